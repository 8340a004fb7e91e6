"""Single-row deep-groove ball bearing, whose contact angle follows from its clearance."""

from __future__ import annotations

import math

from spindle_fem.physics.bearings.bearing_kind import AttainableSpeeds, BearingKind
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS

DEEP_GROOVE_BALL = BearingKind(
    source="ISO 76; Harris & Kotzalas, vol. 1 (Palmgren); SKF rolling bearings catalogue (2013)",
    # A shoulder of 0.16 ball diameters.
    largest_free_angle=math.radians(35.0),
    static_radial_factor=0.6,
    static_axial_factors=((0.0, math.radians(35.0)), (0.5, 0.5)),
    # 0.0004 to 0.0006; the upper end is that of series 62 and 63.
    palmgren_load_factors=((0.0, math.radians(35.0)), (5.0e-4, 5.0e-4)),
    palmgren_load_exponent=0.55,
    skf_rolling=(),
    skf_sliding=(),
    # Series 60; of series 62 3.9e-7, 1.7, 3.23e-3, 36.5.
    skf_groove=(4.1e-7, 1.7, 3.73e-3, 14.6),
    skf_replenishment=3.1,
    # Limiting speeds of open 60xx and 62xx with pressed cages, bores of 25 to 60 mm: 0.66 to 0.76e6.
    attainable_speeds=AttainableSpeeds(
        source="SKF general catalogue 6000, 2006",
        grease=((0.0,), (0.7e6,)),
        oil=((0.0,), (0.7e6,)),
    ),
    palmgren_axial_factor=3.0,
    rated_contact_angle=0.0,
)
BEARING_KINDS.add("deep_groove_ball", DEEP_GROOVE_BALL)
