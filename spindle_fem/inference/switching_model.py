"""Something that is on or off at unrecorded times: a linear model with a state that switches.

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

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spindle_fem.model.mesh.kernels import OPTIONS

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

# Steps after which what was on is taken as decided.
DECIDED_AFTER = 48
# Courses that are followed side by side, and rounds of course and size in turn: to compare many places, and
# to settle.
QUICK, THOROUGH = (24, 3), (96, 8)
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
    outputs : (c, n) ndarray
        Channels from the state.
    """

    advance: Array
    loss: Array
    group: Whole
    entering: Array
    begins: NDArray[np.bool_]
    outputs: Array

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
    """Sticky transitions between off and on.

    Attributes
    ----------
    begin : (q,) ndarray
        Probability in one step of going on, by condition.
    end : (q,) ndarray
        Of going off.
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
    on : (T,) bool ndarray
    probability : (T,) ndarray
        Of being on, given the readings up to ``DECIDED_AFTER`` steps later.
    size : float
        W or W/K.
    sigma : float
        One standard deviation of it, given the course.
    log_evidence : float
        All courses together, over no hidden state.
    log_choice : float
        What the choice of this one course costs: its likelihood over that of all of them together.
    """

    on: NDArray[np.bool_]
    probability: Array
    size: float
    sigma: float
    log_evidence: float
    log_choice: float
    chain: Chain


class ReadingFilter:
    """Filter for slow errors and coordinates; its gains do not depend on the course of a state."""

    def __init__(self, readings: Readings) -> None:
        kept = np.exp(-readings.steps[:, None] / readings.slow_time)
        known = np.isfinite(readings.residual)
        slopes = np.ascontiguousarray(readings.slopes)
        gain, total = _gains(known, readings.variance, slopes, kept, readings.slow_sigma**2)
        self._residual = np.where(known, readings.residual, 0.0)
        self._own = known, slopes, kept, gain, total

    def innovations(self, values: Array | None = None) -> Array:
        """Innovations of readings (T, c), or of other values of the channels, with unit variance."""
        return _innovations(self._residual if values is None else values, *self._own)

    def courses(
        self, answer: LinearAnswer, chain: Chain, size: float, number: int
    ) -> tuple[NDArray[np.bool_], Array, float, float]:
        """Most likely course, probability of being on, evidence of all courses, likelihood of that one.

        Likelihoods are those over the likelihood without a hidden state.
        """
        on, probability, evidence, likelihood = _follow(
            self._residual,
            *self._own,
            answer.advance,
            answer.loss,
            answer.group,
            answer.entering,
            answer.begins,
            np.ascontiguousarray(answer.outputs),
            np.log(chain.begin),
            np.log1p(-chain.begin),
            np.log(chain.end),
            np.log1p(-chain.end),
            chain.condition,
            size,
            number,
            DECIDED_AFTER,
        )
        never = -0.5 * float(np.sum(self.innovations() ** 2))
        return on, probability, evidence - never, likelihood - never


def find_course(
    answer: LinearAnswer,
    readings: ReadingFilter,
    chain: Chain,
    size: float,
    spread: float,
    effort: tuple[int, int] = THOROUGH,
) -> Course | None:
    """Course, size and rates of one hidden state, in turn until the course stays.

    Parameters
    ----------
    size : float
        To begin with.
    spread : float
        Prior standard deviation of the size, which is positive.
    effort : (int, int)
        Courses that are followed side by side, and rounds at most.

    Returns
    -------
    Course or None
        None where it is never on.
    """
    found: Course | None = None
    for _ in range(effort[1]):
        size = min(size, answer.largest)
        on, probability, evidence, likelihood = readings.courses(answer, chain, size, effort[0])
        if not on.any():
            return found
        stays = found is not None and np.array_equal(on, found.on)
        size, sigma = size_of(answer, readings, on, size, spread)
        if size <= 0.0:
            return None
        found = Course(on, probability, size, sigma, evidence, likelihood - evidence, chain)
        if stays:
            break
        chain = chain.fitted(probability)
    return found


def size_of(
    answer: LinearAnswer, readings: ReadingFilter, on: NDArray[np.bool_], size: float, spread: float
) -> tuple[float, float]:
    """Size of what is on in a given course and its standard deviation, to first order about a size."""
    states, slope = _states(
        answer.advance, answer.loss, answer.group, answer.entering, answer.begins, on.astype(float), size
    )
    column = readings.innovations(slope @ answer.outputs.T)
    left = readings.innovations() - readings.innovations(states @ answer.outputs.T) + size * column
    precision = float(np.sum(column**2)) + spread**-2
    return float(np.sum(column * left)) / precision, precision**-0.5


