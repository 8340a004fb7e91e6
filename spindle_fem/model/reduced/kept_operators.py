"""Operators of a mesh model on disk: another machine of the family is checked without its mesh."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from spindle_fem.cache import DAMAGED, cache_directory, load_fields, save_fields
from spindle_fem.model.matrices_on_pattern import MatricesOnPattern
from spindle_fem.model.reduced.mesh_model import MeshModel
from spindle_fem.model.thermal_model import MATRIX_FIELDS

OPERATORS_FORMAT = "spindle-fem/mesh-operators/1"
_PARTS = ("data", "indices", "indptr", "shape")


def operators_path(digest: str) -> Path:
    """File of the operators that all machines of a reduced model's family share."""
    return cache_directory() / f"operators-{digest.partition('-')[0]}.npz"


def keep_operators(full: MeshModel, digest: str) -> None:
    """Keep a model in solving order for the family of a reduced model's digest."""
    content: dict[str, Any] = {}
    stacks = {name: getattr(full, name) for name in MATRIX_FIELDS}
    for item in fields(full):
        value = getattr(full, item.name)
        if sparse.issparse(value):
            value = value.tocsr()
            parts = (value.data, value.indices, value.indptr, np.array(value.shape))
            content |= {f"{item.name}.{part}": own for part, own in zip(_PARTS, parts, strict=True)}
        elif item.name in stacks:
            content[f"{item.name}.starts"] = value.starts
        else:
            content[item.name] = value
    one = stacks[MATRIX_FIELDS[0]]
    content |= {f"all.{part}": getattr(one, part) for part in ("indptr", "indices", "places", "values")}
    save_fields(content, operators_path(digest), OPERATORS_FORMAT)


def kept_operators(digest: str) -> MeshModel | None:
    """The model that was kept for the family of a digest; None where there is none, or it is damaged."""
    content = load_fields(operators_path(digest), OPERATORS_FORMAT)
    if content is None:
        return None
    try:
        shared = [content.pop(f"all.{part}") for part in ("indptr", "indices", "places", "values")]
        indptr, indices, places, values = shared
        for name in MATRIX_FIELDS:
            starts = content.pop(f"{name}.starts")
            content[name] = MatricesOnPattern(indptr, indices, starts, places, values)
        for name in [key.removesuffix(".data") for key in content if key.endswith(".data")]:
            data, columns, rows, shape = (content.pop(f"{name}.{part}") for part in _PARTS)
            content[name] = sparse.csr_array((data, columns, rows), shape=tuple(shape.tolist()))
        for name in ("gap_radii", "ranges"):
            content[name] = {key: tuple(pair) for key, pair in content[name].items()}
        return MeshModel(**content)
    except DAMAGED:
        return None
