"""A solved machine: heat, films, coolant and temperature made to agree."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, NoSteadyStateError, SpindleFemError
from spindle_fem.model.mesh.linear_solvers import RELATIVE_TOLERANCE
from spindle_fem.model.mesh.steady_conduction import ConductionSolution, SteadySeries, solve_steady
from spindle_fem.operation.circuits import capacity_rate
from spindle_fem.operation.coolant_loop import CoolantState
from spindle_fem.operation.loads import NO_CHANGE, LoadChange, Loads
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.fixed_point import REFUSED, Iteration, fixed_point
from spindle_fem.solvers.preload_runaway import (
    HeatResponse,
    beyond_the_branch,
    equilibria_above,
    no_equilibrium,
)
from spindle_fem.solvers.prepared_machine import PreparedMachine, without_expansion

# The coolant's energy closes to 1e-8 only when the wall is known to about 1e-7 K.
FIELD_TOLERANCE = 1.0e-8
HEAT_TOLERANCE = 1.0e-7
COOLANT_TOLERANCE = 2.0e-9
# W; what round-off leaves of the heat of films, and all of it where everything is equally warm.
ROUNDED_HEAT = 1.0e-6
MAXIMUM_ITERATIONS = 100
# Near the fold of the reference spindle 17 are enough.
QUICK_ITERATIONS = 25
RELAXATION = 0.3
ANDERSON_DEPTH = 6
# Greases and seals are gone long before; a field beyond this is running away.
RUNAWAY_TEMPERATURE = 600.0
# How far cold grease may heat a machine in one step, K: it rubs so much more than warm grease that its heat
# says nothing of where the machine settles.
WARM_GREASE = (363.15, 423.15)
MIXING_BELOW = 0.5
# K; expansion moves a state without it by more, so that knowing it nearer saves nothing.
FIRST_STATE = 1.0
MAXIMUM_RETREATS = 10
# Share of the requested speed at which films are first evaluated when the fold is searched below it.
SLOW_RUNNING = 0.3
# Shares of the speed reached by a search at which films and contacts are updated for the next.
FOLD_APPROACHES = (0.9, 0.97, 0.97)
FOLD_TOLERANCE = 0.01
# A linear residual this small against the last change of the field costs no extra iteration of the loop.
LINEAR_PER_KELVIN = 1.0e-4
LOOSEST_LINEAR_TOLERANCE = 1.0e-3
#: Relative residual that a coupled solution may leave of its linear equations.
LINEAR_RESIDUAL_LIMIT = 1.0e-9

Beyond = Callable[[OperatingPoint, NDArray[np.float64], Mapping[str, float]], LoadChange]


@dataclass(frozen=True, slots=True)
class CoupledState:
    """A converged fixed point: field, the loads that made it, and the coolant."""

    solution: ConductionSolution
    loads: Loads
    coolant: CoolantState | None
    iterations: int
    change: float


def solve_coupled(
    machine: PreparedMachine,
    point: OperatingPoint,
    start: NDArray[np.float64] | None = None,
    *,
    beyond: Beyond | None = None,
) -> CoupledState:
    """Steady field at which heat, films and coolant are those of the field itself.

    A fixed-point iteration with Anderson mixing over the whole field; the map
    is nearly affine, so the mixing finds the fixed point in a few solves even
    where friction heat falls steeply with temperature. Where expansion changes
    the preload, it begins from the state without expansion.

    Parameters
    ----------
    start : (n_unknowns,) ndarray, optional, [K]
    beyond : callable, optional
        Point, field and lumped temperatures to what physics beyond the
        machine's own does to its loads.

    Raises
    ------
    NoSteadyStateError
        The temperatures run away.
    ConvergenceError
        No fixed point within the iterations.

    Source: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735 (mixing).
    """
    try:
        return _settle(machine, point, start, beyond)
    except (NoSteadyStateError, ConvergenceError) as error:
        if not machine.spec.follows_preload:
            raise
        raise _beyond_the_fold(machine, point, error, beyond) from error


def _settle(
    machine: PreparedMachine,
    point: OperatingPoint,
    start: NDArray[np.float64] | None,
    beyond: Beyond | None,
    enough: float = 0.0,
) -> CoupledState:
    """The fixed point, or with ``enough`` a field that its own loads move by less than that, K."""
    follows, first = machine.spec.follows_preload, None
    # Cold grease makes more heat than the machine will ever see: its states are left half the way back.
    retreats = 0 if follows else MAXIMUM_RETREATS
    if follows and start is None:
        # Cold grease makes heat that would carry the loop past the fixed point.
        first = _settle(without_expansion(machine), point, None, beyond, enough=FIRST_STATE)
    if beyond is None and (first is not None or not follows):
        # Quick, unless heat changes so steeply with temperature that mixing far from the fixed point errs;
        # where preload follows too, what fails here may still be crept up to.
        quick = Iteration(RELAXATION, np.inf, ANDERSON_DEPTH, QUICK_ITERATIONS, retreats)
        failed = (ConvergenceError, NoSteadyStateError, *REFUSED) if follows else (ConvergenceError,)
        with contextlib.suppress(*failed):
            return _iterate(_Operation(machine, point, beyond, enough), start, first, quick)
    operation = _Operation(machine, point, beyond, enough)
    iteration = Iteration(
        relaxation=RELAXATION,
        # Far from the fixed point, heat that changes with temperature must be followed as the machine warms.
        mixing_below=MIXING_BELOW,
        depth=ANDERSON_DEPTH,
        most=MAXIMUM_ITERATIONS,
        retreats=retreats,
    )
    try:
        return _iterate(operation, start, first, iteration)
    except REFUSED as error:
        if operation.follows_preload and (operation.solution is not None or start is None):
            raise no_equilibrium(machine.spec.name, point, str(error)) from error
        raise


def _iterate(
    operation: _Operation,
    start: NDArray[np.float64] | None,
    first: CoupledState | None,
    iteration: Iteration,
) -> CoupledState:
    """The fixed point of an operation, from a field or from a solved state of the machine."""
    state = operation.padded(start) if first is None else operation.begin(first)
    name = operation.machine.spec.name
    _, steps = fixed_point(operation.respond, operation.settled, state, iteration, name)
    return CoupledState(operation.solution, operation.loads, operation.coolant, steps, operation.change)


class _Operation:
    """Loads and field of a machine at one point; a state is the field, then the lumped nodes."""

    def __init__(
        self, machine: PreparedMachine, point: OperatingPoint, beyond: Beyond | None, enough: float = 0.0
    ) -> None:
        self.machine, self.point, self.beyond, self.enough = machine, point, beyond, enough
        self.follows_preload = machine.spec.follows_preload
        self.names = machine.builder.lumped_names
        # Before a first solve nothing is known of the lumped nodes.
        self.lumped_known = False
        self.solution: ConductionSolution | None = None
        self.loads: Loads | None = None
        self.coolant: CoolantState | None = None
        self.change = self.heat_before = np.inf
        self._series = SteadySeries()

    def padded(self, field: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """State of a field, ambient by default, with lumped nodes at ambient temperature."""
        n, ambient = self.machine.operators.n_unknowns, self.point.ambient_temperature
        state = np.full(n + len(self.names), ambient)
        if field is not None:
            state[:n] = field
        return state

    def begin(self, state: CoupledState) -> NDArray[np.float64]:
        """Take up a solved state of the same machine."""
        self.solution, self.lumped_known = state.solution, True
        return _joined(state.solution)

    def respond(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Field of the loads that a state makes."""
        machine, n = self.machine, self.machine.operators.n_unknowns
        field = state[:n]
        lumped = dict(zip(self.names, state[n:].tolist(), strict=True)) if self.lumped_known else {}
        physics = NO_CHANGE if self.beyond is None else self.beyond(self.point, field, lumped)
        self.loads, self.coolant = machine.builder.at(self.point, machine.field_state(field, lumped), physics)
        self.solution = solve_steady(
            machine.problem(self.loads),
            guess=None
            if self.solution is None
            else replace(self.solution, temperature=field, lumped_temperature=state[n:]),
            preconditioner=None if self.solution is None else self.solution.preconditioner,
            relative_tolerance=_linear_tolerance(self.change),
            series=self._series,
        )
        self.lumped_known = True
        self.change = float(np.abs(self.solution.temperature - field).max())
        return self._bounded(state, _joined(self.solution))

    def _bounded(self, state: NDArray[np.float64], found: NDArray[np.float64]) -> NDArray[np.float64]:
        """The field found, or the way to it as far as warm grease where cold grease would make it run away.

        Raises
        ------
        NoSteadyStateError
            It runs away with the heat of warm grease too.
        """
        hottest, before = float(found.max()), float(state.max())
        if np.isfinite(hottest) and hottest <= RUNAWAY_TEMPERATURE:
            return found
        reach = next((warm for warm in WARM_GREASE if before < warm - 1.0), None)
        if not np.isfinite(hottest) or reach is None:
            heat = f"{self.loads.total_heat:.0f} W would heat it over {hottest - 273.15:.0f} °C."
            raise no_equilibrium(self.machine.spec.name, self.point, heat)
        return state + (found - state) * (reach - before) / (hottest - before)

    def settled(self, state: NDArray[np.float64], found: NDArray[np.float64]) -> bool:
        """Whether field, heat and coolant agree, or the field changes little enough."""
        if self.change < self.enough:
            return True
        heat, before = self.loads.total_heat, self.heat_before
        self.heat_before = heat
        hottest = float(self.solution.temperature.max())
        return (
            abs(heat - before) <= max(HEAT_TOLERANCE * abs(heat), ROUNDED_HEAT)
            and coolant_mismatch(self.machine, self.solution, self.coolant) <= COOLANT_TOLERANCE
            and circuit_mismatch(self.machine, self.solution, self.loads) <= COOLANT_TOLERANCE
            and self.solution.residual <= LINEAR_RESIDUAL_LIMIT
            and self.change < FIELD_TOLERANCE * max(1.0, hottest - self.point.coldest)
        )


