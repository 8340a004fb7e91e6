"""Oil sprayed into the bearing by nozzles: it lubricates, drags on the balls and carries heat away."""

from __future__ import annotations

from spindle_fem.physics.coolant.lubrication_kind import LubricationKind, flooded_fill, oil_film
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS

# Palmgren's f_0 of oil jets, and of cylindrical rollers of light series, by Harris & Kotzalas; K_rs of low
# oil levels and jets by the SKF catalogue (2013).
LUBRICATION_KINDS.add(
    "oil_jet",
    LubricationKind(
        ball_factor=6.6,
        roller_factor=2.2,
        replenishment=3.0e-8,
        fill=flooded_fill,
        film=oil_film,
        churns=True,
    ),
)
