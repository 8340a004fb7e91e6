"""Conduction between raceway, ball or roller, and lubricant.

The paper's Table 1 has the constriction of contacts at rest. A ball that rolls brings a fresh surface to
each contact before heat has spread there, so that far more passes the metal; the oil film between is then
what resists.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipkm1

from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.line_contact import (
    half_roller_resistance,
    ring_constriction,
    wedge_conductance,
)
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry

FloatArray = NDArray[np.float64]
STEEL_CONDUCTIVITY = 46.0
# ρ c_p of bearing steel, J/(m³ K)
STEEL_CAPACITY = 7810.0 * 475.0
OIL_HEAT_CAPACITY = 1900.0
# Of the mean of √(length) over the strips of an ellipse: 4/3 B(1/2, 7/4)/B(1/2, 3/2).
_ELLIPSE = 1.2204
# Of the film's thickness: where oil beside a contact is counted to.
_WEDGE_END = 2.0
# Gap that roughness keeps open where a roller just touches.
_LEAST_GAP = 0.1e-6


@dataclass(frozen=True, slots=True)
class BallConductance:
    """Conductance of all balls of a bearing together, W/K.

    Attributes
    ----------
    inner, outer : float, [W/K]
        Raceway to the balls' middle: through the contact, and the lubricant around the ball beside it.
    inner_contact, outer_contact : float, [W/K]
        Through the contact alone: both bodies, half the ball, and the film between them; the wedge of
        lubricant where there is no contact.
    lubricant : float, [W/K]
        Film of the lubricant in the balls' path, to each raceway.
    """

    inner: float
    outer: float
    inner_contact: float
    outer_contact: float
    lubricant: float


def constriction_resistance(
    semi_major: ArrayLike, semi_minor: ArrayLike, thermal_conductivity: ArrayLike
) -> FloatArray:
    """Constriction resistance of an elliptic contact in *one* half-space, ψ/(4 k a).

    Parameters
    ----------
    semi_major, semi_minor : array_like, [m]
    thermal_conductivity : array_like, [W/(m K)]

    Returns
    -------
    ndarray, [K/W]
        Infinite without contact. Add both bodies.

    Source: Table 1, with ψ = (2/π) K(m = 1 - b²/a²).

    Circle of 1 mm radius: 1/(4 k a).

    >>> float(constriction_resistance(1e-3, 1e-3, 50.0))
    5.0
    """
    major, minor = np.asarray(semi_major, float), np.asarray(semi_minor, float)
    if np.any(minor > major * (1.0 + 1e-12)):
        raise SpecError("semi_minor", "it exceeds the semi-major axis.", "Give a >= b.")
    touching = major > 0.0
    ratio = np.divide(minor, major, out=np.ones_like(major), where=touching)
    shape = 2.0 / np.pi * ellipkm1(ratio**2)
    with np.errstate(divide="ignore"):
        return np.where(touching, shape / (4.0 * np.asarray(thermal_conductivity) * major), np.inf)


def ball_resistance(ball_diameter: float, thermal_conductivity: float) -> float:
    """Resistance of one ball from contact to contact, 2/(π k D), K/W: a crude one-dimensional figure.

    >>> round(ball_resistance(14.2875e-3, 46.0), 3)
    0.969
    """
    return 2.0 / (np.pi * thermal_conductivity * ball_diameter)


def ball_film_coefficient(
    ball_diameter: float, flow_speed: ArrayLike, kinematic_viscosity: float, lubricant: Lubricant, *,
    density: float, heat_capacity: float = OIL_HEAT_CAPACITY,
) -> FloatArray:  # fmt: skip
    """Film coefficient of lubricant around a ball, 0.33 (k/D) Re_D^½ Pr^0.4, W/(m² K).

    Parameters
    ----------
    flow_speed : array_like, [m/s]
        A third to all of the cage's surface speed (Harris).
    kinematic_viscosity : float, [m²/s]
    density, heat_capacity : float, [kg/m³], [J/(kg K)]
    """
    conductivity = lubricant.thermal_conductivity
    reynolds = np.abs(np.asarray(flow_speed, float)) * ball_diameter / kinematic_viscosity
    prandtl = heat_capacity * density * kinematic_viscosity / conductivity
    return 0.33 * conductivity / ball_diameter * np.sqrt(reynolds) * prandtl**0.4


def renewal_resistance(
    semi_major: ArrayLike,
    semi_minor: ArrayLike,
    speed: ArrayLike,
    thermal_conductivity: float,
    heat_capacity: float = STEEL_CAPACITY,
) -> FloatArray:
    """Resistance of a half-space whose surface moves under an elliptic contact, K/W.

    1.220 √(2 b α/(π u)) / (k A): the mean over the ellipse of what a band feels that enters cold and takes
    an even flux, each strip along the motion by itself.

    Parameters
    ----------
    semi_major, semi_minor : array_like, [m]
        Across and along the motion.
    speed : array_like, [m/s]
        Of the surface through the contact; NaN: at rest.
    thermal_conductivity : float, [W/(m K)]
    heat_capacity : float, [J/(m³ K)]

    Returns
    -------
    ndarray, [K/W]
        Infinite without contact or at rest.

    Range: Péclet number u b/α above about 10; 95 in the reference spindle.

    Source: Carslaw & Jaeger, Conduction of Heat in Solids, section 10.7 (fast band source); Muzychka &
    Yovanovich (2001), J. Heat Transfer 123, 624-632.

    >>> float(renewal_resistance(0.784e-3, 91.5e-6, 12.9, 46.0).round(2))
    0.88
    """
    major, minor = np.asarray(semi_major, float), np.asarray(semi_minor, float)
    diffusivity = thermal_conductivity / heat_capacity
    moving = np.abs(np.nan_to_num(np.asarray(speed, float)))
    area = np.pi * major * minor
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.sqrt(2.0 * minor * diffusivity / (np.pi * moving))
        return np.where(area * moving > 0.0, _ELLIPSE * depth / (thermal_conductivity * area), np.inf)


def oil_wedge(state: BearingState, thermal_conductivity: float) -> FloatArray:
    """Conductance of the oil between ball and raceway as far as the gap doubles, 2π k √(R_x R_y) ln 2, W/K.

    k times the integral of 1/(h + x²/2R_x + y²/2R_y) from h to 2 h; h itself drops out of it.

    Parameters
    ----------
    thermal_conductivity : float, [W/(m K)]
        Of the oil.

    Returns
    -------
    (n, 2) ndarray, [W/K]

    Range: gaps far below the ball's radius, over which the surfaces are paraboloids.

    Reference bearing, grease: 0.02 W/K a ball.
    """
    geometry = state.geometry
    ratio = geometry.diameter_ratio * np.cos(state.balls.contact_angle)
    grooves = np.array([geometry.groove_curvature_inner, geometry.groove_curvature_outer])
    along = 1.0 / (1.0 + ratio / (1.0 - ratio)), 1.0 / (1.0 - ratio / (1.0 + ratio))
    rolling = 0.5 * geometry.ball_diameter * np.stack((along[0][:, 0], along[1][:, 1]), axis=1)
    across = 0.5 * geometry.ball_diameter / (1.0 - 0.5 / grooves)
    return 2.0 * np.pi * thermal_conductivity * np.sqrt(rolling * across) * math.log(_WEDGE_END)


def film_conductance(state: BearingState, thermal_conductivity: float) -> FloatArray:
    """Conductance of the oil film in every contact, k A/h, and of the wedge of oil around it, W/K.

    Returns
    -------
    (n, 2) ndarray, [W/K]
        NaN where there is no film.
    """
    balls = state.balls
    area = np.pi * balls.semi_major * balls.semi_minor
    wedge = oil_wedge(state, thermal_conductivity)
    return thermal_conductivity * area / balls.film_central + wedge


def contact_resistance(
    state: BearingState,
    lubricant: Lubricant | None = None,
    *,
    ring_conductivity: float = STEEL_CONDUCTIVITY,
    ball_conductivity: float = STEEL_CONDUCTIVITY,
) -> tuple[float, float]:
    """Resistance from each raceway to the balls' middle, all balls in parallel, K/W.

    Per ball: what resists in the ring and in the ball, half the ball and, with lubricant, the film between.
    Each body conducts as at rest and as it does with a surface that is renewed, whichever is more, with a
    smooth passage. A ball that hardly touches, or not at all, has the wedge of lubricant instead.

    Returns
    -------
    (inner, outer) : float, [K/W]
        Infinite where no ball touches and there is no lubricant.

    Source: Muzychka & Yovanovich (2001), for the passage (root of the sum of squares).
    """
    balls = state.balls
    resistance = 0.5 * ball_resistance(state.geometry.ball_diameter, ball_conductivity)
    for conductivity in (ring_conductivity, ball_conductivity):
        still = constriction_resistance(balls.semi_major, balls.semi_minor, conductivity)
        moving = renewal_resistance(balls.semi_major, balls.semi_minor, balls.entrainment_speed, conductivity)
        with np.errstate(divide="ignore"):
            resistance = resistance + 1.0 / np.hypot(1.0 / still, 1.0 / moving)
    least = 0.0
    if lubricant is not None:
        film = film_conductance(state, lubricant.thermal_conductivity)
        resistance = resistance + np.where(np.isfinite(film), 1.0 / film, 0.0)
        least = oil_wedge(state, lubricant.thermal_conductivity)
    conductance = balls.weight @ np.maximum(1.0 / resistance, least)
    with np.errstate(divide="ignore"):
        inner, outer = 1.0 / conductance
    return float(inner), float(outer)


def roller_resistance(
    state: BearingState,
    lubricant: Lubricant | None,
    *,
    ring_conductivity: float,
    roller_conductivity: float,
) -> tuple[float, float]:
    """Resistance from each raceway to the rollers' middle, all rollers in parallel, K/W.

    Per roller: constriction in the ring and half the roller, from the strip that it touches. Where it
    bears nothing, lubricant at rest bridges the strip within which the gap doubles.

    Returns
    -------
    (inner, outer) : float, [K/W]
        Infinite where no roller touches and there is no lubricant.
    """
    geometry, balls = state.geometry, state.balls
    length, radius = geometry.roller_length, geometry.contact_radius
    gap = np.maximum(-balls.deformation, _LEAST_GAP)
    touching = balls.load > 0.0
    wedge = 0.0
    if lubricant is not None:
        wedge = wedge_conductance(gap, radius, length, lubricant.thermal_conductivity)
    spacing = 0.5 * np.pi * np.array(geometry.raceway_diameters) / geometry.roller_count
    # A strip under hardly any load is as wide as that across the least gap.
    strip = np.clip(
        np.where(touching, balls.semi_minor, np.sqrt(2.0 * radius * gap)),
        np.sqrt(2.0 * radius * _LEAST_GAP),
        spacing,
    )
    solid = ring_constriction(strip, spacing, length, ring_conductivity)
    solid += half_roller_resistance(strip, geometry.roller_diameter, length, roller_conductivity)
    with np.errstate(divide="ignore"):
        resistance = solid + np.where(touching, 0.0, 1.0 / np.asarray(wedge))
        inner, outer = 1.0 / (balls.weight @ (1.0 / resistance))
    return float(inner), float(outer)


def ball_conductance(
    state: BearingState,
    lubricant: Lubricant | None = None,
    *,
    ring_conductivity: float = STEEL_CONDUCTIVITY,
    ball_conductivity: float = STEEL_CONDUCTIVITY,
    flow_share: float = 1.0 / 3.0,
    wetted_share: float | None = None,
) -> BallConductance:
    """Conductance between each raceway and the balls or rollers of a bearing.

    Parameters
    ----------
    state : BearingState
        Gives the contacts and the orbital speed.
    lubricant : Lubricant, optional
        Adds the film around the balls in parallel.
    flow_share : float
        Flow speed over the cage's surface speed, a third to 1.
    wetted_share : float, optional
        Share of the ball's surface in lubricant; None: the path fill, which
        is small once the grease has channelled. Half of it faces each raceway.
    """
    geometry = state.geometry
    if isinstance(geometry, RollerGeometry):
        inner, outer = roller_resistance(
            state, lubricant, ring_conductivity=ring_conductivity, roller_conductivity=ball_conductivity
        )
        diameter = geometry.roller_diameter
        facing = 0.5 * np.pi * diameter * geometry.roller_length * geometry.number
    else:
        inner, outer = contact_resistance(
            state, lubricant, ring_conductivity=ring_conductivity, ball_conductivity=ball_conductivity
        )
        diameter = geometry.ball_diameter
        facing = 0.5 * np.pi * diameter**2 * geometry.ball_count
    film = 0.0
    if lubricant is not None and state.speed > 0.0:
        temperature = state.lubricant_temperature
        coefficient = ball_film_coefficient(
            diameter,
            flow_share * 0.5 * geometry.pitch_diameter * state.mean("orbital_speed"),
            float(lubricant.kinematic_viscosity(temperature)),
            lubricant,
            density=float(lubricant.oil_density(temperature)),
        )
        share = lubricant.path_fill if wetted_share is None else wetted_share
        film = float(coefficient * share * facing)
    return BallConductance(1.0 / inner + film, 1.0 / outer + film, 1.0 / inner, 1.0 / outer, film)


__all__ = [
    "INNER",
    "OUTER",
    "BallConductance",
    "ball_conductance",
    "ball_film_coefficient",
    "ball_resistance",
    "constriction_resistance",
    "contact_resistance",
    "film_conductance",
    "oil_wedge",
    "renewal_resistance",
    "roller_resistance",
]
