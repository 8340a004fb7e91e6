"""Speed above which the rings' own heat has no thermal equilibrium.

A rigid preload rises when the inner ring is hotter than the outer one, more
preload makes more friction heat, and more heat a larger difference. Above some
speed that loop has no fixed point; the answer is then a speed, not a
temperature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoSteadyStateError, SpindleFemError
from spindle_fem.model.mesh.column_solver import solve_many
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.kernels.compile import wait_for_columns
from spindle_fem.model.mesh.linear_system import ThermalSystem
from spindle_fem.model.mesh.steady_conduction import ConductionSolution, solve_steady, split_unknowns
from spindle_fem.operation.bearing_heat import BearingTemperatures
from spindle_fem.operation.coefficients import ball_conductances
from spindle_fem.operation.heat_shares import heat_shares
from spindle_fem.operation.loads import BearingHeat, Loads
from spindle_fem.operation.machine_loads import FieldState
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.solution_branch import Branch, follow_branch

# Share of the end of a search at which a branch of equilibria begins.
SLOWEST = 0.05
# Tolerance of a watt's effect on the machine, in the energy norm; it moves the fold by 3e-4 of its speed.
RESPONSE_TOLERANCE = 1.0e-2
RESPONSE_PRECISION = np.float32
# Linear residual of the field that responses begin at.
FIELD_TOLERANCE = 1.0e-6
# Difference of two spreads over rings, as a share, that is round-off of that precision.
SAME_SPREAD = 1.0e-5

Array = NDArray[np.float64]
# Rows around the bearings over heats and conductances of balls.
Around = Callable[[Array, Array], Array]


def no_equilibrium(name: str, point: OperatingPoint, reason: str) -> NoSteadyStateError:
    """The error of a machine, by name, whose heat and temperature do not settle."""
    advice = "Lower the speed or the preload, or cool more."
    rpm = point.speed * 30.0 / np.pi
    return NoSteadyStateError(name, f"no thermal equilibrium at {rpm:.0f} rpm: {reason}", advice)


def beyond_the_branch(error: NoSteadyStateError, branch: Branch) -> NoSteadyStateError:
    """The error of a runaway, with the speed at which a branch of equilibria over the speed ends."""
    rpm = branch.limit * 30.0 / np.pi
    if branch.end == "fold":
        # What a search beyond the fold ends at is no cause: it comes last.
        head, _, reached = error.what.partition(": ")
        what = f"{head}: heat and preload feed each other, equilibria end in a fold at {rpm:.0f} rpm."
        advice = f"{error.how_to_fix} (Heated beyond the fold it ends at: {reached.rstrip('.')}.)"
        return NoSteadyStateError(error.where, what, advice if reached else error.how_to_fix)
    what = f"A thermal equilibrium exists up to about {rpm:.0f} rpm: {branch.reason}"
    return NoSteadyStateError(error.where, error.what, f"{what} {error.how_to_fix}")


class HeatResponse:
    """Bearing temperatures and shifts as a linear function of what enters rings and balls of each bearing.

    Films, oil and joints stay as they are in given loads, so one solution for each ring and ball row, all of
    one matrix, describes the machine near them. What the balls conduct is followed: a change of it moves heat
    between balls and rings.

    Parameters
    ----------
    loads : Loads, optional
        Those at ambient temperature by default.
    solved : ConductionSolution, optional
        Of these loads.
    near : ConductionSolution, optional
        Of similar ones, from which that of these loads is found.
    """

    def __init__(
        self,
        machine: PreparedMachine,
        point: OperatingPoint,
        loads: Loads | None = None,
        solved: ConductionSolution | None = None,
        near: ConductionSolution | None = None,
    ) -> None:
        self.machine = machine
        self.point = point
        self.names = [bearing.name for _, bearing in machine.spec.bearings]
        if loads is None:
            unknowns = np.full(machine.operators.n_unknowns, point.ambient_temperature)
            loads, _ = machine.builder.at(point, machine.field_state(unknowns, {}))
        self._base = np.array(
            [ball_conductances(group, loads.bearing_heat[b.name]) for group, b in machine.spec.bearings]
        )
        self._constant = np.array([group.ball_row.kind == "constant" for group, _ in machine.spec.bearings])
        shares = heat_shares(machine.spec.heat)
        self._shares = np.array([shares["inner"], shares["outer"], shares["balls"]])
        builder, operators = machine.builder, machine.operators
        problem = machine.problem(loads)
        if solved is None:
            known = None if near is None else near.preconditioner
            solved = solve_steady(problem, near, known, relative_tolerance=FIELD_TOLERANCE)
        system = assemble_system(problem)
        tied = system.tied()
        count = 3 * len(self.names)
        entering = np.zeros((len(tied.full_load()), count), RESPONSE_PRECISION)
        nodes = len(tied.load)
        for index, name in enumerate(self.names):
            for body, ring in enumerate(("inner", "outer")):
                surface = f"{name}.{ring}_raceway"
                rows = operators.surface_rows[surface]
                areas = operators.facet_areas(surface)
                watt = operators.facet_vector(np.full(len(areas), 1.0 / areas.sum()), rows)
                entering[:nodes, 3 * index + body] = watt if system.tie is None else system.tie.T @ watt
            balls = [problem.lumped_names.index(node) for node in builder.ball_nodes(name)]
            entering[[nodes + ball for ball in balls], 3 * index + 2] = 1.0 / len(balls)
        passed_on = _passed_on(tied, entering)
        solved_for = np.setdiff1d(np.arange(count), list(passed_on))
        matrix, n_lumped, tie = tied.full_matrix().astype(RESPONSE_PRECISION), system.n_lumped, system.tie
        del system, tied  # their memory serves the solution
        warmed = entering
        wait_for_columns()
        warmed[:, solved_for] = solve_many(
            matrix, entering[:, solved_for], solved.preconditioner, relative_tolerance=RESPONSE_TOLERANCE
        )
        for column, (shares, warmer) in passed_on.items():
            warmed[:, column] = warmed[:, column - 2 : column] @ shares
            warmed[nodes:, column] += warmer

        self._lumped_names, self._n_lumped, self._tie = problem.lumped_names, n_lumped, tie
        self._warmed, self._solved = warmed, solved
        self._entered = np.array(
            [loads.heat_to[name][body] for name in self.names for body in ("inner", "outer", "balls")]
        )
        still = np.zeros(count)
        heated = self._around(still)
        self.per_watt = np.stack([self._around(watt) - heated for watt in np.eye(count)], axis=-1)
        self.unheated = heated - self.per_watt @ self._entered

    def _unknowns(self, more: Array) -> tuple[Array, Array]:
        """Field and lumped nodes [K] with so many watts (3 n_bearings,) more into rings and balls."""
        field, lumped = split_unknowns(self._warmed @ more, self._n_lumped, self._tie)
        return self._solved.temperature + field, self._solved.lumped_temperature + lumped

    def _state(self, field: Array, lumped: Array) -> FieldState:
        known = dict(zip(self._lumped_names, lumped.tolist(), strict=True))
        return self.machine.field_state(field, known)

    def _around(self, more: Array) -> Array:
        found = self.machine.builder.bearing_temperatures(self._state(*self._unknowns(more)))
        return np.array([found[name].state for name in self.names])

    def entering(self, heat: Array, conductance: Array) -> Array:
        """Watts (3 n_bearings,) into rings and balls: shares of the heat, and what balls conduct more."""
        entering = (heat[:, None] * self._shares).ravel()
        values = self.unheated + self.per_watt @ entering
        more = (conductance - self._base).ravel()
        # ball less raceway of every contact, by what enters; a flow leaves the balls and enters the raceway
        count = len(self.names)
        flows = np.zeros((3 * count, 2 * count))
        for contact in range(2 * count):
            flows[3 * (contact // 2) + contact % 2, contact] = 1.0
            flows[3 * (contact // 2) + 2, contact] = -1.0
        drop = (self.per_watt[:, 2:3] - self.per_watt[:, :2]).reshape(2 * count, -1)
        driving = (values[:, 2:3] - values[:, :2]).ravel()
        flow = np.linalg.solve(np.eye(2 * count) - more[:, None] * (drop @ flows), more * driving)
        return entering + flows @ flow

    def around(self, heat: Array, conductance: Array) -> Array:
        """Rows of ``BearingTemperatures.state`` at heats (n,) [W] and conductances of balls (n, 2) [W/K]."""
        return self.unheated + self.per_watt @ self.entering(heat, conductance)

    def at(self, state: Array, speed: float) -> HeatResponse:
        """The response with films, oil and joints of the field that a state at a speed (rad/s) makes."""
        count = len(self.names)
        more = self.entering(state[:count], state[count:].reshape(count, 2)) - self._entered
        point = replace(self.point, speed=speed)
        field, lumped = self._unknowns(more)
        loads, _ = self.machine.builder.at(point, self._state(field, lumped))
        near = replace(self._solved, temperature=field, lumped_temperature=lumped)
        return HeatResponse(self.machine, point, loads, near=near)

    def state(self, heats: Mapping[str, BearingHeat]) -> Array:
        """Heats and conductances of the balls, as one state (3 n_bearings,)."""
        conductances = [
            ball_conductances(group, heats[bearing.name]) for group, bearing in self.machine.spec.bearings
        ]
        return np.append([heats[name].total for name in self.names], conductances)

    def respond(self, states: Array, speed: float, around: Around | None = None) -> Array:
        """The states (n, 3 n_bearings) that the temperatures of states make at a speed (rad/s).

        Parameters
        ----------
        around : callable, optional
            In place of :meth:`around`.
        """
        count = len(self.names)
        rows = [(around or self.around)(state[:count], state[count:].reshape(count, 2)) for state in states]
        temperatures = [
            {n: BearingTemperatures.of_state(row) for n, row in zip(self.names, each, strict=True)}
            for each in rows
        ]
        heat, conductance = self.machine.builder.heat_model.heat_and_conductance(
            replace(self.point, speed=speed), temperatures, expand=True
        )
        conductance[:, self._constant] = self._base[self._constant]
        return np.hstack([heat, conductance.reshape(len(states), -1)])

    def follow(self, state: Array, start: float, end: float, around: Around | None = None) -> Branch:
        """The branch from a state at a speed ``start`` (rad/s); ``around`` as of :meth:`respond`."""

        def respond(states: Array, speed: float) -> Array:
            return self.respond(states, speed, around)

        return follow_branch(respond, state, start, end, weak=2 * len(self.names))

    def renewed(self, branch: Branch, end: float) -> Branch:
        """A branch to its fold with films, oil and joints that go from those given to those of the fold.

        The same branch, with the reason, where there are none at the fold.
        """
        count = len(self.names)
        begin = branch.states[0]
        heats = begin[:count].sum(), branch.top[:count].sum()
        if branch.end != "fold":
            return branch
        if not heats[1] > heats[0]:
            return replace(branch, reason="the heat of the bearings does not rise towards it")
        try:
            there = self.at(branch.top, branch.limit)
        except SpindleFemError as error:
            return replace(branch, reason=str(error))

        def between(heat: Array, conductance: Array) -> Array:
            share = (heat.sum() - heats[0]) / (heats[1] - heats[0])
            first, second = (each.around(heat, conductance) for each in (self, there))
            return (1.0 - share) * first + share * second

        return self.follow(begin, branch.parameter[0], end, between)

    def branch(self, end: float) -> Branch:
        """States of the bearings over the speed (rad/s), from slow running to ``end`` or a fold before.

        Raises
        ------
        SpindleFemError
            No equilibrium even at the slowest speed.
        """
        start = SLOWEST * end
        cold = np.append(np.zeros(len(self.names)), self._base)
        return self.follow(self.respond(cold[None], start)[0], start, end)


def _passed_on(system: ThermalSystem, entering: Array) -> dict[int, tuple[Array, Array]]:
    """Watts into balls that meet their rings evenly: shares of the rings, and how much warmer they are alone.

    Balls pass on all that they are given, so that what they do is what watts into both rings do, which are
    the two columns before. Balls in sectors are not found here: their sectors have areas of their own.
    """
    found = {}
    nodes = len(system.load)
    for column in range(2, entering.shape[1], 3):
        warmer = np.linalg.solve(system.lumped_matrix, entering[nodes:, column])
        given = system.exchange @ warmer
        rings = entering[:nodes, column - 2 : column].astype(float)
        own = np.flatnonzero(given)
        shares = np.linalg.lstsq(rings[own], given[own])[0]
        if np.abs(rings @ shares - given).max() < SAME_SPREAD * given.max():
            found[column] = shares.astype(entering.dtype), warmer.astype(entering.dtype)
    return found


def equilibria_above(
    machine: PreparedMachine, point: OperatingPoint, end: float, loads: Loads, solution: ConductionSolution
) -> Branch:
    """The branch of equilibria from a solved state to a higher speed ``end`` (rad/s), or to its fold before.

    Parameters
    ----------
    loads, solution
        Of the solved state: films, oil and joints go from those there to those of the fold, linearly in the
        heat of the bearings.
    """
    response = HeatResponse(machine, point, loads, solution)
    branch = response.follow(response.state(loads.bearing_heat), point.speed, end)
    return response.renewed(branch, end)
