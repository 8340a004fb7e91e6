"""A narrow annulus: a jacket, around a stator, or a gap whose inner wall turns."""

from __future__ import annotations

import math

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection, DuctShape

# Inner over outer diameter above which the slit's numbers hold within 2 %.
NARROW = 0.5


@DUCT_KINDS.register
def annulus(shape: DuctShape) -> DuctSection:
    """Section of an annulus with both walls wetted, its laminar numbers those of the slit.

    Raises
    ------
    OutOfValidityError
        No outer diameter, or one beyond twice the inner.

    Source: Shah & London (1978), Laminar Flow Forced Convection in Ducts: f Re = 96,
    Nu = 7.541 for the slit with both walls at one temperature.

    >>> round(annulus(DuctShape(0.10, 0.2, 0.11)).hydraulic_diameter, 6)
    0.01
    """
    diameter, outer_diameter = shape.diameter, shape.outer_diameter
    if outer_diameter is None or not diameter < outer_diameter <= diameter / NARROW:
        shown = "none" if outer_diameter is None else f"{1e3 * outer_diameter:g} mm"
        raise OutOfValidityError(
            "annulus",
            f"outer_diameter is {shown}.",
            f"Allowed: above {1e3 * diameter:g} up to {1e3 * diameter / NARROW:g} mm.",
        )
    area = 0.25 * math.pi * (outer_diameter**2 - diameter**2)
    perimeter = math.pi * (outer_diameter + diameter)
    return DuctSection(area, perimeter, 7.541, 96.0, turning_diameter=diameter)
