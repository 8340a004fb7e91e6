"""What terms remember over a whole run, all its steps at once.

A memory follows from the one before it, step by step. Most follow by a straight line,
as a first-order lag does: evaluated at all steps together, with its derivative, a guess
then leads to the answer by one recursion of small matrices. What bends needs a round
more for each bend; every round makes at least one step more exact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

from spindle_fem.effects.framework.term import Term, TermContext
from spindle_fem.model.reduced.term_layout import Layout

Array = NDArray[np.float64]

# Of the largest memory: a round that moves less ends.
SETTLED = 1e-11


class Moves(NamedTuple):
    """Memories after all steps from those before them, and derivatives.

    Attributes
    ----------
    after : (G, n_x) ndarray
    by_sensed : (G, n_x, n_y) ndarray
    by_state : (G, n_x, n_x) ndarray
    by_parameter : (G, n_x, p) ndarray
        To the coordinates of the asked parameters.
    """

    after: Array
    by_sensed: Array
    by_state: Array
    by_parameter: Array

    def hold(self, rows: NDArray[np.int64], before: Array) -> None:
        """Keep memories (G, n_x) as they are over some steps, in place."""
        self.after[rows] = before[rows]
        self.by_sensed[rows] = self.by_parameter[rows] = 0.0
        self.by_state[rows] = np.eye(before.shape[1])


def moves_over(
    terms: list[tuple[Term, Layout]],
    shape: tuple[int, int, int],
    context: Callable[[Layout, Array], TermContext],
    lengths: Array,
    states: Array,
) -> Moves:
    """Advance all terms over all steps side by side.

    Parameters
    ----------
    terms : list of (Term, Layout)
        Those that remember.
    shape : (n_x, n_y, p)
        Memories, sensed temperatures and asked parameters.
    context : callable
        What a term sees at the starts of the steps where memories are ``states``.
    lengths : (G,) ndarray, [s]
    states : (G, n_x) ndarray
        Before each step.
    """
    number, (n_states, n_sensed, asked) = len(lengths), shape
    found = Moves(
        states.copy(),
        *(np.zeros((number, n_states, width)) for width in (n_sensed, n_states, asked)),
    )
    for term, layout in terms:
        seen = context(layout, states)
        width = seen.temperatures.shape[-1] // number
        answers = np.asarray(term.advance(seen, np.repeat(lengths, width)), dtype=complex)
        answers = answers.reshape(len(answers), number, width)
        found.after[:, layout.states] = answers[:, :, 0].real.T
        slopes = (found.by_sensed, found.by_state, found.by_parameter)
        layout.spread_over(answers, layout.states, 1.0, slopes)
    return found


def remembered(
    tell: Callable[[Array], Moves], first: Array, number: int, guess: Array | None = None
) -> tuple[Array, Moves]:
    """Memories before each step and after the last, and how each follows from the one before.

    Parameters
    ----------
    tell : callable
        Memories before each step (G, n_x) to :class:`Moves`.
    first : (n_x,) ndarray
    number : int
        Steps.
    guess : (G + 1, n_x) ndarray, optional
        The first one everywhere where absent.

    Returns
    -------
    (G + 1, n_x) ndarray
    Moves
    """
    memory = np.tile(first, (number + 1, 1)) if guess is None else guess.copy()
    memory[0] = first
    for _ in range(number + 1):
        moves = tell(memory[:-1])
        departure = carried(moves.by_state, (moves.after - memory[1:])[:, :, None])[:, :, 0]
        if not np.all(np.isfinite(departure)):
            departure = np.vstack((np.zeros_like(first), moves.after - memory[1:]))
        memory = memory + departure
        largest = np.abs(departure).max(initial=0.0)
        if largest <= SETTLED * (1.0 + np.abs(memory).max(initial=0.0)) or not np.isfinite(largest):
            break
    return memory, moves


def carried(by_state: Array, added: Array) -> Array:
    """Departures from nothing that each step carries on and adds to, (G + 1, n_x, p).

    Parameters
    ----------
    by_state : (G, n_x, n_x) ndarray
    added : (G, n_x, p) ndarray
        After each step.
    """
    number, size, width = added.shape
    found = np.zeros((number + 1, size, width))
    if added.size:
        # One triangular system, whose blocks below the diagonal are the steps.
        bands = np.zeros((2 * size, number * size))
        for row in range(size):
            for column in range(size):
                bands[size + row - column, column::size][: number - 1] = -by_state[1:, row, column]
        bands[0] = 1.0
        solution, _ = dtbtrs(bands, added.reshape(number * size, width), uplo="L", diag="U")
        found[1:] = solution.reshape(number, size, width)
    return found
