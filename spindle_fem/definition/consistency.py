"""Faults that only show when several tables of a machine are read together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from spindle_fem.definition.bearing_faults import bearing_faults
from spindle_fem.definition.bearing_seats import followed_joint_faults
from spindle_fem.definition.bearing_types import BearingType
from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.displacement_faults import displacement_faults
from spindle_fem.definition.field_types import is_name
from spindle_fem.definition.machine_spec import MachineSpec, Probe
from spindle_fem.definition.schema import names_of
from spindle_fem.definition.standard_materials import MATERIALS
from spindle_fem.errors import SpecError, SpindleFemError, UnknownSurfaceError, did_you_mean

_LISTS = (
    "part",
    "bearing_set",
    "joint",
    "surface",
    "film",
    "gap",
    "factor",
    "probe",
    "displacement_sensor",
    "source",
    "radial_load",
)
_TOLERANCE = 1.0e-9
# Makers of bearing balls give 300 to 315 GPa, 0.24 to 0.27, 2.2e-6 to 3.3e-6 1/K.
SILICON_NITRIDE = {"young_modulus": "310 GPa", "poisson_ratio": "0.26", "thermal_expansion": "3.2e-6 1/K"}


@dataclass(frozen=True, slots=True)
class Declared:
    """Names that a definition declares, in its sound tables and in its faulty ones.

    A name counts as known even where its table has a fault of its own, so that
    one fault does not bring up others.

    Attributes
    ----------
    names : mapping of str to tuple of str
        By top-level key, with ``bearing`` for the bearings of all sets.
    rotating : mapping of str to bool
        By part and ring.
    part_of : mapping of str to str
        Part of each surface.
    claims : tuple of (str, str)
        Key path of a film or gap and the surface that it names, in file order.
    tables : frozenset of str
        Top-level keys that are given.
    unsound : frozenset of str
        Those with a fault inside.
    """

    names: Mapping[str, tuple[str, ...]]
    rotating: Mapping[str, bool]
    part_of: Mapping[str, str]
    claims: tuple[tuple[str, str], ...]
    tables: frozenset[str]
    unsound: frozenset[str]

    @classmethod
    def of(cls, content: Mapping[str, Any], unsound: Iterable[str] = ()) -> Declared:
        """Names declared by raw tables."""
        names = {key: tuple(names_of(content.get(key))) for key in _LISTS}
        for key in ("materials", "bearing_types"):
            tables = content.get(key)
            names[key] = tuple(tables) if isinstance(tables, Mapping) else ()
        names["bearing"] = tuple(
            name for group in _tables(content, "bearing_set") for name in names_of(group.get("bearing"))
        )
        rotating: dict[str, bool] = {}
        for part in _tables(content, "part"):
            rotating.setdefault(str(part.get("name")), part.get("rotating") is True)
        for name in names["bearing"]:
            rotating |= {f"{name}.inner_ring": True, f"{name}.outer_ring": False}
        return cls(
            names=names,
            rotating=rotating,
            part_of={str(item.get("name")): str(item.get("part")) for item in _tables(content, "surface")},
            claims=tuple(_claims(content)),
            tables=frozenset(content),
            unsound=frozenset(unsound),
        )

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts and the rings of every bearing."""
        return tuple(self.rotating)


