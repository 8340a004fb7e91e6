"""A round bore, through a shaft or along a housing."""

from __future__ import annotations

import math

from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection


@DUCT_KINDS.register
def bore(diameter: float, outer_diameter: float | None) -> DuctSection:
    """Section of a round duct.

    Source: Hagen–Poiseuille, f Re = 64; Nu = 3.657 at uniform wall temperature
    (Shah & London 1978, Laminar Flow Forced Convection in Ducts).

    >>> round(bore(0.02, None).hydraulic_diameter, 6)
    0.02
    """
    return DuctSection(0.25 * math.pi * diameter**2, math.pi * diameter, 3.657, 64.0)
