"""Faces of revolution as lines in the meridian plane, and the pieces they are joined from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spindle_fem.machine.geometry.part_shapes import FaceBox, Facing

NANOMETRES = 1.0e9
VOID = -1
AXIS_NAME = ""


def to_nanometres(length: float) -> int:
    """Length in m as whole nanometres.

    >>> to_nanometres(0.019)
    19000000
    """
    return round(length * NANOMETRES)


def in_millimetres(nanometres: int) -> str:
    """Length for a message.

    >>> in_millimetres(2_500_000)
    '2.5 mm'
    """
    return f"{nanometres * 1e-6:g} mm"


def revolved_area(z: tuple[float, float], r: tuple[float, float]) -> float:
    """Area of a cylinder (equal radii) or a plane of revolution between two places, m²."""
    if r[0] == r[1]:
        return 2.0 * np.pi * r[0] * (z[1] - z[0])
    return np.pi * (r[1] ** 2 - r[0] ** 2)


@dataclass(frozen=True, slots=True)
class MeridianEdge:
    """A face of revolution as a line in the meridian plane.

    Attributes
    ----------
    name : str
        Surface or joint; empty on the axis.
    parts : tuple of str
        The part it bounds, or the two parts of a contact in sorted order.
    facings : tuple of {"outward", "inward", "front", "rear"}
        Normal as seen from each of ``parts``.
    z, r : (low, high), [m]
        Equal bounds of ``r`` make a cylinder, of ``z`` a plane.
    """

    name: str
    parts: tuple[str, ...]
    facings: tuple[Facing, ...]
    z: tuple[float, float]
    r: tuple[float, float]

    @property
    def is_contact(self) -> bool:
        """Whether two parts meet here."""
        return len(self.parts) == 2

    @property
    def is_cylinder(self) -> bool:
        """Whether the face is a cylinder (else a plane)."""
        return self.r[0] == self.r[1]

    @property
    def is_axis(self) -> bool:
        """Whether the line lies on the axis and makes no face."""
        return self.r[1] == 0.0

    @property
    def area(self) -> float:
        """Area of the face of revolution without channel and ports, m²."""
        return revolved_area(self.z, self.r)


@dataclass(frozen=True, slots=True)
class Piece:
    """Part of a face between neighbouring grid lines; below and above along its normal."""

    kind: Literal["cylinder", "plane"]
    z: tuple[int, int]
    r: tuple[int, int]
    below: int
    above: int

    @property
    def is_contact(self) -> bool:
        """Whether two parts meet here."""
        return self.below != VOID and self.above != VOID

    @property
    def is_axis(self) -> bool:
        """Whether it lies on the axis."""
        return self.r == (0, 0)

    def is_exposed_of(self, part: int) -> bool:
        """Whether only this part bounds it."""
        return not self.is_contact and not self.is_axis and part in (self.below, self.above)

    def facing(self, of_below: bool) -> Facing:
        """Normal as seen from the part below, or from the one above."""
        if self.kind == "cylinder":
            return "outward" if of_below else "inward"
        return "rear" if of_below else "front"

    def joint_name(self, names: Sequence[str]) -> str:
        """Name of the contact, parts in sorted order."""
        pair = "|".join(sorted((names[self.below], names[self.above])))
        return pair if self.kind == "cylinder" else f"{pair}:face"

    def lies_in(self, box: FaceBox) -> bool:
        """Whether an exposed piece looks the box's way and lies in it."""
        if self.facing(self.above == VOID) != box.facing:
            return False
        for own, bounds in ((self.z, box.z), (self.r, box.r)):
            if bounds is not None and not (
                to_nanometres(bounds[0]) <= own[0] and own[1] <= to_nanometres(bounds[1])
            ):
                return False
        return True

    def describe(self) -> str:
        """Describe this exposed face, for messages."""
        facing = self.facing(self.above == VOID)
        if self.kind == "cylinder":
            return f"the {facing} face r {in_millimetres(self.r[0])}, z {span(self.z)}"
        return f"the {facing} face z {in_millimetres(self.z[0])}, r {span(self.r)}"


def span(bounds: tuple[int, int]) -> str:
    """Range in mm of bounds in nm."""
    return f"{bounds[0] * 1e-6:g} to {in_millimetres(bounds[1])}"


def describe_box(box: FaceBox) -> str:
    """Selector as the user wrote it."""
    text = f'facing "{box.facing}"'
    for key, bounds in (("z", box.z), ("r", box.r)):
        if bounds is not None:
            low, high = (to_nanometres(value) for value in bounds)
            text += f", {key} {in_millimetres(low)}" if low == high else f", {key} {span((low, high))}"
    return text


def list_faces(pieces: list[Piece], part: int, facing: Facing) -> str:
    """Exposed faces of a part that look one way, for messages."""
    faces = [
        piece for piece in pieces if piece.is_exposed_of(part) and piece.facing(piece.above == VOID) == facing
    ]
    if not faces:
        return "none"
    place, along = ("r", "z") if faces[0].kind == "cylinder" else ("z", "r")
    spans: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for low, high, at in sorted((*getattr(piece, along), getattr(piece, place)[0]) for piece in faces):
        # A face is cut wherever a line of the drawing crosses it.
        if spans[at] and spans[at][-1][1] == low:
            low = spans[at].pop()[0]
        spans[at].append((low, high))
    return "; ".join(
        f"{place} {in_millimetres(at)}, {along} {span(ends)}" for at, found in spans.items() for ends in found
    )


def merge_pieces(pieces: list[Piece], labels: list[str], names: Sequence[str]) -> tuple[MeridianEdge, ...]:
    """Join pieces in line that bound the same parts under the same name."""
    meeting: dict[tuple[int, int], list[int]] = defaultdict(list)
    for index, piece in enumerate(pieces):
        meeting[piece.z[0], piece.r[0]].append(index)
        meeting[piece.z[1], piece.r[1]].append(index)

    def signature(index: int) -> tuple[object, ...]:
        piece = pieces[index]
        return piece.kind, piece.below, piece.above, labels[index]

    follows = {}
    for indices in meeting.values():
        if len(indices) == 2 and signature(indices[0]) == signature(indices[1]):
            before, after = sorted(indices, key=lambda index: (pieces[index].z, pieces[index].r))
            follows[before] = after
    started = set(range(len(pieces))) - set(follows.values())
    edges = []
    for first in sorted(started):
        last = first
        while last in follows:
            last = follows[last]
        piece = pieces[first]
        sides = [(names[piece.below], True)] * (piece.below != VOID)
        sides += [(names[piece.above], False)] * (piece.above != VOID)
        sides.sort()
        edges.append(
            MeridianEdge(
                AXIS_NAME if piece.is_axis else labels[first],
                tuple(name for name, _ in sides),
                tuple(piece.facing(below) for _, below in sides),
                (piece.z[0] / NANOMETRES, pieces[last].z[1] / NANOMETRES),
                (piece.r[0] / NANOMETRES, pieces[last].r[1] / NANOMETRES),
            )
        )
    return tuple(edges)
