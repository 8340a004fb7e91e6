"""A thermal model with its coefficients and loads, ready to be driven and differentiated.

One class for a machine with geometry and for a written network: where coefficients and load inputs
come from is behind :class:`ModelInputs`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.effects.framework.term import CHANNEL_FILM, FLOW, FLUID_PREFIX, Term
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.reduced.channel_operators import ChannelOperators
from spindle_fem.model.reduced.circuit_operators import CircuitOperators
from spindle_fem.model.reduced.class_operators import NO_CHANGES, ClassOperators
from spindle_fem.model.reduced.coefficient_directions import ConductingDirections
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.exponential_step import ExactPropagator
from spindle_fem.model.reduced.network_operators import NetworkTable
from spindle_fem.model.reduced.trbdf2_matrices import Propagator
from spindle_fem.model.thermal_model import ThermalModel, project
from spindle_fem.operation.coefficient_table import CoefficientTable
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]

# Numbers in remembered sums of operators.
MOST_SUMS = 4_000_000


class ModelInputs(Protocol):
    """Interface in which a machine with geometry and a written network differ.

    Attributes
    ----------
    network : ThermalNetwork or None
        None for a machine with geometry.
    table : CoefficientTable or NetworkTable
        What scales which coefficient.
    bearings : tuple of str
        Bearings, or sources of a network: what gives friction heat.
    heat_places : tuple of str
        Place of every first load input, W.
    channels : tuple of str
        Temperatures that can be read.
    load_names : tuple of str
        Load inputs: heats [W], then temperatures of fluids [K].
    inlet : str or None
        Load input that is the coolant's inlet temperature.
    """

    spec: MachineSpec | NetworkMachineSpec | None
    network: ThermalNetwork | None
    table: CoefficientTable | NetworkTable
    bearings: tuple[str, ...]
    heat_places: tuple[str, ...]
    channels: tuple[str, ...]
    load_names: tuple[str, ...]
    inlet: str | None

    def operating_key(self, point: OperatingPoint) -> tuple[float, ...]:
        """Quantities on which :meth:`base` depends."""

    def base(self, point: OperatingPoint) -> Mapping[str, float]:
        """Every coefficient at an operating point before factors."""

    def capacities(self) -> Mapping[str, float]:
        """Every capacity before factors."""

    def sigmas(self) -> Mapping[str, float]:
        """1 σ of the logarithm of every uncertain parameter."""

    def fluid_input(self, coefficient: str) -> str:
        """Load input that is the fluid of a film."""

    def ambient_input(self, place: str) -> str:
        """Load input that is the surroundings of a place."""

    def fluid_temperature(self, coefficient: str, inputs: Mapping[str, Any]) -> Any:
        """Temperature that a film's heat counts from, K; 0 for what conducts between solids."""

    def fluid_parameters(self, coefficient: str) -> tuple[str, ...]:
        """Names whose factors multiply :meth:`fluid_temperature`."""

    def heat_rows(self, bearing: str) -> tuple[int, ...]:
        """Positions among :attr:`heat_places` of the places that a bearing heats."""

    def own_terms(self, drive: Drive) -> tuple[Term, ...]:
        """Terms that are always there on a drive."""

    def load_inputs(
        self,
        names: Sequence[str],
        inputs: Array,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
    ) -> tuple[Array, dict[str, Array]]:
        """Load inputs (n, n_w) from inputs (n, m) of some names, and derivatives to logarithms."""

    def channel_operators(self, model: ThermalModel) -> ChannelOperators | None:
        """The coolant's channel on a model."""

    def propagator(self, storage: Array, conduction: Array, step: float) -> Propagator | ExactPropagator:
        """Matrices of one step [s] of a linear model."""


