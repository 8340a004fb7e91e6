"""Joints, outer surfaces and air gaps of a spindle in a workshop, where its definition gives none."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

from pydantic import TypeAdapter, ValidationError

from spindle_fem.definition.bearing_types import BearingType
from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.drawn_tables import part_geometry, ring_geometries, surface_definition
from spindle_fem.definition.exchange_tables import JointGroup, Surface, raceway_surfaces
from spindle_fem.definition.solid_tables import Part, SetBearing
from spindle_fem.machine.geometry.faces import VOID, Piece, in_millimetres
from spindle_fem.machine.geometry.meridian import MeridianMap
from spindle_fem.machine.geometry.part_shapes import PartGeometry, SurfaceDefinition

# Wider ones hold air that moves along the axis too, which no law of an annulus knows.
WIDEST_GAP = 5_000_000
_RIM = -2
# Value, one standard deviation of its logarithm, why. A clearance of 6 µm of air conducts 4000 W/(m²·K).
_JOINTS = {
    "workshop_inner_seats": ("10000 W/m**2/K", 0.3, "inner rings shrunk on"),
    "workshop_outer_seats": ("4000 W/m**2/K", 0.4, "outer rings with some µm of clearance"),
    "workshop_turning_seats": ("8000 W/m**2/K", 0.3, "rotating parts, press fit"),
    "workshop_standing_seats": ("4000 W/m**2/K", 0.4, "stationary parts, some µm of clearance"),
    "workshop_clamped_faces": ("8000 W/m**2/K", 0.3, "clamped ground faces"),
}


@dataclass(frozen=True, slots=True)
class _Drawn:
    """Parts in the meridian plane and the faces that the file has not named."""

    meridian: MeridianMap
    rotating: tuple[bool, ...]
    pieces: tuple[Piece, ...]
    unnamed: tuple[Piece, ...]

    def seen(self, piece: Piece) -> tuple[int, int]:
        """Part that an exposed face looks at, and its distance in nm.

        ``_RIM`` means the room, ``VOID`` a face that sees it through an opening only.
        """
        z_lines, r_lines, owner = self.meridian.z_lines, self.meridian.r_lines, self.meridian.owner
        forward = piece.above == VOID
        if piece.kind == "cylinder":
            column = owner[int(z_lines.searchsorted(piece.z[0])) + 1]
            lines, start = r_lines, int(r_lines.searchsorted(piece.r[0]))
        else:
            column = owner[:, int(r_lines.searchsorted(piece.r[0])) + 1]
            lines, start = z_lines, int(z_lines.searchsorted(piece.z[0]))
        step = range(start + 1, len(column)) if forward else range(start, -1, -1)
        for cell in step:
            if column[cell] != VOID:
                line = lines[cell - 1] if forward else lines[cell]
                return int(column[cell]), abs(int(line - lines[start]))
        if piece.kind == "plane":
            first, beyond = step.start, int(r_lines.searchsorted(piece.r[0])) + 2
            passed = owner[first:] if forward else owner[: first + 1]
            return (VOID if (passed[:, beyond:] != VOID).any() else _RIM), 0
        return _RIM, 0


def add_surroundings(content: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Complete raw tables in place; yield what was taken, as key path and rule.

    Contacts that no ``[[joint]]`` covers join one of five groups; faces that no
    ``[[surface]]`` names and that see the room take natural convection and
    radiation where they stand, rotating films where they turn; turning cylinders
    within 5 mm of a standing one take the annulus law. Other faces are adiabatic. An
    entry of the file with the name of one of these replaces its values.
    """
    drawn = _drawn(content)
    if drawn is None:
        return
    yield from _joints(content, drawn)
    yield from _gaps(content, drawn)
    yield from _films(content, drawn)
    if "remaining_surfaces" not in content:
        content["remaining_surfaces"] = "adiabatic"
        yield "remaining_surfaces", "adiabatic: bores, axial gaps and cavities wider than 5 mm"


