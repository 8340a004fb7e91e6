"""Water with 30 % of ethylene glycol by mass (Melinder)."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.water_glycol import WaterGlycol

COOLANTS.add(
    "ethylene_glycol_30",
    WaterGlycol(
        "ethylene_glycol_30",
        density=[1038.714, -8.148548, -1.266421],
        logarithm_of_viscosity=[-6.136344, -0.5870271, 0.1000535, -0.003684314],
        specific_heat_capacity=[3737.364, 61.13187, -0.6605809],
        thermal_conductivity=[0.4653034, 0.01821802, -0.0008620201],
    ),
)
