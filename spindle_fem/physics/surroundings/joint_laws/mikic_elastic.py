"""Rough flat surfaces under pressure whose asperities stay elastic: lapped or run in (Mikic)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.joint_law import joint_law
from spindle_fem.physics.surroundings.joint_laws import JOINT_LAWS
from spindle_fem.validity import NOT_NEGATIVE


def _relative_pressure(pressure: Array, slope: Array, contact_modulus: Array) -> Array:
    """√2 p/(m E')."""
    return np.sqrt(2.0) * pressure / (slope * contact_modulus)


@JOINT_LAWS.register
@joint_law(
    units={"pressure": "Pa", "conductivity": "W/m/K", "roughness": "m", "slope": "", "contact_modulus": "Pa"},
    derived=lambda pressure, slope, contact_modulus, **_: {
        "relative_pressure": _relative_pressure(pressure, slope, contact_modulus)
    },
    pressure=NOT_NEGATIVE,
    relative_pressure=(0.0, 0.02),
)
def joint_conductance_mikic_elastic(
    pressure: Array, conductivity: Array, roughness: Array, slope: Array, contact_modulus: Array
) -> Array:
    """Contact conductance of rough flat surfaces whose asperities stay elastic, W/(m²·K).

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
        Apparent; 0 gives 0.
    conductivity : (n,) array_like, [W/(m·K)]
        Harmonic mean of both bodies.
    roughness : (n,) array_like, [m]
        Combined rms.
    slope : (n,) array_like, [-]
        Combined rms of the profile slope.
    contact_modulus : (n,) array_like, [Pa]
        1/E' = (1 − ν1²)/E1 + (1 − ν2²)/E2.

    Range: elastic asperities (lapped or run-in surfaces, repeated loading), √2 p/(m E') up to 0.02.

    Source: Mikic (1974), Int. J. Heat Mass Transfer 17, 205–214:
    h = 1.55 k (m/σ)(√2 p/(m E'))^0.94.

    >>> float(joint_conductance_mikic_elastic(10e6, 43.9, 1.0e-6, 0.1, 113.2e9).round(-2))
    12700.0
    """
    relative = _relative_pressure(pressure, slope, contact_modulus)
    return 1.55 * conductivity * slope / roughness * relative**0.94
