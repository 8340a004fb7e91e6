"""Find when a level changed, from inner products of the responses to changes at a row of instants.

A course of levels is a sum of steps; to first order the readings respond with the sum of the
responses to them. Everything else that is uncertain has been integrated out of the inner products, so that
the evidence of any set of instants is a closed expression: single instants and pairs are tried exhaustively
beside those already found, then each is moved or left out as long as that improves the evidence.

Source: Fearnhead (2006), Statistics and Computing 16, 203-213 (evidence of sets of change points, their
number and places paid for).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

Array = NDArray[np.float64]

# Changes of one level at most: what changes more often switches.
MOST_CHANGES = 6
# Shortest time that something counts as a level, as a share of the recording: what lasts less is an event,
# or the start of a run, which no model of few masses follows.
SHORTEST = 1.0 / 30.0
# A level counts as that without anything where it is within this share of the largest.
NOTHING = 0.1


@dataclass(frozen=True, slots=True)
class Changes:
    """Instants at which a level changed.

    Attributes
    ----------
    at : tuple of int
        Positions in the row of instants, growing.
    steps : (m,) ndarray
        By how much the level changes at each.
    gain : float
        Logarithm of the evidence over no change, the choice of the instants paid for.
    """

    at: tuple[int, ...]
    steps: Array
    gain: float


def choice(count: int, number: int) -> float:
    """Logarithm of the number of ways to choose ``number`` of ``count`` instants."""
    return float(gammaln(count + 1) - gammaln(number + 1) - gammaln(count - number + 1))


def find_changes(gram: Array, data: Array, spread: float, most: int = MOST_CHANGES) -> Changes | None:
    """The set of changes with the largest evidence; None if none improves the fit.

    Parameters
    ----------
    gram : (k, k) ndarray
        Inner products of the responses to a unit step at each instant.
    data : (k,) ndarray
        With what is left of the readings.
    spread : float
        Prior standard deviation of a step.
    """
    scaled, along = spread**2 * gram, spread * data
    count = len(data)
    chosen: list[int] = []
    best = 0.0
    while len(chosen) < most:
        options = []
        for added in (_best_one(scaled, along, chosen), _best_two(scaled, along, chosen)):
            if added and len(chosen) + len(added) <= most:
                own = _settled(scaled, along, sorted([*chosen, *added]))
                options.append((_evidence(scaled, along, own) - choice(count, len(own)), own))
        if not options:
            break
        gain, own = max(options)
        if gain <= best:
            break
        best, chosen = gain, own
    dropped = True
    while dropped and chosen:
        dropped = False
        for position in range(len(chosen)):
            own = chosen[:position] + chosen[position + 1 :]
            gain = _evidence(scaled, along, own) - choice(count, len(own)) if own else 0.0
            if gain > best:
                chosen, best, dropped = own, gain, True
                break
    if not chosen:
        return None
    root = _root(scaled, chosen)
    return Changes(tuple(chosen), spread * root.T @ (root @ along[chosen]), best)


def _root(scaled: Array, chosen: Sequence[int]) -> Array:
    """``W`` with ``Wᵀ W`` the inverse of the precision of steps at some instants, (m, m).

    No eigenvalue of the precision is below 1, whatever rounding leaves of indistinguishable steps.
    """
    values, vectors = np.linalg.eigh(scaled[np.ix_(chosen, chosen)] + np.eye(len(chosen)))
    return (vectors / np.sqrt(np.maximum(values, 1.0))).T


def _evidence(scaled: Array, along: Array, chosen: Sequence[int]) -> float:
    """Logarithm of the evidence of steps at some instants over none."""
    root = _root(scaled, chosen)
    right = root @ along[list(chosen)]
    # The determinant of the root is that of the precision to the power of -1/2.
    return 0.5 * float(right @ right) + 0.5 * float(np.log((root**2).sum(axis=1)).sum())


def _beside(scaled: Array, along: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
    """Inner products of all responses after projecting out the chosen ones."""
    if not chosen:
        return scaled, along
    own = list(chosen)
    root = _root(scaled, own)
    turned = root @ scaled[own]
    return scaled - turned.T @ turned, along - turned.T @ (root @ along[own])


def _best_one(scaled: Array, along: Array, chosen: Sequence[int]) -> list[int]:
    matrix, right = _beside(scaled, along, chosen)
    own = 1.0 + np.maximum(np.diag(matrix), 0.0)
    gain = 0.5 * right**2 / own - 0.5 * np.log(own)
    gain[~_apart(len(along), chosen)] = -np.inf
    return [int(np.argmax(gain))] if np.isfinite(gain).any() else []


def _best_two(scaled: Array, along: Array, chosen: Sequence[int]) -> list[int]:
    matrix, right = _beside(scaled, along, chosen)
    first, second = np.triu_indices(len(along), 1)
    a, b, c = 1.0 + matrix[first, first], 1.0 + matrix[second, second], matrix[first, second]
    determinant = np.maximum(a * b - c**2, 1e-12)
    square = b * right[first] ** 2 - 2.0 * c * right[first] * right[second] + a * right[second] ** 2
    gain = 0.5 * square / determinant - 0.5 * np.log(determinant)
    allowed = _apart(len(along), chosen)
    gain[~(allowed[first] & allowed[second] & (second - first >= SHORTEST * len(along)))] = -np.inf
    best = int(np.argmax(gain))
    return [int(first[best]), int(second[best])] if np.isfinite(gain[best]) else []


def _apart(count: int, chosen: Sequence[int]) -> NDArray[np.bool_]:
    """Instants far enough from both ends of the recording and from those that are there, (k,)."""
    places = np.arange(count)
    distance = np.abs(places[:, None] - np.array([0, count, *chosen])).min(axis=1)
    return distance >= SHORTEST * count


def _settled(scaled: Array, along: Array, chosen: list[int]) -> list[int]:
    """Instants moved one after the other until none gains."""
    moved = True
    while moved:
        moved = False
        for position, now in enumerate(chosen):
            rest = chosen[:position] + chosen[position + 1 :]
            again = next(iter(_best_one(scaled, along, rest)), now)
            if (
                again != now
                and _evidence(scaled, along, [*rest, again]) > _evidence(scaled, along, chosen) + 1e-6
            ):
                chosen, moved = sorted([*rest, again]), True
                break
    return chosen


def levels_over_lowest(
    changes: Changes, times: Array, stop: float
) -> tuple[list[tuple[float, float]], list[float]]:
    """Intervals in which a level lies above its lowest, and by how much.

    Parameters
    ----------
    times : (k,) ndarray, [s]
        The row of instants.
    stop : float, [s]
        End of the recording.
    """
    levels = np.concatenate(([0.0], np.cumsum(changes.steps)))
    edges = [float(times[0]), *(float(times[i]) for i in changes.at), stop]
    levels = levels - levels.min()
    spans = zip(edges[:-1], edges[1:], levels.tolist(), strict=True)
    found = [
        ((begin, end), level)
        for begin, end, level in spans
        if end > begin and level > NOTHING * float(levels.max())
    ]
    return [span for span, _ in found], [level for _, level in found]
