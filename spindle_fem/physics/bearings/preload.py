"""Preload and thrust of axially loaded bearings at rest (eqs 1-3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import contact_polynomials, jones_axial_constant


@dataclass(frozen=True, slots=True)
class AxialState:
    """One bearing under a central axial force at rest.

    Attributes
    ----------
    force : float, [N]
    approach : float, [m]
        Axial displacement from touching.
    contact_angle : float, [rad]
    ball_load : float, [N]
    stiffness : float, [N/m]
        dF/dδ.
    """

    force: float
    approach: float
    contact_angle: float
    ball_load: float
    stiffness: float


def preload_from_catalogue(
    catalogue_preload: float,
    bearing_factor: float = 1.0,
    angle_factor: float = 1.0,
    grade_factor: float = 1.0,
    material_factor: float = 1.0,
) -> float:
    """Preload of the mounted bearing, F_p = ζ ζ1 ζ2 ζ3 F_A (eq. 2), N.

    >>> preload_from_catalogue(200.0, 1.02, 0.99)
    201.96
    """
    require_force("catalogue_preload", catalogue_preload)
    for key, value in (
        ("bearing_factor", bearing_factor), ("angle_factor", angle_factor),
        ("grade_factor", grade_factor), ("material_factor", material_factor),
    ):  # fmt: skip
        if not value > 0.0:
            raise SpecError(key, f"it is {value:g}.", "It must be above 0.")
    return catalogue_preload * bearing_factor * angle_factor * grade_factor * material_factor


def require_force(where: str, force: float) -> None:
    """Refuse a preload that is negative or not finite."""
    if not math.isfinite(force) or force < 0.0:
        raise SpecError(where, f"preload is {force:g} N.", "It must not be negative.")


def mounted_contact_angle(geometry: BearingGeometry, preload: float) -> float:
    """Contact angle α_p under preload by eq. 1 with Jones's axial constant, rad.

    The constant belongs to the free angle; ``axial_state`` lets it follow the
    running angle (they differ by less than 1e-3).

    Parameters
    ----------
    preload : float, [N]
        Of this bearing: half the set's for each of two in tandem.

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> round(math.degrees(mounted_contact_angle(g, 568.6)), 2)
    16.12
    """
    require_force("preload", preload)
    alpha0 = geometry.contact_angle
    normalised = preload / (geometry.ball_count * geometry.ball_diameter**2 * jones_axial_constant(geometry))
    highest = 0.5 * math.pi - 1e-9
    if preload == 0.0:
        return alpha0

    def excess(angle: float) -> float:
        stretch = max(math.cos(alpha0) / math.cos(angle) - 1.0, 0.0)
        return math.sin(angle) * stretch**1.5 - normalised

    return float(brentq(excess, alpha0, highest, xtol=1e-14, rtol=1e-14))


def preload_displacement(geometry: BearingGeometry, contact_angle: float) -> float:
    """Axial approach δ_p = B D sin(α_p - α_0)/cos α_p of eq. 1, m."""
    distance = geometry.curvature_centre_distance
    return distance * math.sin(contact_angle - geometry.contact_angle) / math.cos(contact_angle)


def thrust_angles(
    geometry: BearingGeometry, thrust: float, displacement_sum: float, front: int = 2, rear: int = 1
) -> tuple[float, float]:
    """Front and rear contact angle of a rigidly preloaded set under thrust (eq. 3), rad.

    Parameters
    ----------
    thrust : float, [N]
        Loads the front bearings further.
    displacement_sum : float, [m]
        δ_pA + δ_pB of the preload, which a locknut keeps.
    front, rear : int
        Bearings on each side; the paper's factor 2 is ``front`` = 2.

    Raises
    ------
    NoEquilibriumError
        Thrust that no contact angle below 90° carries.
    """
    alpha0, distance = geometry.contact_angle, geometry.curvature_centre_distance
    scale = geometry.ball_count * geometry.ball_diameter**2 * jones_axial_constant(geometry)

    def angle(approach: float) -> float:
        # sin(α-α0)/cos α = sin... solved in closed form: tan α = tan α0 + δ/(BD cos α0)
        return math.atan(math.tan(alpha0) + approach / (distance * math.cos(alpha0)))

    def side(approach: float) -> float:
        running = angle(approach)
        return math.sin(running) * max(math.cos(alpha0) / math.cos(running) - 1.0, 0.0) ** 1.5

    def excess(front_approach: float) -> float:
        return (
            scale * (front * side(front_approach) - rear * side(displacement_sum - front_approach)) - thrust
        )

    low, high = -distance, displacement_sum + 10.0 * distance
    if excess(low) > 0.0 or excess(high) < 0.0:
        raise NoEquilibriumError(
            "thrust", f"{thrust:g} N is more than the set can carry.", "Lower the thrust."
        )
    approach = float(brentq(excess, low, high, xtol=1e-16, rtol=1e-14))
    return angle(approach), angle(displacement_sum - approach)


def axial_force(geometry: BearingGeometry, approach: float) -> float:
    """Axial force at an axial approach from touching (m), contact constants at the running angle, N."""
    return _axial(geometry, approach)[0]


def _axial(geometry: BearingGeometry, approach: float) -> tuple[float, float, float]:
    distance, alpha0 = geometry.curvature_centre_distance, geometry.contact_angle
    axial, radial = distance * math.sin(alpha0) + approach, distance * math.cos(alpha0)
    length = math.hypot(axial, radial)
    cosine = radial / length
    table = contact_polynomials(geometry)[:, 0, :]
    constants = np.exp(np.polynomial.polynomial.polyval(2.0 * cosine - 1.0, table.T))
    constant = float(np.sum(constants ** (-2.0 / 3.0)) ** -1.5)
    load = constant * max(length - distance, 0.0) ** 1.5
    return geometry.ball_count * load * axial / length, math.atan2(axial, radial), load


def axial_state(geometry: BearingGeometry, force: float) -> AxialState:
    """Approach, angle, ball load and stiffness of one bearing under an axial force at rest.

    Parameters
    ----------
    force : float, [N]

    Raises
    ------
    NoEquilibriumError
        More force than the bearing carries before the balls climb the shoulder.

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> s = axial_state(g, 1137.2)
    >>> round(s.approach * 1e6, 3), round(s.stiffness * 1e-6, 2)
    (17.716, 107.6)
    """
    require_force("axial force", force)
    distance, alpha0 = geometry.curvature_centre_distance, geometry.contact_angle
    largest = min(geometry.largest_contact_angle, math.radians(89.0))
    highest = distance * (math.cos(alpha0) * math.tan(largest) - math.sin(alpha0))
    if axial_force(geometry, highest) < force:
        raise NoEquilibriumError(
            "axial force", f"{force:g} N lifts the balls over the shoulder at {math.degrees(largest):.1f}°.",
            f"Allowed: up to {axial_force(geometry, highest):.0f} N.",
        )  # fmt: skip
    approach = 0.0
    if force > 0.0:
        approach = float(
            brentq(lambda x: axial_force(geometry, x) - force, 0.0, highest, xtol=1e-18, rtol=1e-14)
        )
    total, angle, load = _axial(geometry, approach)
    step = 1e-6 * max(approach, 1e-7)
    stiffness = (axial_force(geometry, approach + step) - axial_force(geometry, approach - step)) / (
        2.0 * step
    )
    return AxialState(total, approach, angle, load, stiffness)


def unloading_thrust(
    geometries: tuple[BearingGeometry, ...], orientations: tuple[int, ...], preload: float, direction: int = 1
) -> float:
    """Thrust at which the counter bearings of a rigidly preloaded set come free at rest, N.

    Parameters
    ----------
    preload : float, [N]
        Force through the set.
    direction : {+1, -1}
        Of the thrust along z.

    Returns
    -------
    float
        Infinite for a set without counter bearings.

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> round(unloading_thrust((g, g), (1, -1), 1137.2) / 1137.2, 2)
    3.35
    """
    loaded = [g for g, s in zip(geometries, orientations, strict=True) if s == direction]
    counter = [g for g, s in zip(geometries, orientations, strict=True) if s == -direction]
    if not loaded or not counter:
        return math.inf
    total = tandem_approach(tuple(loaded), preload) + tandem_approach(tuple(counter), preload)
    return sum(axial_force(geometry, total) for geometry in loaded)


@lru_cache(maxsize=1024)
def tandem_approach(geometries: tuple[BearingGeometry, ...], force: float) -> float:
    """Common axial approach of bearings in tandem that share a force, m."""
    require_force("preload", force)
    if force == 0.0:
        return 0.0
    if len(set(geometries)) == 1:
        return axial_state(geometries[0], force / len(geometries)).approach
    highest = max(axial_state(geometry, force).approach for geometry in geometries)
    return float(
        brentq(
            lambda x: sum(axial_force(g, x) for g in geometries) - force, 0.0, highest, xtol=1e-18, rtol=1e-14
        )
    )
