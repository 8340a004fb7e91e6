"""Check recorded inputs against the machine: impossible ones are refused, unusual ones reported."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import RecordingError, SpindleFemError, did_you_mean, raise_all
from spindle_fem.physics.bearings.highest_speed import too_fast
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.units import TEMPERATURE_UNIT, ZERO_CELSIUS_K

# Air about machines, K: what industrial electronics beside them is made for.
USUAL_AMBIENT = (233.15, 358.15)
_RPM = 30.0 / np.pi


def require_possible_inputs(spec: MachineSpec, recording: Recording) -> tuple[str, ...]:
    """Refuse inputs that a machine with geometry does not have or cannot take; what is unusual, as sentences.

    Raises
    ------
    RecordingError or FaultsError
        Every input that is unknown, a speed that is not given or no rolling bearing reaches, a flow that
        is not above zero; with them, every probe that is unknown.
    """
    faults = list(_faults(spec, recording))
    if faults:
        faults += _unknown_probes(spec, recording)
    raise_all(recording.source, faults)
    return tuple(_unusual(spec, recording))


def _unknown_probes(spec: MachineSpec, recording: Recording) -> Iterator[SpindleFemError]:
    known = tuple(item.name for item in (*spec.probe, *spec.displacement_sensor))
    for probe in recording.probes:
        if probe not in known:
            yield RecordingError(
                recording.source, f'reads "{probe}", no probe of the machine.', did_you_mean(probe, known)
            )


def _faults(spec: MachineSpec, recording: Recording) -> Iterator[SpindleFemError]:
    inlets = tuple(film.inlet_input for film in spec.circuits)
    source, known = recording.source, (*standard_inputs(spec), *inlets, *spec.source_inputs)
    for name in recording.input_names:
        if name not in known and not name.startswith("heat."):
            yield RecordingError(
                source,
                f'drives "{name}", which a machine with geometry does not have.',
                f"Allowed: {', '.join(known)}, heat.<source>.",
            )
    for name, unit in zip(recording.input_names, recording.input_units, strict=True):
        if name in inlets and unit != TEMPERATURE_UNIT:
            yield RecordingError(source, f'"{name}" is in {unit}.', "Allowed: a temperature.")
    if "speed" not in recording.input_names:
        yield RecordingError(
            source, "no channel drives the speed.", 'Add an input channel with drives = "speed".'
        )
    fastest = max(np.abs(_ends(recording, "speed")))
    reason = too_fast(spec, fastest)
    if reason is not None:
        yield RecordingError(
            source,
            f'column "{_column(recording, "speed")}" (speed) reaches {fastest * _RPM:.0f} rpm.',
            reason,
        )
    lowest = _ends(recording, "coolant_flow")[0]
    if lowest < 0.0 or (lowest == 0.0 and spec.coolant is not None):
        flows = recording.inputs[:, recording.input_names.index("coolant_flow")]
        rows = np.flatnonzero(flows <= 0.0)
        first = recording.stamps(recording.times[rows[:1]])[0]
        when = first if isinstance(first, str) else f"{first:g} s"
        yield RecordingError(
            source,
            f'column "{_column(recording, "coolant_flow")}" (coolant_flow) falls to '
            f"{6e4 * lowest:.3g} l/min; {rows.size} of {flows.size} rows are not above 0, first at {when}.",
            "Allowed: above 0. While the pump is off give a small flow, such as 0.1 L/min: standing coolant "
            "has no film model.",
        )


def _unusual(spec: MachineSpec, recording: Recording) -> Iterator[str]:
    fastest = max(np.abs(_ends(recording, "speed")))
    if spec.heat.model == "table" and fastest > spec.heat.table.speed[-1] * (1.0 + 1e-9):
        yield (
            f"speed reaches {fastest * _RPM:.0f} rpm, the heat table ends at "
            f"{spec.heat.table.speed[-1] * _RPM:.0f} rpm: its last segment is continued"
        )
    yield from _outside(recording, "ambient", USUAL_AMBIENT, "what is usual about machines")
    if spec.coolant is not None:
        fluid = coolant_by_name(spec.coolant.fluid)
        limits = (fluid.lowest_temperature, fluid.highest_temperature)
        yield from _outside(recording, "coolant_inlet", limits, f"the range of {spec.coolant.fluid}")
    elif any(np.ptp(_ends(recording, name)) > 0.0 for name in ("coolant_inlet", "coolant_flow")):
        inlets = " or ".join(film.inlet_input for film in spec.circuits)
        yield "coolant_inlet and coolant_flow are those of a [channel], which this machine does not have" + (
            f"; {inlets} is the inlet temperature of a stream" if inlets else ""
        )


def _outside(recording: Recording, name: str, limits: tuple[float, float], what: str) -> Iterator[str]:
    low, high = _ends(recording, name)
    if low < limits[0] or high > limits[1]:
        shown = [value - ZERO_CELSIUS_K for value in (low, high, *limits)]
        yield (
            f"{name} runs from {shown[0]:.1f} to {shown[1]:.1f} °C, "
            f"{what} from {shown[2]:g} to {shown[3]:g} °C"
        )


def _column(recording: Recording, name: str) -> str:
    return recording.input_columns[recording.input_names.index(name)]


def _ends(recording: Recording, name: str) -> tuple[float, float]:
    """Lowest and highest reading of an input, NaN where it is not recorded."""
    if name not in recording.input_names:
        return np.nan, np.nan
    values = recording.inputs[:, recording.input_names.index(name)]
    return float(np.nanmin(values)), float(np.nanmax(values))
