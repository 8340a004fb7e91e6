"""First guesses of linear systems and of fixed points, from those solved before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.linear_solvers import multiply
from spindle_fem.model.mesh.threads import chunk_bounds, run_team, use_compiled

# Earlier iterates that are mixed into the next.
EARLIER_ITERATES = 2
# Corrections from which first guesses are combined.
CORRECTIONS = 8
# Solutions of one matrix that are kept as a basis.
BASIS_SIZE = 60
# A part this small of a solution, in energy, is round-off of what is known.
NOTHING_NEW = 1e-12


class RecentCorrections:
    """Recent corrections of stages: the next one is nearly a combination of them.

    What they store and conduct together is kept too, and used on when a film has
    changed a little: they only make first guesses.
    """

    def __init__(self) -> None:
        self._fields: NDArray[np.float64] | None = None
        self._count = 0
        self._stored = np.zeros((CORRECTIONS, CORRECTIONS))
        self._conducted = np.zeros((CORRECTIONS, CORRECTIONS))

    def add(
        self, correction: NDArray[np.float64], storage: sparse.csr_array, conduction: sparse.csr_array
    ) -> None:
        """Remember a correction that is not zero, (n,) [K]; the oldest is forgotten."""
        if self._fields is None:
            self._fields = np.zeros((CORRECTIONS, len(correction)))
        place = self._count % CORRECTIONS
        self._count += 1
        scaled = correction / np.abs(correction).max()
        self._fields[place] = scaled
        for table, matrix in ((self._stored, storage), (self._conducted, conduction)):
            table[place] = table[:, place] = self._fields @ (matrix @ scaled)

    def combine(self, residual: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
        """Galerkin solution of ``(M + shift K) x = residual`` among the recent corrections."""
        size = min(self._count, CORRECTIONS)
        if not size:
            return np.zeros_like(residual)
        fields = self._fields[:size]
        projected = self._stored[:size, :size] + shift * self._conducted[:size, :size]
        return np.linalg.lstsq(projected, fields @ residual, rcond=1e-9)[0] @ fields


class SolvedSpace:
    """Earlier solutions of one symmetric positive definite matrix, orthonormal in its energy.

    The best guess among them then costs two products with the basis and none
    with the matrix. The oldest are forgotten. Single precision halves what is
    read: guesses need no more.

    Parameters
    ----------
    matrix : (n, n) csr_array
    size : int
        Solutions that are kept.

    Source: Fischer (1998), Comput. Methods Appl. Mech. Eng. 163, 193-204.
    """

    def __init__(self, matrix: sparse.csr_array, size: int = BASIS_SIZE) -> None:
        self._matrix = matrix
        self._basis = room((size, matrix.shape[0]), np.float32)
        self._bounds = chunk_bounds(matrix.indptr)
        self._count = self._added = 0

    def guess(self, load: NDArray[np.float64]) -> NDArray[np.float64]:
        """Galerkin solution among what is kept, (n,)."""
        answer = np.zeros(len(load))
        self._add_known(load, 1.0, answer)
        return answer

    def add(self, solution: NDArray[np.float64], guess: NDArray[np.float64] | None = None) -> None:
        """Keep what is new in a solution, (n,); its guess from here, when given, tells what is not."""
        place = self._added % len(self._basis)
        # the oldest goes first: what the new one has of it is to stay
        self._basis[place] = 0.0
        # while nothing is forgotten, what the guess left is all that is new
        rest = solution if guess is None or self._count == len(self._basis) else solution - guess
        rest = rest / (float(np.abs(rest).max(initial=0.0)) or 1.0)
        whole = None
        for _ in range(2):
            image = multiply(self._matrix, rest)
            energy = float(rest @ image)
            whole = energy if whole is None else whole
            shares = self._add_known(image, -1.0, rest)
            left = energy - float(shares @ shares)
            # once is enough where little of it was known: round-off of that is small
            if left > 0.5 * energy:
                break
        if not left > NOTHING_NEW * whole:
            return
        self._basis[place] = rest / np.sqrt(left)
        self._added += 1
        self._count = min(self._added, len(self._basis))

    def _add_known(
        self, load: NDArray[np.float64], factor: float, out: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Add the Galerkin solution times a factor in place; returns its shares of the basis."""
        if not self._count:
            return np.zeros(0)
        if not use_compiled(len(load)):
            known = self._basis[: self._count]
            shares = known @ load.astype(np.float32)
            out += factor * (shares @ known)
            return shares
        from spindle_fem.model.mesh.kernels.team_loops import project

        n_chunks = len(self._bounds) - 1
        parts = np.empty((n_chunks, self._count))
        run_team(project, n_chunks, self._bounds, self._basis, self._count, load, factor, parts, out)
        return parts.sum(axis=0)


def mixed(past: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> NDArray[np.float64]:
    """Anderson mixing: the combination of past iterates whose defects cancel best.

    Parameters
    ----------
    past : list of ((n,) ndarray, (n,) ndarray)
        Answers of a fixed-point map and their distance from what was put in, latest last.

    Source: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735.

    >>> linear = lambda x: np.array([0.5, 0.2]) * x + 1.0
    >>> put = [np.zeros(2), np.ones(2), np.array([1.5, 1.2])]
    >>> mixed([(linear(x), linear(x) - x) for x in put]).round(9).tolist()
    [2.0, 1.25]
    """
    answer, defect = past[-1]
    if len(past) == 1:
        return answer
    turns = np.array([defect - other for _, other in past[:-1]])
    weights = np.linalg.lstsq(turns @ turns.T, turns @ defect, rcond=1e-10)[0]
    return answer - sum(
        weight * (answer - other) for weight, (other, _) in zip(weights, past[:-1], strict=True)
    )
