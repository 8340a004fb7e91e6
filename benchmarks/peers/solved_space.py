"""First guesses from all earlier solutions of one matrix, for many implicit steps of one length."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import FAST
from spindle_fem.model.mesh.kernels.team_loops import CLAIMED, DONE, count_up, wait
from spindle_fem.model.mesh.linear_solvers import multiply
from spindle_fem.model.mesh.threads import chunk_bounds, run_team

# Solutions that are kept as a basis.
BASIS_SIZE = 60
# A part this small of a solution, in energy, is round-off of what is known.
NOTHING_NEW = 1e-12


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
        """Add the new part of a solution, (n,); its guess from here, if given, shows which part is known."""
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
        n_chunks = len(self._bounds) - 1
        parts = np.empty((n_chunks, self._count))
        run_team(project, n_chunks, self._bounds, self._basis, self._count, load, factor, parts, out)
        return parts.sum(axis=0)


@njit(**FAST)
def project(is_first, counters, bounds, basis, count, vector, factor, parts, out):
    """``out += factor Σ (v · x) v`` over the first rows v of a basis (size, n), in single precision.

    ``parts``, (n_chunks, size), gets what each chunk adds to ``v · x``.
    """
    n_chunks = bounds.size - 1
    while True:
        ticket = count_up(counters, CLAIMED)
        if ticket >= 2 * n_chunks:
            break
        number, chunk = ticket // n_chunks, ticket % n_chunks
        wait(counters, number * n_chunks)
        low, high = bounds[chunk], bounds[chunk + 1]
        if number == 0:
            _dots_with_rows(low, high, basis, count, vector, parts[chunk])
        else:
            _add_rows(low, high, basis, count, factor, parts, out)
        count_up(counters, DONE)
    if is_first:
        wait(counters, 2 * n_chunks)


@njit(**FAST)
def _dots_with_rows(low, high, basis, count, vector, parts):
    own = np.empty(high - low, dtype=basis.dtype)
    for i in range(low, high):
        own[i - low] = vector[i]
    for k in range(count):
        total = basis.dtype.type(0.0)
        row = basis[k, low:high]
        for i in range(own.size):
            total += row[i] * own[i]
        parts[k] = total


@njit(**FAST)
def _add_rows(low, high, basis, count, factor, parts, out):
    own = np.zeros(high - low, dtype=basis.dtype)
    for k in range(count):
        share = basis.dtype.type(factor * parts[:, k].sum())
        row = basis[k, low:high]
        for i in range(own.size):
            own[i] += share * row[i]
    for i in range(low, high):
        out[i] += own[i - low]
