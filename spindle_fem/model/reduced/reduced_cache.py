"""Keys of reduced models in the cache: hashes of their input, and families that share a geometry."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.model.thermal_model import FORMAT

# Properties of a material that are live coefficients.
MATERIAL_COEFFICIENTS = ("thermal_conductivity", "density", "specific_heat_capacity")
BASIS_FORMAT = "spindle-fem/reduced-basis/1"


@dataclass(frozen=True, slots=True)
class KeptBasis:
    """Fields on a mesh that a reduced model is a projection on: another machine of the family begins there.

    Attributes
    ----------
    mesh : str
        Digest of the mesh.
    fields : (n, r) float32 ndarray
        Unknowns in the order of :func:`solving_order.in_solving_order`.
    """

    mesh: str
    fields: NDArray[np.float32]

    def save(self, digest: str) -> None:
        """Keep it beside the reduced model of a digest."""
        save_record(self, basis_path(reduced_path(digest)), BASIS_FORMAT)

    @classmethod
    def beside(cls, path: Path) -> KeptBasis | None:
        """Basis stored beside a reduced model; None if there is none."""
        found = load_record(basis_path(path), BASIS_FORMAT, cls)
        return None if found is None else cls(**found)


def basis_path(path: Path) -> Path:
    """File of the basis beside a reduced model's."""
    return path.with_name(path.name.replace("reduced-", "basis-", 1))


def reduced_digest(spec: MachineSpec, options: Mapping[str, float]) -> str:
    """Hash of everything that a reduced model depends on: its family's, and that of its range."""
    content = _content(spec)
    own = _hash([content, dict(options)])
    return f"{_hash(_without_coefficients(content))[:24]}-{own}"


def reduced_path(digest: str) -> Path:
    """File of a reduced model in the cache."""
    return cache_directory() / f"reduced-{digest}.npz"


def family_of(digest: str) -> list[Path]:
    """Models in the cache of machines that differ in values of coefficients only, the newest first."""
    family = digest.partition("-")[0]
    found = cache_directory().glob(f"reduced-{family}-*.npz")
    return sorted(found, key=lambda path: -path.stat().st_mtime)


def _content(spec: MachineSpec) -> dict[str, Any]:
    content = spec.model_dump(mode="json")
    # The operating point and the words change nothing in the operators.
    for key in ("operation", "name", "title", "description", "initial", "effects"):
        content.pop(key, None)
    # Heat sources count only by their place: the basis holds the fields of these places.
    content["source"] = sorted({source.place for source in spec.source})
    return _without_tolerances(_without_marks(content))


def _without_marks(content: Any) -> Any:
    """Content without the origin of values: ``--set`` marks what it sets, which does not change results."""
    if isinstance(content, dict):
        return {key: _without_marks(item) for key, item in content.items() if key != "marks"}
    if isinstance(content, (list, tuple)):
        return [_without_marks(item) for item in content]
    return content


def _without_tolerances(content: Any) -> Any:
    """Content with lengths that have a tolerance replaced by plain ones."""
    if isinstance(content, dict):
        if content.keys() == {"value", "sigma"}:
            return content["value"]
        return {key: _without_tolerances(item) for key, item in content.items()}
    if isinstance(content, (list, tuple)):
        return [_without_tolerances(item) for item in content]
    return content


def _without_coefficients(content: Mapping[str, Any]) -> dict[str, Any]:
    """A definition without what the reduced model has as live coefficients, and without heat."""
    rest = {key: value for key, value in content.items() if key not in ("factor", "heat", "grease")}
    rest["heat_capacity_factor"] = rest["coolant"] = None
    rest["materials"] = {
        name: {key: item for key, item in own.items() if key not in MATERIAL_COEFFICIENTS}
        for name, own in content["materials"].items()
    }
    rest["joint"] = [
        item | {"conductance": "perfect" if item.get("conductance") == "perfect" else None}
        for item in content["joint"]
    ]
    rest["film"] = [item | {"coefficient": None, "factor": None} for item in content["film"]]
    rest["gap"] = [item | {"factor": None} for item in content["gap"]]
    rest["bearing_set"] = [
        item | {"heat_factor": None, "ball_row": item["ball_row"] | {"conductance": None}}
        for item in content["bearing_set"]
    ]
    return rest


def _hash(content: Any) -> str:
    text = json.dumps(
        [FORMAT, source_digest("spindle_fem.model.reduced.build_reduced"), content],
        sort_keys=True,
        default=str,
    )
    return hashlib.sha256(text.encode()).hexdigest()
