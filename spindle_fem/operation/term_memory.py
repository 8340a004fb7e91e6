"""Memory of terms over a whole run, all its steps at once.

A memory follows from the one before it, step by step, mostly along a straight line, as a first-order
lag does: evaluated at all steps together, with its derivative, a guess then leads to the answer by one
recursion of small matrices. What bends takes further rounds; every round makes at least one step more
exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

from spindle_fem.operation.effect_terms import Derivatives, EffectTerms, Instants, Quantities

Array = NDArray[np.float64]

# Share of the largest memory below which a round's change ends the iteration.
SETTLED = 1e-11


def remembered(
    terms: EffectTerms,
    instants: Instants,
    steps: Array,
    sensed: Array,
    derivatives: Derivatives,
    *,
    held: NDArray[np.int64],
    guess: Array | None = None,
) -> tuple[Array, Quantities]:
    """Memories before each step and after the last, and how each follows from the one before.

    Parameters
    ----------
    instants : Instants
        Starts of the G steps.
    steps : (G,) ndarray, [s]
    sensed : (G, n_y) ndarray, [K]
        At the starts.
    derivatives : Derivatives
        At least those to the memories.
    held : (k,) int ndarray
        Steps over which memories stay as they are: gaps of a recording.
    guess : (G + 1, n_x) ndarray, optional
        The first memory everywhere where absent.

    Returns
    -------
    (G + 1, n_x) ndarray
    Quantities
        Memories after each step, with derivatives to what held before it.
    """
    number, first = len(steps), terms.initial_states()
    memory = np.tile(first, (number + 1, 1)) if guess is None else guess.copy()
    memory[0] = first
    for _ in range(number + 1):
        moves = terms.advance(instants, steps, sensed, memory[:-1], derivatives)
        hold(moves, held, memory)
        departure = carried(moves.by_state, (moves.value - memory[1:])[:, :, None])[:, :, 0]
        if not np.all(np.isfinite(departure)):
            departure = np.vstack((np.zeros_like(first), moves.value - memory[1:]))
        memory = memory + departure
        largest = np.abs(departure).max(initial=0.0)
        if largest <= SETTLED * (1.0 + np.abs(memory).max(initial=0.0)) or not np.isfinite(largest):
            break
    return memory, moves


def hold(moves: Quantities, held: NDArray[np.int64] | slice, before: Array) -> None:
    """Keep memories as they are over some steps, in place."""
    moves.value[held] = before[held]
    moves.by[held] = 0.0
    moves.by_state[held] = np.eye(moves.n_states)


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
