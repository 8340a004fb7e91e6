"""Place and time of missing heat: regularised inversion of the residual, place by place.

For every place the response of all channels to heat that begins at each of a
row of instants is marched through the linear model. From these responses follow

- the heat over time at that one place which explains the residual best, as a
  Gaussian random walk whose size the evidence chooses, and how well it does;
- the intervals of constant heat (or of a constant conductance to the
  surroundings) that explain it best, by trying every pair of instants.

Source of the random-walk inversion: Tarantola (2005), Inverse Problem Theory,
chapter 3 (linear Gaussian problems).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.linearised_fit import LinearProblem
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.machine.view.usual_sizes import LEAST_ON
from spindle_fem.model.thermal_model import ThermalModel

Array = NDArray[np.float64]

# Answers that are marched together, which bounds the memory of one march.
COLUMNS = 320
# Parts of the instants that are marched one after the other.
PARTS = 4
# An edge of an interval is moved where that gains more than rounding (natural logarithm).
SMALLEST_SETTLING = 1e-6


@dataclass(frozen=True, slots=True)
class Pattern:
    """Distribution of unknown heat, positive or negative, at one spot.

    Attributes
    ----------
    places : tuple of str
        Places of the model, which share the heat evenly.
    cooling : bool
        True: a unit conductance to the surroundings; False: unit heat.
    fluid : str or float
        Input that is the temperature of these surroundings, or that temperature [K].
    link : str
        Coefficient that ends at them, where there is one.
    other : str
        Place at the link's other end, where that is no surroundings.
    source : str
        Source whose heat it scales, where there is one; its unit is the mean of that while on.
    """

    spot: str
    places: tuple[str, ...]
    cooling: bool = False
    fluid: str | float = "ambient"
    link: str = ""
    other: str = ""
    source: str = ""

    def load(self, model: ThermalModel) -> Array:
        """Load of a unit of heat, (r,)."""
        load = np.mean([model.place(place) for place in self.places], axis=0)
        return load - model.place(self.other) if self.other else load

    def strength(self, base: BaseRun) -> tuple[Array | float, Array | float]:
        """Heat of one unit at both ends of every step, (G,) W."""
        if self.source:
            (row,) = base.predictor.fast.heat_rows(self.source)
            ends = base.run.friction_start[:, row], base.run.friction_end[:, row]
            heat = 0.5 * (ends[0] + ends[1])
            on = heat > LEAST_ON * heat.max()
            usual = float(np.average(heat[on], weights=base.drive.steps[on])) if on.any() else 1.0
            return ends[0] / usual, ends[1] / usual
        if not self.cooling:
            return 1.0, 1.0
        over = (0.0 if self.other else self.surroundings(base)) - base.states @ self.load(
            base.predictor.fast.model
        )
        return over[:-1], over[1:]

    def surroundings(self, base: BaseRun) -> Array:
        """Temperature of the surroundings along a run, (G + 1,) K."""
        ends = []
        for inputs in (base.start_inputs, base.end_inputs):
            if self.link:
                fast = base.predictor.fast
                factors = [base.values.get(name, 1.0) for name in fast.inputs.fluid_parameters(self.link)]
                found = fast.fluid_temperature(self.link, inputs) * float(np.prod(factors))
            else:
                found = inputs[self.fluid] if isinstance(self.fluid, str) else self.fluid
            ends.append(np.broadcast_to(found, len(base.drive.steps)))
        return np.append(ends[0], ends[1][-1])


@dataclass(frozen=True, slots=True)
class Onsets:
    """Inner products of the responses to heat from each instant on, at one spot.

    Attributes
    ----------
    times : (k,) ndarray, [s]
    gram : (k, k) ndarray
    data : (k,) ndarray
    """

    pattern: Pattern
    recording: int
    times: Array
    gram: Array
    data: Array


@dataclass(frozen=True, slots=True)
class Explanation:
    """Heat over time at one spot that explains what is left.

    Attributes
    ----------
    log_evidence : float
        Over no heat.
    times : (k,) ndarray, [s]
    heat : (k,) ndarray, [W]
        From each time to the next.
    sigma : (k,) ndarray, [W]
    """

    spot: str
    recording: int
    log_evidence: float
    times: Array
    heat: Array
    sigma: Array


@dataclass(frozen=True, slots=True)
class OnOff:
    """Intervals of one strength at one spot.

    Attributes
    ----------
    intervals : tuple of (float, float), [s]
    strength : float
        W, or W/K for cooling.
    gain : float
        Logarithm of the evidence over nothing, choice of the instants paid for.
    options : int
        Instants that an edge could be at.
    """

    pattern: Pattern
    recording: int
    intervals: tuple[tuple[float, float], ...]
    strength: float
    gain: float
    options: int = tuned.ONSETS


def onset_answers(
    problem: Problem,
    fit: Fit,
    patterns: Sequence[Pattern],
    recording: int,
    *,
    number: int = tuned.ONSETS,
    linear: LinearProblem | None = None,
    workers: Workers | None = None,
) -> list[Onsets]:
    """Inner products of all spots' responses about a fit.

    Parameters
    ----------
    recording : int
        The one in which heat comes and goes.
    number : int
        Instants.
    linear : LinearProblem or None
        About the fit, where it is known.
    workers : Workers or None
        Processes that work them out; the result does not depend on it.
    """
    linear = LinearProblem.about(problem, fit) if linear is None else linear
    chunk = max(1, COLUMNS // number)
    chunks = [patterns[first : first + chunk] for first in range(0, len(patterns), chunk)]
    jobs = [
        partial(_onsets_of, fit=fit, linear=linear, chunks=own, recording=recording, number=number)
        for own in (chunks[0::2], chunks[1::2])
    ]
    found = (workers or Workers()).done(problem, jobs)
    # One after the other again.
    return [item for position in range(len(chunks)) for item in found[position % 2][position // 2]]


def _onsets_of(
    problem: Problem,
    fit: Fit,
    linear: LinearProblem,
    chunks: Sequence[Sequence[Pattern]],
    recording: int,
    number: int,
) -> list[list[Onsets]]:
    """Inner products of some spots' responses, by chunks that are marched together."""
    base = BaseRun(problem.predictor, recording, fit.values, fit.candidates)
    grid = base.drive.grid
    onsets = np.linspace(grid[0], grid[-1], number + 1)[:-1]
    found = []
    for chosen in chunks:
        answers = _march(base, chosen, onsets)
        on_grid = [
            answers
            if other == recording
            else np.zeros((problem.predictor.drives[other].grid.size, len(columns), answers.shape[2]))
            for other, columns in enumerate(problem.predictor.columns)
        ]
        gram, data, _ = linear.gram(problem.whitened(on_grid))
        own = [slice(index * number, (index + 1) * number) for index in range(len(chosen))]
        found.append(
            [
                Onsets(pattern, recording, onsets, gram[rows, rows].copy(), data[rows].copy())
                for pattern, rows in zip(chosen, own, strict=True)
            ]
        )
    return found


