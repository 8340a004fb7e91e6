"""Group designs of a study that can share a reduced model; refuse those that cannot have one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm

# Values of a definition that only move coefficients, heat or fluids; all else must be equal in a group.
_FREE = {
    "operation": ("speed", "thrust", "ambient_temperature"),
    "coolant": ("inlet_temperature", "flow", "film_factor", "pressure_limit", "pump_curve"),
    "heat": ("inner_share", "ball_share", "table", "palmgren_f0", "skf_mu_ehl"),
}
_FREE_OF_LISTS = {
    "bearing_set": ("preload", "heat_factor", "ball_row"),
    "film": ("coefficient", "temperature", "diameter", "minimum", "factor"),
    "gap": ("at_rest", "rise", "reference_speed", "exponent", "factor"),
    "joint": ("conductance",),
}
# The diameter of a circuit is that of its walls.
_FREE_OF_CIRCUITS = ("fluid", "inlet_temperature", "flow", "law", "factor", "pressure_limit", "pump_curve")
_FREE_OF_MATERIALS = ("thermal_conductivity", "density", "specific_heat_capacity")
_FREE_TABLES = ("grease", "heat_capacity_factor", "factor", "initial", "name", "title", "description")


def structure_digest(dump: Mapping[str, Any]) -> str:
    """Hash of a dumped definition without what only moves coefficients, heat or fluids."""
    kept = {name: value for name, value in dump.items() if name not in _FREE_TABLES}
    for table, keys in _FREE.items():
        if table in kept:
            kept[table] = _without(kept[table], keys)
    for table, keys in _FREE_OF_LISTS.items():
        if table in kept:
            kept[table] = [
                _without(item, _FREE_OF_CIRCUITS if item.get("kind") in ("circuit", "wetted") else keys)
                for item in kept[table]
            ]
    materials = kept.get("materials", {})
    kept["materials"] = {name: _without(item, _FREE_OF_MATERIALS) for name, item in materials.items()}
    text = json.dumps(without_marks(kept), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _without(table: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name not in keys}


def without_marks(value: Any) -> Any:
    """Content of a definition without its ``marks``, at every depth."""
    if isinstance(value, Mapping):
        return {key: without_marks(item) for key, item in value.items() if key != "marks"}
    return [without_marks(item) for item in value] if isinstance(value, list) else value


def refusal(spec: MachineSpec) -> str:
    """Reason why a projected model cannot represent a machine; empty if it can."""
    if any(isinstance(film, NaturalFilm) for film in spec.film):
        return "a film follows the temperature of each place of its surface"
    if spec.follows_preload:
        return "the preload follows the temperatures"
    if any(group.conductance == "perfect" for group in spec.joint):
        return "a joint has no resistance"
    if not spec.mesh.circumferential_averaging:
        return "rotating parts are not averaged around the axis"
    if spec.effects:
        return "the machine has effects"
    if spec.source:
        return "the machine has heat sources"
    return ""
