"""Guess the meaning of each column of a measuring file from its name, unit, size and behaviour."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from spindle_fem.errors import UnitError
from spindle_fem.recordings.column_units import why_no_unit
from spindle_fem.recordings.column_words import (
    OUTLET_WORDS,
    USUAL_UNITS,
    by_meaning,
    drives_by_words,
    near,
    same,
    says,
    says_other_quantity,
    says_place,
    says_temperature,
    within,
)
from spindle_fem.recordings.manifest import DRIVES_UNITS, Channel, column_unit
from spindle_fem.recordings.recordable_names import RecordableNames
from spindle_fem.units import registry

_UNITS = {"speed": "rpm", "coolant_flow": "l/min", "thrust": "N"}
# Readings of sensors on machines, degC.
_PLAUSIBLE = (-40.0, 250.0)
# The same range if only the place suggests a temperature.
_ON_MACHINES = (-30.0, 150.0)
# Readings in kelvin of the same sensors, above all that are plausible in °C.
_KELVIN = (250.0, 425.0)
# Band within which a value counts as constant: relative to its range, and to its largest size.
_STILL, _STILL_OF_SIZE = 0.02, 0.001


@dataclass(frozen=True, slots=True)
class GuessedChannel:
    """A column as the manifest will have it, why, and what is unsure (empty where nothing is)."""

    channel: Channel
    why: str
    unsure: str = ""


def guess_channel(
    name: str, unit: str, values: np.ndarray, machine: RecordableNames, taken: set[str]
) -> GuessedChannel:
    """Role, unit and meaning of one column.

    Parameters
    ----------
    unit : str
        As the file states it, or empty.
    values : (n,) ndarray
        In the file's own unit; NaN where missing.
    taken : set of str
        Inputs and probes that earlier columns have; what is chosen is added.
    """
    present = values[np.isfinite(values)]
    guess = _guess(name, unit, values, machine, taken)
    doubt = _doubt_of_size(guess.channel.unit, present)
    return replace(guess, unsure="; ".join(filter(None, [guess.unsure, doubt])))


def _guess(
    name: str, unit: str, values: np.ndarray, machine: RecordableNames, taken: set[str]
) -> GuessedChannel:
    inputs = dict(DRIVES_UNITS) if machine.inputs is None else machine.inputs
    present = values[np.isfinite(values)]
    named = machine.probes + machine.sensors
    probe = same(name, named) or within(name, named)
    if probe and probe not in taken:
        return _read(name, unit, probe, "named as the machine has it", "", machine, taken)
    drives = same(name, tuple(inputs)) or _said_input(name, unit, inputs, present)
    if drives and drives not in taken and _agrees(unit, inputs[drives]):
        return _input(name, unit, drives, inputs, present, taken)
    only = next((item for item in ("speed", "coolant_flow") if _only_of_unit(item, unit, inputs, taken)), "")
    if only:
        doubt = f"the only {only.replace('_', ' ')} so far"
        return _input(name, unit, only, inputs, present, taken, doubt)
    warm, doubt = _dimension(unit) == "[temperature]", ""
    if not unit and not drives:
        warm, doubt = _warm_without_unit(name, values)
    if not warm:
        why = "drives nothing that is known by this name and unit" if unit else "neither name nor unit tells"
        doubt = _doubt_of_input(drives, unit, inputs) if drives not in taken else ""
        if not unit and not doubt:
            doubt = "no unit is stated, and neither name nor size tells what it is: it drives nothing"
        return GuessedChannel(Channel(column=name, role="covariate", unit=unit or None), why, doubt)
    unit = unit or _temperature_unit(present)
    if len(machine.outlets) == 1 and machine.outlets[0] not in taken and says(name, OUTLET_WORDS):
        return _read(
            name, unit, machine.outlets[0], "the coolant's outlet by its name", doubt, machine, taken
        )
    if not named:
        doubt = "; ".join(filter(None, [doubt, "no machine given: probe named after the column"]))
        return _read(name, unit, name, "a temperature", doubt, machine, taken)
    meant = by_meaning(name, tuple(item for item in machine.probes if item not in taken))
    close = [item for item in near(name, machine.probes) if item not in taken]
    if meant or close:
        reason = f'"{meant}" by what the name means' if meant else f'"{close[0]}" only resembles the name'
        doubt = "; ".join(filter(None, [doubt, f"probe {reason}"]))
        return _read(name, unit, meant or close[0], "a temperature", doubt, machine, taken)
    no_probe = f"no probe of the machine is named after it (probes: {', '.join(machine.probes)})"
    doubt = "; ".join(filter(None, [doubt, no_probe]))
    return GuessedChannel(Channel(column=name, role="covariate", unit=unit), "a temperature", doubt)


def _only_of_unit(drives: str, unit: str, inputs: dict[str, str], taken: set[str]) -> bool:
    """Whether a unit alone says that a column drives an input: of speeds rpm, of flows any volume a time."""
    if not unit or drives not in inputs or drives in taken:
        return False
    return unit == "rpm" if drives == "speed" else _dimension(unit) == _dimension("l/min")


def _said_input(name: str, unit: str, inputs: dict[str, str], present: np.ndarray) -> str:
    """Input suggested by a word of the name; without a unit, name and size must not contradict it."""
    drives = drives_by_words(name, inputs)
    if not drives or unit:
        return drives
    if inputs[drives] == "K":
        fits = not says_other_quantity(name) and (_between(present, *_PLAUSIBLE) or _like_kelvin(present))
    else:
        fits = not says_temperature(name)
    return drives if fits else ""


def _warm_without_unit(name: str, values: np.ndarray) -> tuple[bool, str]:
    """Whether a column without a unit is taken for a temperature, and the doubt about that."""
    present = values[np.isfinite(values)]
    taken = f"taken as {'K' if _like_kelvin(present) else '°C'}"
    if says_temperature(name) and (_between(present, *_PLAUSIBLE) or _like_kelvin(present)):
        return True, f"{why_no_unit(name)}: {taken}"
    if says_place(name) and (_between(present, *_ON_MACHINES) or _like_kelvin(present)):
        return True, f"{why_no_unit(name)}: the name is of a place, the size of a temperature, {taken}"
    if _moves_like_temperature(values) and _looks_like_sensor(name):
        return True, f"{why_no_unit(name)}: size and slow course are those of a temperature"
    return False, ""


def _doubt_of_input(drives: str, unit: str, inputs: dict[str, str]) -> str:
    """Why a column that is named like an input is none."""
    if not drives or not unit or _agrees(unit, inputs[drives]):
        return ""
    if inputs[drives] == "rad/s" and _dimension(unit) == _dimension("Hz"):
        return (
            f"named like a speed, but {unit} is not taken for one: it may count turns, or periods of a "
            'current. Turns a second are role = "input", drives = "speed", unit = "turn/s" '
            "(rpm = 60 times the turns a second)"
        )
    return f'named like "{drives}", but {unit} is no unit of it'


def _read(
    name: str, unit: str, probe: str, why: str, doubt: str, machine: RecordableNames, taken: set[str]
) -> GuessedChannel:
    displaced = probe in machine.sensors
    if displaced and _dimension(unit) != "[length]":
        doubt, unit = "; ".join(filter(None, [doubt, "no length is stated: taken as µm"])), "um"
    elif not displaced and _dimension(unit) != "[temperature]":
        doubt, unit = doubt or "no temperature unit is stated: taken as °C", "degC"
    taken.add(probe)
    role = "displacement" if displaced else "temperature"
    return GuessedChannel(Channel(column=name, role=role, probe=probe, unit=unit), why, doubt)


def _input(
    name: str,
    unit: str,
    drives: str,
    inputs: dict[str, str],
    present: np.ndarray,
    taken: set[str],
    doubt: str = "",
) -> GuessedChannel:
    if not unit:
        usual = next((item for item, words in USUAL_UNITS.items() if says(name, words)), "W")
        unit = _UNITS.get(drives, inputs[drives] or usual)
        unit = _temperature_unit(present) if inputs[drives] == "K" else unit
        doubt = "; ".join(filter(None, [doubt, f"{why_no_unit(name)}: taken as {unit}"]))
    hold = "previous" if _stands_still(present) and inputs[drives] != "K" else "linear"
    taken.add(drives)
    channel = Channel(column=name, role="input", drives=drives, unit=unit, hold=hold)
    why = "stands still between jumps" if hold == "previous" else "changes steadily"
    return GuessedChannel(channel, f"by its name; {why}", doubt)


def _looks_like_sensor(name: str) -> bool:
    return bool(re.fullmatch(r"(?:[A-Za-z]{1,4}[ _]?\d{1,3}|T[ _]\w+)", name))


def _stands_still(present: np.ndarray) -> bool:
    """Whether an input stays most of the time within a small band between its jumps, as set values do."""
    if present.size < 3:
        return False
    band = max(_STILL * float(np.ptp(present)), _STILL_OF_SIZE * float(np.abs(present).max()))
    starts = np.flatnonzero(np.abs(np.diff(present, prepend=np.inf)) > band)
    sizes = np.diff(starts, append=present.size)
    ranges = np.maximum.reduceat(present, starts) - np.minimum.reduceat(present, starts)
    return bool(sizes[(sizes > 2) & (ranges <= band)].sum() > 0.5 * present.size)


def _between(present: np.ndarray, least: float, most: float) -> bool:
    if present.size == 0:
        return False
    low, high = np.percentile(present, [5.0, 95.0])
    return bool(least < low and high < most)


def _like_kelvin(present: np.ndarray) -> bool:
    return _between(present, *_KELVIN)


def _temperature_unit(present: np.ndarray) -> str:
    """Unit of a temperature that states none, by its size."""
    return "K" if _like_kelvin(present) else "degC"


def _doubt_of_size(unit: str | None, present: np.ndarray) -> str:
    """Doubt about a temperature whose size does not fit its unit; empty if there is none."""
    if unit not in ("degC", "K") or not present.size:
        return ""
    low, high = np.percentile(present, [5.0, 95.0])
    if unit == "degC" and _like_kelvin(present):
        return f'readings of {low:.0f} to {high:.0f} look like kelvin: unit = "K"?'
    if unit == "K" and _between(present, *_ON_MACHINES):
        return f'readings of {low:.0f} to {high:.0f} look like °C: unit = "degC"?'
    return ""


def _moves_like_temperature(values: np.ndarray) -> bool:
    """Plausible in size, and steps from row to row small beside what is passed through in all."""
    present = values[np.isfinite(values)]
    if present.size < 10 or not _between(present, *_PLAUSIBLE) or np.ptp(present) == 0.0:
        return False
    return bool(
        np.median(present) > 5.0 and np.percentile(np.abs(np.diff(present)), 95.0) < 0.2 * np.ptp(present)
    )


def _dimension(unit: str) -> str:
    if not unit:
        return ""
    try:
        return str(registry().Unit(column_unit(unit, "unit").unit).dimensionality)
    except UnitError:
        return ""


def _agrees(unit: str, expected: str) -> bool:
    if not unit or not expected:
        return True
    if expected == "rad/s":
        return unit in ("rpm", "rad/s")
    return _dimension(unit) == _dimension(expected)
