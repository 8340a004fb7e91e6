"""Ball equilibrium that friction decides (eqs 22 and 23): six unknowns a ball."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.ball_system import BallSystem, Contacts, Evaluation, evaluate_contacts
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.race_control import (
    race_control_evaluation,
    race_control_friction,
    race_control_speeds,
)
from spindle_fem.physics.bearings.traction import (
    LubricantState,
    TractionIntegrals,
    TractionOptions,
    ball_drag,
    build_patch,
    integrate_traction,
)

FloatArray = NDArray[np.float64]
_LENGTH_STEP = 2e-11
_SPEED_STEP = 1e-7


def friction_evaluation(
    system: BallSystem,
    speed: FloatArray,
    lubricant: LubricantState,
    options: TractionOptions,
    unknowns: FloatArray,
    axial: FloatArray,
    radial: FloatArray,
    carried: NDArray[np.bool_] | None = None,
) -> Evaluation:
    """Residual of eqs 22 and 23 for every ball, with derivatives by differences.

    Unknowns of a ball: X1, X2 (m), orbital speed, and its speeds about x', y',
    z' (rad/s). Residual rows: radial, axial and tangential force (N), moments
    about x', y', z' (N m). A ball that has left the inner race has no traction
    to decide its motion: it follows outer race control, carried by the cage. So
    do the balls marked ``carried``, (n,).
    """
    centre = np.stack([unknowns[:, :2]] * 3)
    centre[1, :, 0] += _LENGTH_STEP
    centre[2, :, 1] += _LENGTH_STEP
    ball_speeds = unknowns[:, 2:]
    speed_step = _SPEED_STEP * np.abs(speed)
    perturbed = ball_speeds + speed_step[:, None] * np.eye(4)[:, None, :]

    contacts = evaluate_contacts(system, (centre[..., 0], centre[..., 1]), (axial, radial))
    patch = build_patch(system, contacts, lubricant, options)
    moved = integrate_traction(system, patch, lubricant, options, speed, ball_speeds)
    base_contacts = _pick(contacts, 0)
    turned = integrate_traction(system, _pick(patch, 0), lubricant, options, speed, perturbed)

    sides = _side_terms(contacts, moved)
    body = _body_terms(system, lubricant, options, ball_speeds)
    base_sides = sides[0]
    by_place = (sides[1:] - base_sides) / _LENGTH_STEP
    turned_sides = _side_terms(base_contacts, turned)
    turned_body = _body_terms(system, lubricant, options, perturbed)
    by_speed = ((turned_sides - base_sides).sum(axis=-2) + _pad(turned_body - body)) / speed_step[:, None]

    n = system.number
    values = base_sides.sum(axis=-2) + _pad(body)
    by_unknown = np.empty((n, 8, 6))
    by_unknown[:, :, :2] = np.moveaxis(by_place.sum(axis=-2), 0, -1)
    by_unknown[:, :, 2:] = np.moveaxis(by_speed, 0, -1)
    # the inner contact sees A - X, so A acts as minus the inner part of X
    by_distance = -np.moveaxis(by_place[..., INNER, :], 0, -1)

    lost = ~(base_contacts.load[:, INNER] > 0.0)
    if carried is not None:
        lost |= carried
    if lost.any():
        _follow_race_control(system, speed, unknowns, (axial, radial), lost, values, by_unknown, by_distance)
    return Evaluation(values[:, :6], values[:, 6:], by_unknown, by_distance)


def _pick(record, index: int):
    return type(record)(*(getattr(record, name)[index] for name in type(record).__slots__))


def _pad(body: FloatArray) -> FloatArray:
    return np.concatenate([body, np.zeros((*body.shape[:-1], 2))], axis=-1)


def _side_terms(contacts: Contacts, traction: TractionIntegrals) -> FloatArray:
    """Part of each contact in the six rows and in the ring force, (..., n, 2, 8)."""
    sign = np.array([-1.0, 1.0])
    radial = contacts.load * contacts.cosine - traction.force_across * contacts.sine
    axial = contacts.load * contacts.sine + traction.force_across * contacts.cosine
    radial, axial, tangential = np.broadcast_arrays(radial, axial, traction.force_rolling)
    on_ring = np.array([1.0, 0.0])
    return np.stack(
        [
            sign * radial, sign * axial, sign * tangential, traction.moment_axis, traction.moment_across,
            traction.moment_normal, on_ring * axial, on_ring * radial,
        ],
        axis=-1,
    )  # fmt: skip


def _body_terms(
    system: BallSystem, lubricant: LubricantState, options: TractionOptions, ball_speeds: FloatArray
) -> FloatArray:
    """Centrifugal force, drag and gyroscopic moments, (..., n, 6)."""
    orbital, _, about_y, about_z = (ball_speeds[..., k] for k in range(4))
    zero = np.zeros_like(orbital)
    return np.stack(
        [
            -0.5 * system.mass * system.pitch_diameter * orbital**2,
            zero,
            ball_drag(system, lubricant, options, orbital),
            zero,
            -system.inertia * orbital * about_z,
            system.inertia * orbital * about_y,
        ],
        axis=-1,
    )


def _follow_race_control(
    system: BallSystem,
    speed: FloatArray,
    unknowns: FloatArray,
    distance: tuple[FloatArray, FloatArray],
    lost: NDArray[np.bool_],
    values: FloatArray,
    by_unknown: FloatArray,
    by_distance: FloatArray,
) -> None:
    """Replace the rows of balls off the inner race: forces under race control, its speeds."""
    plain = race_control_evaluation(system, speed, OUTER, unknowns[:, :2], *distance)
    contacts = evaluate_contacts(system, (unknowns[:, 0], unknowns[:, 1]), distance)
    speeds = race_control_speeds(contacts.cosine, contacts.sine, system.diameter_ratio, speed, OUTER)
    target = np.stack(
        [speeds.orbital, speeds.spin * speeds.axis_cosine, 0.0 * speeds.spin, speeds.spin * speeds.axis_sine],
        axis=-1,
    )
    # forces of the size of the ball's weight in rows that are otherwise N and N m
    row_size = np.array([1.0, 1.0, 1.0, 1.0]) * (system.mass * system.pitch_diameter * np.abs(speed))[:, None]
    values[lost, :2] = plain.residual[lost]
    values[lost, 2:6] = (row_size * (unknowns[:, 2:] - target))[lost]
    values[lost, 6:] = plain.ring_force[lost]
    by_unknown[lost] = 0.0
    by_unknown[lost, :2, :2] = plain.by_unknown[lost, :2]
    by_unknown[lost, 6:, :2] = plain.by_unknown[lost, 2:]
    by_unknown[np.ix_(lost, range(2, 6), range(2, 6))] = np.eye(4) * row_size[lost][:, :, None]
    by_distance[lost] = 0.0
    by_distance[lost, :2] = plain.by_distance[lost, :2]
    by_distance[lost, 6:] = plain.by_distance[lost, 2:]


def start_from_race_control(
    system: BallSystem, speed: FloatArray, centre: FloatArray, distance: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """First guess of all six unknowns, (n, 6), from an outer-race-control solution."""
    contacts = evaluate_contacts(system, (centre[:, 0], centre[:, 1]), distance)
    speeds = race_control_speeds(contacts.cosine, contacts.sine, system.diameter_ratio, speed, OUTER)
    moment = system.inertia * speeds.orbital * speeds.spin * speeds.axis_sine
    inner, outer = race_control_friction(system, contacts, moment, OUTER)
    # a slow gyroscopic slip gives the traction a sign to start from
    share = np.abs(inner + outer) / np.maximum(contacts.load.sum(axis=-1), 1e-9)
    return np.column_stack(
        [
            centre,
            speeds.orbital,
            speeds.spin * speeds.axis_cosine,
            -0.01 * np.minimum(share, 0.1) * speeds.spin,
            speeds.spin * speeds.axis_sine,
        ]
    )