def _drawn(content: Mapping[str, Any]) -> _Drawn | None:
    """The sound parts, None where there are none; faulty tables are named by validation."""
    parts: list[PartGeometry] = [part_geometry(part) for part in _sound(Part, content.get("part"))]
    surfaces: list[SurfaceDefinition] = [
        surface_definition(surface) for surface in _sound(Surface, content.get("surface"))
    ]
    for circuit in _sound(CircuitFilm, content.get("film")):
        surfaces += map(surface_definition, circuit.walls)
    types = content.get("bearing_types")
    groups = content.get("bearing_set")
    for group in groups if isinstance(groups, list) else ():
        if not isinstance(group, Mapping):
            continue
        for bearing in _sound(SetBearing, group.get("bearing")):
            name = str(bearing.bearing_type or group.get("bearing_type"))
            for kind in _sound(BearingType, [types.get(name) if isinstance(types, Mapping) else None]):
                parts += ring_geometries(bearing, kind)
                surfaces += map(surface_definition, raceway_surfaces(bearing.name))
    names = [part.name for part in parts]
    if not parts or len(set(names)) < len(names):
        return None
    meridian = MeridianMap.of_parts(parts, surfaces, [])
    pieces = tuple(meridian.boundary_pieces())
    boxes = [(names.index(s.part), box) for s in surfaces if s.part in names for box in s.where]
    unnamed = [
        piece
        for piece in pieces
        if not piece.is_contact
        and not piece.is_axis
        and not any(piece.is_exposed_of(part) and piece.lies_in(box) for part, box in boxes)
    ]
    return _Drawn(meridian, tuple(part.rotating for part in parts), pieces, tuple(unnamed))


def _sound(model: Any, tables: Any) -> Iterator[Any]:
    for table in tables if isinstance(tables, list) else ():
        with contextlib.suppress(ValidationError):
            yield TypeAdapter(model).validate_python(table)


def _joints(content: dict[str, Any], drawn: _Drawn) -> Iterator[tuple[str, str]]:
    names = drawn.meridian.part_names
    given = [pattern for group in _sound(JointGroup, content.get("joint")) for pattern in group.contacts]
    groups: dict[str, list[str]] = {}
    for piece in drawn.pieces:
        if not piece.is_contact or drawn.rotating[piece.below] != drawn.rotating[piece.above]:
            continue
        contact = piece.joint_name(names)
        if any(contact.endswith(":face") == p.endswith(":face") and fnmatchcase(contact, p) for p in given):
            continue
        if piece.kind == "plane":
            name = "workshop_clamped_faces"
        elif ".inner_ring" in contact:
            name = "workshop_inner_seats"
        elif ".outer_ring" in contact:
            name = "workshop_outer_seats"
        else:
            turns = drawn.rotating[piece.below]
            name = "workshop_turning_seats" if turns else "workshop_standing_seats"
        if contact not in groups.setdefault(name, []):
            groups[name].append(contact)
    for name, (value, sigma, why) in _JOINTS.items():
        if name in groups:
            contacts = sorted(groups[name])
            conductance = {"value": value, "sigma_rel": sigma}
            _add(
                content,
                "joint",
                {"name": name, "conductance": conductance, "contacts": contacts, "marks": "A"},
            )
            yield f"joint.{name}", f"{value} ± {100 * sigma:.0f} %, {why}: {', '.join(contacts)}"


def _gaps(content: dict[str, Any], drawn: _Drawn) -> Iterator[tuple[str, str]]:
    """Becker & Kaye's law between turning cylinders and the standing ones around them."""
    names = drawn.meridian.part_names
    standing = {(piece.above, piece.r, piece.z): piece for piece in drawn.unnamed if piece.below == VOID}
    found: dict[tuple[int, int, int, int], list[tuple[Piece, Piece]]] = {}
    for piece in drawn.unnamed:
        if piece.kind != "cylinder" or piece.above != VOID or not drawn.rotating[piece.below]:
            continue
        other, width = drawn.seen(piece)
        radius = piece.r[0] + width
        partner = standing.get((other, (radius, radius), piece.z))
        if partner is not None and not drawn.rotating[other] and width <= WIDEST_GAP:
            found.setdefault((piece.below, other, piece.r[0], radius), []).append((piece, partner))
    made = []
    for number, ((turning, other, inner, outer), pairs) in enumerate(found.items(), 1):
        name = f"workshop_gap_{number}"
        for side, part, pieces in (
            ("turning", turning, [pair[0] for pair in pairs]),
            ("standing", other, [pair[1] for pair in pairs]),
        ):
            _add(content, "surface", _surface(f"{name}.{side}", names[part], pieces))
        gap = {"name": name, "kind": "becker_kaye", "marks": "A"}
        gap |= {"rotating": f"{name}.turning", "standing": [f"{name}.standing"]}
        _add(content, "gap", gap)
        made.append(f"gap.{name}")
        yield (
            f"gap.{name}",
            f"{in_millimetres(outer - inner)} of air between {names[turning]} and {names[other]} at "
            f"{in_millimetres(2 * inner)}, by Becker & Kaye",
        )
    yield from _factor(content, "workshop_gaps", made)


