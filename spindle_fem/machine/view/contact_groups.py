"""Contacts of a machine that may conduct differently together."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.housing_flange import volume
from spindle_fem.definition.machine_spec import NaturalFilm
from spindle_fem.effects.framework.machine_view import Seat
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.machine.view.part_roles import Layout


def seats_of(
    names: MachineNames, layout: Layout, sets: Mapping[str, tuple[str, ...]]
) -> tuple[tuple[Seat, ...], dict[str, tuple[str, ...]]]:
    """Groups of contacts that may differ together, and the outer seats of every set and bearing."""
    spec, conducting = names.spec, names.conducting_contacts
    by_ends = {name: name.removesuffix(":face").split("|") for name in conducting}
    housing = layout.housing.name if layout.housing is not None else ""
    owner = {b: key for key, members in sets.items() if members != (key,) for b in members}
    found: list[Seat] = []
    outer: dict[str, tuple[str, ...]] = {}
    # Whole sets: rings and spacers on shaft and housing.
    for key, members in sets.items():
        for side, partner in (("outer", housing), ("inner", layout.shaft.name if layout.shaft else "")):
            rings = {f"{bearing}.{side}_ring" for bearing in members}
            own = tuple(
                f"joint.{name}"
                for name, ends in by_ends.items()
                if not name.endswith(":face")
                and partner in ends
                and any(
                    end in rings
                    or (
                        members != (key,)
                        and end not in (partner,)
                        and "." not in end
                        and layout.component_of(end) == key
                    )
                    for end in ends
                )
            )
            if not own:
                continue
            if side == "outer":
                outer[key] = own
            if members == (key,) or owner.get(members[0]) == key:
                found.append(Seat(key, f"{side} ring seats", own, names.shared_parameter(own)))
    seen = {frozenset(seat.coefficients) for seat in found}
    # The machine's own groups, and single contacts between other parts.
    for group in spec.joint:
        own = tuple(n for n in (f"joint.{c}" for c in conducting) if f"joint.{group.name}" in names.groups[n])
        if own and frozenset(own) not in seen:
            components = {layout.component_of(e) for n in own for e in by_ends[n.removeprefix("joint.")]}
            place = _common(components, owner)
            found.append(Seat(place, group.name.replace("_", " "), own, f"joint.{group.name}"))
            seen.add(frozenset(own))
    for name, ends in by_ends.items():
        parts = [next((p for p in spec.part if p.name == end), None) for end in ends]
        alone = all(part is not None and not layout.is_spacer(part) for part in parts)
        if alone and frozenset((f"joint.{name}",)) not in seen:
            small = min(parts, key=volume)
            contact = f"joint.{name}"
            found.append(Seat(layout.component_of(small.name), f"{small.name} contact", (contact,), contact))
    for film in spec.film:
        if not isinstance(film, NaturalFilm) and all(
            layout.is_flange_back(layout.surface(s)) for s in film.surface
        ):
            own = tuple(f"film.{surface}" for surface in film.surface)
            parameter = f"film.{film.name}" if film.name else own[0]
            found.append(Seat("flange", "to the frame", own, parameter))
    return tuple(found), outer


def _common(components: set[str], owner: Mapping[str, str]) -> str:
    """Common component of several: their set, the shaft or the housing."""
    groups = {owner.get(name, name) for name in components}
    rest = groups - {"shaft", "housing"}
    if len(rest) == 1:
        return rest.pop()
    if len(groups) == 1:
        return groups.pop()
    return "shaft" if "shaft" in groups else "housing"
