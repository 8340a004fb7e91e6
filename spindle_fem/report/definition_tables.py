"""Tables of a definition in customary units, with the marks of its sources."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

# SI unit as definitions write it: customary unit, factor, digits.
_CUSTOMARY = {
    "m": ("mm", 1.0e3),
    "rad/s": ("rpm", 30.0 / math.pi),
    "m**3/s": ("L/min", 6.0e4),
    "rad": ("°", 180.0 / math.pi),
    "m**2/s": ("mm²/s", 1.0e6),
    "W/m/K": ("W/(m·K)", 1.0),
    "W/m**2/K": ("W/(m²·K)", 1.0),
    "kg/m**3": ("kg/m³", 1.0),
    "J/kg/K": ("J/(kg·K)", 1.0),
    "degC": ("°C", 1.0),
}
_OPEN = ("operation", "coolant", "channel", "heat")
# Mark of what is given without one.
UNMARKED = "U"
_HIDDEN = ("marks", "schema", "name", "title", "description")


def customary(text: Any) -> str:
    """Value of a definition as people read it.

    >>> customary("0.019 m")
    '19 mm'
    >>> customary({"value": "4000.0 W/m**2/K", "sigma_rel": 0.4})
    '4000 W/(m²·K) ± 40 %'
    >>> customary(["0.041 m", "0.05 m"])
    '41 to 50 mm'
    """
    if isinstance(text, bool):
        return "yes" if text else "no"
    if isinstance(text, Mapping):
        if set(text) == {"value", "sigma_rel"}:
            return f"{customary(text['value'])} ± {_short(100.0 * text['sigma_rel'])} %"
        return ", ".join(f"{key} {customary(value)}" for key, value in text.items() if key != "marks")
    if isinstance(text, (list, tuple)):
        return _sequence([customary(item) for item in text])
    if isinstance(text, float):
        return _short(text)
    words = str(text).split(" ", 1)
    try:
        number = float(words[0])
    except ValueError:
        return str(text)
    if len(words) == 1:
        return _short(number)
    if words[1] == "m" and 0.0 < abs(number) < 1.0e-4:
        return f"{_short(number * 1.0e6)} µm"
    unit, factor = _CUSTOMARY.get(words[1], (words[1], 1.0))
    return f"{_short(number * factor)}{'' if unit == '°' else ' '}{unit}"


def _sequence(items: list[str]) -> str:
    parts = [item.split(" ", 1) for item in items]
    units = {part[1] for part in parts if len(part) == 2}
    if len(units) == 1 and all(len(part) == 2 for part in parts):
        if len(items) == 2 and items[0] == items[1]:
            return items[0]
        joiner = " to " if len(items) == 2 else ", "
        return joiner.join(part[0] for part in parts) + " " + units.pop()
    return ", ".join(items)


def _short(number: float) -> str:
    rounded = float(f"{number:.6g}")
    if rounded == int(rounded) and abs(rounded) < 1.0e7:
        return str(int(rounded))
    return f"{rounded:g}"


def input_groups(definition: Mapping[str, Any], defaults: Collection[str] = ()) -> list[dict[str, Any]]:
    """Tables of a resolved definition, one a top-level table of the file.

    Parameters
    ----------
    definition : mapping
        As read from ``machine.toml``.
    defaults : collection of str
        Paths (``film.0.name``) of values that the user's file did not give;
        the mark of their table does not hold for them.

    Returns
    -------
    list of dict
        ``title``, ``open``, ``columns`` and ``rows`` for the report's table macro.
    """
    columns = [{"title": "quantity"}, {"title": "value"}, {"title": "source", "mark": True}]
    unset = frozenset(defaults)
    groups = []
    for key, value in definition.items():
        rows: list[dict[str, Any]] = []
        if _is_tables(value):
            for index, item in enumerate(value):
                rows += _heading(item.get("name", index + 1)) + _rows(
                    item, "", f"{key}.{index}.", unset, skip_name=True
                )
        elif isinstance(value, Mapping) and _holds_tables(value):
            for name, table in value.items():
                rows += _heading(name) + _rows(table, "", f"{key}.{name}.", unset)
        elif isinstance(value, Mapping) and not _is_prior(value):
            rows = _rows(value, "", f"{key}.", unset)
        if rows:
            groups.append(
                {"title": key.replace("_", " "), "open": key in _OPEN, "columns": columns, "rows": rows}
            )
    order = [name.replace("_", " ") for name in _OPEN]
    groups.sort(key=lambda group: order.index(group["title"]) if group["title"] in order else len(order))
    general = [
        {"cells": [key.replace("_", " "), customary(value), ""]}
        for key, value in definition.items()
        if (_is_prior(value) or not isinstance(value, Mapping))
        and not _is_tables(value)
        and key not in _HIDDEN
    ]
    if general:
        groups.append({"title": "general", "open": False, "columns": columns, "rows": general})
    return groups


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _is_prior(value: Any) -> bool:
    return isinstance(value, Mapping) and set(value) == {"value", "sigma_rel"}


def _holds_tables(table: Mapping[str, Any]) -> bool:
    inner = [value for key, value in table.items() if key != "marks"]
    return bool(inner) and all(isinstance(value, Mapping) and not _is_prior(value) for value in inner)


def _heading(name: Any) -> list[dict[str, Any]]:
    return [{"kind": "group", "cells": [str(name)]}]


def _rows(
    table: Mapping[str, Any],
    prefix: str,
    path: str,
    unset: Collection[str],
    inherited: str = UNMARKED,
    *,
    skip_name: bool = False,
) -> list[dict[str, Any]]:
    marks = table.get("marks", {"default": inherited})
    marks = {"default": marks} if isinstance(marks, str) else marks
    rows: list[dict[str, Any]] = []
    for key, value in table.items():
        if key == "marks" or (skip_name and key == "name"):
            continue
        label = prefix + key.replace("_", " ")
        mark = "" if path + key in unset else marks.get(key, marks.get("default", UNMARKED))
        if _is_tables(value):
            for index, item in enumerate(value):
                inner = f"{label}, {item.get('name', index + 1)}: "
                rows += _rows(item, inner, f"{path}{key}.{index}.", unset, mark, skip_name=True)
        elif isinstance(value, Mapping) and not _is_prior(value):
            rows += _rows(value, f"{label}, ", f"{path}{key}.", unset, mark)
        else:
            rows.append({"cells": [label, customary(value), mark]})
    return rows