def _films(content: dict[str, Any], drawn: _Drawn) -> Iterator[tuple[str, str]]:
    names = drawn.meridian.part_names
    groups: dict[tuple[int, str, str, int], list[Piece]] = {}
    for piece in drawn.unnamed:
        part = max(piece.below, piece.above)
        inward = piece.kind == "cylinder" and piece.below == VOID
        if inward or drawn.seen(piece)[0] != _RIM:
            continue
        turns = drawn.rotating[part]
        # Films of rotating cylinders depend on their diameter; films of still air hardly depend on size.
        radius = piece.r[1] if turns and piece.kind == "cylinder" else 0
        # The two ends of a part are far apart and seldom equally warm.
        end = piece.facing(piece.above == VOID) if piece.kind == "plane" else ""
        groups.setdefault((part, piece.kind, end, radius), []).append(piece)
    made: dict[bool, list[str]] = {True: [], False: []}
    for (part, kind, end, _), pieces in groups.items():
        turns = drawn.rotating[part]
        name = f"workshop_{names[part]}_{kind}" + (f"_{end}" if end else "")
        number = 1 + sum(other.startswith(f"film.{name}") for other in made[turns])
        name += f"_{number}" if number > 1 else ""
        size = in_millimetres(2 * max(piece.r[1] for piece in pieces))
        film: dict[str, Any] = {"name": name, "surface": [name], "marks": "A"}
        if turns:
            law = "cylinder" if kind == "cylinder" else "disc"
            film |= {"kind": "rotating", "correlation": law, "diameter": size, "minimum": "10 W/m**2/K"}
            shape = "cylinder" if kind == "cylinder" else "end face"
            what = f"rotating {shape} of {size} diameter: {law}, at least 10 W/(m²·K)"
        else:
            law = "horizontal_cylinder" if kind == "cylinder" else "vertical_plate"
            film |= {"kind": "natural_convection_radiation", "orientation": law}
            film |= {"characteristic_length": size, "emissivity": 0.6}
            what = f"still air around {size}, emissivity 0.6 of ground and oiled steel"
        _add(content, "surface", _surface(name, names[part], pieces))
        _add(content, "film", film)
        made[turns].append(f"film.{name}")
        yield f"film.{name}", f"{', '.join(_places(pieces))} of {names[part]}: {what}"
    yield from _factor(content, "workshop_still_air", made[False])
    yield from _factor(content, "workshop_turning_air", made[True])


def _factor(content: dict[str, Any], name: str, coefficients: list[str]) -> Iterator[tuple[str, str]]:
    if coefficients:
        _add(content, "factor", {"name": name, "sigma_rel": 0.3, "applies_to": coefficients, "marks": "A"})
        yield f"factor.{name}", "± 30 % on all of these together"


def _joined(pieces: Iterable[Piece]) -> list[Piece]:
    """Pieces that continue one another as one."""
    joined: list[Piece] = []
    for piece in sorted(pieces, key=lambda p: (p.kind, p.below, p.above, p.r if p.kind == "cylinder" else p.z,
                                               p.z, p.r)):  # fmt: skip
        last = joined[-1] if joined else None
        if last is not None and (last.kind, last.below, last.above) == (piece.kind, piece.below, piece.above):
            if piece.kind == "cylinder" and last.r == piece.r and last.z[1] == piece.z[0]:
                joined[-1] = replace(last, z=(last.z[0], piece.z[1]))
                continue
            if piece.kind == "plane" and last.z == piece.z and last.r[1] == piece.r[0]:
                joined[-1] = replace(last, r=(last.r[0], piece.r[1]))
                continue
        joined.append(piece)
    return joined


def _surface(name: str, part: str, pieces: Iterable[Piece]) -> dict[str, Any]:
    where = []
    for piece in _joined(pieces):
        box: dict[str, Any] = {"facing": piece.facing(piece.above == VOID)}
        for key, (low, high) in (("z", piece.z), ("r", piece.r)):
            ends = [f"{value * 1e-6:.6f} mm" for value in (low, high)]
            box[key] = ends if high > low else ends[0]
        where.append(box)
    return {"name": name, "part": part, "where": where}


def _places(pieces: Iterable[Piece]) -> list[str]:
    return [piece.describe().removeprefix("the ") for piece in _joined(pieces)]


def _add(content: dict[str, Any], key: str, entry: dict[str, Any]) -> None:
    """Append an entry, or lay the file's one of this name over it."""
    entries = content.get(key, [])
    if not isinstance(entries, list):
        return
    own = [item for item in entries if isinstance(item, Mapping) and item.get("name") == entry["name"]]
    if own:
        content[key] = [{**entry, **item} if item is own[0] else item for item in entries]
    else:
        content[key] = [*entries, entry]
