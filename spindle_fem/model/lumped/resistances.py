"""Resistances and film coefficients of the paper's Table 1 that belong to no other module.

The contact of a ball and the ball itself are in
:mod:`spindle_fem.physics.bearings.contact_conduction`, the oil in
:mod:`spindle_fem.physics.coolant`.

Source: Wu & Tan (2016), Advances in Mechanical Engineering 8(8), Table 1,
misprints repaired.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range

Array = NDArray[np.float64]
PLATE_REYNOLDS_LIMIT = 5.0e5


def cylinder_resistance(
    inner_radius: ArrayLike, outer_radius: ArrayLike, thermal_conductivity: float, width: float
) -> Array:
    """Radial conduction through a tube (R_h, R_o, R_i, R_s), ln(D_o/D_i)/(2π b k), K/W.

    Parameters
    ----------
    inner_radius, outer_radius : array_like, [m]
    thermal_conductivity : float, [W/(m·K)]
    width : float, [m]
        Axial.

    >>> float(cylinder_resistance(0.05, 0.1, 42.0, 0.024).round(6))
    0.109442
    """
    require_range(
        "cylinder_resistance",
        inner_radius=(inner_radius, *POSITIVE),
        ratio_of_radii=(np.asarray(outer_radius, float) / np.asarray(inner_radius, float), 1.0, POSITIVE[1]),
        thermal_conductivity=(thermal_conductivity, *POSITIVE),
        width=(width, *POSITIVE),
        how_to_fix="Give the outer radius larger than the inner one, SI units.",
    )
    ratio = np.asarray(outer_radius, float) / np.asarray(inner_radius, float)
    return np.log(ratio) / (2.0 * np.pi * width * thermal_conductivity)


def film_resistance(heat_transfer_coefficient: ArrayLike, area: ArrayLike) -> Array:
    """Convection (R_l, R_f, R_lb, R_air), 1/(P S), K/W.

    >>> float(film_resistance(250.0, 0.04))
    0.1
    """
    require_range(
        "film_resistance",
        heat_transfer_coefficient=(heat_transfer_coefficient, *POSITIVE),
        area=(area, *POSITIVE),
        how_to_fix="A film without coefficient or area joins nothing; leave it out.",
    )
    return 1.0 / (np.asarray(heat_transfer_coefficient, float) * np.asarray(area, float))


def ring_housing_resistance(
    ring_thickness: float, ring_conductivity: float, gap: float, gap_conductivity: float, area: float
) -> float:
    """Outer ring to housing through a clearance (R_oh), (h_ring/k_ring + h_gap/k_gap)/S, K/W.

    Parameters
    ----------
    ring_thickness, gap : float, [m]
        The gap is that of the joint, not the channel's h_gap.
    ring_conductivity, gap_conductivity : float, [W/(m·K)]
    area : float, [m²]

    Plane formula: for a ring of 9 mm on r 95 mm it is 5 % off the logarithm.

    >>> round(ring_housing_resistance(9e-3, 46.0, 5e-6, 0.026, 0.01433), 5)
    0.02707
    """
    require_range(
        "ring_housing_resistance",
        ring_thickness=(ring_thickness, *NOT_NEGATIVE),
        gap=(gap, *NOT_NEGATIVE),
        ring_conductivity=(ring_conductivity, *POSITIVE),
        gap_conductivity=(gap_conductivity, *POSITIVE),
        area=(area, *POSITIVE),
        how_to_fix="SI units.",
    )
    return (ring_thickness / ring_conductivity + gap / gap_conductivity) / area


def plate_film_coefficient(
    thermal_conductivity: float, prandtl: ArrayLike, velocity: ArrayLike, kinematic_viscosity: float,
    length: ArrayLike, *, mean: bool = False,
) -> Array:  # fmt: skip
    """Laminar boundary layer of lubricant along a ring (P_l), W/(m²·K).

    ``0.332 k Pr^(1/3) (u / (ν x))^(1/2)`` is the local value at ``x``; the mean
    from the edge to ``x`` is twice that.

    Parameters
    ----------
    thermal_conductivity : float, [W/(m·K)]
    prandtl : array_like, [-]
    velocity : array_like, [m/s]
        A third to all of the cage's surface speed.
    kinematic_viscosity : float, [m²/s]
    length : array_like, [m]
        Along the flow.
    mean : bool

    Raises
    ------
    OutOfValidityError
        Re_x above 5e5, Pr below 0.6.

    Source: Pohlhausen (1921); error of the exponent 1/3 below 3 % for Pr above 0.6.

    >>> float(plate_film_coefficient(0.14, 400.0, 2.0, 3e-5, 0.05).round(1))
    395.4
    """
    velocity, length = np.asarray(velocity, float), np.asarray(length, float)
    require_range(
        "plate_film_coefficient",
        reynolds=(velocity * length / kinematic_viscosity, 0.0, PLATE_REYNOLDS_LIMIT),
        prandtl=(prandtl, 0.6, np.inf),
        length=(length, *POSITIVE),
        how_to_fix="Above Re 5e5 the layer is turbulent.",
    )
    local = (
        0.332 * thermal_conductivity * np.cbrt(prandtl) * np.sqrt(velocity / (kinematic_viscosity * length))
    )
    return 2.0 * local if mean else local


def air_film_coefficient(velocity: ArrayLike, c0: float = 9.7, c1: float = 5.33, c2: float = 0.8) -> Array:
    """Air over a turning surface (R_air), c0 + c1 u^c2, W/(m²·K).

    The paper prints no constants; the defaults are common for spindles.

    Parameters
    ----------
    velocity : array_like, [m/s]

    Source: Bossmanns & Tu (1999), Int. J. Machine Tools & Manufacture 39, 1345-1366.

    >>> air_film_coefficient([0.0, 20.0]).round(1).tolist()
    [9.7, 68.3]
    """
    require_range(
        "air_film_coefficient", velocity=(velocity, *NOT_NEGATIVE), how_to_fix="Give the speed's magnitude."
    )
    return c0 + c1 * np.asarray(velocity, float) ** c2
