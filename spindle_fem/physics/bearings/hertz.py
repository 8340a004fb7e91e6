"""Hertz contact of ball and groove (eqs 1, 20): ellipse, approach, pressure, load constants."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipe, ellipkm1

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry

INNER, OUTER = 0, 1
# Pa; of ball on raceway at rest (ISO 76)
STATIC_PRESSURE = 4.2e9
_TABLE_DEGREE = 8


def curvature_sum_difference(
    ball_diameter: ArrayLike, groove_curvature: ArrayLike, diameter_ratio_cosine: ArrayLike, side: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Curvature sum and difference of a ball in a groove.

    Parameters
    ----------
    ball_diameter : array_like, [m]
    groove_curvature : array_like, [-]
        Groove radius over ball diameter.
    diameter_ratio_cosine : array_like, [-]
        γ = D cos α / d_m.
    side : {INNER, OUTER}

    Returns
    -------
    sum : ndarray, [1/m]
    difference : ndarray, [-]

    Source: Harris & Kotzalas, Rolling Bearing Analysis, 5th ed., vol. 1.
    """
    ball, curvature, gamma = np.broadcast_arrays(
        np.asarray(ball_diameter, float), np.asarray(groove_curvature, float),
        np.asarray(diameter_ratio_cosine, float),
    )  # fmt: skip
    rolling = 2.0 * gamma / (1.0 - gamma) if side == INNER else -2.0 * gamma / (1.0 + gamma)
    total = (4.0 - 1.0 / curvature + rolling) / ball
    return total, (1.0 / curvature + rolling) / (ball * total)


