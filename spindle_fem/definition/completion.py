"""Complete a definition by named rules: catalogue bearings, spacers, materials, surroundings.

Works on raw tables before they are validated, so that all readers of a machine
see a complete one. Malformed tables are left for validation to report.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from spindle_fem.definition import bearing_catalogue, standard_materials
from spindle_fem.definition.set_completion import add_set_rules
from spindle_fem.errors import SpecError, SpindleFemError, did_you_mean
from spindle_fem.units import to_si

_UNKNOWN_WIDTH = 0.01
_MATERIAL_KEYS = ("ring_material", "ball_material", "roller_material")


@dataclass(frozen=True, slots=True)
class Assumption:
    """A value that the file does not give.

    Attributes
    ----------
    where : str
        Key path of what was filled in.
    rule : str
        What was taken, and by which rule.
    """

    where: str
    rule: str


def complete(content: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Assumption, ...]]:
    """Raw tables of a machine with what rules give laid under what the file gives.

    Returns
    -------
    dict
        The completed tables; completing them again changes nothing.
    tuple of Assumption
        In the order of the tables.
    """
    result, assumed = dict(content), []
    _bearing_types(result, assumed)
    _bearing_places(result, assumed)
    assumed += [Assumption(where, rule) for where, rule in add_set_rules(result)]
    _grease(result, assumed)
    _oils(result, assumed)
    _materials(result, assumed)
    if result.get("surroundings") == "workshop":
        # Loads numpy, which reading other definitions does without.
        from spindle_fem.definition.default_surroundings import add_surroundings

        assumed += [Assumption(where, rule) for where, rule in add_surroundings(result)]
    return result, tuple(assumed)


def unknown_catalogues(content: Mapping[str, Any]) -> list[SpindleFemError]:
    """Bearings and greases that tables name and that do not ship."""
    found: list[SpindleFemError] = []
    types, grease = content.get("bearing_types"), content.get("grease")
    for key, table in types.items() if isinstance(types, Mapping) else ():
        name = table.get("catalogue") if isinstance(table, Mapping) else None
        if isinstance(name, str) and bearing_catalogue.catalogue_bearing(name) is None:
            what = f'"{name}" is no bearing that ships.'
            found.append(SpecError(f"bearing_types.{key}.catalogue", what, bearing_catalogue.SHIPPED))
    name = grease.get("catalogue") if isinstance(grease, Mapping) else None
    if isinstance(name, str) and name not in standard_materials.GREASES:
        allowed = did_you_mean(name, standard_materials.GREASES)
        found.append(SpecError("grease.catalogue", f'"{name}" is no grease that ships.', allowed))
    return found


def without_supplied(faults: list[SpindleFemError], content: Mapping[str, Any]) -> list[SpindleFemError]:
    """Faults without keys that are missing only because a name in their table is unknown."""
    unknown = [*unknown_catalogues(content), *(fault for fault in faults if fault.where.endswith(".oil"))]
    tables = {fault.where.rpartition(".")[0] for fault in unknown}
    return [
        fault
        for fault in faults
        if fault.what != "is missing." or fault.where.rpartition(".")[0] not in tables
    ]


def tables_of(value: Any) -> list[dict[str, Any]]:
    """The entries of a list that are tables."""
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, list) else []


def length_of(value: Any) -> float | None:
    """A raw length in m, that of its value where it has a tolerance; None where it cannot be read."""
    value = value.get("value") if isinstance(value, Mapping) else value
    with contextlib.suppress(SpindleFemError):
        return to_si(value, "m", where="")
    return None


def with_named_types(content: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with an entry in ``bearing_types`` for every bearing that ships and that a set names.

    So that single values of it can be changed by its name: ``bearing_types.NN3014_K.radial_clearance``.
    """
    given = content.get("bearing_types", {})
    sets = content.get("bearing_set")
    if not isinstance(given, Mapping) or not isinstance(sets, list):
        return dict(content)
    types, groups = dict(given), []
    for group in sets:
        group = _with_named_type(group, types)
        if isinstance(group, Mapping) and isinstance(group.get("bearing"), list):
            group = {**group, "bearing": [_with_named_type(row, types) for row in group["bearing"]]}
        groups.append(group)
    return {**content, "bearing_set": groups, **({"bearing_types": types} if types else {})}


def _with_named_type(table: Any, types: dict[str, Any]) -> Any:
    """A set, or a bearing of it, with the name of its type, which joins the types where it ships."""
    if not isinstance(table, Mapping) or not isinstance(table.get("bearing_type"), str):
        return table
    designation = table["bearing_type"]
    name = designation.replace(" ", "_").replace("/", "_")
    own = types.get(name, {})
    if bearing_catalogue.catalogue_bearing(designation) and _is_partial(own):
        types[name] = _under({"catalogue": designation, "marks": {"default": "C"}}, own)
    return {**table, "bearing_type": name} if name in types else table


def _bearing_types(content: dict[str, Any], assumed: list[Assumption]) -> None:
    content.update(with_named_types(content))
    types = content.get("bearing_types")
    if not isinstance(types, Mapping):
        return
    content["bearing_types"] = types = dict(types)
    for name, table in types.items():
        designation = table.get("catalogue") if isinstance(table, Mapping) else None
        found = bearing_catalogue.catalogue_bearing(designation) if isinstance(designation, str) else None
        if found is None:
            types[name] = _with_angle(table)
            continue
        taken = [key for key in found if key not in table and key != "marks"]
        types[name] = _under(found, table)
        if taken:
            text = f"{designation}: {bearing_catalogue.estimated(types[name])}"
            if "radial_clearance" in taken:
                text += f"; {found['radial_clearance'].replace('um', 'µm')} of clearance as mounted"
            assumed.append(Assumption(f"bearing_types.{name}", text))
        types[name] = _with_angle(types[name])


