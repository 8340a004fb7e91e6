"""Faults of bearing sets and radial loads that only show when several tables are read together."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from spindle_fem.definition.bearing_catalogue import SHIPPED
from spindle_fem.definition.bearing_seats import seat_faults
from spindle_fem.definition.bearing_types import RollerBearingType
from spindle_fem.definition.machine_spec import BearingSet, MachineSpec
from spindle_fem.definition.set_completion import is_known_material
from spindle_fem.definition.standard_materials import MATERIALS
from spindle_fem.errors import SpecError, SpindleFemError, did_you_mean

_TOLERANCE = 1.0e-9


def bearing_faults(
    spec: MachineSpec, types: Collection[str], *, all_sound: bool
) -> Iterator[SpindleFemError]:
    """Faults of every bearing set.

    Parameters
    ----------
    types : collection of str
        Names of bearing types that the file declares.
    all_sound : bool
        Whether every set could be read.
    """
    for group in spec.bearing_set:
        if group.bearing_type not in types:
            allowed = f"{did_you_mean(group.bearing_type, types)} {SHIPPED}".strip()
            what = f'"{group.bearing_type}" is no bearing type of this machine.'
            yield SpecError(f"bearing_set.{group.name}.bearing_type", what, allowed)
        if group.spacers is not None and not is_known_material(group.spacers, spec.materials):
            what = f'"{group.spacers}" is no material of this machine.'
            allowed = did_you_mean(group.spacers, (*spec.materials, *MATERIALS))
            yield SpecError(f"bearing_set.{group.name}.spacers", what, allowed)
        yield from _single_type_faults(spec, group, types)
        kind = spec.bearing_types.get(group.bearing_type)
        if kind is None:
            continue
        yield from _width_faults(spec, group)
        if isinstance(kind, RollerBearingType):
            yield from _roller_set_faults(group)
        else:
            yield from _ball_set_faults(group)
            yield from _springs_and_thrust(group)
            yield from _sliding_faults(group)
            if group.fit is not None:
                yield from seat_faults(spec, group)
    carriers = [group.name for group in spec.bearing_set if group.carries_thrust]
    if spec.bearing_set and len(carriers) != 1 and all_sound:
        yield SpecError(
            "bearing_set",
            f"{', '.join(carriers)} have carries_thrust = true."
            if carriers
            else "none has carries_thrust = true.",
            "Allowed: exactly one set.",
        )
    if all_sound:
        yield from _radial_faults(spec)


def _single_type_faults(
    spec: MachineSpec, group: BearingSet, types: Collection[str]
) -> Iterator[SpindleFemError]:
    """Types of single bearings that do not exist, or do not go with their set."""
    for bearing in group.bearing:
        name = bearing.bearing_type
        if name is None:
            continue
        where = f"bearing_set.{group.name}.bearing.{bearing.name}.bearing_type"
        if name not in types:
            allowed = f"{did_you_mean(name, types)} {SHIPPED}".strip()
            yield SpecError(where, f'"{name}" is no bearing type of this machine.', allowed)
        kinds = [spec.bearing_types.get(key) for key in (name, group.bearing_type)]
        if any(isinstance(kind, RollerBearingType) for kind in kinds) and kinds[0] is not kinds[1]:
            what = "cylindrical rollers stand in sets of one type."
            yield SpecError(where, what, "Leave it out, or make a set of its own.")


def _width_faults(spec: MachineSpec, group: BearingSet) -> Iterator[SpindleFemError]:
    for bearing in group.bearing:
        name = group.type_name(bearing)
        kind = spec.bearing_types.get(name)
        if kind is None:
            continue
        width = bearing.z[1] - bearing.z[0]
        if abs(width - kind.width) > _TOLERANCE:
            yield SpecError(
                f"bearing_set.{group.name}.bearing.{bearing.name}.z",
                f"spans {width * 1e3:g} mm.",
                f'Allowed: {kind.width * 1e3:g} mm, the width of "{name}".',
            )


def _ball_set_faults(group: BearingSet) -> Iterator[SpindleFemError]:
    where = f"bearing_set.{group.name}"
    if "preload" not in group.model_fields_set:
        allowed = (
            'Allowed: a quantity such as "500 N", at least 0 N; light, medium or heavy of types that ship.'
        )
        yield SpecError(f"{where}.preload", "is missing.", allowed)
    for bearing in group.bearing:
        if bearing.takes_thrust is None:
            yield SpecError(
                f"{where}.bearing.{bearing.name}.takes_thrust",
                "is missing.",
                "Allowed: towards_rear, towards_nose.",
            )


def _springs_and_thrust(group: BearingSet) -> Iterator[SpindleFemError]:
    if group.carries_thrust and group.spring_force:
        yield SpecError(
            f"bearing_set.{group.name}.carries_thrust",
            "its bearings all face one way, on springs, which give way to thrust.",
            "Another set must hold the shaft; bearings at both ends that load each other are one set, where "
            "each may have a bearing_type of its own.",
        )


def _sliding_faults(group: BearingSet) -> Iterator[SpindleFemError]:
    """Rings said to slide that nothing presses on, or to be held where their springs load other sets."""
    fit = group.fit
    if fit is None:
        return
    where = f"bearing_set.{group.name}.fit.outer_ring"
    if fit.outer_ring == "slides" and group.preload_kind != "spring":
        what = f'preload_kind is "{group.preload_kind}": no spring presses rings that slide.'
        yield SpecError(where, what, 'Allowed: "held", or preload_kind = "spring".')
    if fit.outer_ring == "held" and group.spring_force:
        what = "its bearings all face one way, on springs that load the set that holds the shaft."
        yield SpecError(where, what, 'Allowed: "slides".')


def _roller_set_faults(group: BearingSet) -> Iterator[SpindleFemError]:
    where = f"bearing_set.{group.name}"
    rollers = f'"{group.bearing_type}" has cylindrical rollers, which'
    if group.preload > 0.0:
        what = f"{rollers} no axial force preloads."
        yield SpecError(f"{where}.preload", what, "Give radial_clearance of the bearing type instead.")
    if group.carries_thrust:
        yield SpecError(f"{where}.carries_thrust", f"{rollers} carry none.", "Name a set of ball bearings.")
    if group.fit is not None:
        what = f"{rollers} are known by their clearance as mounted."
        yield SpecError(f"{where}.fit", what, "Give radial_clearance of the bearing type instead.")
    for bearing in group.bearing:
        if bearing.takes_thrust is not None:
            key = f"{where}.bearing.{bearing.name}.takes_thrust"
            yield SpecError(key, f"{rollers} carry none.", "Leave it out.")


def _radial_faults(spec: MachineSpec) -> Iterator[SpindleFemError]:
    """Radial loads that no bearing, or one alone, would have to hold."""
    if not spec.radial_load:
        return
    holding = [group.name for group in spec.bearing_set if group.carries_radial]
    if len(holding) < 2:
        named = f"only {holding[0]} carries" if holding else "no bearing set carries"
        yield SpecError(
            "radial_load",
            f"{named} radial loads; the shaft would tilt.",
            "Allowed: at least two sets with carries_radial = true.",
        )