def _joined(solution: ConductionSolution) -> NDArray[np.float64]:
    """Temperatures of the mesh, then of the lumped nodes, K."""
    return np.concatenate([solution.temperature, solution.lumped_temperature])


def coolant_mismatch(
    machine: PreparedMachine, solution: ConductionSolution, coolant: CoolantState | None
) -> float:
    """Heat that the walls give less the oil's enthalpy rise, relative to all heat moved."""
    if coolant is None:
        return 0.0
    march = coolant.march.march
    given = sum(solution.balance.films[surface] for surface in machine.builder.cells.surfaces)
    taken = march.enthalpy_rise - float(march.pumping_heat.sum())
    moved = float(np.abs(march.heat).sum() + np.abs(march.pumping_heat).sum())
    return _relative(given - taken, moved)


def circuit_outlets(machine: PreparedMachine, solution: ConductionSolution, loads: Loads) -> dict[str, float]:
    """Outlet temperature of every circuit as its walls have it, K."""
    circuits = machine.spec.circuits
    if not circuits:
        return {}
    lumped = dict(zip(solution.problem.lumped_names, solution.lumped_temperature.tolist(), strict=True))
    field = machine.field_state(solution.temperature, lumped)
    films = {name: film.coefficient for name, film in loads.films.items()}
    return {
        film.name: machine.builder.circuit_coolant(film, films, field, loads.inlets[film.name])[1]
        for film in circuits
    }