def _with_angle(table: Any) -> Any:
    """A type of deep-groove bearing with the contact angle that its clearance gives."""
    if not isinstance(table, Mapping) or "radial_clearance" not in table or "contact_angle" in table:
        return table
    clearance, ball = (length_of(table.get(key)) for key in ("radial_clearance", "ball_diameter"))
    apart = [table.get(f"groove_curvature_{ring}") for ring in ("inner", "outer")]
    if not clearance or not ball or not all(isinstance(value, float) for value in apart) or sum(apart) <= 1.0:
        return table
    # cos α = 1 - P_d / (2 A), as physics.bearings.bearing_geometry has it, which loads numpy
    cosine = max(1.0 - clearance / (2.0 * (sum(apart) - 1.0) * ball), -1.0)
    return {**table, "contact_angle": f"{math.degrees(math.acos(cosine)):.10g} deg"}


def _is_partial(table: Any) -> bool:
    """Whether a table of a bearing type only overrides keys of another."""
    return isinstance(table, Mapping) and not {"catalogue", "bore_diameter"} & set(table)


def _under(found: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """A table laid over what a catalogue gives, each value with its own mark."""
    own = table.get("marks", {})
    own = {"default": own} if isinstance(own, str) else own
    if not isinstance(own, Mapping):
        return {**found, **table}
    taken = {key: found["marks"].get(key, found["marks"]["default"]) for key in found if key not in table}
    taken.pop("marks", None)
    return {**found, **table, "marks": {**taken, **own}}


def _bearing_places(content: dict[str, Any], assumed: list[Assumption]) -> None:
    """Give bearings placed by their start only the width of their type."""
    groups = []
    for group in content.get("bearing_set") if isinstance(content.get("bearing_set"), list) else ():
        if isinstance(group, Mapping) and isinstance(group.get("bearing"), list):
            types = content.get("bearing_types")
            rows = []
            for row in group["bearing"]:
                own = row.get("bearing_type") if isinstance(row, Mapping) else None
                name = str(own or group.get("bearing_type"))
                kind = types.get(name) if isinstance(types, Mapping) else None
                width = length_of(kind.get("width")) if isinstance(kind, Mapping) else None
                # An unknown type is the one fault: its bearings have some width.
                width = _UNKNOWN_WIDTH if width is None else width
                start = length_of(row.get("z")) if isinstance(row, Mapping) else None
                if start is not None:
                    row = {**row, "z": [f"{1e3 * start:.12g} mm", f"{1e3 * (start + width):.12g} mm"]}
                    assumed.append(
                        Assumption(
                            f"bearing_set.{group.get('name')}.bearing.{row.get('name')}.z",
                            f"{row['z'][0]} to {row['z'][1]}: from where it begins, the width of its type",
                        )
                    )
                rows.append(row)
            group = {**group, "bearing": rows}
        groups.append(group)
    if groups:
        content["bearing_set"] = groups


def _grease(content: dict[str, Any], assumed: list[Assumption]) -> None:
    table = content.get("grease")
    name = table.get("catalogue") if isinstance(table, Mapping) else None
    found = standard_materials.GREASES.get(name) if isinstance(name, str) else None
    if found is not None and set(found) - set(table):
        content["grease"] = _under(found, table)
        values = f"{found['kinematic_viscosity_40']} at 40 °C, {found['kinematic_viscosity_100']} at 100 °C"
        assumed.append(Assumption("grease", f"{name}: {found['name']}, {values}"))


def _oils(content: dict[str, Any], assumed: list[Assumption]) -> None:
    groups = content.get("bearing_set")
    if not isinstance(groups, list):
        return
    content["bearing_set"] = [_with_oil(group, assumed) for group in groups]


def _with_oil(group: Any, assumed: list[Assumption]) -> Any:
    table = group.get("lubrication") if isinstance(group, Mapping) else None
    name = table.get("oil") if isinstance(table, Mapping) else None
    found = standard_materials.OILS.get(name) if isinstance(name, str) else None
    if found is None or not set(found) - set(table):
        return group
    values = f"{found['kinematic_viscosity_40']} at 40 °C, {found['kinematic_viscosity_100']} at 100 °C"
    assumed.append(Assumption(f"bearing_set.{group.get('name')}.lubrication", f"{name}: {values}"))
    return {**group, "lubrication": _under(found, table)}


def _materials(content: dict[str, Any], assumed: list[Assumption]) -> None:
    given = content.get("materials", {})
    types = content.get("bearing_types", {})
    if not isinstance(given, Mapping) or not isinstance(types, Mapping):
        return
    kinds = [kind for kind in types.values() if isinstance(kind, Mapping)]
    named = [part.get("material") for part in tables_of(content.get("part"))]
    named += [kind.get(key) for kind in kinds for key in _MATERIAL_KEYS]
    materials = dict(given)
    for name in named:
        if isinstance(name, str) and name not in materials and name in standard_materials.MATERIALS:
            values = standard_materials.MATERIALS[name]
            materials[name] = values
            shown = ", ".join(
                values[key] for key in ("thermal_conductivity", "density", "specific_heat_capacity")
            )
            assumed.append(Assumption(f"materials.{name}", f"usual values: {shown}"))
    content["materials"] = materials
