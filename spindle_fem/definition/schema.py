"""Allowed tables and keys of a definition, read from the models: for messages, overrides, the reference."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from spindle_fem.definition.field_types import (
    AllowedText,
    ChoiceRule,
    FreeQuantityRule,
    Name,
    QuantityRule,
    RangeRule,
)
from spindle_fem.registry import Registry
from spindle_fem.units import quantity_example


@dataclass(frozen=True, slots=True)
class Shape:
    """Allowed content of a key.

    Attributes
    ----------
    kind : {"table", "list", "mapping", "value"}
    models : tuple of type
        Models of a table: one, or several distinguished by their ``kind`` key.
    inner : Any
        Annotation of the entries of a list or mapping.
    annotation : Any
        Of a value, with its metadata.
    """

    kind: Literal["table", "list", "mapping", "value"]
    models: tuple[type[BaseModel], ...] = ()
    inner: Any = None
    annotation: Any = None


def _peeled(annotation: Any) -> tuple[list[Any], list[Any]]:
    """Alternatives of an annotation without None, and the metadata met on the way."""
    if get_origin(annotation) is Annotated:
        inner, *metadata = get_args(annotation)
        alternatives, deeper = _peeled(inner)
        return alternatives, [*metadata, *deeper]
    if get_origin(annotation) in (Union, types.UnionType):
        alternatives, metadata = [], []
        for argument in get_args(annotation):
            if argument is not type(None):
                found, deeper = _peeled(argument)
                alternatives += found
                metadata += deeper
        return alternatives, metadata
    return [annotation], []


def shape_of(annotation: Any) -> Shape:
    """Shape of a field's annotation."""
    alternatives, _ = _peeled(annotation)
    models = tuple(item for item in alternatives if isinstance(item, type) and issubclass(item, BaseModel))
    if models:
        return Shape("table", models)
    if quantity_rule(annotation) is None and len(alternatives) == 1:
        arguments = get_args(alternatives[0])
        if get_origin(alternatives[0]) is tuple and len(arguments) == 2 and arguments[1] is Ellipsis:
            return Shape("list", inner=arguments[0])
        if get_origin(alternatives[0]) is dict:
            return Shape("mapping", inner=arguments[1])
    return Shape("value", annotation=annotation)


def value_text(annotation: Any) -> str:
    """Allowed plain values, in words."""
    alternatives, metadata = _peeled(annotation)
    words = next((item.text for item in metadata if isinstance(item, AllowedText)), None)
    if words is not None:
        return words
    rule = quantity_rule(annotation)
    if rule is not None:
        text = f"a quantity such as {quantity_example(rule.unit, rule.kind)}" if rule.unit else "a number"
        text = f"{text}, {rule.allowed()}" if rule.allowed() else text
        if rule.laws is not None:
            text += f", or {{law = NAME, ...}} of {', '.join(rule.laws)}"
        return " or ".join([*(f'"{word}"' for word in rule.words), text])
    values = literal_values(annotation)
    if values:
        return ", ".join(str(value) for value in values)
    ranges = [item for item in metadata if isinstance(item, RangeRule)]
    if ranges:
        text = f"from and to, such as {ranges[0].example}"
        return f"a length, or {text}" if ranges[0].single else text
    if any(isinstance(item, FreeQuantityRule) for item in metadata):
        return "a number, or a quantity with its unit"
    if bool in alternatives:
        return "true, false"
    if int in alternatives:
        least, most = (
            next((getattr(item, name) for item in metadata if hasattr(item, name)), None)
            for name in ("ge", "le")
        )
        return "a whole number" + (f" from {least} to {most}" if None not in (least, most) else "")
    if float in alternatives:
        return "a number"
    return "a name" if get_args(Name)[1] in metadata else "a text"


def quantity_rule(annotation: Any) -> QuantityRule | None:
    """The rule of a quantity field, None for other fields."""
    _, metadata = _peeled(annotation)
    return next((item for item in metadata if isinstance(item, QuantityRule)), None)


def is_range(annotation: Any) -> bool:
    """Whether a field takes from and to, or a place."""
    _, metadata = _peeled(annotation)
    return any(isinstance(item, RangeRule) for item in metadata)


def literal_values(annotation: Any) -> tuple[Any, ...]:
    """The allowed values of a field that takes one of a few."""
    alternatives, metadata = _peeled(annotation)
    listed = [value for item in alternatives if get_origin(item) is Literal for value in get_args(item)]
    return (*listed, *(name for item in metadata if isinstance(item, ChoiceRule) for name in item.names))


def registry_of(annotation: Any) -> Registry | None:
    """The registry whose things a field names, or whose laws give its value; None for other fields."""
    _, metadata = _peeled(annotation)
    chosen = next((item.things for item in metadata if isinstance(item, ChoiceRule)), None)
    rule = quantity_rule(annotation)
    return rule.laws if chosen is None and rule is not None else chosen


def is_text(annotation: Any) -> bool:
    """Whether a field takes any text."""
    alternatives, metadata = _peeled(annotation)
    chosen = any(isinstance(item, ChoiceRule) for item in metadata)
    return str in alternatives and quantity_rule(annotation) is None and not chosen


def annotation_of(field: FieldInfo) -> Any:
    """The whole annotation of a field, with the metadata that pydantic split off."""
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def fields_of(models: tuple[type[BaseModel], ...], table: Any = None) -> dict[str, FieldInfo]:
    """Fields by the key that the file uses.

    Parameters
    ----------
    models : tuple of type
    table : mapping, optional
        The table as given; its ``kind`` picks one of several models.
    """
    chosen = models
    if len(models) > 1 and isinstance(table, Mapping):
        matching = tuple(
            model
            for model in models
            if table.get("kind") in literal_values(annotation_of(model.model_fields["kind"]))
        )
        chosen = matching or models
    return {field.alias or name: field for model in chosen for name, field in model.model_fields.items()}


def split_key(path: str) -> tuple[str, str]:
    """First plain key of a path and the rest, without the dot between them.

    >>> split_key("channel.depth")
    ('channel', 'depth')
    >>> split_key("segment[2].z")
    ('segment', '[2].z')
    """
    for position, character in enumerate(path):
        if character == ".":
            return path[:position], path[position + 1 :]
        if character == "[" and position:
            return path[:position], path[position:]
    return path, ""


def split_name(path: str, names: list[str]) -> tuple[str, str] | None:
    """Longest of ``names`` (which may hold dots) that starts a path, and the rest.

    >>> split_name("shaft.gap.part", ["shaft", "shaft.gap"])
    ('shaft.gap', 'part')
    """
    for name in sorted(names, key=len, reverse=True):
        if path == name:
            return name, ""
        if path.startswith(name + "."):
            return name, path[len(name) + 1 :]
        if path.startswith(name + "["):
            return name, path[len(name) :]
    return None


def split_index(path: str) -> tuple[int, str] | None:
    """Position (from 0) of a path that starts with ``[number]``, and the rest.

    >>> split_index("[2].z")
    (1, 'z')
    """
    number, bracket, rest = path.removeprefix("[").partition("]")
    if not path.startswith("[") or not bracket or not number.isdigit() or number == "0":
        return None
    return int(number) - 1, rest.removeprefix(".")


def names_of(tables: Any) -> list[str]:
    """Names of a list of tables, those that have one as text."""
    if not isinstance(tables, (list, tuple)):
        return []
    return [
        item["name"] for item in tables if isinstance(item, Mapping) and isinstance(item.get("name"), str)
    ]
