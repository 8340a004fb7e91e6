"""The coolant of many designs at once: films, march and its linear form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.reduced.design_inputs import DesignInputs
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.channel_cells import cells_of_model
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.physics.coolant.duct_friction import PressureDrop
from spindle_fem.physics.coolant.linear_march import march_maps
from spindle_fem.physics.coolant.march import ChannelMarch, DrivenChannel, MarchResult

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ChannelField:
    """Film and coolant of every cell of every design.

    Attributes
    ----------
    film : (n, n_starts, n_along) ndarray, [W/(m²·K)]
        Factors and ports included.
    channel : ChannelMarch
        Its film as the correlations gave it, before factors.
    """

    film: Array
    channel: ChannelMarch

    @property
    def march(self) -> MarchResult:
        """March at the given wall temperatures, cells of shape (n, n_starts, n_along)."""
        return self.channel.march

    @property
    def enthalpy_rise(self) -> Array:
        """Enthalpy rise of each design, all channels, (n,) [W]."""
        gained = self.march.specific_heat_capacity * np.diff(self.march.edge_rise, axis=-1)
        return (self.channel.mass_flow * gained).sum(axis=(1, 2))


class ChannelBatch:
    """Coolant of designs of one channel.

    Parameters
    ----------
    band : (n, n_along) ndarray, optional
        Further factor on the film of each cell.
    """

    def __init__(self, model: ThermalModel, inputs: DesignInputs, band: Array | None = None) -> None:
        spec = inputs.specs[0]
        self.loop = loop = CoolantLoop(spec, cells_of_model(model))
        self.inlet = inputs.inlet[:, None, None]
        factor = inputs.film_factor[:, None] * loop.cell_factors(inputs.flow, inputs.inlet)
        self.factor = (factor if band is None else factor * band)[:, None, :]
        power: Array = np.zeros(len(inputs))
        if spec.coolant.pumping_heat:
            power = np.array([item.pumping_power for item in pressure_drops(loop, inputs)])
        self.driven = DrivenChannel(
            loop.section,
            loop.coolant,
            inputs.flow[:, None, None],
            self.inlet,
            model.cell_area,
            loop.film_choice(self.factor),
            power[:, None, None],
        )

    def at(self, wall: Array, before: ChannelField | None = None) -> ChannelField:
        """Films and heat at wall temperatures, (n, n_starts, n_along) K.

        Properties along the channel follow from ``before``, so that they
        settle together with the walls.

        Raises
        ------
        OutOfValidityError
            A temperature outside the coolant's range.
        """
        found = self.driven.march(wall, None if before is None else before.channel)
        return ChannelField(self.factor * np.broadcast_to(found.film.value, wall.shape), found)

    def with_bounds(self, wall: Array, field: ChannelField) -> ChannelField:
        """Films with their low and high ends, at wall temperatures (n, n_starts, n_along) K."""
        return ChannelField(field.film, self.driven.with_bounds(wall, field.channel))

    def linear(self, state: ChannelField) -> tuple[Array, Array]:
        """Heat of the cells from wall temperatures: matrix (n, starts, cells, cells) and constant."""
        march, capacity_rate = state.march, state.channel.mass_flow * state.march.specific_heat_capacity
        maps = march_maps(capacity_rate, self.driven.wetted_area, state.film, march.pumping_heat)
        from_inlet = maps.heat_from_wall.sum(axis=-1) * self.inlet
        return maps.heat_from_wall, maps.heat_from_friction - from_inlet


def pressure_drops(loop: CoolantLoop, inputs: DesignInputs) -> list[PressureDrop]:
    """Pressure drop of every design, at inlet properties."""
    return [
        loop.pressure_drop(point.coolant_flow, point.coolant_inlet_temperature) for point in inputs.points
    ]
