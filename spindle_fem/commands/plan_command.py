"""The function behind ``spindle-fem diagnose --plan``."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.load import write_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import base_unit_of
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.inference.diagnosis_content import plain_data
from spindle_fem.inference.measurement_plan import MeasurementPlan, plan_measurement
from spindle_fem.inference.opened_machine import DiagnosedMachine, open_machine, with_growth
from spindle_fem.inference.plan_content import plan_content
from spindle_fem.inference.planned_test import (
    LONGEST_COMPARED,
    STANDARD_TESTS,
    USUAL_RISE,
    Conditions,
    Sensor,
    as_predicted,
    base_name,
    conditions_of,
    recording_of,
    with_sensors,
)
from spindle_fem.inference.sufficiency import says_too_little
from spindle_fem.machine.view.usual_sizes import short_unit
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.recordable_names import recordable_names
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_log import LOGGER
from spindle_fem.solvers.network_start import initial_parameters, require_compatible
from spindle_fem.units import TEMPERATURE_UNIT, ZERO_CELSIUS_K, to_si

Progress = Callable[[str], None]
ALL = "all"


@dataclass(frozen=True, slots=True)
class Planned:
    """A plan with its inputs."""

    plan: MeasurementPlan
    conditions: Conditions
    sensors: tuple[Sensor, ...]
    test: str
    inputs: Mapping[str, tuple[float, str]]
    compared: float
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a plan is asked about, checked."""

    machine: str | Path
    overrides: tuple[str, ...]
    conditions: Conditions
    sensors: tuple[Sensor, ...]
    recording: Recording
    earlier: list[Recording]
    seconds: float
    test: str
    inputs: Mapping[str, tuple[float, str]]


