"""ISO VG 46 mineral hydraulic oil, viscosity index about 100."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil

# 6.8 mm²/s at 100 °C and 877 kg/m³ are usual, not of the standard: a maker's sheet says what an oil has.
COOLANTS.add("iso_vg_46", mineral_oil("iso_vg_46", 877.0, 46.0, 6.8))