class FastModel:
    """A thermal model and what drives it.

    Parameters
    ----------
    model : ThermalModel
        Dense.
    spread : (r,) ndarray, optional
        How large each coordinate of the states is, as :class:`ConductingDirections` takes it.
    """

    def __init__(self, model: ThermalModel, inputs: ModelInputs, spread: Array | None = None) -> None:
        self.model, self.inputs = model, inputs
        self.spec, self.network, self.table = inputs.spec, inputs.network, inputs.table
        self.bearings, self.channels = inputs.bearings, inputs.channels
        self.heat_places, self.load_names = inputs.heat_places, inputs.load_names
        self.directions = ConductingDirections(model, spread)
        self.channel = inputs.channel_operators(model)
        self.point_rows = [self.channels.index(name) for name in model.probe_names]
        self._base: dict[tuple[float, ...], Array] = {}
        # Positions of coefficients that are the same at all operating points so far, and of the others.
        self._alike: tuple[int, ...] = tuple(range(len(model.coefficient_names)))
        self._moving: list[int] = []
        self._sums: dict[tuple[tuple[int, ...], bytes], Array] = {}
        self._scales: tuple[dict[str, float], Array] | None = None
        self._reached: dict[str, frozenset[str]] = {}
        self._rows: dict[str, tuple[int, ...]] = {}
        self._positions = {name: i for i, name in enumerate(model.coefficient_names)}
        self._fluid_rows = {name: i for i, name in enumerate(model.fluid_names)}
        self._fluid_columns = {
            name: self.load_names.index(inputs.fluid_input(name)) for name in model.fluid_names
        }
        self.circuits = None
        if getattr(self.spec, "circuits", ()):
            self.circuits = CircuitOperators(model, self.spec, self._fluid_columns)
        self._heat_loads = np.array([model.place(place) for place in self.heat_places])
        self._heat_loads = self._heat_loads.reshape(-1, model.size).T

    @property
    def names(self) -> MachineNames:
        """Names of places and coefficients."""
        return MachineNames(
            self.spec, self.model.place_names, tuple(self.model.fluid_names), self.table.groups
        )

    def __getstate__(self) -> dict[str, Any]:
        """Without sums that another process makes as fast as it reads them."""
        return {**self.__dict__, "_sums": {}}

    def sigmas(self, names: Sequence[str]) -> dict[str, float]:
        """1 σ of the logarithm of some parameters; 0 for those that are not uncertain."""
        known = self.inputs.sigmas()
        return {name: known.get(name, 0.0) for name in names}

    def projected(self, basis: Array, spread: Array | None = None) -> FastModel:
        """Project on a smaller basis, (r, s), given the spread of the states in it, (s,)."""
        return FastModel(project(self.model, basis, basis.T @ self.model.one), self.inputs, spread)

    # ------------------------------------------------------------- operators
    def storage(self, factors: Mapping[str, float], added: Mapping[str, float] = NO_CHANGES) -> Array:
        """Capacity matrix, (r, r) J/K; ``added`` is further capacity at places, J/K."""
        matrix = np.tensordot(self._capacities(factors), self.model.storage, axes=1)
        for place, capacity in added.items():
            mean = self.model.place(place)
            matrix += capacity * np.outer(mean, mean)
        return matrix

    def storage_by(self, factors: Mapping[str, float], parameters: Sequence[str]) -> dict[str, Array]:
        """Derivatives of the capacity matrix to the logarithms of parameters; absent where zero."""
        weights = self._capacities(factors)
        found = {}
        for parameter in parameters:
            targets = set(self.table.targets(parameter))
            rows = [i for i, n in enumerate(self.model.storage_names) if targets & set(self.table.groups[n])]
            if rows:
                found[parameter] = np.tensordot(weights[rows], self.model.storage[rows], axes=1)
        return found

    def _capacities(self, factors: Mapping[str, float]) -> Array:
        """Weight of every matrix of the storage."""
        capacities = self.inputs.capacities()
        return np.array([capacities[n] * self.table.scale(n, factors) for n in self.model.storage_names])

    def coefficients(
        self, point: OperatingPoint, factors: Mapping[str, float], changes: Mapping[str, float] = NO_CHANGES
    ) -> dict[str, float]:
        """Every coefficient of a class, the mean channel film included.

        Raises
        ------
        SpecError
            A change of something else, or one that follows an input that is not given.
        """
        values = self._values(point, factors, changes)
        found = dict(zip(self.model.coefficient_names, values.tolist(), strict=True))
        if self.channel is not None:
            found[CHANNEL_FILM] = float(self.channel.film(point, factors, changes)[0].mean())
        return found

    def _values(
        self, point: OperatingPoint, factors: Mapping[str, float], changes: Mapping[str, float]
    ) -> Array:
        """The model's own coefficients of a class, in their order."""
        key = self.inputs.operating_key(point)
        if key not in self._base:
            base = self.inputs.base(point)
            self._base[key] = np.array([base[name] for name in self.model.coefficient_names])
            moves = self._base[key] != next(iter(self._base.values()))
            moves[self._moving] = True
            self._moving = np.flatnonzero(moves).tolist()
            self._alike = tuple(np.flatnonzero(~moves).tolist())
        values = self._base[key] * self._scales_of(factors)
        for name, change in changes.items():
            if name in self._positions:
                values[self._positions[name]] *= change
            elif self.channel is None or name not in (FLOW, CHANNEL_FILM):
                known = did_you_mean(name, self.model.coefficient_names)
                raise SpecError("changes", f'"{name}" is no coefficient of this model.', known)
            if not np.isfinite(change):
                raise SpecError(
                    "changes",
                    f'the factor of "{name}" is {change}.',
                    "It may follow only inputs that the recording gives.",
                )
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
            As the table's ``factors`` gives them.
        changes : mapping of str to float
            Further factors on single coefficients, and on the flow.
        conductances : mapping of str to float, [W/K]
            From places to the ambient, beside the model's own films.
        """
        model = self.model
        values = self._values(point, factors, changes)
        conduction = np.tensordot(values[self._moving], model.operators[self._moving], axes=1)
        conduction += self._sum(self._alike, values)
        loads = np.zeros((model.size, len(self.load_names)))
        loads[:, : len(self.heat_places)] = self._heat_loads
        self._add_fluids(loads, model.fluid_names, values)
        outputs = np.zeros((len(self.channels), model.size))
        outputs[self.point_rows] = model.probes
        output_inputs = np.zeros((len(self.channels), len(self.load_names)))
        found = ClassOperators(conduction, loads, outputs, output_inputs)
        self._add_conductances(found, conductances)
        cooled: list[str] = []
        touched: dict[str, tuple[int, ...]] = {}
        for parameter in parameters:
            rows = self._rows_of(parameter)
            if rows:
                found.conduction_by[parameter] = self._sum(rows, values)
            films = self._films_among(rows)
            touched[parameter] = rows
            if films:
                found.loads_by[parameter] = np.zeros_like(loads)
                self._add_fluids(found.loads_by[parameter], films, values)
            if self.channel is not None and CHANNEL_FILM in self.reached(parameter):
                cooled.append(parameter)
                if rows:
                    found.conduction_by[parameter] = found.conduction_by[parameter].copy()
        if self.circuits is not None:
            self.circuits.add(found, values, touched)
        if self.channel is not None:
            self.channel.add(found, point, factors, changes, cooled)
        return found

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
        amounts = upper - lower
        rows = np.flatnonzero(upper != lower)
        loads = np.zeros((model.size, len(self.load_names)))
        films = self._films_among(rows)
        self._add_fluids(loads, films, amounts)
        found = ClassOperators(
            np.tensordot(amounts[rows], model.operators[rows], axes=1),
            loads,
            np.zeros((len(self.channels), model.size)),
            np.zeros((len(self.channels), len(self.load_names))),
        )
        differences = {
            place: conductances[0].get(place, 0.0) - conductances[1].get(place, 0.0)
            for place in {*conductances[0], *conductances[1]}
        }
        self._add_conductances(found, differences)
        if self.circuits is not None:
            self.circuits.add_difference(found, upper, lower)
        if self.channel is not None:
            self.channel.add_difference(found, point, factors, changes)
        return found

    def _films_among(self, rows: Iterable[int]) -> list[str]:
        """Films among coefficients at some positions."""
        names = (self.model.coefficient_names[row] for row in rows)
        return [name for name in names if name in self._fluid_rows]

    def _add_fluids(self, loads: Array, films: Sequence[str], values: Array) -> None:
        """Add what the fluids of some films put in, in place; ``values`` are of all coefficients."""
        for name in films:
            load = self.model.fluid_load[self._fluid_rows[name]]
            loads[:, self._fluid_columns[name]] += values[self._positions[name]] * load

    def _add_conductances(self, operators: ClassOperators, conductances: Mapping[str, float]) -> None:
        """Add conductances [W/K] from places to the surroundings, in place."""
        for place, conductance in conductances.items():
            mean, column = self.model.place(place), self.load_names.index(self.inputs.ambient_input(place))
            operators.conduction[...] += conductance * np.outer(mean, mean)
            operators.loads[:, column] += conductance * mean

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

    # ----------------------------------------------------------------- inputs
    @property
    def propagator(self) -> Any:
        """Matrices of one step from storage, conduction and its length [s]."""
        return self.inputs.propagator

    @property
    def inlet_column(self) -> int | None:
        """Position of the coolant's inlet among the load inputs; None without a coolant."""
        return None if self.inputs.inlet is None else self.load_names.index(self.inputs.inlet)

    @property
    def fluid_places(self) -> dict[str, str]:
        """Coefficient of the film of every fluid that a term may shift, by the fluid's name."""
        return {FLUID_PREFIX + name.partition(".")[2]: name for name in self.model.fluid_names}

    def fluid_temperature(self, coefficient: str, inputs: Mapping[str, Any]) -> Any:
        """Temperature that a film's heat counts from, K; 0 for what conducts between solids."""
        return self.inputs.fluid_temperature(coefficient, inputs) if coefficient in self._fluid_rows else 0.0

    def fluid_parameters(self, coefficient: str) -> tuple[str, ...]:
        """Names whose factors multiply :meth:`fluid_temperature`."""
        return self.inputs.fluid_parameters(coefficient)

    def heat_rows(self, bearing: str) -> tuple[int, ...]:
        """Positions among :attr:`heat_places` of the places that a bearing heats."""
        return self.inputs.heat_rows(bearing)

    def own_terms(self, drive: Drive) -> tuple[Term, ...]:
        """Terms that are always there: the model's own, and heat that the drive gives."""
        return self.inputs.own_terms(drive)

    def load_inputs(
        self,
        names: Sequence[str],
        inputs: Array,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
    ) -> tuple[Array, dict[str, Array]]:
        """Load inputs, in the order of :attr:`load_names`.

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
        return self.inputs.load_inputs(names, inputs, factors, parameters)

    def require_channels(self, probes: Sequence[str], where: str) -> NDArray[np.int64]:
        """Rows of the outputs for the probes of a recording.

        Raises
        ------
        SpecError
            Probes that the machine does not have.
        """
        unknown = [probe for probe in probes if probe not in self.channels]
        if unknown:
            listing = ", ".join(f'"{probe}"' for probe in unknown)
            raise SpecError(
                where, f"reads {listing}, no channel of this model.", did_you_mean(unknown[0], self.channels)
            )
        return np.array([self.channels.index(probe) for probe in probes], dtype=np.int64)
