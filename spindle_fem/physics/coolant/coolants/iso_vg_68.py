"""ISO VG 68 mineral hydraulic oil, viscosity index about 100."""

from __future__ import annotations

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil

# 8.7 mm²/s at 100 °C and 882 kg/m³ are usual, not of the standard: a maker's sheet says what an oil has.
COOLANTS.add("iso_vg_68", mineral_oil("iso_vg_68", 882.0, 68.0, 8.7))
