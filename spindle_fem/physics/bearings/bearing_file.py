"""One bearing or preloaded set from a TOML file: read, check, solve, report as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from spindle_fem.errors import (
    FaultsError,
    OutOfValidityError,
    SpecError,
    SpindleFemError,
)
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry, angle_of_clearance, bearing_faults
from spindle_fem.physics.bearings.bearing_keys import (
    FIT,
    GEOMETRY,
    HOUSING_FIELDS,
    REQUIRED,
    TABLES,
)
from spindle_fem.physics.bearings.bearing_report import report_of_states
from spindle_fem.physics.bearings.bearing_set import solve_bearing_set
from spindle_fem.physics.bearings.bearing_tables import (
    heat_of,
    lubricant_of,
    read_document,
    read_tables,
    with_catalogue,
)
from spindle_fem.physics.bearings.cage_guidance import CageGuidance
from spindle_fem.physics.bearings.fits import RingFits, fit_faults
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.highest_speed import file_speed_faults
from spindle_fem.physics.bearings.mounting import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.rings import STEEL
from spindle_fem.physics.bearings.roller_file import is_roller_document, roller_report
from spindle_fem.validity import CodedWarning

_SPACING_OVER_BALL = 1.7


@dataclass(frozen=True, slots=True)
class BearingCase:
    """Content of a bearing file, in SI.

    Attributes
    ----------
    speed : float, [rad/s]
    load : ExternalLoad
        Thrust turned so that a positive axial load of the file loads the
        first bearing of the row.
    temperatures : SetTemperatures
        All at the operation's temperature, which is also that of assembly,
        unless ``[temperatures]`` says otherwise.
    """

    bearing_set: BearingSet
    speed: float
    load: ExternalLoad
    temperatures: SetTemperatures
    raceway_control: str
    lubricant: Lubricant | None
    heat: HeatOptions
    warnings: tuple[CodedWarning, ...]


def bearing_report(path: str | Path) -> dict[str, Any]:
    """Solve the bearing or set of a TOML file and report it for JSON.

    Returns
    -------
    dict
        Keys and units as ``spindle-fem bearing FILE --json`` prints them;
        None where there is no film (no lubricant, at rest, no contact).

    Raises
    ------
    BadInputError
        Every fault of the file with file, key, value and what is allowed.
    NoEquilibriumError
        The state does not exist.
    """
    if is_roller_document(read_document(path)):
        return roller_report(path)
    case = read_bearing_file(path)
    try:
        states = solve_bearing_set(
            case.bearing_set,
            case.speed,
            case.load,
            case.temperatures,
            lubricant=case.lubricant,
            control=case.raceway_control,
            heat=case.heat,
        )
    except OutOfValidityError as error:
        raise SpecError(f"{path}: operation.temperature", error.what, error.how_to_fix) from error
    return report_of_states(states, case.warnings)


def read_bearing_file(path: str | Path) -> BearingCase:
    """Read and check a bearing file; all faults at once.

    Raises
    ------
    BadInputError
    """
    file, document = Path(path), read_document(path)
    faults: list[SpindleFemError] = []
    document = with_catalogue(document, str(file), faults, GEOMETRY)
    # Keys that an unknown bearing would have supplied are not reported as missing.
    required = {**REQUIRED, "bearing": ()} if faults else REQUIRED
    if not faults and _gives_clearance(document):
        required = {
            **REQUIRED,
            "bearing": tuple(key for key in required["bearing"] if key != "contact_angle"),
        }
    tables = read_tables(document, str(file), faults, TABLES, required)
    case = None
    if not faults:
        case = _build_case(tables, str(file), faults)
    if len(faults) == 1:
        raise faults[0]
    if faults or case is None:
        raise FaultsError(str(file), faults)
    return case


def _gives_clearance(document: Mapping[str, Any]) -> bool:
    """Whether a deep-groove bearing's contact angle follows from its clearance."""
    table = document.get("bearing")
    return isinstance(table, dict) and "radial_clearance" in table


