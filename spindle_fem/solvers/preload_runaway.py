"""Where the rings' own heat stops having a thermal equilibrium.

A rigid preload rises when the inner ring is hotter than the outer one, more
preload makes more friction heat, and more heat a larger difference. Above some
speed that loop has no fixed point; the answer is then a speed, not a
temperature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoSteadyStateError
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.operation.bearing_heat import (
    BearingTemperatures,
)
from spindle_fem.operation.coefficients import ball_conductances
from spindle_fem.operation.heat_shares import heat_shares
from spindle_fem.operation.loads import BearingHeat, Loads
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.solution_branch import Branch, follow_branch

# A preload this many times that of assembly ends a bearing, whatever the loop then does.
LARGEST_PRELOAD_RATIO = 5.0
# Of the end of a search: where a branch of equilibria begins.
SLOWEST = 0.05
SPEED_TOLERANCE = 0.01


@dataclass(frozen=True, slots=True)
class PreloadGuard:
    """Watches whether a preload grows beyond what a bearing survives.

    Attributes
    ----------
    assembled : mapping of bearing to float, [N]
        Preload with everything at the ambient temperature.
    """

    assembled: Mapping[str, float]

    @classmethod
    def of(cls, cold: Mapping[str, BearingHeat]) -> PreloadGuard:
        """From the bearings of a machine at ambient temperature."""
        return cls({name: heat.preload for name, heat in cold.items()})

    def reason(self, bearings: Mapping[str, BearingHeat]) -> str:
        """Why there is no equilibrium; empty while every preload is bearable."""
        ratio = {name: heat.preload / self.assembled[name] for name, heat in bearings.items()}
        worst = max(ratio, key=ratio.get, default="")
        if not worst or not ratio[worst] > LARGEST_PRELOAD_RATIO:
            return ""
        return (
            f"the preload of {worst} passes {LARGEST_PRELOAD_RATIO:g} times the "
            f"{self.assembled[worst]:.0f} N of assembly."
        )


def no_equilibrium(name: str, point: OperatingPoint, reason: str) -> NoSteadyStateError:
    """The error of a machine, by name, whose heat and temperature do not settle."""
    advice = "Lower the speed or the preload, or cool more."
    rpm = point.speed * 30.0 / np.pi
    return NoSteadyStateError(name, f"no thermal equilibrium at {rpm:.0f} rpm: {reason}", advice)


def highest_settling_speed(highest: float, settles: Callable[[float], bool]) -> float:
    """Largest speed (rad/s) below ``highest`` at which ``settles`` still holds, to a hundredth."""
    low, high = 0.0, highest
    while high - low > SPEED_TOLERANCE * highest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if settles(middle) else (low, middle)
    return low


class HeatResponse:
    """Bearing temperatures and shifts as a linear function of what enters rings and balls of each bearing.

    Films, oil and joints stay as they are in given loads, so one solve for each ring and ball row
    describes the machine near them. What the balls conduct is followed: a change of it moves heat
    between balls and rings.

    Parameters
    ----------
    loads : Loads, optional
        Those at ambient temperature by default.
    """

    def __init__(self, machine: PreparedMachine, point: OperatingPoint, loads: Loads | None = None) -> None:
        self.machine = machine
        self.point = point
        self.names = [bearing.name for _, bearing in machine.spec.bearings]
        if loads is None:
            unknowns = np.full(machine.operators.n_unknowns, point.ambient_temperature)
            loads, _ = machine.builder.at(point, machine.field_state(unknowns, {}))
        self._groups = {bearing.name: group for group, bearing in machine.spec.bearings}
        self._base = self._conductances(loads.bearing_heat)
        shares = heat_shares(machine.spec.heat)
        self._shares = np.array([shares["inner"], shares["outer"], shares["balls"]])
        solution = None
        columns = []
        for active in (None, *((name, body) for name in self.names for body in ("inner", "outer", "balls"))):
            heat = dict.fromkeys(loads.surface_heat, 0.0)
            balls: tuple[str, ...] = ()
            if active is not None and active[1] == "balls":
                balls = machine.builder.ball_nodes(active[0])
            elif active is not None:
                heat[f"{active[0]}.{active[1]}_raceway"] = 1.0
            lumped = tuple(
                replace(node, heat=1.0 / len(balls) if node.name in balls else 0.0) for node in loads.lumped
            )
            problem = machine.problem(replace(loads, surface_heat=heat, lumped=lumped))
            solution = solve_steady(
                problem, guess=solution, preconditioner=None if solution is None else solution.preconditioner
            )
            nodes = dict(zip(problem.lumped_names, solution.lumped_temperature.tolist(), strict=True))
            found = machine.builder.bearing_temperatures(machine.field_state(solution.temperature, nodes))
            columns.append(_as_array(found, self.names))
        self.unheated = columns[0]
        self.per_watt = np.stack([column - columns[0] for column in columns[1:]], axis=-1)

    def _conductances(self, heats: Mapping[str, BearingHeat]) -> NDArray[np.float64]:
        """From the balls to the inner and the outer raceway, (n_bearings, 2) W/K."""
        return np.array([ball_conductances(self._groups[name], heats[name]) for name in self.names])

    def temperatures(
        self, heat: NDArray[np.float64], conductance: NDArray[np.float64]
    ) -> dict[str, BearingTemperatures]:
        """Temperatures at heats (n_bearings,) [W] and conductances of the balls (n_bearings, 2) [W/K]."""
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
        values = values + self.per_watt @ (flows @ flow)
        return {
            name: BearingTemperatures(*row[:5].tolist(), 1.0e-6 * row[5:] if row.size > 5 else None)
            for name, row in zip(self.names, values, strict=True)
        }

    def state(self, heats: Mapping[str, BearingHeat]) -> NDArray[np.float64]:
        """Heats and conductances of the balls, as one state (3 n_bearings,)."""
        return np.append([heats[name].total for name in self.names], self._conductances(heats))

    def respond(self, state: NDArray[np.float64], speed: float) -> NDArray[np.float64]:
        """The state that the temperatures of a state make at a speed (rad/s)."""
        count = len(self.names)
        around = self.temperatures(state[:count], state[count:].reshape(count, 2))
        found, _ = self.machine.builder.heat_model(replace(self.point, speed=speed), around)
        return self.state(found)

    def follow(self, state: NDArray[np.float64], start: float, end: float) -> Branch:
        """The branch from a state at a speed ``start`` (rad/s)."""
        return follow_branch(self.respond, state, start, end, weak=2 * len(self.names))

    def branch(self, end: float) -> Branch:
        """States of the bearings over the speed (rad/s), from slow running to ``end`` or a fold before.

        Raises
        ------
        SpindleFemError
            No equilibrium even at the slowest speed.
        """
        start = SLOWEST * end
        cold = np.append(np.zeros(len(self.names)), self._base)
        return self.follow(self.respond(cold, start), start, end)


def equilibria_above(machine: PreparedMachine, point: OperatingPoint, end: float, loads: Loads) -> Branch:
    """The branch of equilibria from a solved state to a higher speed ``end`` (rad/s), or to its fold before.

    Parameters
    ----------
    loads : Loads
        Of the solved state: films, oil and joints stay as they are there.
    """
    response = HeatResponse(machine, point, loads)
    return response.follow(response.state(loads.bearing_heat), point.speed, end)


def _as_array(found: dict[str, BearingTemperatures], names: list[str]) -> NDArray[np.float64]:
    return np.array([found[name].state for name in names])
