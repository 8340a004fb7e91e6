"""Temperatures in time: TR-BDF2 with step control in kelvin.

A trapezoidal stage to ``γ = 2 − √2`` of the step and a BDF2 stage to its end
share one matrix ``M + γ/2 Δt K``; the method is of second order, L-stable, and
an embedded third-order formula estimates the error of each step. Both stages
are solved so that heat stored = heat in − heat out holds to round-off.

Sources: Bank et al. (1985), IEEE Trans. CAD 4, 436-451; error estimate: Hosea
& Shampine (1996), Appl. Numer. Math. 20, 21-37.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from spindle_fem.errors import BadInputError, ConvergenceError, EnergyBalanceError, SpecError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem
from spindle_fem.model.mesh.heat_balance import BALANCE_TOLERANCE
from spindle_fem.model.mesh.linear_solvers import Method
from spindle_fem.model.mesh.time_stage import GAMMA, WEIGHTS, Stage, StageSolver

STATE_SCHEMA = "spindle-fem/thermal-state/1"
SAFETY = 0.85
ERROR_TOLERANCE_K = 0.05
MAX_REJECTIONS = 30


@dataclass(frozen=True, slots=True)
class ThermalState:
    """Temperatures at one time, enough to go on from.

    Attributes
    ----------
    time : float, [s]
    temperature : (n_unknowns,) ndarray, [K]
    lumped_temperature : (m,) ndarray, [K]
    step : float, [s]
        Step size to go on with; 0 when unknown.
    """

    time: float
    temperature: NDArray[np.float64]
    lumped_temperature: NDArray[np.float64]
    step: float = 0.0

    def vector(self) -> NDArray[np.float64]:
        """All temperatures, lumped nodes last, (n + m,) [K]."""
        return np.concatenate((self.temperature, self.lumped_temperature))

    def save(self, path: Path) -> None:
        """Write to an ``.npz`` file."""
        with Path(path).open("wb") as stream:
            np.savez_compressed(
                stream,
                schema=STATE_SCHEMA,
                time=self.time,
                temperature=self.temperature,
                lumped_temperature=self.lumped_temperature,
                step=self.step,
            )

    @classmethod
    def load(cls, path: Path) -> ThermalState:
        """Read what :meth:`save` wrote.

        Raises
        ------
        BadInputError
            Not a saved state, or of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                schema = str(data["schema"])
                if schema != STATE_SCHEMA:
                    raise BadInputError(str(path), f'schema "{schema}".', f'Allowed: "{STATE_SCHEMA}".')
                return cls(
                    float(data["time"]), data["temperature"], data["lumped_temperature"], float(data["step"])
                )
        except (OSError, ValueError, KeyError) as error:
            raise BadInputError(str(path), f"no saved thermal state ({error}).") from error


