"""Temperatures in time: TR-BDF2 with step control in kelvin.

Both stages of a step (:mod:`spindle_fem.model.trbdf2`) are solved so that heat
stored = heat in − heat out holds to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from spindle_fem.errors import ConvergenceError, EnergyBalanceError, SpecError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem
from spindle_fem.model.mesh.heat_balance import BALANCE_TOLERANCE
from spindle_fem.model.mesh.step_control import DEFAULT_CONTROL, StepControl
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.model.mesh.time_stage import Stage, StageSolver
from spindle_fem.model.trbdf2 import WEIGHTS, interpolate_step

SAFETY = 0.85
# Steps grow by at most so much at once, and only where it is worth another matrix.
LARGEST_GROWTH, WORTHWHILE_GROWTH = 4.0, 1.1
# The trend of the error is believed as far as this in the next length.
LARGEST_TREND = 2.0
# A step that is too long becomes no shorter than this share at once.
LARGEST_CUT = 0.1
# Powers of its length with which the error of a step goes: of a smooth course, and at a surface after a jump.
ORDER, AFTER_JUMP = 3.0, 0.5
MAX_REJECTIONS = 30


@dataclass(frozen=True, slots=True)
class EnergyAccount:
    """Heat integrated over a transient, [J].

    Attributes
    ----------
    heat_in : float
        Put into surfaces, parts and lumped nodes.
    films : mapping of str to float
        Left through each film, links to surroundings included.
    stored : float
        Change of the heat content.
    imbalance_relative : float, [-]
        ``in − out − stored`` relative to the turnover: half the
        absolute flows across the boundary, or the stored heat when larger.
    """

    heat_in: float
    films: Mapping[str, float]
    stored: float
    imbalance_relative: float


@dataclass(frozen=True, slots=True)
class TransientResult:
    """A transient from start to end.

    Attributes
    ----------
    state : ThermalState
        At the end, to restart from.
    times : (n_samples,) ndarray, [s]
    samples : (n_samples, n_outputs) ndarray, [K]
        Outputs at the sample times.
    step_times : (n_steps + 1,) ndarray, [s]
        Start and the end of every accepted step.
    step_errors : (n_steps,) ndarray, [K]
        Estimated error of each accepted step.
    preconditioner_builds : int
        Factors or hierarchies; one serves many matrices.
    """

    state: ThermalState
    times: NDArray[np.float64]
    samples: NDArray[np.float64]
    step_times: NDArray[np.float64]
    step_errors: NDArray[np.float64]
    rejected: int
    linear_iterations: int
    matrix_builds: int
    energy: EnergyAccount
    preconditioner_builds: int = 0


Inputs = Callable[[float, ThermalState], ConductionProblem]


@dataclass(frozen=True, slots=True)
class StopTimes:
    """Times inside a run at which a step has to end.

    Attributes
    ----------
    breakpoints : sequence of float, [s]
        Times where inputs jump.
    restarts : sequence of float, [s]
        Times where inputs jump and steps begin as at the start.
    looks : sequence of float, [s]
        Times where nothing jumps, but somebody looks.
    """

    breakpoints: Sequence[float] = ()
    restarts: Sequence[float] = ()
    looks: Sequence[float] = ()


NO_STOPS = StopTimes()


@dataclass(slots=True)
class _Ledger:
    """Running sums while stepping."""

    heat_in: float = 0.0
    turnover: float = 0.0
    films: dict[str, float] = field(default_factory=dict)
    errors: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    rejected: int = 0

    def book(
        self, solver: StageSolver, weights: NDArray[np.float64], step: float, stages: list[Stage]
    ) -> None:
        for weight, stage in zip(weights, stages, strict=True):
            flows = solver.flows(stage)
            self.heat_in += step * weight * flows.heat_in
            self.turnover += step * weight * flows.turnover
            for label, heat in flows.films.items():
                self.films[label] = self.films.get(label, 0.0) + step * weight * heat


def integrate(
    inputs: Inputs | ConductionProblem,
    start: ThermalState,
    end_time: float,
    *,
    control: StepControl = DEFAULT_CONTROL,
    stops: StopTimes = NO_STOPS,
    outputs: sparse.sparray | None = None,
    sample_times: ArrayLike = (),
    observer: Callable[[ThermalState], bool] | None = None,
) -> TransientResult:
    """Integrate a conduction problem in time.

    Parameters
    ----------
    inputs : ConductionProblem or callable
        A constant problem, or ``(time, state)`` to the problem at that time,
        with the same operators and lumped nodes. Jumps are right-continuous
        and listed in ``stops``.
    end_time : float, [s]
    stops : StopTimes
        Where inputs jump; steps end there.
    outputs : (n_outputs, n) or (n_outputs, n + m) sparse array, optional
        Rows to sample, for example of ``probe_matrix``.
    sample_times : (n_samples,) array_like, [s]
        Rising; between steps the stages' parabola is read.
    observer : callable, optional
        Called after each accepted step with the state; True ends the run.

    Raises
    ------
    SpecError
        Times that do not rise, or a state of another size.
    ConvergenceError
        Steps shrink without end, or a solver does not converge.
    EnergyBalanceError
        Stored heat differs from heat in − heat out by more than 1e-8.
    """
    times = np.atleast_1d(np.asarray(sample_times, dtype=float))
    _require_times(start, end_time, times)
    solver = StageSolver(inputs, start, control)
    rows = solver.output_rows(outputs)
    samples = np.full((len(times), rows.shape[0]), np.nan)
    kinks, anew = frozenset((*stops.breakpoints, *stops.restarts)), frozenset(stops.restarts)
    ends = np.unique([*(t for t in (*kinks, *stops.looks) if start.time < t < end_time), end_time])
    first_step = control.first_step or 1e-4 * (end_time - start.time)
    step = start.step or first_step
    ledger = _Ledger(ends=[start.time])
    content_before = solver.heat_content(start)
    state = start
    samples[times == start.time] = rows @ start.vector()
    rejections = 0
    choice = _StepChoice(control.tolerance)
    while state.time < end_time:
        stop = float(ends[np.searchsorted(ends, state.time, side="right")])
        allowed = min(step, control.largest_step)
        left = stop - state.time
        # two equal steps to a stop rather than one full and a sliver
        size = left if allowed >= left * (1.0 - 1e-9) else (0.5 * left if 2.0 * allowed > left else allowed)
        end = stop if size == left else state.time + size
        try:
            stages = solver.take_step(state, end, size)
        except ConvergenceError:
            # The shorter the step, the more storage outweighs temperature-dependent terms.
            rejections += 1
            if control.tolerance is None or rejections > MAX_REJECTIONS:
                raise
            ledger.rejected += 1
            step = 0.5 * size
            continue
        error = solver.step_error(stages, size)
        if control.tolerance is not None and error > control.tolerance:
            ledger.rejected += 1
            rejections += 1
            if rejections > MAX_REJECTIONS:
                raise ConvergenceError(
                    f"time {state.time:g} s",
                    f"the step of {size:.3g} s still has an error of {error:.3g} K.",
                    "Name jumps of the inputs as breakpoints.",
                )
            step = choice.shorter(size, error)
            continue
        rejections = 0
        ledger.book(solver, WEIGHTS, size, stages)
        ledger.errors.append(error)
        ledger.ends.append(end)
        inside = (times > state.time) & (times <= end)
        if np.any(inside):
            place = ((times[inside] - state.time) / size)[:, None]
            samples[inside] = interpolate_step(place, *(rows @ stage.values for stage in stages))
        step = choice.following(step, size, error)
        solver.accept(stages, size)
        if end in kinks:
            solver.forget_steps()
        if end in anew:
            step = first_step
            choice.forget()
            solver.forget_iteration()
        state = solver.state_after(stages, end, step)
        if observer is not None and observer(state):
            break
    return TransientResult(
        state,
        times,
        samples,
        np.array(ledger.ends),
        np.array(ledger.errors),
        ledger.rejected,
        solver.linear_iterations,
        solver.matrix_builds,
        _close_account(ledger, solver.heat_content(state) - content_before),
        solver.preconditioner_builds,
    )


class _StepChoice:
    """Length of the next step from the errors of the last two.

    The error of a step goes with the third power of its length, times what the machine's relaxation
    makes of it: while that fades, steps that follow the last error alone are always late. Its change
    over the last step is taken to go on. Lengths that would change little stay, so that equal steps
    share their matrix. After a jump the surface that feels it follows the root of the time, and so does
    the error of a step until it is short: a step that is refused twice tells which power holds.

    Source: predictive control and its order after refused steps, Gustafsson (1994), ACM Trans. Math.
    Softw. 20, 496-517.
    """

    def __init__(self, tolerance: float | None) -> None:
        self._tolerance = tolerance
        self._last: tuple[float, float] | None = None
        self._refused: tuple[float, float] | None = None
        self._power = AFTER_JUMP

    def forget(self) -> None:
        """Drop the last error: the inputs jump."""
        self._last = self._refused = None
        self._power = AFTER_JUMP

    def shorter(self, size: float, error: float) -> float:
        """Length after a step whose error is too large."""
        if self._refused is not None:
            before, larger = self._refused
            power = float(np.log(larger / error) / np.log(before / size))
            self._power = min(max(power, AFTER_JUMP), ORDER)
        self._last, self._refused = None, (size, error)
        return size * max(SAFETY * (self._tolerance / error) ** (1.0 / self._power), LARGEST_CUT)

    def following(self, step: float, size: float, error: float) -> float:
        """Length after an accepted step of ``size``, which was ``step`` but for the end of a stretch."""
        self._refused, self._power = None, ORDER
        if self._tolerance is None:
            return step
        error = max(error, 1e-12 * self._tolerance)
        factor = SAFETY * (self._tolerance / error) ** (1.0 / ORDER)
        if self._last is not None:
            before, earlier = self._last
            fading = size / before * (earlier / error) ** (1.0 / ORDER)
            factor *= min(max(fading, 1.0), LARGEST_TREND)
        self._last = (size, error)
        factor = min(factor, LARGEST_GROWTH)
        if factor > WORTHWHILE_GROWTH:
            return max(step, factor * size)
        return step if size < step else size


def _close_account(ledger: _Ledger, stored: float) -> EnergyAccount:
    imbalance = ledger.heat_in - sum(ledger.films.values()) - stored
    turnover = max(ledger.turnover, abs(stored))
    relative = abs(imbalance) / turnover if turnover else 0.0
    if relative > BALANCE_TOLERANCE:
        raise EnergyBalanceError(
            "transient",
            f"stored heat and heat in − out differ by {imbalance:.3g} J ({relative:.2e} relative).",
            f"Allowed: {BALANCE_TOLERANCE:.0e}.",
        )
    return EnergyAccount(ledger.heat_in, ledger.films, stored, relative)


def _require_times(start: ThermalState, end_time: float, times: NDArray[np.float64]) -> None:
    if not end_time > start.time:
        raise SpecError(
            "end time", f"{end_time:g} s is not after the start {start.time:g} s.", "Allowed: later."
        )
    if times.size and (np.any(np.diff(times) < 0.0) or times[0] < start.time or times[-1] > end_time):
        raise SpecError("sample times", "they do not rise from start to end.", "Sort them, inside the span.")
