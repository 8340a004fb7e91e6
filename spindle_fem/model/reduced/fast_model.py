"""A machine's reduced model with its coefficients, ready to be driven and differentiated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.effects.framework.term import CHANNEL_FILM, FLOW, FLUID_PREFIX, RecordedHeat, Term
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.reduced.coefficient_directions import ConductingDirections
from spindle_fem.model.reduced.coolant_maps import CoolantMaps, UniformFilmMaps, coolant_maps, film_derivative
from spindle_fem.model.reduced.drive import Drive, WarmedPoint
from spindle_fem.model.reduced.natural_films import natural_film_terms
from spindle_fem.model.reduced.trbdf2_matrices import build_propagator
from spindle_fem.model.thermal_model import ThermalModel, project
from spindle_fem.operation.bearing_heat import heat_of_table
from spindle_fem.operation.channel_cells import cells_of_model
from spindle_fem.operation.coefficient_table import (
    INNER_SHARE,
    CoefficientTable,
    build_coefficient_table,
)
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.operation.heat_shares import BODIES, heat_share_slopes, heat_shares
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]

# Films of cells that differ by no more are one film.
ROUND_OFF = 1e-14
# Films that are remembered: runs whose films follow the wall have new ones each time.
MOST_FILMS = 2000
# Numbers in remembered sums of operators.
MOST_SUMS = 4_000_000
NO_CHANGES: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class ClassOperators:
    """Operators of one operating class and their derivatives.

    ``K u = W w`` with ``w`` the load inputs of :attr:`FastModel.load_names`.

    Attributes
    ----------
    conduction : (r, r) ndarray
    loads : (r, n_w) ndarray
    outputs : (n_out, r) ndarray
        Temperature channels from the unknowns.
    output_inputs : (n_out, n_w) ndarray
        And from the load inputs, for the coolant's outlet.
    conduction_by : mapping of parameter to (r, r) ndarray
        Derivatives to logarithms; absent where zero. Likewise the others.
    loads_by, outputs_by, output_inputs_by : mapping of parameter to ndarray
    """

    conduction: Array
    loads: Array
    outputs: Array
    output_inputs: Array
    conduction_by: Mapping[str, Array]
    loads_by: Mapping[str, Array]
    outputs_by: Mapping[str, Array]
    output_inputs_by: Mapping[str, Array]


class FastModel:
    """Reduced model and definition of one machine.

    Parameters
    ----------
    model : ThermalModel
    spec : MachineSpec
        The machine that the model was made of, or one that differs only in
        coefficients, operation and effects.
    extra_terms : sequence of Term
        Always there, as the machine's natural films are: with a tabulated
        machine, its :class:`spindle_fem.model.reduced.film_heat.FilmHeat`.
    spread : (r,) ndarray, optional
        How large each coordinate of the states is, as :class:`ConductingDirections` takes it.
    """

    def __init__(
        self,
        model: ThermalModel,
        spec: MachineSpec,
        extra_terms: Sequence[Term] = (),
        spread: Array | None = None,
    ) -> None:
        self.model = model
        self.spec = spec
        self.extra_terms = tuple(extra_terms)
        self.directions = ConductingDirections(model, spread)
        self.table: CoefficientTable = build_coefficient_table(spec, model.contacts, model.gap_radii)
        self.bearings = tuple(bearing.name for _, bearing in spec.bearings)
        self.channels = tuple(probe.name for probe in spec.probe)
        self._outlet_row = next(
            (row for row, probe in enumerate(spec.probe) if probe.kind == "coolant_outlet"), None
        )
        self._point_rows = [row for row, probe in enumerate(spec.probe) if probe.kind == "point"]
        self._base: dict[tuple[float, float], Array] = {}
        # Positions of coefficients that are the same at all operating points so far, and of the others.
        self._alike: tuple[int, ...] = tuple(range(len(model.coefficient_names)))
        self._moving: list[int] = []
        self._films: dict[tuple[float, float, bytes], tuple[Array, float, float]] = {}
        self._maps = UniformFilmMaps(model)
        self._sums: dict[tuple[tuple[int, ...], bytes], Array] = {}
        self._coolants: dict[tuple[float, float, float, bool], CoolantMaps] = {}
        self._scales: tuple[dict[str, float], Array] | None = None
        self._reached: dict[str, frozenset[str]] = {}
        self._rows: dict[str, tuple[int, ...]] = {}
        self.loop = CoolantLoop(spec, cells_of_model(model)) if spec.channel is not None else None
        self.fixed_fluids = tuple(
            dict.fromkeys(f.temperature for f in spec.film if f.temperature != "ambient")
        )
        friction = [
            f"{name}.{side}" for name in self.bearings for side in ("inner_raceway", "outer_raceway", "balls")
        ]
        self.heat_places = tuple(friction)
        fixed = tuple(f"fixed[{number}]" for number in range(len(self.fixed_fluids)))
        self.load_names = (*self.heat_places, "ambient", "coolant_inlet", "coolant_friction", *fixed)
        self._positions = {name: i for i, name in enumerate(model.coefficient_names)}
        self._fluid_rows = {name: i for i, name in enumerate(model.fluid_names)}
        self._fluid_columns = {name: self._column_of_fluid(name) for name in model.fluid_names}
        self._heat_loads = np.array([model.place(place) for place in friction]).reshape(-1, model.size).T

    @property
    def names(self) -> MachineNames:
        """Names of places and coefficients."""
        return MachineNames(
            self.spec, self.model.place_names, tuple(self.model.fluid_names), self.table.groups
        )

    def __getstate__(self) -> dict[str, Any]:
        """Without sums that another process makes as fast as it reads them."""
        return {**self.__dict__, "_sums": {}, "_coolants": {}}

    def sigmas(self, names: Sequence[str]) -> dict[str, float]:
        """1 σ of the logarithm of some of the machine's parameters; 0 for those that are not uncertain."""
        known = {item.name: item.sigma_log for item in uncertain_parameters(self.spec)}
        return {name: known.get(name, 0.0) for name in names}

    def projected(self, basis: Array, spread: Array | None = None) -> FastModel:
        """The same machine on a smaller basis, (r, s), in which states spread so far, (s,)."""
        return FastModel(
            project(self.model, basis, basis.T @ self.model.one), self.spec, self.extra_terms, spread
        )

    # ------------------------------------------------------------- operators
    def storage(self, factors: Mapping[str, float], added: Mapping[str, float] = NO_CHANGES) -> Array:
        """Capacity matrix, (r, r) J/K; ``added`` is further capacity at places, J/K."""
        capacities = self.table.capacities()
        weights = [capacities[name] * self.table.scale(name, factors) for name in self.model.storage_names]
        matrix = np.tensordot(np.array(weights), self.model.storage, axes=1)
        for place, capacity in added.items():
            mean = self.model.place(place)
            matrix += capacity * np.outer(mean, mean)
        return matrix

    def storage_by(self, factors: Mapping[str, float], parameters: Sequence[str]) -> dict[str, Array]:
        """Derivatives of the capacity matrix to the logarithms of parameters; absent where zero."""
        capacities = self.table.capacities()
        found = {}
        for parameter in parameters:
            targets = set(self.table.targets(parameter))
            rows = [i for i, n in enumerate(self.model.storage_names) if targets & set(self.table.groups[n])]
            if rows:
                names = [self.model.storage_names[i] for i in rows]
                weights = np.array([capacities[n] * self.table.scale(n, factors) for n in names])
                found[parameter] = np.tensordot(weights, self.model.storage[rows], axes=1)
        return found

    def channel_film(
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
            state = self.loop.at(replace(point, coolant_flow=flow), wall)
            rate = float(state.march.mass_flow * np.mean(state.march.march.specific_heat_capacity))
            friction = float(state.march.march.pumping_heat.sum()) if self.spec.coolant.pumping_heat else 0.0
            self._films[key] = (state.film_coefficient.ravel(), rate, friction)
        film, rate, friction = self._films[key]
        return (
            film * (self.table.scale(CHANNEL_FILM, factors) * changes.get(CHANNEL_FILM, 1.0)),
            rate,
            friction,
        )

    def coefficients(
        self, point: OperatingPoint, factors: Mapping[str, float], changes: Mapping[str, float] = NO_CHANGES
    ) -> dict[str, float]:
        """Every coefficient of a class, the mean channel film included."""
        values = self._values(point, factors, changes)
        found = dict(zip(self.model.coefficient_names, values.tolist(), strict=True))
        if self.loop is not None:
            found[CHANNEL_FILM] = float(self.channel_film(point, factors, changes)[0].mean())
        return found

    def _values(
        self, point: OperatingPoint, factors: Mapping[str, float], changes: Mapping[str, float]
    ) -> Array:
        """The model's own coefficients of a class, in their order."""
        key = (point.speed, point.ambient_temperature)
        if key not in self._base:
            base = self.table.base(point)
            self._base[key] = np.array([base[name] for name in self.model.coefficient_names])
            moves = self._base[key] != next(iter(self._base.values()))
            moves[self._moving] = True
            self._moving = np.flatnonzero(moves).tolist()
            self._alike = tuple(np.flatnonzero(~moves).tolist())
        values = self._base[key] * self._scales_of(factors)
        for name, change in changes.items():
            if name in self._positions:
                values[self._positions[name]] *= change
        return values

    def operators(
        self,
        point: OperatingPoint,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
        *,
        changes: Mapping[str, float] = NO_CHANGES,
        conductances: Mapping[str, float] = NO_CHANGES,
    ) -> ClassOperators:
        """Operators at an operating point with factors, and derivatives to some parameters.

        Parameters
        ----------
        point : OperatingPoint
            Of the class; heat, air and inlet temperature do not enter.
        factors : mapping of str to float
            As :meth:`CoefficientTable.factors` gives them.
        parameters : sequence of str
        changes : mapping of str to float
            Further factors on single coefficients, and on the flow.
        conductances : mapping of str to float, [W/K]
            From places to the ambient, beside the machine's own films.
        """
        model = self.model
        values = self._values(point, factors, changes)
        conduction = np.tensordot(values[self._moving], model.operators[self._moving], axes=1)
        conduction += self._sum(self._alike, values)
        loads = np.zeros((model.size, len(self.load_names)))
        loads[:, : len(self.heat_places)] = self._heat_loads
        for name in model.fluid_names:
            loads[:, self._fluid_columns[name]] += (
                values[self._positions[name]] * model.fluid_load[self._fluid_rows[name]]
            )
        for place, conductance in conductances.items():
            mean = model.place(place)
            conduction = conduction + conductance * np.outer(mean, mean)
            loads[:, self.load_names.index("ambient")] += conductance * mean
        outputs = np.zeros((len(self.channels), model.size))
        outputs[self._point_rows] = model.probes
        output_inputs = np.zeros((len(self.channels), len(self.load_names)))
        conduction_by, loads_by, outputs_by, output_inputs_by = {}, {}, {}, {}
        for parameter in parameters:
            rows = self._rows_of(parameter)
            if not rows:
                continue
            conduction_by[parameter] = self._sum(rows, values)
            films = [
                model.coefficient_names[i] for i in rows if model.coefficient_names[i] in self._fluid_rows
            ]
            if films:
                by = np.zeros_like(loads)
                for name in films:
                    load = model.fluid_load[self._fluid_rows[name]]
                    by[:, self._fluid_columns[name]] += values[self._positions[name]] * load
                loads_by[parameter] = by
        if self.loop is not None:
            film, rate, friction = self.channel_film(point, factors, changes)
            maps = self._coolant(film, rate, friction)
            conduction = conduction + maps.conduction
            self._add_coolant(loads, outputs, output_inputs, maps)
            for parameter in parameters:
                if CHANNEL_FILM in self.reached(parameter):
                    by = self._coolant(film, rate, friction, by_film=True)
                    conduction_by[parameter] = conduction_by.get(parameter, 0.0) + by.conduction
                    loads_by.setdefault(parameter, np.zeros_like(loads))
                    outputs_by[parameter] = np.zeros_like(outputs)
                    output_inputs_by[parameter] = np.zeros_like(output_inputs)
                    self._add_coolant(
                        loads_by[parameter], outputs_by[parameter], output_inputs_by[parameter], by
                    )
        return ClassOperators(
            conduction, loads, outputs, output_inputs, conduction_by, loads_by, outputs_by, output_inputs_by
        )

    def change(
        self,
        point: OperatingPoint,
        factors: Mapping[str, float],
        changes: tuple[Mapping[str, float], Mapping[str, float]],
        conductances: tuple[Mapping[str, float], Mapping[str, float]],
    ) -> ClassOperators:
        """Operators with the first of two sets of changes less those with the second, no derivatives.

        Only what differs is worked out. Arguments as :meth:`operators` takes them.
        """
        model = self.model
        upper, lower = (self._values(point, factors, own) for own in changes)
        rows = np.flatnonzero(upper != lower)
        amounts = (upper - lower)[rows]
        differs = [model.coefficient_names[row] for row in rows]
        conduction = np.tensordot(amounts, model.operators[rows], axes=1)
        loads = np.zeros((model.size, len(self.load_names)))
        for name, amount in zip(differs, amounts, strict=True):
            if name in self._fluid_rows:
                loads[:, self._fluid_columns[name]] += amount * model.fluid_load[self._fluid_rows[name]]
        for place in {*conductances[0], *conductances[1]}:
            amount = conductances[0].get(place, 0.0) - conductances[1].get(place, 0.0)
            mean = model.place(place)
            conduction += amount * np.outer(mean, mean)
            loads[:, self.load_names.index("ambient")] += amount * mean
        outputs = np.zeros((len(self.channels), model.size))
        output_inputs = np.zeros((len(self.channels), len(self.load_names)))
        if self.loop is not None:
            films = [self.channel_film(point, factors, own) for own in changes]
            if any(np.any(one != other) for one, other in zip(*films, strict=True)):
                one, other = (self._coolant(*film) for film in films)
                maps = CoolantMaps(*(getattr(one, n) - getattr(other, n) for n in CoolantMaps.__slots__))
                conduction += maps.conduction
                self._add_coolant(loads, outputs, output_inputs, maps)
        return ClassOperators(conduction, loads, outputs, output_inputs, {}, {}, {}, {})

    def _scales_of(self, factors: Mapping[str, float]) -> Array:
        """Factor on every coefficient, made once for the classes of a run."""
        if self._scales is None or self._scales[0] != factors:
            scales = [self.table.scale(name, factors) for name in self.model.coefficient_names]
            self._scales = dict(factors), np.array(scales)
        return self._scales[1]

    def reached(self, parameter: str) -> frozenset[str]:
        """Coefficients that a parameter scales."""
        if parameter not in self._reached:
            targets = set(self.table.targets(parameter))
            self._reached[parameter] = frozenset(
                name for name, group in self.table.groups.items() if targets & set(group)
            )
        return self._reached[parameter]

    def _rows_of(self, parameter: str) -> tuple[int, ...]:
        """Positions of the model's own coefficients that a parameter scales."""
        if parameter not in self._rows:
            reached = self.reached(parameter)
            self._rows[parameter] = tuple(i for name, i in self._positions.items() if name in reached)
        return self._rows[parameter]

    def _sum(self, rows: tuple[int, ...], values: Array) -> Array:
        """Weighted sum of some operators, shared by the classes that do not differ in them."""
        chosen = list(rows)
        key = (rows, values[chosen].tobytes())
        if key not in self._sums:
            if len(self._sums) * self.model.size**2 >= MOST_SUMS:
                self._sums.clear()
            found = np.tensordot(values[chosen], self.model.operators[chosen], axes=1)
            found.setflags(write=False)
            self._sums[key] = found
        return self._sums[key]

    def fluid_column(self, coefficient: str) -> int:
        """Load input that is the fluid of a film."""
        return self._fluid_columns[coefficient]

    def _column_of_fluid(self, coefficient: str) -> int:
        surface = coefficient.removeprefix("film.")
        film = next(f for f in self.spec.film if surface in f.surface)
        if film.temperature == "ambient":
            return self.load_names.index("ambient")
        return self.load_names.index(f"fixed[{self.fixed_fluids.index(film.temperature)}]")

    def _coolant(self, film: Array, rate: float, friction: float, *, by_film: bool = False) -> CoolantMaps:
        """Maps of the coolant or their derivative to the film; of one film for all cells, interpolated."""
        if film[0] > 0.0 and rate > 0.0 and np.ptp(film) <= ROUND_OFF * film[0]:
            key = (float(film[0]), rate, friction, by_film)
            if key not in self._coolants:
                # The classes of a run share a few films.
                if len(self._coolants) * self.model.size**2 >= MOST_SUMS:
                    self._coolants.clear()
                kind = self._maps.film_derivative if by_film else self._maps.maps
                self._coolants[key] = kind(*key[:3])
            return self._coolants[key]
        return (film_derivative if by_film else coolant_maps)(self.model, film, rate, friction)

    def _add_coolant(self, loads: Array, outputs: Array, output_inputs: Array, maps: CoolantMaps) -> None:
        inlet, friction = self.load_names.index("coolant_inlet"), self.load_names.index("coolant_friction")
        loads[:, inlet] += maps.inlet_load
        loads[:, friction] += maps.constant_load
        if self._outlet_row is not None:
            outputs[self._outlet_row] = maps.outlet
            output_inputs[self._outlet_row, inlet] = maps.outlet_inlet
            output_inputs[self._outlet_row, friction] = maps.outlet_constant

    @property
    def film_follows_wall(self) -> bool:
        """Whether the channel's film changes with the temperatures of coolant and wall along it."""
        return self.loop is not None and self.spec.coolant.properties_at == "bulk"

    def channel_walls(self, states: Array) -> Array:
        """Temperature of the channel's wall in each cell, (n, n_cells) K, from unknowns (n, r)."""
        return states @ (self.model.cell_load / self.model.cell_area.ravel()[:, None]).T

    # ----------------------------------------------------------------- inputs
    propagator = staticmethod(build_propagator)

    @property
    def inlet_column(self) -> int:
        """Position of the coolant's inlet among the load inputs."""
        return self.load_names.index("coolant_inlet")

    @property
    def fluid_places(self) -> dict[str, str]:
        """Coefficient of the film of every fluid that a term may shift, by the fluid's name."""
        return {FLUID_PREFIX + name.removeprefix("film."): name for name in self.model.fluid_names}

    def fluid_temperature(self, coefficient: str, inputs: Mapping[str, float]) -> float:
        """Temperature that a film's heat counts from, K; 0 for what conducts between solids."""
        if coefficient not in self._fluid_rows:
            return 0.0
        surface = coefficient.removeprefix("film.")
        film = next(f for f in self.spec.film if surface in f.surface)
        return inputs["ambient"] if film.temperature == "ambient" else film.temperature

    def fluid_parameters(self, coefficient: str) -> tuple[str, ...]:
        """Names whose factors multiply :meth:`fluid_temperature`; none here."""
        return ()

    def own_terms(self, drive: Drive) -> tuple[Term, ...]:
        """Terms that are always there: natural films, those given, and heat that the drive gives.

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
        recorded = tuple(RecordedHeat(name) for name in drive.names if name.startswith("heat."))
        return (*natural_film_terms(self.spec), *self.extra_terms, *recorded)

    def load_inputs(
        self,
        names: Sequence[str],
        inputs: Array,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
    ) -> tuple[Array, dict[str, Array]]:
        """Load inputs, in the order of :attr:`load_names`, of the machine's inputs.

        Parameters
        ----------
        names : sequence of str
            Of the columns of ``inputs``.
        inputs : (n, m) ndarray, SI
        factors : mapping of str to float
        parameters : sequence of str
            To differentiate by.

        Returns
        -------
        (n, n_w) ndarray
        mapping of parameter to (n, n_w) ndarray
            Derivatives to logarithms; absent where zero.
        """
        column = {name: inputs[:, position] for position, name in enumerate(names)}
        heat = heat_of_table(self.spec, column["speed"], column["thrust"])
        friction, friction_by = self.friction_loads(heat, factors, parameters)
        found = np.zeros((len(inputs), len(self.load_names)))
        found[:, : friction.shape[1]] = friction
        found[:, self.load_names.index("ambient")] = column["ambient"]
        found[:, self.inlet_column] = column["coolant_inlet"]
        found[:, self.load_names.index("coolant_friction")] = 1.0
        for number, temperature in enumerate(self.fixed_fluids):
            found[:, self.load_names.index(f"fixed[{number}]")] = temperature
        by = {}
        for name, part in friction_by.items():
            by[name] = np.zeros_like(found)
            by[name][:, : part.shape[1]] = part
        return found, by

    # ------------------------------------------------------------- heat shares
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
        parameters : sequence of str

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
        factor = factors.get(INNER_SHARE, 1.0)
        shares, moved = (
            np.array([found[body] for body in BODIES])
            for found in (heat_shares(settings, factor), heat_share_slopes(settings, factor))
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
                found += (scaled[:, :, None] * moved).reshape(len(heat), -1)
            if touched.any() or INNER_SHARE in targets:
                by[parameter] = found
        return loads, by

    def require_channels(self, probes: Sequence[str], where: str) -> NDArray[np.int64]:
        """Rows of the outputs for the probes of a recording.

        Raises
        ------
        SpecError
            A probe that the machine does not have.
        """
        for probe in probes:
            if probe not in self.channels:
                raise SpecError(
                    where, f'reads "{probe}", no probe of this machine.', did_you_mean(probe, self.channels)
                )
        return np.array([self.channels.index(probe) for probe in probes], dtype=np.int64)
