"""A jacket of parallel grooves around a part, each fed at one side, so that halves meet at the other."""

from __future__ import annotations

import math

from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection, DuctShape
from spindle_fem.physics.coolant.rectangular_duct import laminar_numbers, required


@DUCT_KINDS.register
def ring_grooves(shape: DuctShape) -> DuctSection:
    """Half a ring of each groove is a path; floor and sides give their heat at the drawn walls.

    These are the floor, and the cover where one is named. Sides count in full (true of grooves in metal that
    are not deeper than wide). Entry and exit of a ring count as 1.5 velocity heads.

    >>> section = ring_grooves(DuctShape(0.1, 0.06, width=6e-3, depth=4e-3, number=5))
    >>> section.paths, round(section.path_length, 4), round(section.wetted_ratio, 3)
    (10, 0.1634, 1.167)
    """
    required("ring_grooves", shape, "width", "depth")
    nusselt, friction = laminar_numbers(shape.width, shape.depth)
    return DuctSection(
        area=shape.width * shape.depth,
        perimeter=2.0 * (shape.width + shape.depth),
        laminar_nusselt=nusselt,
        laminar_friction=friction,
        paths=2 * shape.number,
        path_length=0.5 * math.pi * (shape.diameter + shape.depth),
        wetted_ratio=shape.number * shape.groove_wall / shape.length,
        turn_loss=1.5,
    )
