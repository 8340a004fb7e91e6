"""Units as devices write them beside names of columns, in the words that this program knows."""

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
    "rpm": "rpm",
    "%": "percent",
    "l/min": "l/min",
    "lpm": "l/min",
    "l/h": "l/hour",
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
}
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_SLASH = re.compile(r"^(?P<name>.*?\S)\s+(?:/|in)\s+(?P<unit>\S+(?: C)?)$")
_UNDERSCORE = re.compile(r"^(?P<name>.*\w)_(?P<unit>degC|degF|rpm|K|s|ms|W|kW|N|kN|bar|l_min|um|mm|percent)$")


def unit_of_text(text: str) -> str:
    """Unit that a cell names, empty where it names none.

    >>> unit_of_text("[°C]"), unit_of_text("U/min"), unit_of_text("Spindel")
    ('degC', 'rpm', '')
    """
    plain = text.strip().strip("[]()").strip().replace("º", "°").replace("° ", "°")
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

    >>> without_unit("Temp vorn [°C]"), without_unit("n / min-1"), without_unit("SP01")
    (('Temp vorn', 'degC'), ('n', 'rpm'), ('SP01', ''))
    """
    for form in (_BRACKETS, _SLASH, _UNDERSCORE):
        match = form.match(name.strip())
        if match and match["name"] and (unit := unit_of_text(match["unit"].replace("l_min", "l/min"))):
            return match["name"], unit
    return name.strip(), ""
