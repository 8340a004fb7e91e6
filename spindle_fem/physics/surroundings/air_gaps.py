"""Heat transfer across the air gap between a rotating shaft and its housing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range

_BECKER_KAYE_LIMIT = 1.0e7


def taylor_number(
    angular_speed: ArrayLike, inner_radius: float, gap: float, kinematic_viscosity: float
) -> NDArray[np.float64]:
    """Taylor number of an annulus whose inner cylinder rotates.

    Parameters
    ----------
    angular_speed : (n,) array_like, [rad/s]
    inner_radius : float, [m]
    gap : float, [m]
        Radial.
    kinematic_viscosity : float, [m²/s]

    Returns
    -------
    (n,) ndarray, [-]
        ω² r_m c³/ν², r_m the mean radius; the geometry factor of wide gaps is
        left at 1.

    Raises
    ------
    OutOfValidityError
        A length or viscosity that is not positive.

    >>> float(taylor_number(314.159, 0.09, 0.001, 1.55e-5).round(0))
    37178.0
    """
    require_range(
        "taylor_number",
        angular_speed=(angular_speed, -POSITIVE[1], POSITIVE[1]),
        inner_radius=(inner_radius, *POSITIVE),
        gap=(gap, *POSITIVE),
        kinematic_viscosity=(kinematic_viscosity, *POSITIVE),
        how_to_fix="Give SI values, speed in rad/s.",
    )
    mean_radius = inner_radius + 0.5 * gap
    return np.asarray(angular_speed, float) ** 2 * mean_radius * gap**3 / kinematic_viscosity**2


def nusselt_becker_kaye(taylor: ArrayLike, *, extrapolate: bool = False) -> NDArray[np.float64]:
    """Nusselt number of an annulus with rotating inner cylinder, no axial flow.

    Parameters
    ----------
    taylor : (n,) array_like, [-]
    extrapolate : bool
        Compute above Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On twice the gap; 2 is conduction.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 0 <= Ta <= 1e7. The branches meet within 2 % at Ta 1700, where the
    larger counts, and within 0.2 % at 1e4.

    Source: Becker & Kaye (1962), J. Heat Transfer 84, 97–105.

    >>> nusselt_becker_kaye([0.0, 5.0e3, 1.0e6]).round(2).tolist()
    [2.0, 2.92, 11.42]
    """
    ta = np.asarray(taylor, float)
    if not extrapolate:
        require_range(
            "nusselt_becker_kaye",
            taylor=(ta, 0.0, _BECKER_KAYE_LIMIT),
            how_to_fix="Use gap_coefficient_power_law for a wide gap.",
        )
    vortices = np.where(ta < 1.0e4, 0.128 * ta**0.367, 0.409 * ta**0.241)
    return np.maximum(2.0, vortices)


def gap_coefficient_becker_kaye(
    angular_speed: ArrayLike,
    inner_radius: float,
    gap: float,
    *,
    kinematic_viscosity: float = 1.55e-5,
    thermal_conductivity: float = 0.026,
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


def gap_coefficient_power_law(
    angular_speed: ArrayLike,
    *,
    at_rest: float = 8.0,
    rise_at_reference: float = 12.0,
    reference_speed: float = 3000.0 * 2.0 * math.pi / 60.0,
    exponent: float = 0.75,
) -> NDArray[np.float64]:
    """Heat transfer coefficient across a wide air gap as a power of speed.

    Parameters
    ----------
    angular_speed : (n,) array_like, [rad/s]
    at_rest : float, [W/(m²·K)]
    rise_at_reference : float, [W/(m²·K)]
        Above the value at rest, at the reference speed.
    reference_speed : float, [rad/s]
    exponent : float, [-]

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]
        On the shaft surface: 8 + 12 (n/3000 rpm)^0.75 by default.

    Raises
    ------
    OutOfValidityError
        A coefficient that is negative, a reference speed that is not positive.

    Range: an assumption of the reference machine, gap 25–30 mm, up to 4500 rpm.

    >>> float(gap_coefficient_power_law(2.0 * math.pi * 50.0))
    20.0
    """
    require_range(
        "gap_coefficient_power_law",
        angular_speed=(angular_speed, -POSITIVE[1], POSITIVE[1]),
        at_rest=(at_rest, *NOT_NEGATIVE),
        rise_at_reference=(rise_at_reference, *NOT_NEGATIVE),
        reference_speed=(reference_speed, *POSITIVE),
        exponent=(exponent, *NOT_NEGATIVE),
        how_to_fix="Give SI values, speed in rad/s.",
    )
    ratio = np.abs(np.asarray(angular_speed, float)) / reference_speed
    return at_rest + rise_at_reference * ratio**exponent