@njit(**OPTIONS)
def _states(advance, loss, group, entering, begins, share, size):
    """States that a course leads to, and their slope by the size, (T, n) each, at the ends of the steps."""
    steps, n = entering.shape
    states, slopes = np.zeros((steps, n)), np.zeros((steps, n))
    state, slope = np.zeros(n), np.zeros(n)
    for t in range(steps):
        if begins[t]:
            state[:] = 0.0
            slope[:] = 0.0
        a, b = advance[group[t]], loss[group[t]]
        taken = b @ state
        changed = a @ slope
        if share[t] > 0.0:
            changed = changed + share[t] * (entering[t] - taken) - size * share[t] * (b @ slope)
            state = a @ state + size * share[t] * (entering[t] - taken)
        else:
            state = a @ state
        slope = changed
        states[t], slopes[t] = state, slope
    return states, slopes


@njit(**OPTIONS)
def _gains(known, variance, slopes, kept, slow):
    """Gains (T, c, m) and variances (T, c) of the innovations.

    Readings of one step are taken one after the other; m are the slow errors, then the coordinates.
    """
    steps, channels = known.shape
    own = slopes.shape[2]
    m = channels + own
    gain, total = np.zeros((steps, channels, m)), np.ones((steps, channels))
    covariance = np.zeros((m, m))
    for j in range(channels):
        covariance[j, j] = slow[j]
    for j in range(channels, m):
        covariance[j, j] = 1.0
    row = np.zeros(m)
    for t in range(steps):
        for j in range(channels):
            for i in range(m):
                covariance[j, i] *= kept[t, j]
            for i in range(m):
                covariance[i, j] *= kept[t, j]
            covariance[j, j] += slow[j] * (1.0 - kept[t, j] ** 2)
        for j in range(channels):
            if not known[t, j]:
                continue
            for i in range(m):
                value = covariance[i, j]
                for k in range(own):
                    value += covariance[i, channels + k] * slopes[t, j, k]
                row[i] = value
            spread = variance[t, j] + row[j]
            for k in range(own):
                spread += slopes[t, j, k] * row[channels + k]
            total[t, j] = spread
            for i in range(m):
                gain[t, j, i] = row[i] / spread
            for i in range(m):
                for k in range(m):
                    covariance[i, k] -= gain[t, j, i] * row[k]
    return gain, total


@njit(**OPTIONS)
def _innovations(values, known, slopes, kept, gain, total):
    """Innovations of values (T, c): less their mean given the past, over its standard deviation."""
    steps, channels = values.shape
    own = slopes.shape[2]
    mean = np.zeros(channels + own)
    found = np.zeros_like(values)
    for t in range(steps):
        for j in range(channels):
            mean[j] *= kept[t, j]
        for j in range(channels):
            if not known[t, j]:
                continue
            apart = values[t, j] - mean[j]
            for k in range(own):
                apart -= slopes[t, j, k] * mean[channels + k]
            found[t, j] = apart / np.sqrt(total[t, j])
            for i in range(channels + own):
                mean[i] += gain[t, j, i] * apart
    return found


