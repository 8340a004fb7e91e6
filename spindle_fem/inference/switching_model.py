"""Something that is off or on, at one level or a few, at unrecorded times: a linear model that switches.

A reading is the sum of the known part, the contribution of a hidden state through a linear model, that
of uncertain coordinates, a slow error of each channel and white noise. Given the course of the state all
of it is linear and Gaussian, so that a Kalman filter gives the likelihood of a course, coordinates and
slow errors integrated out. Its gains do not depend on the course: many courses are followed side by
side, each with its own mean, and those that differ only in what lies before their last two changes are
joined. Nothing is approximated within a course; only unlikely ones are dropped.

Source: Doucet, Gordon & Krishnamurthy (2001), IEEE Trans. Signal Processing 49, 613-624 (filters of linear
models that jump); Fearnhead & Clifford (2003), J. R. Statist. Soc. B 65, 887-899 (keeping the most likely
courses).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import switching_loops as loops

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

# Steps after which what was on is taken as decided.
DECIDED_AFTER = 48
# Courses that are followed side by side, and rounds of course and size in turn: to compare many places, and
# to settle.
QUICK, THOROUGH = (24, 3), (96, 8)
# Shares of the first level from which a further one is looked for; levels nearer than this factor are one.
FURTHER_LEVELS = tuple(np.geomspace(0.2, 5.0, 15).tolist())
LEVELS_APART = 1.2
# Of what is on at most, and the share of what a course leaves of the readings that one more has to take up.
# (Of concealed states of one level a second one takes up to a sixteenth, of those of a lathe whose sensor
# settles at several levels a quarter.)
MOST_LEVELS, LEAST_OF_A_LEVEL = 2, 0.2
# Changes that a chain is believed to have had before the data: one of each kind in this many steps.
USUAL_STAY = 50.0


@dataclass(frozen=True, slots=True)
class LinearAnswer:
    """Response of a linear model to something of unit size that is on.

    Attributes
    ----------
    advance : (k, n, n) ndarray
        State after a step from the state before, by class of step.
    loss : (k, n, n) ndarray
        What a unit conductance takes of the state in a step; zeros for heat.
    group : (T,) int ndarray
        Class of every step.
    entering : (T, n) ndarray
        What a unit adds to the state by the end of each step.
    begins : (T,) bool ndarray
        Steps before which the state is given anew.
    reads : (T,) int ndarray
        Class of ``outputs`` at the end of every step.
    outputs : (q, c, n) ndarray
        Channels from the state.
    """

    advance: Array
    loss: Array
    group: Whole
    entering: Array
    begins: NDArray[np.bool_]
    reads: Whole
    outputs: Array

    def read(self, states: Array) -> Array:
        """Channels (T, c) from states (T, n) at the ends of the steps."""
        found = np.empty((len(states), self.outputs.shape[1]))
        for number, outputs in enumerate(self.outputs):
            found[self.reads == number] = states[self.reads == number] @ outputs.T
        return found

    @property
    def largest(self) -> float:
        """Size that settles the places it acts on within a step; larger ones would overshoot."""
        settled = float(np.trace(self.loss, axis1=1, axis2=2).max())
        return 1.0 / settled if settled > 0.0 else np.inf


@dataclass(frozen=True, slots=True)
class Readings:
    """Residuals of readings at the ends of steps, and other explanations beside the hidden state.

    Attributes
    ----------
    residual : (T, c) ndarray, [K]
        NaN where nothing was read.
    variance : (T, c) ndarray, [K²]
    slopes : (T, c, p) ndarray, [K]
        By coordinates whose departures have a unit normal distribution.
    steps : (T,) ndarray, [s]
    slow_sigma, slow_time : (c,) ndarray, [K], [s]
        Slow error of each channel.
    """

    residual: Array
    variance: Array
    slopes: Array
    steps: Array
    slow_sigma: Array
    slow_time: Array


@dataclass(frozen=True, slots=True)
class Chain:
    """Sticky transitions between off and on, and between levels of what is on.

    Attributes
    ----------
    begin : (q,) ndarray
        Probability in one step of going on, by condition.
    end : (q,) ndarray
        Of leaving a level of what is on.
    condition : (T,) int ndarray
        Condition that holds in each step, such as whether an input is zero.
    """

    begin: Array
    end: Array
    condition: Whole

    @classmethod
    def usual(cls, condition: Whole) -> Chain:
        """Prior chain, before any data."""
        number = int(condition.max(initial=0)) + 1
        rate = np.full(number, 1.0 / USUAL_STAY)
        return cls(rate, rate.copy(), condition)

    def fitted(self, on: Array) -> Chain:
        """Rates that a course, or its probabilities, make most likely."""
        before, after = on[:-1], on[1:]
        begin, end = np.empty_like(self.begin), np.empty_like(self.end)
        for number in range(len(begin)):
            own = self.condition[1:] == number
            b, a = before[own], after[own]
            begin[number] = (((1.0 - b) * a).sum() + 1.0) / ((1.0 - b).sum() + USUAL_STAY)
            end[number] = ((b * (1.0 - a)).sum() + 1.0) / (b.sum() + USUAL_STAY)
        return replace(self, begin=np.minimum(begin, 0.5), end=np.minimum(end, 0.5))

    def log_moves(self, levels: int) -> Array:
        """Logarithm of the probability of every move in one step, (q, 1 + levels, 1 + levels).

        What leaves a level goes to each of the others alike.
        """
        stays = np.arange(levels + 1)
        leaves = np.stack((self.begin, *[self.end] * levels), axis=1)
        found = np.repeat(np.log(leaves / levels)[:, :, None], levels + 1, axis=2)
        found[:, stays, stays] = np.log1p(-leaves)
        return found

    def log_likelihood(self, on: NDArray[np.bool_]) -> float:
        """Logarithm of the probability of a course."""
        before, after, own = on[:-1], on[1:], self.condition[1:]
        moved = np.where(before, self.end[own], self.begin[own])
        return float(np.log(np.where(before != after, moved, 1.0 - moved)).sum())


@dataclass(frozen=True, slots=True)
class Course:
    """The most likely course of a hidden state.

    Attributes
    ----------
    level : (T,) int ndarray
        0 while it is off, 1 and more at the levels of ``shares``.
    probability : (T,) ndarray
        Of being on, given the readings up to ``DECIDED_AFTER`` steps later.
    size : float
        Of the first level, W or W/K.
    sigma : float
        One standard deviation of it, given the course.
    log_evidence : float
        All courses together, over no hidden state.
    log_choice : float
        What the choice of this one course costs: its likelihood over that of all of them together.
    shares : tuple of float
        Sizes of the levels over that of the first.
    """

    level: Whole
    probability: Array
    size: float
    sigma: float
    log_evidence: float
    log_choice: float
    chain: Chain
    shares: tuple[float, ...] = (1.0,)

    @property
    def on(self) -> NDArray[np.bool_]:
        """When it is on, (T,)."""
        return self.level > 0

    def shares_at(self, levels: Sequence[int]) -> list[float]:
        """Sizes of levels, of which none is 0, over that of the first."""
        return [self.shares[level - 1] for level in levels]


class ReadingFilter:
    """Filter for slow errors and coordinates; its gains do not depend on the course of a state."""

    def __init__(self, readings: Readings) -> None:
        kept = np.exp(-readings.steps[:, None] / readings.slow_time)
        known = np.isfinite(readings.residual)
        slopes = np.ascontiguousarray(readings.slopes)
        gain, total = loops.gains(known, readings.variance, slopes, kept, readings.slow_sigma**2)
        self._residual = np.where(known, readings.residual, 0.0)
        self._own = known, slopes, kept, gain, total

    def innovations(self, values: Array | None = None) -> Array:
        """Innovations of readings (T, c), or of other values of the channels, with unit variance."""
        return loops.innovations(self._residual if values is None else values, *self._own)

    def courses(
        self, answer: LinearAnswer, chain: Chain, sizes: Array, number: int
    ) -> tuple[Whole, Array, float, float]:
        """Levels of the likeliest course, probability of being on, evidence of all courses, that one's.

        Likelihoods are those over the likelihood without a hidden state; ``sizes`` (l,) of the levels.
        """
        level, probability, evidence, likelihood = loops.follow(
            self._residual,
            *self._own,
            answer.advance,
            answer.loss,
            answer.group,
            answer.entering,
            answer.begins,
            answer.reads,
            np.ascontiguousarray(answer.outputs),
            chain.log_moves(len(sizes)),
            chain.condition,
            np.concatenate(([0.0], sizes)),
            number,
            DECIDED_AFTER,
        )
        never = -0.5 * float(np.sum(self.innovations() ** 2))
        return level, probability, evidence - never, likelihood - never


def find_course(
    answer: LinearAnswer,
    readings: ReadingFilter,
    chain: Chain,
    size: float,
    spread: float,
    effort: tuple[int, int] = THOROUGH,
    shares: tuple[float, ...] = (1.0,),
) -> Course | None:
    """Course, sizes and rates of one hidden state, in turn until the course stays.

    Parameters
    ----------
    size : float
        Of the first level, to begin with.
    spread : float
        Prior standard deviation of every size, which is positive.
    effort : (int, int)
        Courses that are followed side by side, and rounds at most.
    shares : tuple of float
        Sizes of all levels over that of the first, to begin with.

    Returns
    -------
    Course or None
        None where one of its levels never is.
    """
    found: Course | None = None
    sizes = size * np.array(shares)
    for _ in range(effort[1]):
        sizes = sizes * min(1.0, answer.largest / sizes.max())
        level, probability, evidence, likelihood = readings.courses(answer, chain, sizes, effort[0])
        if not np.isin(np.arange(1, len(sizes) + 1), level).all():
            return found
        stays = found is not None and np.array_equal(level, found.level)
        sizes, sigma = sizes_of(answer, readings, level, sizes, spread)
        if sizes.min() <= 0.0:
            return None
        own = tuple((sizes / sizes[0]).tolist())
        found = Course(
            level, probability, float(sizes[0]), sigma, evidence, likelihood - evidence, chain, own
        )
        if stays:
            break
        chain = chain.fitted(probability)
    return found


def with_another_level(
    answer: LinearAnswer,
    readings: ReadingFilter,
    course: Course,
    spread: float,
    effort: tuple[int, int] = THOROUGH,
) -> Course | None:
    """A course with one level more, where that takes up a good share of what it leaves; else None.

    Less may be what an inexact machine leaves, or steps in part of which something is on. A level that is
    missing is flickered about, and one that is wrong too: course and sizes in turn stay near where they
    begin, so that the likeliest of many beginnings is taken.
    """
    if len(course.shares) == MOST_LEVELS:
        return None
    # What flickers in the stead of a level has rates that keep it flickering.
    chain = Chain.usual(course.chain.condition)

    def evidence(share: float) -> float:
        sizes = course.size * np.array((*course.shares, share))
        if sizes.max() >= answer.largest:
            return -np.inf
        return readings.courses(answer, chain, sizes, effort[0])[2]

    apart = [n for n in FURTHER_LEVELS if all(_are_apart(n, own) for own in course.shares)]
    shares = (*course.shares, max(apart, key=evidence))
    found = find_course(answer, readings, chain, course.size, spread, effort, shares)
    if found is None or not all(_are_apart(*pair) for pair in combinations(found.shares, 2)):
        return None
    left = 0.5 * float(np.sum(readings.innovations() ** 2)) - course.log_evidence - course.log_choice
    needed = max(LEAST_OF_A_LEVEL * left, np.log(len(course.level)))
    return found if found.log_evidence > course.log_evidence + needed else None


def _are_apart(one: float, other: float) -> bool:
    return max(one, other) > LEVELS_APART * min(one, other)


def sizes_of(
    answer: LinearAnswer, readings: ReadingFilter, level: Whole, sizes: Array, spread: float
) -> tuple[Array, float]:
    """Sizes of a given course's levels, (l,), to first order about some, and the first one's deviation."""
    states, slopes = loops.states(
        answer.advance, answer.loss, answer.group, answer.entering, answer.begins, level, sizes
    )
    columns = np.stack(
        [readings.innovations(answer.read(slope)).ravel() for slope in slopes.transpose(1, 0, 2)],
        axis=1,
    )
    left = (readings.innovations() - readings.innovations(answer.read(states))).ravel()
    covariance = np.linalg.inv(columns.T @ columns + np.eye(len(sizes)) * spread**-2)
    return covariance @ (columns.T @ (left + columns @ sizes)), float(covariance[0, 0] ** 0.5)
