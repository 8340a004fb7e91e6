"""Quasi-static equilibrium of a ball system: rest, raceway control, friction; continued in speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError
from spindle_fem.physics.bearings.ball_system import (
    BallSystem,
    BorderedSolution,
    Contacts,
    evaluate_contacts,
    solve_bordered,
)
from spindle_fem.physics.bearings.friction_equilibrium import friction_evaluation, start_from_race_control
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.race_control import (
    race_control_evaluation,
    race_control_speeds,
    seat_light_balls,
    static_centres,
    static_evaluation,
)
from spindle_fem.physics.bearings.traction import LubricantState, TractionOptions, ball_drag

FloatArray = NDArray[np.float64]
RacewayControl = Literal["outer", "inner", "equilibrium"]
# N; residuals of a bearing without load are compared with it
_SMALLEST_FORCE = 1e-6
_SMALLEST_SPEED_STEP = 1.0 / 100.0
# Widths (m) of softened contact, and softened traction, on the way to a solution
_SMOOTHINGS = (2e-6, 3e-7, 5e-8, 1e-8, 1e-9, 1e-10, 1e-11, 0.0)
_CREEP_RATIOS = (2e-2, 3e-3, 5e-4)
# A ball counts as free below this share of the ball load of preload and thrust
_FREE_LOAD = 1e-3
# Newton steps within which an equilibrium is next to another.
_NEAR = 12
# A ball is left to the cage below this multiple of the traction it needs
_DRIVE_MARGIN = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """A state of a ball system that fulfils its equations.

    Attributes
    ----------
    displacement : (m,) ndarray, [m, rad]
        Of the rings.
    centre : (n, 2) ndarray, [m]
        X1, X2 of every ball.
    ball_speeds : (n, 4) ndarray, [rad/s]
        Orbital speed and the components about x', y', z'.
    tangent : (m, m) ndarray
        Stiffness of the ring displacements with all balls in equilibrium.
    residual : float, [-]
        Largest force residual over the largest ball load.
    carried : (n,) ndarray of bool
        Balls that friction at the inner race is too weak to drive: the cage
        carries them, with the speeds of outer race control.
    """

    displacement: FloatArray
    centre: FloatArray
    ball_speeds: FloatArray
    contacts: Contacts
    tangent: FloatArray
    residual: float
    iterations: int
    carried: NDArray[np.bool_]


def solve_equilibrium(
    system: BallSystem,
    speed: float,
    load: FloatArray,
    control: RacewayControl,
    *,
    at_rest: tuple[FloatArray, float],
    lubricant: LubricantState | None = None,
    options: TractionOptions | None = None,
    where: str = "bearing",
) -> Equilibrium:
    """Equilibrium of all balls and rings at a shaft speed.

    Tries the requested speed from the state at rest; if that fails, goes there in adaptive
    steps of speed.

    Parameters
    ----------
    speed : float, [rad/s]
        Of the inner rings; its sign does not matter.
    load : (m,) ndarray, [N, N m]
        Conjugate to the displacements.
    control : {"outer", "inner", "equilibrium"}
    at_rest : (displacement (m,) ndarray, ball load [N])
        First guess of the displacements at rest, and the size of the ball loads for scaling.
    lubricant, options
        Needed for ``"equilibrium"``.
    where : str
        Name for messages.

    Raises
    ------
    NoEquilibriumError
        No state found; the message says from which speed on.
    """
    magnitude = abs(speed)
    start, ball_load = at_rest
    solver = _Solver(system, load, control, ball_load, lubricant, options or TractionOptions())
    rest = solver.rest(start)
    if not rest.converged:
        raise NoEquilibriumError(
            where, f"no static equilibrium under this load (residual {rest.residual:.2g} of the load).",
            "Lower the radial load or moment, or raise axial load or preload.",
        )  # fmt: skip
    if magnitude == 0.0:
        return solver.finish(rest, 0.0)
    centre = static_centres(system, *system.groove_distances(rest.displacement))
    attempt = solver.moving(magnitude, centre, rest.displacement, None)
    if not attempt.converged:
        attempt = _continue_in_speed(solver, magnitude, centre, rest.displacement, where)
    return solver.finish(attempt.solution, magnitude, attempt.carried)


def equilibrium_near(
    system: BallSystem,
    speed: float,
    load: FloatArray,
    before: Equilibrium,
    ball_load: float,
    lubricant: LubricantState,
    options: TractionOptions,
) -> Equilibrium | None:
    """Equilibrium by friction next to one of the same balls under almost the same conditions.

    Parameters as of :func:`solve_equilibrium`; ``ball_load`` in N.

    Returns
    -------
    Equilibrium or None
        None where a few Newton steps do not lead there, or where other balls come free of their inner
        race: the way from rest decides then.
    """
    solver = _Solver(system, load, "equilibrium", ball_load, lubricant, options)
    free = solver._free_balls(before.centre, before.displacement)
    if np.any(before.carried != free):
        return None
    guess = np.column_stack([before.centre, before.ball_speeds])
    rows = solver._forces(speed)
    solution = solver._frictional(speed, guess, before.displacement, rows, options, free)
    if not solution.converged or solution.iterations > _NEAR:
        return None
    if np.any(solver._free_balls(solution.unknowns[:, :2], solution.displacement) != free):
        return None
    return solver.finish(solution, speed, free)


@dataclass(frozen=True, slots=True, eq=False)
class _Attempt:
    """A solution with the balls that it left to the cage."""

    solution: BorderedSolution
    carried: NDArray[np.bool_]

    @property
    def converged(self) -> bool:
        return self.solution.converged


@dataclass(frozen=True, slots=True, eq=False)
class _Solver:
    system: BallSystem
    load: FloatArray
    control: RacewayControl
    ball_load: float
    lubricant: LubricantState | None
    options: TractionOptions

    @property
    def nobody(self) -> NDArray[np.bool_]:
        """No ball carried by the cage."""
        return np.zeros(self.system.number, dtype=bool)

    def rest(self, start: FloatArray) -> BorderedSolution:
        """Displacements at rest, with softened contact where the plain method fails."""
        rows = self._forces(0.0)[:, :0]
        unknowns = np.zeros((self.system.number, 0))
        solution = None
        for smoothing in (0.0, *_SMOOTHINGS):
            system = replace(self.system, smoothing=smoothing)
            begin = start if solution is None else solution.displacement
            trial = self._newton(
                lambda _, axial, radial, system=system: static_evaluation(system, axial, radial),
                unknowns, begin, rows, self.ball_load,
            )  # fmt: skip
            if smoothing == 0.0 and trial.converged:
                return trial
            if smoothing > 0.0:
                solution = trial
        return trial

    def moving(
        self, speed: float, centre: FloatArray, displacement: FloatArray, ball_speeds: FloatArray | None
    ) -> _Attempt:
        """Solve at one speed; six unknowns a ball when friction decides, else two."""
        system = self.system
        rows = self._forces(speed)
        if self.control == "equilibrium" and ball_speeds is not None:
            guess = np.column_stack([centre, ball_speeds])
            free = self._free_balls(centre, displacement)
            solution = self._frictional(speed, guess, displacement, rows, self.options, free)
            if solution.converged:
                return _Attempt(solution, free)
        distance = system.groove_distances(displacement)
        centre = seat_light_balls(system, centre, *distance, speed)
        rough = self.control == "equilibrium"
        plain = self._race_control(speed, centre, displacement, rows, 1e-6 if rough else 1e-11)
        if self.control != "equilibrium" or not plain.converged:
            return _Attempt(plain, self.nobody)
        distance = system.groove_distances(plain.displacement)
        speeds = np.full(system.number, speed)
        guess = start_from_race_control(system, speeds, plain.unknowns, distance)
        free = self._free_balls(plain.unknowns, plain.displacement)
        guess[free, 4] = 0.0
        solution = self._frictional(speed, guess, plain.displacement, rows, self.options, free)
        if solution.converged:
            return _Attempt(solution, free)
        carried = free | weakly_driven(system, self.lubricant, self.options, guess, distance)
        for mask in (free, carried) if np.any(carried != free) else (free,):
            state, ring = guess, plain.displacement
            for creep in (*_CREEP_RATIOS, self.options.creep_ratio):
                softer = replace(self.options, creep_ratio=max(creep, self.options.creep_ratio))
                solution = self._frictional(speed, state, ring, rows, softer, mask)
                if np.isfinite(solution.residual):
                    state, ring = solution.unknowns, solution.displacement
            if solution.converged:
                return _Attempt(solution, mask)
        return _Attempt(solution, free)

    def _free_balls(self, centre: FloatArray, displacement: FloatArray) -> NDArray[np.bool_]:
        """Balls that only centrifugal force holds, (n,): their traction cannot decide anything."""
        contacts = evaluate_contacts(
            self.system, (centre[:, 0], centre[:, 1]), self.system.groove_distances(displacement)
        )
        return contacts.load[:, INNER] < _FREE_LOAD * self.ball_load

    def _race_control(
        self,
        speed: float,
        centre: FloatArray,
        displacement: FloatArray,
        rows: FloatArray,
        tolerance: float,
    ) -> BorderedSolution:
        """Raceway control; ``tolerance`` may be rough where it only starts another solution."""
        side = INNER if self.control == "inner" else OUTER
        speeds = np.full(self.system.number, speed)
        for smoothing in (0.0, *_SMOOTHINGS):
            system = replace(self.system, smoothing=smoothing)
            solution = self._newton(
                lambda x, axial, radial, system=system: race_control_evaluation(
                    system, speeds, side, x, axial, radial
                ),
                centre, displacement, rows, float(rows.max()), tolerance,
            )  # fmt: skip
            if smoothing == 0.0 and solution.converged:
                break
            if smoothing > 0.0:
                centre, displacement = solution.unknowns, solution.displacement
        return solution

    def _frictional(
        self,
        speed: float,
        guess: FloatArray,
        displacement: FloatArray,
        rows: FloatArray,
        options: TractionOptions,
        carried: NDArray[np.bool_],
    ) -> BorderedSolution:
        system = self.system
        speeds = np.full(system.number, speed)
        moments = 0.5 * rows[:, :1] * system.ball_diameter[:, None] * np.ones(3)
        scale = np.column_stack([rows, rows[:, :1], moments])
        return self._newton(
            lambda x, axial, radial: friction_evaluation(
                system, speeds, self.lubricant, options, x, axial, radial, carried
            ),
            guess, displacement, scale, float(rows.max()),
        )  # fmt: skip

    def _newton(
        self,
        evaluate: Callable,
        unknowns: FloatArray,
        displacement: FloatArray,
        rows: FloatArray,
        size: float,
        tolerance: float = 1e-11,
    ) -> BorderedSolution:
        system = self.system
        lever = np.maximum(np.abs(system.axial_map).max(axis=0), np.abs(system.radial_map).max(axis=0))
        balls = float(system.weight.sum())
        stretch = float(np.min(system.rest_length))
        size = max(size, _SMALLEST_FORCE)
        return solve_bordered(
            system, evaluate, unknowns, displacement, self.load,
            scales=(rows, np.maximum(size * balls * lever / 10.0, np.abs(self.load))),
            step_limit=0.1 * stretch, tolerance=tolerance,
        )  # fmt: skip

    def _forces(self, speed: float) -> FloatArray:
        """Size of the ball loads at a speed, (n, 2), N."""
        system = self.system
        orbital = 0.45 * speed
        centrifugal = 0.5 * system.mass * system.pitch_diameter * orbital**2
        size = np.full(system.number, max(self.ball_load, float(centrifugal.max()), 1e-9))
        return np.column_stack([size, size])

    def finish(
        self, solution: BorderedSolution, speed: float, carried: NDArray[np.bool_] | None = None
    ) -> Equilibrium:
        carried = self.nobody if carried is None else carried
        system = self.system
        distance = system.groove_distances(solution.displacement)
        if solution.unknowns.shape[1] == 0:
            centre = static_centres(system, *distance)
        else:
            centre = solution.unknowns[:, :2]
        contacts = evaluate_contacts(system, (centre[:, 0], centre[:, 1]), distance)
        if solution.unknowns.shape[1] == 6:
            ball_speeds = solution.unknowns[:, 2:]
        elif speed == 0.0:
            ball_speeds = np.zeros((system.number, 4))
        else:
            side = INNER if self.control == "inner" else OUTER
            speeds = race_control_speeds(contacts.cosine, contacts.sine, system.diameter_ratio, speed, side)
            ball_speeds = np.column_stack(
                [
                    speeds.orbital,
                    speeds.spin * speeds.axis_cosine,
                    0.0 * speeds.spin,
                    speeds.spin * speeds.axis_sine,
                ]
            )
        return Equilibrium(
            solution.displacement, centre, ball_speeds, contacts, solution.tangent, solution.residual,
            solution.iterations, carried,
        )  # fmt: skip


def weakly_driven(
    system: BallSystem,
    lubricant: LubricantState,
    options: TractionOptions,
    unknowns: FloatArray,
    distance: tuple[FloatArray, FloatArray],
) -> NDArray[np.bool_]:
    """Balls whose inner contact cannot drive them against drag and gyroscopic moment, (n,).

    None where the strongest of all balls is too weak as well: the cage cannot
    carry them all.
    """
    contacts = evaluate_contacts(system, (unknowns[:, 0], unknowns[:, 1]), distance)
    capacity = lubricant.limiting_shear_ratio * contacts.load[:, INNER]
    drag = ball_drag(system, lubricant, options, unknowns[:, 2])
    gyroscopic = system.inertia * unknowns[:, 2] * np.abs(unknowns[:, 5]) / system.ball_diameter
    weak = capacity < _DRIVE_MARGIN * (drag + gyroscopic)
    return weak & ~weak.all()


def _continue_in_speed(
    solver: _Solver, speed: float, centre: FloatArray, displacement: FloatArray, where: str
) -> _Attempt:
    """Go from rest to the requested speed in steps that halve on failure."""
    reached, step = 0.0, 0.05
    attempt: _Attempt | None = None
    ball_speeds: FloatArray | None = None
    while reached < 1.0:
        target = min(1.0, reached + step)
        guess = None if ball_speeds is None else ball_speeds * (target / reached)
        trial = solver.moving(speed * target, centre, displacement, guess)
        if trial.converged:
            attempt, reached, solution = trial, target, trial.solution
            centre, displacement = solution.unknowns[:, :2], solution.displacement
            ball_speeds = solution.unknowns[:, 2:] if solution.unknowns.shape[1] == 6 else None
            step = min(2.0 * step, 0.05)
            continue
        step *= 0.5
        if step < _SMALLEST_SPEED_STEP:
            rpm = speed * 30.0 / np.pi
            cause = (
                "friction no longer holds the balls (gross sliding)"
                if solver.control == "equilibrium"
                else "no ball position balances the forces"
            )
            onset = f" from about {rpm * target:.0f} rpm on" if reached > 0.0 else ""
            raise NoEquilibriumError(
                where,
                f"no quasi-static equilibrium at {rpm:.0f} rpm: {cause}{onset}.",
                "Raise preload or axial load, or lower the speed or any radial load.",
            )
    return attempt
