"""Rough flat surfaces under pressure whose asperities yield (Yovanovich)."""

from __future__ import annotations

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.joint_law import joint_law
from spindle_fem.physics.surroundings.joint_laws import JOINT_LAWS
from spindle_fem.validity import NOT_NEGATIVE


@JOINT_LAWS.register
@joint_law(
    units={"pressure": "Pa", "conductivity": "W/m/K", "roughness": "m", "slope": "", "microhardness": "Pa"},
    derived=lambda pressure, microhardness, **_: {"pressure_over_hardness": pressure / microhardness},
    pressure=NOT_NEGATIVE,
    pressure_over_hardness=(0.0, 0.02),
)
def joint_conductance_yovanovich(
    pressure: Array, conductivity: Array, roughness: Array, slope: Array, microhardness: Array
) -> Array:
    """Contact conductance of rough flat surfaces whose asperities yield, W/(m²·K).

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
        Apparent; 0 gives 0.
    conductivity : (n,) array_like, [W/(m·K)]
        Harmonic mean of both bodies.
    roughness : (n,) array_like, [m]
        Combined rms, √(σ1² + σ2²).
    slope : (n,) array_like, [-]
        Combined rms of the profile slope.
    microhardness : (n,) array_like, [Pa]
        Of the softer body.

    Range: the source starts at p/H = 1e-6, below which it tends to 0.

    Source: Yovanovich (1982), AIAA-82-0888: h = 1.25 k (m/σ)(p/H)^0.95.

    >>> float(joint_conductance_yovanovich(10e6, 43.9, 1.0e-6, 0.1, 3.0e9).round(-2))
    24300.0
    """
    return 1.25 * conductivity * slope / roughness * (pressure / microhardness) ** 0.95
