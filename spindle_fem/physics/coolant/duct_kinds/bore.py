"""A round bore, through a shaft or along a housing."""

from __future__ import annotations

import math

from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection, DuctShape


@DUCT_KINDS.register
def bore(shape: DuctShape) -> DuctSection:
    """Section of a round duct.

    Source: Hagen–Poiseuille, f Re = 64; Nu = 3.657 at uniform wall temperature
    (Shah & London 1978, Laminar Flow Forced Convection in Ducts).

    >>> round(bore(DuctShape(0.02, 0.4)).hydraulic_diameter, 6)
    0.02
    """
    return DuctSection(0.25 * math.pi * shape.diameter**2, math.pi * shape.diameter, 3.657, 64.0)
