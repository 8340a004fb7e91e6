"""Quasi-static equilibrium of a ball system: rest, raceway control, friction; continued in speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError
from spindle_fem.tribology.ball_system import (
    BallSystem,
    BorderedSolution,
    Contacts,
    evaluate_contacts,
    solve_bordered,
)
from spindle_fem.tribology.friction_equilibrium import friction_evaluation, start_from_race_control
from spindle_fem.tribology.hertz import INNER, OUTER
from spindle_fem.tribology.race_control import (
    race_control_evaluation,
    race_control_speeds,
    static_centres,
    static_evaluation,
)
from spindle_fem.tribology.traction import LubricantState, TractionOptions

FloatArray = NDArray[np.float64]
RacewayControl = Literal["outer", "inner", "equilibrium"]
_SMALLEST_SPEED_STEP = 1.0 / 256.0


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
    contacts : Contacts
    tangent : (m, m) ndarray
        Stiffness of the ring displacements with all balls in equilibrium.
    residual : float, [-]
        Largest force residual over the largest ball load.
    iterations : int
    """

    displacement: FloatArray
    centre: FloatArray
    ball_speeds: FloatArray
    contacts: Contacts
    tangent: FloatArray
    residual: float
    iterations: int


def solve_equilibrium(
    system: BallSystem,
    speed: float,
    load: FloatArray,
    control: RacewayControl,
    *,
    start: FloatArray,
    ball_load: float,
    lubricant: LubricantState | None = None,
    options: TractionOptions | None = None,
    where: str = "bearing",
    warm: Equilibrium | None = None,
) -> Equilibrium:
    """Equilibrium of all balls and rings at a shaft speed.

    Tries the asked speed from the state at rest (or a warm start), and goes
    there in adaptive steps of speed where that fails.

    Parameters
    ----------
    speed : float, [rad/s]
        Of the inner rings; its sign does not matter.
    load : (m,) ndarray, [N, N m]
        Conjugate to the displacements.
    control : {"outer", "inner", "equilibrium"}
    start : (m,) ndarray
        First guess of the displacements at rest.
    ball_load : float, [N]
        Size of the ball loads at rest, for scaling.
    lubricant, options
        Needed for ``"equilibrium"``.
    where : str
        Name for messages.
    warm : Equilibrium, optional
        Of the same system at a nearby state.

    Raises
    ------
    NoEquilibriumError
        No state found; the message says from which speed on.
    """
    magnitude = abs(speed)
    solver = _Solver(system, load, control, ball_load, lubricant, options or TractionOptions())
    if warm is not None and magnitude > 0.0:
        solution = solver.moving(magnitude, warm.centre, warm.displacement, warm.ball_speeds)
        if solution.converged:
            return solver.finish(solution, magnitude)
    rest = solver.rest(start)
    if not rest.converged:
        raise NoEquilibriumError(
            where, f"no static equilibrium under this load (residual {rest.residual:.2g} of the load).",
            "Lower the radial load or moment, or raise axial load or preload.",
        )  # fmt: skip
    if magnitude == 0.0:
        return solver.finish(rest, 0.0)
    centre = static_centres(system, *system.groove_distances(rest.displacement))
    solution = solver.moving(magnitude, centre, rest.displacement, None)
    if not solution.converged:
        solution = _continue_in_speed(solver, magnitude, centre, rest.displacement, where)
    return solver.finish(solution, magnitude)


@dataclass(frozen=True, slots=True, eq=False)
class _Solver:
    system: BallSystem
    load: FloatArray
    control: RacewayControl
    ball_load: float
    lubricant: LubricantState | None
    options: TractionOptions

    def rest(self, start: FloatArray) -> BorderedSolution:
        system = self.system
        return self._newton(
            lambda _, axial, radial: static_evaluation(system, axial, radial),
            np.zeros((system.number, 0)), start, self._forces(0.0)[:, :0], self.ball_load,
        )  # fmt: skip

    def moving(
        self, speed: float, centre: FloatArray, displacement: FloatArray, ball_speeds: FloatArray | None
    ) -> BorderedSolution:
        """Solve at one speed; six unknowns a ball when friction decides, else two."""
        system = self.system
        speeds = np.full(system.number, speed)
        rows = self._forces(speed)
        size = float(rows.max())
        frictional = self.control == "equilibrium"
        if frictional and ball_speeds is not None:
            solution = self._frictional(speeds, np.column_stack([centre, ball_speeds]), displacement, rows)
            if solution.converged:
                return solution
        side = INNER if self.control == "inner" else OUTER
        plain = self._newton(
            lambda x, axial, radial: race_control_evaluation(system, speeds, side, x, axial, radial),
            centre, displacement, rows, size,
        )  # fmt: skip
        if not frictional or not plain.converged:
            return plain
        distance = system.groove_distances(plain.displacement)
        guess = start_from_race_control(system, speeds, plain.unknowns, distance)
        return self._frictional(speeds, guess, plain.displacement, rows)

    def _frictional(
        self, speeds: FloatArray, guess: FloatArray, displacement: FloatArray, rows: FloatArray
    ) -> BorderedSolution:
        system = self.system
        moments = 0.5 * rows[:, :1] * system.ball_diameter[:, None] * np.ones(3)
        scale = np.column_stack([rows, rows[:, :1], moments])
        return self._newton(
            lambda x, axial, radial: friction_evaluation(
                system, speeds, self.lubricant, self.options, x, axial, radial
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
    ) -> BorderedSolution:
        system = self.system
        lever = np.maximum(np.abs(system.axial_map).max(axis=0), np.abs(system.radial_map).max(axis=0))
        balls = float(system.weight.sum())
        stretch = float(np.min(system.rest_length))
        return solve_bordered(
            system, evaluate, unknowns, displacement, self.load,
            row_scale=rows, load_scale=np.maximum(size * balls * lever / 10.0, np.abs(self.load)),
            step_limit=0.1 * stretch,
        )  # fmt: skip

    def _forces(self, speed: float) -> FloatArray:
        """Size of the ball loads at a speed, (n, 2), N."""
        system = self.system
        orbital = 0.45 * speed
        centrifugal = 0.5 * system.mass * system.pitch_diameter * orbital**2
        size = np.full(system.number, max(self.ball_load, float(centrifugal.max()), 1e-9))
        return np.column_stack([size, size])

    def finish(self, solution: BorderedSolution, speed: float) -> Equilibrium:
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
            solution.iterations,
        )  # fmt: skip


def _continue_in_speed(
    solver: _Solver, speed: float, centre: FloatArray, displacement: FloatArray, where: str
) -> BorderedSolution:
    """Go from rest to the asked speed in steps that halve on failure."""
    reached, step = 0.0, 0.05
    solution: BorderedSolution | None = None
    ball_speeds: FloatArray | None = None
    while reached < 1.0:
        target = min(1.0, reached + step)
        if ball_speeds is not None and reached > 0.0:
            guess = ball_speeds * (target / reached)
        else:
            guess = None
        trial = solver.moving(speed * target, centre, displacement, guess)
        if trial.converged:
            solution, reached = trial, target
            centre, displacement = trial.unknowns[:, :2], trial.displacement
            ball_speeds = trial.unknowns[:, 2:] if trial.unknowns.shape[1] == 6 else None
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
            raise NoEquilibriumError(
                where,
                f"no quasi-static equilibrium at {rpm:.0f} rpm: {cause} from about {rpm * target:.0f} rpm on.",
                "Raise preload or axial load, or lower the speed.",
            )
    return solution
