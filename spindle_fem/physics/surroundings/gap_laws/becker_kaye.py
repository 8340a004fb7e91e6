"""A narrow annulus by the correlation of Becker & Kaye, conduction through the air at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.surroundings.air_gaps import AirGap, GapCoefficient, taylor_number
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS

# Air at about 25 °C.
AIR_KINEMATIC_VISCOSITY = 1.55e-5
AIR_CONDUCTIVITY = 0.026


@GAP_LAWS.register
def becker_kaye(gap: AirGap) -> GapCoefficient:
    """Coefficient between the two walls, also beyond the range, which is then reported."""
    width = gap.outer_radius - gap.inner_radius
    taylor = taylor_number(gap.angular_speed, gap.inner_radius, width, AIR_KINEMATIC_VISCOSITY)
    value = gap_coefficient_becker_kaye(gap.angular_speed, gap.inner_radius, width, extrapolate=True)
    return GapCoefficient(float(value), nusselt_becker_kaye.faults(taylor=taylor))


@correlation(how_to_fix="Use gap_coefficient_power_law for a wide gap.", taylor=(0.0, 1.0e7))
def nusselt_becker_kaye(taylor: Array) -> Array:
    """Nusselt number of an annulus with rotating inner cylinder, no axial flow.

    On twice the gap; 2 is conduction.

    Parameters
    ----------
    taylor : (n,) array_like, [-]

    The branches meet within 2 % at Ta 1700, where the larger counts, and within 0.2 % at 1e4.

    Source: Becker & Kaye (1962), J. Heat Transfer 84, 97–105.

    >>> nusselt_becker_kaye([0.0, 5.0e3, 1.0e6]).round(2).tolist()
    [2.0, 2.92, 11.42]
    """
    vortices = np.where(taylor < 1.0e4, 0.128 * taylor**0.367, 0.409 * taylor**0.241)
    return np.maximum(2.0, vortices)


def gap_coefficient_becker_kaye(
    angular_speed: ArrayLike,
    inner_radius: float,
    gap: float,
    *,
    kinematic_viscosity: float = AIR_KINEMATIC_VISCOSITY,
    thermal_conductivity: float = AIR_CONDUCTIVITY,
    extrapolate: bool = False,
) -> NDArray[np.float64]:
    """Heat transfer coefficient from shaft to housing across a narrow annular gap.

    Parameters
    ----------
    angular_speed : (n,) array_like, [rad/s]
    inner_radius, gap : float, [m]
    kinematic_viscosity : float, [m²/s]
    thermal_conductivity : float, [W/(m·K)]
    extrapolate : bool
        Compute above the range of ``nusselt_becker_kaye`` too.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]
        On the inner surface, with the difference of the two wall temperatures.

    Raises
    ------
    OutOfValidityError
        Outside the range of ``nusselt_becker_kaye``, unless ``extrapolate``.

    Source: Becker & Kaye (1962): Nu k/(2 c), Nu between one wall and the other.

    >>> float(gap_coefficient_becker_kaye(0.0, 0.09, 0.001))
    26.0
    """
    taylor = taylor_number(angular_speed, inner_radius, gap, kinematic_viscosity)
    return nusselt_becker_kaye(taylor, extrapolate=extrapolate) * thermal_conductivity / (2.0 * gap)
