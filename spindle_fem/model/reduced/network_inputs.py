"""A thermal network that the user wrote, as a fast model.

Its nodes are the unknowns, its links the coefficients, its boundaries the
fluids and its sources the bearings, so that terms, drives, sensitivities and
everything built on them work on it as on a machine with geometry.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.effects.framework.term import COVARIATE, RecordedHeat, Term
from spindle_fem.errors import SpecError
from spindle_fem.model.lumped.driven_inputs import boundary_temperatures, source_heat
from spindle_fem.model.lumped.thermal_network import Parameter, ThermalNetwork
from spindle_fem.model.reduced.channel_operators import ChannelOperators
from spindle_fem.model.reduced.class_operators import NO_CHANGES
from spindle_fem.model.reduced.drive import (
    LARGEST_STEP,
    STANDARD,
    Drive,
    inputs_on_steps,
    level_covariates,
)
from spindle_fem.model.reduced.exponential_step import build_exact_propagator
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.network_operators import (
    LINK,
    NetworkTable,
    boundary_of_links,
    network_thermal_model,
)
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.align import Recording
from spindle_fem.solvers.network_start import (
    initial_parameters,
    initial_state,
    magnitude_history,
    require_compatible,
)

Array = NDArray[np.float64]


def fast_network(network: ThermalNetwork, spec: NetworkMachineSpec | None = None) -> FastModel:
    """Fast model of a written network: unknowns are the nodes, which are its places and channels.

    Parameters
    ----------
    network : ThermalNetwork
        Constants only: no laws, no streams.
    spec : NetworkMachineSpec or None
        What it was written as.

    Raises
    ------
    SpecError
        Laws or streams.
    """
    inputs = NetworkInputs(network, spec)
    return FastModel(network_thermal_model(network, tuple(inputs.boundary_of)), inputs)


class NetworkInputs:
    """Implementation of :class:`spindle_fem.model.reduced.fast_model.ModelInputs` for a written network.

    Parameters are factors named ``conductance.<link>``, ``capacity.<node>``,
    ``gain.<source>``, ``temperature.<boundary>`` (of the absolute temperature
    of a boundary that no input drives) and ``initial.<node>``.

    Parameters
    ----------
    network, spec
        As :func:`fast_network` takes them.

    Attributes
    ----------
    bearings : tuple of str
        Sources.
    heat_places : tuple of str
        Node of each source.
    channels : tuple of str
        Nodes.
    load_names : tuple of str
        ``source.<source>``, then ``boundary.<boundary>``.
    boundary_of : mapping of str to str
        Boundary of every link that ends at one, by coefficient.
    ambient_boundary : str or None
        Boundary that represents the surroundings: that named ``ambient``, or the only one.
    """

    inlet = None
    propagator = staticmethod(build_exact_propagator)

    def __init__(self, network: ThermalNetwork, spec: NetworkMachineSpec | None = None) -> None:
        self.network, self.spec = network, spec
        self.table = NetworkTable.of(network)
        self.bearings = network.source_names
        self.heat_places = tuple(network.node_names[node] for node in network.source_node)
        self.channels = network.node_names
        self.load_names = (
            *(f"source.{name}" for name in network.source_names),
            *(f"boundary.{name}" for name in network.boundary_names),
        )
        names = network.boundary_names
        self.ambient_boundary = "ambient" if "ambient" in names else names[0] if len(names) == 1 else None
        self.boundary_of = boundary_of_links(network)

    def channel_operators(self, model: ThermalModel) -> ChannelOperators | None:
        """A network has no coolant."""
        return None

    # ------------------------------------------------------------- coefficients
    def operating_key(self, point: OperatingPoint) -> tuple[float, ...]:
        """Empty key: links conduct as they are written."""
        return ()

    def base(self, point: OperatingPoint) -> dict[str, float]:
        """Conductance of every link, W/K."""
        names = (f"{LINK}{name}" for name in self.network.link_names)
        return dict(zip(names, self.network.link_conductance.tolist(), strict=True))

    def capacities(self) -> dict[str, float]:
        """Capacity of every node, J/K."""
        names = (f"capacity.{name}" for name in self.network.node_names)
        return dict(zip(names, self.network.capacity.tolist(), strict=True))

    def sigmas(self) -> dict[str, float]:
        """1 σ of the logarithm of every uncertain parameter."""
        return {item.name: item.sigma_log for item in self.network.parameters}

    # ------------------------------------------------------------------- fluids
    def fluid_input(self, coefficient: str) -> str:
        """Load input that is the boundary of a link."""
        return f"boundary.{self.boundary_of[coefficient]}"

    def ambient_input(self, place: str) -> str:
        """Load input for the surroundings of a node.

        Raises
        ------
        SpecError
            No boundary represents them.
        """
        if self.ambient_boundary is None:
            raise SpecError(
                place,
                "is joined to the surroundings, but no boundary stands for them.",
                'Name one of the boundaries "ambient".',
            )
        return f"boundary.{self.ambient_boundary}"

    def fluid_temperature(self, coefficient: str, inputs: Mapping[str, Any]) -> Any:
        """Nominal temperature of the boundary that a link ends at, K."""
        return self._boundary_value(self.boundary_of[coefficient], inputs)

    def _boundary_value(self, boundary: str, inputs: Mapping[str, Any]) -> Any:
        position = self.network.boundary_names.index(boundary)
        driven = self.network.boundary_input[position]
        return float(self.network.boundary_temperature[position]) if driven is None else inputs[driven]

    def fluid_parameters(self, coefficient: str) -> tuple[str, ...]:
        """Names whose factors multiply :meth:`fluid_temperature`."""
        name = f"temperature.{self.boundary_of.get(coefficient, '')}"
        return (name,) if name in self.table.names else ()

    def own_terms(self, drive: Drive) -> tuple[Term, ...]:
        """Heat of nodes that a recording gives and no source takes already."""
        return tuple(
            RecordedHeat(name)
            for name in drive.names
            if name.startswith("heat.") and name not in self.network.input_names
        )

    def load_inputs(
        self,
        names: Sequence[str],
        inputs: Array,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
    ) -> tuple[Array, dict[str, Array]]:
        """Heat of every source [W] and temperature of every boundary [K], and derivatives.

        Parameters and returns as :meth:`FastModel.load_inputs`.
        """
        network = self.network
        column = {name: inputs[:, position] for position, name in enumerate(names)}
        heat = source_heat(network, column, len(inputs))
        friction, friction_by = self.friction_loads(heat, factors, parameters)
        found = np.zeros((len(inputs), len(self.load_names)))
        found[:, : friction.shape[1]] = friction
        by = {name: np.zeros_like(found) for name in friction_by}
        for name, part in friction_by.items():
            by[name][:, : part.shape[1]] = part
        found[:, len(self.bearings) :] = boundary_temperatures(network, column, len(inputs))
        for place, boundary in enumerate(network.boundary_names, len(self.bearings)):
            name = f"temperature.{boundary}"
            found[:, place] *= factors.get(name, 1.0)
            if name in parameters:
                by[name] = np.zeros_like(found)
                by[name][:, place] = found[:, place]
        return found, by

    def heat_rows(self, bearing: str) -> tuple[int, ...]:
        """Position among :attr:`heat_places` of a source."""
        return (self.bearings.index(bearing),)

    def friction_loads(
        self, heat: Array, factors: Mapping[str, float], parameters: Sequence[str] = ()
    ) -> tuple[Array, dict[str, Array]]:
        """Heat of every source with factors, (n, n_sources) W, and derivatives."""
        scales = np.array([factors.get(f"gain.{name}", 1.0) for name in self.bearings])
        loads, by = heat * scales, {}
        for position, name in enumerate(self.bearings):
            if f"gain.{name}" in parameters:
                by[f"gain.{name}"] = np.zeros_like(loads)
                by[f"gain.{name}"][:, position] = loads[:, position]
        return loads, by

    # ------------------------------------------------------------- recordings
    def drive(self, recording: Recording, *, largest_step: float = LARGEST_STEP) -> Drive:
        """Inputs of a recording on the steps of its own grid; long gaps start anew.

        Every input of the recording is there, by the name of what it drives,
        also those that the network does not use; and ``ambient``, the nominal
        temperature of the surroundings where none is recorded.

        Raises
        ------
        FaultsError
            The recording does not fit the network.
        """
        notes = require_compatible(self.network, recording)
        history = magnitude_history(self.network, recording, recording.input_names)
        names, values, held = history.names, history.values, history.held
        if "ambient" not in names and self.ambient_boundary is not None:
            first = self._boundary_value(self.ambient_boundary, dict.fromkeys(names, 0.0))
            position = self.network.boundary_names.index(self.ambient_boundary)
            driven = self.network.boundary_input[position]
            room = np.full(len(values), first) if driven is None else values[:, names.index(driven)]
            names, values = (*names, "ambient"), np.column_stack((values, room))
            held = np.append(held, driven is None or held[names.index(driven)])
        for name, column in recording.covariate_history().items():
            names, values = (*names, COVARIATE + name), np.column_stack((values, column))
            held = np.append(held, False)
        breaks = recording.times[recording.segments[1:, 0]]
        grid, start, end = inputs_on_steps(recording.times, values, held, largest_step, breaks)
        level_covariates(names, start, end)
        restarts = tuple(int(i) for i in np.searchsorted(grid, breaks - 1e-9))
        means = dict(zip(names, (0.5 * (start + end)).mean(axis=0).tolist(), strict=True))
        point = OperatingPoint(*(means.get(name, np.nan) for name in STANDARD))
        classes = np.zeros(len(start), dtype=np.int64)
        return Drive(recording.times, grid, names, start, end, classes, (point,), notes, restarts)

    def initial_parameters(self, recording: Recording) -> tuple[Parameter, ...]:
        """Temperatures at the start of a recording with their priors, named ``initial.<node>``."""
        return initial_parameters(self.network, recording)

    def start(
        self,
        recording: Recording,
        drive: Drive,
        parameters: Mapping[str, float] = NO_CHANGES,
        derivatives: Sequence[str] = (),
        *,
        kind: str = "first_reading",
        initial: Sequence[Parameter] = (),
    ) -> Start:
        """Temperatures at the start of a recording and after its long gaps.

        Parameters
        ----------
        drive : Drive
            Of the same recording, by :meth:`drive`.
        parameters : mapping of str to float
            Factors; those of terms and unknown ones are left aside.
        kind : {"first_reading", "ambient", "steady"}
            As :func:`initial_state` has it; terms do not enter.
        initial : sequence of Parameter
            Of :meth:`initial_parameters`; the factors ``initial.<node>`` multiply them.
        """
        factors = {name: value for name, value in parameters.items() if name in self.table.names}
        network = self.moved(factors)
        history = magnitude_history(network, recording)
        begun = tuple(replace(p, value=p.value * factors.get(p.name, 1.0)) for p in initial)
        asked = tuple(
            self._parameter(network, name)
            for name in derivatives
            if name in self.table.names and not name.startswith("initial.")
        )
        states = np.empty((len(recording.segments), network.n_nodes))
        by: dict[str, Array] = {}
        for segment, (begin, end) in enumerate(recording.segments):
            # Free starting temperatures belong to the first segment; later ones start from their readings.
            chosen = (*asked, *begun) if segment == 0 else asked
            readings = recording.first_readings(segment)
            state, slope = initial_state(network, history.cut(begin, end), readings, chosen, kind=kind)
            states[segment] = state
            for column, item in enumerate(chosen):
                by.setdefault(item.name, np.zeros_like(states))[segment] = slope[:, column]
        points = np.array([0, *drive.restarts], dtype=np.int64)
        return Start(points, states, {name: part for name, part in by.items() if name in derivatives})

    def moved(self, factors: Mapping[str, float]) -> ThermalNetwork:
        """The network with factors on its numbers."""
        network = self.network

        def scaled(kind: str, names: Sequence[str], values: Array) -> Array:
            return values * np.array([factors.get(f"{kind}.{name}", 1.0) for name in names])

        return replace(
            network,
            capacity=scaled("capacity", network.node_names, network.capacity),
            link_conductance=scaled("conductance", network.link_names, network.link_conductance),
            source_gain=scaled("gain", network.source_names, network.source_gain),
            boundary_temperature=scaled("temperature", network.boundary_names, network.boundary_temperature),
        )

    @staticmethod
    def _parameter(network: ThermalNetwork, name: str) -> Parameter:
        kind, _, label = name.partition(".")
        of_kind = {
            "capacity": (network.node_names, network.capacity, "J/K"),
            "conductance": (network.link_names, network.link_conductance, "W/K"),
            "gain": (network.source_names, network.source_gain, ""),
            "temperature": (network.boundary_names, network.boundary_temperature, "K"),
        }
        labels, values, unit = of_kind[kind]
        index = labels.index(label)
        return Parameter(name, kind, index, float(values[index]), 1.0, unit)