def circuit_mismatch(machine: PreparedMachine, solution: ConductionSolution, loads: Loads) -> float:
    """Heat that the walls of circuits give less the enthalpy rise of their coolant; the worst, relative."""
    worst = 0.0
    for name, outlet in circuit_outlets(machine, solution, loads).items():
        film = next(film for film in machine.spec.circuits if film.name == name)
        if any(loads.change.fluids.get(surface) for surface in film.surface):
            # A term that shifts the fluid of one wall says nothing of the coolant that goes on.
            continue
        heat = np.array([solution.balance.films[surface] for surface in film.surface])
        rise = capacity_rate(film) * (outlet - loads.inlets[name])
        worst = max(worst, _relative(float(heat.sum()) - rise, float(np.abs(heat).sum())))
    return worst


def _relative(left: float, moved: float) -> float:
    """Heat that a balance leaves as a share of the heat moved, both W; none where it is round-off."""
    return abs(left) / max(moved, ROUNDED_HEAT) if abs(left) > ROUNDED_HEAT else 0.0


def _linear_tolerance(change: float) -> float:
    """Relative residual worth solving to when the loads last moved the field by ``change`` K."""
    return float(np.clip(LINEAR_PER_KELVIN * change, RELATIVE_TOLERANCE, LOOSEST_LINEAR_TOLERANCE))


def _beyond_the_fold(
    machine: PreparedMachine,
    point: OperatingPoint,
    error: NoSteadyStateError | ConvergenceError,
    beyond: Beyond | None,
) -> NoSteadyStateError | ConvergenceError:
    """The error of a runaway, with the speed up to which the machine has an equilibrium.

    Just beyond a fold temperatures creep on without end: what did not converge there is a runaway too.
    Equilibria are followed with films and contacts at ambient temperature first, then with those of
    states solved just below the speed that was reached, until that stays; the error itself where they go on,
    and at standstill, where no lower speed has an equilibrium.
    """
    if point.speed == 0.0:
        return error
    try:
        slow = replace(point, speed=SLOW_RUNNING * point.speed)
        branch = HeatResponse(machine, slow).branch(point.speed)
        for approach in FOLD_APPROACHES:
            below = replace(point, speed=approach * branch.limit)
            state = _settle(machine, below, None, beyond)
            before = branch.limit
            branch = equilibria_above(machine, below, point.speed, state.loads, state.solution)
            if abs(branch.limit - before) < FOLD_TOLERANCE * before:
                break
    except SpindleFemError:
        return error
    if branch.end == "end":
        return error
    if isinstance(error, ConvergenceError):
        error = no_equilibrium(machine.spec.name, point, error.what)
    return beyond_the_branch(error, branch)
