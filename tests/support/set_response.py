"""A bearing set whose friction follows ring difference, gap and speed by formulas, to try terms on."""

import numpy as np

from spindle_fem.effects.framework.preload_response import PreloadResponse

OUTER_RING = 1.2e-6
HOUSING = {"housing": 0.9e-6}


def log_friction(difference, gap, speed, bearing):
    """Smooth, and different for every bearing."""
    closed = np.log1p(np.exp(-gap / 5e-6))
    return (0.05 + 0.02 * bearing) * difference + 0.1 * closed - 0.1 * difference / 50.0 * np.log(speed)


def set_response(bearings=("F1", "F2", "F3"), housing=HOUSING):
    """The response of such a set."""
    difference, gap = np.linspace(-8.0, 45.0, 25), np.linspace(-25e-6, 20e-6, 25)
    speed = np.array([20.0, 100.0, 250.0, 450.0])
    grid = np.meshgrid(difference, gap, speed, np.arange(len(bearings)), indexing="ij")
    return PreloadResponse(
        tuple(bearings),
        difference,
        gap,
        speed,
        log_friction(*grid),
        clearance=5e-6,
        clearance_sigma=9e-6,
        assembly_temperature=293.15,
        outer_ring=OUTER_RING,
        housing=housing,
        reference_speed=300.0,
    )
