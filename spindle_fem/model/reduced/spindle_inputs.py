"""A machine with geometry as a fast model: its coefficients, the loads of its inputs, its own terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.effects.framework.term import RecordedHeat, Term
from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.channel_operators import ChannelOperators
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.natural_films import natural_film_terms
from spindle_fem.model.reduced.trbdf2_matrices import build_propagator
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.bearing_heat import heat_of_table
from spindle_fem.operation.coefficient_table import INNER_SHARE, build_coefficient_table
from spindle_fem.operation.heat_shares import heat_share_slopes, heat_shares
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.source_terms import heated_places, source_terms

Array = NDArray[np.float64]

SIDES = ("inner_raceway", "outer_raceway", "balls")


def fast_spindle(model: ThermalModel, spec: MachineSpec, extra_terms: Sequence[Term] = ()) -> FastModel:
    """Fast model of a machine with geometry.

    Parameters
    ----------
    spec : MachineSpec
        The machine that the model was made of, or one that differs only in
        coefficients, operation and effects.
    extra_terms : sequence of Term
        Always there, as the machine's natural films are: with a tabulated
        machine, its :class:`spindle_fem.model.reduced.film_heat.FilmHeat`.
    """
    return FastModel(model, SpindleInputs(model, spec, extra_terms))


class SpindleInputs:
    """Implementation of :class:`spindle_fem.model.reduced.fast_model.ModelInputs` with geometry.

    Parameters
    ----------
    model, spec, extra_terms
        As :func:`fast_spindle` takes them.
    """

    inlet = "coolant_inlet"
    network = None
    propagator = staticmethod(build_propagator)

    def __init__(self, model: ThermalModel, spec: MachineSpec, extra_terms: Sequence[Term] = ()) -> None:
        self.spec, self.extra_terms = spec, tuple(extra_terms)
        self.table = build_coefficient_table(spec, model.contacts, model.gap_radii)
        self.bearings = tuple(bearing.name for _, bearing in spec.bearings)
        self.channels = tuple(item.name for item in (*spec.probe, *spec.displacement_sensor))
        self.heat_places = tuple(f"{name}.{side}" for name in self.bearings for side in SIDES)
        still = [film for film in spec.film if not isinstance(film, StreamFilm)]
        self.fixed_fluids = tuple(dict.fromkeys(f.temperature for f in still if f.temperature != "ambient"))
        fixed = tuple(f"fixed[{number}]" for number in range(len(self.fixed_fluids)))
        self.inlets = {film.inlet_input: film.inlet_temperature for film in spec.circuits}
        self.load_names = (
            *self.heat_places, "ambient", "coolant_inlet", "coolant_friction", *fixed, *self.inlets
        )  # fmt: skip
        self._fluids = {f"film.{surface}": film.temperature for film in still for surface in film.surface}
        self._streams = {
            f"film.{surface}": film.inlet_input for film in spec.circuits for surface in film.surface
        }

    def channel_operators(self, model: ThermalModel) -> ChannelOperators | None:
        """The coolant's channel, if the machine has one."""
        if self.spec.channel is None:
            return None
        return ChannelOperators(model, self.spec, self.table, self.load_names)

    # ------------------------------------------------------------- coefficients
    def operating_key(self, point: OperatingPoint) -> tuple[float, ...]:
        """Speed and temperature of the surroundings: films and gaps follow them."""
        return (point.speed, point.ambient_temperature)

    def base(self, point: OperatingPoint) -> dict[str, float]:
        """Every coefficient at an operating point."""
        return self.table.base(point)

    def capacities(self) -> dict[str, float]:
        """Volumetric capacity of every material [J/(m³·K)] and capacity of every ball row [J/K]."""
        return self.table.capacities()

    def sigmas(self) -> dict[str, float]:
        """1 σ of the logarithm of every uncertain parameter."""
        return {item.name: item.sigma_log for item in uncertain_parameters(self.spec)}

    # ------------------------------------------------------------------- fluids
    def fluid_input(self, coefficient: str) -> str:
        """Load input that is the fluid of a film."""
        if coefficient in self._streams:
            return self._streams[coefficient]
        temperature = self._fluids[coefficient]
        return "ambient" if temperature == "ambient" else f"fixed[{self.fixed_fluids.index(temperature)}]"

    def ambient_input(self, place: str) -> str:
        """The surroundings, the same for all places."""
        return "ambient"

    def fluid_temperature(self, coefficient: str, inputs: Mapping[str, Any]) -> Any:
        """Temperature that a film's heat counts from, K."""
        if coefficient in self._streams:
            return inputs.get(self._streams[coefficient], self.inlets[self._streams[coefficient]])
        temperature = self._fluids[coefficient]
        return inputs["ambient"] if temperature == "ambient" else temperature

    def fluid_parameters(self, coefficient: str) -> tuple[str, ...]:
        """No parameters: factors leave the temperatures of fluids alone."""
        return ()

    # --------------------------------------------------------------------- loads
    def own_terms(self, drive: Drive) -> tuple[Term, ...]:
        """Terms always there: natural films, heat sources, those given, and heat that the drive gives.

        Raises
        ------
        SpecError
            Heat that is not by table.
        """
        if self.spec.heat.model != "table":
            raise SpecError(
                "heat.model",
                f'"{self.spec.heat.model}" follows the temperatures of every bearing.',
                'The fast model takes heat.model = "table"; recorded_model.fast_model_for makes one.',
            )
        recorded = tuple(RecordedHeat(name) for name in heated_places(self.spec, drive.names))
        return (*natural_film_terms(self.spec), *source_terms(self.spec), *self.extra_terms, *recorded)

    def load_inputs(
        self,
        names: Sequence[str],
        inputs: Array,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
    ) -> tuple[Array, dict[str, Array]]:
        """Friction of every bearing [W], temperatures of fluids [K], 1 for the coolant's friction.

        Parameters and returns as :meth:`FastModel.load_inputs`.
        """
        column = {name: inputs[:, position] for position, name in enumerate(names)}
        heat = heat_of_table(self.spec, column["speed"], column["thrust"])
        friction, friction_by = self.friction_loads(heat, factors, parameters)
        found = np.zeros((len(inputs), len(self.load_names)))
        found[:, : friction.shape[1]] = friction
        found[:, self.load_names.index("ambient")] = column["ambient"]
        found[:, self.load_names.index("coolant_inlet")] = column["coolant_inlet"]
        found[:, self.load_names.index("coolant_friction")] = 1.0
        for number, temperature in enumerate(self.fixed_fluids):
            found[:, self.load_names.index(f"fixed[{number}]")] = temperature
        for name, temperature in self.inlets.items():
            found[:, self.load_names.index(name)] = column.get(name, temperature)
        by = {}
        for name, part in friction_by.items():
            by[name] = np.zeros_like(found)
            by[name][:, : part.shape[1]] = part
        return found, by

    def heat_rows(self, bearing: str) -> tuple[int, ...]:
        """Positions among :attr:`heat_places` of the places that a bearing heats."""
        first = 3 * self.bearings.index(bearing)
        return (first, first + 1, first + 2)

    def friction_loads(
        self, heat: Array, factors: Mapping[str, float], parameters: Sequence[str] = ()
    ) -> tuple[Array, dict[str, Array]]:
        """Heat of every heat place from that of every bearing, and derivatives.

        Parameters
        ----------
        heat : (n, n_bearings) ndarray, [W]
            Before factors.
        factors : mapping of str to float

        Returns
        -------
        (n, n_heat_places) ndarray, [W]
        mapping of parameter to (n, n_heat_places) ndarray

        Raises
        ------
        SpecError
            The inner share leaves 0 to 1.
        """
        settings = self.spec.heat
        inner = settings.inner_share.value * factors.get(INNER_SHARE, 1.0)
        if not 0.0 <= inner <= 1.0:
            raise SpecError(INNER_SHARE, f"the share becomes {inner:g}.", "Allowed: 0 to 1.")
        own = factors.get(INNER_SHARE, 1.0)
        shares, share_slopes = (
            np.array(list(found.values()))
            for found in (heat_shares(settings, own), heat_share_slopes(settings, own))
        )
        scales = np.array(
            [np.prod([factors.get(name, 1.0) for name in self.table.heat_groups(b)]) for b in self.bearings]
        )
        scaled = heat * scales
        loads = (scaled[:, :, None] * shares).reshape(len(heat), -1)
        by = {}
        for parameter in parameters:
            targets = set(self.table.targets(parameter))
            touched = np.array([bool(targets & set(self.table.heat_groups(b))) for b in self.bearings])
            found = np.zeros_like(loads)
            if touched.any():
                found += (np.where(touched, scaled, 0.0)[:, :, None] * shares).reshape(len(heat), -1)
            if INNER_SHARE in targets:
                found += (scaled[:, :, None] * share_slopes).reshape(len(heat), -1)
            if touched.any() or INNER_SHARE in targets:
                by[parameter] = found
        return loads, by
