"""What random machines have beside bearings, drive and channel: oil, jackets, purge air, cutting fluid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spindle_fem.definition.bearing_catalogue import catalogue_bearing

LUBRICATIONS = ("grease", "oil_air", "oil_jet", "circulating_oil")
JACKETS = ("annulus", "ring_grooves", "helical_groove", "axial_bores", "bores there and back")
WATERS = ("water", *(f"ethylene_glycol_{share}" for share in (20, 30, 40, 50)))
OILS = tuple(f"iso_vg_{grade}" for grade in (10, 22, 32, 46, 68))
# Litres a minute through a bearing, between which flows are drawn evenly in their logarithm.
_OIL_FLOWS = {"oil_air": (2e-6, 2e-5), "oil_jet": (0.3, 3.0), "circulating_oil": (0.1, 1.0)}


def add_kinds(content: dict[str, Any], generator: np.random.Generator) -> dict[str, Any]:
    """Raw tables of a machine of ``random_machines`` with further kinds of things, in place."""
    for group in content["bearing_set"]:
        kind = str(generator.choice(LUBRICATIONS))
        if kind != "grease":
            group["lubrication"] = _lubrication(generator, kind)
        if generator.random() < 0.25 and not group["bearing_type"].endswith(" HC"):
            group["bearing_type"] += " HC"
        if generator.random() < 0.25 and "preload" in group:
            group["fit"] = {
                "inner_interference": f"{generator.uniform(1.0, 8.0):.1f} um",
                "outer_clearance": f"{generator.uniform(2.0, 12.0):.1f} um",
            }
    named = [*content.get("film", ()), *([content["coolant"]] if "coolant" in content else [])]
    for stream in named:
        stream["fluid"] = _fluid(generator)
        if generator.random() < 0.3:
            stream["pressure_limit"] = f"{generator.uniform(0.5, 6.0):.1f} bar"
    if "channel" not in content and not any(film.get("duct") == "annulus" for film in named):
        _jacket(content, generator)
    if generator.random() < 0.35:
        _purge(content, generator)
    if generator.random() < 0.35:
        _cutting_fluid(content, generator)
    # Friction that each ball settles by itself takes minutes of a machine under radial load.
    if generator.random() < 0.5 and content["heat"]["model"] in ("palmgren", "skf"):
        force = f"{generator.uniform(50.0, 1000.0):.0f} N"
        cut = {"name": "cut", "force": force, "z": "-20 mm", "angle": "90 deg"}
        content["radial_load"] = [*content.get("radial_load", ()), cut]
    return content


def _fluid(generator: np.random.Generator) -> str:
    return str(generator.choice(WATERS if generator.random() < 0.6 else OILS))


def _lubrication(generator: np.random.Generator, kind: str) -> dict[str, Any]:
    low, high = np.log(_OIL_FLOWS[kind])
    table = {
        "kind": kind,
        "oil": str(generator.choice(OILS)),
        "oil_flow": f"{np.exp(generator.uniform(low, high)):.3g} L/min",
        "inlet_temperature": f"{generator.uniform(18.0, 35.0):.1f} degC",
    }
    if kind == "oil_air":
        table["air_flow"] = f"{generator.uniform(15.0, 60.0):.0f} L/min"
    return table


def _millimetres(segment: Mapping[str, Any], key: str) -> float:
    return float(str(segment[key]).split()[0])


def _part(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(part for part in content["part"] if part["name"] == name)
    return found


def _jacket(content: dict[str, Any], generator: np.random.Generator) -> None:
    """A sleeve and its cover instead of the housing's middle, with one kind of duct between them."""
    segments = _part(content, "housing")["segment"]
    middle = next(segment for segment in segments if segment["name"] == "middle")
    clear, whole = _millimetres(middle, "inner_diameter"), _millimetres(middle, "outer_diameter")
    depth = round(min(float(generator.uniform(2.0, 7.0)), 0.25 * (whole - clear) - 3.0), 3)
    floor = round(0.5 * (clear + whole) - depth, 3)
    segments.remove(middle)
    for name, inner, outer in (("sleeve", clear, floor), ("cover", floor + 2.0 * depth, whole)):
        ends = {"inner_diameter": f"{inner:.4f} mm", "outer_diameter": f"{outer:.4f} mm"}
        segments.append({"name": name, "z": middle["z"], **ends})
    length = float(np.diff([float(end.split()[0]) for end in middle["z"]])[0])
    content.setdefault("film", []).append(
        {
            "kind": "circuit",
            "name": "jacket",
            "part": "housing",
            "diameter": f"{floor:.4f} mm",
            "z": middle["z"],
            "fluid": _fluid(generator),
            "inlet_temperature": f"{generator.uniform(15.0, 25.0):.1f} degC",
            "flow": f"{10.0 ** generator.uniform(0.0, 1.3):.2f} L/min",
            "flows_to": str(generator.choice(["front", "rear"])),
            **_duct(generator, length, floor, depth),
        }
    )