@njit(**OPTIONS)
def _follow(
    residual, known, slopes, kept, gain, total, advance, loss, group, entering, begins, outputs,
    log_begin, log_stay_off, log_end, log_stay_on, condition, size, courses, after,
):  # fmt: skip
    """Follow the most likely courses; see :meth:`_Filter.courses`."""
    steps, channels = residual.shape
    own, n = slopes.shape[2], entering.shape[1]
    m = channels + own
    parent = np.zeros((steps, courses), dtype=np.int32)
    chosen = np.zeros((steps, courses), dtype=np.int8)
    most = 2 * courses
    # For every course: state, mean of the nuisances, weight, likelihood, whether on, its last two changes,
    # its past.
    state, mean = np.zeros((most, n)), np.zeros((most, m))
    weight, likelihood = np.zeros(most), np.zeros(most)
    on, last, before = np.zeros(most, np.int8), np.zeros(most, np.int64), np.zeros(most, np.int64)
    past = np.zeros((most, after), np.int8)
    next_state, next_mean = np.zeros((most, n)), np.zeros((most, m))
    next_weight, next_likelihood = np.zeros(most), np.zeros(most)
    next_on, next_last, next_before = (
        np.zeros(most, np.int8),
        np.zeros(most, np.int64),
        np.zeros(most, np.int64),
    )
    origin = np.zeros(most, np.int64)
    joined = np.zeros(most)
    probability = np.zeros(steps)
    moved, taken = np.zeros(n), np.zeros(n)
    count = 1
    last[0], before[0] = -1, -2
    for t in range(steps):
        a, b = advance[group[t]], loss[group[t]]
        q = condition[t]
        children = 0
        for h in range(count):
            for i in range(n):
                moved[i], taken[i] = 0.0, 0.0
                for k in range(n):
                    moved[i] += a[i, k] * state[h, k]
                    taken[i] += b[i, k] * state[h, k]
            for s in range(2):
                c = children
                if on[h] == 1:
                    step = log_stay_on[q] if s == 1 else log_end[q]
                else:
                    step = log_begin[q] if s == 1 else log_stay_off[q]
                next_on[c] = s
                next_last[c] = last[h] if s == on[h] else t
                next_before[c] = before[h] if s == on[h] else last[h]
                for i in range(n):
                    if begins[t]:
                        next_state[c, i] = 0.0
                    else:
                        next_state[c, i] = moved[i]
                        if s == 1:
                            next_state[c, i] -= size * taken[i]
                    if s == 1:
                        next_state[c, i] += size * entering[t, i]
                for i in range(m):
                    next_mean[c, i] = mean[h, i] * kept[t, i] if i < channels else mean[h, i]
                gained = 0.0
                for j in range(channels):
                    if not known[t, j]:
                        continue
                    apart = residual[t, j] - next_mean[c, j]
                    for i in range(n):
                        apart -= outputs[j, i] * next_state[c, i]
                    for k in range(own):
                        apart -= slopes[t, j, k] * next_mean[c, channels + k]
                    gained -= 0.5 * apart**2 / total[t, j]
                    for i in range(m):
                        next_mean[c, i] += gain[t, j, i] * apart
                next_weight[c] = weight[h] + step + gained
                next_likelihood[c] = likelihood[h] + gained
                origin[c] = h
                children += 1
        # Join those that agree on what is on and on the last two changes.
        order = np.argsort(-next_weight[:children])
        top = next_weight[order[0]]
        kept_courses = 0
        selected = np.empty(courses, np.int64)
        for position in range(children):
            c = order[position]
            twin = -1
            for other in range(kept_courses):
                d = selected[other]
                if (
                    next_on[d] == next_on[c]
                    and next_last[d] == next_last[c]
                    and next_before[d] == next_before[c]
                ):
                    twin = other
                    break
            if twin >= 0:
                joined[selected[twin]] += np.exp(next_weight[c] - top)
            elif kept_courses < courses and next_weight[c] > top - 40.0:
                selected[kept_courses] = c
                joined[c] = np.exp(next_weight[c] - top)
                kept_courses += 1
        spare = np.empty((kept_courses, after), np.int8)
        for k in range(kept_courses):
            c = selected[k]
            h = origin[c]
            parent[t, k], chosen[t, k] = h, next_on[c]
            for i in range(after):
                spare[k, i] = past[h, i]
            spare[k, t % after] = next_on[c]
        if kept_courses == 0:
            # no course has a likelihood that is a number
            return np.zeros(steps, np.bool_), probability, -np.inf, -np.inf
        whole = 0.0
        for k in range(kept_courses):
            c = selected[k]
            state[k] = next_state[c]
            mean[k] = next_mean[c]
            weight[k] = top + np.log(joined[c])
            likelihood[k] = next_likelihood[c]
            on[k], last[k], before[k] = next_on[c], next_last[c], next_before[c]
            past[k] = spare[k]
            whole += joined[c]
        count = kept_courses
        # States long ago are determined by the remaining courses.
        if t >= after - 1:
            old = (t + 1) % after
            share = 0.0
            for k in range(count):
                if past[k, old] == 1:
                    share += joined[selected[k]]
            probability[t - after + 1] = share / whole
    top = weight[:count].max()
    shares = np.exp(weight[:count] - top)
    evidence = top + np.log(shares.sum())
    for t in range(max(0, steps - after + 1), steps):
        share = 0.0
        for k in range(count):
            if past[k, t % after] == 1:
                share += shares[k]
        probability[t] = share / shares.sum()
    best = int(np.argmax(weight[:count]))
    course = np.zeros(steps, np.bool_)
    k = best
    for t in range(steps - 1, -1, -1):
        course[t] = chosen[t, k] == 1
        k = parent[t, k]
    return course, probability, evidence, likelihood[best]
