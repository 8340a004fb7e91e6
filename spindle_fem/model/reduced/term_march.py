"""Marches with temperature-dependent terms: step by step, or the whole run at once.

Step by step, each step solves for what the terms add at its end. At once, Newton's
method works on what is sensed in the whole run: terms are evaluated at all instants
together and the run is marched with them as straight lines, until it is what they
were evaluated at. It solves the same equations, from a run that is near in two or
three rounds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, OutOfValidityError
from spindle_fem.model.reduced.added_heat import (
    TEMPERATURE_TOLERANCE,
    AddedHeat,
    RunInstants,
    solve_added,
)
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.linearised_run import Answers, Followed, Linearised, Lines
from spindle_fem.model.reduced.run_operators import RunOperators
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.operation.effect_terms import Derivatives, Instants, Quantities
from spindle_fem.operation.term_memory import hold, remembered

Array = NDArray[np.float64]

# Rounds over a whole run; one that needs more is marched step by step.
MOST_ROUNDS = 8
# A round is not made where it would move by so much less than the last may.
CERTAIN = 0.02
# A round that moves what is sensed by more than this, K, has left what the terms can answer.
LOST = 1000.0
# Beyond this, K, no machine is: steel melts. Terms that answer late take it there without losing their state.
MOLTEN = 1800.0


@dataclass(slots=True)
class Tracks:
    """Contributions of the terms in every step, kept for the derivatives.

    Attributes
    ----------
    columns : list of (r, m) ndarray
        What every added quantity puts in, by group of steps.
    added_start, added_end : (G, m) ndarray
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
        """Small changes of the states, (G + 1, r, p), including the response of the terms.

        Parameters
        ----------
        forcing : (G, r, p) ndarray
        start : (S, r, p) ndarray
        explicit : bool
            Whether the columns are the requested parameters, on which the terms depend too.
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
    columns : list of (r, m) ndarray
        As :class:`Tracks` has them.
    response : (G, r) ndarray
        What the machine's own loads add to the end of each step.
    friction : pair of (G, n_heat_places) ndarray, [W]
        Heat that the machine itself gives, at the start and end of every step.
    friction_by : pair of (G, n_heat_places, p) ndarray, [W]
    shifts : pair of mapping of coefficient to ((G,) ndarray, (G, p) ndarray), [K]
        As :meth:`OpenLoads.shifts` gives them.
    """

    drive: Drive
    built: RunOperators
    dynamic: AddedHeat
    columns: list[Array]
    answers: Answers
    response: Array
    start: Start
    friction: tuple[Array, Array]
    friction_by: tuple[Array, Array]
    shifts: tuple[Mapping[str, tuple[Array, Array]], Mapping[str, tuple[Array, Array]]]

    def march(self, near: Array, *, close: bool) -> tuple[Array, Tracks]:
        """States at the ends of all steps, (G + 1, r), and what the terms did.

        Parameters
        ----------
        near : (G + 1, r) ndarray
            States to begin from.
        close : bool
            Whether they are so near that the first round may be the last.

        Raises
        ------
        ConvergenceError
            The terms run away.
        """
        # A state may exist even if it diverges in Newton's first rounds.
        with np.errstate(all="ignore"):
            try:
                found = self._at_once(near, close)
            except OutOfValidityError:
                found = None
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
    def _instants(self, *, at_end: bool) -> RunInstants:
        drive = self.drive
        coefficients = {
            name: np.array([found[name] for found in self.built.coefficients])[drive.step_class]
            for name in self.dynamic.wanted_coefficients
        }
        inputs = drive.end if at_end else drive.start
        return RunInstants(
            Instants(
                drive.grid[1:] if at_end else drive.grid[:-1],
                {name: inputs[:, i] for i, name in enumerate(drive.names)},
            ),
            coefficients,
            self.friction[at_end],
            self.friction_by[at_end],
            self.shifts[at_end],
        )

    @property
    def _gaps(self) -> NDArray[np.int64]:
        """Steps that bridge a gap."""
        return np.array([point - 1 for point in self.answers.given if point], dtype=np.int64)

    def _at_once(self, near: Array, close: bool) -> tuple[Array, Tracks] | None:
        """Solution of all steps at once; None if Newton's method does not converge soon."""
        answers, start = self.answers, self.start
        begins = np.flatnonzero(~self._goes_on())
        before, after = self._instants(at_end=False), self._instants(at_end=True)
        forcing = answers.with_sensed(self.response[:, :, None])
        given = start.states[:, :, None]
        # The round that may be the last needs the derivatives to parameters.
        slopes = close and bool(self.dynamic.derivatives)
        sensed = near @ answers.sense.T
        memory, before_that = None, np.nan
        # Where derivatives follow, the lines must be those of the last round.
        only_values = close and not self.dynamic.derivatives
        for _ in range(MOST_ROUNDS):
            if not np.all(np.isfinite(sensed)):
                return None
            asked = Derivatives.ALL if slopes else Derivatives.STATE
            evaluated = self._evaluate((before, after), begins, sensed, memory, asked)
            memory = evaluated.memory
            try:
                linearised = Linearised(answers, evaluated.lines)
            except ConvergenceError:
                return None
            found = linearised.follow(forcing, given, *evaluated.constants(sensed))
            moved = float(np.abs(found.sensed[:, :, 0] - sensed).max(initial=0.0))
            sensed = found.sensed[:, :, 0]
            if not moved < LOST:
                return None
            # Newton's method squares what is left: what the next round would move follows from the last two.
            left = moved * (moved / before_that) ** 2 if only_values else np.inf
            before_that = moved
            if moved <= TEMPERATURE_TOLERANCE or left <= CERTAIN * TEMPERATURE_TOLERANCE:
                if self.dynamic.derivatives and not slopes:
                    evaluated = self._evaluate((before, after), begins, sensed, memory, Derivatives.ALL)
                return found.states[:, :, 0], self._tracks(found, linearised, evaluated)
            slopes = False
        return None

    def _tracks(self, found: Followed, linearised: Linearised, evaluated: _Evaluated) -> Tracks:
        begin, end, memory = evaluated.lines
        return Tracks(
            self.columns,
            found.added_start[:, :, 0],
            found.added_end[:, :, 0],
            linearised,
            begin.by_parameter,
            end.by_parameter,
            memory.by_parameter,
        )

    def _evaluate(
        self,
        instants: tuple[RunInstants, RunInstants],
        begins: NDArray[np.int64],
        sensed: Array,
        guess: Array | None,
        derivatives: Derivatives,
    ) -> _Evaluated:
        """Values of the terms along sensed temperatures (G + 1, n_y); ``guess`` is their memory.

        ``instants`` are those just after the start and just before the end of every step.
        """
        dynamic, touched, (before, after) = self.dynamic, self.built.touched, instants
        memory, moves = remembered(
            dynamic.terms,
            before.instants,
            self.drive.steps,
            sensed[:-1],
            derivatives,
            held=self._gaps,
            guess=guess,
        )
        end = dynamic.at(after, touched, sensed[1:], memory[1:], derivatives)
        jumps = dynamic.at(before.at(begins), touched, sensed[begins], memory[begins], derivatives)
        # Where nothing jumps between steps, what holds at the end of one holds at the start of the next.
        begin = Quantities(
            np.roll(end.value, 1, axis=0), np.roll(end.by, 1, axis=0), end.n_sensed, end.n_states
        )
        begin.value[begins], begin.by[begins] = jumps.value, jumps.by
        return _Evaluated(Lines(begin, end, moves), memory)

    # ------------------------------------------------------------------ step by step
    def _evaluator(self, where: RunInstants, step: int, memory: Array) -> Callable[[Array], Quantities]:
        """Added quantities at one end of a step as a function of the sensed temperatures (1, n_y)."""
        one, touched = where.one(step), self.built.touched
        return lambda sensed: self.dynamic.at(one, touched, sensed, memory)

    def _step_by_step(self) -> tuple[Array, Tracks]:
        dynamic, drive, answers, start = self.dynamic, self.drive, self.answers, self.start
        given, goes_on, size = answers.given, self._goes_on().tolist(), answers.sense.shape[1]
        steps = len(goes_on)
        states = np.empty((steps + 1, size))
        added_start, added_end = np.zeros((2, steps, dynamic.n_added))
        known = answers.with_sensed(self.response[:, :, None])[:, :, 0]
        before, after = self._instants(at_end=False), self._instants(at_end=True)
        begins: list[Quantities] = []
        ends: list[Quantities] = []
        moves: list[Quantities] = []
        now = np.empty(size + dynamic.n_added)
        memory = dynamic.terms.initial_states()[None]
        for step, group in enumerate(answers.group_of_step.tolist()):
            if step in given:
                states[step] = start.states[given[step]]
            sensed = (dynamic.sense @ states[step])[None]
            if goes_on[step]:
                # Nothing jumps between the steps: what held at the end of the last still does.
                begin, first = ends[-1], added_end[step - 1]
                guess = 2.0 * first - added_start[step - 1]
            else:
                begin = self._evaluator(before, step, memory)(sensed)
                guess = first = begin.value[0]
            begins.append(begin)
            moved = dynamic.terms.advance(
                before.one(step).instants, float(self.drive.steps[step]), sensed, memory
            )
            if step + 1 in given:
                # A gap: nothing is known of it, and what comes after it is given.
                hold(moved, slice(None), memory)
                moves.append(moved)
                ends.append(begin)
                added_start[step] = added_end[step] = first
                continue
            moves.append(moved)
            memory = moved.value
            now[:size], now[size:] = states[step], first
            base = answers.follows[group] @ now
            base += known[step]
            evaluator = self._evaluator(after, step, memory)
            answer = answers.replies[group][size:]
            added, end = solve_added(evaluator, base[size:], answer, guess, float(drive.grid[step + 1]))
            hottest = float(np.abs(base[size:] + answer @ added).max(initial=0.0))
            if hottest > MOLTEN:
                raise ConvergenceError(
                    f"t = {drive.grid[step + 1]:.0f} s",
                    f"the terms of the fast model run away to {hottest:.0f} K.",
                    "Their heat may rise faster with temperature than it can flow away.",
                )
            ends.append(end)
            added_start[step], added_end[step] = first, added
            states[step + 1] = base[:size] + answers.replies[group][:size] @ added
        lines = Lines(*(_joined(items) for items in (begins, ends, moves)))
        by_parameter = (item.by_parameter for item in lines)
        return states, Tracks(self.columns, added_start, added_end, Linearised(answers, lines), *by_parameter)


def _joined(items: list[Quantities]) -> Quantities:
    """Single instants, one after the other."""
    return Quantities(
        np.concatenate([item.value for item in items]),
        np.concatenate([item.by for item in items]),
        items[0].n_sensed,
        items[0].n_states,
    )


@dataclass(frozen=True, slots=True)
class _Evaluated:
    """Values of terms at both ends of every step, and their memory, (G + 1, n_x)."""

    lines: Lines
    memory: Array

    def constants(self, sensed: Array) -> tuple[Array, Array, Array]:
        """Constant part of the lines, where nothing is sensed, from sensed temperatures (G + 1, n_y).

        Memories are expressed as departures from their values along these temperatures.
        """
        begin, end, memory = self.lines
        before, after = sensed[:-1, :, None], sensed[1:, :, None]
        return (
            begin.value[:, :, None] - begin.by_sensed @ before,
            end.value[:, :, None] - end.by_sensed @ after,
            -memory.by_sensed @ before,
        )