def _duct(generator: np.random.Generator, length: float, floor: float, depth: float) -> dict[str, Any]:
    """A kind of duct and its measures, in a sleeve whose floor has this length and diameter, mm."""
    kind = str(generator.choice(JACKETS))
    width = float(generator.uniform(5.0, 12.0))
    grooves = int(max(1.0, generator.uniform(0.3, 0.8) * length / width))
    measures = {"width": f"{width:.3f} mm", "depth": f"{depth:.4f} mm"}
    if generator.random() < 0.5:
        measures["outer_part"] = "housing"
    if kind == "ring_grooves":
        return {"duct": kind, "number": grooves, **measures}
    if kind == "helical_groove":
        starts = 2 if grooves % 2 == 0 else 1
        law = str(generator.choice(["straight", "helical"]))
        return {"duct": kind, "number": starts, "turns": grooves / starts, "law": law, **measures}
    if "bores" in kind:
        passes = int(generator.choice([2, 4])) if kind != "axial_bores" else 1
        bores = {"number": passes * int(generator.integers(2, 6)), "passes": passes}
        size = f"{generator.uniform(4.0, 9.0):.2f} mm"
        return {"duct": "axial_bores", "wall": "outside", "bore_diameter": size, **bores}
    return {"duct": "annulus", "outer_diameter": f"{floor + 2.0 * depth:.4f} mm"}


def _purge(content: dict[str, Any], generator: np.random.Generator) -> None:
    """A cap around the nose, and air that is blown out through the slit between them."""
    nose = next(segment for segment in _part(content, "shaft")["segment"] if segment["name"] == "nose")
    front = next(segment for segment in _part(content, "housing")["segment"] if segment["name"] == "front")
    face, outside = _millimetres(nose, "outer_diameter"), _millimetres(front, "inner_diameter")
    # It clamps the outer ring and stays clear of the inner one.
    kind = catalogue_bearing(content["bearing_set"][0]["bearing_type"])
    lip = 0.5 * (outside + float(kind["outer_ring_inner_diameter"].split()[0]))
    seat = float(str(nose["z"][1]).split()[0])
    slit = float(generator.uniform(0.3, 1.0))
    around = f"{outside + 20.0:.4f} mm"
    inner = f"{face + 2.0 * slit:.4f} mm"
    flange = {"name": "flange", "z": ["10 mm", f"{seat - 4.0:g} mm"], "inner_diameter": inner}
    pilot = {"name": "pilot", "z": [f"{seat - 4.0:g} mm", f"{seat:g} mm"], "inner_diameter": f"{lip:.4f} mm"}
    segments = [segment | {"outer_diameter": around} for segment in (flange, pilot)]
    content["part"].append({"name": "nose_cap", "material": "steel", "segment": segments})
    content.setdefault("film", []).append(
        {
            "kind": "circuit",
            "name": "purge",
            "duct": "annulus",
            "part": "shaft",
            "outer_part": "nose_cap",
            "diameter": nose["outer_diameter"],
            "outer_diameter": inner,
            "z": flange["z"],
            "flows_to": "front",
            "fluid": "air",
            "inlet_temperature": f"{generator.uniform(18.0, 28.0):.1f} degC",
            "flow": f"{generator.uniform(10.0, 80.0):.0f} L/min",
            "law": "turning",
        }
    )


def _cutting_fluid(content: dict[str, Any], generator: np.random.Generator) -> None:
    """Fluid that runs down over the front face of the nose."""
    nose = next(segment for segment in _part(content, "shaft")["segment"] if segment["name"] == "nose")
    low, high = (0.5 * _millimetres(nose, key) for key in ("inner_diameter", "outer_diameter"))
    place = {"facing": "front", "z": "0 mm", "r": [f"{low:.5f} mm", f"{high:.5f} mm"]}
    content.setdefault("surface", []).append({"name": "wet_nose", "part": "shaft", "where": [place]})
    content.setdefault("film", []).append(
        {
            "kind": "wetted",
            "name": "cutting_fluid",
            "surface": ["wet_nose"],
            "width": f"{1.6 * high:.1f} mm",
            "length": f"{1.6 * high:.1f} mm",
            "fluid": str(generator.choice(["water", "iso_vg_10"])),
            "inlet_temperature": f"{generator.uniform(18.0, 28.0):.1f} degC",
            "flow": f"{10.0 ** generator.uniform(0.3, 1.3):.2f} L/min",
        }
    )
