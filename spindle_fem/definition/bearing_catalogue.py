"""Spindle bearings by designation, such as 7014 C, NN3014 K: ISO 15 dimensions, balls and rollers by rule."""

from __future__ import annotations

import math
import re
from typing import Any

# Outer diameter and width in mm over the bore, by diameter series of ISO 15 (dimension series 19, 10, 02, and
# 30 for the widths of double-row roller bearings), 20 to 200 mm.
_BORES = (
    20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85, 90, 95, 100, 105, 110, 120, 130, 140, 150, 160,
    170, 180, 190, 200,
)  # fmt: skip
_OUTER = {
    "9": (37, 42, 47, 55, 62, 68, 72, 80, 85, 90, 100, 105, 110, 120, 125, 130, 140, 145, 150, 165, 180, 190,
          210, 220, 230, 250, 260, 280),
    "0": (42, 47, 55, 62, 68, 75, 80, 90, 95, 100, 110, 115, 125, 130, 140, 145, 150, 160, 170, 180, 200, 210,
          225, 240, 260, 280, 290, 310),
    "2": (47, 52, 62, 72, 80, 85, 90, 100, 110, 120, 125, 130, 140, 150, 160, 170, 180, 190, 200, 215, 230,
          250, 270, 290, 310, 320, 340, 360),
}  # fmt: skip
_WIDTH = {
    "19": (9, 9, 9, 10, 12, 12, 12, 13, 13, 13, 16, 16, 16, 18, 18, 18, 20, 20, 20, 22, 24, 24, 28, 28, 28,
           33, 33, 38),
    "10": (12, 12, 13, 14, 15, 16, 16, 18, 18, 18, 20, 20, 22, 22, 24, 24, 24, 26, 28, 28, 33, 33, 35, 38, 42,
           46, 46, 51),
    "02": (14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 28, 30, 32, 34, 36, 38, 40, 40, 42, 45, 48, 52,
           52, 55, 58),
    "30": (16, 16, 19, 20, 21, 23, 23, 26, 26, 26, 30, 30, 34, 34, 37, 37, 37, 41, 45, 46, 52, 53, 56, 60, 67,
           74, 75, 82),
}  # fmt: skip
# Designation prefix: diameter series, dimension series, most of the section's height that the ball fills.
_BALL_SERIES = {"719": ("9", "19", 0.60), "70": ("0", "10", 0.635), "72": ("2", "02", 0.635)}
# Designation prefix: diameter series, dimension series, rows.
_ROLLER_SERIES = {"N10": ("0", "10", 1), "NN30": ("0", "30", 2)}
# Conrad bearings: the balls enter while they fill so much of the circle.
_GROOVE_SERIES = {"60": ("0", "10", 0.60), "62": ("2", "02", 0.60)}
_ASSEMBLY_ARC = 195.0 / 360.0
_GROOVE_CLEARANCE = "10 um"
_ANGLES = {"C": "15 deg", "E": "25 deg", "AC": "25 deg"}
_BALL_STEP = 25.4 / 32.0
_PITCH_FILL = 0.85
_SHOULDER = 0.6
# Shares of the section's height: outer ring, whose raceway has no ribs in N and NN designs, and rollers.
_OUTER_WALL = 0.25
_ROLLER = 0.45
# Bearing length between the relieved edges, as a share of the rollers' length, which equals their diameter.
_BEARING_LENGTH = 0.9

_BALL = re.compile(r"(719|70|72)(\d\d)[ _]?(C|E|AC)([ _/]?HC)?", re.ASCII)
_GROOVE = re.compile(r"(60|62)(\d\d)([ _/]?HC)?", re.ASCII)
_ROLLERS = re.compile(r"(NN30|N10)(\d\d)(?:[ _]?K)?([ _/]?HC)?", re.ASCII)
RULE = (
    "boundary dimensions of ISO 15; ball diameter the largest multiple of 1/32 inch of at most 0.60 "
    "(series 719) or 0.635 (series 70, 72) of the section's height, as many balls as fill 0.85 of the "
    "pitch circle; shoulders 0.6 ball diameters from the pitch circle; groove radii of 0.52 ball diameters"
)

