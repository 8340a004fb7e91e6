"""The equations inside one time step: matrices kept while they stay the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.errors import ConvergenceError, SpecError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, reference_temperature
from spindle_fem.model.mesh.equations import assemble_capacity, assemble_load, assemble_system
from spindle_fem.model.mesh.first_guesses import RecentCorrections
from spindle_fem.model.mesh.heat_balance import BoundaryFlows, boundary_flows
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.linear_solvers import Preconditioner, build_preconditioner, multiply, solve_linear
from spindle_fem.model.mesh.linear_system import ThermalSystem, merged
from spindle_fem.model.mesh.renewed_equations import Equations, RenewedEquations
from spindle_fem.model.mesh.stage_iteration import UNKNOWN_CONTRACTION, StageIteration
from spindle_fem.model.mesh.steady_conduction import close_balance, split_unknowns
from spindle_fem.model.mesh.step_control import LEAST_SHARE, StepControl
from spindle_fem.model.mesh.temperature_films import linearise_films
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.model.mesh.threads import row_blocks, run_blocks
from spindle_fem.model.trbdf2 import (
    DIAGONAL,
    GAMMA,
    error_defect,
    extrapolated,
    right_of_end,
    right_of_middle,
)

MAX_STAGE_ITERATIONS = 30
# The error estimate itself is solved to this fraction of the tolerance.
ERROR_SOLVE_FRACTION = 0.02
# While a stage is iterated, each solve needs to be this much better than its guess only.
REDUCTION = 0.005
# A preconditioner of other coefficients or steps serves until it takes so many times the iterations
# that it took when new for the same decades of error.
STALE_FACTOR = 1.6
# Nor does it serve for steps so many times longer or shorter, whatever it takes: one that is made for a
# short step nearly weighs storage alone.
OTHER_STEP = 10.0


@dataclass(frozen=True, slots=True)
class Stage:
    """Temperatures at one time inside a step.

    Attributes
    ----------
    problem : ConductionProblem
        Linearised.
    unknowns : ndarray, [K]
        Above the reference, perfect joints tied, lumped nodes last.
    rate : ndarray, [W]
        Heat that each equation has left over for storage.
    values : (n + m,) ndarray, [K]
        Temperatures of all nodes and lumped nodes.
    """

    problem: ConductionProblem
    unknowns: NDArray[np.float64]
    rate: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(slots=True)
class _Kept:
    """Data of the last solve, reused by the next."""

    coefficients: ConductionProblem | None = None
    tied: ThermalSystem | None = None
    conduction: sparse.csr_array | None = None
    step: float = -1.0
    matrix: sparse.csr_array | None = None
    row_sums: NDArray[np.float64] | None = None
    preconditioner: Preconditioner | None = None
    preconditioned_step: float = -1.0
    fresh_effort: float | None = None
    stale: bool = False
    before: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None


class StageSolver:
    """Solves the stages of time steps on one mesh.

    Parameters
    ----------
    inputs : ConductionProblem or callable
        See :func:`spindle_fem.model.mesh.time_stepper.integrate`.
    """

    def __init__(
        self,
        inputs: ConductionProblem | Callable[[float, ThermalState], ConductionProblem],
        start: ThermalState,
        control: StepControl,
    ) -> None:
        constant = inputs if isinstance(inputs, ConductionProblem) else None
        self._inputs = (lambda time, state: constant) if constant is not None else inputs
        self._control = control
        problem = self._inputs(start.time, start)
        self._operators = problem.operators
        self._names = problem.lumped_names
        self._capacities = (problem.volumetric_capacity, [node.capacity for node in problem.lumped_nodes])
        self._reference = reference_temperature(problem)
        if len(start.temperature) != self._operators.n_unknowns or len(start.lumped_temperature) != len(
            self._names
        ):
            raise SpecError("start state", "it belongs to another mesh or other lumped nodes.")
        storage, lumped_capacity = assemble_capacity(problem)
        self._lumped_capacity = lumped_capacity
        self._content = np.concatenate((storage @ np.ones(storage.shape[0]), lumped_capacity))
        self._renewed = RenewedEquations()
        own = self._renewed.of(self._linear(problem, start.temperature))
        self._tie = own.system.tie
        self._tied_storage = storage if self._tie is None else merged(storage, self._tie)
        self._n = self._tied_storage.shape[0]
        self._tied_content = np.concatenate((self._tied_storage @ np.ones(self._n), lumped_capacity))
        self._storage = self._beside(own)
        self._kept = _Kept(conduction=own.matrix)
        self._recent = RecentCorrections(2)
        self._origin = (start.time, 1.0)
        self._shift = 0.0
        self._iteration = StageIteration()
        self.linear_iterations = 0
        self.matrix_builds = 0
        self.preconditioner_builds = 0

    # ------------------------------------------------------------ interface
    def output_rows(self, outputs: sparse.sparray | None) -> sparse.csr_array:
        """Output rows extended over the lumped nodes; those alone when None."""
        n, m = self._operators.n_unknowns, len(self._names)
        if outputs is None:
            return sparse.csr_array((np.ones(m), (np.arange(m), n + np.arange(m))), shape=(m, n + m))
        if outputs.shape[1] not in (n, n + m):
            raise SpecError("outputs", f"{outputs.shape[1]} columns.", f"Allowed: {n} or {n + m}.")
        missing = n + m - outputs.shape[1]
        return sparse.csr_array(sparse.hstack((outputs, sparse.csr_array((outputs.shape[0], missing)))))

    def heat_content(self, state: ThermalState) -> float:
        """Heat above the reference temperature, [J]."""
        return float(self._content @ (state.vector() - self._reference))

    def take_step(self, state: ThermalState, end: float, size: float) -> list[Stage]:
        """The three stages of a step from a state."""
        first = self._first_stage(state)
        begin, inner = state.time, state.time + GAMMA * size
        if self._kept.before is None:
            self._origin = (begin, size)
            guess = first.unknowns
        else:
            length, earlier, middle = self._kept.before
            times = (begin - length, begin - (1.0 - GAMMA) * length, begin)
            guess = self._extrapolated(times, (earlier, middle, first.unknowns), inner)
        base = multiply(self._storage, first.unknowns)
        middle = self._solve_stage(right_of_middle(base, size, first.rate), inner, size, guess, state)
        times, values = (begin, inner), (first.unknowns, middle.unknowns)
        if self._kept.before is not None:
            times, values = (begin - length, *times), (earlier, *values)
        guess = self._extrapolated(times, values, begin + size)
        last = self._solve_stage(
            right_of_end(base, size, first.rate, middle.rate),
            # inputs that jump at the end of the step are still the old ones there
            float(np.nextafter(end, state.time)),
            size,
            guess,
            state,
        )
        return [first, middle, last]

    def step_error(self, stages: list[Stage], size: float) -> float:
        """Estimated error of a step in the norm of the step control, [K]."""
        defect = error_defect(size, tuple(stage.rate for stage in stages))
        defect[self._n :][self._lumped_capacity == 0.0] = 0.0
        tolerance = ERROR_SOLVE_FRACTION * (self._control.tolerance or 1.0)
        known = self._recent.combine(defect, 1.0, self._shift)
        solution = solve_linear(
            self._kept.matrix, defect, self._kept.preconditioner, known, error_tolerance=tolerance
        )
        self.linear_iterations += solution.iterations
        if self._control.error_norm == "mean":
            capacity = self._tied_content
            return float(np.sqrt(capacity @ solution.unknowns**2 / capacity.sum()))
        return float(np.abs(solution.unknowns).max(initial=0.0))

    def state_after(self, stages: list[Stage], end: float, step: float) -> ThermalState:
        """State at the end of an accepted step."""
        last = stages[-1]
        n = self._operators.n_unknowns
        return ThermalState(end, last.values[:n], last.values[n:], step)

    def accept(self, stages: list[Stage], size: float) -> None:
        """Remember a step, for the next one's first guesses."""
        self._kept.before = (size, stages[0].unknowns, stages[1].unknowns)

    def forget_steps(self) -> None:
        """Discard the data for initial guesses, because the inputs jump."""
        self._kept.before = None

    def forget_iteration(self) -> None:
        """Drop what is known of the iteration: other inputs, another coupling."""
        self._iteration.forget()

    def flows(self, stage: Stage) -> BoundaryFlows:
        """Heat across the boundary at a stage."""
        n = self._operators.n_unknowns
        rise = stage.values - self._reference
        return boundary_flows(stage.problem, self._reference, rise[:n], rise[n:])

    # -------------------------------------------------------------- details
    def _extrapolated(
        self, times: tuple[float, ...], values: tuple[NDArray[np.float64], ...], at: float
    ) -> NDArray[np.float64]:
        """First guess of a stage from earlier ones, on a polynomial in the logarithm of the time.

        It counts from where the inputs last jumped, and the first step there: a machine that relaxes has
        modes of all lengths, and while its steps grow it is in this variable that they are about equal.
        """
        begin, first = self._origin

        def place(time: float) -> float:
            return float(np.log1p(max(time - begin, 0.0) / first))

        return extrapolated(tuple(map(place, times)), values, place(at))

    def _first_stage(self, state: ThermalState) -> Stage:
        problem = self._linear(self._inputs(state.time, state), state.temperature)
        tied = self._system(problem)
        rise = state.vector() - self._reference
        n = self._operators.n_unknowns
        unknowns = rise.copy()
        if self._tie is not None:
            unknowns = np.concatenate(((self._tie.T @ rise[:n]) / self._tie.sum(axis=0), rise[n:]))
        load = self._load(problem)
        without = np.flatnonzero(self._lumped_capacity == 0.0)
        if without.size:
            # a node without capacity follows its neighbours at once, also over a jump
            lumped = unknowns[self._n :]
            lumped[without] = 0.0
            inflow = load[self._n :] + tied.exchange.T @ unknowns[: self._n] - tied.lumped_matrix @ lumped
            lumped[without] = np.linalg.solve(tied.lumped_matrix[np.ix_(without, without)], inflow[without])
        return self._stage(problem, unknowns, load)

    def _solve_stage(
        self,
        right: NDArray[np.float64],
        time: float,
        size: float,
        guess: NDArray[np.float64],
        state: ThermalState,
    ) -> Stage:
        n = self._operators.n_unknowns
        unknowns = guess
        self._iteration.begin(size)
        for attempt in range(MAX_STAGE_ITERATIONS):
            values = self._values(unknowns)
            asked = self._inputs(time, ThermalState(time, values[:n], values[n:], state.step))
            problem = self._linear(asked, values[:n])
            iterate = self._control.temperature_dependent or bool(asked.film_laws)
            self._system(problem)
            matrix = self._matrix(size)
            self._shift = size * DIAGONAL
            load = self._load(problem)
            following = self._solve(
                matrix,
                right + size * DIAGONAL * load,
                unknowns,
                reduction=REDUCTION if iterate else 0.0,
                judge=attempt == 0,
            )
            if not iterate:
                return self._stage(problem, following, load)
            change = self._iteration.answered(unknowns, following)
            if self._is_left(change) <= self._control.nonlinear:
                return self._stage(problem, following, load)
            unknowns = self._iteration.mixed()
        raise ConvergenceError(
            f"time {time:g} s",
            f"a stage still changes by {change:.3g} K after {MAX_STAGE_ITERATIONS} iterations.",
            "Shorten the steps or check the temperature-dependent inputs.",
        )

    def _is_left(self, change: float) -> float:
        """Upper bound of the remaining change, K, from the last iteration's change."""
        contraction = self._iteration.contraction
        if not self._control.trust_contraction or contraction >= UNKNOWN_CONTRACTION:
            return change
        share = contraction / (1.0 - contraction) + REDUCTION
        return min(max(share, LEAST_SHARE), 1.0) * change

    def _solve(
        self,
        matrix: sparse.csr_array,
        right: NDArray[np.float64],
        guess: NDArray[np.float64],
        *,
        reduction: float,
        judge: bool,
    ) -> NDArray[np.float64]:
        kept = self._kept
        known = self._recent.combine(right - multiply(matrix, guess), 1.0, self._shift)
        solution = solve_linear(
            matrix,
            right,
            kept.preconditioner,
            guess + known,
            error_tolerance=max(self._control.linear, reduction * float(np.abs(known).max())),
            reduction=reduction,
        )
        if solution.iterations and judge:
            self._recent.add(solution.unknowns - guess, self._storage, kept.conduction)
        self.linear_iterations += solution.iterations
        # Later solves of a stage gain too few decades to judge by.
        if judge and solution.digits > 0.0:
            effort = solution.iterations / solution.digits
            if kept.fresh_effort is None:
                kept.fresh_effort = effort
            elif effort > STALE_FACTOR * kept.fresh_effort:
                kept.stale = True
        return close_balance(matrix, right, solution.unknowns, kept.row_sums)

    def _linear(self, problem: ConductionProblem, temperature: NDArray[np.float64]) -> ConductionProblem:
        if problem.operators is not self._operators or problem.lumped_names != self._names:
            raise SpecError("inputs", "the problem changed its mesh or its lumped nodes.", "Keep both.")
        capacities = (problem.volumetric_capacity, [node.capacity for node in problem.lumped_nodes])
        if capacities[1] != self._capacities[1] or dict(capacities[0]) != dict(self._capacities[0]):
            raise SpecError("inputs", "heat capacities changed in time.", "Keep them constant in one run.")
        return linearise_films(problem, temperature) if problem.film_laws else problem

    def _system(self, problem: ConductionProblem) -> ThermalSystem:
        kept = self._kept
        if kept.coefficients is None or not same_coefficients(problem, kept.coefficients):
            own = self._renewed.of(problem)
            kept.tied = own.tied
            if own.matrix is not kept.conduction:
                kept.conduction, self._storage = own.matrix, self._beside(own)
            kept.coefficients = problem
            kept.matrix = None
        return kept.tied

    def _beside(self, equations: Equations) -> sparse.csr_array:
        """Storage on the pattern of the equations, the indices of both the same memory."""
        storage = equations.tied.beside_full(self._tied_storage, np.diag(self._lumped_capacity))
        other = equations.matrix
        if not _one_pattern(storage, other):
            return storage
        return sparse.csr_array((storage.data, other.indices, other.indptr), shape=storage.shape)

    def _matrix(self, size: float) -> sparse.csr_array:
        kept = self._kept
        # sizes that differ by round-off alone share one matrix
        if kept.matrix is None or abs(size - kept.step) > 1e-12 * size or kept.stale:
            factor = size * DIAGONAL
            kept.matrix = add_scaled(self._storage, factor, kept.conduction)
            kept.row_sums = multiply(kept.matrix, np.ones(kept.matrix.shape[0]))
            kept.step = size
            self.matrix_builds += 1
            ratio = size / kept.preconditioned_step
            if kept.preconditioner is None or kept.stale or not 1.0 / OTHER_STEP < ratio < OTHER_STEP:
                tied, matrix = kept.tied, kept.tied.matrix
                if matrix is None:
                    matrix = assemble_system(kept.coefficients, self._reference).matrix
                stepped = ThermalSystem(
                    add_scaled(self._tied_storage, factor, matrix),
                    tied.load,
                    tied.exchange * factor,
                    np.diag(self._lumped_capacity) + factor * tied.lumped_matrix,
                    tied.lumped_load,
                    self._reference,
                    None,
                    tied.prolongation,
                )
                kept.preconditioner = build_preconditioner(stepped, self._control.method)
                kept.preconditioned_step = size
                self.preconditioner_builds += 1
                kept.fresh_effort = None
                kept.stale = False
        return kept.matrix

    def _load(self, problem: ConductionProblem) -> NDArray[np.float64]:
        load, lumped_load = assemble_load(problem, self._reference)
        if self._tie is not None:
            load = self._tie.T @ load
        return np.concatenate((load, lumped_load))

    def _values(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        rise, lumped = split_unknowns(unknowns, len(self._names), self._tie)
        return np.concatenate((rise, lumped)) + self._reference

    def _stage(
        self, problem: ConductionProblem, unknowns: NDArray[np.float64], load: NDArray[np.float64]
    ) -> Stage:
        rate = load - multiply(self._kept.conduction, unknowns)
        return Stage(problem, unknowns, rate, self._values(unknowns))


def add_scaled(one: sparse.csr_array, factor: float, other: sparse.csr_array) -> sparse.csr_array:
    """``one + factor · other``; on one pattern only the entries are added."""
    if _one_pattern(one, other):
        data = room(one.nnz)

        def fill(low: int, high: int) -> None:
            np.multiply(other.data[low:high], factor, out=data[low:high])
            data[low:high] += one.data[low:high]

        run_blocks(fill, row_blocks(len(data)))
        return sparse.csr_array((data, one.indices, one.indptr), shape=one.shape)
    return sparse.csr_array(one + factor * other)


def _one_pattern(one: sparse.csr_array, other: sparse.csr_array) -> bool:
    if one.nnz != other.nnz:
        return False
    same = one.indices.ctypes.data == other.indices.ctypes.data
    return same or (np.array_equal(one.indptr, other.indptr) and np.array_equal(one.indices, other.indices))


def same_coefficients(one: ConductionProblem, other: ConductionProblem) -> bool:
    """Whether two problems have the same matrix: all but heat and surrounding temperatures equal."""
    if one is other:
        return True
    if dict(one.conductivity) != dict(other.conductivity):
        return False
    joints, others = one.joint_conductance, other.joint_conductance
    if joints.keys() != others.keys() or any(
        not _same(value, others[name]) for name, value in joints.items()
    ):
        return False
    if len(one.films) != len(other.films) or any(
        a.surface != b.surface or not _same(a.coefficient, b.coefficient)
        for a, b in zip(one.films, other.films, strict=True)
    ):
        return False
    for a, b in zip(one.lumped_nodes, other.lumped_nodes, strict=True):
        if len(a.connections) != len(b.connections) or any(
            surface_a != surface_b or not _same(value_a, value_b)
            for (surface_a, value_a), (surface_b, value_b) in zip(a.connections, b.connections, strict=True)
        ):
            return False
    keys = [field.name for field in fields(one.lumped_links[0])] if one.lumped_links else []
    matters = [key for key in keys if key != "temperature"]
    return len(one.lumped_links) == len(other.lumped_links) and all(
        all(getattr(a, key) == getattr(b, key) for key in matters)
        for a, b in zip(one.lumped_links, other.lumped_links, strict=True)
    )


def _same(one: object, other: object) -> bool:
    return one is other or np.array_equal(np.asarray(one), np.asarray(other))
