"""Tables of a run for the report, from ``summary.json`` and ``result.nc`` alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spindle_fem.report.figure_style import BODY_NAMES, grouped

if TYPE_CHECKING:
    import xarray as xr

MISSING = "–"


def number(value: Any, digits: int = 1) -> str:
    """Fixed-point text, a dash where there is no value.

    >>> number(3.14159, 2), number(None), number(-0.04, 1)
    ('3.14', '–', '0.0')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return MISSING
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text.replace("-", "−")


def significant(value: Any, digits: int = 3) -> str:
    """Text with significant digits, a dash where there is no value.

    >>> significant(1213.6), significant(2.6e-13, 2), significant(0.0)
    ('1210', '2.6e−13', '0')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return MISSING
    if value == 0.0:
        return "0"
    if 1.0e-3 <= abs(value) < 1.0e6:
        decimals = digits - 1 - math.floor(math.log10(abs(value)))
        text = f"{round(value, decimals):.{max(decimals, 0)}f}"
        if "." in text:
            text = text.rstrip("0").rstrip(".")
    else:
        text = f"{value:.{max(digits - 1, 1)}e}".replace("e-0", "e-").replace("e+0", "e+")
    return text.replace("-", "−")


def column(title: str, **kind: bool) -> dict[str, Any]:
    """Column of the table macro; ``number``, ``mark`` or ``verdict``."""
    return {"title": title, **kind}


def rows_of(cells: Any) -> list[dict[str, Any]]:
    """Rows of the table macro."""
    return [{"cells": list(row)} for row in cells]


def readable(name: str) -> str:
    """Name of a surface, joint or term for people.

    >>> readable("housing.channel_wall"), readable("F1.inner_ring|shaft:face")
    ('coolant, channel wall', 'F1.inner ring | shaft, face')
    """
    for ending, text in (("channel_wall", "coolant, channel wall"), ("channel_ports", "coolant, ports")):
        if name.endswith("." + ending):
            return text
    return name.replace("_", " ").replace("|", " | ").replace(":", ", ")


def heat_by_source(heat_in_by: Mapping[str, float], bearings: Iterable[str]) -> dict[str, float]:
    """Heat put in with the races and balls of each bearing added up.

    >>> heat_by_source({"F1.inner_raceway": 1.0, "F1.balls": 2.0, "motor": 3.0}, ["F1"])
    {'F1': 3.0, 'motor': 3.0}
    """
    names = set(bearings)
    totals: dict[str, float] = {}
    for key, value in heat_in_by.items():
        owner = key.split(".", 1)[0]
        source = owner if owner in names else key
        totals[source] = totals.get(source, 0.0) + value
    return totals


def headline(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Cards with the numbers that a designer asks for first."""
    temperature, energy = summary["temperature"], summary["energy"]
    x, y, z = temperature["max_at_mm"]
    items = [
        (
            f"{number(temperature['max_degC'])} °C",
            f"warmest place of the solid, r = {math.hypot(x, y):.0f} mm, z = {z:.0f} mm",
        ),
    ]
    bearings = summary["bearings"]
    if bearings:
        ball = max(bearings, key=lambda name: _or_low(bearings[name]["temperature_ball_degC"]))
        rings = max(bearings, key=lambda name: _or_low(bearings[name]["ring_difference_K"]))
        items += [
            (f"{number(bearings[ball]['temperature_ball_degC'])} °C", f"warmest balls, {ball}"),
            (
                f"{number(bearings[rings]['ring_difference_K'])} K",
                f"largest inner minus outer raceway temperature, {rings}",
            ),
        ]
        films = {name: state["lambda"] for name, state in bearings.items() if state["lambda"] is not None}
        if films:
            thin = min(films, key=films.__getitem__)
            items.append((number(films[thin]), f"smallest film over roughness (lambda), {thin}"))
    items.append((f"{number(energy['heat_in_W'], 0)} W", "heat put in"))
    coolant = summary.get("coolant")
    if coolant:
        share = 100.0 * coolant["heat_W"] / energy["heat_in_W"] if energy["heat_in_W"] else math.nan
        items += [
            (
                f"{number(coolant['heat_W'], 0)} W",
                f"taken by the coolant, {number(share, 0)} % of the heat put in",
            ),
            (
                f"{number(coolant['outlet_degC'], 2)} °C",
                f"coolant outlet, inlet {number(coolant['inlet_degC'], 1)} °C",
            ),
            (f"{significant(coolant['pressure_drop_Pa'] / 1.0e5)} bar", "pressure drop of the channel"),
        ]
    return [{"value": value, "name": name} for value, name in items]