GROOVE_RULE = (
    "boundary dimensions of ISO 15; ball diameter the largest multiple of 1/32 inch of at most 0.60 of "
    "the section's height, as many balls as fill an arc of 195 degrees and one more; shoulders 0.6 ball "
    "diameters from the pitch circle; groove radii of 0.52 ball diameters"
)

ROLLER_RULE = (
    "boundary dimensions of ISO 15; the outer raceway a quarter of the section's height inside the outside "
    "diameter; rollers of whole millimetres nearest to 0.45 of the section's height, as long as thick, 0.9 "
    "of that length bearing, as many as fill 0.85 of the pitch circle"
)

# N/mm² of the pitch circle's square: heavy preload of a pair with 15 and with 25 degrees, by series.
_HEAVY_PRELOAD = {"719": (0.112, 0.158), "70": (0.1585, 0.215), "72": (0.208, 0.284)}
PRELOAD_CLASSES = {"light": 1.0 / 4.5, "medium": 0.5, "heavy": 1.0}
PRELOAD_RULE = (
    "heavy: 0.112, 0.1585, 0.208 N/mm² (C), 0.158, 0.215, 0.284 N/mm² (E, AC) of the pitch diameter squared "
    "for 719, 70, 72; medium half, light 1/4.5 of it, fitted to IBC TI-I-5050.0 (2010); larger sets by "
    "the force that closes them by the same distance as a pair"
)

SHIPPED = (
    "Bearings that ship: 719xx, 70xx, 72xx with C, E or AC, such as 7014 C, N10xx and NN30xx, such as "
    "NN3014 K, 60xx and 62xx, such as 6014, bores 20 to 200 mm."
)


def boundary_dimensions(designation: str) -> tuple[float, float, float] | None:
    """Bore, outside and width of a bearing in m; None where the designation is not in the catalogue.

    Ball bearings 719xx, 70xx, 72xx and roller bearings N10xx, NN30xx of 20 to
    200 mm. Source: ISO 15, dimension series 19, 10, 02 and 30.

    >>> boundary_dimensions("7014 C")
    (0.07, 0.11, 0.02)
    """
    ball, roller = _BALL.fullmatch(designation), _ROLLERS.fullmatch(designation)
    groove = _GROOVE.fullmatch(designation)
    if groove:
        diameter_series, dimension_series, _ = _GROOVE_SERIES[groove[1]]
        code = groove[2]
    elif ball:
        diameter_series, dimension_series, _ = _BALL_SERIES[ball[1]]
        code = ball[2]
    elif roller:
        diameter_series, dimension_series, _ = _ROLLER_SERIES[roller[1]]
        code = roller[2]
    else:
        return None
    bore = 5 * int(code)
    if bore not in _BORES:
        return None
    place = _BORES.index(bore)
    return bore / 1e3, _OUTER[diameter_series][place] / 1e3, _WIDTH[dimension_series][place] / 1e3


def catalogue_bearing(designation: str) -> dict[str, Any] | None:
    """Raw ``[bearing_types]`` table of a bearing; None where it is not in the catalogue.

    Boundary dimensions and contact angle (C 15, E and AC 25 degrees) are the
    standard's and the series' (marked C). Balls and rollers are estimated (marked A): published
    ones of single makers differ by up to a tenth in diameter and two in number.
    ``HC`` at the end: balls or rollers of silicon nitride.

    >>> catalogue_bearing("7014 C")["ball_count"], catalogue_bearing("NN3014 K")["roller_diameter"]
    (19, '9 mm')
    """
    dimensions = boundary_dimensions(designation)
    if dimensions is None:
        return None
    ball, roller = _BALL.fullmatch(designation), _ROLLERS.fullmatch(designation)
    bore, outer, width = (1e3 * value for value in dimensions)
    if groove := _GROOVE.fullmatch(designation):
        table = _groove_balls(groove, bore, outer)
    else:
        table = _balls(ball, bore, outer) if ball else _rollers(roller, bore, outer)
    boundary = {"bore_diameter": bore, "outer_diameter": outer, "width": width}
    given = [key for key in ("contact_angle", "rows") if key in table]
    return {
        "marks": {"default": "A", **dict.fromkeys((*boundary, *given), "C")},
        **{key: _millimetres(value) for key, value in boundary.items()},
        **table,
        "ring_material": "bearing_steel",
    }


