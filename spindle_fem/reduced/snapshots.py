"""Full solutions that span the reduced space, and the space itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from spindle_fem.conduction.linear_solvers import build_preconditioner, solve_linear
from spindle_fem.reduced.affine import AffineSystem

Array = NDArray[np.float64]

# Of the residual; a field of tens of kelvin is then right to some 1e-5 K.
SOLVER_TOLERANCE = 1e-8


@dataclass(frozen=True, slots=True)
class Sample:
    """One set of coefficients to solve at.

    Attributes
    ----------
    coefficients : mapping of str to float
    channel_film : (n_cells,) ndarray, [W/(m²·K)]
    capacities : mapping of str to float
    """

    coefficients: dict[str, float]
    channel_film: Array
    capacities: dict[str, float]


def solve_shifted(
    affine: AffineSystem, sample: Sample, shift: float, loads: Array, known: Array | None = None
) -> Array:
    """``(K + s M)⁻¹ F`` column by column.

    Parameters
    ----------
    affine : AffineSystem
    sample : Sample
    shift : float, [1/s]
    loads : (n, m) ndarray, [W]
    known : (n, k) ndarray, optional
        Independent fields from which the first guesses are combined.

    Returns
    -------
    (n, m) ndarray, [K]
    """
    matrix = affine.conduction(sample.coefficients, sample.channel_film)
    if shift > 0.0:
        matrix = matrix + shift * affine.capacity(sample.capacities)
    matrix = matrix.tocsr()
    guesses = np.zeros_like(loads)
    if known is not None:
        guesses = known @ np.linalg.solve(known.T @ (matrix @ known), known.T @ loads)
    preconditioner = build_preconditioner(affine.system(matrix))
    solved = np.empty_like(loads)
    for column in range(loads.shape[1]):
        solved[:, column] = solve_linear(
            matrix,
            loads[:, column],
            preconditioner,
            guesses[:, column],
            relative_tolerance=SOLVER_TOLERANCE,
        ).unknowns
    return solved


def compress(
    snapshots: Array, energy: sparse.csr_array, tolerance: float, largest: int, keep: Array
) -> Array:
    """Energy-orthonormal basis of snapshots by proper orthogonal decomposition.

    Parameters
    ----------
    snapshots : (n, m) ndarray
        Each scaled to the size at which it occurs.
    energy : (n, n) csr_array
        Symmetric positive definite inner product.
    tolerance : float, [-]
        Singular values below this share of the largest are dropped.
    largest : int
        Vectors at most.
    keep : (n, q) ndarray
        Vectors that the basis must hold exactly.

    Returns
    -------
    (n, r) ndarray
    """
    fixed = orthonormalise(keep, energy)
    rest = snapshots - fixed @ (fixed.T @ (energy @ snapshots))
    gram = rest.T @ (energy @ rest)
    values, vectors = eigh(0.5 * (gram + gram.T))
    order = np.argsort(values)[::-1]
    values, vectors = values[order], vectors[:, order]
    number = int(np.count_nonzero(np.sqrt(np.maximum(values, 0.0)) > tolerance * np.sqrt(values[0])))
    number = min(number, largest - fixed.shape[1])
    modes = rest @ (vectors[:, :number] / np.sqrt(values[:number]))
    # Once more: the smallest modes have lost orthogonality to round-off.
    return orthonormalise(np.hstack((fixed, modes)), energy)


def orthonormalise(vectors: Array, energy: sparse.csr_array) -> Array:
    """Columns made orthonormal in the energy product, twice by Cholesky."""
    for _ in range(2):
        gram = vectors.T @ (energy @ vectors)
        factor = np.linalg.cholesky(0.5 * (gram + gram.T))
        vectors = np.linalg.solve(factor, vectors.T).T
    return vectors


def helix_profiles(n_starts: int, n_along: int, degree: int) -> Array:
    """Bulk temperature shapes along each start, Legendre polynomials, (n_cells, m)."""
    along = (np.arange(n_along) + 0.5) / n_along * 2.0 - 1.0
    shapes = np.polynomial.legendre.legvander(along, degree)
    profiles = np.zeros((n_starts * n_along, n_starts * (degree + 1)))
    for start in range(n_starts):
        rows = slice(start * n_along, (start + 1) * n_along)
        profiles[rows, start * (degree + 1) : (start + 1) * (degree + 1)] = shapes
    return profiles


def load_columns(affine: AffineSystem, places: Sequence[str]) -> Array:
    """Load of 1 W on each of some places, (n, m)."""
    rows = [affine.place_names.index(name) for name in places]
    return affine.places[rows].toarray().T
