"""Sliding and shear stress over both contact ellipses of every ball (eqs 16-18, 23-25).

Sliding depends on the place across the groove only, pressure on both, so the
quadrature is a product: second-kind Gauss-Chebyshev across (its weight is the
strip's half length) and Gauss-Legendre in the angle along the strip (smooth
at the ellipse's edge, where the pressure has a vertical tangent).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.ball_system import BallSystem, Contacts, ellipse_axes
from spindle_fem.physics.bearings.grease import ROELANDS_LOGARITHM, ROELANDS_PRESSURE
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.lubricant_film import (
    film_central_hamrock_dowson,
    film_groups,
    thermal_reduction,
)
from spindle_fem.physics.bearings.rough_surface import SurfaceRoughness, contact_area_ratio

FloatArray = NDArray[np.float64]
_SIDE_SIGN = np.array([-1.0, 1.0])


@dataclass(frozen=True, slots=True)
class TractionOptions:
    """Choices of the friction model.

    Attributes
    ----------
    limit : {"vector", "separate"}
        Whether the limiting stress bounds the resultant, or each direction by
        itself as in the paper (which lets the resultant exceed it by √2).
    thermal_film : {"wilson", "gupta", "none"}
    drag_coefficient : float, [-]
        Of a ball in the lubricant in its path.
    drag_exponent : float, [-]
        Of the ball speed: 1.95 as in the paper (speed in m/s), 2 for ½ρC_dAv².
    creep_ratio : float, [-]
        Slide-roll ratio that elastic creep of the surfaces alone takes up at
        the limiting stress. It caps the viscosity at high pressure, where the
        film would be rigid against any sliding, and fades the friction of
        asperities towards rest.
    nodes_across, nodes_along : int
        Quadrature; 20 by 6 integrates the heat to 1 % under heavy load and to
        1e-3 under spindle loads (tested).
    """

    limit: Literal["vector", "separate"] = "vector"
    thermal_film: Literal["wilson", "gupta", "none"] = "wilson"
    drag_coefficient: float = 0.4
    drag_exponent: float = 1.95
    creep_ratio: float = 1e-4
    nodes_across: int = 20
    nodes_along: int = 6


@dataclass(frozen=True, slots=True, eq=False)
class LubricantState:
    """Lubricant of each ball at its temperature, each (n,).

    Attributes
    ----------
    viscosity, viscosity_slope : ndarray, [Pa s], [Pa s/K]
    pressure_viscosity : ndarray, [1/Pa]
    pressure_exponent, limiting_shear_ratio, asperity_friction, film_starvation : ndarray, [-]
    thermal_conductivity : ndarray, [W/(m K)]
    path_density : ndarray, [kg/m³]
        Lubricant in the balls' path.
    roughness : SurfaceRoughness or None
        Composite; None leaves asperities out.
    """

    viscosity: FloatArray
    viscosity_slope: FloatArray
    pressure_viscosity: FloatArray
    pressure_exponent: FloatArray
    limiting_shear_ratio: FloatArray
    asperity_friction: FloatArray
    film_starvation: FloatArray
    thermal_conductivity: FloatArray
    path_density: FloatArray
    roughness: SurfaceRoughness | None


@lru_cache(maxsize=16)
def ellipse_quadrature(
    nodes_across: int, nodes_along: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Nodes q across (-1..1), weights, pressure factors along a strip, weights.

    ``Σ_i w_i Σ_j v_j f(q_i, √(1-q_i²) cos φ_j)`` integrates over the unit
    disc a function of q that is even along the strip, where the second
    argument is the pressure over its maximum.

    >>> q, w, c, v = ellipse_quadrature(24, 6)
    >>> round(float(w.sum() * v.sum()), 10)
    3.1415926536
    """
    index = np.arange(1, nodes_across + 1) * np.pi / (nodes_across + 1)
    across = np.cos(index)
    across_weight = np.pi / (nodes_across + 1) * np.sin(index) ** 2
    nodes, weights = np.polynomial.legendre.leggauss(nodes_along)
    angle = 0.25 * np.pi * (nodes + 1.0)
    along = np.cos(angle)
    # both halves of the strip; ds = cos φ dφ
    along_weight = 2.0 * 0.25 * np.pi * weights * along
    for array in (across, across_weight, along, along_weight):
        array.setflags(write=False)
    return across, across_weight, along, along_weight


