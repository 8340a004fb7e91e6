"""Ball equilibrium without friction: at rest, and under outer or inner raceway control (Jones)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.bearings.ball_system import (
    BallSystem,
    Contacts,
    Evaluation,
    evaluate_contacts,
    load_constant,
    pressed_part,
)
from spindle_fem.physics.bearings.hertz import INNER, OUTER

FloatArray = NDArray[np.float64]
_COMPLEX_STEP = 1e-30


@dataclass(frozen=True, slots=True, eq=False)
class BallSpeeds:
    """Speeds of balls under raceway control, each (..., n).

    Attributes
    ----------
    orbital, spin : ndarray, [rad/s]
        About the bearing axis, and about the ball's own axis.
    axis_cosine, axis_sine : ndarray, [-]
        cos β and sin β of the ball axis to the bearing axis.
    """

    orbital: NDArray
    spin: NDArray
    axis_cosine: NDArray
    axis_sine: NDArray


def race_control_speeds(
    cosine: NDArray, sine: NDArray, diameter_ratio: ArrayLike, speed: ArrayLike, control: int
) -> BallSpeeds:
    """Ball speeds when one raceway rolls without spin; the inner ring turns.

    Parameters
    ----------
    cosine, sine : (..., 2) ndarray, [-]
        Of the inner and outer contact angle.
    diameter_ratio : array_like, [-]
        γ' = D / d_m.
    speed : array_like, [rad/s]
    control : {INNER, OUTER}

    Source: Jones (1960); Harris & Kotzalas, Rolling Bearing Analysis, vol. 2.

    >>> angle = np.radians([[18.345, 14.850]])
    >>> s = race_control_speeds(np.cos(angle), np.sin(angle), 14.2875 / 165, 100 * np.pi, OUTER)
    >>> round(float(s.orbital[0]), 2)
    144.3
    """
    ci, co, si, so = cosine[..., INNER], cosine[..., OUTER], sine[..., INNER], sine[..., OUTER]
    difference = ci * co + si * so
    if control == OUTER:
        tangent = so / (co + diameter_ratio)
        orbital = (1.0 - diameter_ratio * ci) / (1.0 + difference) * speed
    else:
        tangent = si / (ci - diameter_ratio)
        orbital = (difference - diameter_ratio * ci) / (1.0 + difference) * speed
    beta_cosine = 1.0 / np.sqrt(1.0 + tangent**2)
    sum_of_races = (co + tangent * so) / (1.0 + diameter_ratio * co) + (ci + tangent * si) / (
        1.0 - diameter_ratio * ci
    )
    spin = speed / (diameter_ratio * beta_cosine * sum_of_races)
    return BallSpeeds(orbital, spin, beta_cosine, tangent * beta_cosine)


def static_evaluation(system: BallSystem, axial: FloatArray, radial: FloatArray) -> Evaluation:
    """Force of the inner ring on each ball at rest, where both contacts share one line."""
    one = 1j * _COMPLEX_STEP
    a1 = np.stack([axial + one, axial + 0j])
    a2 = np.stack([radial + 0j, radial + one])
    length = np.sqrt(a1**2 + a2**2)
    cosine = np.repeat((a2 / length)[..., None], 2, axis=-1)
    constants = load_constants_in_series(system, cosine)
    total = length - system.rest_length.sum(axis=1)
    pressed = pressed_part(system, total)
    force = constants * pressed * np.sqrt(pressed)
    components = np.stack([force * a1 / length, force * a2 / length], axis=-1)
    derivative = np.moveaxis(components.imag / _COMPLEX_STEP, 0, -1)
    n = system.number
    return Evaluation(np.zeros((n, 0)), components[0].real, np.zeros((n, 2, 0)), derivative)


def load_constants_in_series(system: BallSystem, cosine: NDArray) -> NDArray:
    """K_n of both contacts in series, (..., n), N/m^1.5."""
    constants = load_constant(system, cosine) ** (-2.0 / 3.0)
    return constants.sum(axis=-1) ** -1.5


def static_centres(system: BallSystem, axial: FloatArray, radial: FloatArray) -> FloatArray:
    """Ball centres X1, X2 at rest, (n, 2), m; free balls lie in the outer groove's bottom line."""
    length = np.hypot(axial, radial)
    cosine = np.repeat((radial / length)[:, None], 2, axis=-1)
    flexibility = load_constant(system, cosine) ** (-2.0 / 3.0)
    total = np.maximum(length - system.rest_length.sum(axis=1), 0.0)
    reach = system.rest_length[:, OUTER] + total * flexibility[:, OUTER] / flexibility.sum(axis=1)
    return np.column_stack([axial, radial]) * (reach / length)[:, None]


