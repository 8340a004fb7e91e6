"""Operating points over time, and the times at which they matter to the steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.stream_films import INLET_PREFIX
from spindle_fem.effects.framework.term import COVARIATE, RecordedHeat
from spindle_fem.errors import RecordingError, did_you_mean
from spindle_fem.machine.geometry.coolant_path import CoolantPath
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.source_terms import heated_places
from spindle_fem.recordings.input_samples import InputHistory

Array = NDArray[np.float64]

# Inputs of a history, with the field of the operating point that each one sets.
FIELD_OF = {
    "speed": "speed",
    "thrust": "thrust",
    "ambient": "ambient_temperature",
    "coolant_inlet": "coolant_inlet_temperature",
    "coolant_flow": "coolant_flow",
}
# Changes below this pass inside a step: share of the largest value, or K for temperatures.
TEMPERATURES = ("ambient", "coolant_inlet")
RELATIVE_RESOLUTION = {"speed": 2.0e-3, "thrust": 1.0e-2, "coolant_flow": 1.0e-2}
# Heat that the inputs give for a place, in W; its resolution is that of all that only terms follow.
HEAT = "heat."
HEAT_RESOLUTION = 1.0e-2
TEMPERATURE_RESOLUTION = 0.05
# A held input that jumps by this many resolutions starts the steps anew.
RESTART_FACTOR = 10.0


@dataclass(frozen=True, slots=True)
class OperatingHistory:
    """Inputs of a machine at any time; what is not given stays as defined.

    Attributes
    ----------
    inputs : InputHistory
        Columns named ``speed`` [rad/s], ``thrust`` [N], ``ambient``,
        ``coolant_inlet`` [K], ``coolant_flow`` [m³/s], ``heat.<place>`` [W],
        ``covariate.<column>``, ``inlet.<stream>`` [K], those of heat sources;
        before the first time the first value holds, after the last one the last.
    defined : OperatingPoint
        The definition's own values.
    followed : tuple of str
        Inputs that the machine's heat sources and the inlets of its streams follow.
    heated : tuple of str
        Inputs ``heat.<place>`` that no heat source takes.
    path : CoolantPath or None
        Where the flow is what the pump drives at the inlet temperature of the moment.
    """

    inputs: InputHistory
    defined: OperatingPoint
    followed: tuple[str, ...] = ()
    heated: tuple[str, ...] = ()
    path: CoolantPath | None = None

    @classmethod
    def of(cls, spec: MachineSpec, inputs: InputHistory) -> OperatingHistory:
        """History of a machine.

        Raises
        ------
        RecordingError
            An input that a machine with geometry does not have.
        """
        followed = (*spec.source_inputs, *(film.inlet_input for film in spec.circuits))
        for name in inputs.names:
            if name not in (*FIELD_OF, *followed) and not name.startswith((HEAT, COVARIATE)):
                raise RecordingError(
                    "inputs",
                    f'"{name}" drives nothing in this machine.',
                    did_you_mean(name, (*FIELD_OF, *followed)),
                )
        pumped = spec.has_pump_limit and "coolant_flow" not in inputs.names
        path = CoolantPath.of(spec) if pumped and "coolant_inlet" in inputs.names else None
        return cls(inputs, OperatingPoint.of(spec), followed, heated_places(spec, inputs.names), path)

    def at(self, time: float) -> OperatingPoint:
        """Operating point just after a time [s]; friction does not know which way a spindle turns."""
        values = {field: getattr(self.defined, field) for field in FIELD_OF.values()}
        extra_heat, beside = {}, {}
        times = self.inputs.times
        left = max(int(np.searchsorted(times, time, side="right")) - 1, 0)
        for column, name in enumerate(self.inputs.names):
            samples = self.inputs.values[:, column]
            held = self.inputs.held[column]
            value = float(samples[left] if held else np.interp(time, times, samples))
            if name in FIELD_OF:
                values[FIELD_OF[name]] = value
            elif name in self.followed or name.startswith(COVARIATE):
                beside[name] = value
            else:
                extra_heat[name.removeprefix(HEAT)] = value
        values["speed"] = abs(values["speed"])
        if self.path is not None:
            values["coolant_flow"] = float(self.path.delivered(values["coolant_inlet_temperature"]))
        return OperatingPoint(**values, extra_heat=extra_heat, beside=beside)

    def given_heat(self) -> tuple[RecordedHeat, ...]:
        """Terms that put the heat of the inputs into their places."""
        return tuple(RecordedHeat(name) for name in self.heated)

    def _resolution(self, column: int, temperature: float = TEMPERATURE_RESOLUTION) -> float:
        name = self.inputs.names[column]
        if name in TEMPERATURES or name.startswith(INLET_PREFIX):
            return temperature
        share = RELATIVE_RESOLUTION.get(name, HEAT_RESOLUTION)
        largest = float(np.abs(self.inputs.values[:, column]).max())
        return share * max(largest, 1.0e-9)

    def breakpoints(self, temperature: float = TEMPERATURE_RESOLUTION) -> Array:
        """Times [s] at which a step has to end for the inputs to be followed within their resolution.

        Parameters
        ----------
        temperature : float, [K]
            Resolution of temperatures; the others have their own.
        """
        found = [np.zeros(0)]
        for column in range(len(self.inputs.names)):
            values, resolution = self.inputs.values[:, column], self._resolution(column, temperature)
            pick = _jumps if self.inputs.held[column] else _corners
            found.append(self.inputs.times[pick(self.inputs.times, values, resolution)])
        return np.unique(np.concatenate(found))

    def restarts(self) -> Array:
        """Times [s] of jumps after which steps begin small again."""
        found = [np.zeros(0)]
        for column in np.flatnonzero(self.inputs.held):
            values = self.inputs.values[:, column]
            large = np.abs(np.diff(values)) > RESTART_FACTOR * self._resolution(int(column))
            found.append(self.inputs.times[1:][large])
        return np.unique(np.concatenate(found))


def _jumps(times: Array, values: Array, resolution: float) -> NDArray[np.int64]:
    """Samples at which a held value has left the last one picked by more than the resolution.

    >>> _jumps(np.arange(5.0), np.array([0.0, 0.4, 0.8, 1.2, 5.0]), 1.0).tolist()
    [3, 4]
    """
    picked, last = [], values[0]
    for index in np.flatnonzero(np.diff(values) != 0.0) + 1:
        if abs(values[index] - last) > resolution:
            picked.append(index)
            last = values[index]
    return np.array(picked, dtype=np.int64)


def _corners(times: Array, values: Array, resolution: float) -> NDArray[np.int64]:
    """Samples that a polygon needs to follow all others within the resolution.

    Source: Douglas & Peucker (1973), Cartographica 10, 112-122.

    >>> _corners(np.arange(5.0), np.array([0.0, 1.0, 2.0, 1.0, 0.0]), 0.1).tolist()
    [2]
    """
    picked = []
    stretches = [(0, len(times) - 1)]
    while stretches:
        first, last = stretches.pop()
        if last - first < 2:
            continue
        inside = slice(first + 1, last)
        line = np.interp(times[inside], times[[first, last]], values[[first, last]])
        departure = np.abs(values[inside] - line)
        farthest = int(np.argmax(departure))
        if departure[farthest] > resolution:
            middle = first + 1 + farthest
            picked.append(middle)
            stretches += [(first, middle), (middle, last)]
    return np.array(sorted(picked), dtype=np.int64)
