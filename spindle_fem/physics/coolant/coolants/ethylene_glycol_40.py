"""Water with 40 % of ethylene glycol by mass (Melinder)."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.water_glycol import WaterGlycol

COOLANTS.add(
    "ethylene_glycol_40",
    WaterGlycol(
        "ethylene_glycol_40",
        density=[1052.572, -9.71432, -0.9847718],
        logarithm_of_viscosity=[-5.8642, -0.6065967, 0.1001779, -0.007195395],
        specific_heat_capacity=[3513.251, 83.01653, 0.1156924],
        thermal_conductivity=[0.4248598, 0.01521218, -0.0001589836],
    ),
)
