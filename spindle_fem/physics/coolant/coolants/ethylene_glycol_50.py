"""Water with 50 % of ethylene glycol by mass (Melinder)."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.water_glycol import WaterGlycol

COOLANTS.add(
    "ethylene_glycol_50",
    WaterGlycol(
        "ethylene_glycol_50",
        density=[1065.982, -10.8958, -0.9095863],
        logarithm_of_viscosity=[-5.570771, -0.6373611, 0.0953651, -0.01243768],
        specific_heat_capacity=[3295.247, 106.3859, 0.7788105],
        thermal_conductivity=[0.3891256, 0.01231967, 8.072704e-05],
    ),
)
