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
from spindle_fem.physics.coolant.linear_march import linearise_march
from spindle_fem.physics.coolant.march import march_enthalpy
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.physics.coolant.regimes import (
    ChannelState,
    FilmCoefficient,
    select_film,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ChannelField:
    """Film and coolant of every cell of every design.

    Attributes
    ----------
    film : (n, n_starts, n_along) ndarray, [W/(m²·K)]
        Factors and ports included.
    capacity : (n, n_starts, n_along) ndarray, [J/(kg·K)]
    heat : (n, n_starts, n_along) ndarray, [W]
        From the wall, at the wall temperatures that were given.
    bulk, outlet_edge : ndarray, [K]
        (n, n_starts, n_along) and (n, n_starts).
    enthalpy_rise : (n,) ndarray, [W]
    source : FilmCoefficient
        As the correlations gave it, before factors.
    """

    film: Array
    capacity: Array
    heat: Array
    bulk: Array
    outlet_edge: Array
    enthalpy_rise: Array
    source: FilmCoefficient


class ChannelBatch:
    """Coolant of designs of one channel.

    Parameters
    ----------
    band : (n, n_along) ndarray, optional
        Further factor on the film of each cell.
    """

    def __init__(self, model: ThermalModel, inputs: DesignInputs, band: Array | None = None) -> None:
        spec = inputs.specs[0]
        self.settings = spec.coolant
        self.coolant = coolant_by_name(spec.coolant.fluid)
        self.loop = CoolantLoop(spec, cells_of_model(model))
        self.section = self.loop.section
        self.area = model.cell_area
        self.inlet = inputs.inlet[:, None, None]
        self.flow = inputs.flow[:, None, None]
        at_inlet = self.coolant.properties(self.inlet)
        self.mass_flow = at_inlet.density * self.flow / self.section.starts
        factor = inputs.film_factor[:, None] * self.loop.cell_factors(inputs.flow, inputs.inlet)
        self.factor = (factor if band is None else factor * band)[:, None, :]
        self.local = self.settings.properties_at == "bulk"
        self.pumping: Array = np.zeros((len(inputs), *self.area.shape))
        if self.settings.pumping_heat:
            drops = pressure_drops(self.loop, inputs)
            power = np.array([item.pumping_power for item in drops])[:, None, None]
            share = self.area / self.area.sum(axis=1, keepdims=True) / self.section.starts
            self.pumping = power * share
        self._fixed: tuple[FilmCoefficient, Array] | None = None

    def at(self, wall: Array, before: ChannelField | None = None) -> ChannelField:
        """Films and heat at wall temperatures, (n, n_starts, n_along) K.

        Properties along the channel follow from ``before``, so that they
        settle together with the walls.

        Raises
        ------
        OutOfValidityError
            A temperature outside the coolant's range.
        """
        if self.local:
            bulk = np.broadcast_to(self.inlet, wall.shape) if before is None else before.bulk
            found = select_film(
                self.settings.film_model, self.section, ChannelState(self.coolant, self.flow, bulk, wall)
            )
            film = self.factor * np.broadcast_to(found.value, wall.shape)
            capacity = self._mean_capacity(wall, film, before)
        else:
            if self._fixed is None:
                state = ChannelState(self.coolant, self.flow, self.inlet)
                at_inlet = select_film(self.settings.film_model, self.section, state)
                capacity = self.coolant.properties(self.inlet).specific_heat_capacity
                self._fixed = at_inlet, np.broadcast_to(capacity, wall.shape)
            found, capacity = self._fixed
            film = self.factor * np.broadcast_to(found.value, wall.shape)
        march = march_enthalpy(self.inlet, self.mass_flow, capacity, wall, self.area, film, self.pumping)
        rise = (self.mass_flow * capacity * np.diff(march.edge_rise, axis=-1)).sum(axis=(1, 2))
        return ChannelField(
            film, capacity, march.heat, march.bulk_temperature, march.edge_temperature[..., -1], rise, found
        )

    def _mean_capacity(self, wall: Array, film: Array, before: ChannelField | None) -> Array:
        """Mean heat capacity between the ends of each cell; Simpson is exact for the properties used."""
        if before is None:
            capacity = self.coolant.properties(self.inlet).specific_heat_capacity
            return np.broadcast_to(capacity, wall.shape)
        gained = np.cumsum((before.heat + self.pumping) / (self.mass_flow * before.capacity), axis=-1)
        end = self.inlet + gained
        start = np.concatenate((np.broadcast_to(self.inlet, (*end.shape[:-1], 1)), end[..., :-1]), axis=-1)
        values = [
            self.coolant.properties(place).specific_heat_capacity
            for place in (start, 0.5 * (start + end), end)
        ]
        return (values[0] + 4.0 * values[1] + values[2]) / 6.0

    def linear(self, state: ChannelField) -> tuple[Array, Array]:
        """Heat of the cells from wall temperatures: matrix (n, starts, cells, cells) and constant."""
        line = linearise_march(
            self.inlet, self.mass_flow, state.capacity, self.area, state.film, self.pumping
        )
        return line.matrix, line.constant


def pressure_drops(loop: CoolantLoop, inputs: DesignInputs) -> list[PressureDrop]:
    """Pressure drop of every design, at inlet properties."""
    return [
        loop.pressure_drop(point.coolant_flow, point.coolant_inlet_temperature) for point in inputs.points
    ]
