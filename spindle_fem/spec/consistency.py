"""Faults that only show when several tables of a machine are read together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from spindle_fem.errors import SpecError, SpindleFemError, UnknownSurfaceError, did_you_mean
from spindle_fem.spec.model import MachineSpec


def find_faults(spec: MachineSpec) -> list[SpindleFemError]:
    """Every inconsistency between the tables of a machine, in file order."""
    return [
        *_duplicates(spec),
        *_materials(spec),
        *_bearings(spec),
        *_cooling(spec),
        *_heat(spec),
        *_surfaces(spec),
        *_factors(spec),
        *_probes(spec),
    ]


def _unknown(where: str, name: str, what: str, allowed: Iterable[str]) -> SpecError:
    return SpecError(where, f'"{name}" is no {what} of this machine.', did_you_mean(name, allowed))


def _duplicates(spec: MachineSpec) -> Iterator[SpindleFemError]:
    groups = {
        "part": [part.name for part in spec.part],
        "bearing_set": [group.name for group in spec.bearing_set],
        "bearing_set.bearing": [bearing.name for _, bearing in spec.bearings],
        "joint": [joint.name for joint in spec.joint],
        "surface": [surface.name for surface in spec.surface],
        "film": [film.name for film in spec.film if film.name],
        "gap": [gap.name for gap in spec.gap],
        "factor": [factor.name for factor in spec.factor],
        "probe": [probe.name for probe in spec.probe],
    }
    for key, names in groups.items():
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield SpecError(key, f'the name "{name}" is used {names.count(name)} times.', "Names must differ.")


def _materials(spec: MachineSpec) -> Iterator[SpindleFemError]:
    for part in spec.part:
        if part.material not in spec.materials:
            yield _unknown(f"part.{part.name}.material", part.material, "material", spec.materials)
    for name, kind in spec.bearing_types.items():
        for key in ("ring_material", "ball_material"):
            if getattr(kind, key) not in spec.materials:
                yield _unknown(f"bearing_types.{name}.{key}", getattr(kind, key), "material", spec.materials)


def _bearings(spec: MachineSpec) -> Iterator[SpindleFemError]:
    for group in spec.bearing_set:
        kind = spec.bearing_types.get(group.bearing_type)
        if kind is None:
            yield _unknown(
                f"bearing_set.{group.name}.bearing_type", group.bearing_type, "bearing type", spec.bearing_types
            )
            continue
        for bearing in group.bearing:
            width = bearing.z[1] - bearing.z[0]
            if abs(width - kind.width) > 1.0e-6:
                yield SpecError(
                    f"bearing_set.{group.name}.bearing.{bearing.name}.z",
                    f"spans {width * 1e3:g} mm, but {group.bearing_type} is {kind.width * 1e3:g} mm wide.",
                )
    if spec.bearing_set and sum(group.carries_thrust for group in spec.bearing_set) != 1:
        yield SpecError("bearing_set", "exactly one set must have carries_thrust = true.")


def _cooling(spec: MachineSpec) -> Iterator[SpindleFemError]:
    if (spec.channel is None) != (spec.coolant is None):
        given, lacking = ("channel", "coolant") if spec.coolant is None else ("coolant", "channel")
        yield SpecError(given, f"there is a [{given}] but no [{lacking}].", "Give both or neither.")
    if spec.channel is not None:
        standing = [part.name for part in spec.part if not part.rotating]
        if spec.channel.part not in standing:
            yield _unknown("channel.part", spec.channel.part, "standing part", standing)


def _heat(spec: MachineSpec) -> Iterator[SpindleFemError]:
    names = [bearing.name for _, bearing in spec.bearings]
    if spec.heat.model != "table" and spec.bearing_set and spec.grease is None:
        yield SpecError("grease", f'is missing, heat.model = "{spec.heat.model}" needs it.')
    if spec.heat.table is None:
        return
    for key in ("heat", "thrust_coefficient"):
        for name in getattr(spec.heat.table, key):
            if name not in names:
                yield _unknown(f"heat.table.{key}.{name}", name, "bearing", names)
    for name in names:
        if name not in spec.heat.table.heat:
            yield SpecError(f"heat.table.heat.{name}", "is missing.", "Every bearing needs a row.")


def _surfaces(spec: MachineSpec) -> Iterator[SpindleFemError]:
    parts = [part.name for part in spec.part]
    rings = [f"{bearing.name}.{ring}_ring" for _, bearing in spec.bearings for ring in ("inner", "outer")]
    for surface in spec.surface:
        if surface.part not in parts + rings:
            yield _unknown(f"surface.{surface.name}.part", surface.part, "part", parts + rings)
    names = [surface.name for surface in spec.surface]
    claimed: dict[str, str] = {}
    for index, film in enumerate(spec.film):
        label = f"film.{film.name}" if film.name else f"film[{index + 1}]"
        for name in film.surface:
            yield from _claim(claimed, label + ".surface", name, names)
    rotating = {part.name: part.rotating for part in spec.part}
    part_of = {surface.name: surface.part for surface in spec.surface}
    for gap in spec.gap:
        for key, side in (("rotating", (gap.rotating,)), ("standing", gap.standing)):
            for name in side:
                yield from _claim(claimed, f"gap.{gap.name}.{key}", name, names)
                if name in part_of and rotating.get(part_of[name], False) != (key == "rotating"):
                    yield SpecError(
                        f"gap.{gap.name}.{key}", f'"{name}" lies on a part that is {"not " * (key == "rotating")}rotating.'
                    )
    for name in names:
        if name not in claimed:
            yield SpecError(
                f"surface.{name}", "has no film and no gap.", "Give it one, or remove the name to leave it adiabatic."
            )


def _claim(claimed: dict[str, str], where: str, name: str, names: list[str]) -> Iterator[SpindleFemError]:
    if name not in names:
        yield UnknownSurfaceError(where, f'names "{name}", not a surface of this machine.', did_you_mean(name, names))
    elif name in claimed:
        yield SpecError(where, f'"{name}" is already used by {claimed[name]}.', "A surface takes one film or gap.")
    else:
        claimed[name] = where


def factor_targets(spec: MachineSpec) -> tuple[str, ...]:
    """What a shared factor may apply to."""
    return (
        *(f"film.{film.name}" for film in spec.film if film.name),
        *(f"gap.{gap.name}" for gap in spec.gap),
        *(f"joint.{joint.name}" for joint in spec.joint if joint.conductance != "perfect"),
        *(f"heat.{group.name}" for group in spec.bearing_set),
        *(f"ball_row.{group.name}" for group in spec.bearing_set),
    )


def _factors(spec: MachineSpec) -> Iterator[SpindleFemError]:
    targets = factor_targets(spec)
    for factor in spec.factor:
        for name in factor.applies_to:
            if name not in targets:
                yield _unknown(f"factor.{factor.name}.applies_to", name, "coefficient", targets)


def _probes(spec: MachineSpec) -> Iterator[SpindleFemError]:
    parts = [part.name for part in spec.part]
    for probe in spec.probe:
        if probe.kind == "coolant_outlet" and spec.coolant is None:
            yield SpecError(f"probe.{probe.name}", "reads the coolant outlet, but there is no [coolant].")
        if probe.part is not None and probe.part not in parts and "_ring" not in probe.part:
            yield _unknown(f"probe.{probe.name}.part", probe.part, "part", parts)
