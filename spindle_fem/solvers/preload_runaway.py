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

from spindle_fem.errors import (
    ConvergenceError,
    NoEquilibriumError,
    NoSteadyStateError,
    OutOfValidityError,
)
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.operation.bearing_heat import (
    BearingTemperatures,
    HeatModel,
    at_assembly_size,
    heat_model_of,
)
from spindle_fem.operation.heat_shares import heat_shares
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.fixed_point import Iteration, fixed_point
from spindle_fem.solvers.prepared_machine import PreparedMachine

# A preload this many times that of assembly ends a bearing, whatever the loop then does.
LARGEST_PRELOAD_RATIO = 5.0
HEAT_TOLERANCE = 1.0e-3
# The linear response has no film or oil loop to upset, so it may step further than the full one.
RESPONSE = Iteration(relaxation=0.6, mixing_below=0.0)
SPEED_TOLERANCE = 0.01
MAXIMUM_RESPONSES = 6


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


def no_equilibrium(
    name: str, point: OperatingPoint, reason: str, limit: float | None = None
) -> NoSteadyStateError:
    """The error of a machine whose heat and temperature do not settle.

    Parameters
    ----------
    name : str
        Of the machine.
    limit : float, optional, [rad/s]
        Speed up to which they do.
    """
    advice = "Lower the speed or the preload, or cool more."
    if limit is not None:
        advice = f"A thermal equilibrium exists up to about {limit * 30.0 / np.pi:.0f} rpm. {advice}"
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
    """Bearing temperatures as a linear function of the heat of each bearing.

    Films, oil and contact conductances stay as they are at the operating
    point, so one solve a bearing describes the machine for all heats.
    """

    def __init__(self, machine: PreparedMachine, point: OperatingPoint) -> None:
        self.machine = machine
        self.point = point
        self.without_expansion = heat_model_of(at_assembly_size(machine.spec))
        self.names = [bearing.name for _, bearing in machine.spec.bearings]
        unknowns = np.full(machine.operators.n_unknowns, point.ambient_temperature)
        loads, _ = machine.builder.at(point, machine.field_state(unknowns, {}))
        solution = None
        columns = []
        for active in (None, *self.names):
            heat = dict.fromkeys(loads.surface_heat, 0.0)
            shares = heat_shares(machine.spec.heat)
            if active:
                heat |= {
                    f"{active}.inner_raceway": shares["inner"],
                    f"{active}.outer_raceway": shares["outer"],
                }
            balls = machine.builder.ball_nodes(active) if active else ()
            lumped = tuple(
                replace(node, heat=shares["balls"] / len(balls) if node.name in balls else 0.0)
                for node in loads.lumped
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

    def temperatures(self, heat: NDArray[np.float64]) -> dict[str, BearingTemperatures]:
        """Temperatures at given heats (n_bearings,) in W."""
        values = self.unheated + self.per_watt @ heat
        return {
            name: BearingTemperatures(*row) for name, row in zip(self.names, values.tolist(), strict=True)
        }

    def settles(self, speed: float) -> bool:
        """Whether heat and temperature reach a fixed point from that without expansion."""
        point = replace(self.point, speed=speed)
        model = self.machine.builder.heat_model
        cold = self.temperatures(np.zeros(len(self.names)))
        try:
            guard = PreloadGuard.of(model(point, cold)[0])
            heat = self._fixed_point(point, self.without_expansion, np.zeros(len(self.names)))
            self._fixed_point(point, model, heat, guard)
        except (ConvergenceError, NoEquilibriumError, NoSteadyStateError, OutOfValidityError):
            return False
        return True

    def _fixed_point(
        self,
        point: OperatingPoint,
        model: HeatModel,
        heat: NDArray[np.float64],
        guard: PreloadGuard | None = None,
    ) -> NDArray[np.float64]:
        """Heat of every bearing (n_bearings,) [W] that makes the temperatures that make it."""

        def respond(given: NDArray[np.float64]) -> NDArray[np.float64]:
            found, _ = model(point, self.temperatures(given))
            reason = "" if guard is None else guard.reason(found)
            if reason:
                raise no_equilibrium(self.machine.spec.name, point, reason)
            return np.array([found[name].total for name in self.names])

        def settled(given: NDArray[np.float64], wanted: NDArray[np.float64]) -> bool:
            return np.abs(wanted - given).max() <= HEAT_TOLERANCE * wanted.max()

        return fixed_point(respond, settled, heat, RESPONSE, self.machine.spec.name)[0]


def highest_stable_speed(machine: PreparedMachine, point: OperatingPoint) -> float:
    """Speed up to which the machine has a thermal equilibrium, rad/s; below that of ``point``.

    Films depend on speed, so the response is taken again at the speed found
    until both agree.
    """
    limit = point.speed
    for _ in range(MAXIMUM_RESPONSES):
        response = HeatResponse(machine, replace(point, speed=limit))
        found = highest_settling_speed(point.speed, response.settles)
        settled = abs(found - limit) <= 2.0 * SPEED_TOLERANCE * point.speed
        limit = found
        if settled or limit == 0.0:
            break
    return limit


def _as_array(found: dict[str, BearingTemperatures], names: list[str]) -> NDArray[np.float64]:
    return np.array(
        [
            (found[name].inner, found[name].outer, found[name].ball, found[name].shaft, found[name].housing)
            for name in names
        ]
    )
