"""Temperatures over time by the reduced model, and their derivatives to parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import Term
from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.kernels import OPTIONS
from spindle_fem.model.reduced.added_heat import AddedHeat
from spindle_fem.model.reduced.drive import Drive, with_walls
from spindle_fem.model.reduced.exponential_step import ExactPropagator
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.linearised_run import Answers
from spindle_fem.model.reduced.open_terms import MachineInputs, is_open, with_open_terms
from spindle_fem.model.reduced.run_operators import RunOperators, run_operators
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.model.reduced.term_march import TermMarch, Tracks
from spindle_fem.model.reduced.trbdf2_matrices import (
    MatrixChange,
    Propagator,
    group_steps,
    load_response,
    sensitivity_forcing,
    stage_values,
)

Array = NDArray[np.float64]

# Runs that find the temperature of the channel's wall for films that follow it: the second corrects what the
# first does by 1 %, which is 1 % of the rise.
WALL_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class FastTransient:
    """Prediction of every probe.

    Attributes
    ----------
    times : (N,) ndarray, [s]
    temperature : (N, c) ndarray, [K]
    sensitivity : (N, c, p) ndarray, [K]
        Derivative to the natural logarithm of each parameter; to the value
        itself for term parameters that say so.
    grid : (G + 1,) ndarray, [s]
    states : (G + 1, r) ndarray
        Reduced unknowns at the ends of the steps.
    added : (G + 1, m) ndarray
        What the terms added just before each of them.
    tangents : (G + 1, r, p) ndarray or None
        Derivatives of the states; None if none were requested.
    inlet : (N,) ndarray or None, [K]
        Coolant inlet with what the terms do to it; None without a coolant.
    inlet_by : (N, p) ndarray or None
        Its derivatives.
    """

    times: Array
    channels: tuple[str, ...]
    temperature: Array
    sensitivity: Array
    parameters: tuple[str, ...]
    grid: Array
    states: Array
    added: Array
    tangents: Array | None = None
    inlet: Array | None = None
    inlet_by: Array | None = None


def simulate_fast(
    fast: FastModel,
    drive: Drive,
    initial: float | Array | Start,
    *,
    parameters: Mapping[str, float] | None = None,
    derivatives: Sequence[str] = (),
    terms: Sequence[Term] = (),
) -> FastTransient:
    """Follow a drive from a uniform temperature or a given state.

    Parameters
    ----------
    initial : float, (r,) ndarray or Start
        Uniform temperature [K]; unknowns; or unknowns with derivatives, at
        time zero and after long gaps. What the terms remember outlasts a gap.
    parameters : mapping of str to float, optional
        Factors of the machine's parameters, 1 where absent; values of the
        terms' (``<term>.<parameter>``), nominal where absent.
    derivatives : sequence of str
        Parameters to differentiate by.
    terms : sequence of Term
        Physics beside the machine's own; its natural films, and heat that the
        drive gives (``heat.<place>``), are always there.

    Raises
    ------
    SpecError
        A parameter or place that does not exist; heat that is not by table.
    ConvergenceError
        The terms run away.
    """
    everything = (*fast.own_terms(drive), *terms)
    given, near = parameters or {}, None
    if fast.channel is not None and fast.channel.film_follows_wall:
        own = drive
        for _ in range(WALL_ROUNDS):
            near, _ = TransientRun(fast, own, given, (), everything).march(initial, near)
            own = with_walls(drive, fast.channel.walls(near))
        drive = own
    return TransientRun(fast, drive, given, tuple(derivatives), everything).solve(initial, near)


class TransientRun:
    """One run with given inputs and parameters.

    Parameters
    ----------
    fast, drive, parameters, derivatives, terms
        As for :func:`simulate_fast`; ``terms`` include the machine's own.
    open_loop : bool
        Whether terms that follow no temperature join the load inputs.
    like : TransientRun, optional
        A run on the same drive; what it has in common with this one is taken from it.
    same_within : float
        As :func:`run_operators` takes it.
    """

    def __init__(
        self,
        fast: FastModel,
        drive: Drive,
        parameters: Mapping[str, float],
        derivatives: tuple[str, ...],
        terms: tuple[Term, ...],
        *,
        open_loop: bool = True,
        like: TransientRun | None = None,
        same_within: float = 0.0,
    ) -> None:
        self.fast, self.drive, self.derivatives = fast, drive, derivatives
        self.built: RunOperators = run_operators(
            fast, drive.points, parameters, derivatives, terms, same_within=same_within
        )
        self.operators = self.built.classes
        self.step_class = self.built.owner[drive.step_class]
        self.groups = group_steps(self.step_class, _stepped(drive))
        self.propagators: dict[tuple[int, float], Propagator | ExactPropagator] = {
            key: self._propagator(key, like) for key in self.groups
        }
        self.group_of_step = np.empty(len(drive.steps), dtype=np.int64)
        for number, rows in enumerate(self.groups.values()):
            self.group_of_step[rows] = number
        self._given = (0, *drive.restarts)
        start, start_by = self._load_inputs(drive.start)
        end, end_by = self._load_inputs(drive.end)
        self._n_heat = len(fast.heat_places)
        known = [term for term in terms if open_loop and is_open(term)]
        own = MachineInputs(start, end, start_by, end_by)
        opened = with_open_terms(fast, drive, self.built, own, known, parameters, derivatives)
        self.loads, self.loads_by = opened.loads, opened.loads_by
        self.start, self.end = opened.start, opened.end
        self.start_by, self.end_by = opened.start_by, opened.end_by
        # Dynamic terms scale the machine's own friction times the factors of open terms.
        self.friction_start, self.friction_end = (item[:, : self._n_heat] for item in (self.start, self.end))
        self._friction_start_by = self._friction_derivatives(self.start_by)
        self._friction_end_by = self._friction_derivatives(self.end_by)
        dynamic = [term for term in terms if term.is_dynamic and term not in known]
        self.dynamic = AddedHeat(fast, dynamic, parameters, derivatives) if dynamic else None
        scaled = {name for term in dynamic for name in term.coefficients}
        self._shifts = opened.shifts(scaled, derivatives)

    def _propagator(self, key: tuple[int, float], like: TransientRun | None) -> Propagator | ExactPropagator:
        """Matrices of a class and length of step."""
        storage, conduction = self.built.storage, self.operators[key[0]].conduction
        if (
            like is not None
            and key in like.propagators
            and np.array_equal(conduction, like.operators[key[0]].conduction)
            and np.array_equal(storage, like.built.storage)
        ):
            return like.propagators[key]
        return self.fast.propagator(storage, conduction, key[1])

    def _load_inputs(self, inputs: Array) -> tuple[Array, dict[str, Array]]:
        """Load inputs of every step at one of its ends, and their derivatives."""
        built = self.built
        return self.fast.load_inputs(self.drive.names, inputs, built.factors, built.machine_derivatives)

    def _friction_derivatives(self, by: Mapping[str, Array]) -> Array:
        """Derivatives of every heat place's heat by every requested parameter, (G, n_heat_places, p)."""
        found = np.zeros((len(self.drive.steps), self._n_heat, len(self.derivatives)))
        for column, parameter in enumerate(self.derivatives):
            if parameter in by:
                found[:, :, column] = by[parameter][:, : self._n_heat]
        return found

    def solve(self, initial: float | Array | Start, near: Array | None = None) -> FastTransient:
        """States, then sensitivities, then outputs; ``near`` as :meth:`march` takes it."""
        start = Start.of(initial, self.fast.model.one)
        states, tracks = self.march(start, near)
        sensitivities = None
        if self.derivatives:
            forcing, slopes = self.forcing_of(states, tracks), start.derivatives(self.derivatives)
            sensitivities = self.tangents(forcing, tracks, explicit=True, start=slopes)
        return self._outputs(states, sensitivities, tracks)

    def march(self, initial: float | Array | Start, near: Array | None = None) -> tuple[Array, Tracks | None]:
        """States at the ends of all steps, (G + 1, r), and what the terms did.

        ``near`` are states (G + 1, r) of a run that is near: terms that answer are solved from there, else
        from what the machine does without them.
        """
        start = Start.of(initial, self.fast.model.one)
        if start.points.tolist() != [0, *self.drive.restarts]:
            raise SpecError(
                "start",
                f"states at {start.points.size} points of the grid.",
                f"The drive needs one at the first and after each of {len(self.drive.restarts)} long gaps.",
            )
        size, steps = self.fast.model.size, len(self.drive.steps)
        response = np.empty((steps, size))
        for key, rows in self.groups.items():
            loads = self.loads[key[0]]
            response[rows] = load_response(self.propagators[key], self.start[rows], self.end[rows], loads)
        if self.dynamic is not None and near is not None:
            return self._with_terms(start, response).march(near, close=True)
        states = self._carried(response[:, :, None], start.states[:, :, None])[:, :, 0]
        if self.dynamic is None:
            return states, None
        return self._with_terms(start, response).march(states, close=False)

    def _carried(self, forcing: Array, start: Array) -> Array:
        """Columns (G + 1, r, p) from those that are given (S, r, p), with what every step adds (G, r, p)."""
        given = np.full(len(forcing) + 1, -1, dtype=np.int64)
        given[list(self._given)] = np.arange(len(self._given))
        advance = np.stack([self.propagators[key].advance for key in self.groups])
        columns = (np.ascontiguousarray(item) for item in (forcing, start))
        return _carry(self.group_of_step, given, advance, *columns)

    def _with_terms(self, start: Start, response: Array) -> TermMarch:
        """The run with its terms, ready to be marched."""
        dynamic = self.dynamic
        columns, follows, replies = [], [], []
        for key, propagator in self.propagators.items():
            own = dynamic.columns(self._inlet_load(key[0]))
            both = np.hstack((propagator.advance, propagator.from_start @ own))
            reply = propagator.from_end @ own
            columns.append(own)
            follows.append(np.vstack((both, dynamic.sense @ both)))
            replies.append(np.vstack((reply, dynamic.sense @ reply)))
        answers = Answers(follows, replies, dynamic.sense, self.group_of_step, start.rows())
        return TermMarch(
            self.drive,
            self.built,
            dynamic,
            columns,
            answers,
            response,
            start,
            (self.friction_start, self.friction_end),
            (self._friction_start_by, self._friction_end_by),
            self._shifts,
        )

    def _inlet_load(self, number: int) -> Array:
        column = self.fast.inlet_column
        if column is None:
            return np.zeros(self.fast.model.size)
        return self.loads[number][:, column]

    # ---------------------------------------------------------- sensitivities
    def forcing_of(self, states: Array, tracks: Tracks | None) -> Array:
        """Contribution of the requested parameters to the derivative of each step's end, (G, r, p)."""
        forcing = np.zeros((len(self.drive.steps), states.shape[1], len(self.derivatives)))
        for group, (key, rows) in enumerate(self.groups.items()):
            operators, propagator = self.operators[key[0]], self.propagators[key]
            start, end, loads = self.start[rows], self.end[rows], self.loads[key[0]]
            if tracks is not None:
                start = np.hstack((start, tracks.added_start[rows]))
                end = np.hstack((end, tracks.added_end[rows]))
                loads = np.hstack((loads, tracks.columns[group]))
            before, after = states[rows], states[rows + 1]
            stage = stage_values(propagator, before, start, end, loads)
            changes = [
                MatrixChange(
                    operators.conduction_by.get(parameter),
                    self.built.storage_by.get(parameter),
                    *self._load_derivatives(parameter, key[0], rows, tracks),
                )
                for parameter in self.derivatives
            ]
            forcing[rows] = sensitivity_forcing(propagator, before, stage, after, changes)
        return forcing

    def _load_derivatives(
        self, parameter: str, number: int, rows: NDArray[np.int64], tracks: Tracks | None
    ) -> tuple[Array | None, Array | None]:
        """Derivative of the loads at both ends of some steps at fixed temperatures, the terms' own apart."""
        start = end = None
        if parameter in self.loads_by[number]:
            by = self.loads_by[number][parameter]
            inputs_start, inputs_end = self.start[rows], self.end[rows]
            if tracks is not None and self.dynamic.inlet_columns():
                inlet = self.fast.load_names.index("coolant_inlet")
                shift = self.dynamic.inlet_columns()
                inputs_start, inputs_end = inputs_start.copy(), inputs_end.copy()
                inputs_start[:, inlet] += tracks.added_start[np.ix_(rows, shift)].sum(axis=1)
                inputs_end[:, inlet] += tracks.added_end[np.ix_(rows, shift)].sum(axis=1)
            start, end = inputs_start @ by.T, inputs_end @ by.T
        if parameter in self.start_by:
            loads = self.loads[number].T
            more_start = self.start_by[parameter][rows] @ loads
            more_end = self.end_by[parameter][rows] @ loads
            start = more_start if start is None else start + more_start
            end = more_end if end is None else end + more_end
        return start, end

    def tangents(
        self, forcing: Array, tracks: Tracks | None, *, explicit: bool = False, start: Array | None = None
    ) -> Array:
        """Small changes of the states due to small changes of the loads.

        Parameters
        ----------
        forcing : (G, r, p) ndarray
            What each change adds to the end of each step.
        tracks : Tracks or None
            What the terms did in the run that the changes are small against; they answer.
        explicit : bool
            Whether the columns are the requested parameters, on which the terms depend too.
        start : (S, r, p) ndarray, optional
            Changes of the given states: the first, and those after long gaps.

        Returns
        -------
        (G + 1, r, p) ndarray
        """
        if start is None:
            start = np.zeros((len(self._given), *forcing.shape[1:]))
        if tracks is not None:
            return tracks.follow(forcing, start, explicit=explicit)
        return self._carried(forcing, start)

    # ----------------------------------------------------------------- outputs
    def _outputs(self, states: Array, sensitivities: Array | None, tracks: Tracks | None) -> FastTransient:
        """Outputs at the output times, by the drive's classes of readings."""
        fast, drive = self.fast, self.drive
        n_out, n_par = len(fast.channels), len(self.derivatives)
        at_grid = np.empty((len(states), n_out))
        by_grid = np.zeros((len(states), n_out, n_par))
        last = len(drive.steps) - 1
        spins = fast.model.probe_spins
        speed = drive.names.index("speed") if spins.any() else None
        owner = np.append(self.step_class, self.step_class[last])
        if drive.read_class is not None:
            owner = self.built.owner[drive.read_class]
        inputs = np.vstack((self.start, self.end[last:]))
        added = np.zeros((len(states), 0)) if tracks is None else tracks.added()
        inlet_by = self._inlet_derivatives(inputs, tracks)
        inlet = fast.inlet_column
        moving = np.flatnonzero(inlet_by.any(axis=0))
        n_own = len(fast.load_names)
        inputs = inputs[:, :n_own]
        for number in np.unique(owner):
            operators, rows = self.operators[number], np.flatnonzero(owner == number)
            at_grid[rows] = states[rows] @ operators.outputs.T + inputs[rows] @ operators.output_inputs.T
            if sensitivities is None:
                continue
            by_grid[rows] = operators.outputs @ sensitivities[rows]
            for column in moving:
                direct = np.outer(inlet_by[rows, column], operators.output_inputs[:, inlet])
                by_grid[rows, :, column] += direct
            for column, parameter in enumerate(self.derivatives):
                if parameter in operators.outputs_by:
                    by_grid[rows, :, column] += states[rows] @ operators.outputs_by[parameter].T
                    by_grid[rows, :, column] += inputs[rows] @ operators.output_inputs_by[parameter].T
        if speed is not None:
            turning = np.append(drive.start[:, speed], drive.end[-1:, speed])
            at_grid[:, fast.point_rows] += np.square(turning)[:, None] * spins
        return FastTransient(
            drive.times,
            fast.channels,
            _at(drive.times, drive.grid, at_grid),
            _at(drive.times, drive.grid, by_grid),
            self.derivatives,
            drive.grid,
            states,
            added,
            sensitivities,
            None if inlet is None else _at(drive.times, drive.grid, inputs[:, inlet]),
            None if inlet is None else _at(drive.times, drive.grid, inlet_by),
        )

    def _inlet_derivatives(self, inputs: Array, tracks: Tracks | None) -> Array:
        """Derivatives of the inlet temperature (G + 1, p), after adding what terms do to it in place."""
        found, inlet = np.zeros((len(inputs), len(self.derivatives))), self.fast.inlet_column
        if inlet is None:
            return found
        for column, parameter in enumerate(self.derivatives):
            if parameter in self.start_by:
                found[:-1, column] = self.start_by[parameter][:, inlet]
                found[-1, column] = self.end_by[parameter][-1, inlet]
        if tracks is not None and self.dynamic.inlet_columns():
            shift = self.dynamic.inlet_columns()
            values = np.vstack((tracks.added_start, tracks.added_end[-1:]))
            inputs[:, inlet] += values[:, shift].sum(axis=1)
            found += np.concatenate((tracks.start_by, tracks.end_by[-1:]))[:, shift].sum(axis=1)
        return found


