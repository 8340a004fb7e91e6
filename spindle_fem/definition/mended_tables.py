"""What can still be read of faulty tables, so that one check of a file tells all that is wrong with it.

What stands in for a faulty value finds further faults only; nothing is computed with it.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from spindle_fem.definition.faults import walk_to
from spindle_fem.definition.schema import fields_of, is_range, literal_values, quantity_rule


def mended(content: Mapping[str, Any], error: ValidationError, model: type[BaseModel]) -> dict[str, Any]:
    """Tables of a file with what stands in for single faulty values.

    Unknown keys go, and so do faulty values of keys that need not be given. A choice that is missing or
    unknown becomes the first that is allowed, a length without its unit is in millimetres. Segments and
    bearings with other faults go where their part or set has more of them. What stays cannot be read.

    Parameters
    ----------
    error : ValidationError
        Of the content, by the model.
    """
    result = copy.deepcopy(dict(content))
    lost: dict[int, tuple[list[Any], set[int]]] = {}
    for item in error.errors(include_url=False, include_context=False, include_input=False):
        *path, leaf = item["loc"]
        nodes = _along(result, path)
        if nodes is None or len(nodes) == 1 or _mend(nodes[-1], tuple(path), leaf, model, result):
            continue
        # The list at the top level, of parts say, comes second.
        for entries, entry in itertools.pairwise(nodes[2:]):
            if isinstance(entries, list):
                place = next(number for number, other in enumerate(entries) if other is entry)
                lost.setdefault(id(entries), (entries, set()))[1].add(place)
    for entries, places in lost.values():
        if len(places) < len(entries):
            entries[:] = [entry for place, entry in enumerate(entries) if place not in places]
    return result


def _along(content: dict[str, Any], path: list[int | str]) -> list[Any] | None:
    """Tables and lists along a path, from the file; None where it leads nowhere."""
    nodes: list[Any] = [content]
    for step in path:
        node = nodes[-1]
        listed = isinstance(node, list) and isinstance(step, int) and step < len(node)
        if listed or (isinstance(node, dict) and step in node):
            nodes.append(node[step])
        elif not isinstance(node, dict) or not isinstance(step, str):
            return None
        # else the tag of a union, which the tables do not have
    return nodes


def _mend(
    node: Any,
    path: tuple[int | str, ...],
    leaf: int | str,
    model: type[BaseModel],
    content: Mapping[str, Any],
) -> bool:
    """Whether a table or list got a stand-in for its faulty entry."""
    given = node[leaf] if isinstance(node, list) and isinstance(leaf, int) and leaf < len(node) else None
    given = node.get(leaf) if isinstance(node, dict) else given
    shape, _ = walk_to(model, (*path, leaf), content)
    rule = quantity_rule(shape.annotation)
    if is_range(shape.annotation) and isinstance(given, list):
        node[leaf] = [_in_millimetres(value) for value in given]
        return any(map(_is_bare, given))
    if rule is not None and rule.unit == "m" and _is_bare(given):
        node[leaf] = _in_millimetres(given)
        return True
    if isinstance(node, dict) and not isinstance(given, (dict, list)):
        table, _ = walk_to(model, path, content)
        field = fields_of(table.models, node).get(str(leaf))
        choices = literal_values(shape.annotation)
        if field is None or not field.is_required():
            node.pop(leaf, None)
            return True
        if choices and leaf != "kind":
            node[leaf] = choices[0]
            return True
    return False


def _is_bare(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _in_millimetres(value: Any) -> Any:
    return f"{value} mm" if _is_bare(value) else value
