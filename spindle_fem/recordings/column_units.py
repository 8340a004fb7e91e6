"""Units as devices write them beside column names, translated to units that this program knows."""

from __future__ import annotations

import re

from spindle_fem.errors import UnitError
from spindle_fem.recordings.manifest import column_unit

# Writings that pint does not know, or takes for something else (C is coulomb, F farad, h Planck's or hour).
_WRITINGS = {
    "°c": "degC",
    "c": "degC",
    "degc": "degC",
    "deg c": "degC",
    "grad c": "degC",
    "grad celsius": "degC",
    "celsius": "degC",
    "°f": "degF",
    "f": "degF",
    "degf": "degF",
    "k": "K",
    "1/min": "rpm",
    "/min": "rpm",
    "min-1": "rpm",
    "min^-1": "rpm",
    "min⁻¹": "rpm",
    "u/min": "rpm",
    "upm": "rpm",
    "rpm": "rpm",
    "r/min": "rpm",
    "tr/min": "rpm",
    "%": "percent",
    "l/min": "l/min",
    "lpm": "l/min",
    "l/h": "l/hour",
    "gpm": "gallon/min",
    "m³/h": "m**3/hour",
    "m3/h": "m**3/hour",
    "µm": "um",
    "μm": "um",
    "sec": "s",
    "sek": "s",
    "h": "hour",
    "std": "hour",
    "min": "min",
    "nm": "N*m",
    "ps": "metric_horsepower",
}
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_SLASH = re.compile(r"^(?P<name>.*?\S)\s+(?:/|in)\s+(?P<unit>\S+(?: C)?)$")
_GLUED = re.compile(r"^(?P<name>.*\w)(?P<unit>[°º]\s?[CFcf])$")
# After a name and a blank, only texts that cannot be a word of a name count as units.
_NO_WORDS = frozenset(
    {writing for writing in _WRITINGS if not writing.isascii() or not writing.replace(" ", "").isalpha()}
    | {"degc", "degf", "deg c", "grad c", "grad celsius", "celsius", "rpm", "upm", "lpm"}
)
_NO_WORDS_AS_WRITTEN = frozenset({"kN", "kW", "Nm", "mm", "mbar", "bar", "Hz", "kHz", "m/s", "mm/s", "mA"})
_CELSIUS = re.compile(r"^(?P<name>(?:[Tt]|[Tt]emp\w*)[_ ].*\w)_(?P<unit>C)$")
# The longest unit that ends a name: its first underscore that leaves one.
_UNDERSCORE = re.compile(
    r"^(?P<name>.*?\w)_(?P<unit>degC|degF|rpm|rad_s|K|s|ms|W|kW|N|kN|bar|l_min|l_h|m3_h|lpm|gpm|um|mm|percent)$"
)
# "Lager vorne K" in kelvin, but no thermocouple of type K.
_KELVIN = re.compile(r"^(?P<name>.*\w(?<!\b[Tt]yp)(?<!\b[Tt]ype)(?<!\bTC)) (?P<unit>K)$")


# Date formats found where columns of dates and clocks would have a unit, German, French and English.
_DATE_FORM = r"(?:[tdj]{1,2}|m{1,4}|[jya]{2,4})(?:[-./ ](?:[tdj]{1,2}|m{1,4}|[jya]{2,4})){1,2}"
_SECOND_FORM = r"(?:s{1,2}|sek|sec)(?:[.,:](?:0|[a-z]){1,9})?"
_CLOCK_FORM = rf"(?:h{{1,2}}|std):(?:m{{1,2}}|min)(?::{_SECOND_FORM})?(?: ?(?:am/pm|tt))?"
_TIME_FORM = re.compile(rf"(?:{_DATE_FORM})?(?:[t ,;]*(?:{_CLOCK_FORM}))?", re.IGNORECASE)


def is_time_form(text: str) -> bool:
    """Whether a cell is a format of dates or clocks.

    >>> [is_time_form(cell) for cell in ("TT.MM.JJJJ", "[hh:mm:ss,000]", "YYYY-MM-DD HH:MM", "min", "")]
    [True, True, True, False, False]
    """
    plain = _bare(text)
    return bool(plain) and _TIME_FORM.fullmatch(plain) is not None


def _bare(text: str) -> str:
    return text.strip().strip("[]()").strip()


def unit_of_text(text: str) -> str:
    """Unit that a cell names, empty where it names none.

    >>> unit_of_text("[°C]"), unit_of_text("U/min"), unit_of_text("Spindel")
    ('degC', 'rpm', '')
    """
    plain = _bare(text).replace("º", "°").replace("° ", "°")
    known = _WRITINGS.get(plain.lower())
    if known:
        return known
    if not plain or len(plain) > 12 or plain[0].isdigit():
        return ""
    try:
        column_unit(plain, "unit")
    except UnitError:
        return ""
    return plain


def without_unit(name: str) -> tuple[str, str]:
    """A column's name and the unit within it, empty where there is none.

    >>> without_unit("Temp vorn [°C]"), without_unit("n / min-1"), without_unit("Lager vorne °C")
    (('Temp vorn', 'degC'), ('n', 'rpm'), ('Lager vorne', 'degC'))
    >>> without_unit("T_Ruecklauf_C"), without_unit("SP01"), without_unit("Temp min")
    (('T_Ruecklauf', 'degC'), ('SP01', ''), ('Temp min', ''))
    >>> without_unit("spindle_speed_rad_s"), without_unit("Lager vorn K"), without_unit("TC Typ K")
    (('spindle_speed', 'rad/s'), ('Lager vorn', 'K'), ('TC Typ K', ''))
    """
    for form in (_BRACKETS, _SLASH, _UNDERSCORE, _CELSIUS, _GLUED, _KELVIN):
        match = form.match(name.strip())
        if match and match["name"] and (unit := unit_of_text(match["unit"].replace("_", "/"))):
            return match["name"], unit
    words = name.split()
    for number in (2, 1):
        last, plain = " ".join(words[-number:]), " ".join(words[:-number]).rstrip(" ,:;-")
        if plain and _is_no_word(last):
            return plain, unit_of_text(last)
    return name.strip(), ""


def why_no_unit(name: str) -> str:
    """Why a column without a unit has none: none stated, or brackets with something else.

    >>> why_no_unit("flow"), why_no_unit("flow (cfs)")
    ('no unit is stated', '"cfs" is not known as a unit')
    """
    match = _BRACKETS.match(name.strip())
    inside = match["unit"].strip() if match else ""
    return f'"{inside}" is not known as a unit' if inside else "no unit is stated"


def _is_no_word(text: str) -> bool:
    """Whether a text after a name can only be its unit."""
    plain = text.replace("º", "°").replace("° ", "°")
    return plain.lower() in _NO_WORDS or plain in _NO_WORDS_AS_WRITTEN