def plan(
    machine: str | Path,
    folder: str | Path,
    *,
    test: str | Path = "steps",
    sensors: Sequence[str] = (),
    inputs: Sequence[str] = (),
    calibrate: Iterable[str | Path] = (),
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Report which effects a machine's sensors and a test could distinguish, and how to distinguish more.

    Parameters
    ----------
    machine : str or Path
        A definition or the name of one that ships; with geometry or a ``[network]``.
    folder : str or Path
        Gets ``plan.json``, ``figures/*.png``, ``report.html`` and, of a machine with geometry,
        ``machine.toml``.
    test : str or Path
        A recording, whose inputs are used; or ``heat_up``, ``steps`` or ``cool_down``, with a length
        after a colon (``steps:4h``).
    sensors : sequence of str
        Names of probes, nodes or displacement sensors, each perhaps with its noise (``SP01=0.05K``,
        ``S1=0.5um``); ``all=0.2K`` for all temperatures. By default those of the recording, else every one
        of the definition.
    inputs : sequence of str
        ``NAME=VALUE`` texts with units: inputs at full load in a standard test.
    calibrate : iterable of str or Path
        Recordings of the same machine with nothing missing.
    overrides : iterable of str
        ``path=value`` texts.

    Returns
    -------
    dict
        The content of ``plan.json``.

    Raises
    ------
    SpindleFemError
    """
    started = time.perf_counter()
    tell = progress or LOGGER.info
    asked = _asked(
        machine, test=test, sensors=sensors, inputs=inputs, calibrate=calibrate, overrides=overrides
    )
    with output_folder(folder) as place:
        planned = _planned(asked, progress=tell)
        content = plan_content(
            planned.plan,
            planned.sensors,
            planned.test,
            planned.inputs,
            planned.compared,
            planned.notes,
        )
        content["wall_time_s"] = time.perf_counter() - started
        content = plain_data(content)
        spec = planned.conditions.spec
        if isinstance(spec, MachineSpec):
            replace_text(place / "machine.toml", write_machine(spec))
        replace_text(place / "plan.json", json.dumps(content, indent=1) + "\n")
        from spindle_fem.report.plan_report import write_plan_report

        tell("report")
        write_plan_report(place)
        return content


def planned_measurement(
    machine: str | Path,
    *,
    test: str | Path = "steps",
    sensors: Sequence[str] = (),
    inputs: Sequence[str] = (),
    calibrate: Iterable[str | Path] = (),
    overrides: Iterable[str] = (),
    compare: bool = True,
    progress: Progress = lambda stage: None,
) -> Planned:
    """Result of :func:`plan` before anything is written; parameters as there.

    ``compare`` selects whether other tests are simulated too.
    """
    asked = _asked(
        machine, test=test, sensors=sensors, inputs=inputs, calibrate=calibrate, overrides=overrides
    )
    return _planned(asked, compare=compare, progress=progress)


def _asked(
    machine: str | Path,
    *,
    test: str | Path,
    sensors: Sequence[str],
    inputs: Sequence[str],
    calibrate: Iterable[str | Path],
    overrides: Iterable[str],
) -> _Asked:
    """Parameters of :func:`plan`, refused before any work where they cannot be meant."""
    overrides = tuple(overrides)
    names = partial(recordable_names, machine, overrides)
    given = dict(_input(text) for text in inputs)
    name, _, length = str(test).partition(":")
    standard = name in STANDARD_TESTS
    if not standard and not Path(test).exists():
        raise SpecError(
            "test",
            f'"{test}" is neither a standard test nor a recording.',
            f"Allowed: a recording's folder or .toml file, or {', '.join(STANDARD_TESTS)}, "
            "with a length after a colon (steps:4h).",
        )
    conditions = conditions_of(str(machine), overrides, given, recorded=not standard)
    if standard:
        seconds = to_si(length, "s", where="test: length") if length else conditions.default_length
        if seconds <= 0.0:
            raise SpecError("test", f"its length is {seconds:g} s.", "Allowed: above 0 s.")
        schedule = conditions.standard_tests(seconds)[name]
        chosen = _sensors(sensors, conditions.sensors)
        asked, words = recording_of(conditions, schedule, chosen), schedule.name
        full = {name: _shown(value, conditions.units[name]) for name, value in conditions.usual.items()}
    else:
        read = read_recording(test, names=names)
        if given:
            raise SpecError(
                "input", "belongs to a standard test.", "Leave it out: the recording has its own."
            )
        if conditions.network is not None:
            require_compatible(conditions.network, read)
        conditions = _as_recorded(conditions, read)
        asked, chosen = _of_recording(read, sensors, conditions)
        seconds, words, full = float(np.ptp(read.times)), f'the inputs of "{read.name}"', {}
    earlier = [read_recording(path, names=names) for path in calibrate]
    return _Asked(machine, overrides, conditions, tuple(chosen), asked, earlier, seconds, words, full)


def _planned(asked: _Asked, *, progress: Progress, compare: bool = True) -> Planned:
    """What the plan says."""
    conditions, full = asked.conditions, asked.inputs
    compared = min(asked.seconds, LONGEST_COMPARED)
    schedules = conditions.family(compared) if compare else []
    recordings = [asked.recording, *(recording_of(conditions, item, asked.sensors) for item in schedules)]
    begin = partial(open_machine, asked.machine, asked.overrides)
    opened = begin(recordings, asked.earlier, progress=progress)
    # Usual sizes of effects, and of a network's errors, follow from what the sensors would read.
    opened = begin(as_predicted(opened, recordings), asked.earlier, progress=progress)
    opened = with_growth(opened)
    found = plan_measurement(opened, schedules, asked=asked.test, progress=progress)
    little = says_too_little(_only_first(opened))
    notes = [f"A diagnosis of such a recording would refuse it: {little}"] if little else []
    if conditions.assumed:
        sizes = ", ".join(
            f"{name} {full[name][0]:.3g} {full[name][1]}".strip() for name in conditions.assumed
        )
        notes.insert(
            0,
            f"Nothing says how large these inputs are; each is taken to warm the hottest node by "
            f"{USUAL_RISE:.0f} K in the end: {sizes}. Give what the test would run at with --input.",
        )
    return Planned(found, conditions, asked.sensors, asked.test, full, compared, tuple(notes))


def _shown(value: float, unit: str) -> tuple[float, str]:
    """A value in SI as people read it, temperatures in °C."""
    return (value - ZERO_CELSIUS_K, "degC") if unit == TEMPERATURE_UNIT else (value, short_unit(unit))


def _input(text: str) -> tuple[str, tuple[float, str]]:
    """Name of an input, its value (SI) and its base unit, from ``NAME=VALUE``."""
    name, found, value = (part.strip() for part in text.partition("="))
    if not found or not name or not value:
        raise SpecError("input", f'"{text}" cannot be read.', 'Write it as speed="3000 rpm".')
    where = f"input {name}"
    unit = base_unit_of(value)
    kind = "temperature" if unit == "K" else "quantity"
    return name, (to_si(value, unit, where=where, kind=kind), base_name(unit))


def _parts(asked: Sequence[str]) -> list[tuple[str, ...]]:
    """Name, equals sign and noise of each sensor in ``NAME=NOISE,NAME`` texts."""
    return [tuple(word.strip() for word in part.partition("=")) for text in asked for part in text.split(",")]


def _sensors(asked: Sequence[str], known: Mapping[str, Sensor]) -> tuple[Sensor, ...]:
    """Requested sensors, by the probe that each reads, with their noise."""
    if not known:
        raise SpecError(
            "sensors",
            "the machine has none.",
            "Add [[probe]] tables to the definition; see docs/planning.md.",
        )
    chosen, noise = [], {}
    for name, found, given in _parts(asked):
        if name != ALL and name not in known:
            raise SpecError(
                "sensors", f'"{name}" is no sensor of this machine.', did_you_mean(name, (*known, ALL))
            )
        if found:
            where = f"sensors: noise of {name}"
            moved = name != ALL and known[name].displaced
            unit, kind = ("m", "quantity") if moved else ("K", "temperature_difference")
            noise[name] = to_si(given, unit, where=where, kind=kind)
            if noise[name] <= 0.0:
                raise SpecError(where, f"is {noise[name]:g} {unit}.", f"Allowed: above 0 {unit}.")
        if name != ALL:
            chosen.append(name)
    found = [known[name] for name in dict.fromkeys(chosen or known)]
    if all(item.displaced for item in found):
        raise SpecError(
            "sensors",
            "read no temperature.",
            f"Add one of {', '.join(name for name, item in known.items() if not item.displaced)}.",
        )

    def noise_of(item: Sensor, name: str) -> float:
        usual = item.noise if item.displaced else noise.get(ALL, item.noise)
        return noise.get(name, usual)

    names = dict.fromkeys(chosen or known)
    return tuple(replace(item, noise=noise_of(item, name)) for item, name in zip(found, names, strict=True))


def _of_recording(
    read: Recording, asked: Sequence[str], conditions: Conditions
) -> tuple[Recording, tuple[Sensor, ...]]:
    """A recording's inputs with the requested sensors, or those of the recording if none are requested."""
    own = {
        probe: Sensor(name, probe, float(sigma))
        for name, probe, sigma in zip(read.temperature_names, read.probes, read.sigma, strict=True)
    }
    if conditions.network is None:
        moved = zip(read.displacement_names, read.displacement_sensors, read.displacement_sigma, strict=True)
        own |= {probe: Sensor(name, probe, float(sigma), displaced=True) for name, probe, sigma in moved}
    others = {name: item for name, item in conditions.sensors.items() if name not in own}
    named = any(name != ALL for name, *_ in _parts(asked))
    chosen = _sensors(asked, own | others if named else own)
    if conditions.network is None:
        mean = float(np.mean([*read.first_readings().values()] or [conditions.start]))
        begun = dict.fromkeys((*own, *others), mean)
    else:
        # Where a diagnosis lets nodes begin that nothing reads.
        started = initial_parameters(conditions.network, read)
        begun = {name: item.value for name, item in zip(conditions.network.node_names, started, strict=True)}
    return with_sensors(read, chosen, begun), chosen


def _as_recorded(conditions: Conditions, read: Recording) -> Conditions:
    """Conditions whose full load is the largest that a recording holds, temperatures their means."""
    usual, units = dict(conditions.usual), dict(conditions.units)
    for name, unit in zip(read.input_names, read.input_units, strict=True):
        if name in usual or conditions.network is not None:
            values = np.abs(read.input_at(name, read.times))
            usual[name] = float(values.mean() if unit == TEMPERATURE_UNIT else values.max())
            units[name] = unit
    return replace(conditions, usual=usual, units=units)


def _only_first(machine: DiagnosedMachine) -> DiagnosedMachine:
    return replace(machine, recordings=machine.recordings[:1])
