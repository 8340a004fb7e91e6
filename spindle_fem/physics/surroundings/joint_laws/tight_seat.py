"""Rough surfaces under pressure with air in their valleys: a ring on its seat."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.surroundings.joint_law import joint_law
from spindle_fem.physics.surroundings.joint_laws import JOINT_LAWS
from spindle_fem.physics.surroundings.joint_laws.filled_gap import gap_conductance
from spindle_fem.physics.surroundings.joint_laws.yovanovich import joint_conductance_yovanovich
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE

# Pressure over hardness below which the mean planes of two surfaces no longer move apart.
_LIGHTEST_TOUCH = 1.0e-5


@correlation(
    how_to_fix="Without pressure give the clearance as separation.",
    derived=lambda pressure, roughness, microhardness: {"pressure_over_hardness": pressure / microhardness},
    roughness=POSITIVE,
    microhardness=POSITIVE,
    pressure_over_hardness=(_LIGHTEST_TOUCH, 0.02),
)
def mean_plane_separation(pressure: Array, roughness: Array, microhardness: Array) -> Array:
    """Distance of the mean planes of two rough surfaces in contact, m.

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
    roughness : (n,) array_like, [m]
        Combined rms.
    microhardness : (n,) array_like, [Pa]

    Source: Antonetti (1983): Y = 1.53 σ (p/H)^−0.097.

    >>> float((mean_plane_separation(10e6, 1.0e-6, 3.0e9) * 1e6).round(2))
    2.66
    """
    return 1.53 * roughness * (pressure / microhardness) ** -0.097


@JOINT_LAWS.register
@joint_law(
    units={
        "pressure": "Pa",
        "conductivity": "W/m/K",
        "roughness": "m",
        "slope": "",
        "microhardness": "Pa",
        "radial_gap": "m",
    },
    derived=lambda pressure, microhardness, **_: {"pressure_over_hardness": pressure / microhardness},
    pressure=NOT_NEGATIVE,
    radial_gap=NOT_NEGATIVE,
    pressure_over_hardness=(0.0, 0.02),
)
def seat_conductance(
    pressure: Array,
    conductivity: Array,
    roughness: Array,
    slope: Array,
    microhardness: Array,
    radial_gap: Array = 0.0,
) -> Array:
    """Conductance of a ring's seat: contact and air where tight, air alone where loose, W/(m²·K).

    It grows with pressure, falls with the gap, and has no jump where the ring comes loose.

    Parameters
    ----------
    pressure, conductivity, roughness, slope, microhardness : (n,) array_like
        As ``joint_conductance_yovanovich`` has them.
    radial_gap : (n,) array_like, [m]
        Where the ring is loose; 0 where it is tight.

    Source: ``joint_conductance_yovanovich``, ``mean_plane_separation`` and ``gap_conductance``.

    >>> float(seat_conductance(3.0e6, 43.9, 1.0e-6, 0.1, 3.0e9).round(-2))
    15500.0
    """
    touching = np.maximum(pressure, _LIGHTEST_TOUCH * microhardness)
    separation = mean_plane_separation(touching, roughness, microhardness)
    contact = joint_conductance_yovanovich(pressure, conductivity, roughness, slope, microhardness)
    return contact + gap_conductance(separation + radial_gap)
