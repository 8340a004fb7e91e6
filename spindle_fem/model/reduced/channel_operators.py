"""Operators that the coolant adds to a model: its channel's film, what it carries away, its outlet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import CHANNEL_FILM, FLOW
from spindle_fem.model.reduced.class_operators import NO_CHANGES, ClassOperators
from spindle_fem.model.reduced.coolant_maps import CoolantMaps, UniformFilmMaps, coolant_maps, film_derivative
from spindle_fem.model.reduced.drive import WarmedPoint
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.channel_cells import cells_of_model
from spindle_fem.operation.coefficient_table import CoefficientTable
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]

# Films of cells that differ by no more are one film.
ROUND_OFF = 1e-14
# Films that are remembered: runs whose films follow the wall have new ones each time.
MOST_FILMS = 2000
# Numbers in remembered maps.
MOST_NUMBERS = 4_000_000


class ChannelOperators:
    """The coolant's channel of a machine on a model.

    Parameters
    ----------
    spec : MachineSpec
        With a channel.
    load_names : sequence of str
        Of the load inputs; ``coolant_inlet`` and ``coolant_friction`` among them.
    """

    def __init__(
        self, model: ThermalModel, spec: MachineSpec, table: CoefficientTable, load_names: Sequence[str]
    ) -> None:
        self.model, self.spec, self.table = model, spec, table
        self.loop = CoolantLoop(spec, cells_of_model(model))
        self._inlet = load_names.index("coolant_inlet")
        self._friction = load_names.index("coolant_friction")
        self._outlet_row = next(
            (row for row, probe in enumerate(spec.probe) if probe.kind == "coolant_outlet"), None
        )
        self._films: dict[tuple[float, float, bytes], tuple[Array, float, float]] = {}
        self._uniform = UniformFilmMaps(model)
        self._known: dict[tuple[float, float, float, bool], CoolantMaps] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Without maps that another process makes as fast as it reads them."""
        return {**self.__dict__, "_known": {}}

    def film(
        self, point: OperatingPoint, factors: Mapping[str, float], changes: Mapping[str, float] = NO_CHANGES
    ) -> tuple[Array, float, float]:
        """Film of each cell [W/(m²·K)], capacity rate of each start [W/K], friction heat [W].

        With the wall at inlet temperature unless the point knows the wall's
        (:class:`spindle_fem.model.reduced.drive.WarmedPoint`).
        """
        flow = point.coolant_flow * changes.get(FLOW, 1.0)
        warmed = point.channel_wall if isinstance(point, WarmedPoint) else None
        key = (flow, point.coolant_inlet_temperature, b"" if warmed is None else warmed.tobytes())
        if key not in self._films:
            if len(self._films) >= MOST_FILMS:
                self._films.clear()
            shape = self.model.cell_area.shape
            wall = (
                np.full(shape, point.coolant_inlet_temperature) if warmed is None else warmed.reshape(shape)
            )
            state = self.loop.at(replace(point, coolant_flow=flow), wall, bounds=False)
            rate = float(state.march.mass_flow * np.mean(state.march.march.specific_heat_capacity))
            friction = float(state.march.march.pumping_heat.sum()) if self.spec.coolant.pumping_heat else 0.0
            self._films[key] = (state.film_coefficient.ravel(), rate, friction)
        film, rate, friction = self._films[key]
        return (
            film * (self.table.scale(CHANNEL_FILM, factors) * changes.get(CHANNEL_FILM, 1.0)),
            rate,
            friction,
        )

    def add(
        self,
        operators: ClassOperators,
        point: OperatingPoint,
        factors: Mapping[str, float],
        changes: Mapping[str, float],
        scaled_by: Sequence[str],
    ) -> None:
        """Add the coolant to the operators of a class, in place.

        Parameters
        ----------
        point, factors, changes
            As :meth:`FastModel.operators` takes them.
        scaled_by : sequence of str
            Asked parameters that scale the channel's film.
        """
        film, rate, friction = self.film(point, factors, changes)
        self._put(
            self._maps(film, rate, friction),
            (operators.conduction, operators.loads, operators.outputs, operators.output_inputs),
        )
        for parameter in scaled_by:
            parts = tuple(
                by.setdefault(parameter, np.zeros_like(whole))
                for by, whole in (
                    (operators.conduction_by, operators.conduction),
                    (operators.loads_by, operators.loads),
                    (operators.outputs_by, operators.outputs),
                    (operators.output_inputs_by, operators.output_inputs),
                )
            )
            self._put(self._maps(film, rate, friction, by_film=True), parts)

    def add_difference(
        self,
        operators: ClassOperators,
        point: OperatingPoint,
        factors: Mapping[str, float],
        changes: tuple[Mapping[str, float], Mapping[str, float]],
    ) -> None:
        """Add what the coolant does under the first of two sets of changes less the second, in place."""
        films = [self.film(point, factors, own) for own in changes]
        if any(np.any(one != other) for one, other in zip(*films, strict=True)):
            one, other = (self._maps(*film) for film in films)
            maps = CoolantMaps(*(getattr(one, n) - getattr(other, n) for n in CoolantMaps.__slots__))
            parts = (operators.conduction, operators.loads, operators.outputs, operators.output_inputs)
            self._put(maps, parts)

    def _maps(self, film: Array, rate: float, friction: float, *, by_film: bool = False) -> CoolantMaps:
        """Maps of the coolant or their derivative to the film; of one film for all cells, interpolated."""
        if film[0] > 0.0 and rate > 0.0 and np.ptp(film) <= ROUND_OFF * film[0]:
            key = (float(film[0]), rate, friction, by_film)
            if key not in self._known:
                # The classes of a run share a few films.
                if len(self._known) * self.model.size**2 >= MOST_NUMBERS:
                    self._known.clear()
                kind = self._uniform.film_derivative if by_film else self._uniform.maps
                self._known[key] = kind(*key[:3])
            return self._known[key]
        return (film_derivative if by_film else coolant_maps)(self.model, film, rate, friction)

    def _put(self, maps: CoolantMaps, parts: tuple[Array, Array, Array, Array]) -> None:
        """Add maps to conduction, loads, outputs and outputs from load inputs, in place."""
        conduction, loads, outputs, output_inputs = parts
        conduction += maps.conduction
        loads[:, self._inlet] += maps.inlet_load
        loads[:, self._friction] += maps.constant_load
        if self._outlet_row is not None:
            outputs[self._outlet_row] = maps.outlet
            output_inputs[self._outlet_row, self._inlet] = maps.outlet_inlet
            output_inputs[self._outlet_row, self._friction] = maps.outlet_constant

    @property
    def film_follows_wall(self) -> bool:
        """Whether the film changes with the temperatures of coolant and wall along it."""
        return self.spec.coolant.properties_at == "bulk"

    def walls(self, states: Array) -> Array:
        """Temperature of the channel's wall in each cell, (n, n_cells) K, from unknowns (n, r)."""
        return states @ (self.model.cell_load / self.model.cell_area.ravel()[:, None]).T
