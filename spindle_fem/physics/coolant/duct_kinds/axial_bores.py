"""Bores along a housing, evenly around its axis, with turns at their ends where the coolant goes back."""

from __future__ import annotations

import math

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection, DuctShape
from spindle_fem.physics.coolant.rectangular_duct import required

# Of a turn by 180° through two sharp corners (Idelchik, Handbook of Hydraulic Resistance: 1.2 each).
TURN_LOSS = 2.4


@DUCT_KINDS.register
def axial_bores(shape: DuctShape) -> DuctSection:
    """The surface of all bores gives its heat at the drawn cylinder that stands for them.

    With more than one pass there and back, the coolant beside every place along the axis is the mean of all
    passes: cells take their shares side by side. The metal between bores and drawn wall is left out.

    Raises
    ------
    OutOfValidityError
        Passes that do not share the bores evenly.

    >>> section = axial_bores(DuctShape(0.2, 0.3, number=12, passes=6, bore_diameter=10e-3))
    >>> section.paths, round(section.path_length, 2), round(section.wetted_ratio, 2), section.turn_loss
    (2, 1.8, 0.6, 12.0)
    """
    required("axial_bores", shape, "bore_diameter")
    if shape.number % shape.passes:
        what = f"{shape.number} bores are no multiple of {shape.passes} passes."
        raise OutOfValidityError("axial_bores", what, "Give passes that share the bores evenly.")
    size = shape.bore_diameter
    return DuctSection(
        area=0.25 * math.pi * size**2,
        perimeter=math.pi * size,
        laminar_nusselt=3.657,
        laminar_friction=64.0,
        paths=shape.number // shape.passes,
        path_length=shape.passes * shape.length,
        wetted_ratio=shape.number * size / shape.diameter,
        turn_loss=TURN_LOSS * (shape.passes - 1),
    )