def preload_of_class(designation: str, name: str) -> float | None:
    """Preload of a pair of ball bearings in a class, N; None of what is no ball bearing of the catalogue.

    Classes of makers differ by half; these are IBC's (L, M, H).

    >>> round(preload_of_class("7020 C", "heavy"))
    2477
    """
    match, dimensions = _BALL.fullmatch(designation), boundary_dimensions(designation)
    if match is None or dimensions is None:
        return None
    pitch = 0.5e3 * (dimensions[0] + dimensions[1])
    heavy = _HEAVY_PRELOAD[match[1]][0 if match[3] == "C" else 1] * pitch**2
    return PRELOAD_CLASSES[name] * heavy


def estimated(table: dict[str, Any]) -> str:
    """Balls or rollers of a completed table in words, with the rule of those that were estimated."""
    if "roller_count" in table:
        size = f"{table['roller_diameter']} x {table['roller_length']}"
        return f"{table.get('rows', 1)} x {table['roller_count']} rollers of {size}; {ROLLER_RULE}"
    rule = GROOVE_RULE if table.get("kind") == "deep_groove_ball" else RULE
    return f"{table['ball_count']} balls of {table['ball_diameter']}; {rule}"


def _balls(match: re.Match[str], bore: float, outer: float) -> dict[str, Any]:
    """Keys of a ball bearing beyond its boundary dimensions (mm)."""
    ball, pitch = _ball_and_pitch(_BALL_SERIES[match[1]][2], bore, outer)
    return {
        "ball_count": round(_PITCH_FILL * math.pi * pitch / ball),
        "contact_angle": _ANGLES[match[3]],
        **_ball_sizes(ball, pitch, hybrid=bool(match[4])),
    }


def _groove_balls(match: re.Match[str], bore: float, outer: float) -> dict[str, Any]:
    """Keys of a deep-groove ball bearing beyond its boundary dimensions (mm)."""
    ball, pitch = _ball_and_pitch(_GROOVE_SERIES[match[1]][2], bore, outer)
    return {
        "kind": "deep_groove_ball",
        "ball_count": math.floor(_ASSEMBLY_ARC * math.pi / math.asin(ball / pitch) + 1.0),
        "radial_clearance": _GROOVE_CLEARANCE,
        **_ball_sizes(ball, pitch, hybrid=bool(match[3])),
    }


def _ball_and_pitch(fill: float, bore: float, outer: float) -> tuple[float, float]:
    """Ball and pitch circle of a section, mm."""
    return _BALL_STEP * math.floor(fill * 0.5 * (outer - bore) / _BALL_STEP + 1e-9), 0.5 * (bore + outer)


def _ball_sizes(ball: float, pitch: float, *, hybrid: bool) -> dict[str, Any]:
    """Keys that all ball bearings have, of sizes in mm."""
    return {
        "inner_ring_outer_diameter": _millimetres(pitch - _SHOULDER * ball),
        "outer_ring_inner_diameter": _millimetres(pitch + _SHOULDER * ball),
        "ball_diameter": _millimetres(ball),
        "pitch_diameter": _millimetres(pitch),
        "groove_curvature_inner": 0.52,
        "groove_curvature_outer": 0.52,
        "ball_material": "silicon_nitride" if hybrid else "bearing_steel",
    }


def _rollers(match: re.Match[str], bore: float, outer: float) -> dict[str, Any]:
    """Keys of a cylindrical roller bearing beyond its boundary dimensions (mm)."""
    section = 0.5 * (outer - bore)
    raceway = outer - 2.0 * _OUTER_WALL * section
    roller = math.floor(_ROLLER * section + 0.5)
    pitch = raceway - roller
    return {
        "kind": "cylindrical_roller",
        "inner_ring_outer_diameter": _millimetres(pitch - roller),
        "outer_ring_inner_diameter": _millimetres(raceway),
        "roller_diameter": _millimetres(roller),
        "roller_length": _millimetres(_BEARING_LENGTH * roller),
        "roller_count": round(_PITCH_FILL * math.pi * pitch / roller),
        "rows": _ROLLER_SERIES[match[1]][2],
        "pitch_diameter": _millimetres(pitch),
        "roller_material": "silicon_nitride" if match[3] else "bearing_steel",
    }


def _millimetres(value: float) -> str:
    return f"{round(value, 4):g} mm"
