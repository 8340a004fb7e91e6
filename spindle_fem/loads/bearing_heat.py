"""Bearing heat behind one interface, whatever model makes it.

A heat model is called with the operating point and the mean temperatures of
every bearing and answers with :class:`BearingHeat` for each. A new model is a
function of that form, entered in :func:`heat_model_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from spindle_fem.loads.model import BearingHeat
from spindle_fem.loads.operating_point import OperatingPoint
from spindle_fem.spec.model import MachineSpec
from spindle_fem.validity import CodedWarning


@dataclass(frozen=True, slots=True)
class BearingTemperatures:
    """Mean temperatures of one bearing in K: raceways and balls."""

    inner: float
    outer: float
    ball: float

    @property
    def grease(self) -> float:
        """Where the lubricant works: the mean of both raceways."""
        return 0.5 * (self.inner + self.outer)


HeatModel = Callable[
    [OperatingPoint, Mapping[str, BearingTemperatures]],
    tuple[Mapping[str, BearingHeat], tuple[CodedWarning, ...]],
]


def table_heat(spec: MachineSpec, point: OperatingPoint) -> tuple[dict[str, float], tuple[CodedWarning, ...]]:
    """Heat of every bearing by the table, W: linear in speed, first order in thrust.

    Beyond the last speed the last segment is continued and a warning says so.
    """
    table = spec.heat.table
    speeds = np.asarray(table.speed)
    warnings: tuple[CodedWarning, ...] = ()
    if point.speed > speeds[-1] * (1.0 + 1e-9):
        text = (
            f"Speed {point.speed * 30 / np.pi:.0f} rpm lies beyond the heat table, which ends at "
            f"{speeds[-1] * 30 / np.pi:.0f} rpm; its last segment was continued."
        )
        warnings = (CodedWarning("heat_table_extrapolated", text),)
    segment = int(np.clip(np.searchsorted(speeds, point.speed, side="right") - 1, 0, len(speeds) - 2))
    fraction = (point.speed - speeds[segment]) / (speeds[segment + 1] - speeds[segment])
    heat = {}
    for group, bearing in spec.bearings:
        values = table.heat[bearing.name]
        nominal = values[segment] + fraction * (values[segment + 1] - values[segment])
        slope = table.thrust_coefficient.get(bearing.name, 0.0)
        factor = 1.0 + slope * (point.thrust / table.reference_thrust - 1.0)
        heat[bearing.name] = max(0.0, nominal * factor) * group.heat_factor.value
    return heat, warnings


def heat_model_of(spec: MachineSpec) -> HeatModel:
    """The heat model that a definition asks for."""
    if spec.heat.model == "table":

        def model(
            point: OperatingPoint, temperatures: Mapping[str, BearingTemperatures]
        ) -> tuple[Mapping[str, BearingHeat], tuple[CodedWarning, ...]]:
            heat, warnings = table_heat(spec, point)
            return {name: BearingHeat(value, {"table": value}) for name, value in heat.items()}, warnings

        return model
    raise NotImplementedError
