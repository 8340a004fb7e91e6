"""Faces, contacts and faults of solids of revolution, found in the meridian plane.

Coordinates are whole nanometres, so that touching is equality.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError, did_you_mean
from spindle_fem.machine.geometry.faces import (
    VOID,
    MeridianEdge,
    Piece,
    describe_box,
    in_millimetres,
    list_faces,
    merge_pieces,
    to_nanometres,
)
from spindle_fem.machine.geometry.overlaps import overlap_faults, overlaps_of
from spindle_fem.machine.geometry.part_shapes import FaceBox, PartGeometry, SurfaceDefinition

# Lengths beyond which nothing is drawn, nm.
LARGEST = 10**12


@dataclass(frozen=True, slots=True)
class MeridianMap:
    """Owner of each cell of the grid spanned by all part coordinates.

    Attributes
    ----------
    z_lines, r_lines : (n,), (m,) int64 ndarray, [nm]
    owner : (n + 1, m + 1) int32 ndarray
        Part of the cell below each pair of lines, VOID outside; the rim of
        cells around the grid is VOID.
    cut : mapping of str to list of (z low, z high, r low, r high), [nm]
        Segments that other parts overlap, whose faces are not where they are drawn.
    """

    part_names: tuple[str, ...]
    z_lines: NDArray[np.int64]
    r_lines: NDArray[np.int64]
    owner: NDArray[np.int32]
    cut: Mapping[str, list[tuple[int, int, int, int]]]

    @classmethod
    def of_parts(
        cls,
        parts: Sequence[PartGeometry],
        surfaces: Sequence[SurfaceDefinition],
        faults: list[GeometryError],
    ) -> MeridianMap:
        """Build the map; degenerate segments and overlapping parts go to ``faults``."""
        names = tuple(part.name for part in parts)
        boxes = []
        for index, part in enumerate(parts):
            for segment in part.segments:
                bounds = [
                    to_nanometres(value)
                    for value in (segment.z_start, segment.z_end, segment.inner_radius, segment.outer_radius)
                ]
                if _check_segment(part.name, bounds, faults):
                    boxes.append((index, *bounds))
        z_values = {value for box in boxes for value in box[1:3]}
        r_values = {value for box in boxes for value in box[3:5]} | {0}
        for surface in surfaces:
            for box in surface.where:
                z_values.update(_within(to_nanometres(value), -LARGEST) for value in box.z or ())
                r_values.update(_within(to_nanometres(value), 0) for value in box.r or ())
        z_lines = np.array(sorted(z_values), dtype=np.int64)
        r_lines = np.array(sorted(r_values), dtype=np.int64)
        owner = np.full((len(z_lines) + 1, len(r_lines) + 1), VOID, dtype=np.int32)
        for index, z_start, z_end, inner, outer in boxes:
            cells = (
                slice(*(np.searchsorted(z_lines, (z_start, z_end)) + 1)),
                slice(*(np.searchsorted(r_lines, (inner, outer)) + 1)),
            )
            block = owner[cells]
            block[block == VOID] = index
        regions = overlaps_of(boxes)
        faults += overlap_faults(names, boxes, regions)
        cut: dict[str, list[tuple[int, int, int, int]]] = defaultdict(list)
        for number in sorted({number for region in regions for number in region.boxes}):
            index, *box = boxes[number]
            cut[names[index]].append(tuple(box))
        return cls(names, z_lines, r_lines, owner, cut)

    def named_edges(
        self,
        surfaces: Sequence[SurfaceDefinition],
        remaining: Literal["adiabatic", "error"],
        faults: list[GeometryError],
    ) -> tuple[MeridianEdge, ...]:
        """Name every face and join neighbours of one name into edges.

        Parts that float, come apart or pinch, selectors that match nothing and
        faces claimed twice go to ``faults``.
        """
        pieces = self.boundary_pieces()
        self._check_connection(pieces, faults)
        labels = self._label(pieces, surfaces, remaining, faults)
        return merge_pieces(pieces, labels, self.part_names)

    def faults_of_sound_parts(
        self,
        surfaces: Sequence[SurfaceDefinition],
        sound: Collection[str],
        faults: list[GeometryError],
    ) -> None:
        """Sound parts that come apart or pinch, and surfaces on them that match nothing."""
        self._check_bodies(sound, faults)
        own = [surface for surface in surfaces if surface.part in sound]
        self._label(self.boundary_pieces(), own, "adiabatic", faults)

    def check_seats(self, seats: Mapping[str, float], faults: list[GeometryError]) -> None:
        """Rings that touch nothing at the radius [m] of their seat, by what lies nearest to it.

        A ring that overlaps what it should sit on is a fault of its own.
        """
        loose: dict[str, list[str]] = defaultdict(list)
        for name, radius in seats.items():
            seat = to_nanometres(radius)
            if name not in self.part_names or seat not in self.r_lines:
                continue
            above = int(np.searchsorted(self.r_lines, seat)) + 1
            part = self.part_names.index(name)
            outwards = part in self.owner[:, above]
            own, other = (above, above - 1) if outwards else (above - 1, above)
            along = np.flatnonzero(self.owner[:, own] == part)
            if not along.size or np.any(self.owner[along, other] != VOID):
                continue
            beyond = self.owner[along[0], :above][::-1] if outwards else self.owner[along[0], above:]
            away = int(np.argmax(beyond != VOID))
            near = "nothing lies there"
            if beyond[away] != VOID:
                line = self.r_lines[above - 1 - away if outwards else above - 1 + away]
                near = f'part "{self.part_names[beyond[away]]}" ends at r {in_millimetres(line)} there'
            loose[f"{near}, the seat is at r {in_millimetres(seat)}."].append(f'"{name}"')
        for near, rings in loose.items():
            word, verb = ("part", "sits") if len(rings) == 1 else ("parts", "sit")
            where, what = f"{word} {', '.join(rings)}", f"{verb} on nothing: {near}"
            faults.append(GeometryError(where, what, "Allowed: rings that touch the parts that carry them."))

    def cell_boxes(self) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Bounds (z low, z high, r low, r high) in nm and owner of every cell.

        The rim reaches ten metres out.
        """
        far = 10_000_000_000
        z_edges = np.concatenate(([self.z_lines[0] - far], self.z_lines, [self.z_lines[-1] + far]))
        r_edges = np.concatenate(([-far], self.r_lines, [self.r_lines[-1] + far]))
        z_index, r_index = np.indices(self.owner.shape)
        boxes = np.stack(
            [z_edges[z_index], z_edges[z_index + 1], r_edges[r_index], r_edges[r_index + 1]], axis=-1
        )
        # Below the axis there is nothing to break into.
        inside = (r_index > 0).ravel()
        return boxes.reshape(-1, 4)[inside], self.owner.ravel()[inside]

    def boundary_pieces(self) -> list[Piece]:
        """Faces and contacts, cut wherever a line of the drawing crosses them."""
        pieces = []
        owner = self.owner
        for low, high in zip(*np.nonzero(owner[:, 1:] != owner[:, :-1]), strict=True):
            pieces.append(
                Piece(
                    "cylinder",
                    (self.z_lines[low - 1].item(), self.z_lines[low].item()),
                    (self.r_lines[high].item(),) * 2,
                    owner[low, high].item(),
                    owner[low, high + 1].item(),
                )
            )
        for low, high in zip(*np.nonzero(owner[1:] != owner[:-1]), strict=True):
            pieces.append(
                Piece(
                    "plane",
                    (self.z_lines[low].item(),) * 2,
                    (self.r_lines[high - 1].item(), self.r_lines[high].item()),
                    owner[low, high].item(),
                    owner[low + 1, high].item(),
                )
            )
        return pieces

    def _check_connection(self, pieces: list[Piece], faults: list[GeometryError]) -> None:
        touching = {part for piece in pieces if piece.is_contact for part in (piece.below, piece.above)}
        for index, name in enumerate(self.part_names):
            cells = self.owner == index
            if not cells.any():
                continue
            if len(self.part_names) > 1 and index not in touching:
                what = f"touches no other part; {self._nearest(index)}."
                faults.append(GeometryError(f'part "{name}"', what, "Allowed: parts with a face in contact."))
        self._check_bodies(self.part_names, faults)

    def _nearest(self, part: int) -> str:
        """The other part that is nearest to one, and how far along the axis and outwards."""
        boxes, owner = self.cell_boxes()
        own, others = boxes[owner == part, None], boxes[(owner != part) & (owner != VOID)]
        gaps = np.stack([others[..., ::2] - own[..., 1::2], own[..., ::2] - others[..., 1::2]]).max(axis=0)
        away = np.maximum(gaps, 0)
        first, second = np.unravel_index(np.argmin(np.hypot(*np.moveaxis(away, -1, 0))), away.shape[:2])
        name = self.part_names[owner[(owner != part) & (owner != VOID)][second]]
        far = [
            f"{in_millimetres(value)} away {way}"
            for value, way in zip(away[first, second], ("along z", "along r"), strict=True)
            if value
        ]
        return f'the nearest, part "{name}", is {" and ".join(far)}'

    def _check_bodies(self, names: Collection[str], faults: list[GeometryError]) -> None:
        from scipy.ndimage import label

        for index, name in enumerate(self.part_names):
            cells = self.owner == index
            if name not in names or not cells.any():
                continue
            _, number = label(cells)
            if number > 1:
                faults.append(
                    GeometryError(
                        f'part "{name}"',
                        f"comes apart into {number} bodies.",
                        "Allowed: segments that share a face.",
                    )
                )
            diagonal = (cells[1:, 1:] & cells[:-1, :-1] & ~cells[1:, :-1] & ~cells[:-1, 1:]) | (
                cells[1:, :-1] & cells[:-1, 1:] & ~cells[1:, 1:] & ~cells[:-1, :-1]
            )
            for z_index, r_index in zip(*np.nonzero(diagonal), strict=True):
                faults.append(
                    GeometryError(
                        f'part "{name}"',
                        f"has zero thickness at z {in_millimetres(self.z_lines[z_index])}, "
                        f"r {in_millimetres(self.r_lines[r_index])}, where segments meet in an edge only.",
                        "Allowed: segments that share a face.",
                    )
                )

    def _is_cut(self, part: str, box: FaceBox) -> bool:
        """Whether a box lies in a segment that another part overlaps."""
        return any(
            all(
                bounds is None or (low <= to_nanometres(bounds[0]) and to_nanometres(bounds[1]) <= high)
                for bounds, (low, high) in ((box.z, segment[:2]), (box.r, segment[2:]))
            )
            for segment in self.cut.get(part, ())
        )

    def _label(
        self,
        pieces: list[Piece],
        surfaces: Sequence[SurfaceDefinition],
        remaining: Literal["adiabatic", "error"],
        faults: list[GeometryError],
    ) -> list[str]:
        names = self.part_names
        labels = [piece.joint_name(names) if piece.is_contact else "" for piece in pieces]
        written = {surface.name: surface.key or f'surface "{surface.name}"' for surface in surfaces}
        claimed_twice: set[tuple[str, str]] = set()
        unmatched: list[tuple[SurfaceDefinition, int]] = []
        for surface in surfaces:
            if surface.part not in names:
                faults.append(
                    GeometryError(
                        f'surface "{surface.name}"',
                        f'part "{surface.part}" does not exist.',
                        did_you_mean(surface.part, names),
                    )
                )
                continue
            part = names.index(surface.part)
            for number, box in enumerate(surface.where):
                hits = [
                    index
                    for index, piece in enumerate(pieces)
                    if piece.is_exposed_of(part) and piece.lies_in(box)
                ]
                whole = not surface.key or _covers([pieces[index] for index in hits], box)
                if not (hits and whole) and not self._is_cut(surface.part, box):
                    unmatched.append((surface, number))
                for index in hits:
                    if labels[index] not in ("", surface.name):
                        claimed_twice.add((written[labels[index]], written[surface.name]))
                    else:
                        labels[index] = surface.name
        for group in _in_rows(unmatched):
            surface, number = group[0]
            box, last = surface.where[number], group[-1][0]
            ends = [] if box.z is None else sorted((*box.z, *last.where[number].z))
            what, fails = written[surface.name], "matches no exposed face"
            places = describe_box(replace(box, z=(ends[0], ends[-1]) if ends else None))
            if surface.key:
                what = _key_at_fault(surface, box, pieces, names.index(surface.part))
                fails = "is not all an exposed face" if what.endswith(".z") else fails
            elif last is surface:
                what += f", where[{number + 1}]"
            else:
                what += f' to "{last.name}"'
            faults.append(
                GeometryError(
                    what,
                    f'{places} {fails} of part "{surface.part}".',
                    f"Allowed: faces that look {box.facing}: "
                    f"{list_faces(pieces, names.index(surface.part), box.facing)}.",
                )
            )
        for first, second in sorted(claimed_twice):
            faults.append(
                GeometryError(
                    second,
                    f"claims a face that {first} has already.",
                    "Allowed: each face in one surface.",
                )
            )
        for index, piece in enumerate(pieces):
            if labels[index] == "" and not piece.is_axis:
                part = names[max(piece.below, piece.above)]
                labels[index] = f"{part}.adiabatic"
                if remaining == "error":
                    faults.append(
                        GeometryError(
                            f'part "{part}"',
                            f"{piece.describe()} belongs to no surface.",
                            'Name it in a [[surface]], or set remaining_surfaces = "adiabatic".',
                        )
                    )
        return labels