def seat_light_balls(
    system: BallSystem, centre: FloatArray, axial: FloatArray, radial: FloatArray, speed: float
) -> FloatArray:
    """Ball centres with lightly loaded balls moved to where centrifugal force holds them, (n, 2), m.

    A ball whose load at rest is below its centrifugal force lies in the bottom
    of the outer groove, or is wedged between both grooves where the inner one
    reaches into its way. Newton's method cannot find this from a touching
    ball, whose contacts have no stiffness.
    """
    contacts = evaluate_contacts(system, (centre[:, 0], centre[:, 1]), (axial, radial))
    orbital = 0.5 * (1.0 - system.diameter_ratio) * speed
    centrifugal = 0.5 * system.mass * system.pitch_diameter * orbital**2
    light = contacts.load[:, INNER] < centrifugal
    if not light.any():
        return centre
    constant = load_constant(system, contacts.cosine)
    rest_inner, rest_outer = system.rest_length[:, INNER], system.rest_length[:, OUTER]
    bottom = rest_outer + (centrifugal / constant[:, OUTER]) ** (2.0 / 3.0)
    wedged = np.hypot(axial, radial - bottom) > rest_inner
    seated = np.column_stack([np.zeros_like(bottom), bottom])
    length = np.hypot(axial, radial)
    reach_inner, reach_outer = rest_inner.copy(), rest_outer.copy()
    for _ in range(4):
        # the triangle of both groove centres and the ball, on the side of the smaller outer angle
        along = 0.5 * (length + (reach_outer**2 - reach_inner**2) / length)
        across = np.sqrt(np.maximum(reach_outer**2 - along**2, 0.0))
        x1 = (along * axial - across * radial) / length
        x2 = (along * radial + across * axial) / length
        outer = np.arctan2(x1, x2)
        inner = np.arctan2(axial - x1, radial - x2)
        opening = np.maximum(np.sin(inner - outer), 1e-3)
        push_outer = centrifugal * np.maximum(np.sin(inner), 0.0) / opening
        push_inner = centrifugal * np.maximum(np.sin(outer), 0.0) / opening
        reach_inner = rest_inner + (push_inner / constant[:, INNER]) ** (2.0 / 3.0)
        reach_outer = rest_outer + (push_outer / constant[:, OUTER]) ** (2.0 / 3.0)
    seated[wedged] = np.column_stack([x1, x2])[wedged]
    return np.where(light[:, None], seated, centre)


def race_control_evaluation(
    system: BallSystem,
    speed: FloatArray,
    control: int,
    unknowns: FloatArray,
    axial: FloatArray,
    radial: FloatArray,
) -> Evaluation:
    """Force balance of each ball (eq. 22) with the gyroscopic moment held by friction at the race.

    Unknowns are X1 and X2. Derivatives come from complex steps, exact to rounding.
    """
    one = 1j * _COMPLEX_STEP
    base = np.array([unknowns[:, 0], unknowns[:, 1], axial, radial])
    stacked = base[:, None, :] + one * np.eye(4)[:, :, None]
    contacts = evaluate_contacts(system, (stacked[0], stacked[1]), (stacked[2], stacked[3]))
    residual, ring = _balance(system, contacts, speed, control)
    values = np.concatenate([residual, ring], axis=-1)
    derivative = np.moveaxis(values.imag / _COMPLEX_STEP, 0, -1)
    return Evaluation(
        values[0, :, :2].real, values[0, :, 2:].real, derivative[:, :, :2], derivative[:, :, 2:]
    )


def _balance(
    system: BallSystem, contacts: Contacts, speed: FloatArray, control: int
) -> tuple[NDArray, NDArray]:
    speeds = race_control_speeds(contacts.cosine, contacts.sine, system.diameter_ratio, speed, control)
    moment = system.inertia * speeds.orbital * speeds.spin * speeds.axis_sine
    centrifugal = 0.5 * system.mass * system.pitch_diameter * speeds.orbital**2
    friction_inner, friction_outer = race_control_friction(system, contacts, moment, control)
    ci, co = contacts.cosine[..., INNER], contacts.cosine[..., OUTER]
    si, so = contacts.sine[..., INNER], contacts.sine[..., OUTER]
    qi, qo = contacts.load[..., INNER], contacts.load[..., OUTER]
    ring_axial = qi * si + friction_inner * ci
    ring_radial = qi * ci - friction_inner * si
    radial = qo * co - friction_outer * so - ring_radial - centrifugal
    axial = qo * so + friction_outer * co - ring_axial
    return np.stack([radial, axial], axis=-1), np.stack([ring_axial, ring_radial], axis=-1)


def race_control_friction(
    system: BallSystem, contacts: Contacts, moment: NDArray, control: int
) -> tuple[NDArray, NDArray]:
    """Friction forces across the groove that hold the gyroscopic moment, inner and outer, N.

    Outer control lets the outer race hold it all (λ_o = 2, λ_i = 0), inner
    control shares it; a ball that has left the inner race is held by the outer.
    """
    force = moment / system.ball_diameter
    if control == OUTER:
        return 0.0 * force, 2.0 * force
    touching = contacts.load[..., INNER].real > 0.0
    return np.where(touching, force, 0.0), np.where(touching, force, 2.0 * force)
