"""The steps of a run with its terms as straight lines about what they did.

With what terms add at both ends of a step as straight lines of what they sense and
remember, a step is a few small products, whether it carries the run itself
(Newton's method) or its derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError
from spindle_fem.model.mesh.kernels import OPTIONS
from spindle_fem.operation.effect_terms import Quantities

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Answers:
    """Responses of the model, by groups of equal steps.

    Attributes
    ----------
    follows : list of (r + n_y, r + m) ndarray
        Unknowns at the end of a step, and what is sensed of them, from unknowns at its start and what
        was added there.
    replies : list of (r + n_y, m) ndarray
        The same from what is added at the end.
    sense : (n_y, r) ndarray
    group_of_step : (G,) int64 ndarray
    given : mapping of int to int
        Row of each point of the grid at which a state is given.
    """

    follows: list[Array]
    replies: list[Array]
    sense: Array
    group_of_step: NDArray[np.int64]
    given: Mapping[int, int]

    def with_sensed(self, forcing: Array) -> Array:
        """Changes at the ends of steps (G, r, p) with their sensed temperatures, (G, r + n_y, p)."""
        return np.concatenate((forcing, np.matmul(self.sense, forcing)), axis=1)


class Lines(NamedTuple):
    """Contributions of terms at the start and end of every step, and their memory, with derivatives.

    Attributes
    ----------
    begin, end : Quantities
        Added, (G, m): by what is sensed there, and remembered before and after the step.
    memory : Quantities
        After a step, (G, n_x): by what was sensed and remembered before it.
    """

    begin: Quantities
    end: Quantities
    memory: Quantities


@dataclass(frozen=True, slots=True)
class Followed:
    """Result of a linearised run.

    Attributes
    ----------
    states : (G + 1, r, p) ndarray
    sensed : (G + 1, n_y, p) ndarray
    added_start, added_end : (G, m, p) ndarray
    """

    states: Array
    sensed: Array
    added_start: Array
    added_end: Array


class Linearised:
    """A run with terms as straight lines.

    Raises
    ------
    ConvergenceError
        Terms that leave a step without an answer.
    """

    def __init__(self, answers: Answers, lines: Lines) -> None:
        self.answers, self.lines = answers, lines
        size = answers.sense.shape[1]
        matrix = np.empty((len(answers.group_of_step), *answers.replies[0].shape[1:] * 2))
        for group, reply in enumerate(answers.replies):
            rows = np.flatnonzero(answers.group_of_step == group)
            matrix[rows] = np.eye(reply.shape[1]) - lines.end.by_sensed[rows] @ reply[size:]
        try:
            self._solve = np.linalg.inv(matrix)
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(
                "terms of the fast model", "they leave a step without an answer.", "Take smaller steps."
            ) from error
        self._answered: tuple[Array, Array] | None = None

    def _end_lines(self, columns: int) -> tuple[Array, Array]:
        """Contribution at the end of steps, by sensed and remembered values: prepared for many columns."""
        if columns > 1 and self._answered is None:
            end = self.lines.end
            self._answered = self._solve @ end.by_sensed, self._solve @ end.by_state
        return self._answered or (self.lines.end.by_sensed, self.lines.end.by_state)

    def follow(
        self,
        forcing: Array,
        start: Array,
        begin: Array | None = None,
        end: Array | None = None,
        remembered: Array | None = None,
    ) -> Followed:
        """March columns of changes, or the run itself with the constants of its lines.

        Parameters
        ----------
        forcing : (G, r + n_y, p) ndarray
            Added to the end of each step, with what is sensed of it.
        start : (S, r, p) ndarray
            At the points that are given.
        begin, end : (G, m, p) ndarray, optional
            Added at both ends beside what the lines say.
        remembered : (G, n_x, p) ndarray, optional
            Likewise after each step.
        """
        answers, lines = self.answers, self.lines
        steps, number = forcing.shape[0], forcing.shape[2]
        by_sensed, by_state = self._end_lines(number)
        # A single column is solved for as it comes.
        solved = self._answered is not None
        if solved and end is not None:
            end = self._solve @ end
        given = np.full(steps + 1, -1, dtype=np.int64)
        for point, row in answers.given.items():
            given[point] = row
        none = np.zeros((0, 0, number))
        return Followed(
            *_follow(
                answers.group_of_step,
                given,
                *(
                    np.ascontiguousarray(item, dtype=np.float64)
                    for item in (
                        start,
                        np.stack(answers.follows),
                        np.stack(answers.replies),
                        answers.sense,
                        lines.begin.by_sensed,
                        lines.begin.by_state,
                        lines.memory.by_sensed,
                        lines.memory.by_state,
                        by_sensed,
                        by_state,
                        np.zeros((0, 0, 0)) if solved else self._solve,
                        forcing,
                        none if begin is None else begin,
                        none if end is None else end,
                        none if remembered is None else remembered,
                    )
                ),
            )
        )


@njit(**OPTIONS)
def _follow(
    group, given, start, follows, replies, sense, start_by_sensed, start_by_state, memory_by_sensed,
    memory_by_state, by_sensed, by_state, solve, forcing, begin, end, remembered,
):  # fmt: skip
    """March columns of changes; see :meth:`Linearised.follow`. Arrays without rows are left out."""
    steps, _, number = forcing.shape
    n_sensed, size = sense.shape
    n_added, n_states = by_sensed.shape[1], memory_by_sensed.shape[1]
    states, sensed = np.zeros((steps + 1, size, number)), np.zeros((steps + 1, n_sensed, number))
    added_start, added_end = np.zeros((steps, n_added, number)), np.zeros((steps, n_added, number))
    now, base = np.zeros((size + n_added, number)), np.zeros((size + n_sensed, number))
    memory = np.zeros((n_states, number))
    for step in range(steps):
        if given[step] >= 0:
            states[step] = start[given[step]]
            sensed[step] = np.dot(sense, states[step])
        added = np.dot(start_by_sensed[step], sensed[step])
        if n_states > 0:
            added += np.dot(start_by_state[step], memory)
        if len(begin) > 0:
            added += begin[step]
        added_start[step] = added
        if given[step + 1] >= 0:
            # A gap: nothing is known of it, and what comes after it is given.
            added_end[step] = added
            continue
        if n_states > 0:
            memory = np.dot(memory_by_sensed[step], sensed[step]) + np.dot(memory_by_state[step], memory)
            if len(remembered) > 0:
                memory += remembered[step]
        now[:size] = states[step]
        now[size:] = added
        np.dot(follows[group[step]], now, base)
        base += forcing[step]
        total = np.dot(by_sensed[step], base[size:])
        if n_states > 0:
            total += np.dot(by_state[step], memory)
        if len(end) > 0:
            total += end[step]
        if len(solve) > 0:
            total = np.dot(solve[step], total)
        added_end[step] = total
        base += np.dot(replies[group[step]], total)
        states[step + 1] = base[:size]
        sensed[step + 1] = base[size:]
    return states, sensed, added_start, added_end
