"""The reference spindle with rings near their housing, flooded grease and little of it on the balls.

Heat and preload feed each other from a few hundred rpm on.
"""

SETS = ("front", "rear")
NEAR_RINGS = (
    "grease.wetted_share=0.3",
    "grease.limiting_shear_ratio=0.07",
    "grease.limiting_shear_slope=0 1/K",
    *(f"bearing_set.{name}.fit.outer_clearance=5um" for name in SETS),
    *(f"bearing_set.{name}.heat_factor=1" for name in SETS),
)
