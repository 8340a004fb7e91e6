"""ISO VG 10 mineral hydraulic oil, viscosity index about 100."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil

# 2.6 mm²/s at 100 °C and 850 kg/m³ are usual, not of the standard: a maker's sheet says what an oil has.
COOLANTS.add("iso_vg_10", mineral_oil("iso_vg_10", 850.0, 10.0, 2.6))
