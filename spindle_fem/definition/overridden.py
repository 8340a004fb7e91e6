"""``--set`` on definitions that rules complete: values of what the rules add can be set as well."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spindle_fem.definition.completion import complete, tables_of, with_named_types
from spindle_fem.definition.inherit import apply_overrides, split_override
from spindle_fem.definition.schema import names_of, split_key, split_name
from spindle_fem.errors import SpecError, UnknownKeyError, did_you_mean

# Lists of named tables to which the rules of the surroundings add.
_ADDED_TO = ("joint", "surface", "gap", "film", "factor")


def overridden(content: Mapping[str, Any], *overrides: str) -> dict[str, Any]:
    """Raw tables with each ``path=value`` applied, as :func:`apply_overrides` does.

    Raises
    ------
    UnknownKeyError, SpecError
        The path leads to no key that the definition may have, or leaves out what a rule would add again.
    """
    result = with_named_types(content)
    for override in overrides:
        path, text = split_override(override)
        reached = with_ruled_value(result, path)
        if text == "none" and reached != result:
            raise SpecError(
                f"--set {path}",
                'is given by surroundings = "workshop", which would give it again.',
                "Set another value, or describe its faces or contacts in the file.",
            )
        result = with_named_types(apply_overrides(reached, [override]))
    return result


def with_ruled_value(content: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Raw tables with the one value that a path leads to, where only the rules of the surroundings give it.

    The rules lay the rest of its table under it.

    Raises
    ------
    UnknownKeyError
        A table that neither the file nor the rules have.
    """
    key, rest = split_key(path)
    if content.get("surroundings") != "workshop" or key not in _ADDED_TO or not rest or rest.startswith("["):
        return dict(content)
    given = content.get(key, [])
    own = _entry(content, path)
    if not isinstance(given, list) or (own is not None and _key_within(path, own) in own):
        return dict(content)
    completed, _ = complete(content)
    ruled = _entry(completed, path)
    if ruled is None:
        name = split_key(rest)[0]
        known = names_of(completed.get(key, []))
        raise UnknownKeyError(f"--set {path}", f'there is no "{name}" in {key}.', did_you_mean(name, known))
    inner = _key_within(path, ruled)
    value = {inner: ruled[inner]} if inner in ruled else {}
    if own is not None:
        return {**content, key: [{**item, **value} if item is own else item for item in given]}
    marks = {"marks": ruled["marks"]} if "marks" in ruled else {}
    return {**content, key: [*given, {"name": ruled["name"], **value, **marks}]}


def _entry(content: Mapping[str, Any], path: str) -> dict[str, Any] | None:
    """Named table that a path goes through or to."""
    key, rest = split_key(path)
    entries = tables_of(content.get(key))
    found = split_name(rest, names_of(entries)) if rest else None
    return None if found is None else next(item for item in entries if item.get("name") == found[0])


def _key_within(path: str, entry: Mapping[str, Any]) -> str:
    """Key of a named table that a path goes on to; "" where it ends with the table."""
    rest = split_name(split_key(path)[1], [entry["name"]])[1]
    return split_key(rest)[0] if rest else ""
