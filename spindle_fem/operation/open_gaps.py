"""Air between parts that turn and parts that stand, which no gap of the definition crosses."""

from __future__ import annotations

from collections.abc import Iterator

from spindle_fem.definition.default_surroundings import WIDEST_GAP
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.assembly import REMAINING, AssemblyGeometry
from spindle_fem.machine.geometry.faces import MeridianEdge
from spindle_fem.validity import CodedWarning

# Of the turning diameter; around shafts, cavities of housings are wider.
WIDEST_SHARE = 0.2


def heated_gaps_without_exchange(spec: MachineSpec, assembly: AssemblyGeometry) -> tuple[CodedWarning, ...]:
    """Warning of a part with a source that no heat leaves across the air to the one it turns in, or around.

    Both faces are adiabatic, and the air between them is at most a fifth of the turning diameter wide, as
    between a rotor and its stator.
    """
    owner = {surface.name: surface.part for surface in spec.all_surfaces}
    heated = {owner.get(source.place, source.place) for source in spec.source}
    heated |= {name.partition(".")[0] for name in heated if name not in assembly.part_names}
    found: dict[tuple[str, str], tuple[MeridianEdge, MeridianEdge]] = {}
    for inner, outer in _facing(assembly):
        pair = inner.parts[0], outer.parts[0]
        if heated.intersection(pair):
            found.setdefault(pair, (inner, outer))
    return tuple(CodedWarning("gap_without_exchange", _told(*edges)) for edges in found.values())


def _facing(assembly: AssemblyGeometry) -> Iterator[tuple[MeridianEdge, MeridianEdge]]:
    """Adiabatic cylinders that turn, each with an adiabatic one that stands around it."""
    cylinders = [edge for edge in assembly.edges if edge.is_cylinder and not edge.is_axis]
    bare = [edge for edge in cylinders if edge.name.endswith(f".{REMAINING}")]
    rotating = assembly.rotating
    for inner in bare:
        if inner.facings != ("outward",) or not rotating[inner.parts[0]]:
            continue
        for outer in bare:
            low, high = max(inner.z[0], outer.z[0]), min(inner.z[1], outer.z[1])
            width = outer.r[0] - inner.r[0]
            if (
                outer.facings == ("inward",)
                and not rotating[outer.parts[0]]
                and high > low
                and 0.0 < width <= 2.0 * WIDEST_SHARE * inner.r[0]
                and not any(
                    inner.r[0] < edge.r[0] < outer.r[0] and edge.z[0] < high and low < edge.z[1]
                    for edge in cylinders
                )
            ):
                yield inner, outer


def _told(inner: MeridianEdge, outer: MeridianEdge) -> str:
    turning, standing = inner.parts[0], outer.parts[0]
    low, high = 1e3 * max(inner.z[0], outer.z[0]), 1e3 * min(inner.z[1], outer.z[1])
    width = 1e3 * (outer.r[0] - inner.r[0])
    beyond = width > 1e-6 * WIDEST_GAP
    rule = f"; the rule for gaps ends at {1e-6 * WIDEST_GAP:g} mm" if beyond else ""
    return (
        f"No heat crosses the {width:.4g} mm of air between {turning} (diameter {2e3 * inner.r[0]:.4g} mm) "
        f"and {standing} ({2e3 * outer.r[0]:.4g} mm), z {low:.4g} to {high:.4g} mm{rule}. Is a diameter "
        'wrong? If not, name both faces by [[surface]] and put a [[gap]] of kind = "becker_kaye" between.'
    )
