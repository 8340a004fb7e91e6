"""The flange of a housing, from the sizes of its segments, not from names."""

from __future__ import annotations

import math
from collections.abc import Sequence

from spindle_fem.definition.machine_spec import AnnulusSegment, Part

# A segment is a flange where its diameter passes the next largest by this share.
FLANGE_STEP = 1.1


def volume(part: Part) -> float:
    """Volume of a part's segments, m³; fused overlaps count twice."""
    return sum(segment_volume(s) for s in part.segment)


def segment_volume(segment: AnnulusSegment) -> float:
    """Volume of an annulus, m³."""
    area = 0.25 * math.pi * (segment.outer_diameter**2 - segment.inner_diameter**2)
    return area * (segment.z[1] - segment.z[0])


def housing_of(parts: Sequence[Part]) -> Part | None:
    """The largest part that stands."""
    return max((part for part in parts if not part.rotating), key=volume, default=None)


def flange_of(housing: Part | None) -> str:
    """Widest segment of a housing; empty if none is clearly wider than the others."""
    if housing is None or len(housing.segment) < 2:
        return ""
    wide = sorted(housing.segment, key=lambda s: s.outer_diameter)
    stands_out = wide[-1].outer_diameter > FLANGE_STEP * wide[-2].outer_diameter
    return wide[-1].name if stands_out else ""
