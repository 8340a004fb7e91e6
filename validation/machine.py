"""The reference spindle as rectangles in the meridian plane, and the grid laid over it.

Dimensions in metres, from the drawing of ``geometry/wu_tan_2016.toml`` and the conventions of
``geometry/recorded_spindle.toml``; written down a second time on purpose, so that a misreading
in one of the two shows.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BEARINGS = ("F1", "F2", "F3", "R1", "R2")
PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05")
CHANNELS = (*PROBES, "COOLANT_OUT")

# name: (z from, z to, r from, r to) in millimetres; later entries never overlap earlier ones.
_ROTATING = {
    "shaft": (
        (0, 45, 30, 90), (45, 137, 30, 70), (137, 157, 30, 82.5), (157, 430, 30, 65),
        (430, 484, 30, 60), (484, 500, 30, 70), (500, 560, 30, 55),
    ),
    "F1.inner": ((45, 69, 70, 79),), "F2.inner": ((69, 93, 70, 79),), "F3.inner": ((113, 137, 70, 79),),
    "R1.inner": ((430, 452, 60, 67.5),), "R2.inner": ((462, 484, 60, 67.5),),
    "front_spacer.inner": ((93, 113, 70, 77),), "rear_spacer.inner": ((452, 462, 60, 66),),
}  # fmt: skip
_STANDING = {
    "housing": (
        (40, 65, 95, 190), (65, 180, 95, 150), (137, 150, 89, 95), (180, 410, 90, 150), (410, 490, 82.5, 130),
    ),
    "cover": ((25, 40, 91, 150),),
    "F1.outer": ((45, 69, 86, 95),), "F2.outer": ((69, 93, 86, 95),), "F3.outer": ((113, 137, 86, 95),),
    "R1.outer": ((430, 452, 75, 82.5),), "R2.outer": ((462, 484, 75, 82.5),),
    "front_spacer.outer": ((93, 113, 88, 95),), "rear_spacer.outer": ((452, 462, 76.5, 82.5),),
}  # fmt: skip
PARTS = (*_ROTATING, *_STANDING)
ROTATING = frozenset(_ROTATING)

_STEEL = (42.0, 7850.0 * 470.0)
_RING_STEEL = (46.0, 7810.0 * 475.0)
_IRON = (50.0, 7200.0 * 500.0)

CHANNEL_INNER, CHANNEL_OUTER, CHANNEL_WIDTH = 0.108, 0.118, 0.012
CHANNEL_PITCH, CHANNEL_START, CHANNEL_TURNS = 0.024, 0.048, 5
CHANNEL_AREA = 0.1562
CHANNEL_LENGTH = 3.552
CHANNEL_HYDRAULIC_DIAMETER = 10.909e-3
FLOW = 20.0e-3 / 60.0

PROBE_PLACES = {
    "SP01": (0.096, 0.057), "SP02": (0.096, 0.081), "SP03": (0.096, 0.125),
    "SP04": (0.091, 0.290), "SP05": (0.0835, 0.457),
}  # fmt: skip
BALL_CAPACITY = {"F": 170.0, "R": 119.0}
BALL_CONDUCTANCE = {"F": 4.0, "R": 3.0}
INNER_SEAT, OUTER_SEAT, AXIAL_CONTACT = 10_000.0, 4_000.0, 8_000.0
OUTSIDE_FILM, FLANGE_BACK_FILM, LABYRINTH_FILM = 10.0, 200.0, 30.0

_R_LINES = (
    30, 40, 48, 55, 60, 65, 66, 67.5, 70, 73, 75, 76.5, 77, 79, 82.5, 84.5, 86, 88, 89, 90, 91, 95, 97, 100,
    105, 108, 113, 118, 121, 125.5, 130, 138, 144, 150, 162, 175, 190,
)  # fmt: skip
_Z_STATIONS = (
    (0, 2), (25, 3), (40, 2), (45, 8), (65, 2), (69, 8), (93, 7), (113, 8), (137, 4), (150, 3), (157, 7),
    (180, 14), (410, 4), (430, 4), (452, 2), (462, 4), (484, 2), (490, 2), (500, 4), (560, 0),
)  # fmt: skip


def standing(part: str) -> tuple[tuple[float, float, float, float], ...]:
    """Rectangles of a part that stands, mm: z from, z to, r from, r to."""
    return _STANDING[part]


def material_of(part: str) -> tuple[float, float]:
    """Conductivity, W/(m K), and volumetric heat capacity, J/(m³ K), of a part."""
    if part in ("housing", "cover"):
        return _IRON
    return _STEEL if part == "shaft" or "spacer" in part else _RING_STEEL


@dataclass(frozen=True, slots=True)
class Deviation:
    """Deviations of a shape that drawings and mounting leave open; all zero is the machine as drawn.

    ``outer`` relative change of the housing's outer radii; ``depth`` of the channel, outwards, and its
    ``shift`` along the axis, m; ``film`` relative change of the film along the helix, by cosines;
    ``probes`` (dr, dz), m.
    """

    outer: float = 0.0
    depth: float = 0.0
    shift: float = 0.0
    film: tuple[float, ...] = ()
    probes: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * len(PROBES)

    def radius(self, drawn: NDArray[np.float64]) -> NDArray[np.float64]:
        """True positions of lines of the drawing, m."""
        knots = np.array([0.0, 0.105, CHANNEL_INNER, CHANNEL_OUTER, 0.121, 0.1255, 0.130, 0.2])
        moved = knots * np.where(knots > 0.1255, 1.0 + self.outer, 1.0)
        moved[2:4] += self.depth
        return np.interp(drawn, knots, moved)

    def film_factor(self, stations: int) -> NDArray[np.float64]:
        """(stations,) film over its mean."""
        along = (np.arange(stations) + 0.5) / stations
        return np.ones(stations) + sum(a * np.cos((k + 1) * np.pi * along) for k, a in enumerate(self.film))


AS_DRAWN = Deviation()


@dataclass(frozen=True, slots=True)
class Grid:
    """Structured grid in r, angle and z with the part of every cell.

    ``part`` is (nr, nz) with −1 for void and an index into ``PARTS`` else; ``wet`` is
    (nr, ntheta, nz), true where the channel was cut out of the housing; ``station`` gives those
    cells' place along the helix, counted in cells of angle from the inlet. ``r_drawn`` is where the drawing
    has the lines that are at ``r``.
    """

    r: NDArray[np.float64]
    r_drawn: NDArray[np.float64]
    z: NDArray[np.float64]
    sectors: int
    part: NDArray[np.int64]
    wet: NDArray[np.bool_]
    station: NDArray[np.int64]
    deviation: Deviation = AS_DRAWN


def _refined(lines: NDArray[np.float64], refine: int) -> NDArray[np.float64]:
    steps = np.arange(refine) / refine
    return np.append((lines[:-1, None] + np.diff(lines)[:, None] * steps).ravel(), lines[-1])


def build_grid(sectors: int = 32, refine: int = 1, deviation: Deviation = AS_DRAWN) -> Grid:
    """Lay the grid; ``refine`` divides every cell in r and z."""
    r = _refined(np.array(_R_LINES) * 1e-3, refine)
    lines = [
        np.linspace(start, stop, number, endpoint=False)
        for (start, number), (stop, _) in itertools.pairwise(_Z_STATIONS)
    ]
    z = _refined(np.append(np.concatenate(lines), _Z_STATIONS[-1][0]) * 1e-3, refine)
    r_mid, z_mid = 0.5 * (r[1:] + r[:-1]), 0.5 * (z[1:] + z[:-1])
    part = np.full((r_mid.size, z_mid.size), -1)
    for number, (_, rectangles) in enumerate((_ROTATING | _STANDING).items()):
        for z0, z1, r0, r1 in rectangles:
            inside_r = (r_mid > r0 * 1e-3) & (r_mid < r1 * 1e-3)
            inside_z = (z_mid > z0 * 1e-3) & (z_mid < z1 * 1e-3)
            part[np.ix_(inside_r, inside_z)] = number
    theta_mid = (np.arange(sectors) + 0.5) / sectors
    station = np.full((r_mid.size, sectors, z_mid.size), -1)
    depth = (r_mid > CHANNEL_INNER) & (r_mid < CHANNEL_OUTER)
    for turn in range(CHANNEL_TURNS):
        centre = CHANNEL_START + deviation.shift + CHANNEL_PITCH * (turn + theta_mid)
        within = np.abs(z_mid[None, :] - centre[:, None]) < 0.5 * CHANNEL_WIDTH
        number = turn * sectors + np.arange(sectors)
        station[depth] = np.where(within, number[:, None], station[depth])
    return Grid(deviation.radius(r), r, z, sectors, part, station >= 0, station, deviation)
