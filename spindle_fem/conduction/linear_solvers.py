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

from spindle_fem.conduction.multigrid import build_hierarchy
from spindle_fem.conduction.system import ThermalSystem
from spindle_fem.errors import ConvergenceError, SpecError

DIRECT_BELOW = 20_000
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
        Approximate solution of ``A x = r``; symmetric positive definite.
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
    iterations : int
    residual : float, [-]
        2-norm of the true residual relative to the load's; not a number where
        an error tolerance ended the iteration.
    """

    unknowns: NDArray[np.float64]
    iterations: int
    residual: float


def build_preconditioner(system: ThermalSystem, method: Method | None = None) -> Preconditioner:
    """Factor or multigrid hierarchy of a system without tied nodes.

    Parameters
    ----------
    system : ThermalSystem
        As ``tied()`` returns it.
    method : {"direct", "multigrid"}, optional
        Direct below 20,000 unknowns when not given.
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
        condensed = residual[:n] + exchange @ cho_solve(factor, residual[n:])
        unknowns = cycle(condensed)
        return np.concatenate((unknowns, cho_solve(factor, residual[n:] + exchange.T @ unknowns)))

    return apply


def solve_linear(
    matrix: sparse.csr_array,
    load: NDArray[np.float64],
    preconditioner: Preconditioner,
    guess: NDArray[np.float64] | None = None,
    *,
    relative_tolerance: float = RELATIVE_TOLERANCE,
    error_tolerance: float | None = None,
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
    max_iterations : int

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
    residual = load - matrix @ unknowns
    scale = float(np.linalg.norm(load))
    if scale == 0.0:
        scale = float(np.linalg.norm(residual))
    target = relative_tolerance * scale
    if error_tolerance is not None:
        floor = ROUND_OFF * float(np.abs(unknowns).max(initial=0.0))
        correction, iterations = _conjugate_gradients(
            matrix, residual, preconditioner.apply, 0.0, max_iterations, max(error_tolerance, floor)
        )
        if iterations >= max_iterations:
            raise ConvergenceError(
                "linear solver",
                f"error above {error_tolerance:.1e} after {iterations} iterations.",
                "Rebuild the preconditioner or allow more iterations.",
            )
        return LinearSolution(unknowns + correction, iterations, np.nan)
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
        residual = load - matrix @ unknowns
    return LinearSolution(unknowns, iterations, norm / scale if scale else 0.0)


def _conjugate_gradients(
    matrix: sparse.csr_array,
    load: NDArray[np.float64],
    precondition: Operator,
    target: float,
    limit: int,
    error_target: float = 0.0,
) -> tuple[NDArray[np.float64], int]:
    unknowns = np.zeros_like(load)
    residual = load.copy()
    direction = precondition(residual).astype(float)
    if float(np.abs(direction).max(initial=0.0)) <= error_target:
        return direction if error_target else unknowns, 0
    energy = float(residual @ direction)
    for iteration in range(1, limit + 1):
        image = matrix @ direction
        curvature = float(direction @ image)
        if not curvature > 0.0 or not np.isfinite(energy):
            raise ConvergenceError("linear solver", f"the matrix is not positive definite ({curvature:.3g}).")
        step = energy / curvature
        unknowns += step * direction
        residual -= step * image
        if np.linalg.norm(residual) <= target:
            return unknowns, iteration
        preconditioned = precondition(residual)
        if float(np.abs(preconditioned).max()) <= error_target:
            return unknowns + preconditioned, iteration
        # Polak-Ribière: stays conjugate although single precision makes the cycle slightly nonlinear
        direction *= -step * float(preconditioned @ image) / energy
        direction += preconditioned
        energy = float(residual @ preconditioned)
    return unknowns, limit
