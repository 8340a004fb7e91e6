"""A test that has not been run yet, as the recording that it would produce."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_load import is_network_machine, load_network_machine
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.schedules import TEMPERATURE_STEP, Schedule, geometry_schedules, network_schedules
from spindle_fem.inference.schedules import standard_schedules as standard
from spindle_fem.machine.view.defined_point import defined_recording
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import ChannelNoise
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.units import ANGULAR_SPEED_UNIT, TEMPERATURE_UNIT, ZERO_CELSIUS_K, registry

Array = NDArray[np.float64]

# White noise of a temperature [K] and of a displacement [m], and length of a test of a machine with geometry
# [s], unless said otherwise. (Judgement.)
NOISE, DISPLACEMENT_NOISE, LENGTH = 0.1, 0.3e-6, 4.0 * 3600.0
# A network is watched for so many of its slowest time constants, within these limits [s].
TIME_CONSTANTS, SHORTEST, LONGEST = 4.0, 600.0, 24.0 * 3600.0
# Distance of readings, s, and most of them: longer tests are read less often.
SAMPLE, MOST_SAMPLES = 30.0, 2_000
# Longest test compared with the requested one, s.
LONGEST_COMPARED = 8.0 * 3600.0
ROOM = ZERO_CELSIUS_K + 20.0
# Inputs of a network whose size nothing says warm its hottest node by this in the end, others at rest, K.
USUAL_RISE = 30.0
STANDARD_TESTS = ("heat_up", "steps", "cool_down")
# SI base units of the inputs that every machine with geometry has.
UNITS = {
    "speed": ANGULAR_SPEED_UNIT,
    "thrust": "kilogram * meter / second ** 2",
    "ambient": TEMPERATURE_UNIT,
    "coolant_inlet": TEMPERATURE_UNIT,
    "coolant_flow": "meter ** 3 / second",
}


@dataclass(frozen=True, slots=True)
class Sensor:
    """Something that reads a temperature, or a displacement.

    Attributes
    ----------
    name : str
        Of its channel.
    probe : str
        Probe, node or displacement sensor that it reads.
    noise : float, [K, m]
        White, 1 σ.
    displaced : bool
        Whether it reads a displacement.
    """

    name: str
    probe: str
    noise: float
    displaced: bool = False


@dataclass(frozen=True, slots=True)
class Conditions:
    """Inputs of a machine in a test, and their standard values.

    Attributes
    ----------
    usual : mapping of str to float
        Every input at full load, SI.
    units : mapping of str to str
        SI base units of the inputs.
    driven : tuple of str
        Inputs that heat the machine.
    assumed : tuple of str
        Inputs whose size nothing says: as large as warms the hottest node by ``USUAL_RISE``.
    """

    spec: MachineSpec | NetworkMachineSpec
    network: ThermalNetwork | None
    usual: Mapping[str, float]
    units: Mapping[str, str]
    driven: tuple[str, ...]
    assumed: tuple[str, ...] = ()

    @property
    def start(self) -> float:
        """Temperature of everything before a test, K: the room's, or the mean of a network's boundaries."""
        if self.network is None:
            return self.usual["ambient"]
        driven = [self.usual[name] for name in self.network.boundary_input if name is not None]
        fixed = [float(value) for value in self.network.boundary_temperature if np.isfinite(value)]
        return float(np.mean(driven or fixed or [ROOM]))

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Everything that the definition can read, by name, with the usual noise."""
        if self.network is not None:
            return {name: Sensor(name, name, NOISE) for name in self.network.node_names}
        warm = {item.name: Sensor(item.name, item.name, NOISE) for item in self.spec.probe}
        moved = [item.name for item in self.spec.displacement_sensor]
        return warm | {name: Sensor(name, name, DISPLACEMENT_NOISE, displaced=True) for name in moved}

    @property
    def default_length(self) -> float:
        """Default duration of a test, s."""
        if self.network is None:
            return LENGTH
        nodes = self.network.n_nodes
        root = np.sqrt(self.network.capacity)
        rates = np.linalg.eigvalsh(self.network.conductance_matrix()[:, :nodes] / np.outer(root, root))
        slowest = max(float(rates[0]), 1e-9 * float(rates[-1]))
        return float(np.clip(round(TIME_CONSTANTS / slowest / SHORTEST) * SHORTEST, SHORTEST, LONGEST))

    def standard_tests(self, length: float) -> dict[str, Schedule]:
        """Heat-up, steps and cool-down of a length [s]."""
        return standard(self.usual, self.driven, length)

    def family(self, length: float) -> list[Schedule]:
        """Tests that are compared, of one length [s]."""
        own = self.standard_tests(length)
        if self.network is None:
            has_channel = self.spec.channel is not None
            others = geometry_schedules(
                self.usual, self.usual["speed"], has_channel=has_channel, length=length
            )
            return [own["heat_up"], *others]
        ranges = {
            name: (value, value + TEMPERATURE_STEP) if self.units[name] == TEMPERATURE_UNIT else (0.0, value)
            for name, value in self.usual.items()
        }
        return [*own.values(), *network_schedules(ranges, length / 3.0)]


