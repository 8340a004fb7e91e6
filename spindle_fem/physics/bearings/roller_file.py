"""A cylindrical roller bearing from a TOML file: read, check, solve, report as plain numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.errors import FaultsError, GeometryError, SpecError, SpindleFemError
from spindle_fem.physics.bearings.bearing_keys import GEOMETRY, OPERATION, Reader
from spindle_fem.physics.bearings.bearing_report import REPORT_SCHEMA
from spindle_fem.physics.bearings.bearing_tables import read_document, read_tables
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry, RollerStates, solve_roller_bearing

KIND = "cylindrical_roller"


def _rows(value: Any, where: str) -> int:
    if isinstance(value, bool) or value not in (1, 2):
        raise SpecError(where, f"{value!r} is no number of rows.", "Allowed: 1, 2.")
    return int(value)


def _kind(value: Any, _where: str) -> str:
    return str(value)


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
    "kind": _kind,
}
_TABLES = {"bearing": _BEARING, "operation": {key: OPERATION[key] for key in ("speed", "radial_load")}}
_REQUIRED = {"bearing": tuple(_BEARING)[:4], "operation": ("speed", "radial_load")}


def is_roller_document(document: Mapping[str, Any]) -> bool:
    """Whether a bearing file describes a cylindrical roller bearing."""
    table = document.get("bearing")
    return isinstance(table, dict) and table.get("kind") == KIND


def roller_report(path: str | Path) -> dict[str, Any]:
    """Solve the roller bearing of a TOML file and report it for JSON.

    Returns
    -------
    dict
        As of a ball bearing, with ``rollers`` for ``balls``; no heat and no film.

    Raises
    ------
    BadInputError
        Every fault of the file with file, key, value and what is allowed.
    """
    file = str(path)
    faults: list[SpindleFemError] = []
    tables = read_tables(read_document(path), file, faults, _TABLES, _REQUIRED)
    geometry = None
    if not faults:
        bearing, operation = tables["bearing"], tables["operation"]
        faults += [
            SpecError(f"{file}: operation.{key}", f"{operation[key]:g}.", "It must not be negative.")
            for key in ("speed", "radial_load")
            if operation[key] < 0.0
        ]
        try:
            geometry = RollerGeometry(**{key: value for key, value in bearing.items() if key != "kind"})
        except GeometryError as error:
            faults.append(SpecError(f"{file}: bearing.{error.where}", error.what, error.how_to_fix))
    if len(faults) == 1:
        raise faults[0]
    if faults or geometry is None:
        raise FaultsError(file, faults)
    states = solve_roller_bearing(geometry, tables["operation"]["radial_load"], tables["operation"]["speed"])
    return _report(geometry, states)


def _report(geometry: RollerGeometry, states: RollerStates) -> dict[str, Any]:
    rollers = []
    for index, azimuth in enumerate(states.azimuth):
        record: dict[str, Any] = {
            "row": index // geometry.roller_count + 1,
            "azimuth_deg": float(np.degrees(azimuth)),
        }
        for name, field, factor in (
            ("load_{}_N", "load", 1.0),
            ("pressure_{}_GPa", "pressure", 1e-9),
            ("half_width_{}_mm", "half_width", 1e3),
            ("deformation_{}_um", "approach", 1e6),
        ):
            for side, ring in ((INNER, "inner"), (OUTER, "outer")):
                record[name.format(ring)] = float(getattr(states, field)[index, side]) * factor
        record["centrifugal_force_N"] = states.centrifugal_force
        rollers.append(record)
    return {
        "schema": REPORT_SCHEMA,
        "radial_deflection_um": states.radial_displacement * 1e6,
        "radial_stiffness_N_um": states.radial_stiffness * 1e-6,
        "heat_W": None,
        "terms_W": {},
        "rollers": rollers,
        "warnings": [
            {
                "code": "roller_friction_missing",
                "text": "friction and film of rollers are not worked out; heat is unknown, not zero.",
            }
        ],
    }