def _stepped(drive: Drive) -> Array:
    """Lengths of the steps; those that lead to given states, which nothing uses, are as the usual ones."""
    lengths = drive.steps.copy()
    if drive.restarts:
        lengths[np.array(drive.restarts) - 1] = np.median(lengths)
    return lengths


def _at(times: Array, grid: Array, values: Array) -> Array:
    """Values at times by straight lines between the grid's; exact where a time is on the grid."""
    right, part = grid_weights(times, grid)
    part = part.reshape(-1, *([1] * (values.ndim - 1)))
    return values[right - 1] + part * (values[right] - values[right - 1])


def grid_weights(times: Array, grid: Array) -> tuple[NDArray[np.int64], Array]:
    """Grid point after each time, and the share of the step before it that has passed."""
    right = np.clip(np.searchsorted(grid, times - 1e-7), 1, grid.size - 1)
    return right, np.clip((times - grid[right - 1]) / (grid[right] - grid[right - 1]), 0.0, 1.0)


@njit(**OPTIONS)
def _carry(group, given, advance, forcing, start):
    """March columns through linear steps; see :meth:`TransientRun._carried`."""
    steps, size, number = forcing.shape
    found = np.zeros((steps + 1, size, number))
    first = 0
    if not start.any():
        while first < steps and not forcing[first].any():
            first += 1
    for step in range(first, steps):
        if given[step] >= 0:
            found[step] = start[given[step]]
        np.dot(advance[group[step]], found[step], found[step + 1])
        found[step + 1] += forcing[step]
    return found
