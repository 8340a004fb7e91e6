"""Heat transfer across the air gap between a rotating shaft and its housing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import POSITIVE, require_range


@dataclass(frozen=True, slots=True)
class AirGap:
    """Quantities that a law of a gap may use.

    Attributes
    ----------
    angular_speed : float, [rad/s]
    inner_radius, outer_radius : float, [m]
        Of the turning and the standing surface.
    at_rest, rise : float, [W/(m²·K)]
        Of the definition, like the next two: at standstill, and added at the reference speed.
    reference_speed : float, [rad/s]
    exponent : float, [-]
    """

    angular_speed: float
    inner_radius: float
    outer_radius: float
    at_rest: float = 0.0
    rise: float = 0.0
    reference_speed: float = 0.0
    exponent: float = 1.0


@dataclass(frozen=True, slots=True)
class GapCoefficient:
    """Heat transfer coefficient of a gap.

    Attributes
    ----------
    value : float, [W/(m²·K)]
        On the turning surface, with the difference of the two wall temperatures.
    faults : tuple of str
        What leaves the range of the law.
    """

    value: float
    faults: tuple[str, ...] = ()


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
