"""A bearing set whose friction follows ring difference, gap and speed by formulas, to try terms on."""

import numpy as np

from spindle_fem.effects.framework.preload_response import PreloadResponse

OUTER_RING = 1.2e-6
HOUSING = {"housing": 0.9e-6}
SHAFT = {"shaft": 0.4}
THRUST = 1000.0


def log_friction(difference, gap, speed, thrust, bearing):
    """Smooth, straight over the thrust, and different for every bearing."""
    closed = np.log1p(np.exp(-gap / 5e-6))
    loaded = 1.0 + (bearing - 0.5) * (thrust / THRUST - 1.0) / 4.0
    return (
        (0.05 + 0.02 * bearing) * difference * loaded + 0.1 * closed - 0.1 * difference / 50.0 * np.log(speed)
    )


def set_response(bearings=("F1", "F2", "F3"), housing=HOUSING, shaft=SHAFT):
    """The response of such a set."""
    difference, gap = np.linspace(-8.0, 45.0, 25), np.linspace(-25e-6, 20e-6, 25)
    speed = np.array([20.0, 100.0, 250.0, 450.0])
    thrust = np.array([0.0, THRUST, 2.0 * THRUST])
    grid = np.meshgrid(difference, gap, speed, thrust, np.arange(len(bearings)), indexing="ij")
    return PreloadResponse(
        tuple(bearings),
        difference,
        gap,
        speed,
        thrust,
        log_friction(*grid),
        clearance=5e-6,
        clearance_sigma=9e-6,
        assembly_temperature=293.15,
        outer_ring=OUTER_RING,
        housing=housing,
        shaft=shaft,
        reference_speed=300.0,
        reference_thrust=THRUST,
    )
