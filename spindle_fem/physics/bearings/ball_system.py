"""Balls between rings that move together: geometry of eqs 19-21 and the bordered Newton method.

A system holds any number of balls, each with its own bearing; ``weight`` lets
one ball represent all of an axially loaded bearing. The rings' motion is a
short vector of displacements (axial, two radial, two tilts, or one common
shaft displacement of a whole preloaded set) that enters every ball through
``axial_map`` and ``radial_map``. Forces on the rings follow from the same maps
(virtual work), so one solver serves bearings and sets alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import INNER, OUTER, contact_polynomials
from spindle_fem.physics.bearings.rings import RingCompliance, RingLaw
from spindle_fem.physics.bearings.seat_contact import CoupledRings, SeatedLaw

FloatArray = NDArray[np.float64]

# Newton method: residual below which an answer counts, and where iteration ends.
_ACCEPTED = 1e-7
_MOST_ITERATIONS = 60


@dataclass(frozen=True, slots=True, eq=False)
class BallSystem:
    """Balls, the grooves they run in and the movement of the grooves with the rings' displacements.

    Attributes
    ----------
    ball_diameter, pitch_diameter, mass, inertia, compliance, weight : (n,) ndarray, SI
        ``weight`` is the number of balls that a row represents.
    groove_curvature : (n, 2) ndarray, [-]
    rest_length : (n, 2) ndarray, [m]
        Groove radius less ball radius, at the temperatures of ring and ball.
    start : (n, 2) ndarray, [m]
        Axial (A1) and radial (A2) distance of the groove centres at zero displacement.
    axial_map, radial_map : (n, m) ndarray
        dA1/dq and dA2/dq.
    polynomials : (n, 2, 4, k) ndarray
        Of ``hertz.contact_polynomials``.
    smoothing : float, [m]
        Width over which contact sets in; above 0 only on the way to a
        solution, where a free ball would leave the Newton matrix singular.
    rings : RingCompliance, CoupledRings or None
        Displacements that are raceway growths, held by rings that give way;
        None: rigid rings.
    stiffness : (m,) ndarray or None, [N/m]
        Of linear springs that hold displacements; None: none do.
    """

    ball_diameter: FloatArray
    pitch_diameter: FloatArray
    mass: FloatArray
    inertia: FloatArray
    compliance: FloatArray
    weight: FloatArray
    groove_curvature: FloatArray
    rest_length: FloatArray
    start: FloatArray
    axial_map: FloatArray
    radial_map: FloatArray
    polynomials: FloatArray
    smoothing: float = 0.0
    rings: RingCompliance | CoupledRings | None = None
    stiffness: FloatArray | None = None

    @property
    def number(self) -> int:
        """Number of balls that are solved for."""
        return len(self.weight)

    @property
    def diameter_ratio(self) -> FloatArray:
        """γ' = ball diameter over pitch diameter."""
        return self.ball_diameter / self.pitch_diameter

    def groove_distances(self, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A1 and A2 of eq. 19 at ring displacements, each (n,), m."""
        return (
            self.start[:, 0] + self.axial_map @ displacement,
            self.start[:, 1] + self.radial_map @ displacement,
        )


def build_ball_rows(
    geometry: BearingGeometry,
    azimuth: FloatArray,
    weight: float,
    *,
    ring_rise: tuple[float, float] = (0.0, 0.0),
    ball_rise: float = 0.0,
    radial_growth: float = 0.0,
    axial_offset: float = 0.0,
    place: tuple[int, float] = (1, 0.0),
) -> dict[str, FloatArray]:
    """Arrays of one bearing for ``BallSystem``, with five displacements of the inner ring.

    Parameters
    ----------
    azimuth : (n,) ndarray, [rad]
    weight : float
        Number of balls that each row represents.
    ring_rise : (inner, outer), [K]
        Temperature above assembly.
    ball_rise : float, [K]
    radial_growth : float, [m]
        Of the inner raceway, from rotation and fit.
    axial_offset : float, [m]
        Axial approach of the rings at zero displacement (preload).
    place : (orientation, axial position [m])
        Orientation +1: displacement towards +z loads the bearing. Position of the bearing's centre
        from the point that the displacements refer to.

    Returns
    -------
    dict of str to ndarray
        Displacements are (axial, radial cos, radial sin, tilt cos, tilt sin); a
        positive tilt moves the ring towards +z at the azimuth it is named by.
    """
    n = len(azimuth)
    orientation, axial_position = place
    alpha0, ball = geometry.contact_angle, geometry.ball_diameter
    curvature = np.array([geometry.groove_curvature_inner, geometry.groove_curvature_outer])
    expansion, ball_expansion = geometry.thermal_expansion, geometry.ball_thermal_expansion
    ball_radius = 0.5 * ball * (1.0 + ball_expansion * ball_rise)
    rest = curvature * ball * (1.0 + expansion * np.asarray(ring_rise)) - ball_radius
    radial_change = expansion * (
        geometry.inner_groove_centre_radius * ring_rise[INNER]
        - geometry.outer_groove_centre_radius * ring_rise[OUTER]
    )
    distance = geometry.curvature_centre_distance
    start = np.array(
        [distance * np.sin(alpha0) + axial_offset, distance * np.cos(alpha0) + radial_change + radial_growth]
    )
    lever = geometry.inner_groove_centre_radius
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    axial_map = orientation * np.column_stack(
        [np.ones(n), np.zeros(n), np.zeros(n), lever * cosine, lever * sine]
    )
    # a tilt that lifts the ring towards +z at azimuth 0 carries a bearing at +z against the radial direction
    radial_map = np.column_stack(
        [np.zeros(n), cosine, sine, -axial_position * cosine, -axial_position * sine]
    )
    full = np.full
    return {
        "ball_diameter": full(n, 2.0 * ball_radius),
        "pitch_diameter": full(n, geometry.pitch_diameter),
        "mass": full(n, geometry.ball_mass),
        "inertia": full(n, geometry.ball_inertia),
        "compliance": full(n, geometry.contact_compliance),
        "weight": full(n, float(weight)),
        "groove_curvature": np.tile(curvature, (n, 1)),
        "rest_length": np.tile(rest, (n, 1)),
        "start": np.tile(start, (n, 1)),
        "axial_map": axial_map,
        "radial_map": radial_map,
        "polynomials": np.broadcast_to(
            contact_polynomials(geometry), (n, *contact_polynomials(geometry).shape)
        ),
    }


def join_rows(
    rows: list[dict[str, FloatArray]],
    displacements: list[int],
    laws: Sequence[RingLaw | None] | SeatedLaw = (),
) -> BallSystem:
    """One system of several bearings' rows that keeps the displacements named by index.

    Every bearing with a ring law gets one displacement more, the growth of its
    inner raceway over the outer one, counted from ``start``; a :class:`SeatedLaw` is one for all of them.
    """
    joined = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
    axial_map, radial_map = joined["axial_map"][:, displacements], joined["radial_map"][:, displacements]
    coupled = isinstance(laws, SeatedLaw)
    seated = list(range(len(rows))) if coupled else [i for i, law in enumerate(laws) if law is not None]
    rings = None
    if seated:
        bearing = np.repeat(np.arange(len(rows)), [len(row["weight"]) for row in rows])
        growth = (bearing[:, None] == np.array(seated)).astype(float)
        columns = axial_map.shape[1] + np.arange(len(seated))
        axial_map = np.hstack([axial_map, np.zeros_like(growth)])
        radial_map = np.hstack([radial_map, growth])
        if coupled:
            rings = CoupledRings(columns, (laws,))
        else:
            rings = RingCompliance.of([laws[index] for index in seated], columns)
    joined |= {"axial_map": np.ascontiguousarray(axial_map), "radial_map": np.ascontiguousarray(radial_map)}
    return BallSystem(**joined, rings=rings)


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Contact angles, deformations and normal loads of every ball; arrays (..., n, 2), inner first."""

    cosine: NDArray
    sine: NDArray
    deformation: NDArray
    load: NDArray


def evaluate_contacts(
    system: BallSystem, centre: tuple[NDArray, NDArray], distance: tuple[NDArray, NDArray]
) -> Contacts:
    """Contacts of balls at given places (eqs 20, 21); works for complex steps.

    Parameters
    ----------
    centre : (X1, X2), each (..., n), [m]
        Ball centre from the outer groove's centre, axial and radial.
    distance : (A1, A2), each (..., n), [m]
        Inner groove's centre from the outer one's.
    """
    x1, x2 = centre
    axial = np.stack([distance[0] - x1, x1 + 0.0 * distance[0]], axis=-1)
    radial = np.stack([distance[1] - x2, x2 + 0.0 * distance[1]], axis=-1)
    length = np.sqrt(axial**2 + radial**2)
    cosine, sine = radial / length, axial / length
    deformation = length - system.rest_length
    pressed = pressed_part(system, deformation)
    load = load_constant(system, cosine) * pressed * np.sqrt(pressed)
    return Contacts(cosine, sine, deformation, load)


def pressed_part(system: BallSystem, deformation: NDArray) -> NDArray:
    """Deformation where the contact is closed, else 0, m."""
    if system.smoothing > 0.0:
        return 0.5 * (deformation + np.sqrt(deformation**2 + system.smoothing**2))
    return np.where(deformation.real > 0.0, deformation, 0.0)


def load_constant(system: BallSystem, cosine: NDArray) -> NDArray:
    """K of Q = K δ^1.5 at the running contact angle, (..., n, 2), N/m^1.5."""
    return np.exp(_polynomial(system.polynomials[:, :, 0, :], cosine))


def ellipse_axes(system: BallSystem, cosine: NDArray, load: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Semi-major and semi-minor axis (m) and ellipticity at the running contact angle."""
    size = np.cbrt(load)
    major = np.exp(_polynomial(system.polynomials[:, :, 1, :], cosine)) * size
    minor = np.exp(_polynomial(system.polynomials[:, :, 2, :], cosine)) * size
    return major, minor, np.exp(_polynomial(system.polynomials[:, :, 3, :], cosine))


def _polynomial(coefficients: FloatArray, cosine: NDArray) -> NDArray:
    argument = 2.0 * cosine - 1.0
    total = coefficients[..., -1] + 0.0 * argument
    for power in range(coefficients.shape[-1] - 2, -1, -1):
        total = total * argument + coefficients[..., power]
    return total


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Residual of every ball, its force on the inner ring, and their derivatives.

    Attributes
    ----------
    residual : (n, p) ndarray
    ring_force : (n, 2) ndarray, [N]
        Axial and radial force of the inner ring on the ball.
    by_unknown : (n, p + 2, p) ndarray
        Derivatives of residual and ring force by the ball's unknowns.
    by_distance : (n, p + 2, 2) ndarray
        The same by A1 and A2.
    """

    residual: FloatArray
    ring_force: FloatArray
    by_unknown: FloatArray
    by_distance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class BorderedSolution:
    """Final state of the Newton method; ``converged`` is true if the residual is small enough.

    ``tangent`` is the stiffness of the ring displacements, (m, m), N/m and
    N m/rad, with every ball in equilibrium.
    """

    unknowns: FloatArray
    displacement: FloatArray
    residual: float
    converged: bool
    iterations: int
    tangent: FloatArray


def solve_bordered(
    system: BallSystem,
    evaluate: Callable[[FloatArray, FloatArray, FloatArray], Evaluation],
    unknowns: FloatArray,
    displacement: FloatArray,
    load: FloatArray,
    *,
    scales: tuple[FloatArray, FloatArray],
    step_limit: float,
    tolerance: float = 1e-11,
) -> BorderedSolution:
    """Damped Newton method for all balls and the ring displacements at once.

    Each ball couples only to the rings, so the Jacobian is an arrow: balls are
    eliminated block by block and the rings' few equations solved densely.

    Parameters
    ----------
    evaluate : callable
        ``(unknowns (n, p), A1 (n,), A2 (n,)) -> Evaluation``; the first two
        unknowns of a ball are X1 and X2 when p > 0.
    load : (m,) ndarray, [N, N m]
        External load conjugate to each displacement.
    scales : (rows (n, p) ndarray, loads (m,) ndarray)
        Size of each residual row, and of each load, that counts as 1.
    step_limit : float, [m]
        Largest change of a length in one step.
    tolerance : float
        Iteration goes on to it while it gains; the answer counts as converged below 1e-7 already.
    """
    row_scale, load_scale = scales
    weight = system.weight[:, None]
    lever = np.maximum(np.abs(system.axial_map).max(axis=0), np.abs(system.radial_map).max(axis=0))
    x, q = unknowns.copy(), displacement.copy()
    current = evaluate(x, *system.groove_distances(q))
    ring, fall = _ring_residual(system, current, load, q)
    merit = _merit(current, ring, row_scale, load_scale)
    iterations, fresh = 0, True
    while iterations < _MOST_ITERATIONS and merit > tolerance:
        iterations += 1
        tangent, solved_residual, solved_distance = _tangent(system, current, fall)
        if len(q):
            p = x.shape[1]
            force_change = -np.einsum("nij,nj->ni", current.by_unknown[:, p:, :], solved_residual)
            weighted = weight * force_change
            right = -(ring + system.axial_map.T @ weighted[:, 0] + system.radial_map.T @ weighted[:, 1])
            step_q = _solve_rings(tangent, right)
        else:
            step_q = np.zeros(0)
        distance_step = np.stack([system.axial_map @ step_q, system.radial_map @ step_q], axis=-1)
        step_x = -solved_residual - np.einsum("nij,nj->ni", solved_distance, distance_step)
        largest = float(np.max(np.abs(step_q) * lever, initial=0.0))
        if x.shape[1]:
            largest = max(largest, float(np.max(np.abs(step_x[:, :2]))))
        if not np.isfinite(largest) or not np.isfinite(step_x).all():
            break
        fraction = min(1.0, step_limit / largest) if largest > 0.0 else 1.0
        fresh = False
        for _ in range(9):
            trial_q = q + fraction * step_q
            trial = evaluate(x + fraction * step_x, *system.groove_distances(trial_q))
            trial_ring, trial_fall = _ring_residual(system, trial, load, trial_q)
            trial_merit = _merit(trial, trial_ring, row_scale, load_scale)
            if trial_merit < merit * (1.0 - 1e-3 * fraction):
                fresh = True
                break
            fraction *= 0.5
        if not fresh:
            break
        x, q = x + fraction * step_x, q + fraction * step_q
        current, ring, fall, merit = trial, trial_ring, trial_fall, trial_merit
    tangent = _tangent(system, current, fall)[0]
    return BorderedSolution(x, q, merit, bool(merit < max(_ACCEPTED, tolerance)), iterations, tangent)


def _solve_rings(tangent: FloatArray, right: FloatArray) -> FloatArray:
    """Displacement step; the shortest one where the rings can move without force, NaN if there is none."""
    if not (np.isfinite(tangent).all() and np.isfinite(right).all()):
        return np.full_like(right, np.nan)
    try:
        step = np.linalg.solve(tangent, right)
    except np.linalg.LinAlgError:
        return np.linalg.lstsq(tangent, right, rcond=1e-14)[0]
    return step if np.isfinite(step).all() else np.linalg.lstsq(tangent, right, rcond=1e-14)[0]


def _ring_residual(
    system: BallSystem, evaluation: Evaluation, load: FloatArray, displacement: FloatArray
) -> tuple[FloatArray, FloatArray | None]:
    """Forces on the rings that are not in balance, and how those of rings that give way fall."""
    weighted = system.weight[:, None] * evaluation.ring_force
    residual = system.axial_map.T @ weighted[:, 0] + system.radial_map.T @ weighted[:, 1] - load
    if system.stiffness is not None:
        residual += system.stiffness * displacement
    if system.rings is None:
        return residual, None
    force, fall = system.rings.force(displacement)
    residual[system.rings.columns] -= force
    return residual, fall


def _merit(evaluation: Evaluation, ring: FloatArray, row_scale: FloatArray, load_scale: FloatArray) -> float:
    merit = max(
        float(np.max(np.abs(evaluation.residual) / row_scale, initial=0.0)),
        float(np.max(np.abs(ring) / load_scale, initial=0.0)),
    )
    return merit if np.isfinite(merit) else np.inf


def _tangent(
    system: BallSystem, evaluation: Evaluation, fall: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ring stiffness with the balls eliminated, and J_xx⁻¹R, J_xx⁻¹J_xA of every ball."""
    p = evaluation.residual.shape[1]
    if p:
        block = evaluation.by_unknown[:, :p, :]
        right = np.concatenate([evaluation.residual[:, :, None], evaluation.by_distance[:, :p, :]], axis=2)
        try:
            solved = np.linalg.solve(block, right)
        except np.linalg.LinAlgError:
            solved = np.linalg.pinv(block) @ right
        solved_residual, solved_distance = solved[:, :, 0], solved[:, :, 1:]
        stiffness = evaluation.by_distance[:, p:, :] - evaluation.by_unknown[:, p:, :] @ solved_distance
    else:
        solved_residual = np.zeros_like(evaluation.residual)
        solved_distance = np.zeros((system.number, 0, 2))
        stiffness = evaluation.by_distance
    maps = np.stack([system.axial_map, system.radial_map], axis=1)
    rows = maps.reshape(2 * system.number, maps.shape[2])
    tangent = rows.T @ (system.weight[:, None, None] * (stiffness @ maps)).reshape(rows.shape)
    if system.rings is not None:
        columns = system.rings.columns
        tangent[np.ix_(columns, columns)] += fall
    if system.stiffness is not None:
        tangent[np.diag_indices_from(tangent)] += system.stiffness
    return tangent, solved_residual, solved_distance
