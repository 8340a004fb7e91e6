"""Machine definitions read and changed without the package: plain tables, lengths in metres, written back.

A definition that ships is taken with its heat from the table, its films constant and its balls of one
temperature; a scale makes a machine of another size of it.
"""

import re
import tomllib
from pathlib import Path
from typing import Any

GEOMETRY = Path(__file__).parents[2] / "geometry"
_NUMBER = re.compile(r"^\s*([-+0-9.eE]+)\s*(\S.*)?$")
_SCALES = {"mm": 1e-3, "m": 1.0, "W": 1.0, "N": 1.0, "rpm": 1.0, "W/K": 1.0, "J/K": 1.0, "W/m**2/K": 1.0}
_SCALES |= {"W/m/K": 1.0, "kg/m**3": 1.0, "J/kg/K": 1.0, "degC": 1.0, "K": 1.0, "deg": 1.0}
# Tables needed only by heat laws that are not used, or for the package's mesh.
_LENGTHS = ("part", "bearing_types", "bearing_set", "surface", "probe")


def value(text: Any) -> float:
    """Number of a quantity, in SI (degrees and rpm stay); the middle of an uncertain one.

    >>> value("12 mm"), value({"value": "10 W/m**2/K", "sigma_rel": 0.3}), value(2.0)
    (0.012, 10.0, 2.0)
    """
    if isinstance(text, dict):
        return value(text["value"])
    if isinstance(text, (int, float)):
        return float(text)
    number, unit = _NUMBER.match(text).groups()
    return float(number) * (_SCALES[unit] if unit else 1.0)


def _scaled(table: Any, scale: float) -> Any:
    if isinstance(table, dict):
        return {k: v if k == "marks" else _scaled(v, scale) for k, v in table.items()}
    if isinstance(table, list):
        return [_scaled(v, scale) for v in table]
    if isinstance(table, str) and table.endswith(" mm"):
        return f"{float(table[:-3]) * scale:.6g} mm"
    return table


def recorded(name: str, scale: float = 1.0, film: float = 12.0) -> dict[str, Any]:
    """Tables of a shipped machine without a channel as recordings take it: heat by table, films constant.

    Lengths times ``scale``; heat grows with its square (areas), speeds fall with it.
    """
    tables = tomllib.loads((GEOMETRY / f"{name}.toml").read_text(encoding="utf-8"))
    for key in _LENGTHS:
        tables[key] = _scaled(tables[key], scale)
    tables["name"] = f"{name}_recorded" if scale == 1.0 else f"{name}_times_{scale:g}".replace(".", "_")
    tables["heat_capacity_factor"] = {"value": 1.0, "sigma_rel": 0.03}
    heat = tables["heat"]
    heat |= {"model": "table", "ball_share": 0.0, "inner_share": {"value": 0.5, "sigma_rel": 0.1}}
    heat["table"]["speed"] = [f"{value(n) / scale:g} rpm" for n in heat["table"]["speed"]]
    heat["table"]["heat"] = {
        b: [f"{value(w) * scale**2:.4g} W" for w in row] for b, row in heat["table"]["heat"].items()
    }
    tables["operation"]["speed"] = f"{value(tables['operation']['speed']) / scale:g} rpm"
    for ring in tables["bearing_set"]:
        ring["heat_factor"] = {"value": 1.0, "sigma_rel": 0.1}
        ring["ball_row"] = {
            "kind": "constant",
            "conductance": f"{3.0 * scale:.4g} W/K",
            "capacity": f"{60.0 * scale**3:.4g} J/K",
            "marks": "A",
        }
    for k, one in enumerate(tables["film"]):
        if one["kind"] == "natural_convection_radiation":
            plain = {"value": f"{film} W/m**2/K", "sigma_rel": 0.3}
            tables["film"][k] = {"kind": "constant", "coefficient": plain, "marks": "A"} | {
                key: one[key] for key in ("name", "surface")
            }
        elif "diameter" in one:
            one["diameter"] = _scaled(one["diameter"], scale)
    for one in tables["gap"]:
        if one["kind"] != "power_law":
            one |= {"kind": "power_law", "at_rest": "8 W/m**2/K", "rise": "12 W/m**2/K"}
            one |= {"reference_speed": "3000 rpm", "exponent": 0.75}
    balls = [f"ball_row.{s['name']}" for s in tables["bearing_set"]]
    tables.setdefault("factor", []).append(
        {"name": "ball_conductance", "sigma_rel": 0.3, "applies_to": balls, "marks": "A"}
    )
    return tables


def text_of(tables: dict[str, Any]) -> str:
    """The tables as TOML: top keys first, tables and arrays of tables inline below."""

    def plain(item: Any) -> str:
        if isinstance(item, bool):
            return "true" if item else "false"
        if isinstance(item, str):
            return '"' + item.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(item, list):
            return "[" + ", ".join(plain(x) for x in item) + "]"
        if isinstance(item, dict):
            return "{" + ", ".join(f"{_key(k)} = {plain(v)}" for k, v in item.items()) + "}"
        return repr(item)

    lines = [f"{k} = {plain(v)}" for k, v in tables.items() if not isinstance(v, (dict, list))]
    for name, item in tables.items():
        if isinstance(item, dict):
            lines += ["", f"[{name}]", *(f"{_key(k)} = {plain(v)}" for k, v in item.items())]
        elif isinstance(item, list):
            for entry in item:
                lines += ["", f"[[{name}]]", *(f"{_key(k)} = {plain(v)}" for k, v in entry.items())]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else f'"{name}"'
