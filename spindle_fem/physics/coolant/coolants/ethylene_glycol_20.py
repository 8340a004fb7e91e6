"""Water with 20 % of ethylene glycol by mass (Melinder)."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.water_glycol import WaterGlycol

COOLANTS.add(
    "ethylene_glycol_20",
    WaterGlycol(
        "ethylene_glycol_20",
        density=[1025.201, -6.381604, -1.621981],
        logarithm_of_viscosity=[-6.399227, -0.5585778, 0.09521075, -0.001904433],
        specific_heat_capacity=[3929.246, 37.29996, 0.3164707],
        thermal_conductivity=[0.5085992, 0.02217043, -0.001758142],
    ),
)
