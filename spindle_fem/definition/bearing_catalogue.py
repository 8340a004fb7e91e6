"""Spindle bearings by designation, such as 7014 C: ISO 15 dimensions, balls by an estimating rule."""

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
_ROLLER_SERIES = {"N10": ("0", "10"), "NN30": ("0", "30")}
_ANGLES = {"C": "15 deg", "E": "25 deg", "AC": "25 deg"}
_BALL_STEP = 25.4 / 32.0
_PITCH_FILL = 0.85
_SHOULDER = 0.6

_BALL = re.compile(r"(719|70|72)(\d\d)[ _]?(C|E|AC)([ _/]?HC)?", re.ASCII)
_ROLLER = re.compile(r"(NN30|N10)(\d\d)(?:[ _]?K)?", re.ASCII)
RULE = (
    "boundary dimensions of ISO 15; the largest ball of whole 1/32 in within 0.60 (719) or 0.635 (70, 72) "
    "of the section, on 0.85 of the pitch circle; shoulders 0.6 ball diameters from it; grooves of 0.52"
)

SHIPPED = "Ball bearings that ship: 719xx, 70xx, 72xx with C, E or AC, bores 20 to 200 mm, such as 7014 C."


def boundary_dimensions(designation: str) -> tuple[float, float, float] | None:
    """Bore, outside and width of a bearing in m; None where the designation is not in the catalogue.

    Ball bearings 719xx, 70xx, 72xx and roller bearings N10xx, NN30xx of 20 to
    200 mm. Source: ISO 15, dimension series 19, 10, 02 and 30.

    >>> boundary_dimensions("7014 C")
    (0.07, 0.11, 0.02)
    """
    ball, roller = _BALL.fullmatch(designation), _ROLLER.fullmatch(designation)
    if ball:
        diameter_series, dimension_series, _ = _BALL_SERIES[ball[1]]
        code = ball[2]
    elif roller:
        diameter_series, dimension_series = _ROLLER_SERIES[roller[1]]
        code = roller[2]
    else:
        return None
    bore = 5 * int(code)
    if bore not in _BORES:
        return None
    place = _BORES.index(bore)
    return bore / 1e3, _OUTER[diameter_series][place] / 1e3, _WIDTH[dimension_series][place] / 1e3


def is_roller_bearing(designation: str) -> bool:
    """Whether a designation is one of N10xx or NN30xx, which are known by their boundary dimensions only."""
    return bool(_ROLLER.fullmatch(designation)) and boundary_dimensions(designation) is not None


def catalogue_bearing(designation: str) -> dict[str, Any] | None:
    """Raw ``[bearing_types]`` table of a ball bearing; None where it is not in the catalogue.

    Boundary dimensions and contact angle (C 15, E and AC 25 degrees) are the
    standard's and the series' (marked C). Balls are estimated (marked A): published
    ones of single makers differ by up to a tenth in diameter and two in number.
    ``HC`` at the end: balls of silicon nitride.

    >>> catalogue_bearing("7014 C")["ball_count"]
    19
    """
    match, dimensions = _BALL.fullmatch(designation), boundary_dimensions(designation)
    if match is None or dimensions is None:
        return None
    bore, outer, width = (1e3 * value for value in dimensions)
    fill = _BALL_SERIES[match[1]][2]
    ball = _BALL_STEP * math.floor(fill * 0.5 * (outer - bore) / _BALL_STEP + 1e-9)
    pitch = 0.5 * (bore + outer)
    given = ("bore_diameter", "outer_diameter", "width", "contact_angle", "pitch_diameter")
    return {
        "marks": {"default": "A", **dict.fromkeys(given[:4], "C")},
        "bore_diameter": _millimetres(bore),
        "outer_diameter": _millimetres(outer),
        "width": _millimetres(width),
        "inner_ring_outer_diameter": _millimetres(pitch - _SHOULDER * ball),
        "outer_ring_inner_diameter": _millimetres(pitch + _SHOULDER * ball),
        "ball_diameter": _millimetres(ball),
        "ball_count": round(_PITCH_FILL * math.pi * pitch / ball),
        "pitch_diameter": _millimetres(pitch),
        "contact_angle": _ANGLES[match[3]],
        "groove_curvature_inner": 0.52,
        "groove_curvature_outer": 0.52,
        "ring_material": "bearing_steel",
        "ball_material": "silicon_nitride" if match[4] else "bearing_steel",
    }


def _millimetres(value: float) -> str:
    return f"{round(value, 4):g} mm"
