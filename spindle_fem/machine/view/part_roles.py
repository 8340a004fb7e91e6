"""Role of each part of a machine (shaft, housing, flange, ...), from kind and position, not from names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spindle_fem.definition.displacement_tables import FRAME
from spindle_fem.definition.exchange_tables import Gap
from spindle_fem.definition.housing_flange import FLANGE_STEP, flange_of, housing_of, segment_volume, volume
from spindle_fem.definition.machine_spec import AnnulusSegment, MachineSpec, Part, Probe, Surface
from spindle_fem.errors import SpecError, raise_all

# Spot of the wall of the cooling channel.
CHANNEL_WALL = "channel_wall"
# Spot of the shaft between its bearings: a rotor, a drawbar, what runs through the bore.
SHAFT_GAP = "shaft_gap"
# Spot of what faces it: a stator, the bore of the housing.
STANDING_GAP = "standing_gap"


class Layout:
    """Roles of the parts of a machine.

    Parameters
    ----------
    places : set of str
        That the model has.
    """

    def __init__(self, spec: MachineSpec, places: set[str]) -> None:
        self.spec, self.places = spec, places
        ends = [z for _, bearing in spec.bearings for z in bearing.z]
        self.first, self.last = (min(ends), max(ends)) if ends else (0.0, 0.0)
        rotating = [part for part in spec.part if part.rotating]
        self.shaft = max(rotating, key=volume, default=None)
        self.housing = housing_of(spec.part)
        self.flange = self._flange()

    def _flange(self) -> str:
        """Segment of the housing that is its flange; empty without one."""
        return flange_of(self.housing)

    def flange_ends(self) -> tuple[float, float] | None:
        """Both ends of the flange along the axis."""
        if not self.flange:
            return None
        return next(s.z for s in self.housing.segment if s.name == self.flange)

    def segment_place(self, part: Part, segment: str) -> str:
        """Place of a segment; of its part where that is one, or where the mesh has no other."""
        place = f"{part.name}.{segment}"
        return place if place in self.places else part.name

    def place_of_probe(self, probe: Probe) -> str:
        """Place of the largest segment of its part that holds a point probe."""
        part = next(part for part in self.spec.part if part.name == probe.part)
        around = [s for s in part.segment if s.z[0] <= probe.z <= s.z[1] and _holds(s, probe.r)]
        return self.segment_place(part, max(around, key=segment_volume).name) if around else part.name

    def is_spacer(self, part: Part) -> bool:
        """Whether a part lies between the bearings of one set."""
        start, end = extent(part)
        for group in self.spec.bearing_set:
            ends = [z for bearing in group.bearing for z in bearing.z]
            if min(ends) - 1e-9 <= start and end <= max(ends) + 1e-9:
                return True
        return False

    def component_of(self, part: str) -> str:
        """Component that a part belongs to."""
        if self.shaft is not None and part == self.shaft.name:
            return "shaft"
        if self.housing is not None and part == self.housing.name:
            return "housing"
        bearing = part.rpartition(".")[0]
        if bearing:
            return bearing
        found = next(p for p in self.spec.part if p.name == part)
        start, end = extent(found)
        if self.is_spacer(found):
            middle = 0.5 * (start + end)
            group = min(
                self.spec.bearing_set,
                key=lambda g: min(abs(middle - z) for bearing in g.bearing for z in bearing.z),
            )
            return f"{group.name}_bearings"
        if end <= self.first + 1e-9:
            return "nose"
        if start >= self.last - 1e-9:
            return "drive_end"
        return "shaft" if found.rotating else "housing"

    def heat(self) -> dict[str, tuple[str, ...]]:
        """Places of the large components."""
        found: dict[str, tuple[str, ...]] = {}
        if self.shaft is not None:
            found["shaft"] = (self.shaft.name,)
            ahead = [s for s in self.shaft.segment if s.z[1] <= self.first + 1e-9]
            behind = [s for s in self.shaft.segment if s.z[0] >= self.last - 1e-9]
            # The outermost of several segments: what rubs or drives sits at the end.
            if ahead:
                found["nose"] = (self.segment_place(self.shaft, min(ahead, key=lambda s: s.z[0]).name),)
            if behind:
                found["drive_end"] = (self.segment_place(self.shaft, max(behind, key=lambda s: s.z[1]).name),)
            gaps = [g for g in self.gaps() if g.rotating in self.places]
            found[SHAFT_GAP] = tuple(g.rotating for g in gaps) or found["shaft"]
            standing = tuple(name for g in gaps for name in g.standing if name in self.places)
            if standing:
                found[STANDING_GAP] = standing
        for part in self.spec.part:
            # A part that holds the seal at an end of the shaft.
            end = "" if part in (self.shaft, self.housing) else self.component_of(part.name)
            if not part.rotating and end in ("nose", "drive_end") and part.name in self.places:
                found[f"standing_{end}"] = (*found.get(f"standing_{end}", ()), part.name)
        if self.housing is not None:
            found["housing"] = (self.housing.name,)
            if self.flange:
                found["flange"] = (self.segment_place(self.housing, self.flange),)
        if self.spec.channel is not None:
            walls = [f"{self.spec.channel.part}.channel_wall", self.spec.channel.part]
            found["channel"] = (next((w for w in walls if w in self.places), walls[-1]),)
        return found

    def gaps(self) -> list[Gap]:
        """Gaps around the shaft whose air it stirs."""
        return [
            gap
            for gap in self.spec.gap
            if (gap.rise > 0.0 or gap.kind != "power_law") and self._part_of(gap.rotating) == self.shaft.name
        ]

    def _part_of(self, surface: str) -> str:
        return self.surface(surface).part

    def surface(self, name: str) -> Surface:
        """A named surface."""
        return next(s for s in self.spec.all_surfaces if s.name == name)

    def is_flange_back(self, surface: Surface) -> bool:
        """Whether a surface is only a plane end of the flange, the face bolted to a frame."""
        ends = self.flange_ends()
        if ends is None or surface.part != self.housing.name:
            return False
        return (
            all(
                where.facing in ("front", "rear")
                and where.z is not None
                and any(abs(z - end) < 1e-6 for z in _both(where.z) for end in ends)
                for where in surface.where
            )
            and len(surface.where) == 1
        )

    def end_of(self, surface: Surface) -> str:
        """End of the shaft that a rotating surface belongs to; empty in between."""
        middle = self._middle(surface)
        if middle is None:
            return ""
        if middle <= self.first:
            return "nose"
        return "drive_end" if middle >= self.last else ""

    def _middle(self, surface: Surface) -> float | None:
        """Mean place of a surface along the axis."""
        part = next((p for p in self.spec.part if p.name == surface.part), None)
        found = []
        for where in surface.where:
            if where.z is not None:
                found.append(float(np.mean(_both(where.z))))
            elif part is not None:
                radius = None if where.r is None else float(np.mean(_both(where.r)))
                fitting = [
                    s for s in part.segment if radius is None or abs(0.5 * s.outer_diameter - radius) < 1e-6
                ]
                found += [float(np.mean(s.z)) for s in fitting]
        return float(np.mean(found)) if found else None


def _both(value: float | Sequence[float]) -> tuple[float, ...]:
    return (float(value),) if isinstance(value, (int, float)) else tuple(float(v) for v in value)


def _holds(segment: AnnulusSegment, radius: float) -> bool:
    return segment.inner_diameter <= 2.0 * radius <= segment.outer_diameter


def extent(part: Part) -> tuple[float, float]:
    """Both ends of a part along the axis, m."""
    return min(s.z[0] for s in part.segment), max(s.z[1] for s in part.segment)


def require_mounts(layout: Layout) -> None:
    """Refuse displacement sensors on a flange where there is none, or on a segment that is no flange.

    Raises
    ------
    SpecError or FaultsError
    """
    surfaces, faults = {surface.name for surface in layout.spec.surface}, []
    segments = {s.name for part in layout.spec.part for s in part.segment}
    for sensor in layout.spec.displacement_sensor:
        # names that are nothing are refused as the definition is read
        if not isinstance(sensor.mount, str) or sensor.mount not in {FRAME, *segments} - surfaces:
            continue
        if not layout.flange or sensor.mount not in (layout.flange, FRAME):
            named = f"{layout.flange}, {FRAME}, " if layout.flange else ""
            what = (
                f'"{sensor.mount}" is not the flange of the housing.'
                if layout.flange
                else f"the housing has no flange: no segment is {FLANGE_STEP:g} times as wide as all others."
            )
            fix = f"Allowed: {named}a surface of a standing part, or z and radius of a spot on it."
            faults.append(SpecError(f"displacement_sensor.{sensor.name}.mount", what, fix))
    raise_all(layout.spec.name, faults)