def conditions_of(
    machine: str, overrides: Sequence[str], given: Mapping[str, tuple[float, str]], *, recorded: bool
) -> Conditions:
    """Inputs of a machine at full load: as given, else from its definition.

    Parameters
    ----------
    given : mapping of str to (float, str)
        Value (SI) and SI base unit of inputs.
    recorded : bool
        Whether a recording drives the test, so that nothing need be known of the inputs.

    Raises
    ------
    SpecError
        An input that the machine does not have, or one that warms nothing and has no size.
    """
    if not is_network_machine(read_definition(find_machine(machine))):
        spec = load_machine(machine, overrides)
        known = standard_inputs(spec)
        if spec.coolant is None:
            known = {name: value for name, value in known.items() if not name.startswith("coolant")}
        _require_known(given, known)
        for name, (_, unit) in given.items():
            if unit != UNITS[name]:
                raise SpecError(f"input {name}", f"has the unit {unit}.", f"Allowed: units of {UNITS[name]}.")
        usual = known | {name: value for name, (value, _) in given.items()}
        return Conditions(spec, None, usual, UNITS, ("speed",))
    spec = load_network_machine(machine, overrides)
    network = build_network(spec.network)
    temperatures = [name for name in network.boundary_input if name is not None]
    _require_known(given, network.input_names)
    usual = dict.fromkeys(temperatures, ROOM)
    units = dict.fromkeys(temperatures, TEMPERATURE_UNIT)
    for source in spec.network.source:
        if source.input is not None and source.reference is not None and source.input not in usual:
            usual[source.input] = source.reference.amount.value
            units[source.input] = base_name(source.reference.unit)
    usual |= {name: value for name, (value, _) in given.items()}
    units |= {name: unit for name, (_, unit) in given.items()}
    silent = [name for name in network.input_names if name not in usual]
    for name in () if recorded else silent:
        usual[name], units[name] = _warming_size(spec, network, name)
    driven = tuple(name for name in network.input_names if name not in temperatures)
    return Conditions(spec, network, usual, units, driven, () if recorded else tuple(silent))


def _warming_size(spec: NetworkMachineSpec, network: ThermalNetwork, name: str) -> tuple[float, str]:
    """Size of an input that in the end warms the hottest node by ``USUAL_RISE``, others at rest; its unit.

    Raises
    ------
    SpecError
        It warms nothing, or without end.
    """
    sources = [(i, item) for i, item in enumerate(spec.network.source) if item.input == name]
    nodes = network.n_nodes
    matrix = network.conductance_matrix()[:, :nodes]

    def rise(size: float) -> float:
        heat = np.zeros(nodes)
        for index, item in sources:
            heat[network.source_node[index]] += network.source_gain[index] * size**item.exponent
        return float(np.max(np.linalg.solve(matrix, heat)))

    first = sources[0][1]
    watts = registry().Unit("W") / registry().Unit(first.gain.unit or "dimensionless")
    unit = base_name(str(watts ** (1.0 / first.exponent)))
    try:
        exponent = brentq(lambda power: np.log(rise(10.0**power) / USUAL_RISE), -12.0, 12.0)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise SpecError(
            f"input {name}",
            "drives the machine, but nothing says how large it is in the test.",
            f'Give it with its unit, --input {name}="100 W", or a recording as the test.',
        ) from error
    return float(10.0**exponent), unit