def ellipticity(curvature_difference: ArrayLike) -> NDArray[np.float64]:
    """Semi-major over semi-minor axis of the contact ellipse.

    Solves F = [(κ²+1)E - 2K]/[(κ²-1)E] by Newton steps safeguarded by bisection.

    Parameters
    ----------
    curvature_difference : array_like, [-]
        F(ρ), 0 (sphere on sphere) to below 1.

    Source: Harris & Kotzalas, vol. 1; K and E of parameter m = 1 - 1/κ².

    >>> round(float(ellipticity(0.0)), 6)
    1.0
    """
    target = np.atleast_1d(np.asarray(curvature_difference, float))
    low, high = np.zeros_like(target), np.full_like(target, math.log(1e4))
    log_kappa = 0.5 * (low + high)
    for _ in range(200):
        too_low = _difference_of_ellipse(log_kappa) < target
        low = np.where(too_low, log_kappa, low)
        high = np.where(too_low, high, log_kappa)
        middle = 0.5 * (low + high)
        step = 1e-5
        slope = (_difference_of_ellipse(log_kappa + step) - _difference_of_ellipse(log_kappa - step)) / (
            2 * step
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = log_kappa - (_difference_of_ellipse(log_kappa) - target) / slope
        inside = (newton > low) & (newton < high)
        proposal = np.where(inside, newton, middle)
        if np.all(np.abs(proposal - log_kappa) < 1e-14):
            break
        log_kappa = proposal
    return np.exp(log_kappa).reshape(np.shape(curvature_difference))


def _difference_of_ellipse(log_kappa: NDArray[np.float64]) -> NDArray[np.float64]:
    complement = np.exp(-2.0 * log_kappa)
    parameter = 1.0 - complement
    first, second = ellipkm1(complement), ellipe(parameter)
    with np.errstate(divide="ignore", invalid="ignore"):
        full = ((2.0 - parameter) * second - 2.0 * complement * first) / (parameter * second)
    # the quotient cancels near the circle; its series there is 3m/8 + ...
    return np.where(np.abs(parameter) < 1e-5, 0.375 * parameter, full)


@dataclass(frozen=True, slots=True)
class ContactConstants:
    """Constants that relate a load to the ellipse: a = a₁Q^⅓, b = b₁Q^⅓, Q = K δ^1.5.

    Attributes
    ----------
    ellipticity : ndarray, [-]
    semi_major, semi_minor : ndarray, [m/N^⅓]
    load_constant : ndarray, [N/m^1.5]
    """

    ellipticity: NDArray[np.float64]
    semi_major: NDArray[np.float64]
    semi_minor: NDArray[np.float64]
    load_constant: NDArray[np.float64]


def contact_constants(
    curvature_sum: ArrayLike, curvature_difference: ArrayLike, compliance: ArrayLike
) -> ContactConstants:
    """Hertz constants of an elliptic contact.

    Parameters
    ----------
    curvature_sum : array_like, [1/m]
    curvature_difference : array_like, [-]
    compliance : array_like, [1/Pa]
        (1-ν1²)/E1 + (1-ν2²)/E2.

    Source: Hertz 1881; Harris & Kotzalas, vol. 1.

    Sphere of 10 mm on sphere of 15 mm radius, steel:

    >>> c = contact_constants(2 * (100.0 + 1 / 0.015), 0.0, 2 * (1 - 0.3**2) / 210e9)
    >>> round(float(c.semi_major * 5.0 ** (1 / 3)) * 1e6, 2)
    57.99
    """
    total = np.asarray(curvature_sum, float)
    kappa = ellipticity(curvature_difference)
    complement = kappa**-2.0
    first, second = ellipkm1(complement), ellipe(1.0 - complement)
    major = np.cbrt(2.0 * kappa**2 * second / np.pi)
    approach = 2.0 * first / np.pi * np.cbrt(np.pi / (2.0 * kappa**2 * second))
    scale = 1.5 * np.asarray(compliance, float) / total
    length = np.cbrt(scale)
    return ContactConstants(
        kappa, major * length, major / kappa * length, (approach * length**2 * total / 2.0) ** -1.5
    )


def bearing_contact_constants(
    geometry: BearingGeometry, contact_angle: ArrayLike, side: int
) -> ContactConstants:
    """Hertz constants of the ball-raceway contact at a contact angle (rad)."""
    curvature = geometry.groove_curvature_inner if side == INNER else geometry.groove_curvature_outer
    gamma = geometry.diameter_ratio * np.cos(np.asarray(contact_angle, float))
    total, difference = curvature_sum_difference(geometry.ball_diameter, curvature, gamma, side)
    return contact_constants(total, difference, geometry.contact_compliance)


@lru_cache(maxsize=256)
def contact_polynomials(geometry: BearingGeometry) -> NDArray[np.float64]:
    """Logarithms of K, a₁, b₁, κ as polynomials of cos α, for both raceways.

    Elliptic integrals would dominate each equilibrium iteration; over the
    narrow range of γ their combinations are smooth, and degree 8 reproduces
    them to better than 1e-9 (tested).

    Returns
    -------
    (2, 4, 9) ndarray
        Ascending powers of ``2 cos α - 1``; first index ``INNER``, ``OUTER``,
        second K in N/m^1.5, a₁ and b₁ in m/N^⅓, κ.
    """
    nodes = chebyshev.chebpts1(4 * _TABLE_DEGREE)
    angle = np.arccos(0.5 * (nodes + 1.0))
    table = np.empty((2, 4, _TABLE_DEGREE + 1))
    for side in (INNER, OUTER):
        constants = bearing_contact_constants(geometry, angle, side)
        for row, values in enumerate(
            (constants.load_constant, constants.semi_major, constants.semi_minor, constants.ellipticity)
        ):
            series = chebyshev.chebfit(nodes, np.log(values), _TABLE_DEGREE)
            table[side, row] = chebyshev.cheb2poly(series)
    table.setflags(write=False)
    return table


@lru_cache(maxsize=256)
def mean_load_constant(geometry: BearingGeometry) -> float:
    """K_n of inner and outer contact in series at the free contact angle, N/m^1.5."""
    inner = bearing_contact_constants(geometry, geometry.contact_angle, INNER).load_constant
    outer = bearing_contact_constants(geometry, geometry.contact_angle, OUTER).load_constant
    return float((inner ** (-2.0 / 3.0) + outer ** (-2.0 / 3.0)) ** -1.5)


def jones_axial_constant(geometry: BearingGeometry) -> float:
    """Jones's axial constant K = K_n (B D)^1.5 / D², N/m² (eq. 1)."""
    stretch = geometry.curvature_centre_distance**1.5
    return mean_load_constant(geometry) * stretch / geometry.ball_diameter**2


def maximum_pressure(load: ArrayLike, semi_major: ArrayLike, semi_minor: ArrayLike) -> NDArray[np.float64]:
    """Hertz pressure in the centre of the ellipse, Pa; 0 without load."""
    force, major, minor = np.broadcast_arrays(
        np.asarray(load, float), np.asarray(semi_major, float), np.asarray(semi_minor, float)
    )
    area = np.pi * major * minor
    return np.divide(1.5 * force, area, out=np.zeros_like(area), where=area > 0.0)
