"""Where the rings' own heat stops having a thermal equilibrium.

A rigid preload rises when the inner ring is hotter than the outer one, more
preload makes more friction heat, and more heat a larger difference. Above some
speed that loop has no fixed point; the answer is then a speed, not a
temperature.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.operation.bearing_heat import (
    BearingTemperatures,
    HeatModel,
    heat_model_of,
    preload_runs_away,
)
from spindle_fem.operation.operating_point import OperatingPoint

if TYPE_CHECKING:
    from spindle_fem.solvers.coupled_steady import PreparedMachine

RELAXATION = 0.3
# The linear response has no film or oil loop to upset, so it may step further.
RESPONSE_RELAXATION = 0.6
HEAT_TOLERANCE = 1.0e-3
MAXIMUM_STEPS = 100
SPEED_TOLERANCE = 0.01
MAXIMUM_RESPONSES = 6


class HeatResponse:
    """Bearing temperatures as a linear function of the heat of each bearing.

    Films, oil and contact conductances stay as they are at the operating
    point, so one solve a bearing describes the machine for all heats.
    """

    def __init__(self, machine: PreparedMachine, point: OperatingPoint) -> None:
        self.machine = machine
        self.point = point
        rigid = machine.spec.heat.model_copy(update={"thermal_preload": False})
        self.without_expansion = heat_model_of(machine.spec.model_copy(update={"heat": rigid}))
        self.names = [bearing.name for _, bearing in machine.spec.bearings]
        unknowns = np.full(machine.operators.n_unknowns, point.ambient_temperature)
        loads, _ = machine.builder.at(point, machine.field_state(unknowns, {}))
        solution = None
        columns = []
        for active in (None, *self.names):
            heat = dict.fromkeys(loads.surface_heat, 0.0)
            shares = machine.builder.shares(1.0)
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
            assembled = {name: heat.preload for name, heat in model(point, cold)[0].items()}
            heat = self._fixed_point(point, self.without_expansion, np.zeros(len(self.names)))
            return heat is not None and self._fixed_point(point, model, heat, assembled) is not None
        except (NoEquilibriumError, OutOfValidityError):
            return False

    def _fixed_point(
        self,
        point: OperatingPoint,
        model: HeatModel,
        heat: NDArray[np.float64],
        assembled: dict[str, float] | None = None,
    ) -> NDArray[np.float64] | None:
        """Heat of every bearing that makes the temperatures that make it; None where it runs away."""
        for _ in range(MAXIMUM_STEPS):
            found, _ = model(point, self.temperatures(heat))
            preload = {name: found[name].preload for name in self.names}
            if assembled is not None and preload_runs_away(preload, assembled):
                return None
            wanted = np.array([found[name].total for name in self.names])
            if np.abs(wanted - heat).max() <= HEAT_TOLERANCE * wanted.max():
                return heat
            heat = heat + RESPONSE_RELAXATION * (wanted - heat)
        return None

    def highest_speed(self, highest: float) -> float:
        """Largest speed below ``highest`` (rad/s) at which an equilibrium exists."""
        low, high = 0.0, highest
        while high - low > SPEED_TOLERANCE * highest:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.settles(middle) else (low, middle)
        return low


def highest_stable_speed(machine: PreparedMachine, point: OperatingPoint) -> float:
    """Speed up to which the machine has a thermal equilibrium, rad/s; below that of ``point``.

    Films depend on speed, so the response is taken again at the speed found
    until both agree.
    """
    limit = point.speed
    for _ in range(MAXIMUM_RESPONSES):
        found = HeatResponse(machine, replace(point, speed=limit)).highest_speed(point.speed)
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
