"""A cylindrical roller bearing from a TOML file: read, check, solve, report as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.bearing_catalogue import catalogue_bearing
from spindle_fem.definition.bearing_types import has_rollers
from spindle_fem.errors import FaultsError, GeometryError, OutOfValidityError, SpecError, SpindleFemError
from spindle_fem.physics.bearings.bearing_keys import GEOMETRY, HEAT, LUBRICANT, OPERATION, Reader
from spindle_fem.physics.bearings.bearing_report import REPORT_SCHEMA, life_report
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.bearing_tables import (
    heat_of,
    lubricant_of,
    read_document,
    read_tables,
    with_catalogue,
)
from spindle_fem.physics.bearings.heat_model import HeatOptions, friction_model_names
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.highest_speed import file_speed_faults
from spindle_fem.physics.bearings.mounting import ExternalLoad, uniform_temperatures
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry, RollerStates, solve_roller_bearing
from spindle_fem.physics.bearings.roller_set import RollerSet, solve_roller_set

_SIZE_KEYS = ("roller_diameter", "roller_length", "roller_count", "pitch_diameter")


def _rows(value: Any, where: str) -> int:
    if isinstance(value, bool) or value not in (1, 2):
        raise SpecError(where, f"{value!r} is no number of rows.", "Allowed: 1, 2.")
    return int(value)


_LENGTH, _NUMBER = GEOMETRY["width"], GEOMETRY["poisson_ratio"]
_BEARING: dict[str, Reader] = {
    "roller_diameter": _LENGTH,
    "roller_length": _LENGTH,
    "roller_count": GEOMETRY["ball_count"],
    "pitch_diameter": _LENGTH,
    "rows": _rows,
    "radial_clearance": _LENGTH,
    "young_modulus": GEOMETRY["young_modulus"],
    "poisson_ratio": _NUMBER,
    "roller_young_modulus": GEOMETRY["young_modulus"],
    "roller_poisson_ratio": _NUMBER,
    "density": GEOMETRY["density"],
    "bore_diameter": _LENGTH,
    "outer_diameter": _LENGTH,
    "palmgren_f0": _NUMBER,
    "seal_moment": GEOMETRY["seal_moment"],
    "dynamic_load_rating": GEOMETRY["dynamic_load_rating"],
    "kind": GEOMETRY["kind"],
}
_FIELDS = {"palmgren_f0": "palmgren_lubrication_factor"}
_TABLES = {
    "bearing": _BEARING,
    "operation": {key: OPERATION[key] for key in ("speed", "radial_load", "temperature")},
    "lubricant": LUBRICANT,
    "heat": {"model": HEAT["model"]},
}
_REQUIRED = {
    "bearing": _SIZE_KEYS,
    "operation": ("speed", "radial_load"),
    "lubricant": ("kinematic_viscosity_40", "kinematic_viscosity_100"),
    "heat": (),
}


def is_roller_document(document: Mapping[str, Any]) -> bool:
    """Whether a bearing file describes a cylindrical roller bearing."""
    table = document.get("bearing")
    if not isinstance(table, dict):
        return False
    designation = table.get("catalogue")
    found = catalogue_bearing(designation) if isinstance(designation, str) else None
    kind = table.get("kind", (found or {}).get("kind"))
    return isinstance(kind, str) and has_rollers(kind)


def roller_report(path: str | Path) -> dict[str, Any]:
    """Solve the roller bearing of a TOML file and report it for JSON.

    Returns
    -------
    dict
        As of a ball bearing, with ``rollers`` for ``balls``; no heat and no film without a lubricant.

    Raises
    ------
    BadInputError
        Every fault of the file with file, key, value and what is allowed.
    """
    file = str(path)
    faults: list[SpindleFemError] = []
    document = with_catalogue(read_document(path), file, faults, _BEARING, "roller")
    # Keys that an unknown bearing would have supplied are not reported as missing.
    required = {**_REQUIRED, "bearing": ()} if faults else _REQUIRED
    tables = read_tables(document, file, faults, _TABLES, required)
    geometry, heat, lubricant = None, HeatOptions("palmgren"), None
    if not faults:
        bearing, operation = tables["bearing"], tables["operation"]
        faults += [
            SpecError(f"{file}: operation.{key}", f"{operation[key]:g}.", "It must not be negative.")
            for key in ("speed", "radial_load")
            if operation[key] < 0.0
        ]
        faults += file_speed_faults(file, bearing["pitch_diameter"], operation["speed"])
        heat = heat_of({"model": "palmgren", **tables.get("heat", {})}, file, faults)
        known = friction_model_names(rollers=True)
        if heat.level not in known:
            what = f'"{heat.level}" knows no rollers.'
            faults.append(SpecError(f"{file}: heat.model", what, f"Allowed: {', '.join(known)}."))
        lubricant = lubricant_of(tables.get("lubricant"), file, faults)
        try:
            geometry = RollerGeometry(**{_FIELDS.get(key, key): value for key, value in bearing.items()})
        except GeometryError as error:
            faults.append(SpecError(f"{file}: bearing.{error.where}", error.what, error.how_to_fix))
    if len(faults) == 1:
        raise faults[0]
    if faults or geometry is None:
        raise FaultsError(file, faults)
    load = operation["radial_load"]
    warm = uniform_temperatures(1, operation.get("temperature", 313.15))
    try:
        ((state,),) = solve_roller_set(
            RollerSet(("bearing",), geometry), operation["speed"], ExternalLoad(0.0, load), [warm],
            lubricant=lubricant, heat=heat,
        )  # fmt: skip
    except OutOfValidityError as error:
        raise SpecError(f"{file}: operation.temperature", error.what, error.how_to_fix) from error
    return _report(geometry, state, solve_roller_bearing(geometry, load, operation["speed"]))


def _report(geometry: RollerGeometry, state: BearingState, solved: RollerStates) -> dict[str, Any]:
    rollers, balls = [], state.balls
    for index, azimuth in enumerate(balls.azimuth):
        record: dict[str, Any] = {
            "row": index // geometry.roller_count + 1,
            "azimuth_deg": float(np.degrees(azimuth)),
        }
        for name, field, factor in (
            ("load_{}_N", "load", 1.0),
            ("pressure_{}_GPa", "pressure", 1e-9),
            ("half_width_{}_mm", "semi_minor", 1e3),
            ("deformation_{}_um", "deformation", 1e6),
        ):
            for side, ring in ((INNER, "inner"), (OUTER, "outer")):
                record[name.format(ring)] = float(getattr(balls, field)[index, side]) * factor
        record["centrifugal_force_N"] = float(balls.centrifugal_force[index])
        for name, field, factor in (
            ("film_central_um", "film_central", 1e6),
            ("film_minimum_um", "film_minimum", 1e6),
            ("lambda", "film_thickness_ratio", 1.0),
        ):
            least = float(np.fmin(*getattr(balls, field)[index])) * factor
            record[name] = least if math.isfinite(least) else None
        rollers.append(record)
    found = [{"code": note.code, "text": note.text} for note in state.warnings]
    if state.heat is None:
        text = "without a lubricant there is no friction and no film; heat is unknown, not zero."
        found.append({"code": "roller_friction_missing", "text": text})
    return {
        "schema": REPORT_SCHEMA,
        "radial_deflection_um": state.radial_displacement * 1e6,
        "radial_stiffness_N_um": solved.radial_stiffness * 1e-6,
        **life_report(geometry, balls.load, None, state.speed),
        "heat_W": None if state.heat is None else state.heat_W,
        "terms_W": state.terms_W,
        "rollers": rollers,
        "warnings": found,
    }
