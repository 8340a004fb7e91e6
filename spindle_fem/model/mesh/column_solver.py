"""Conjugate gradients for several right-hand sides at once: each entry of a matrix is read once for all."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.errors import ConvergenceError
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import column_loops
from spindle_fem.model.mesh.kernels.row_sums import LANES
from spindle_fem.model.mesh.linear_solvers import MAX_ITERATIONS, Operator, Preconditioner
from spindle_fem.model.mesh.threads import row_blocks, run_blocks, unsigned

# Right-hand sides iterated together: a product with so many takes twice as long as with one.
COLUMNS_AT_ONCE = 24

Array = NDArray[np.floating]
# Product of a matrix with columns, written to the second argument.
Product = Callable[[Array, Array], object]
# Product for the columns that are still iterated, whose numbers are the third argument.
ActiveProduct = Callable[[Array, Array, NDArray[np.int64]], object]


def solve_many(
    matrix: sparse.csr_array,
    loads: NDArray[np.float64],
    preconditioner: Preconditioner,
    guesses: NDArray[np.float64] | None = None,
    *,
    relative_tolerance: float,
    max_iterations: int = MAX_ITERATIONS,
) -> NDArray[np.float64]:
    """Several right-hand sides at once by conjugate gradients, each on its own.

    A column ends when its error in the energy norm, estimated as ``√(rᵀ B r)``
    with the preconditioner B, is a given share of the norm of its solution.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric positive definite.
    loads : (n, m) ndarray
    preconditioner : Preconditioner
        Of this matrix or of a similar one.
    guesses : (n, m) ndarray, optional
        Galerkin solutions in some space (their energy is taken for their
        share of the solution's).
    relative_tolerance : float, [-]

    Returns
    -------
    (n, m) ndarray

    Raises
    ------
    ConvergenceError
        The tolerance was not reached.
    """
    solved = np.zeros_like(loads) if guesses is None else np.array(guesses, dtype=float)
    product = product_of(matrix)
    columns = np.arange(loads.shape[1])
    for first in range(0, len(columns), COLUMNS_AT_ONCE):
        own = _filled(columns[first : first + COLUMNS_AT_ONCE])
        block = np.ascontiguousarray(solved[:, own])
        residual = np.empty_like(block)
        product(block, residual)
        np.subtract(loads[:, own], residual, out=residual)
        known = np.abs(dots(np.ascontiguousarray(loads[:, own]), block))
        direction = np.ascontiguousarray(preconditioner.apply(residual))  # a factor's columns lie apart
        target = relative_tolerance**2 * (known + dots(residual, direction))
        solved[:, own] = block + corrections(
            lambda vectors, out, _: product(vectors, out),
            residual,
            direction,
            preconditioner.apply,
            target,
            max_iterations,
        )
    return solved


def _filled(columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of columns, some of them more than once: as many as fill vector registers."""
    return np.resize(columns, -(-len(columns) // LANES) * LANES)


def product_of(matrix: sparse.csr_array) -> Product:
    """Products with a matrix, shared by threads."""
    rows = (*unsigned(matrix.indptr, matrix.indices), matrix.data)
    blocks = row_blocks(matrix.shape[0])

    def product(vectors: Array, out: Array) -> None:
        run_blocks(column_loops.multiply_columns, blocks, *rows, vectors, out)

    return product


def dots(first: Array, second: Array) -> NDArray[np.float64]:
    """Scalar product of each pair of columns, (m,)."""
    return sum(run_blocks(column_loops.dot_columns, row_blocks(len(first)), first, second))


def corrections(
    product: ActiveProduct,
    residual: Array,
    direction: Array,
    precondition: Operator,
    target: NDArray[np.float64],
    limit: int = MAX_ITERATIONS,
) -> Array:
    """Solutions for residuals (n, m), which are overwritten; columns that have converged leave.

    Parameters
    ----------
    residual : (n, m) ndarray
        Of single or double precision, as all vectors of the iteration.
    direction : (n, m) ndarray
        The preconditioned residual, overwritten too.
    target : (m,) ndarray
        Square of each column's error in the energy norm at which it ends.

    Raises
    ------
    ConvergenceError
        The target was not reached.
    """
    kind, blocks = residual.dtype, row_blocks(len(residual))
    found = np.zeros_like(residual)
    active = np.arange(residual.shape[1])
    unknowns = np.zeros_like(residual)
    energy = dots(residual, direction)
    for _ in range(limit + 1):
        going = np.flatnonzero(energy > target)
        if len(going) < len(active):
            found[:, active] = unknowns
            if not len(going):
                return found
            kept = _filled(going[np.unique(active[going], return_index=True)[1]])
            active, energy, target = active[kept], energy[kept], target[kept]
            residual, direction, unknowns = (
                np.ascontiguousarray(item[:, kept]) for item in (residual, direction, unknowns)
            )
        image = room(residual.shape, kind)
        product(direction, image, active)
        curvature = dots(direction, image)
        if not np.all(curvature > 0.0):
            raise ConvergenceError(
                "linear solver", f"the matrix is not positive definite ({curvature.min():.3g})."
            )
        step = energy / curvature
        vectors = (direction, image, unknowns, residual)
        run_blocks(column_loops.advance_columns, blocks, step.astype(kind), *vectors)
        preconditioned = precondition(residual)
        factor = -step * dots(preconditioned, image) / energy
        run_blocks(column_loops.turn_columns, blocks, factor.astype(kind), preconditioned, direction)
        energy = dots(residual, preconditioned)
    share = np.sqrt(energy / target).max()
    raise ConvergenceError(
        "linear solver",
        f"error still {share:.1e} times what was asked after {limit} iterations.",
        "Allow more iterations.",
    )
