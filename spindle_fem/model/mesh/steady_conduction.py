"""Steady temperature of a conduction problem, with its heat balance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.errors import ConvergenceError, SpecError
from spindle_fem.model.mesh.conduction_problem import (
    ConductionProblem,
    reference_temperature,
    require_surroundings,
)
from spindle_fem.model.mesh.first_guesses import RecentCorrections
from spindle_fem.model.mesh.heat_balance import (
    BALANCE_TOLERANCE,
    LINEAR_BALANCE_TOLERANCE,
    HeatBalance,
    compute_balance,
    require_balance,
    with_law_heat,
)
from spindle_fem.model.mesh.linear_solvers import (
    RELATIVE_TOLERANCE,
    Method,
    Preconditioner,
    build_preconditioner,
    multiply,
    solve_linear,
)
from spindle_fem.model.mesh.linear_system import ThermalSystem
from spindle_fem.model.mesh.renewed_equations import Equations, RenewedEquations
from spindle_fem.model.mesh.temperature_films import law_heat, linearise_films

NONLINEAR_TOLERANCE_K = 1e-6
MAX_NONLINEAR_STEPS = 40
DIVERGED_K = 1e5
# Natural convection has no heat at no difference: start off the ambient.
START_RISE_K = 5.0


@dataclass(frozen=True, slots=True)
class ConductionSolution:
    """Temperatures that satisfy a problem, and how well.

    Attributes
    ----------
    problem : ConductionProblem
        With the coefficients that were used.
    temperature : (n_unknowns,) ndarray, [K]
    lumped_temperature : (m,) ndarray, [K]
        In the order of ``problem.lumped_names``.
    iterations : int
        Of the linear solver, summed over nonlinear iterations.
    residual : float, [-]
    preconditioner : Preconditioner
        To pass on to the next similar problem.
    nonlinear_iterations : int
        0 for a linear problem.
    closing_shift : float, [K]
        Uniform shift that closed the heat balance to round-off: what the
        linear solver left undone, as a temperature.
    """

    problem: ConductionProblem
    temperature: NDArray[np.float64]
    lumped_temperature: NDArray[np.float64]
    balance: HeatBalance
    iterations: int
    residual: float
    preconditioner: Preconditioner
    nonlinear_iterations: int = 0
    closing_shift: float = 0.0

    def lumped(self, name: str) -> float:
        """Temperature of one lumped node, [K]."""
        if name not in self.problem.lumped_names:
            raise SpecError("lumped node", f'"{name}" is none.', f"Allowed: {self.problem.lumped_names}.")
        return float(self.lumped_temperature[self.problem.lumped_names.index(name)])


@dataclass(frozen=True, slots=True)
class SteadySeries:
    """What problems without film laws on one mesh, solved one after the other, leave to the next."""

    equations: RenewedEquations = field(default_factory=RenewedEquations)
    recent: RecentCorrections = field(default_factory=lambda: RecentCorrections(1))


def solve_steady(
    problem: ConductionProblem,
    guess: ConductionSolution | None = None,
    preconditioner: Preconditioner | None = None,
    *,
    method: Method | None = None,
    relative_tolerance: float = RELATIVE_TOLERANCE,
    nonlinear_tolerance: float = NONLINEAR_TOLERANCE_K,
    balance_tolerance: float | None = None,
    series: SteadySeries | None = None,
) -> ConductionSolution:
    """Solve a steady problem; film laws by Newton's method.

    Parameters
    ----------
    guess : ConductionSolution, optional
        Of a similar problem on the same mesh.
    preconditioner : Preconditioner, optional
        Of a similar problem on the same mesh; built when absent.
    method : {"direct", "multigrid"}, optional
        When a preconditioner is built; by size when absent.
    relative_tolerance : float, [-]
        Of the linear residual.
    nonlinear_tolerance : float, [K]
        Largest change of temperature in the last Newton step.
    balance_tolerance : float, optional, [-]
        Largest relative difference of heat in and out; 1e-10 when linear and
        1e-8 with film laws unless given.
    series : SteadySeries, optional
        Of problems that are solved one after the other.

    Raises
    ------
    NoSteadyStateError
        Heat cannot leave some part.
    ConvergenceError, EnergyBalanceError
    """
    require_surroundings(problem)
    if problem.film_laws:
        return _solve_nonlinear(
            problem, guess, preconditioner, method, relative_tolerance, nonlinear_tolerance, balance_tolerance
        )
    own = Equations.of(problem) if series is None else series.equations.of(problem)
    system, matrix, load = own.system, own.matrix, own.tied.full_load()
    if preconditioner is None:
        preconditioner = build_preconditioner(own.tied, method)
    start = None if guess is None else _start_values(system, guess)
    near = start
    if series is not None and start is not None:
        near = start + series.recent.combine(load - multiply(matrix, start), 1.0)
    solution = solve_linear(matrix, load, preconditioner, near, relative_tolerance=relative_tolerance)
    if series is not None and start is not None and solution.iterations:
        series.recent.add(solution.unknowns - start, matrix)
    unknowns = close_balance(matrix, load, solution.unknowns)
    rise, lumped_rise = split_unknowns(unknowns, system.n_lumped, system.tie)
    # Row sums of a stiff matrix are rounded; the films alone say what is still missing.
    first = compute_balance(problem, system, rise, lumped_rise)
    missing = first.imbalance / _surroundings_conductance(problem)
    rise, lumped_rise = rise + missing, lumped_rise + missing
    closing_shift = float(unknowns[0] - solution.unknowns[0] + missing)
    balance = compute_balance(problem, system, rise, lumped_rise)
    require_balance(balance, LINEAR_BALANCE_TOLERANCE if balance_tolerance is None else balance_tolerance)
    return ConductionSolution(
        problem,
        _frozen(rise + system.reference_temperature),
        _frozen(lumped_rise + system.reference_temperature),
        balance,
        solution.iterations,
        solution.residual,
        preconditioner,
        closing_shift=closing_shift,
    )


def _solve_nonlinear(
    problem: ConductionProblem,
    guess: ConductionSolution | None,
    preconditioner: Preconditioner | None,
    method: Method | None,
    relative_tolerance: float,
    nonlinear_tolerance: float,
    balance_tolerance: float | None,
) -> ConductionSolution:
    if guess is None:
        temperature = np.full(problem.operators.n_unknowns, reference_temperature(problem) + START_RISE_K)
    else:
        temperature = guess.temperature
    solution, iterations = guess, 0
    for step in range(1, MAX_NONLINEAR_STEPS + 1):
        linear = linearise_films(problem, temperature)
        solution = solve_steady(
            linear,
            solution,
            preconditioner,
            method=method,
            relative_tolerance=relative_tolerance,
            balance_tolerance=BALANCE_TOLERANCE,
        )
        preconditioner = solution.preconditioner
        iterations += solution.iterations
        change = float(np.abs(solution.temperature - temperature).max())
        temperature = solution.temperature
        if change > DIVERGED_K:
            break
        if change <= nonlinear_tolerance:
            balance = with_law_heat(solution.balance, law_heat(problem, temperature))
            require_balance(balance, BALANCE_TOLERANCE if balance_tolerance is None else balance_tolerance)
            return replace(
                solution, problem=problem, balance=balance, iterations=iterations, nonlinear_iterations=step
            )
    raise ConvergenceError(
        "film laws",
        f"temperatures still change by {change:.3g} K after {step} Newton steps.",
        f"Asked: {nonlinear_tolerance:g} K. Check that each film's heat rises with temperature.",
    )


def close_balance(
    matrix: sparse.csr_array,
    load: NDArray[np.float64],
    unknowns: NDArray[np.float64],
    row_sums: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Galerkin correction by a constant: what is left of the residual sums to zero.

    The sum of all equations is the heat balance, so one uniform shift (far
    below the solver's tolerance) closes it to round-off.
    """
    sums = matrix @ np.ones_like(load) if row_sums is None else row_sums
    # the matrix is symmetric, so its row sums are its column sums
    return unknowns + (float(np.sum(load)) - float(sums @ unknowns)) / float(np.sum(sums))