def _build_case(
    tables: dict[str, dict[str, Any]], file: str, faults: list[SpindleFemError]
) -> BearingCase | None:
    bearing, operation = tables["bearing"], tables["operation"]
    orientations = bearing.get("arrangement", (1,))
    geometry_values = {key: value for key, value in bearing.items() if key in GEOMETRY}
    clearance = geometry_values.pop("radial_clearance", None)
    if clearance is not None:
        sizes = [
            bearing[key] for key in ("ball_diameter", "groove_curvature_inner", "groove_curvature_outer")
        ]
        geometry_values.setdefault("contact_angle", angle_of_clearance(clearance, *sizes))
    probe = _Unchecked(**geometry_values)
    for key, what, how_to_fix in bearing_faults(probe):
        faults.append(SpecError(f"{file}: bearing.{key}", what, how_to_fix))
    faults += file_speed_faults(file, bearing["pitch_diameter"], operation["speed"])
    _check_operation(operation, orientations, file, faults)
    preload = bearing.get("preload", 0.0)
    if preload < 0.0:
        faults.append(
            SpecError(f"{file}: bearing.preload", f"preload is {preload:g} N.", "It must not be negative.")
        )
    lubricant = lubricant_of(tables.get("lubricant"), file, faults)
    control = operation.get("raceway_control", "outer")
    if control == "equilibrium" and lubricant is None and "lubricant" not in tables:
        faults.append(
            SpecError(
                f"{file}: operation.raceway_control",
                '"equilibrium" lets friction decide, but there is no [lubricant].',
                'Write [lubricant], or "outer" or "inner".',
            )
        )
    heat = heat_of(tables.get("heat", {}), file, faults)
    if faults:
        return None
    try:
        cage = CageGuidance(**tables["cage"]) if "cage" in tables else None
    except SpecError as error:
        faults.append(SpecError(f"{file}: {error.where}", error.what, error.how_to_fix))
        return None
    geometry = BearingGeometry(**geometry_values, cage=cage)
    warnings: list[CodedWarning] = []
    radial, moment = operation.get("radial_load", 0.0), operation.get("moment", 0.0)
    spacing = bearing.get("spacing", bearing.get("width"))
    if spacing is None:
        spacing = _SPACING_OVER_BALL * geometry.ball_diameter
        if len(orientations) > 1 and (radial or moment):
            warnings.append(
                CodedWarning(
                    "spacing_assumed",
                    f"bearings stand {spacing * 1e3:.2f} mm apart (1.7 ball diameters); give bearing.spacing "
                    "or bearing.width.",
                )
            )
    fits = _fits(tables.get("fit"), geometry, file, faults)
    if faults:
        return None
    mounted = tuple(
        MountedBearing(
            f"B{index + 1}" if len(orientations) > 1 else "bearing", geometry, side, index * spacing, fits
        )
        for index, side in enumerate(orientations)
    )
    roughness = {
        target: bearing[key]
        for key, target in (("roughness_raceway", "raceway_roughness"), ("roughness_ball", "ball_roughness"))
        if key in bearing
    }
    try:
        bearing_set = BearingSet(mounted, preload, bearing.get("preload_kind", "rigid"), **roughness)
    except SpecError as error:
        faults.append(SpecError(f"{file}: bearing.{error.where}", error.what, error.how_to_fix))
        return None
    return BearingCase(
        bearing_set,
        operation["speed"],
        ExternalLoad(operation["axial_load"] * orientations[0], radial, moment),
        _temperatures(tables, len(mounted)),
        control,
        lubricant,
        heat,
        tuple(warnings),
    )


def _fits(
    values: dict[str, Any] | None, geometry: BearingGeometry, file: str, faults: list[SpindleFemError]
) -> RingFits | None:
    """Seats of the rings; the housing is of steel unless given otherwise."""
    if values is None:
        return None
    housing = {name: values[key] for key, name in HOUSING_FIELDS.items() if key in values}
    own = {key: value for key, value in values.items() if key not in HOUSING_FIELDS}
    fits = RingFits(**own, housing=replace(STEEL, **housing))
    for key, what, how_to_fix in fit_faults(geometry, fits):
        table = "fit" if key in FIT else "bearing"
        faults.append(SpecError(f"{file}: {table}.{key}", what, how_to_fix))
    return fits


def _temperatures(tables: Mapping[str, dict[str, Any]], number: int) -> SetTemperatures:
    common = tables["operation"].get("temperature", 313.15)
    given = tables.get("temperatures")
    if given is None:
        return uniform_temperatures(number, common)
    rings = BearingTemperatures(*(given.get(key, common) for key in ("inner_ring", "outer_ring", "ball")))
    return SetTemperatures(
        (rings,) * number, given.get("shaft", common), given.get("housing", common), given["assembly"]
    )


class _Unchecked:
    """Geometry values before the checks of ``BearingGeometry``."""

    def __init__(self, **values: Any) -> None:
        for name, spec in BearingGeometry.__dataclass_fields__.items():
            setattr(self, name, values.get(name, spec.default))


def _check_operation(
    operation: dict[str, Any], orientations: tuple[int, ...], file: str, faults: list[SpindleFemError]
) -> None:
    if operation["speed"] < 0.0:
        rpm = operation["speed"] * 30.0 / math.pi
        faults.append(
            SpecError(f"{file}: operation.speed", f"speed is {rpm:g} rpm.", "It must not be negative.")
        )
    axial = operation["axial_load"]
    if axial < 0.0 and len(set(orientations)) == 1:
        faults.append(
            SpecError(
                f"{file}: operation.axial_load",
                f"{axial:g} N unloads bearings that all face the other way.",
                "It must not be negative without a counter bearing.",
            )
        )
    if operation.get("radial_load", 0.0) < 0.0:
        faults.append(
            SpecError(
                f"{file}: operation.radial_load",
                f"{operation['radial_load']:g} N.",
                "It must not be negative: azimuth 0 lies under the radial load.",
            )
        )
