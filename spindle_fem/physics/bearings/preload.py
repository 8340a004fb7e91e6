"""Preload and thrust of axially loaded bearings at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from spindle_fem.bracketed_root import bracketed_root
from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import contact_polynomials


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


def require_force(where: str, force: float) -> None:
    """Refuse a preload that is negative or not finite."""
    if not math.isfinite(force) or force < 0.0:
        raise SpecError(where, f"preload is {force:g} N.", "It must not be negative.")


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
        approach = bracketed_root(
            lambda x: axial_force(geometry, x) - force, 0.0, highest, absolute=1e-18, relative=1e-14
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
    return bracketed_root(
        lambda x: sum(axial_force(g, x) for g in geometries) - force,
        0.0,
        highest,
        absolute=1e-18,
        relative=1e-14,
    )
