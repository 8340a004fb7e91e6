"""A wide gap by a power of the speed, with the coefficients of the definition."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.surroundings.air_gaps import AirGap, GapCoefficient
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range


@GAP_LAWS.register
def power_law(gap: AirGap) -> GapCoefficient:
    """``at_rest + rise (speed / reference_speed)^exponent``, W/(m²·K)."""
    value = gap_coefficient_power_law(
        gap.angular_speed,
        at_rest=gap.at_rest,
        rise_at_reference=gap.rise,
        reference_speed=gap.reference_speed,
        exponent=gap.exponent,
    )
    return GapCoefficient(float(value))


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