@dataclass(frozen=True, slots=True, eq=False)
class ContactPatch:
    """Speed-independent quantities of the contact ellipses; arrays (..., n, 2[, q[, s]])."""

    load: FloatArray
    cosine: FloatArray
    semi_major: FloatArray
    semi_minor: FloatArray
    ellipticity: FloatArray
    pressure: FloatArray
    rolling_radius: FloatArray
    arm_axis: FloatArray
    arm_normal: FloatArray
    arm: FloatArray
    centre_arm: FloatArray
    inverse_viscosity: FloatArray
    inverse_limit: FloatArray
    local_pressure: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class TractionIntegrals:
    """Forces, moments and powers of the shear stress, (..., n, 2), inner first.

    Attributes
    ----------
    force_rolling, force_across : ndarray, [N]
        ∫τ_y' and ∫τ_x'.
    moment_axis, moment_normal, moment_across : ndarray, [N m]
        ∫τ_y' r' cos(α+θ), ∫τ_y' r' sin(α+θ), ∫τ_x' r'.
    power_rolling, power_across : ndarray, [W]
        Eqs 24 and 25.
    power_asperity : ndarray, [W]
        Share of both from touching asperities.
    entrainment_speed : ndarray, [m/s]
    film : ndarray, [m]
        Central film with all reductions.
    contact_ratio : ndarray, [-]
    """

    force_rolling: FloatArray
    force_across: FloatArray
    moment_axis: FloatArray
    moment_normal: FloatArray
    moment_across: FloatArray
    power_rolling: FloatArray
    power_across: FloatArray
    power_asperity: FloatArray
    entrainment_speed: FloatArray
    film: FloatArray
    contact_ratio: FloatArray


def build_patch(
    system: BallSystem, contacts: Contacts, lubricant: LubricantState, options: TractionOptions
) -> ContactPatch:
    """Ellipses, moment arms (eq. 16) and viscosity under pressure at the quadrature nodes."""
    across, _, along, _ = ellipse_quadrature(options.nodes_across, options.nodes_along)
    load = np.maximum(contacts.load, 0.0)
    cosine, sine = contacts.cosine, contacts.sine
    major, minor, kappa = ellipse_axes(system, cosine, load)
    area = np.pi * major * minor
    pressure = np.divide(1.5 * load, area, out=np.zeros_like(area), where=area > 0.0)
    ball = system.ball_diameter[:, None]
    gamma = system.diameter_ratio[:, None] * cosine
    rolling_radius = 0.5 * ball * (1.0 + _SIDE_SIGN * gamma)
    curvature = system.groove_curvature
    deformed = 2.0 * curvature * ball / (2.0 * curvature + 1.0)
    place = major[..., None] * across
    squared = major[..., None] ** 2
    # An ellipse wider than its ball, in a trial far from any equilibrium, has no height: NaN, then refused.
    with np.errstate(invalid="ignore"):
        height = (
            np.sqrt(deformed[..., None] ** 2 - place**2)
            - np.sqrt(deformed[..., None] ** 2 - squared)
            + np.sqrt(0.25 * ball[..., None] ** 2 - squared)
        )
        centre = (deformed - np.sqrt(deformed**2 - major**2)) + np.sqrt(0.25 * ball**2 - major**2)
    # pressure is even across the ellipse: one half of the nodes, mirrored, saves half the exponentials
    half = (len(across) + 1) // 2
    strip = pressure[..., None] * np.sqrt(1.0 - across[:half] ** 2)
    # at least 1 Pa: an unloaded contact then carries no stress instead of 0/0
    local = np.maximum(strip[..., None] * along, 1.0)
    exponent = lubricant.pressure_exponent[:, None, None, None]
    logarithm = (np.log(lubricant.viscosity) + ROELANDS_LOGARITHM)[:, None, None, None]
    rise = np.exp(exponent * np.log1p(ROELANDS_PRESSURE * local))

    def mirrored(values: FloatArray) -> FloatArray:
        return np.concatenate([values, values[..., : len(across) - half, :][..., ::-1, :]], axis=-2)

    return ContactPatch(
        load, cosine, major, minor, kappa, pressure, rolling_radius,
        height * cosine[..., None] - place * sine[..., None],
        height * sine[..., None] + place * cosine[..., None],
        np.sqrt(height**2 + place**2),
        centre,
        mirrored(np.exp(ROELANDS_LOGARITHM - logarithm * rise)),
        mirrored(1.0 / (lubricant.limiting_shear_ratio[:, None, None, None] * local)),
        mirrored(local),
    )  # fmt: skip


