"""A bearing file as tables of values in SI, whatever kind of bearing it describes."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.definition.bearing_catalogue import SHIPPED, catalogue_bearing
from spindle_fem.definition.standard_materials import MATERIALS
from spindle_fem.errors import BadInputError, SpecError, SpindleFemError, UnknownKeyError, did_you_mean
from spindle_fem.physics.bearings.bearing_keys import HEAT_FIELDS, Reader
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions

SCHEMA = "spindle-fem/bearing/1"


def read_document(path: str | Path) -> dict[str, Any]:
    """The TOML document of a file.

    Raises
    ------
    SpecError
        The file cannot be read or is not TOML.
    """
    file = Path(path)
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(str(file), f"cannot be read ({error}).", "Give a TOML file.") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise SpecError(str(file), f"is not TOML ({error}).", "Correct the syntax.") from error


def read_tables(
    document: Mapping[str, Any],
    file: str,
    faults: list[SpindleFemError],
    allowed: Mapping[str, Mapping[str, Reader]],
    required: Mapping[str, Sequence[str]],
) -> dict[str, dict[str, Any]]:
    """Tables of a bearing file in SI; unknown, wrong or missing keys are added to ``faults``.

    Parameters
    ----------
    allowed : mapping of table to mapping of key to reader
    required : mapping of table to keys
    """
    schema = document.get("schema", SCHEMA)
    if schema != SCHEMA:
        faults.append(SpecError(f"{file}: schema", f"{schema!r} is unknown.", f'Allowed: "{SCHEMA}".'))
    tables: dict[str, dict[str, Any]] = {}
    for name in document:
        if name != "schema" and name not in allowed:
            faults.append(UnknownKeyError(f"{file}: {name}", "unknown table.", did_you_mean(name, allowed)))
    for name, readers in allowed.items():
        table = document.get(name)
        if table is None:
            if name in ("bearing", "operation"):
                faults.append(SpecError(f"{file}: {name}", "the table is missing.", f"Write [{name}]."))
            continue
        if not isinstance(table, dict):
            faults.append(SpecError(f"{file}: {name}", f"{table!r} is no table.", f"Write [{name}]."))
            continue
        values: dict[str, Any] = {}
        for key, value in table.items():
            where = f"{file}: {name}.{key}"
            if key not in readers:
                faults.append(UnknownKeyError(where, "unknown key.", did_you_mean(key, readers)))
                continue
            try:
                values[key] = readers[key](value, where)
            except BadInputError as error:
                faults.append(error)
        for key in required[name]:
            if key not in table:
                faults.append(SpecError(f"{file}: {name}.{key}", "the key is missing.", "It is required."))
        tables[name] = values
    return tables


def lubricant_of(values: dict[str, Any] | None, file: str, faults: list[SpindleFemError]) -> Lubricant | None:
    """Lubricant of a ``[lubricant]`` table; None without one, or with faults."""
    if values is None:
        return None
    fields = {
        ("density" if key == "base_oil_density" else key): v for key, v in values.items() if key != "name"
    }
    try:
        return Lubricant(**fields)
    except SpecError as error:
        faults.append(SpecError(f"{file}: lubricant.{error.where}", error.what, error.how_to_fix))
        return None


def heat_of(values: dict[str, Any], file: str, faults: list[SpindleFemError]) -> HeatOptions:
    """Options of a ``[heat]`` table; the defaults without one, or with faults."""
    try:
        return HeatOptions(**{HEAT_FIELDS.get(key, key): value for key, value in values.items()})
    except SpecError as error:
        faults.append(SpecError(f"{file}: {error.where}", error.what, error.how_to_fix))
        return HeatOptions()


def with_catalogue(
    document: dict[str, Any],
    file: str,
    faults: list[SpindleFemError],
    keys: Collection[str],
    element: str = "ball",
) -> dict[str, Any]:
    """A file whose ``bearing.catalogue`` names a bearing that ships, with what that gives under ``keys``."""
    table = document.get("bearing")
    if not isinstance(table, dict) or "catalogue" not in table:
        return document
    designation = table["catalogue"]
    found = catalogue_bearing(designation) if isinstance(designation, str) else None
    own = {key: value for key, value in table.items() if key != "catalogue"}
    if found is None or f"{element}_count" not in found:
        what = "does not ship" if found is None else f"has no {element}s"
        faults.append(SpecError(f"{file}: bearing.catalogue", f"{designation!r} {what}.", SHIPPED))
        return {**document, "bearing": own}
    if found[f"{element}_material"] == "silicon_nitride":
        hybrid = MATERIALS["silicon_nitride"]
        found |= {f"{element}_{key}": hybrid[key] for key in ("young_modulus", "poisson_ratio")}
        found["density"] = hybrid["density"]
    return {**document, "bearing": {key: found[key] for key in found if key in keys} | own}