def uniform_state(problem: ConductionProblem, temperature: float, time: float = 0.0) -> ThermalState:
    """State of one temperature everywhere.

    Parameters
    ----------
    problem : ConductionProblem
    temperature : float, [K]
    time : float, [s]
    """
    return ThermalState(
        time,
        np.full(problem.operators.n_unknowns, float(temperature)),
        np.full(len(problem.lumped_nodes), float(temperature)),
    )


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
    rejected : int
    linear_iterations : int
    matrix_builds : int
    energy : EnergyAccount
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
class StepControl:
    """How steps are chosen.

    Attributes
    ----------
    tolerance : float or None, [K]
        Largest estimated error of a step at any node; None keeps
        ``first_step``.
    first_step : float or None, [s]
        A ten-thousandth of the span when None.
    largest_step : float, [s]
    linear_tolerance : float or None, [K]
        Error allowed to the linear solver; a thousandth of the tolerance when
        None.
    temperature_dependent : bool
        Whether the inputs look at the temperatures: each stage is then
        iterated. Film laws switch it on.
    nonlinear_tolerance : float or None, [K]
        Change at which that iteration ends; a hundredth of the tolerance when
        None.
    trust_contraction : bool
        Whether it may end before, where the change times what the iteration
        lately left of a change is as small: one solve a stage fewer. Heat of
        temperature-dependent inputs is then that of fields so much further apart.
    method : {"direct", "multigrid"} or None
    """

    tolerance: float | None = ERROR_TOLERANCE_K
    first_step: float | None = None
    largest_step: float = np.inf
    linear_tolerance: float | None = None
    temperature_dependent: bool = False
    nonlinear_tolerance: float | None = None
    trust_contraction: bool = False
    method: Method | None = None

    def __post_init__(self) -> None:
        if self.tolerance is None and self.first_step is None:
            raise SpecError("step control", "neither a tolerance nor a step.", "Give one of both.")
        for name in ("tolerance", "first_step", "largest_step", "linear_tolerance", "nonlinear_tolerance"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise SpecError(f"step control: {name}", f"{value!r}.", "Allowed: above 0.")

    @property
    def linear(self) -> float:
        """Error allowed to the linear solver, [K]."""
        return self.linear_tolerance or 1e-3 * (self.tolerance or 1e-3)

    @property
    def nonlinear(self) -> float:
        """Change at which a stage's iteration ends, [K]."""
        return self.nonlinear_tolerance or 1e-2 * (self.tolerance or 1e-3)


DEFAULT_CONTROL = StepControl()


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
    breakpoints: Sequence[float] = (),
    restarts: Sequence[float] = (),
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
        and listed in ``breakpoints``.
    start : ThermalState
    end_time : float, [s]
    control : StepControl
    breakpoints : sequence of float, [s]
        Times where inputs jump; steps end there.
    restarts : sequence of float, [s]
        Those of them after which steps begin as at the start.
    outputs : (n_outputs, n) or (n_outputs, n + m) sparse array, optional
        Rows to sample, for example of ``probe_matrix``.
    sample_times : (n_samples,) array_like, [s]
        Rising; between steps the stages' parabola is read.
    observer : callable, optional
        Called after each accepted step with the state; True ends the run.

    Returns
    -------
    TransientResult

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
    marks = [t for t in (*breakpoints, *restarts) if start.time < t < end_time]
    stops, anew = np.unique([*marks, end_time]), frozenset(restarts)
    first_step = control.first_step or 1e-4 * (end_time - start.time)
    step = start.step or first_step
    ledger = _Ledger(ends=[start.time])
    content_before = solver.heat_content(start)
    state = start
    samples[times == start.time] = rows @ start.vector()
    rejections = 0
    while state.time < end_time:
        stop = float(stops[np.searchsorted(stops, state.time, side="right")])
        allowed = min(step, control.largest_step)
        left = stop - state.time
        # two equal steps to a stop rather than one full and a sliver
        size = left if allowed >= left * (1.0 - 1e-9) else (0.5 * left if 2.0 * allowed > left else allowed)
        end = stop if size == left else state.time + size
        try:
            stages = solver.take_step(state, end, size)
        except ConvergenceError:
            # What is stored outweighs what follows the field the more, the shorter the step.
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
            step = 0.5 * size
            continue
        rejections = 0
        ledger.book(solver, WEIGHTS, size, stages)
        ledger.errors.append(error)
        ledger.ends.append(end)
        inside = (times > state.time) & (times <= end)
        if np.any(inside):
            samples[inside] = _interpolate(rows, stages, state.time, size, times[inside])
        step = _next_step(step, size, error, control.tolerance)
        solver.accept(stages, size)
        if end in stops:
            solver.forget_slope()
        if end in anew:
            step = first_step
            solver.forget_contraction()
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


def _next_step(step: float, size: float, error: float, tolerance: float | None) -> float:
    """Keep, or grow by powers of √2, four at most: equal steps share their matrix."""
    if tolerance is None:
        return step
    factor = SAFETY * (tolerance / max(error, 1e-12 * tolerance)) ** (1.0 / 3.0)
    rungs = int(np.floor(2.0 * np.log2(min(factor, 4.0))))
    if rungs > 0:
        return max(step, 2.0 ** (0.5 * rungs) * size)
    return step if size < step else size


def _interpolate(
    rows: sparse.csr_array, stages: list[Stage], start: float, size: float, times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outputs on the parabola through the step's start, inner stage and end."""
    s = ((times - start) / size)[:, None]
    first, middle, last = (rows @ stage.values for stage in stages)
    return (
        first * (s - GAMMA) * (s - 1.0) / GAMMA
        + middle * s * (s - 1.0) / (GAMMA * (GAMMA - 1.0))
        + last * s * (s - GAMMA) / (1.0 - GAMMA)
    )


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
