"""Linear solvers: a factor for small systems, multigrid conjugate gradients for large ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import splu

from spindle_fem.errors import ConvergenceError, SpecError
from spindle_fem.model.mesh.kernels import multigrid_loops
from spindle_fem.model.mesh.kernels.team_loops import conjugate_step
from spindle_fem.model.mesh.linear_system import ThermalSystem
from spindle_fem.model.mesh.multigrid import build_hierarchy
from spindle_fem.model.mesh.threads import chunk_bounds, row_blocks, run_blocks, run_team, unsigned

# For a cube: at 2,200 unknowns a factor takes three times as long as multigrid, at 11,000 ten times.
DIRECT_BELOW = 2_000
RELATIVE_TOLERANCE = 1e-11
MAX_ITERATIONS = 400
# A residual this small against the matrix times the solution is round-off: no solver gets below.
ROUND_OFF = 16.0 * np.finfo(float).eps

Method = Literal["direct", "multigrid"]
Operator = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Preconditioner:
    """An approximate inverse of a system, to be passed on to similar ones.

    Attributes
    ----------
    method : {"direct", "multigrid"}
    size : int
        Unknowns, lumped nodes included.
    apply : callable
        Approximate solution of ``A x = r``, (n,) or several columns (n, m);
        symmetric positive definite.
    """

    method: Method
    size: int
    apply: Operator


@dataclass(frozen=True, slots=True)
class LinearSolution:
    """Solution of a linear system.

    Attributes
    ----------
    unknowns : (n,) ndarray
    residual : float, [-]
        2-norm of the true residual relative to the load's; not a number where
        an error tolerance ended the iteration.
    digits : float
        Decades by which the estimated error fell; only where an error
        tolerance ended the iteration.
    """

    unknowns: NDArray[np.float64]
    iterations: int
    residual: float
    digits: float = 0.0


def build_preconditioner(system: ThermalSystem, method: Method | None = None) -> Preconditioner:
    """Factor or multigrid hierarchy of a system without tied nodes.

    Parameters
    ----------
    system : ThermalSystem
        As ``tied()`` returns it.
    method : {"direct", "multigrid"}, optional
        Direct below 2,000 unknowns when not given.
    """
    size = len(system.load) + system.n_lumped
    chosen: Method = method or ("direct" if size < DIRECT_BELOW else "multigrid")
    if chosen == "direct":
        factor = splu(
            sparse.csc_matrix(system.full_matrix()),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return Preconditioner("direct", size, factor.solve)
    if chosen != "multigrid":
        raise SpecError("solver", f"{method!r}.", "Allowed: direct, multigrid.")
    hierarchy = build_hierarchy(system.matrix, system.prolongation)
    return Preconditioner("multigrid", size, with_lumped_nodes(system, hierarchy.cycle))


def with_lumped_nodes(system: ThermalSystem, cycle: Operator) -> Operator:
    """Extend a cycle on the mesh's unknowns by exact elimination of the lumped nodes."""
    if not system.n_lumped:
        return cycle
    n = len(system.load)
    exchange, factor = system.exchange, cho_factor(system.lumped_matrix)

    def apply(residual: NDArray[np.float64]) -> NDArray[np.float64]:
        condensed = residual[:n] + (exchange @ cho_solve(factor, residual[n:])).astype(residual.dtype)
        unknowns = cycle(condensed)
        lumped = cho_solve(factor, residual[n:] + exchange.T @ unknowns)
        return np.concatenate((unknowns, lumped.astype(residual.dtype)))

    return apply