def _or_low(value: Any) -> float:
    return -math.inf if value is None else value


def bearing_table(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """State of each bearing."""
    if not summary["bearings"]:
        return None
    fields = (
        ("heat_W", "heat / W", 1),
        ("temperature_inner_degC", "inner race / °C", 1),
        ("temperature_ball_degC", "balls / °C", 1),
        ("temperature_outer_degC", "outer race / °C", 1),
        ("ring_difference_K", "inner − outer / K", 1),
        ("contact_angle_inner_deg", "contact angle inner / °", 1),
        ("contact_angle_outer_deg", "contact angle outer / °", 1),
        ("preload_N", "preload / N", 0),
        ("film_um", "film / µm", 2),
        ("lambda", "lambda", 1),
    )
    return {
        "columns": [column("bearing")] + [column(title, number=True) for _, title, _ in fields],
        "rows": rows_of(
            [name, *(number(state.get(key), digits) for key, _, digits in fields)]
            for name, state in summary["bearings"].items()
        ),
    }


def term_table(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Heat term by term, and where it enters, one column a bearing."""
    bearings = summary["bearings"]
    if not bearings:
        return None

    def rows(key: str, names: Mapping[str, str]) -> list[dict[str, Any]]:
        found = list(dict.fromkeys(name for state in bearings.values() for name in state.get(key, {})))
        table = []
        for name in found:
            values = [state.get(key, {}).get(name) or 0.0 for state in bearings.values()]
            table.append(
                {"cells": [names.get(name, readable(name)), *map(number, values), number(sum(values))]}
            )
        return table

    total = [state["heat_W"] for state in bearings.values()]
    columns = [
        column("friction heat / W"),
        *(column(name, number=True) for name in bearings),
        column("all", number=True),
    ]
    return {
        "columns": columns,
        "rows": [
            {"kind": "group", "cells": ["term by term"]},
            *rows("terms_W", {}),
            {"kind": "total", "cells": ["sum", *map(number, total), number(sum(total))]},
            {"kind": "group", "cells": ["where it enters"]},
            *rows("heat_to_W", BODY_NAMES),
        ],
    }


def coolant_table(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Channel flow with the range of its film coefficient."""
    coolant = summary.get("coolant")
    if not coolant:
        return None
    film = coolant["film_coefficient_W_m2K"]
    state = (
        "within the range of its source"
        if coolant["in_range"]
        else "outside the range of its source, see the warnings"
    )
    entries = (
        ("flow", significant(coolant["flow_m3_s"] * 6.0e4), "L/min"),
        ("inlet", number(coolant["inlet_degC"], 2), "°C"),
        ("outlet, mixed", number(coolant["outlet_degC"], 2), "°C"),
        ("heat taken up", number(coolant["heat_W"]), "W"),
        ("mean velocity", significant(coolant["velocity_m_s"]), "m/s"),
        ("Reynolds number (hydraulic diameter, inlet)", significant(coolant["reynolds"]), ""),
        ("Prandtl number", significant(coolant["prandtl"]), ""),
        ("film coefficient, area mean", significant(film["value"]), "W/(m²·K)"),
        ("film coefficient, low", significant(film["low"]), "W/(m²·K)"),
        ("film coefficient, high", significant(film["high"]), "W/(m²·K)"),
        ("pressure drop", significant(coolant["pressure_drop_Pa"] / 1.0e5), "bar"),
        ("pumping power", significant(coolant["pumping_power_W"]), "W"),
        ("hydraulic diameter", significant(coolant["hydraulic_diameter_m"] * 1.0e3, 4), "mm"),
        ("length", significant(coolant["length_m"], 4), "m"),
        ("wetted area", significant(coolant["wetted_area_m2"] * 1.0e4, 4), "cm²"),
    )
    return {
        "sentence": f"Flow regime: {coolant['regime']}. Film coefficient after {coolant['source']}; {state}.",
        "columns": [column("quantity"), column("value", number=True), column("unit")],
        "rows": rows_of(entries),
    }


def balance_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Heat in and out."""
    energy = summary["energy"]
    scale = abs(energy["heat_in_W"]) or 1.0
    rows: list[dict[str, Any]] = [{"kind": "group", "cells": ["put in"]}]
    for name, value in heat_by_source(energy.get("heat_in_by_W", {}), summary["bearings"]).items():
        rows.append({"cells": [readable(name), number(value, 2), number(100.0 * value / scale)]})
    rows.append({"kind": "total", "cells": ["sum", number(energy["heat_in_W"], 2), "100.0"]})
    rows.append({"kind": "group", "cells": ["leaves by"]})
    for name, value in sorted(energy["heat_out_W"].items(), key=lambda item: -item[1]):
        rows.append({"cells": [readable(name), number(value, 2), number(100.0 * value / scale)]})
    out = sum(energy["heat_out_W"].values())
    rows.append({"kind": "total", "cells": ["sum", number(out, 2), number(100.0 * out / scale)]})
    return {
        "columns": [column("heat"), column("W", number=True), column("% of heat put in", number=True)],
        "rows": rows,
    }


def probe_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Probe readings."""
    return {
        "columns": [column("probe"), column("temperature / °C", number=True)],
        "rows": rows_of([name, number(value, 2)] for name, value in summary["probes"].items()),
    }


def joint_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Heat through joints."""
    joints = summary.get("joints", {})
    return {
        "columns": [column("joint"), column("heat / W", number=True)],
        "rows": rows_of([readable(name), number(item["heat_W"], 2)] for name, item in sorted(joints.items())),
    }


def surface_table(dataset: xr.Dataset) -> dict[str, Any]:
    """Surfaces that exchange heat."""
    columns = [
        column("surface"),
        column("area / cm²", number=True),
        column("mean / °C", number=True),
        column("film / W/(m²·K)", number=True),
        column("fluid / °C", number=True),
    ]
    film = dataset["surface_film_coefficient"].values
    rows = rows_of(
        [
            readable(str(name)),
            number(dataset["surface_area"].values[index] * 1.0e4, 1),
            number(dataset["surface_temperature_mean"].values[index], 2),
            significant(float(film[index])),
            number(dataset["surface_fluid_temperature"].values[index], 2),
        ]
        for index, name in enumerate(dataset["surface"].values)
        if np.isfinite(film[index])
    )
    return {"columns": columns, "rows": rows}


def check_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Self-checks with value and limit."""
    return {
        "columns": [
            column("check"),
            column("value", number=True),
            column("limit", number=True),
            column("unit"),
            column("result", verdict=True),
            column("meaning"),
        ],
        "rows": rows_of(
            [
                item["name"],
                significant(item["value"], 2),
                significant(item["limit"], 2),
                item["unit"].replace("-", ""),
                item["passed"],
                item["explanation"],
            ]
            for item in summary.get("checks", ())
        ),
    }


def mesh_table(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Mesh figures and how near the mesh is to the solid model."""
    mesh = summary["mesh"]
    rows = [
        ["elements (tetrahedra)", grouped(mesh["elements"]), ""],
        ["temperature unknowns", grouped(mesh["nodes"]), ""],
        ["order of the field", str(mesh["order"]), ""],
        ["smallest minSICN", number(mesh["min_quality"], 3), ""],
    ]
    for key, title in (("area_error_relative", "area"), ("volume_error_relative", "volume")):
        errors = mesh.get(key, {})
        if errors:
            worst = max(errors, key=lambda name: abs(errors[name] or 0.0))
            rows.append(
                [f"largest relative error of {title}", significant(errors[worst], 2), readable(worst)]
            )
    return {
        "columns": [column("quantity"), column("value", number=True), column("where")],
        "rows": rows_of(rows),
    }


def version_table(summary: Mapping[str, Any], attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Versions, hashes, times."""
    rows = [[name, version] for name, version in summary["versions"].items()]
    rows += [
        ["definition (SHA-256)", attributes.get("spec_sha256", MISSING)],
        ["mesh (digest)", attributes.get("mesh_digest", MISSING) or MISSING],
        ["wall time up to this report", f"{number(summary.get('wall_time_s'), 1)} s"],
        ["peak memory", f"{number(summary.get('peak_rss_MB'), 0)} MB"],
    ]
    rows += [
        [f"time: {readable(name)}", f"{number(value, 2)} s"]
        for name, value in summary.get("timings_s", {}).items()
    ]
    rows += [
        [f"iterations: {readable(name)}", str(value)] for name, value in summary.get("iterations", {}).items()
    ]
    return {"columns": [column("what"), column("value")], "rows": rows_of(rows)}