def base_name(unit: str) -> str:
    """SI base unit as recordings name it.

    >>> base_name("rad/s"), base_name("W")
    ('radian / second', 'kilogram * meter ** 2 / second ** 3')
    """
    units = registry()
    return str(units.Quantity(1.0, unit or "dimensionless").to_base_units().units)


def _require_known(
    given: Mapping[str, tuple[float, str]], known: Sequence[str] | Mapping[str, float]
) -> None:
    unknown = [name for name in given if name not in known]
    if unknown:
        raise SpecError(
            f"input {unknown[0]}", "is not an input of this machine.", did_you_mean(unknown[0], tuple(known))
        )


def recording_of(conditions: Conditions, schedule: Schedule, sensors: Sequence[Sensor]) -> Recording:
    """Recording that a test would produce, every reading still at the temperature of the start."""
    edges = np.cumsum([0.0, *(length for length, _ in schedule.stages)])
    step = max(SAMPLE, schedule.length / MOST_SAMPLES)
    times = np.unique(np.round(np.append(np.arange(0.0, schedule.length, step), edges), 6))
    owner = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(schedule.stages) - 1)
    rows = np.array(
        [
            [{**conditions.usual, **changed}[name] for name in conditions.usual]
            for _, changed in schedule.stages
        ]
    ).reshape(len(schedule.stages), -1)
    empty = defined_recording(
        schedule.name,
        (),
        conditions.start,
        {name: (value, value) for name, value in conditions.usual.items()},
        conditions.units,
    )
    bare = replace(
        empty,
        name=schedule.name,
        times=times,
        inputs=rows[owner],
        covariates=np.empty((len(times), 0)),
        segments=np.array([[0, len(times)]]),
    )
    return with_sensors(bare, sensors, {item.probe: conditions.start for item in sensors})


def with_sensors(recording: Recording, sensors: Sequence[Sensor], start: Mapping[str, float]) -> Recording:
    """A recording as read by these sensors, at the temperature of its own start, undisplaced, throughout.

    Parameters
    ----------
    start : mapping of str to float, [K]
        Of the probes that the recording does not read.
    """
    first = dict(start) | (recording.first_readings() if recording.temperature_names else {})
    warm = [item for item in sensors if not item.displaced]
    moved = [item for item in sensors if item.displaced]
    size = (recording.times.size, len(warm))
    level = np.array([first[item.probe] for item in warm])

    def noises(own: Sequence[Sensor]) -> tuple[ChannelNoise, ...]:
        return tuple(ChannelNoise(0.0, 0.0, item.noise, 0.0) for item in own)

    return replace(
        recording,
        temperature_names=tuple(item.name for item in warm),
        probes=tuple(item.probe for item in warm),
        temperature=np.broadcast_to(level, size).copy(),
        flags=np.zeros(size, dtype=np.uint8),
        sigma=np.array([item.noise for item in warm]),
        noise=noises(warm),
        displacement_names=tuple(item.name for item in moved),
        displacement_sensors=tuple(item.probe for item in moved),
        displacements=np.zeros((recording.times.size, len(moved))),
        displacement_sigma=np.array([item.noise for item in moved]),
        displacement_noise=noises(moved),
    )


def as_predicted(machine: DiagnosedMachine, recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings with the temperatures that the sensors should read of the machine as it is known.

    Parameters
    ----------
    machine : DiagnosedMachine
        Opened on these recordings.
    """
    predictor = Predictor(machine.fast, machine.recordings, effects=machine.effects)
    found = []
    for number, recording in enumerate(recordings):
        predicted = predictor.predict(number, {}).temperature
        grid = predictor.drives[number].times
        readings = [np.interp(recording.times, grid, column) for column in predicted.T]
        found.append(replace(recording, temperature=np.array(readings).T))
    return found
