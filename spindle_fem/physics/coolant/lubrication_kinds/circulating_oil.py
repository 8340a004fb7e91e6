"""Oil that flows through the bearing from a bore in ring or housing, some of it always between the rings."""

from __future__ import annotations

from spindle_fem.physics.coolant.lubrication_kind import LubricationKind, flooded_fill, oil_film
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS

# Palmgren's f_0 of an oil bath to the middle of the lowest element by Harris & Kotzalas; K_rs as of a low
# oil bath by the SKF catalogue (2013).
LUBRICATION_KINDS.add(
    "circulating_oil",
    LubricationKind(
        ball_factor=3.3,
        roller_factor=2.2,
        replenishment=3.0e-8,
        fill=flooded_fill,
        film=oil_film,
        churns=True,
    ),
)
