"""Cylindrical roller bearing with cage, one row or two, such as N10 and NN30; no axial load."""

from __future__ import annotations

from spindle_fem.physics.bearings.bearing_kind import AttainableSpeeds
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.roller_kind import RollerKind

CYLINDRICAL_ROLLER = RollerKind(
    source="Harris & Kotzalas, vol. 1 (Palmgren); SKF rolling bearings catalogue (2013)",
    # Rollers with cage: 0.6 to 1 with grease, 1.5 to 2.8 with oil mist, 2.2 to 4 in an oil bath.
    palmgren_lubrication_factor=1.0,
    # 2e-4 to 4e-4; the lower end is that of light series.
    palmgren_load_factor=2.0e-4,
    # Series 10 of the N and NU designs.
    skf_rolling=1.12e-6,
    skf_sliding=1.5e-3,
    skf_friction_ehl=0.02,
    skf_replenishment=5.1,
    # Limiting speeds of NU 10 with machined cages, bores of 75 to 120 mm: 0.94 to 0.99e6.
    attainable_speeds=AttainableSpeeds(
        source="SKF general catalogue 6000, 2006",
        grease=((0.0,), (0.97e6,)),
        oil=((0.0,), (0.97e6,)),
    ),
)
BEARING_KINDS.add("cylindrical_roller", CYLINDRICAL_ROLLER)
