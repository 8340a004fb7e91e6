"""Marches with terms that answer to temperatures: step by step, or the whole run at once.

Step by step, each step solves for what the terms add at its end. At once, Newton's
method works on what is sensed in the whole run: terms are evaluated at all instants
together and the run is marched with them as straight lines, until it is what they
were evaluated at. It solves the same equations, from a run that is near in two or
three rounds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import TermContext
from spindle_fem.errors import ConvergenceError
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.dynamic_terms import TEMPERATURE_TOLERANCE, DynamicTerms, solve_added
from spindle_fem.model.reduced.linearised_run import Answers, Followed, Linearised, Lines
from spindle_fem.model.reduced.run_operators import RunOperators
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.model.reduced.term_layout import Evaluation, Layout, OneInstant
from spindle_fem.model.reduced.term_memory import Moves, moves_over, remembered
from spindle_fem.model.reduced.terms_over_time import EvaluationOver, Instants, evaluate_over

Array = NDArray[np.float64]

# Rounds over a whole run; one that needs more is marched step by step.
MOST_ROUNDS = 8
# A round is not made where it would move by so much less than the last may.
CERTAIN = 0.02
# A round that moves what is sensed by more than this, K, has left what the terms can answer.
LOST = 1000.0


@dataclass(slots=True)
class Tracks:
    """What the terms did in every step, kept for the derivatives.

    Attributes
    ----------
    columns : list of (r, m) ndarray
        What every added quantity puts in, by group of steps.
    added_start, added_end : (G, m) ndarray
    linearised : Linearised
    start_by_parameter, end_by_parameter : (G, m, p) ndarray
        Explicit derivatives of what is added.
    state_by_parameter : (G, n_x, p) ndarray
    start_by, end_by : (G, m, p) ndarray
        Whole derivatives; set by the march of the derivatives.
    """

    columns: list[Array]
    added_start: Array
    added_end: Array
    linearised: Linearised
    start_by_parameter: Array
    end_by_parameter: Array
    state_by_parameter: Array
    start_by: Array = field(init=False)
    end_by: Array = field(init=False)

    def __post_init__(self) -> None:
        self.start_by, self.end_by = np.zeros((2, *self.start_by_parameter.shape))

    def added(self) -> Array:
        """Added quantities at the ends of the steps, (G + 1, m)."""
        return np.vstack((self.added_start[:1], self.added_end))

    def follow(self, forcing: Array, start: Array, *, explicit: bool) -> Array:
        """Small changes of the states, (G + 1, r, p), to which the terms answer.

        Parameters
        ----------
        forcing : (G, r, p) ndarray
        start : (S, r, p) ndarray
        explicit : bool
            Whether the columns are the asked parameters, which the terms also know.
        """
        answers = self.linearised.answers
        own = (self.start_by_parameter, self.end_by_parameter, self.state_by_parameter) if explicit else ()
        found = self.linearised.follow(answers.with_sensed(forcing), start, *own)
        if explicit:
            self.start_by, self.end_by = found.added_start, found.added_end
        return found.states


@dataclass(frozen=True, slots=True)
class TermMarch:
    """A run with terms, ready to be marched.

    Attributes
    ----------
    drive : Drive
    built : RunOperators
    dynamic : DynamicTerms
    columns : list of (r, m) ndarray
        As :class:`Tracks` has them.
    answers : Answers
    response : (G, r) ndarray
        What the machine's own loads add to the end of each step.
    start : Start
    friction : pair of (G, n_heat_places) ndarray, [W]
        Heat that the machine itself gives, at the start and end of every step.
    friction_by : pair of (G, n_heat_places, p) ndarray, [W]
    shifts : pair of mapping of coefficient to ((G,) ndarray, (G, p) ndarray), [K]
        As :meth:`OpenLoads.shifts` gives them.
    """

    drive: Drive
    built: RunOperators
    dynamic: DynamicTerms
    columns: list[Array]
    answers: Answers
    response: Array
    start: Start
    friction: tuple[Array, Array]
    friction_by: tuple[Array, Array]
    shifts: tuple[Mapping[str, tuple[Array, Array]], Mapping[str, tuple[Array, Array]]]

    def march(self, near: Array | None = None) -> tuple[Array, Tracks]:
        """States at the ends of all steps, (G + 1, r), and what the terms did.

        Parameters
        ----------
        near : (G + 1, r) ndarray, optional
            States of a run that is near; a uniform one where absent.

        Raises
        ------
        ConvergenceError
            The terms run away.
        """
        found = None
        if not any(isinstance(term, OneInstant) for term in self.dynamic.terms):
            # What runs away on the way, in Newton's first rounds, may have a state all the same.
            with np.errstate(all="ignore"):
                found = self._at_once(near)
        return self._step_by_step() if found is None else found

    def _goes_on(self) -> NDArray[np.bool_]:
        """Whether inputs and class are the same on both sides of each step's start, (G,)."""
        drive = self.drive
        same = np.zeros(len(drive.step_class), dtype=bool)
        same[1:] = (drive.step_class[1:] == drive.step_class[:-1]) & np.all(
            drive.start[1:] == drive.end[:-1], axis=1
        )
        same[list(self.answers.given)] = False
        return same

    # ------------------------------------------------------------------ the whole run at once
    def _instants(self, *, at_end: bool) -> Instants:
        drive, dynamic = self.drive, self.dynamic
        steps = len(drive.step_class)
        wanted = {item.coefficient for items in dynamic.moved for item in items}
        wanted |= {film for items in dynamic.shifted for _, film in items}
        coefficients = {
            name: np.array([found[name] for found in self.built.coefficients])[drive.step_class]
            for name in wanted
        }
        inputs = drive.end if at_end else drive.start
        return Instants(
            drive.grid[1:] if at_end else drive.grid[:-1],
            {name: inputs[:steps, i] for i, name in enumerate(drive.names)},
            coefficients,
            self.friction[at_end],
            self.friction_by[at_end],
            self.shifts[at_end],
        )

    def _at_once(self, near: Array | None) -> tuple[Array, Tracks] | None:
        """None where Newton's method does not end soon."""
        answers, start = self.answers, self.start
        steps = len(answers.group_of_step)
        begins = np.flatnonzero(~self._goes_on())
        before, after = self._instants(at_end=False), self._instants(at_end=True)
        forcing = answers.with_sensed(self.response[:, :, None])
        given = start.states[:, :, None]
        # From a run that is near the first round may be the last, which needs the derivatives to parameters.
        near_given = near is not None
        slopes = near_given and bool(self.dynamic.derivatives)
        if near is None:
            near = start.states[np.searchsorted(start.points, np.arange(steps + 1), side="right") - 1]
        sensed = near @ answers.sense.T
        memory, before_that = None, np.nan
        # Where derivatives follow, the lines must be those of the last round.
        only_values = near_given and not self.dynamic.derivatives
        for _ in range(MOST_ROUNDS):
            if not np.all(np.isfinite(sensed)):
                return None
            told = self._told(before, after, begins, sensed, memory, slopes=slopes)
            memory = told.memory
            try:
                linearised = Linearised(answers, told.lines)
            except ConvergenceError:
                return None
            found = linearised.follow(forcing, given, *told.constants(sensed))
            moved = float(np.abs(found.sensed[:, :, 0] - sensed).max(initial=0.0))
            sensed = found.sensed[:, :, 0]
            if not moved < LOST:
                return None
            # Newton's method squares what is left: what the next round would move follows from the last two.
            left = moved * (moved / before_that) ** 2 if only_values else np.inf
            before_that = moved
            if moved <= TEMPERATURE_TOLERANCE or left <= CERTAIN * TEMPERATURE_TOLERANCE:
                if self.dynamic.derivatives and not slopes:
                    told = self._told(before, after, begins, sensed, memory, slopes=True)
                return found.states[:, :, 0], self._tracks(found, linearised, told)
            slopes = False
        return None

    def _tracks(self, found: Followed, linearised: Linearised, told: _Told) -> Tracks:
        return Tracks(
            self.columns,
            found.added_start[:, :, 0],
            found.added_end[:, :, 0],
            linearised,
            told.begin.by_parameter,
            told.end.by_parameter,
            told.state_by_parameter,
        )

    def _told(
        self,
        before: Instants,
        after: Instants,
        begins: NDArray[np.int64],
        sensed: Array,
        guess: Array | None,
        *,
        slopes: bool,
    ) -> _Told:
        """What the terms tell along sensed temperatures (G + 1, n_y); ``guess`` is of what they remember."""
        dynamic, touched = self.dynamic, self.built.touched
        memory, moves = self._remembered(before, sensed, guess, slopes=slopes)
        end = evaluate_over(dynamic, after, touched, sensed[1:], memory[1:], slopes=slopes)
        jumps = evaluate_over(
            dynamic, before.at(begins), touched, sensed[begins], memory[begins], slopes=slopes
        )
        # Where nothing jumps between steps, what holds at the end of one holds at the start of the next.
        begin = EvaluationOver(*(np.roll(getattr(end, name), 1, axis=0) for name in EvaluationOver.__slots__))
        begin.put(begins, jumps)
        lines = Lines(
            begin.by_sensed, begin.by_state, end.by_sensed, end.by_state, moves.by_sensed, moves.by_state
        )
        return _Told(begin, end, lines, moves.by_parameter, memory)

    def _remembered(
        self, before: Instants, sensed: Array, guess: Array | None, *, slopes: bool
    ) -> tuple[Array, Moves]:
        """What terms remember before each step and after the last (G + 1, n_x), and its derivatives."""
        dynamic, drive, steps = self.dynamic, self.drive, len(self.drive.step_class)
        asked = len(dynamic.derivatives) if slopes else 0
        terms = [
            (term, layout)
            for term, layout in zip(dynamic.terms, dynamic.layouts, strict=True)
            if term.n_states
        ]
        gaps = np.array([point - 1 for point in self.answers.given if point], dtype=np.int64)

        def seen(layout: Layout, states: Array) -> TermContext:
            return layout.context_over(before.times, before.inputs, sensed[:-1], states, slopes=slopes)

        def tell(states: Array) -> Moves:
            shape = (dynamic.n_states, len(dynamic.sense), asked)
            moves = moves_over(terms, shape, seen, drive.steps, states)
            moves.hold(gaps, states)
            return moves

        return remembered(tell, dynamic.initial_states(), steps, guess)

    def _unmoved(self, memory: Array) -> tuple[Array, Array, Array, Array]:
        """Memory over a gap: as it was."""
        number = len(memory)
        nothing = (np.zeros((number, width)) for width in (len(self.dynamic.sense), number))
        return memory, *nothing, np.zeros((number, len(self.dynamic.derivatives)))

    def _stacked(self, moved: Sequence[tuple[Array, Array, Array, Array]]) -> list[Array]:
        """Derivatives of what terms remember, (G, n_x, ...)."""
        dynamic, steps = self.dynamic, len(self.drive.step_class)
        widths = (len(dynamic.sense), dynamic.n_states, len(dynamic.derivatives))
        if not dynamic.n_states:
            return [np.zeros((steps, 0, width)) for width in widths]
        return [np.array([item[position] for item in moved]) for position in (1, 2, 3)]

    # ------------------------------------------------------------------ step by step
    def _evaluator(self, step: int, *, at_end: bool, memory: Array) -> Callable[[Array], Evaluation]:
        """Added quantities at one end of a step as a function of the sensed temperatures."""
        drive = self.drive
        inputs = (drive.end if at_end else drive.start)[step].tolist()
        return partial(
            self.dynamic.evaluate,
            float(drive.grid[step + at_end]),
            dict(zip(drive.names, inputs, strict=True)),
            self.built.coefficients[drive.step_class[step]],
            self.built.touched,
            states=memory,
            friction=self.friction[at_end][step],
            friction_by=self.friction_by[at_end][step],
            shifts={film: (float(k[step]), by[step]) for film, (k, by) in self.shifts[at_end].items()},
        )

    def _step_by_step(self) -> tuple[Array, Tracks]:
        dynamic, drive, answers, start = self.dynamic, self.drive, self.answers, self.start
        given, goes_on, size = answers.given, self._goes_on().tolist(), answers.sense.shape[1]
        steps = len(goes_on)
        states = np.empty((steps + 1, size))
        added_start, added_end = np.zeros((2, steps, dynamic.n_added))
        known = answers.with_sensed(self.response[:, :, None])[:, :, 0]
        begins: list[Evaluation] = []
        ends: list[Evaluation] = []
        moved: list[tuple[Array, Array, Array, Array]] = []
        now = np.empty(size + dynamic.n_added)
        memory = dynamic.initial_states()
        for step, group in enumerate(answers.group_of_step.tolist()):
            if step in given:
                states[step] = start.states[given[step]]
            sensed = dynamic.sense @ states[step]
            if goes_on[step]:
                # Nothing jumps between the steps: what held at the end of the last still does.
                begin, first = ends[-1], added_end[step - 1]
                guess = 2.0 * first - added_start[step - 1]
            else:
                begin = self._evaluator(step, at_end=False, memory=memory)(sensed)
                guess = first = begin.value
            begins.append(begin)
            if step + 1 in given:
                # A gap: nothing is known of it, and what comes after it is given.
                ends.append(begin)
                added_start[step] = added_end[step] = first
                moved.append(self._unmoved(memory))
                continue
            if dynamic.n_states:
                inputs = dict(zip(drive.names, drive.start[step].tolist(), strict=True))
                time, length = float(drive.grid[step]), float(drive.steps[step])
                moved.append(dynamic.advance(time, length, inputs, sensed, memory))
                memory = moved[-1][0]
            now[:size], now[size:] = states[step], first
            base = answers.follows[group] @ now
            base += known[step]
            evaluator = self._evaluator(step, at_end=True, memory=memory)
            answer = answers.replies[group][size:]
            added, end = solve_added(evaluator, base[size:], answer, guess, float(drive.grid[step + 1]))
            ends.append(end)
            added_start[step], added_end[step] = first, added
            states[step + 1] = base[:size] + answers.replies[group][:size] @ added
        by = [
            np.array([getattr(item, name) for item in items])
            for items in (begins, ends)
            for name in ("by_sensed", "by_state", "by_parameter")
        ]
        state_by = self._stacked(moved)
        lines = Lines(by[0], by[1], by[3], by[4], state_by[0], state_by[1])
        return states, Tracks(
            self.columns, added_start, added_end, Linearised(answers, lines), by[2], by[5], state_by[2]
        )


@dataclass(frozen=True, slots=True)
class _Told:
    """What terms tell at both ends of every step, and what they remember."""

    begin: EvaluationOver
    end: EvaluationOver
    lines: Lines
    state_by_parameter: Array
    memory: Array

    def constants(self, sensed: Array) -> tuple[Array, Array, Array]:
        """What their straight lines add where nothing is sensed, from sensed temperatures (G + 1, n_y).

        Memories are followed as departures from what they are along these temperatures.
        """
        before, after = sensed[:-1, :, None], sensed[1:, :, None]
        return (
            self.begin.value[:, :, None] - self.begin.by_sensed @ before,
            self.end.value[:, :, None] - self.end.by_sensed @ after,
            -self.lines.state_by_sensed @ before,
        )
