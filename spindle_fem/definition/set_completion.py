"""Complete bearing sets by rules: spacers between their bearings, the force of a preload class.

Works on raw tables, as :mod:`spindle_fem.definition.completion` does; malformed tables are left unchanged.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from spindle_fem.definition.bearing_catalogue import PRELOAD_CLASSES, PRELOAD_RULE, preload_of_class
from spindle_fem.definition.standard_materials import MATERIALS
from spindle_fem.errors import SpindleFemError
from spindle_fem.units import to_si

_SAME_PLACE = 1.0e-9
# Exponent of the axial approach of a ball bearing over its force.
_APPROACH_EXPONENT = 2.0 / 3.0


def add_set_rules(content: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Complete sets in place; yield what was taken, as key path and rule."""
    groups = content.get("bearing_set")
    if not isinstance(groups, list):
        return
    types = content.get("bearing_types")
    types = types if isinstance(types, Mapping) else {}
    for position, group in enumerate(groups):
        if not isinstance(group, Mapping):
            continue
        kind = types.get(str(group.get("bearing_type")))
        if isinstance(kind, Mapping):
            yield from _preload(groups, position, kind)
            yield from _spacers(content, group, types)
        elif str(group.get("preload")) in PRELOAD_CLASSES:
            # An unknown type is the one fault: its bearings have some preload.
            groups[position] = {**group, "preload": "0 N"}


def _preload(groups: list[Any], position: int, kind: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A preload class as the force through the set."""
    group = groups[position]
    name, designation = str(group.get("preload")), kind.get("catalogue")
    if name not in PRELOAD_CLASSES or not isinstance(designation, str):
        return
    own = preload_of_class(designation, name)
    if own is None:
        return
    rows = group.get("bearing")
    if rows and any(isinstance(row, Mapping) and row.get("bearing_type") for row in rows):
        # a class is that of equal bearings
        return
    sides = [row.get("takes_thrust") for row in rows if isinstance(row, Mapping)] if rows else []
    numbers = [sides.count(side) for side in ("towards_rear", "towards_nose")]
    if sum(numbers) < len(sides):
        # A direction that is missing or unknown is the one fault: its set has some preload.
        groups[position] = {**group, "preload": "0 N"}
    if not any(numbers) or sum(numbers) < len(sides):
        return
    if all(numbers):
        force = own * tandem_factor(*numbers)
    elif group.get("preload_kind") == "spring":
        # each bearing as in a pair
        force = own * sum(numbers)
    else:
        return
    groups[position] = {**group, "preload": f"{force:.4g} N"}
    yield (
        f"bearing_set.{group.get('name')}.preload",
        f"{name}: {force:.4g} N through the set, {own:.4g} N of a pair; {PRELOAD_RULE}",
    )


def tandem_factor(towards_rear: int, towards_nose: int) -> float:
    """Preload of a set of matched bearings over that of a pair of them.

    Each bearing is ground with the offset of its preload class, so that the set closes
    the same distance as a pair; its approach goes with the force to the power of 2/3.

    A pair, a triplex set and a quadruplex set:

    >>> [round(tandem_factor(*sides), 2) for sides in ((1, 1), (2, 1), (2, 2))]
    [1.0, 1.36, 2.0]
    """
    shares = (number**-_APPROACH_EXPONENT for number in (towards_rear, towards_nose))
    return (2.0 / sum(shares)) ** (1.0 / _APPROACH_EXPONENT)


def _spacers(
    content: dict[str, Any], group: Mapping[str, Any], types: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """Rings between bearings of one type with gaps, as high as the bearing's rings."""
    material = group.get("spacers")
    rows, parts = group.get("bearing"), content.get("part")
    if not isinstance(rows, list) or not isinstance(parts, list):
        return
    if not is_known_material(material, content.get("materials")):
        return
    with contextlib.suppress(SpindleFemError, TypeError, ValueError, AttributeError, KeyError):
        named = [str(row.get("bearing_type") or group["bearing_type"]) for row in rows]
        gaps = _gaps([row["z"] for row in rows], named)
        known = {part.get("name") for part in parts if isinstance(part, Mapping)}
        rings = {
            "inner_spacer": ("bore_diameter", "inner_ring_outer_diameter"),
            "outer_spacer": ("outer_ring_inner_diameter", "outer_diameter"),
        }
        for number, (low, high, own) in enumerate(gaps, start=1):
            for ring, (inner, outer) in rings.items():
                name = f"{group['name']}_{ring}" + (f"_{number}" if len(gaps) > 1 else "")
                if name in known:
                    continue
                segment = {
                    "marks": "A",
                    "name": "ring",
                    "z": [_millimetres(low), _millimetres(high)],
                    "inner_diameter": types[own][inner],
                    "outer_diameter": types[own][outer],
                }
                turning = ring == "inner_spacer"
                part = {"name": name, "material": material, "rotating": turning, "segment": [segment]}
                content["part"] = parts = [*parts, {"marks": "A", **part}]
                yield (
                    f"part.{name}",
                    f"{material}, z {segment['z'][0]} to {segment['z'][1]}: between bearings, "
                    "as high as their rings",
                )


def is_known_material(name: Any, given: Any) -> bool:
    """Whether a material is one of the file's own or ships."""
    own = given if isinstance(given, Mapping) else {}
    return isinstance(name, str) and (name in own or name in MATERIALS)


def _gaps(places: list[Any], named: list[str]) -> list[tuple[float, float, str]]:
    """Gaps between neighbouring bearings of one type, m, with its name."""
    spans = sorted(
        (*(to_si(end, "m", where="") for end in place), name)
        for place, name in zip(places, named, strict=True)
    )
    return [
        (before[1], after[0], after[2])
        for before, after in pairwise(spans)
        if after[0] - before[1] > _SAME_PLACE and before[2] == after[2]
    ]


def _millimetres(value: float) -> str:
    return f"{1e3 * value:.12g} mm"
