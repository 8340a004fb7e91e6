"""What each column of a measuring file probably means: by its name, its unit, its size and how it behaves."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass

import numpy as np

from spindle_fem.errors import UnitError
from spindle_fem.recordings.manifest import DRIVES_UNITS, Channel, column_unit
from spindle_fem.units import registry

# What names of columns say in the languages of machine builders. Words are looked for as whole words, one
# after another where there are several, and longer ones within compounds.
WORDS = {
    "ambient": ("ambient", "umgebung", "raum", "room", "halle", "hall", "luft", "air", "env"),
    "coolant_inlet": ("inlet", "vorlauf", "zulauf", "supply", "eintritt", "coolant in", "oil in", "öl ein"),
    "coolant_flow": ("flow", "durchfluss", "volumenstrom", "durchfluß"),
    "speed": ("speed", "drehzahl", "rpm", "vitesse", "n"),
    "thrust": ("thrust", "axialkraft", "axialforce", "vorspannkraft"),
}
_OUTLET_WORDS = ("outlet", "rücklauf", "auslauf", "austritt", "return", "coolant out", "oil out", "öl aus")
_TEMPERATURE_WORDS = ("temp", "temperatur", "temperature", "tc", "pt100", "thermo", "therm")
# Units that names without one usually mean, of quantities that a network is free to take in any unit.
_USUAL_UNITS = {
    "rpm": WORDS["speed"],
    "percent": ("load", "auslastung", "last", "override"),
    "l/min": WORDS["coolant_flow"],
    "N*m": ("torque", "drehmoment", "moment"),
    "A": ("current", "strom"),
    "degC": (*_TEMPERATURE_WORDS, *WORDS["ambient"], *WORDS["coolant_inlet"]),
    "W": ("power", "leistung", "heat"),
}
_UNITS = {"speed": "rpm", "ambient": "degC", "coolant_inlet": "degC", "coolant_flow": "l/min", "thrust": "N"}
# German words of places on machines, for probes that are named in English.
_ENGLISH = {
    "front": ("vorn", "vorne", "vorderes", "vorderer", "vordere"),
    "rear": ("hinten", "hinteres", "hinterer", "hintere"),
    "bearing": ("lager", "wälzlager"),
    "housing": ("gehäuse",),
    "casing": ("gehäuse",),
    "flange": ("flansch",),
    "shaft": ("welle",),
    "spindle": ("spindel",),
    "nose": ("nase", "spindelnase"),
    "headstock": ("spindelstock", "spindelkasten"),
    "stator": ("ständer",),
    "winding": ("wicklung",),
    "drive": ("antrieb",),
    "oil": ("öl",),
    "cover": ("deckel",),
    "bed": ("bett",),
    "body": ("körper",),
}
_CLOSE = 0.72
# Readings of sensors on machines, degC.
_PLAUSIBLE = (-40.0, 250.0)


@dataclass(frozen=True, slots=True)
class MachineNames:
    """Names of a machine that channels may stand for; all empty where no machine is given.

    Attributes
    ----------
    probes, sensors : tuple of str
        Probes or network nodes; displacement sensors.
    inputs : dict of str to str
        What may be driven, with its SI unit; empty where any unit will do.
    outlets : tuple of str
        Probes that read the coolant where it leaves.
    """

    probes: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    inputs: dict[str, str] | None = None
    outlets: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GuessedChannel:
    """A column as the manifest will have it, why, and what is unsure (empty where nothing is)."""

    channel: Channel
    why: str
    unsure: str = ""


def guess_channel(
    name: str, unit: str, values: np.ndarray, machine: MachineNames, taken: set[str]
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
    inputs = dict(DRIVES_UNITS) if machine.inputs is None else machine.inputs
    dimension = _dimension(unit)
    present = values[np.isfinite(values)]
    named = machine.probes + machine.sensors
    probe = _same(name, named) or _within(name, named)
    if probe and probe not in taken:
        return _read(name, unit, probe, "named as the machine has it", "", machine, taken)
    drives = _same(name, tuple(inputs)) or _by_words(name, inputs)
    if drives and inputs[drives] != "K" and not unit and _says_temperature(name):
        drives = ""
    if drives and drives not in taken and _agrees(unit, inputs[drives]):
        return _input(name, unit, drives, inputs, present, taken)
    if "speed" in inputs and "speed" not in taken and unit == "rpm":
        return _input(name, unit, "speed", inputs, present, taken, "the only speed so far")
    warm = dimension == "[temperature]" or (not unit and _says_temperature(name) and _plausible(present))
    doubt = ""
    if not warm and not unit and not drives and _moves_like_temperature(values) and _looks_like_sensor(name):
        warm, doubt = True, "no unit is stated: size and slow course are those of a temperature"
    if not warm:
        why = "drives nothing that is known by this name and unit" if unit else "neither name nor unit tells"
        return GuessedChannel(Channel(column=name, role="covariate", unit=unit or None), why)
    if warm and not unit:
        doubt = doubt or "no unit is stated: taken as °C"
    if len(machine.outlets) == 1 and machine.outlets[0] not in taken and _says(name, _OUTLET_WORDS):
        return _read(
            name, unit, machine.outlets[0], "the coolant's outlet by its name", doubt, machine, taken
        )
    if not named:
        doubt = "; ".join(filter(None, [doubt, "no machine given: probe named after the column"]))
        return _read(name, unit, name, "a temperature", doubt, machine, taken)
    meant = _by_meaning(name, tuple(item for item in machine.probes if item not in taken))
    near = [item for item in _near(name, machine.probes) if item not in taken]
    if meant or near:
        reason = f'"{meant}" by what the name means' if meant else f'"{near[0]}" only resembles the name'
        doubt = "; ".join(filter(None, [doubt, f"probe {reason}"]))
        return _read(name, unit, meant or near[0], "a temperature", doubt, machine, taken)
    doubt = f"a temperature that no probe of the machine is named after (probes: {', '.join(machine.probes)})"
    return GuessedChannel(Channel(column=name, role="covariate", unit=unit or "degC"), "a temperature", doubt)


def _read(
    name: str, unit: str, probe: str, why: str, doubt: str, machine: MachineNames, taken: set[str]
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
        usual = next((item for item, words in _USUAL_UNITS.items() if _says(name, words)), "W")
        unit = _UNITS.get(drives, "degC" if inputs[drives] == "K" else inputs[drives] or usual)
        doubt = "; ".join(filter(None, [doubt, f"no unit is stated: taken as {unit}"]))
    # set values stand still and jump; measured ones hardly ever repeat
    held = present.size > 2 and float(np.mean(np.diff(present) == 0.0)) > 0.5
    hold = "previous" if held and inputs[drives] != "K" else "linear"
    taken.add(drives)
    channel = Channel(column=name, role="input", drives=drives, unit=unit, hold=hold)
    why = "stands still between jumps" if hold == "previous" else "changes steadily"
    return GuessedChannel(channel, f"by its name; {why}", doubt)


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9äöüß]+", "", text.lower())


def _same(name: str, allowed: tuple[str, ...]) -> str:
    return next((item for item in allowed if _plain(item) == _plain(name)), "")


def _within(name: str, allowed: tuple[str, ...]) -> str:
    """The longest allowed name whose words stand one after another in a name, where it is the only one."""
    words = _words(name)
    found: dict[int, list[str]] = {}
    for item in allowed:
        parts = _words(item)
        places = range(len(words) - len(parts) + 1)
        if parts and any(words[at : at + len(parts)] == parts for at in places):
            found.setdefault(len(parts), []).append(item)
    longest = found[max(found)] if found else []
    return longest[0] if len(longest) == 1 else ""


def _by_meaning(name: str, allowed: tuple[str, ...]) -> str:
    """The allowed name with the most words, all of which a German name has, where it is the only one."""
    said = set(_words(name))

    def is_said(word: str) -> bool:
        return word in said or not said.isdisjoint(_ENGLISH.get(word, ()))

    found = [item for item in allowed if _words(item) and all(is_said(word) for word in _words(item))]
    most = max((len(_words(item)) for item in found), default=0)
    longest = [item for item in found if len(_words(item)) == most]
    return longest[0] if len(longest) == 1 else ""


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z0-9äöüß]+", name.lower())


def _near(name: str, allowed: tuple[str, ...]) -> list[str]:
    plain = {_plain(item): item for item in allowed}
    return [plain[item] for item in difflib.get_close_matches(_plain(name), plain, 1, _CLOSE)]


def _by_words(name: str, inputs: dict[str, str]) -> str:
    return next((drives for drives in inputs if _says(name, WORDS.get(drives, ()))), "")


def _says(name: str, known: tuple[str, ...]) -> bool:
    words = re.findall(r"[a-zäöüß]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
    line = f" {' '.join(words)} "
    return any(f" {item} " in line or any(_compounds(item, word) for word in words) for item in known)


def _compounds(known: str, word: str) -> bool:
    """Whether a word is a compound of a known one, such as Raumtemperatur."""
    return (len(known) > 4 and known in word) or (len(known) == 4 and word.startswith(known))


def _says_temperature(name: str) -> bool:
    words = re.split(r"[^a-z]+", name.lower())
    return any(word.startswith(known) for word in words for known in _TEMPERATURE_WORDS if word)


def _looks_like_sensor(name: str) -> bool:
    return bool(re.fullmatch(r"(?:[A-Za-z]{1,4}[ _]?\d{1,3}|T[ _]\w+)", name))


def _plausible(present: np.ndarray) -> bool:
    if present.size == 0:
        return False
    low, high = np.percentile(present, [5.0, 95.0])
    return bool(_PLAUSIBLE[0] < low and high < _PLAUSIBLE[1])


def _moves_like_temperature(values: np.ndarray) -> bool:
    """Plausible in size, and steps from row to row small beside what is passed through in all."""
    present = values[np.isfinite(values)]
    if present.size < 10 or not _plausible(present) or np.ptp(present) == 0.0:
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
