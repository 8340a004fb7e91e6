"""Basic rating life of ball and roller bearings from the load of every ball or roller."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry

FloatArray = NDArray[np.float64]
# Present-day steel and finish over the formulas' of 1947 (ISO 281, b_m), and what mounting takes (λ, λν).
_BALL_STEEL, _BALL_REDUCTION = 1.3, 0.95
_ROLLER_STEEL, _ROLLER_REDUCTION = 1.1, 0.83
# Balls beyond 25.4 mm gain less (ISO 281).
_LARGE_BALL = 25.4


def dynamic_load_rating(geometry: BearingGeometry | RollerGeometry) -> float:
    """Radial load that one row bears for a million turns, C of the row, N.

    The catalogue's where the geometry has one (of two rows divided by 2**(7/9)), else by ISO 281.

    Source: ISO 281; ISO/TR 1281-1; Harris & Kotzalas, vol. 1, ch. 11.

    A 6206 has 19.5 kN in catalogues:

    >>> groove = BearingGeometry(9.525e-3, 9, 46e-3, 0.0, 0.52, 0.52)
    >>> round(dynamic_load_rating(groove) / 1e3, 1)
    19.3
    """
    given = geometry.dynamic_load_rating
    if isinstance(geometry, RollerGeometry):
        return _roller_rating(geometry) if given is None else given / geometry.rows ** (7.0 / 9.0)
    return _ball_rating(geometry) if given is None else given


def rating_life(
    geometry: BearingGeometry | RollerGeometry, load: FloatArray, weight: FloatArray | None = None
) -> float:
    """Turns that nine of ten bearings with these loads reach, in millions; infinite without load.

    Parameters
    ----------
    geometry : BearingGeometry or RollerGeometry
    load : (n, 2) ndarray, [N]
        Of every ball, or of every roller row after row; inner contact first.
    weight : (n,) ndarray, optional
        Number of balls that each row of ``load`` represents.

    Range: the inner ring turns past a stationary load; steel, clean oil (no a_ISO); aligned rollers.

    Source: ISO/TS 16281:2008, basic reference rating life; its load of the contacts is this program's.
    """
    number = weight if weight is not None else np.ones(len(load))
    if isinstance(geometry, RollerGeometry):
        inner, outer = _roller_capacities(geometry)
        rows = np.split(load, geometry.rows)
        damage = sum(
            (_mean(row[:, INNER], 4.0) / inner) ** 4.5 + (_mean(row[:, OUTER], 4.5) / outer) ** 4.5
            for row in rows
        )
        return float(damage ** (-8.0 / 9.0)) if damage > 0.0 else math.inf
    inner, outer = _ball_capacities(geometry)
    damage = (_mean(load[:, INNER], 3.0, number) / inner) ** (10.0 / 3.0)
    damage += (_mean(load[:, OUTER], 10.0 / 3.0, number) / outer) ** (10.0 / 3.0)
    return float(damage**-0.9) if damage > 0.0 else math.inf


def _mean(load: FloatArray, exponent: float, weight: FloatArray | None = None) -> float:
    """Load of each that damages as much as they do together, N."""
    return float(np.average(load**exponent, weights=weight) ** (1.0 / exponent))


def _ball_ratio(geometry: BearingGeometry) -> float:
    """Strength of the inner raceway's contacts over the outer's, with 1.04 of the formulas as derived."""
    ratio = geometry.diameter_ratio * math.cos(geometry.rated_contact_angle)
    inner, outer = geometry.groove_curvature_inner, geometry.groove_curvature_outer
    curvature = inner / outer * (2.0 * outer - 1.0) / (2.0 * inner - 1.0)
    return 1.044 * ((1.0 - ratio) / (1.0 + ratio)) ** 1.72 * curvature**0.41


def _ball_rating(geometry: BearingGeometry) -> float:
    ratio = geometry.diameter_ratio * math.cos(geometry.rated_contact_angle)
    groove = geometry.groove_curvature_inner
    factor = 39.9 * _BALL_REDUCTION * (1.0 + _ball_ratio(geometry) ** (10.0 / 3.0)) ** -0.3
    factor *= ratio**0.3 * (1.0 - ratio) ** 1.39 / (1.0 + ratio) ** (1.0 / 3.0)
    factor *= (2.0 * groove / (2.0 * groove - 1.0)) ** 0.41
    ball = 1e3 * geometry.ball_diameter
    size = ball**1.8 if ball <= _LARGE_BALL else 3.647 * ball**1.4
    angle = math.cos(geometry.rated_contact_angle) ** 0.7
    return _BALL_STEEL * factor * angle * geometry.ball_count ** (2.0 / 3.0) * size


def _ball_capacities(geometry: BearingGeometry) -> tuple[float, float]:
    """Load of a ball at which inner and outer raceway live a million turns, N."""
    rating, ratio = dynamic_load_rating(geometry), _ball_ratio(geometry)
    share = rating / (geometry.ball_count * math.cos(geometry.rated_contact_angle))
    inner = share / 0.407 * (1.0 + ratio ** (10.0 / 3.0)) ** 0.3
    outer = share / 0.389 * (1.0 + ratio ** (-10.0 / 3.0)) ** 0.3
    return inner, outer


def _roller_ratio(geometry: RollerGeometry) -> float:
    ratio = geometry.diameter_ratio
    return 1.038 * ((1.0 - ratio) / (1.0 + ratio)) ** (143.0 / 108.0)


def _roller_rating(geometry: RollerGeometry) -> float:
    ratio = geometry.diameter_ratio
    factor = 207.9 * _ROLLER_REDUCTION * (1.0 + _roller_ratio(geometry) ** 4.5) ** (-2.0 / 9.0)
    factor *= ratio ** (2.0 / 9.0) * (1.0 - ratio) ** (29.0 / 27.0) / (1.0 + ratio) ** 0.25
    length, diameter = 1e3 * geometry.roller_length, 1e3 * geometry.roller_diameter
    size = length ** (7.0 / 9.0) * geometry.roller_count**0.75 * diameter ** (29.0 / 27.0)
    return _ROLLER_STEEL * factor * size


def _roller_capacities(geometry: RollerGeometry) -> tuple[float, float]:
    """Load of a roller at which inner and outer raceway live a million turns, N."""
    ratio = _roller_ratio(geometry)
    # λν, what edges take, stays in: rollers here carry evenly along their length
    share = dynamic_load_rating(geometry) / geometry.roller_count
    inner = share / 0.378 * (1.0 + ratio**4.5) ** (2.0 / 9.0)
    outer = share / 0.364 * (1.0 + ratio**-4.5) ** (2.0 / 9.0)
    return inner, outer
