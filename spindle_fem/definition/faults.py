"""Pydantic's errors as ours: every fault with the key path as the file writes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

import spindle_fem.errors
from spindle_fem.definition.field_types import Fault
from spindle_fem.definition.schema import (
    Shape,
    annotation_of,
    fields_of,
    literal_values,
    names_of,
    shape_of,
    value_text,
)
from spindle_fem.errors import SpindleFemError, did_you_mean

Location = tuple[int | str, ...]


def validation_faults(
    error: ValidationError, source: str, model: type[BaseModel], content: Any = None
) -> list[SpindleFemError]:
    """Our errors for each of pydantic's.

    Parameters
    ----------
    source : str
        File for the message; ``""`` leaves it out.
    model : type
        Model of the whole file.
    content : mapping, optional
        The raw tables; with them, entries of lists are called by their name.
    """
    faults: dict[tuple[str, str], SpindleFemError] = {}
    for item in error.errors(include_url=False):
        path = key_path(_untagged(item, content), content)
        for fault in _faults_of(item, model, content):
            where = (
                path + fault.key if fault.key.startswith("[") else ".".join(filter(None, (path, fault.key)))
            )
            error_class = getattr(spindle_fem.errors, fault.error)
            made = error_class(f"{source}: {where}" if source else where, fault.what, fault.how_to_fix)
            faults.setdefault((made.where, made.what), made)
    return list(faults.values())


def _untagged(item: Any, content: Any) -> Location:
    """Location without the tag of a union, which ends it where a whole table is at fault."""
    location, node = item["loc"], content
    if item["type"] != "faults" or not location:
        return location
    for step in location[:-1]:
        known = isinstance(node, Mapping) and step in node
        listed = isinstance(node, (list, tuple)) and isinstance(step, int) and step < len(node)
        node = node[step] if known or listed else None
    tagged = isinstance(node, Mapping) and isinstance(location[-1], str) and location[-1] not in node
    return location[:-1] if tagged else location


def key_path(location: Location, content: Any = None) -> str:
    """Key path of one of pydantic's locations; named entries of lists by name.

    >>> key_path(("film", 0, "constant", "coefficient"), {"film": [{"name": "outside"}]})
    'film.outside.coefficient'
    """
    text, node = "", content
    for position, item in enumerate(location):
        if isinstance(item, int):
            entry = node[item] if isinstance(node, (list, tuple)) and item < len(node) else None
            name = entry.get("name") if isinstance(entry, Mapping) else None
            unique = isinstance(name, str) and names_of(node).count(name) == 1
            text += f".{name}" if unique else f"[{item + 1}]"
            node = entry
        else:
            if isinstance(node, Mapping) and item not in node and position < len(location) - 1:
                continue  # the tag that selects a member of a union
            text += f".{item}" if text else item
            node = node.get(item) if isinstance(node, Mapping) else None
    return text or "file"


def _faults_of(item: Any, model: type[BaseModel], content: Any) -> list[Fault]:
    kind, context, given = item["type"], item.get("ctx", {}), item["input"]
    if kind == "faults":
        return list(context["faults"])
    if kind == "extra_forbidden":
        table_shape, table = walk_to(model, item["loc"][:-1], content)
        allowed = fields_of(table_shape.models, table)
        return [Fault("", "unknown key.", did_you_mean(str(item["loc"][-1]), allowed), "UnknownKeyError")]
    if kind == "missing":
        return [Fault("", "is missing.", _expected(model, item["loc"], content))]
    if kind == "literal_error":
        shape, _ = walk_to(model, item["loc"], content)
        allowed = [str(value) for value in literal_values(shape.annotation)]
        return [Fault("", f"{_shown(given)} is not allowed.", did_you_mean(str(given), allowed))]
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        shape, table = walk_to(model, item["loc"], content)
        kinds = [
            str(value)
            for one in shape.models
            for value in literal_values(annotation_of(one.model_fields["kind"]))
        ]
        tag = table.get("kind") if isinstance(table, Mapping) else None
        what = "is missing." if tag is None else f"{_shown(tag)} is not allowed."
        return [Fault("kind", what, did_you_mean(str(tag), kinds))]
    if kind == "too_short" and hasattr(given, "__len__") and len(given) >= context.get("min_length", 0):
        return []  # only because entries were refused, which are reported themselves
    if kind == "value_error":
        return [Fault("", item["msg"].removeprefix("Value error, "))]
    return [Fault("", f"{_shown(given)} is not allowed.", _expected(model, item["loc"], content))]


def _shown(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def walk_to(model: type[BaseModel], location: Location, content: Any) -> tuple[Shape, Any]:
    """Shape and raw value at one of pydantic's locations."""
    shape, node = Shape("table", (model,)), content
    for item in location:
        if isinstance(item, int):
            if shape.kind == "list":
                shape = shape_of(shape.inner)
            node = node[item] if isinstance(node, (list, tuple)) and item < len(node) else None
        elif shape.kind == "table":
            fields = fields_of(shape.models, node)
            if item not in fields:
                continue  # the tag of a union
            shape = shape_of(annotation_of(fields[item]))
            node = node.get(item) if isinstance(node, Mapping) else None
        elif shape.kind == "mapping":
            shape = shape_of(shape.inner)
            node = node.get(item) if isinstance(node, Mapping) else None
    return shape, node


def _expected(model: type[BaseModel], location: Location, content: Any) -> str:
    shape, _ = walk_to(model, location, content)
    if shape.kind == "list":
        inner = shape_of(shape.inner)
        entries = "tables" if inner.kind == "table" else "values"
        return f"Allowed: a list of {entries}, at least one."
    if shape.kind == "mapping":
        return "Allowed: a table."
    if shape.kind == "table":
        needed = [key for key, field in fields_of(shape.models).items() if field.is_required()]
        return "Allowed: a table" + (f" with {', '.join(needed)}." if needed else ".")
    return f"Allowed: {value_text(shape.annotation)}."