def _march(base: BaseRun, patterns: Sequence[Pattern], onsets: Array) -> Array:
    """Answers of the channels, (G + 1, c, n_patterns * n_onsets)."""
    model, run, drive = base.predictor.fast.model, base.run, base.drive
    loads = np.array([pattern.load(model) for pattern in patterns]).T
    before, after = (np.ones((len(drive.steps), len(patterns))) for _ in range(2))
    for index, pattern in enumerate(patterns):
        before[:, index], after[:, index] = pattern.strength(base)
    # Share of each step for which heat that begins at an onset is on.
    on = np.clip((drive.grid[1:, None] - onsets) / drive.steps[:, None], 0.0, 1.0)
    answer = np.empty((len(drive.steps), model.size, len(patterns), 1))
    for key, rows in run.groups.items():
        propagator = run.propagators[key]
        start, end = propagator.from_start @ loads, propagator.from_end @ loads
        answer[rows, :, :, 0] = start * before[rows, None, :] + end * after[rows, None, :]
    found = []
    # Nothing happens before the first instant of each part: its march begins there.
    for chosen in np.array_split(on, min(PARTS, len(onsets)), axis=1):
        forcing = (answer * chosen[:, None, None, :]).reshape(*answer.shape[:2], -1)
        changes = base.outputs(run.tangents(forcing, base.tracks))
        found.append(changes.reshape(*changes.shape[:2], len(patterns), -1))
    return np.concatenate(found, axis=3).reshape(*found[0].shape[:2], -1)


def explain(onsets: Onsets) -> Explanation:
    """Heat over time at one spot as a random walk from zero.

    The size of its steps is that of the highest evidence among
    ``WALK_SCALES`` (W a step).
    """
    best: tuple[float, float, Array, Array] | None = None
    count = len(onsets.times)
    for scale in tuned.WALK_SCALES:
        matrix = np.eye(count) + scale**2 * onsets.gram
        lower = np.linalg.cholesky(0.5 * (matrix + matrix.T))
        right = scale * onsets.data
        solution = np.linalg.solve(matrix, right)
        evidence = 0.5 * float(right @ solution) - float(np.log(np.diag(lower)).sum())
        if best is None or evidence > best[0]:
            best = (evidence, scale, scale * solution, scale**2 * np.linalg.inv(matrix))
    evidence, _, increments, covariance = best
    total = np.tril(np.ones((count, count)))
    heat = total @ increments
    sigma = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", total, covariance, total), 0.0))
    return Explanation(
        onsets.pattern.spot,
        onsets.recording,
        evidence - np.log(len(tuned.WALK_SCALES)),
        onsets.times,
        heat,
        sigma,
    )


