"""Segments of different parts that overlap in the meridian plane, told once where they lie together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

from spindle_fem.errors import GeometryError
from spindle_fem.machine.geometry.faces import in_millimetres

# Part, then z and r of a segment, nm.
Box = tuple[int, int, int, int, int]


@dataclass(frozen=True, slots=True)
class Overlap:
    """What two segments share.

    Attributes
    ----------
    boxes, parts : tuple of int
        Of both.
    z, r : (low, high), [nm]
    """

    boxes: tuple[int, int]
    parts: tuple[int, int]
    z: tuple[int, int]
    r: tuple[int, int]

    def is_of_one_cause_with(self, other: Overlap) -> bool:
        """Whether both are of the same two parts, or touch within one segment."""
        if self.parts == other.parts:
            return True
        touch = all(a[0] <= b[1] and b[0] <= a[1] for a, b in ((self.z, other.z), (self.r, other.r)))
        return touch and bool(set(self.boxes) & set(other.boxes))


def overlaps_of(boxes: Sequence[Box]) -> list[Overlap]:
    """Overlaps of segments of different parts."""
    found = []
    for (first, a), (second, b) in combinations(enumerate(boxes), 2):
        z, r = (max(a[1], b[1]), min(a[2], b[2])), (max(a[3], b[3]), min(a[4], b[4]))
        if a[0] != b[0] and z[0] < z[1] and r[0] < r[1]:
            found.append(Overlap((first, second), (a[0], b[0]), z, r))
    return found


def overlap_faults(
    names: Sequence[str], boxes: Sequence[Box], overlaps: Iterable[Overlap]
) -> list[GeometryError]:
    """A fault for each cause: the segment that overlaps most others, the later one of two."""
    groups: list[list[Overlap]] = []
    for overlap in overlaps:
        near = [group for group in groups if any(overlap.is_of_one_cause_with(item) for item in group)]
        groups = [group for group in groups if group not in near]
        groups.append([*(item for group in near for item in group), overlap])
    faults = []
    for group in groups:
        counted = Counter(part for parts in {item.parts for item in group} for part in parts)
        part = max(counted, key=lambda index: (counted[index], index))
        box = next(boxes[number] for item in group for number in item.boxes if boxes[number][0] == part)
        others = sorted({other for item in group for other in item.parts} - {part})
        told = " and ".join(f'"{names[other]}"' for other in others)
        faults.append(
            GeometryError(
                f'part "{names[part]}"',
                f"z {in_millimetres(box[1])} to {in_millimetres(box[2])}, r {in_millimetres(box[3])} to "
                f"{in_millimetres(box[4])} overlaps part{'s' * (len(others) > 1)} {told}.",
                "Parts may touch but not overlap.",
            )
        )
    return faults
