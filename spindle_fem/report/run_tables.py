"""Tables of a run for the report, from ``summary.json`` and ``result.nc`` alone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from spindle_fem.report.block_page import Table
from spindle_fem.report.figure_style import BODY_NAMES, grouped
from spindle_fem.report.table_rows import (
    MISSING,
    Field,
    column,
    fixed,
    number,
    rounded,
    rows_of,
    significant,
    table_of,
    words,
)

if TYPE_CHECKING:
    import xarray as xr


# Walls of a circuit's cells, or the raceways that the oil of a bearing wets.
_WALLS = r"{}\.(?:(?:(?:inner|outer|cover)\.)?\d+|(?:inner|outer)_raceway|balls)"


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


def heat_by_sink(heat_out: Mapping[str, float], circuits: Iterable[str]) -> dict[str, float]:
    """Heat that leaves with the walls of each circuit added up; most first.

    >>> heat_by_sink({"outside": 1.0, "jacket.1": 2.0, "jacket.2": 3.0, "R1.balls": 4.0},
    ...              ["jacket", "R1.lubrication"])
    {'jacket': 5.0, 'R1.lubrication': 4.0, 'outside': 1.0}
    """
    walls = {name: _WALLS.format(re.escape(name.removesuffix(".lubrication"))) for name in circuits}
    totals: dict[str, float] = {}
    for key, value in heat_out.items():
        sink = next((name for name, wall in walls.items() if re.fullmatch(wall, key)), key)
        totals[sink] = totals.get(sink, 0.0) + value
    return dict(sorted(totals.items(), key=lambda item: -item[1]))


def warmest_at(summary: Mapping[str, Any]) -> str:
    """Where the solid is warmest, in words.

    >>> warmest_at({"temperature": {"max_at_mm": [0.0, 30.0, 12.0]}})
    'r = 30 mm, z = 12 mm'
    """
    x, y, z = summary["temperature"]["max_at_mm"]
    return f"r = {math.hypot(x, y):.0f} mm, z = {z:.0f} mm"


def headline(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Cards with the numbers that a designer looks for first."""
    temperature, energy = summary["temperature"], summary["energy"]
    items = [(f"{number(temperature['max_degC'])} °C", f"warmest place of the solid, {warmest_at(summary)}")]
    bearings = summary["bearings"]
    if bearings:
        ball = max(bearings, key=lambda name: _or_low(bearings[name]["temperature_ball_degC"]))
        rings = max(bearings, key=lambda name: _or_low(bearings[name]["ring_difference_K"]))
        items += [
            (f"{number(bearings[ball]['temperature_ball_degC'])} °C", f"warmest rolling elements, {ball}"),
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
    taken = {name: circuit["heat_W"] for name, circuit in (summary.get("circuits") or {}).items()}
    if coolant:
        taken = {"channel": coolant["heat_W"], **taken}
    if taken:
        heat = sum(taken.values())
        share = 100.0 * heat / energy["heat_in_W"] if energy["heat_in_W"] else math.nan
        each = ", ".join(f"{readable(name)} {number(value, 0)} W" for name, value in taken.items())
        what = f"taken by the coolant, {number(share, 0)} % of the heat put in"
        items.append((f"{number(heat, 0)} W", f"{what}: {each}" if len(taken) > 1 else what))
    if coolant:
        items += [
            (
                f"{number(coolant['outlet_degC'], 2)} °C",
                f"coolant outlet, inlet {number(coolant['inlet_degC'], 1)} °C",
            ),
            (f"{significant(coolant['pressure_drop_Pa'] / 1.0e5)} bar", _pressure_drop(coolant)),
        ]
    return [{"value": value, "name": name} for value, name in items]


def _pressure_drop(coolant: Mapping[str, Any]) -> str:
    """What takes the pressure; folders of earlier versions do not tell."""
    ports = coolant.get("ports_pressure_drop_Pa")
    if not ports:
        return "pressure drop of the channel"
    channel = coolant["pressure_drop_Pa"] - ports
    return (
        f"pressure drop, {significant(channel / 1.0e5)} bar of it along the channel and "
        f"{significant(ports / 1.0e5)} bar in its ports"
    )


def _or_low(value: Any) -> float:
    return -math.inf if value is None else value


def bearing_table(summary: Mapping[str, Any]) -> Table:
    """State of each bearing."""
    columns = (
        ("heat_W", "heat / W", 1),
        ("temperature_inner_degC", "inner race / °C", 1),
        ("temperature_ball_degC", "rolling elements / °C", 1),
        ("temperature_outer_degC", "outer race / °C", 1),
        ("ring_difference_K", "inner − outer / K", 1),
        ("contact_angle_inner_deg", "contact angle inner / °", 1),
        ("contact_angle_outer_deg", "contact angle outer / °", 1),
        ("preload_N", "preload / N", 0),
        ("axial_load_N", "axial load / N", 0),
        ("film_um", "film / µm", 2),
        ("lambda", "lambda", 1),
    )
    fields = (
        words("bearing", itemgetter(0)),
        *(fixed(title, lambda item, key=key: item[1].get(key), digits) for key, title, digits in columns),
    )
    caption = (
        "Heat, temperatures and state of each bearing. The axial load is its share of preload, thrust and "
        "the springs of other sets; a set that nothing but those presses on has no preload of its own."
    )
    return table_of(fields, summary["bearings"].items(), caption)


def term_table(summary: Mapping[str, Any]) -> Table:
    """Heat term by term, and where it enters, one column a bearing."""
    bearings = summary["bearings"]

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
    columns = (
        column("friction heat / W"),
        *(column(name, number=True) for name in bearings),
        column("all", number=True),
    )
    lines = [
        {"kind": "group", "cells": ["term by term"]},
        *rows("terms_W", {}),
        {"kind": "total", "cells": ["sum", *map(number, total), number(sum(total))]},
        {"kind": "group", "cells": ["where it enters"]},
        *rows("heat_to_W", BODY_NAMES),
    ]
    return Table(columns, lines, "Friction heat of each bearing, W.")


def regime_words(coolant: Mapping[str, Any]) -> str:
    """Flow regime of the channel and the source of its film coefficient."""
    state = (
        "within the range of its source"
        if coolant["in_range"]
        else "outside the range of its source, see the warnings"
    )
    return f"Flow regime: {coolant['regime']}. Film coefficient after {coolant['source']}; {state}."


def coolant_table(coolant: Mapping[str, Any]) -> Table:
    """Channel flow with the range of its film coefficient."""
    film = coolant["film_coefficient_W_m2K"]
    # Folders of earlier versions lack the key.
    asked = coolant.get("asked_flow_m3_s", coolant["flow_m3_s"])
    entries = (
        ("flow asked for", significant(asked * 6.0e4), "L/min"),
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
        ("of it in ports", significant(coolant.get("ports_pressure_drop_Pa", math.nan) / 1.0e5), "bar"),
        ("pumping power", significant(coolant["pumping_power_W"]), "W"),
        ("hydraulic diameter", significant(coolant["hydraulic_diameter_m"] * 1.0e3, 4), "mm"),
        ("length", significant(coolant["length_m"], 4), "m"),
        ("wetted area", significant(coolant["wetted_area_m2"] * 1.0e4, 4), "cm²"),
    )
    return Table((column("quantity"), column("value", number=True), column("unit")), rows_of(entries))


def circuit_table(summary: Mapping[str, Any]) -> Table:
    """Flow, temperatures and heat of every circuit beside the channel."""
    columns = ("flow / L/min", "inlet / °C", "outlet / °C", "heat / W", "Re", "film / W/(m²·K)", "drop / bar")
    rows = [
        [
            readable(name),
            significant(circuit["flow_m3_s"] * 6.0e4),
            number(circuit["inlet_degC"], 2),
            number(circuit["outlet_degC"], 2),
            number(circuit["heat_W"]),
            significant(circuit["reynolds"]),
            significant(circuit["film_coefficient_W_m2K"]),
            significant(circuit["pressure_drop_Pa"] / 1.0e5),
            f"{circuit['regime']}, {circuit['source']}",
        ]
        for name, circuit in summary["circuits"].items()
    ]
    head = (column("circuit"), *(column(name, number=True) for name in columns), column("film by"))
    return Table(head, rows_of(rows))


def balance_table(summary: Mapping[str, Any]) -> Table:
    """Heat in and out."""
    energy = summary["energy"]
    scale = abs(energy["heat_in_W"]) or 1.0

    def cells(name: str, value: float) -> list[str]:
        return [name, number(value, 2), number(100.0 * value / scale)]

    sources = heat_by_source(energy.get("heat_in_by_W", {}), summary["bearings"])
    sinks = heat_by_sink(energy["heat_out_W"], summary.get("circuits") or {})
    rows = [
        {"kind": "group", "cells": ["put in"]},
        *rows_of(cells(readable(name), value) for name, value in sources.items()),
        {"kind": "total", "cells": ["sum", number(energy["heat_in_W"], 2), "100.0"]},
        {"kind": "group", "cells": ["leaves by"]},
        *rows_of(cells(readable(name), value) for name, value in sinks.items()),
        {"kind": "total", "cells": cells("sum", sum(energy["heat_out_W"].values()))},
    ]
    columns = (column("heat"), column("W", number=True), column("% of heat put in", number=True))
    return Table(columns, rows, "Heat put in and heat that leaves; negative values enter the machine.")


def probe_table(summary: Mapping[str, Any]) -> Table:
    """Probe readings."""
    fields = (words("probe", itemgetter(0)), fixed("temperature / °C", itemgetter(1), 2))
    return table_of(fields, summary["probes"].items(), "What the probes should read.")


def growth_table(summary: Mapping[str, Any], fitted: Collection[str]) -> Table:
    """Fits and radial growth at every bearing; how a ring sits is known of ``fitted`` bearings only."""
    growth, fits = summary["growth"], summary["fits"]

    def row(bearing: str, side: str, ring: str) -> list[str]:
        fit = fits[bearing][side]
        return [
            bearing,
            f"{ring} ring on {side}" if side == "shaft" else f"{ring} ring in {side}",
            number(fit["pressure_MPa"], 2) if bearing in fitted else MISSING,
            number(fit["gap_um"], 1) if bearing in fitted else MISSING,
            number(growth["seats"][bearing][f"{side}_um"]),
            number(growth["raceways"][bearing][f"{ring}_um"]),
        ]

    rows = [
        row(bearing, side, ring)
        for bearing in fits
        for side, ring in (("shaft", "inner"), ("housing", "outer"))
        if side in fits[bearing]
    ]
    columns = (
        column("bearing"),
        column("seat"),
        *(
            column(name, number=True)
            for name in ("pressure / MPa", "radial gap / µm", "seat grown / µm", "raceway grown / µm")
        ),
    )
    caption = "Fits, and radial growth since assembly by temperature, rotation, fit and ball load."
    return Table(columns, rows_of(rows), caption)


def spacer_table(summary: Mapping[str, Any]) -> Table:
    """How much longer the spacers have become."""
    entries = {
        readable(name): item["length_um"] for name, item in summary["growth"].get("spacers", {}).items()
    }
    fields = (words("spacer", itemgetter(0)), fixed("longer / µm", itemgetter(1), 2))
    caption = "Growth of the spacers along the axis since assembly, by temperature alone."
    return table_of(fields, entries.items(), caption)


def displacement_table(summary: Mapping[str, Any]) -> Table:
    """Readings of the displacement sensors."""
    fields = [words("sensor", itemgetter(0)), fixed("displacement / µm", itemgetter(1), 2)]
    solid = summary["growth"].get("three_dimensional", {}).get("displacements", {})
    if solid:
        fields.append(fixed("in three dimensions / µm", lambda item: solid[item[0]], 2))
    caption = "What the displacement sensors read since assembly."
    return table_of(tuple(fields), summary.get("displacements", {}).items(), caption)


def nose_table(summary: Mapping[str, Any]) -> Table:
    """Displacement of the nose relative to the frame that the flange is bolted to."""
    growth = summary["growth"]
    entries = [
        (words, number(growth[key]), unit)
        for words, key, unit in (
            ("forward", "nose_axial_um", "µm"),
            ("up (θ = 0°)", "nose_radial_up_um", "µm"),
            ("across (θ = 90°)", "nose_radial_across_um", "µm"),
            ("axis tilted up towards the drive end", "nose_tilt_up_urad", "µrad"),
            ("axis tilted across", "nose_tilt_across_urad", "µrad"),
        )
        if growth[key] is not None
    ]
    columns = (column("nose"), column("value", number=True), column("unit"))
    return Table(
        columns, rows_of(entries), "Displacement of the nose since assembly, by temperature and rotation."
    )


def joint_table(summary: Mapping[str, Any]) -> Table:
    """Heat through joints."""
    fields = (
        words("joint", lambda item: readable(item[0])),
        fixed("heat / W", lambda item: item[1]["heat_W"], 2),
    )
    caption = "Heat through each joint, from the first-named part to the second."
    return table_of(fields, sorted(summary.get("joints", {}).items()), caption)


def surface_table(dataset: xr.Dataset) -> Table:
    """Surfaces that exchange heat."""

    def values(name: str) -> Callable[[int], float]:
        return dataset[f"surface_{name}"].values.astype(float).tolist().__getitem__

    film, area = values("film_coefficient"), values("area")
    fields = (
        words("surface", lambda index: readable(str(dataset["surface"].values[index]))),
        fixed("area / cm²", lambda index: area(index) * 1.0e4),
        fixed("mean / °C", values("temperature_mean"), 2),
        rounded("film / W/(m²·K)", film),
        fixed("fluid / °C", values("fluid_temperature"), 2),
    )
    shown = [index for index in range(dataset.sizes["surface"]) if math.isfinite(film(index))]
    return table_of(fields, shown, "Exposed surfaces with a film: area means.")


def check_table(summary: Mapping[str, Any]) -> Table:
    """Self-checks with value and limit."""
    fields = (
        words("check", "name"),
        rounded("value", "value", 2),
        rounded("limit", "limit", 2),
        words("unit", lambda item: item["unit"].replace("-", "")),
        Field("result", "passed", bool, "verdict"),
        words("meaning", "explanation"),
    )
    return table_of(fields, summary.get("checks", ()))


def mesh_table(summary: Mapping[str, Any]) -> Table:
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
    columns = (column("quantity"), column("value", number=True), column("where"))
    return Table(columns, rows_of(rows), "Mesh: largest differences from the solid model.")


def version_table(summary: Mapping[str, Any], attributes: Mapping[str, Any]) -> Table:
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
    return Table((column("what"), column("value")), rows_of(rows))
