"""Vocabulary of column names, in the languages of machine builders."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable

# Letters that many devices write as two: both spellings are the same word.
_TWO_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue"})
# Words are looked for as whole words, one after another where there are several, and longer ones within
# compounds.
_LIQUIDS = ("oil", "öl", "coolant", "kühlmittel", "kss")
_VOLUME_FLOWS = tuple(f"{sign} {liquid}" for sign in ("v", "q", "vdot") for liquid in _LIQUIDS)
WORDS = {
    "ambient": (
        *("ambient", "amb", "tamb", "umgebung", "environment", "env"),
        *("raum", "room", "halle", "hall", "werkstatt", "workshop", "luft", "air"),
    ),
    "coolant_inlet": (
        *("inlet", "vorlauf", "vl", "zulauf", "supply", "eintritt"),
        *("coolant in", "oil in", "öl ein"),
    ),
    "coolant_flow": ("flow", "durchfluss", "volumenstrom", *_VOLUME_FLOWS),
    "speed": ("speed", "drehzahl", "rpm", "vitesse", "n"),
    "thrust": ("thrust", "axialkraft", "axialforce", "vorspannkraft"),
}
OUTLET_WORDS = (
    *("outlet", "rücklauf", "rl", "auslauf", "austritt", "return"),
    *("coolant out", "oil out", "öl aus"),
)
TEMPERATURE_WORDS = ("temp", "temperatur", "temperature", "tc", "pt100", "thermo", "therm")
# Units that names without one usually mean, of quantities that a network is free to take in any unit.
USUAL_UNITS = {
    "rpm": WORDS["speed"],
    "percent": ("load", "auslastung", "last", "override"),
    "l/min": WORDS["coolant_flow"],
    "N*m": ("torque", "drehmoment", "moment"),
    "A": ("current", "strom"),
    "degC": (*TEMPERATURE_WORDS, *WORDS["ambient"], *WORDS["coolant_inlet"]),
    "W": ("power", "leistung", "heat"),
}
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
# Parts of machines on which sensors sit.
_PLACES = (*_ENGLISH, *sum(_ENGLISH.values(), ()), "außenring", "innenring", "motor", *OUTLET_WORDS)
# Quantities other than a temperature that are measured in such places.
_OTHER_QUANTITIES = (
    *("kraft", "force", "druck", "pressure", "spannung", "voltage", "strom", "current"),
    *("schwingung", "vibration", "beschleunigung", "acceleration", "frequenz", "frequency"),
    *("weg", "position", "verlagerung", "displacement", "vorschub", "feed", "drehzahl", "speed", "rpm"),
    *("leistung", "power", "moment", "torque", "last", "load", "auslastung", "override"),
    *("feuchte", "humidity", "status", "alarm", "zähler", "counter"),
)
_CLOSE = 0.72


def spelt_out(text: str) -> str:
    """A text without letters that devices may write as two.

    >>> spelt_out("Kühlmittel Rücklauf")
    'Kuehlmittel Ruecklauf'
    """
    return unicodedata.normalize("NFC", text).translate(_TWO_LETTERS)


def _plain(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "", spelt_out(text).lower())


def same(name: str, allowed: tuple[str, ...]) -> str:
    """The allowed name that differs in signs, case and spelling only."""
    return next((item for item in allowed if _plain(item) == _plain(name)), "")


def within(name: str, allowed: tuple[str, ...]) -> str:
    """The longest allowed name whose words appear consecutively in a name, if it is the only one."""
    words = _words(name)
    found: dict[int, list[str]] = {}
    for item in allowed:
        parts = _words(item)
        places = range(len(words) - len(parts) + 1)
        if parts and any(words[at : at + len(parts)] == parts for at in places):
            found.setdefault(len(parts), []).append(item)
    longest = found[max(found)] if found else []
    return longest[0] if len(longest) == 1 else ""


def by_meaning(name: str, allowed: tuple[str, ...]) -> str:
    """The allowed name with the most words, all of which a German name has, where it is the only one."""
    said = set(_words(name))

    def is_said(word: str) -> bool:
        return word in said or not said.isdisjoint(map(spelt_out, _ENGLISH.get(word, ())))

    found = [item for item in allowed if _words(item) and all(is_said(word) for word in _words(item))]
    most = max((len(_words(item)) for item in found), default=0)
    longest = [item for item in found if len(_words(item)) == most]
    return longest[0] if len(longest) == 1 else ""


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", spelt_out(name).lower())


def near(name: str, allowed: tuple[str, ...]) -> list[str]:
    """The allowed name that resembles a name most, where one does."""
    plain = {_plain(item): item for item in allowed}
    return [plain[item] for item in difflib.get_close_matches(_plain(name), plain, 1, _CLOSE)]


def drives_by_words(name: str, inputs: dict[str, str]) -> str:
    """The first input of which a name has a word."""
    return next((drives for drives in inputs if says(name, WORDS.get(drives, ()))), "")


def says(name: str, known: Iterable[str]) -> bool:
    """Whether a name has any of some words, whole or within a compound."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", spelt_out(name))
    words = re.findall(r"[a-z]+", apart.lower())
    line = f" {' '.join(words)} "
    spelt = map(spelt_out, known)
    return any(f" {item} " in line or any(_compounds(item, word) for word in words) for item in spelt)


def _compounds(known: str, word: str) -> bool:
    """Whether a word is a compound of a known one, such as Raumtemperatur."""
    return (len(known) > 4 and known in word) or (len(known) == 4 and word.startswith(known))


def says_temperature(name: str) -> bool:
    """Whether a name calls itself a temperature."""
    words = re.split(r"[^a-z]+", name.lower())
    starts = any(word.startswith(known) for word in words for known in TEMPERATURE_WORDS if word)
    return starts or "temperatur" in name.lower()


def says_place(name: str) -> bool:
    """Whether a name is of a place where sensors of temperature sit, and of no other quantity.

    >>> [says_place(name) for name in ("Lager vorne Außenring", "Lagerkraft vorne", "Spindelstrom", "X")]
    [True, False, False, False]
    """
    return says(name, _PLACES) and not says_other_quantity(name)


def says_other_quantity(name: str) -> bool:
    """Whether a name calls itself a quantity that is no temperature."""
    return not says_temperature(name) and says(name, _OTHER_QUANTITIES)
