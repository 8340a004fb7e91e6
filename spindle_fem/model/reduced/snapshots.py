"""Full solutions that span the reduced space, and the space itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from spindle_fem.model.mesh.column_solver import solve_many
from spindle_fem.model.mesh.linear_solvers import build_preconditioner
from spindle_fem.model.reduced.mesh_model import MeshModel

Array = NDArray[np.float64]

# Relative to a solution's norm in energy: a field of tens of kelvin is then right to some 1e-4 K.
# Tighter ones changed no checked error in its third digit.
SOLVER_TOLERANCE = 3e-5
# Directions below this share of what the basis drops are dropped at once.
KEPT_SHARE = 0.3
# Rest after projecting twice a solution that is already in the basis, relative.
ROUND_OFF = 1e-11


@dataclass(frozen=True, slots=True)
class Sample:
    """One set of coefficients to solve at.

    Attributes
    ----------
    coefficients : mapping of str to float
    channel_film : (n_cells,) ndarray, [W/(m²·K)]
    capacities : mapping of str to float
        Not needed for steady solutions.
    """

    coefficients: dict[str, float]
    channel_film: Array
    capacities: dict[str, float]


@dataclass(frozen=True, slots=True)
class ShiftedSystem:
    """``K + s M`` of one sample, and what is known of its solutions.

    Attributes
    ----------
    shift : float, [1/s]
    matrix : (n, n) csr_array
    known : (n, k) ndarray
        Independent fields from which first guesses are combined.
    projected : (k, k) ndarray
        The matrix on them.
    tolerance : float
        Of each solution, relative to its norm in energy.
    """

    shift: float
    matrix: sparse.csr_array
    known: Array
    projected: Array
    full: MeshModel
    tolerance: float = SOLVER_TOLERANCE

    def solve(self, loads: Array) -> Array:
        """``(K + s M)⁻¹ F``, (n, m) [K], from loads (n, m) [W]."""
        guesses = None
        if self.known.shape[1]:
            guesses = self.known @ np.linalg.solve(self.projected, self.known.T @ loads)
        return self._iterate(loads, guesses, self.tolerance)

    def correct(self, loads: Array, solutions: Array, relative_tolerance: float) -> Array:
        """Correction of approximate solutions, to a relative tolerance of itself, (n, m) [K]."""
        return self._iterate(loads - self.matrix @ solutions, None, relative_tolerance)

    def _iterate(self, loads: Array, guesses: Array | None, relative_tolerance: float) -> Array:
        preconditioner = build_preconditioner(self.full.system(self.matrix))
        return solve_many(self.matrix, loads, preconditioner, guesses, relative_tolerance=relative_tolerance)


def shifted_systems(
    full: MeshModel,
    sample: Sample,
    shifts: Sequence[float],
    known: Array | None = None,
    tolerance: float = SOLVER_TOLERANCE,
) -> Iterator[ShiftedSystem]:
    """Systems of one sample at several Laplace frequencies.

    Parameters
    ----------
    shifts : sequence of float, [1/s]
    known : (n, k) ndarray, optional
    tolerance : float
        As :class:`ShiftedSystem` has them.
    """
    conduction = full.conduction(sample.coefficients, sample.channel_film)
    capacity = full.capacity(sample.capacities) if any(shifts) else sparse.csr_array(conduction.shape)
    fields = np.zeros((full.size, 0)) if known is None else known
    parts = [fields.T @ (matrix @ fields) for matrix in (conduction, capacity)]
    for shift in shifts:
        matrix = conduction + shift * capacity if shift > 0.0 else conduction
        yield ShiftedSystem(shift, matrix.tocsr(), fields, parts[0] + shift * parts[1], full, tolerance)


class SnapshotSpace:
    """Solutions gathered so far, in an energy-orthonormal basis that grows with them.

    Parameters
    ----------
    energy : (n, n) csr_array
        Symmetric positive definite inner product.
    keep : (n, q) ndarray
        Vectors that every basis must hold exactly.
    tolerance : float, [-]
        Singular values below this share of the largest are not wanted.
    """

    def __init__(self, energy: sparse.csr_array, keep: Array, tolerance: float) -> None:
        self._energy = energy
        self._tolerance = tolerance
        self._directions = orthonormalise(keep, energy)
        self._kept = keep.shape[1]
        self._coordinates = np.zeros((self._kept, 0))

    def add(self, snapshots: Array) -> None:
        """Let solutions join, (n, m), each scaled to the size at which it occurs."""
        coordinates = self._directions.T @ (self._energy @ snapshots)
        rest = snapshots - self._directions @ coordinates
        image = self._energy @ rest
        gram = rest.T @ image
        values, vectors = eigh(0.5 * (gram + gram.T))
        size = max(np.sum(block[self._kept :] ** 2) for block in (self._coordinates, coordinates))
        wanted = (KEPT_SHARE * self._tolerance) ** 2 * (size + values.clip(min=0.0).sum())
        chosen = values > max(wanted, ROUND_OFF**2 * np.sum(coordinates**2))
        turn = vectors[:, chosen] / np.sqrt(values[chosen])
        fresh, image = rest @ turn, image @ turn
        # Once more: the smallest directions have lost orthogonality to round-off.
        fresh -= self._directions @ (self._directions.T @ image)
        fresh = orthonormalise(fresh, self._energy)
        added = turn.T @ gram if chosen.any() else np.zeros((0, snapshots.shape[1]))
        old = np.vstack((self._coordinates, np.zeros((fresh.shape[1], self._coordinates.shape[1]))))
        self._coordinates = np.hstack((old, np.vstack((coordinates, added))))
        self._directions = np.hstack((self._directions, fresh))

    def basis(self, largest: int, tolerance: float | None = None) -> Array:
        """Proper orthogonal decomposition, (n, r), what must be held first.

        Parameters
        ----------
        largest : int
            Vectors at most.
        tolerance : float, optional
            Singular values below this share of the largest are dropped; that
            of the space when None.
        """
        kept, rest = self._directions[:, : self._kept], self._directions[:, self._kept :]
        vectors, values, _ = np.linalg.svd(self._coordinates[self._kept :], full_matrices=False)
        wanted = np.count_nonzero(values > (tolerance or self._tolerance) * values.max(initial=0.0))
        return np.hstack((kept, rest @ vectors[:, : min(int(wanted), largest - self._kept)]))


def orthonormalise(vectors: Array, energy: sparse.csr_array) -> Array:
    """Columns made orthonormal in the energy product, twice by Cholesky."""
    for _ in range(2):
        gram = vectors.T @ (energy @ vectors)
        factor = np.linalg.cholesky(0.5 * (gram + gram.T))
        vectors = np.linalg.solve(factor, vectors.T).T
    return vectors