def _covers(pieces: Iterable[Piece], box: FaceBox) -> bool:
    """Whether cylinders fill the length of a box along the axis."""
    if box.z is None:
        return True
    low, high = map(to_nanometres, box.z)
    return sum(piece.z[1] - piece.z[0] for piece in pieces) == high - low


def _key_at_fault(surface: SurfaceDefinition, box: FaceBox, pieces: Sequence[Piece], part: int) -> str:
    """Key of the diameter that no face has, or of the z where one has it."""
    radii = {piece.r for piece in pieces if piece.is_exposed_of(part) and piece.kind == "cylinder"}
    right = box.r is not None and tuple(map(to_nanometres, box.r)) in radii
    return surface.key.rpartition(".")[0] + ".z" if right else surface.key


def _in_rows(
    unmatched: Sequence[tuple[SurfaceDefinition, int]],
) -> list[list[tuple[SurfaceDefinition, int]]]:
    """Surfaces and the places of boxes in them, those of one wall that is cut along z together."""
    rows: list[list[tuple[SurfaceDefinition, int]]] = []
    ends: dict[object, list[tuple[SurfaceDefinition, int]]] = {}
    for surface, number in unmatched:
        box, (base, _, cell) = surface.where[number], surface.name.rpartition(".")
        wall = (base if cell.isdigit() else surface.name, surface.part, number, box.facing, box.r)
        # Cells follow the flow, which may go either way.
        z = () if box.z is None else tuple(map(to_nanometres, box.z))
        row = next((ends[*wall, end] for end in z if (*wall, end) in ends), None)
        if row is None or not cell.isdigit():
            row = []
            rows.append(row)
        row.append((surface, number))
        ends |= {(*wall, end): row for end in z}
    return rows


def _within(nanometres: int, least: int) -> int:
    """A bound of what a box picks, at the ends of what there can be."""
    return max(least, min(nanometres, LARGEST))


def _check_segment(part: str, bounds: list[int], faults: list[GeometryError]) -> bool:
    z_start, z_end, inner, outer = bounds
    where = f'part "{part}"'
    if z_end <= z_start or outer <= inner:
        faults.append(
            GeometryError(
                where,
                f"a segment z {in_millimetres(z_start)} to {in_millimetres(z_end)}, "
                f"r {in_millimetres(inner)} to {in_millimetres(outer)} has no thickness.",
                "Allowed: z and r that grow.",
            )
        )
        return False
    if max(map(abs, bounds)) > LARGEST:
        faults.append(
            GeometryError(where, f"a segment ends {max(bounds) / 1e9:.3g} m away.", "Allowed: up to 1 km.")
        )
        return False
    if inner < 0:
        faults.append(
            GeometryError(where, f"inner radius is {in_millimetres(inner)}.", "Allowed: 0 mm or more.")
        )
        return False
    return True
