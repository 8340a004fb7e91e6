"""Single-row angular-contact ball bearing."""

from __future__ import annotations

import math

from spindle_fem.physics.bearings.bearing_kind import AttainableSpeeds, BearingKind
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS


def _degrees(*angles: float) -> tuple[float, ...]:
    return tuple(math.radians(angle) for angle in angles)


ANGULAR_CONTACT_BALL = BearingKind(
    source="ISO 76; Harris & Kotzalas, vol. 1 (Palmgren); SKF rolling bearings catalogue (2013)",
    # A shoulder of 0.29 ball diameters, higher than any groove is ground.
    largest_free_angle=math.radians(65.0),
    static_radial_factor=0.5,
    static_axial_factors=(
        _degrees(15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0),
        (0.46, 0.42, 0.38, 0.33, 0.29, 0.26, 0.22),
    ),
    # From 0.0010 up to 30° to 0.0013 at 40° of contact angle.
    palmgren_load_factors=(_degrees(30.0, 40.0), (1.0e-3, 1.3e-3)),
    palmgren_load_exponent=0.33,
    # Those of 40° bearings: an upper bound at 15°.
    skf_rolling=(5.03e-7, 1.97, 1.90e-12),
    skf_sliding=(1.30e-2, 0.68, 1.91e-12),
    skf_replenishment=4.4,
    # Every row of series 70 and 79 from bores of 30 mm on, within 1.5 %.
    attainable_speeds=AttainableSpeeds(
        source="NTN-SNR ULTAGE, 2015",
        grease=(_degrees(15.0, 25.0), (1.17e6, 1.015e6)),
        oil=(_degrees(15.0, 25.0), (1.87e6, 1.64e6)),
    ),
)
BEARING_KINDS.add("angular_contact_ball", ANGULAR_CONTACT_BALL)