def _tables(content: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    entries = content.get(key)
    if not isinstance(entries, (list, tuple)):
        return []
    return [item for item in entries if isinstance(item, Mapping)]


def _claims(content: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for position, film in enumerate(_tables(content, "film")):
        label = f"film.{film['name']}" if isinstance(film.get("name"), str) else f"film[{position + 1}]"
        for name in _texts(film.get("surface")):
            yield f"{label}.surface", name
    for gap in _tables(content, "gap"):
        for key in ("rotating", "standing"):
            for name in _texts(gap.get(key)):
                yield f"gap.{gap.get('name')}.{key}", name


def _texts(value: Any) -> list[str]:
    entries = value if isinstance(value, (list, tuple)) else [value]
    return [item for item in entries if isinstance(item, str)]


def find_faults(spec: MachineSpec, declared: Declared | None = None) -> list[SpindleFemError]:
    """Every inconsistency between the tables of a machine.

    Parameters
    ----------
    spec : MachineSpec
        The machine, or its sound tables.
    declared : Declared, optional
        Names of the whole file; taken from ``spec`` where none are given.
    """
    if declared is None:
        declared = Declared.of(spec.model_dump(mode="json", by_alias=True, exclude_none=True))
    return [
        *_duplicates(declared),
        *_segments(spec),
        *_materials(spec, declared),
        *bearing_faults(
            spec, declared.names["bearing_types"], all_sound="bearing_set" not in declared.unsound
        ),
        *_cooling(spec, declared),
        *_heat(spec, declared),
        *_sources(spec, declared),
        *_joints(spec, declared),
        *followed_joint_faults(spec),
        *_surfaces(spec, declared),
        *_factors(spec, declared),
        *_probes(spec, declared),
        *displacement_faults(spec),
        *_mesh(spec, declared),
    ]


def _unknown(
    where: str, name: str, what: str, allowed: Iterable[str], may_be: Callable[[str], bool] = is_name
) -> SpecError:
    # A name that is refused where it is given is none to offer.
    offered = [item for item in allowed if may_be(item)]
    return SpecError(where, f'"{name}" is no {what} of this machine.', did_you_mean(name, offered))


def _duplicates(declared: Declared) -> Iterator[SpindleFemError]:
    raceways = tuple(
        f"{name}.{side}_raceway" for name in declared.names["bearing"] for side in ("inner", "outer")
    )
    rings = tuple(f"{name}.{side}_ring" for name in declared.names["bearing"] for side in ("inner", "outer"))
    groups = {key: declared.names[key] for key in _LISTS}
    groups["bearing_set.bearing"] = declared.names["bearing"]
    for key, names in groups.items():
        reserved = {"part": rings, "surface": raceways}.get(key, ())
        for name in dict.fromkeys(names):
            if names.count(name) > 1:
                yield SpecError(
                    key, f'the name "{name}" is used {names.count(name)} times.', "Names must differ."
                )
            if name in reserved:
                yield SpecError(f"{key}.{name}", "has the name that a bearing gives.", "Choose another.")


def _segments(spec: MachineSpec) -> Iterator[SpindleFemError]:
    for part in spec.part:
        names = [segment.name for segment in part.segment]
        for name in dict.fromkeys(names):
            if names.count(name) > 1:
                what = f'the name "{name}" is used {names.count(name)} times.'
                yield SpecError(f"part.{part.name}.segment", what, "Names must differ.")


def _materials(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    materials = declared.names["materials"]
    # Materials that ship need no table: the message for an unknown name lists both.
    allowed = sorted({*materials, *MATERIALS})
    for part in spec.part:
        if part.material not in materials:
            yield _unknown(f"part.{part.name}.material", part.material, "material", allowed, bool)
    for name, kind in spec.bearing_types.items():
        for key in ("ring_material", f"{kind.element_word}_material"):
            if getattr(kind, key) not in materials:
                yield _unknown(f"bearing_types.{name}.{key}", getattr(kind, key), "material", allowed, bool)
    # Steel's values, the defaults, are wrong by half for ceramics.
    mixed = {
        kind.element_material
        for kind in spec.bearing_types.values()
        if kind.element_material != kind.ring_material and kind.ring_material in materials
    }
    for name in sorted(mixed):
        balls = spec.materials.get(name)
        for key in ("young_modulus", "poisson_ratio", "thermal_expansion") if balls is not None else ():
            if key not in balls.model_fields_set:
                what = "is missing, but balls or rollers of other material than their rings are made of it."
                yield SpecError(
                    f"materials.{name}.{key}", what, f"Give it; silicon nitride: {SILICON_NITRIDE[key]}."
                )


def _cooling(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    given = declared.tables & {"channel", "coolant"}
    if len(given) == 1:
        present = next(iter(given))
        lacking = "coolant" if present == "channel" else "channel"
        yield SpecError(present, f"there is a [{present}] but no [{lacking}].", "Give both or neither.")
    if spec.channel is not None:
        standing = [name for name in declared.names["part"] if not declared.rotating[name]]
        if spec.channel.part not in standing:
            yield _unknown("channel.part", spec.channel.part, "standing part", standing)


def _heat(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    names = declared.names["bearing"]
    if spec.heat is None:
        return
    dry = [group for group in spec.bearing_set if group.lubrication is None]
    contacts = any(group.ball_row.kind == "contact" for group in spec.bearing_set)
    by_contact = [group.name for group in dry] if contacts else []
    if "grease" in declared.tables:
        pass
    elif spec.heat.model != "table" and names and (dry or not spec.bearing_set):
        yield SpecError(
            "grease",
            f'is missing, heat.model = "{spec.heat.model}" needs it.',
            'Add [grease], lubrication of every bearing set, or heat.model = "table".',
        )
    elif by_contact:
        yield SpecError(
            "grease",
            f'is missing, the contacts of the balls of "{by_contact[0]}" need it.',
            'Add [grease], or ball_row = {kind = "constant", conductance = "..."}.',
        )
    if spec.heat.table is None:
        return
    for key in ("heat", "thrust_coefficient"):
        for name in getattr(spec.heat.table, key):
            if name not in names:
                yield _unknown(f"heat.table.{key}.{name}", name, "bearing", names)
    for name in names:
        if name not in spec.heat.table.heat:
            yield SpecError(f"heat.table.heat.{name}", "is missing.", "Every bearing needs a row.")


def _sources(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    segments = tuple(f"{part.name}.{item.name}" for part in spec.part for item in part.segment)
    surfaces = tuple(dict.fromkeys((*declared.names["surface"], *(s.name for s in spec.all_surfaces))))
    for source in spec.source:
        where = f"source.{source.name}"
        if source.part is not None and source.part not in (*declared.parts, *segments):
            yield _unknown(f"{where}.part", source.part, "part or segment", (*declared.parts, *segments))
        if source.surface is not None and source.surface not in surfaces:
            yield _unknown(f"{where}.surface", source.surface, "surface", surfaces)
        if source.follows_torque and spec.operation and spec.operation.load_torque is None:
            fix = 'Give operation.torque, such as "40 N*m", or operation.power.'
            yield SpecError(f"{where}.heat", "follows the torque, and operation has none.", fix)


def _joints(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    form = 'Allowed: "part_a|part_b" or "part_a|part_b:face" with * for any text'
    for joint in spec.joint:
        where = f"joint.{joint.name}.contacts"
        for contact in joint.contacts:
            pair, colon, kind = contact.partition(":")
            sides = pair.split("|")
            if len(sides) != 2 or (colon and kind != "face" and "*" not in kind):
                yield SpecError(where, f'"{contact}" is no contact.', f"{form}.")
                continue
            matches = [[name for name in declared.parts if fnmatchcase(name, side)] for side in sides]
            for side, found in zip(sides, matches, strict=True):
                if not found:
                    yield _unknown(where, side, "part or ring", declared.parts)
            pairs = [(first, second) for first in matches[0] for second in matches[1] if first != second]
            if pairs and all(first > second for first, second in pairs):
                turned = f"{sides[1]}|{sides[0]}{colon}{kind}"
                yield SpecError(
                    where, f'"{contact}" names the parts in the wrong order.', f'Write "{turned}".'
                )


def _surfaces(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    names = declared.names["surface"]
    for surface in spec.surface:
        if surface.part not in declared.parts:
            yield _unknown(f"surface.{surface.name}.part", surface.part, "part", declared.parts)
    claimed: dict[str, str] = {}
    for where, name in declared.claims:
        if name not in names:
            yield UnknownSurfaceError(
                where, f'names "{name}", not a surface of this machine.', did_you_mean(name, names)
            )
        elif name in claimed:
            yield SpecError(
                where, f'"{name}" is already used by {claimed[name]}.', "A surface takes one film or gap."
            )
        else:
            claimed[name] = where
    yield from _motion(spec, declared)
    yield from _circuits(spec, declared)
    for name in dict.fromkeys(names):
        if name not in claimed:
            yield SpecError(
                f"surface.{name}",
                "has no film and no gap.",
                "Give it one, or drop the name to leave the face with the remaining surfaces.",
            )


def _circuits(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    for film in spec.circuits:
        if not isinstance(film, CircuitFilm):
            continue
        for key in ("part", "outer_part"):
            part = getattr(film, key)
            if part is None:
                continue
            if part not in declared.parts:
                yield _unknown(f"film.{film.name}.{key}", part, "part", declared.parts)
            elif (
                film.duct == "annulus" and declared.rotating[part] and (film.law, key) != ("turning", "part")
            ):
                yield SpecError(
                    f"film.{film.name}.{key}",
                    f'"{part}" turns.',
                    'The walls of an annulus stand, but the inner one with law = "turning".',
                )
        for name in film.surface:
            if name in declared.names["surface"]:
                yield SpecError(f"surface.{name}", "has the name that a circuit gives.", "Choose another.")


def _motion(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    def rotates(surface: str) -> bool | None:
        return declared.rotating.get(declared.part_of.get(surface, ""))

    for gap in spec.gap:
        if rotates(gap.rotating) is False:
            yield SpecError(
                f"gap.{gap.name}.rotating",
                f'"{gap.rotating}" lies on a standing part.',
                "Name a rotating one's.",
            )
        for name in gap.standing:
            if rotates(name):
                yield SpecError(
                    f"gap.{gap.name}.standing", f'"{name}" lies on a rotating part.', "Name a standing one's."
                )
    for position, film in enumerate(spec.film):
        label = f"film.{film.name}" if film.name else f"film[{position + 1}]"
        for name in film.surface:
            if film.kind == "rotating" and rotates(name) is False:
                yield SpecError(
                    f"{label}.surface",
                    f'"{name}" lies on a standing part.',
                    'A film of kind "rotating" needs a rotating part\'s.',
                )


def factor_targets(spec: MachineSpec) -> tuple[str, ...]:
    """Coefficients that a shared factor may apply to."""
    return (
        *(f"film.{film.name}" for film in spec.film if film.name),
        *(f"gap.{gap.name}" for gap in spec.gap),
        *(f"joint.{joint.name}" for joint in spec.joint if joint.conductance != "perfect"),
        *(f"heat.{group.name}" for group in spec.bearing_set),
        *(f"ball_row.{group.name}" for group in spec.bearing_set if group.ball_row.conductance is not None),
    )


def _factors(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    targets = factor_targets(spec)
    tables = {
        "film": "film",
        "gap": "gap",
        "joint": "joint",
        "heat": "bearing_set",
        "ball_row": "bearing_set",
    }
    for factor in spec.factor:
        for name in dict.fromkeys(factor.applies_to):
            where = f"factor.{factor.name}.applies_to"
            if factor.applies_to.count(name) > 1:
                yield SpecError(
                    where, f'"{name}" is named {factor.applies_to.count(name)} times.', "Once is enough."
                )
            if name not in targets and tables.get(name.partition(".")[0]) not in declared.unsound:
                yield _unknown(where, name, "coefficient", targets)


def _probes(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    # A circuit, or a set that makes streams, whose own fault is reported.
    unread = list(declared.names["film"]) if "film" in declared.unsound else []
    if "bearing_set" in declared.unsound:
        unread += [f"{name}.lubrication" for name in declared.names["bearing"]]
    for probe in spec.probe:
        if probe.kind == "coolant_outlet" and "coolant" not in declared.tables:
            yield SpecError(
                f"probe.{probe.name}",
                "reads the coolant outlet, but there is no [coolant].",
                "Drop it, or add one.",
            )
        names = [film.name for film in spec.circuits]
        if probe.circuit is not None and probe.circuit not in (*names, *unread):
            yield _unknown(f"probe.{probe.name}.circuit", probe.circuit, "circuit", names)
        if probe.part is not None and probe.part not in declared.parts:
            yield _unknown(f"probe.{probe.name}.part", probe.part, "part", declared.parts)
        elif probe.part is not None:
            yield from _outside(spec, probe)


def _outside(spec: MachineSpec, probe: Probe) -> Iterator[SpindleFemError]:
    sections = _sections(spec, str(probe.part))
    if sections is None or probe.r is None or probe.z is None:
        return
    for z_low, z_high, r_low, r_high in sections:
        if (
            z_low - _TOLERANCE <= probe.z <= z_high + _TOLERANCE
            and r_low - _TOLERANCE <= probe.r <= r_high + _TOLERANCE
        ):
            return
    listing = "; ".join(
        f"z {z_low * 1e3:g}-{z_high * 1e3:g} r {r_low * 1e3:g}-{r_high * 1e3:g} mm"
        for z_low, z_high, r_low, r_high in sections
    )
    yield SpecError(
        f"probe.{probe.name}",
        f'z {probe.z * 1e3:g} mm, r {probe.r * 1e3:g} mm lies outside "{probe.part}".',
        f"Allowed: {listing}.",
    )


def _sections(spec: MachineSpec, part_name: str) -> list[tuple[float, float, float, float]] | None:
    """Meridian rectangles of a part or ring in m, None where they are not known."""
    for part in spec.part:
        if part.name == part_name:
            return [(*item.z, item.inner_diameter / 2.0, item.outer_diameter / 2.0) for item in part.segment]
    bearing_name, _, ring = part_name.rpartition(".")
    for group, bearing in spec.bearings:
        kind: BearingType | None = spec.bearing_types.get(group.type_name(bearing))
        if bearing.name == bearing_name and kind is not None:
            inner = (kind.bore_diameter, kind.inner_ring_outer_diameter)
            outer = (kind.outer_ring_inner_diameter, kind.outer_diameter)
            low, high = inner if ring == "inner_ring" else outer
            return [(*bearing.z, low / 2.0, high / 2.0)]
    return None


def _mesh(spec: MachineSpec, declared: Declared) -> Iterator[SpindleFemError]:
    allowed = (*declared.parts, *(["channel"] if "channel" in declared.tables else []))
    for name in spec.mesh.size:
        if name not in allowed:
            yield _unknown(f"mesh.size.{name}", name, "part", allowed)
