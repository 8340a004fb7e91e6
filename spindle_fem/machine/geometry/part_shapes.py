"""Shapes that make up a machine: rings of parts, boxes that pick faces, named surfaces, balls and rollers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Facing = Literal["outward", "inward", "front", "rear"]


@dataclass(frozen=True, slots=True)
class AnnularSegment:
    """A ring of rectangular meridian section, lengths in m."""

    z_start: float
    z_end: float
    inner_radius: float
    outer_radius: float


@dataclass(frozen=True, slots=True)
class PartGeometry:
    """A solid of revolution: its segments fused into one."""

    name: str
    segments: tuple[AnnularSegment, ...]
    rotating: bool = False


@dataclass(frozen=True, slots=True)
class FaceBox:
    """Exposed faces with one orientation that lie between bounds, lengths in m.

    Attributes
    ----------
    facing : {"outward", "inward", "front", "rear"}
        Direction of the normal: +r, -r, -z, +z.
    z, r : (low, high) or None
        A face that lies in the range only in part is split there; None takes
        every face. Select a plane face with equal bounds or a range.
    """

    facing: Facing
    z: tuple[float, float] | None = None
    r: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class SurfaceDefinition:
    """A named exposed surface of one part, the union of its boxes.

    Attributes
    ----------
    key : str
        Key of the definition that gives its place, where that is no ``[[surface]]``.
    """

    name: str
    part: str
    where: tuple[FaceBox, ...]
    key: str = ""


@dataclass(frozen=True, slots=True)
class BallRowGeometry:
    """A row of balls or rollers of a bearing: drawn in the solid model, one temperature in the mesh.

    Attributes
    ----------
    length : float
        Of rollers, m; 0 for balls.
    turned : float, [rad]
        Of the first one.
    first : int
        Its number in the bearing.
    """

    name: str
    z: float
    pitch_radius: float
    ball_diameter: float
    ball_count: int
    length: float = 0.0
    turned: float = 0.0
    first: int = 1

    @property
    def centres(self) -> list[tuple[float, float, float]]:
        """x, y, z of every ball or roller; angle 0 points up (+y)."""
        angles = (self.turned + 2.0 * math.pi * index / self.ball_count for index in range(self.ball_count))
        radius = self.pitch_radius
        return [(-radius * math.sin(angle), radius * math.cos(angle), self.z) for angle in angles]