def multiply(matrix: sparse.csr_array, vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """``A x``, shared by threads.

    Parameters
    ----------
    matrix : (n, n) csr_array
    vector : (n,) ndarray
    """
    answer = np.empty(matrix.shape[0])
    rows = (*unsigned(matrix.indptr, matrix.indices), matrix.data)
    run_blocks(multigrid_loops.multiply, row_blocks(len(answer)), *rows, vector, answer)
    return answer


def solve_linear(
    matrix: sparse.csr_array,
    load: NDArray[np.float64],
    preconditioner: Preconditioner,
    guess: NDArray[np.float64] | None = None,
    *,
    relative_tolerance: float = RELATIVE_TOLERANCE,
    error_tolerance: float | None = None,
    reduction: float = 0.0,
    max_iterations: int = MAX_ITERATIONS,
) -> LinearSolution:
    """Preconditioned conjugate gradients, checked on the true residual.

    Ends at the tolerance, or where the residual is round-off of the product
    itself (stiff coefficients).

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric positive definite.
    load : (n,) ndarray
    preconditioner : Preconditioner
        Of this matrix or of a similar one.
    guess : (n,) ndarray, optional
    relative_tolerance : float, [-]
        Of the residual's 2-norm against the load's.
    error_tolerance : float, optional, [K]
        Ends instead where the preconditioned residual, which estimates the
        error, is nowhere larger. The norm of the residual itself would let
        small elements go wrong in short time steps.
    reduction : float, [-]
        With an error tolerance: this share of the guess's own error is enough
        even where it is larger, for use inside an outer iteration.

    Raises
    ------
    ConvergenceError
        The tolerance was not reached.
    SpecError
        The preconditioner has another size.
    """
    if preconditioner.size != len(load):
        raise SpecError(
            "preconditioner",
            f"it has {preconditioner.size} unknowns, the system {len(load)}.",
            "Build it for this mesh and these lumped nodes.",
        )
    unknowns = np.zeros_like(load) if guess is None else np.array(guess, dtype=float)
    residual = load.copy() if guess is None else load - multiply(matrix, unknowns)
    scale = float(np.linalg.norm(load))
    if scale == 0.0:
        scale = float(np.linalg.norm(residual))
    target = relative_tolerance * scale
    if error_tolerance is not None:
        floor = ROUND_OFF * largest(unknowns)
        first = preconditioner.apply(residual).astype(float, copy=False)
        estimate = largest(first)
        wanted = max(error_tolerance, floor, reduction * estimate)
        if estimate <= wanted:
            if estimate > 0.0:
                # as far along it as helps: all of it overshoots where the preconditioner is of another step
                state = _Iteration(matrix, residual)
                state.advance(first)
                unknowns += state.unknowns
            return LinearSolution(unknowns, 0, np.nan)
        correction, iterations, reached = _to_error(
            matrix, residual, preconditioner.apply, first, wanted, max_iterations
        )
        if iterations >= max_iterations:
            raise ConvergenceError(
                "linear solver",
                f"error above {wanted:.1e} after {iterations} iterations.",
                "Rebuild the preconditioner or allow more iterations.",
            )
        digits = float(np.log10(estimate / max(reached, np.finfo(float).tiny)))
        unknowns += correction
        return LinearSolution(unknowns, iterations, np.nan, digits)
    iterations = 0
    restarts = 0
    while (norm := float(np.linalg.norm(residual))) > target:
        if restarts and norm <= ROUND_OFF * float(np.linalg.norm(matrix.diagonal() * unknowns)):
            break
        if iterations >= max_iterations or restarts > 4:
            raise ConvergenceError(
                "linear solver",
                f"residual {norm / scale:.2e} after {iterations} iterations.",
                f"Asked: {target / scale:.1e}. Rebuild the preconditioner or allow more iterations.",
            )
        correction, steps = _conjugate_gradients(
            matrix, residual, preconditioner.apply, target, max_iterations - iterations
        )
        unknowns += correction
        iterations += steps
        restarts += 1
        residual = load - multiply(matrix, unknowns)
    return LinearSolution(unknowns, iterations, norm / scale if scale else 0.0)


def _to_error(
    matrix: sparse.csr_array,
    residual: NDArray[np.float64],
    precondition: Operator,
    first: NDArray[np.float64],
    wanted: float,
    limit: int,
) -> tuple[NDArray[np.float64], int, float]:
    """Correction with an estimated error everywhere below the tolerance, iterations, and that error."""
    state = _Iteration(matrix, residual)
    preconditioned = first
    for iteration in range(1, limit + 1):
        state.advance(preconditioned)
        preconditioned = precondition(state.residual)
        reached = largest(preconditioned)
        if reached <= wanted:
            if reached > 0.0:
                state.advance(preconditioned)
            return state.unknowns, iteration, reached
    return state.unknowns, limit, reached


class _Iteration:
    """Conjugate gradients between two applications of the preconditioner."""

    __slots__ = (
        "_bounds",
        "_energy",
        "_image",
        "_rows",
        "_shares",
        "_step",
        "direction",
        "residual",
        "unknowns",
    )

    def __init__(self, matrix: sparse.csr_array, residual: NDArray[np.float64]) -> None:
        self._rows = (*unsigned(matrix.indptr, matrix.indices), matrix.data)
        self._bounds = chunk_bounds(matrix.indptr)
        self._shares = np.empty((4, len(self._bounds) - 1))
        self.unknowns = np.zeros_like(residual)
        self.residual = residual
        self.direction = np.zeros_like(residual)
        self._image = np.zeros_like(residual)
        self._energy = self._step = 0.0

    def advance(self, preconditioned: NDArray[np.float64]) -> float:
        """Turn, go as far along the new direction as helps; returns the residual's norm."""
        run_team(
            conjugate_step, len(self._bounds) - 1, self._bounds, *self._rows, preconditioned, self.residual,
            self._image, self.direction, self.unknowns, self._step, self._energy, self._shares,
        )  # fmt: skip
        _, self._energy, curvature, square = self._shares.sum(axis=1).tolist()
        if not curvature > 0.0 or not np.isfinite(self._energy):
            raise ConvergenceError("linear solver", f"the matrix is not positive definite ({curvature:.3g}).")
        self._step = self._energy / curvature
        return float(np.sqrt(square))


def _conjugate_gradients(
    matrix: sparse.csr_array,
    load: NDArray[np.float64],
    precondition: Operator,
    target: float,
    limit: int,
) -> tuple[NDArray[np.float64], int]:
    state = _Iteration(matrix, load.copy())
    for iteration in range(1, limit + 1):
        if state.advance(precondition(state.residual).astype(float, copy=False)) <= target:
            return state.unknowns, iteration
    return state.unknowns, limit


def largest(vector: NDArray[np.float64]) -> float:
    """Largest size of a vector's entries, without a vector of sizes."""
    return max(float(vector.max(initial=0.0)), -float(vector.min(initial=0.0)))