def find_intervals(onsets: Onsets, spread: float, stop: float) -> list[OnOff]:
    """Best one, two and three intervals of one strength at a spot.

    Each further one is put beside the others, or a rest is cut into one of
    them; then all edges are moved until none gains.

    Parameters
    ----------
    spread : float
        Prior standard deviation of the strength, W or W/K; it is positive.
    stop : float, [s]
        End of the recording.
    """
    count = len(onsets.times)
    # Heat that never ends again has no closing instant: an answer of zero closes it.
    gram = np.zeros((count + 1, count + 1))
    gram[:count, :count] = onsets.gram
    data = np.append(onsets.data, 0.0)
    pairs = np.column_stack(np.triu_indices(count + 1, 1))
    times = np.append(onsets.times, stop)
    edges: list[int] = []
    found = []
    for number in range(1, tuned.MOST_INTERVALS + 1):
        added = _best_addition(gram, data, edges, pairs, spread)
        if added is None:
            break
        edges = _settled(gram, data, sorted([*edges, *added]), spread)
        weights = _weights(edges, count + 1)
        square, along = float(weights @ gram @ weights), float(weights @ data)
        paid = number * np.log(len(pairs)) - sum(np.log(i) for i in range(1, number + 1))
        found.append(
            OnOff(
                onsets.pattern,
                onsets.recording,
                tuple(
                    (float(times[a]), float(times[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)
                ),
                along / (square + 1.0 / spread**2),
                float(_gain(np.array([along]), np.array([square]), spread)[0]) - paid,
                count,
            )
        )
    return found


def _weights(edges: Sequence[int], size: int) -> Array:
    """Steps up at every first edge, down at every second."""
    found = np.zeros(size)
    found[list(edges[::2])], found[list(edges[1::2])] = 1.0, -1.0
    return found


def _best_addition(
    gram: Array, data: Array, edges: Sequence[int], pairs: NDArray[np.int64], spread: float
) -> tuple[int, int] | None:
    """Two edges more: an interval beside the others, or a rest within one of them."""
    first, last = pairs.T
    # No edge of the others between the two, nor on them.
    passed = np.searchsorted(edges, first, side="right")
    allowed = passed == np.searchsorted(edges, last, side="left")
    allowed &= ~np.isin(first, edges) & ~np.isin(last, edges)
    if not allowed.any():
        return None
    first, last = first[allowed], last[allowed]
    sign = np.where(passed[allowed] % 2 == 0, 1.0, -1.0)
    weights = _weights(edges, len(data))
    cross = gram @ weights
    own = gram[first, first] + gram[last, last] - 2.0 * gram[first, last]
    size = weights @ cross + 2.0 * sign * (cross[first] - cross[last]) + own
    overlap = weights @ data + sign * (data[first] - data[last])
    best = int(np.argmax(_gain(overlap, size, spread)))
    return int(first[best]), int(last[best])


def _settled(gram: Array, data: Array, edges: list[int], spread: float) -> list[int]:
    """Edges moved one after the other, between their neighbours, until none gains."""
    edges, moved = list(edges), True
    while moved:
        moved = False
        for index, edge in enumerate(edges):
            low = edges[index - 1] + 1 if index else 0
            high = edges[index + 1] if index + 1 < len(edges) else len(data)
            options = np.arange(low, high)
            sign = 1.0 if index % 2 == 0 else -1.0
            rest = _weights(edges, len(data))
            rest[edge] = 0.0
            cross = gram @ rest
            size = rest @ cross + 2.0 * sign * cross[options] + gram[options, options]
            gain = _gain(rest @ data + sign * data[options], size, spread)
            best = int(np.argmax(gain))
            if gain[best] > gain[edge - low] + SMALLEST_SETTLING:
                edges[index], moved = int(options[best]), True
    return edges


def _gain(overlap: Array, size: Array, spread: float) -> Array:
    """Logarithm of the evidence of one positive strength over none."""
    scaled = 1.0 + spread**2 * size
    gain = 0.5 * spread**2 * overlap**2 / scaled - 0.5 * np.log(scaled) + np.log(2.0)
    return np.where(overlap > 0.0, gain, -np.inf)


def conditions_of(times: Array, speed: Array, temperature: Array) -> list[str]:
    """Operating condition at each time: standstill, heating, cooling or steady running.

    Parameters
    ----------
    times : (n,) ndarray, [s]
    speed : (n,) ndarray, [rad/s]
    temperature : (n,) ndarray, [K]
        Temperature of the machine.
    """
    rate = np.gradient(temperature, times) if len(times) > 1 else np.zeros(len(times))
    limit = max(0.1 * float(np.abs(rate).max(initial=0.0)), 1e-12)
    words = []
    for value, slope in zip(speed, rate, strict=True):
        if value <= 0.0:
            words.append("standstill")
        elif slope > limit:
            words.append("heating")
        elif slope < -limit:
            words.append("cooling")
        else:
            words.append("steady running")
    return words


def stretches(mask: NDArray[np.bool_], times: Array) -> list[tuple[float, float]]:
    """Intervals over which a mask holds, from each first to each last true entry."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    return [(float(times[a]), float(times[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def shares(evidence: Mapping[str, float]) -> dict[str, float]:
    """Probabilities from logarithms of evidence."""
    highest = max(evidence.values())
    weight = {key: float(np.exp(value - highest)) for key, value in evidence.items()}
    total = sum(weight.values())
    return {key: value / total for key, value in weight.items()}
