"""ISO VG 22 mineral hydraulic oil, viscosity index about 100."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil

# 4.3 mm²/s at 100 °C and 866 kg/m³ are usual, not of the standard: a maker's sheet says what an oil has.
COOLANTS.add("iso_vg_22", mineral_oil("iso_vg_22", 866.0, 22.0, 4.3))