def sliding_speeds(
    system: BallSystem, patch: ContactPatch, speed: FloatArray, ball_speeds: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sliding along and across the rolling direction (eq. 17), and the entrainment speed.

    Ring speeds count relative to the cage, both positive; c_i = -1, c_o = +1.

    Parameters
    ----------
    speed : (n,) ndarray, [rad/s]
        Of the shaft.
    ball_speeds : (..., n, 4) ndarray, [rad/s]
        Orbital speed and the ball's three components about x', y', z'.

    Returns
    -------
    along, across : (..., n, 2, q) ndarray, [m/s]
    entrainment : (..., n, 2) ndarray, [m/s]
        Mean of both surface speeds in the centre of the ellipse.
    """
    orbital, about_x, about_y, about_z = (ball_speeds[..., k] for k in range(4))
    ring = np.stack([speed - orbital, orbital], axis=-1)
    half_pitch = 0.5 * system.pitch_diameter[:, None]
    relative = _SIDE_SIGN * ring - about_x[..., None]
    along = (
        (half_pitch * ring)[..., None]
        + patch.arm_axis * relative[..., None]
        - patch.arm_normal * about_z[..., None, None]
    )
    across = -patch.arm * about_y[..., None, None]
    sine = np.sqrt(np.maximum(1.0 - patch.cosine**2, 0.0))
    race = ring * (half_pitch + _SIDE_SIGN * patch.centre_arm * patch.cosine)
    ball = patch.centre_arm * (about_x[..., None] * patch.cosine + about_z[..., None] * sine)
    return along, across, 0.5 * np.abs(race + ball)


def integrate_traction(
    system: BallSystem,
    patch: ContactPatch,
    lubricant: LubricantState,
    options: TractionOptions,
    speed: FloatArray,
    ball_speeds: FloatArray,
) -> TractionIntegrals:
    """Shear stress (eq. 18) integrated over both ellipses of every ball."""
    _, across_weight, _, along_weight = ellipse_quadrature(options.nodes_across, options.nodes_along)
    along, across, entrainment = sliding_speeds(system, patch, speed, ball_speeds)
    film = central_film(system, patch, lubricant, options, entrainment)
    loaded = patch.load > 0.0
    film = np.where(loaded, film, 1.0)
    if lubricant.roughness is None:
        ratio = np.zeros_like(film)
    else:
        ratio = np.where(loaded, contact_area_ratio(film, lubricant.roughness), 0.0)
    area = (patch.semi_major * patch.semi_minor)[..., None]
    resultant = np.sqrt(along**2 + across**2)
    fade = options.creep_ratio * (entrainment + 1e-9)[..., None]
    creep = options.creep_ratio * entrainment[..., None, None] * patch.inverse_limit
    shear = film[..., None, None] * patch.inverse_viscosity + creep
    friction = lubricant.asperity_friction[:, None, None] * ratio[..., None]
    pressed = friction * (patch.local_pressure @ along_weight) if np.any(ratio > 0.0) else 0.0 * resultant

    def stress_over_speed(magnitude: FloatArray) -> tuple[FloatArray, FloatArray]:
        fluid = (1.0 / (shear + magnitude[..., None] * patch.inverse_limit)) @ along_weight
        return (1.0 - ratio[..., None]) * fluid, pressed / np.sqrt(magnitude**2 + fade**2)

    fluid_along, solid_along = stress_over_speed(resultant if options.limit == "vector" else np.abs(along))
    if options.limit == "vector":
        fluid_across, solid_across = fluid_along, solid_along
    else:
        fluid_across, solid_across = stress_over_speed(np.abs(across))
    weight = area * across_weight * loaded[..., None]
    solid = np.sum(weight * (solid_along * along**2 + solid_across * across**2), axis=-1)
    force_y = weight * (fluid_along + solid_along) * along
    force_x = weight * (fluid_across + solid_across) * across
    total = np.sum
    return TractionIntegrals(
        total(force_y, axis=-1),
        total(force_x, axis=-1),
        total(force_y * patch.arm_axis, axis=-1),
        total(force_y * patch.arm_normal, axis=-1),
        total(force_x * patch.arm, axis=-1),
        total(force_y * along, axis=-1),
        total(force_x * across, axis=-1),
        solid,
        entrainment,
        film,
        ratio,
    )


def central_film(
    system: BallSystem,
    patch: ContactPatch,
    lubricant: LubricantState,
    options: TractionOptions,
    entrainment: FloatArray,
) -> FloatArray:
    """Central film with thermal and starvation reduction, (..., n, 2), m."""
    column = (slice(None), None)
    modulus = (2.0 / system.compliance)[column]
    groups = film_groups(
        lubricant.viscosity[column], entrainment, np.maximum(patch.load, 1e-12), modulus,
        patch.rolling_radius, lubricant.pressure_viscosity[column],
    )  # fmt: skip
    film = film_central_hamrock_dowson(*groups, patch.ellipticity) * patch.rolling_radius
    reduction = thermal_reduction(
        lubricant.viscosity_slope[column], entrainment, lubricant.thermal_conductivity[column],
        model=options.thermal_film, pressure=patch.pressure, reduced_modulus=modulus,
    )  # fmt: skip
    return film * reduction * lubricant.film_starvation[column]


def ball_drag(
    system: BallSystem, lubricant: LubricantState, options: TractionOptions, orbital: FloatArray
) -> FloatArray:
    """Drag force F_v of the lubricant in the balls' path, (..., n), N (mass density: no g)."""
    area = np.pi / 32.0 * system.ball_diameter**2
    flow = np.abs(system.pitch_diameter * orbital) ** options.drag_exponent
    return area * lubricant.path_density * options.drag_coefficient * flow


__all__ = [
    "INNER", "OUTER", "ContactPatch", "LubricantState", "TractionIntegrals", "TractionOptions", "ball_drag",
    "build_patch", "central_film", "ellipse_quadrature", "integrate_traction", "sliding_speeds",
]  # fmt: skip
