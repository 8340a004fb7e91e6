"""Definitions laid over one another: ``base`` files and ``--set`` overrides."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.schema import (
    Shape,
    annotation_of,
    fields_of,
    is_text,
    names_of,
    quantity_rule,
    shape_of,
    split_index,
    split_key,
    split_name,
)
from spindle_fem.errors import SpecError, SpindleFemError, UnknownKeyError, did_you_mean

PRIOR_KEYS = frozenset({"value", "sigma_rel", "low", "high"})
USER_MARK = "U"


@dataclass(frozen=True, slots=True)
class Layer:
    """One source of a definition.

    Attributes
    ----------
    source : str
        File name, or ``--set path``.
    content : mapping
        Its raw tables.
    override : str
        Path of an override, ``""`` for a file.
    """

    source: str
    content: Mapping[str, Any]
    override: str = ""


def is_prior(value: Any) -> bool:
    """Whether a raw table is one value with its prior."""
    return isinstance(value, Mapping) and bool(value) and set(value) <= PRIOR_KEYS


def merge(base: Any, change: Any) -> Any:
    """Lay one definition over another.

    Tables merge key by key, lists of named tables by ``name`` (an entry with
    ``remove = true`` goes); any other value replaces the base's, and
    ``"none"`` removes a key. A value that replaces the base's takes the mark
    that the change gives it, or U where it gives none.
    """
    if isinstance(base, Mapping) and isinstance(change, Mapping):
        if is_prior(change) or is_prior(base):
            return change
        merged = dict(base)
        for key, value in change.items():
            if key == "marks":
                continue
            if value == "none":
                merged.pop(key, None)
            else:
                merged[key] = merge(base[key], value) if key in base else value
        marks = _merged_marks(base, change, merged)
        return {**merged, "marks": marks} if marks else merged
    if _all_named(base) and _all_named(change) and base and change:
        by_name = {item["name"]: item for item in base}
        for item in change:
            if item.get("remove") is True:
                by_name.pop(item["name"], None)
            else:
                by_name[item["name"]] = merge(by_name.get(item["name"], {}), item)
        return list(by_name.values())
    return change


def _all_named(value: Any) -> bool:
    return isinstance(value, list) and len(names_of(value)) == len(value)


def _marks_table(table: Mapping[str, Any]) -> dict[str, Any]:
    marks = table.get("marks", {})
    if isinstance(marks, Mapping):
        return dict(marks)
    return {"default": marks}


def _merged_marks(
    base: Mapping[str, Any], change: Mapping[str, Any], merged: Mapping[str, Any]
) -> dict[str, Any]:
    marks, given = _marks_table(base), _marks_table(change)
    if not base:
        return given
    default = given.pop("default", None)
    for key, value in change.items():
        is_table = isinstance(value, Mapping) and not is_prior(value)
        if key in ("marks", "name", "schema") or is_table or _all_named(value) or key not in merged:
            continue
        if key in given or base.get(key) == value:
            continue
        if default is not None or "default" in marks or key in marks:
            marks[key] = default if default is not None else USER_MARK
    return {key: mark for key, mark in {**marks, **given}.items() if key == "default" or key in merged}


def without_none(value: Any) -> Any:
    """Raw tables without the keys that are ``"none"``, which means leaving a key out."""
    if isinstance(value, Mapping):
        return {key: without_none(item) for key, item in value.items() if item != "none"}
    if isinstance(value, list):
        return [without_none(item) for item in value]
    return value


def apply_overrides(
    content: Mapping[str, Any], overrides: Iterable[str], model: type[BaseModel] = MachineSpec
) -> dict[str, Any]:
    """Apply ``path=value`` texts, for example ``channel.depth=19mm``.

    Lists of named tables are entered by name (``bearing_set.front.preload``,
    ``part.shaft.segment.nose.outer_diameter``) or by ``[position]``; ``none``
    leaves a key or an entry out. A value that was set carries the mark U.

    Parameters
    ----------
    content : mapping
        Raw tables of a definition.
    model : type
        Model of the file, whose keys the paths may name.

    Raises
    ------
    UnknownKeyError, SpecError
        The path leads to no key that the definition may have.

    >>> apply_overrides({"channel": {"depth": "10 mm"}}, ["channel.depth=19mm"])["channel"]["depth"]
    '19mm'
    """
    result: Any = dict(content)
    for override in overrides:
        path, text = split_override(override)
        result = _with_value(result, Shape("table", (model,)), path, text, f"--set {path}", "the definition")
    return result


def split_override(override: str) -> tuple[str, str]:
    """Path and value text of ``path=value``.

    Raises
    ------
    SpecError
        No ``=``, or nothing before it.
    """
    path, separator, text = override.partition("=")
    if not separator or not path.strip():
        raise SpecError(
            f"--set {override}", "is not of the form path=value.", "For example channel.depth=19mm."
        )
    return path.strip(), text.strip()


def _typed(text: str, shape: Shape) -> Any:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError):
        return text
    return (
        text if shape.kind == "value" and is_text(shape.annotation) and not isinstance(value, str) else value
    )


def _with_value(node: Any, shape: Shape, path: str, text: str, where: str, inside: str) -> Any:
    if not path:
        value = _typed(text, shape)
        if (
            isinstance(node, Mapping)
            and "value" in node
            and value != "none"
            and not isinstance(value, Mapping)
        ):
            return {**node, "value": value}
        return value
    if shape.kind == "table":
        return _in_table(node, shape, path, text, where, inside)
    if shape.kind == "mapping":
        return _in_mapping(node, shape, path, text, where, inside)
    if isinstance(node, list):
        return _in_list(node, shape, path, text, where, inside)
    if shape.kind == "list":
        raise UnknownKeyError(where, f"{inside} has no entries to choose from.", "Add them in the file.")
    return _in_value(node, shape, path, text, where, inside)


def _in_table(node: Any, shape: Shape, path: str, text: str, where: str, inside: str) -> Any:
    table = node if isinstance(node, Mapping) else {}
    fields = fields_of(shape.models, table)
    key, rest = split_key(path)
    if key not in fields:
        raise UnknownKeyError(where, f'there is no key "{key}" in {inside}.', did_you_mean(key, fields))
    child = shape_of(annotation_of(fields[key]))
    label = key if inside == "the definition" else f"{inside}.{key}"
    if rest and table.get(key) in (None, "none") and child.kind == "table":
        lacking = [name for name, field in fields_of(child.models).items() if field.is_required()]
        if set(lacking) - {split_key(rest)[0]}:
            raise UnknownKeyError(
                where,
                f"this machine has no [{label}].",
                f"Add the table to the file; it needs {', '.join(lacking)}.",
            )
    value = _with_value(table.get(key), child, rest, text, where, label)
    changed = {**table, key: value}
    if (
        key not in ("marks", "name", "schema")
        and (child.kind == "value" or not rest)
        and value != table.get(key)
    ):
        changed["marks"] = {**_marks_table(table), key: USER_MARK}
    if value == "none":
        changed["marks"] = {name: mark for name, mark in _marks_table(table).items() if name != key}
    return changed


def _in_mapping(node: Any, shape: Shape, path: str, text: str, where: str, inside: str) -> Any:
    entries = dict(node) if isinstance(node, Mapping) else {}
    inner = shape_of(shape.inner)
    found = split_name(path, list(entries))
    if found is None:
        if inner.kind == "table":
            raise UnknownKeyError(
                where,
                f'there is no "{split_key(path)[0]}" in {inside}.',
                did_you_mean(split_key(path)[0], entries),
            )
        found = path, ""
    name, rest = found
    return {**entries, name: _with_value(entries.get(name), inner, rest, text, where, f"{inside}.{name}")}


def _in_list(node: list[Any], shape: Shape, path: str, text: str, where: str, inside: str) -> list[Any]:
    inner = shape_of(shape.inner) if shape.kind == "list" else Shape("value", annotation=None)
    by_index = split_index(path)
    names = names_of(node)
    if by_index is not None:
        position, rest = by_index
        if position >= len(node):
            raise UnknownKeyError(
                where, f"{inside} has {len(node)} entries.", f"Allowed: [1] to [{len(node)}]."
            )
    else:
        found = split_name(path, names)
        if found is None:
            wanted = split_key(path)[0]
            raise UnknownKeyError(where, f'there is no "{wanted}" in {inside}.', did_you_mean(wanted, names))
        name, rest = found
        position = next(
            index for index, item in enumerate(node) if isinstance(item, Mapping) and item.get("name") == name
        )
    value = _with_value(
        node[position], inner, rest, text, where, f"{inside}.{path.removesuffix(rest).rstrip('.')}"
    )
    return [*node[:position], *([] if value == "none" else [value]), *node[position + 1 :]]


def _in_value(node: Any, shape: Shape, path: str, text: str, where: str, inside: str) -> Any:
    rule = quantity_rule(shape.annotation)
    if rule is not None and rule.uncertain and path in PRIOR_KEYS:
        if node is None:
            raise UnknownKeyError(
                where,
                f"{inside} is not given.",
                f'Set {inside}={{value = "...", sigma_rel = ...}} as a whole.',
            )
        table = dict(node) if isinstance(node, Mapping) else {"value": node}
        return {**table, path: _typed(text, Shape("value", annotation=None))}
    raise UnknownKeyError(where, f"{inside} is one value, it has no {path}.", f"Set {inside} itself.")


def source_of(key_path: str, layers: Iterable[Layer]) -> str:
    """Layer that a key comes from: the last one that reaches deepest along its path."""
    best, source = -1, ""
    for layer in layers:
        if layer.override:
            same = key_path == layer.override or key_path.startswith(
                (layer.override + ".", layer.override + "[")
            )
            depth = len(layer.override) if same else -1
        else:
            depth = _reach(layer.content, key_path)
        if depth >= best:
            best, source = depth, layer.source
    return source


def _reach(content: Any, key_path: str) -> int:
    """Number of characters of a key path that raw tables contain."""
    node, rest = content, key_path
    while rest:
        following: tuple[Any, str] | None = None
        if isinstance(node, Mapping):
            found = split_name(rest, list(node))
            following = (node[found[0]], found[1]) if found else None
        elif isinstance(node, list):
            found = split_name(rest, names_of(node))
            index = split_index(rest)
            if found:
                following = (
                    next(i for i in node if isinstance(i, Mapping) and i.get("name") == found[0]),
                    found[1],
                )
            elif index and index[0] < len(node):
                following = node[index[0]], index[1]
        if following is None:
            break
        node, rest = following
    return len(key_path) - len(rest)


def relabelled(fault: SpindleFemError, layers: Iterable[Layer]) -> SpindleFemError:
    """The fault with the file or override in front of its key path."""
    layers = tuple(layers)
    source = source_of(fault.where, layers)
    where = source if source == f"--set {fault.where}" else f"{source}: {fault.where}"
    return type(fault)(where, fault.what, fault.how_to_fix)