def _surroundings_conductance(problem: ConductionProblem) -> float:
    """Heat to the surroundings of the whole machine warmed by one kelvin, W/K."""
    operators = problem.operators
    films = sum(
        float(
            operators.per_facet(film.surface, film.coefficient, film.label)
            @ operators.facet_areas(film.surface)
        )
        for film in problem.films
    )
    return films + sum(link.conductance for link in problem.lumped_links if link.other is None)


def split_unknowns(
    unknowns: NDArray[np.float64], n_lumped: int, tie: sparse.csr_array | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rises of the mesh's unknowns and of the lumped nodes, ties undone."""
    n = len(unknowns) - n_lumped
    return (unknowns[:n] if tie is None else tie @ unknowns[:n]), unknowns[n:]


def _start_values(system: ThermalSystem, guess: ConductionSolution) -> NDArray[np.float64]:
    if len(guess.temperature) != len(system.load) or len(guess.lumped_temperature) != system.n_lumped:
        raise SpecError("guess", "it belongs to another mesh or other lumped nodes.")
    rise = guess.temperature - system.reference_temperature
    if system.tie is not None:
        rise = (system.tie.T @ rise) / system.tie.sum(axis=0)
    return np.concatenate((rise, guess.lumped_temperature - system.reference_temperature))


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.setflags(write=False)
    return array
