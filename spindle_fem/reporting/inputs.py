"""Tables of a definition in customary units, with the marks of its sources."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
        joiner = " to " if len(items) == 2 else ", "
        return joiner.join(part[0] for part in parts) + " " + units.pop()
    return ", ".join(items)


def _short(number: float) -> str:
    rounded = float(f"{number:.6g}")
    if rounded == int(rounded) and abs(rounded) < 1.0e7:
        return str(int(rounded))
    return f"{rounded:g}"


def input_groups(definition: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tables of a resolved definition, one a top-level table of the file.

    Parameters
    ----------
    definition : mapping
        As read from ``machine.toml``.

    Returns
    -------
    list of dict
        ``title``, ``open``, ``columns`` and ``rows`` for the report's table macro.
    """
    columns = [{"title": "quantity"}, {"title": "value"}, {"title": "source", "mark": True}]
    general = [
        {"cells": [key.replace("_", " "), customary(value), ""]}
        for key, value in definition.items()
        if not isinstance(value, Mapping) and not _is_tables(value) and key not in _HIDDEN
    ]
    groups = []
    for key, value in definition.items():
        rows: list[dict[str, Any]] = []
        if (
            isinstance(value, Mapping)
            and any(isinstance(item, Mapping) for item in value.values())
            and key not in _OPEN
        ):
            for name, table in value.items():
                rows += _rows(table, f"{name}" if isinstance(table, Mapping) else "", "")
        elif isinstance(value, Mapping):
            rows = _rows(value, "", "")
        elif _is_tables(value):
            for number, item in enumerate(value, 1):
                rows += _rows(item, str(item.get("name", number)), "")
        if rows:
            groups.append(
                {
                    "title": key.replace("_", " "),
                    "open": key in _OPEN,
                    "columns": columns,
                    "rows": rows,
                    "key": key,
                }
            )
    groups.sort(key=lambda group: _OPEN.index(group["key"]) if group["key"] in _OPEN else len(_OPEN))
    if general:
        groups.append({"title": "general", "open": False, "columns": columns, "rows": general, "key": ""})
    return groups


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _rows(table: Any, heading: str, prefix: str) -> list[dict[str, Any]]:
    if not isinstance(table, Mapping):
        return [{"cells": [prefix.replace("_", " ") or heading, customary(table), ""]}]
    marks = table.get("marks", {})
    marks = {"default": marks} if isinstance(marks, str) else marks
    rows: list[dict[str, Any]] = [{"kind": "group", "cells": [heading.replace("_", " ")]}] if heading else []
    for key, value in table.items():
        if key == "marks" or (heading and key == "name"):
            continue
        label = f"{prefix}{key}".replace("_", " ")
        mark = marks.get(key, marks.get("default", ""))
        if _is_tables(value):
            for number, item in enumerate(value, 1):
                name = item.get("name", number)
                rows += [
                    row
                    for row in _rows(item, "", f"{label}, {name}: ")
                    if not row["cells"][0].endswith(": name")
                ]
        elif isinstance(value, Mapping) and set(value) != {"value", "sigma_rel"}:
            inner = _rows(value, "", f"{label}, ")
            own = value.get("marks")
            if own is None:
                inner = [{**row, "cells": [*row["cells"][:2], row["cells"][2] or mark]} for row in inner]
            rows += inner
        else:
            rows.append({"cells": [label, customary(value), mark]})
    return rows
