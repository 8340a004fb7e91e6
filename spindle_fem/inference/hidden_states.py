"""Heat or cooling that switches: from a fit of a machine to the course that explains what it leaves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hypothesis_fit import Fit, Problem, candidate_coordinates
from spindle_fem.inference.innovations import ZERO_SIGMA
from spindle_fem.inference.missing_heat import Pattern
from spindle_fem.inference.reading_noise import key_of
from spindle_fem.inference.switching_model import LinearAnswer, Readings

Array = NDArray[np.float64]

# An input counts as zero up to this share of its largest value; it is informative if it is both zero and not
# zero for at least this share of the time.
ZERO_SHARE, LEAST_SHARE = 0.01, 0.03


def answer_of(base: BaseRun, pattern: Pattern) -> LinearAnswer:
    """Response of a machine about one of its runs to a unit of heat, or of conductance, at a spot."""
    run, model = base.run, base.predictor.fast.model
    load = np.mean([model.place(place) for place in pattern.places], axis=0)
    steps, size = len(base.drive.steps), model.size
    group = np.zeros(steps, dtype=np.int64)
    entering = np.empty((steps, size))
    strength = np.ones(steps + 1)
    if pattern.cooling:
        strength = pattern.surroundings(base) - base.states @ load
    advance, loss = [], []
    for number, (key, rows) in enumerate(run.groups.items()):
        propagator = run.propagators[key]
        group[rows] = number
        start, end = propagator.from_start @ load, propagator.from_end @ load
        entering[rows] = strength[rows, None] * start + strength[rows + 1, None] * end
        advance.append(np.asarray(propagator.advance))
        taken = np.outer(start, load) + np.outer(end, load @ advance[-1])
        loss.append(taken if pattern.cooling else np.zeros_like(taken))
    begins = np.zeros(steps, dtype=bool)
    begins[[0, *base.drive.restarts]] = True
    # As BaseRun.outputs has it: an outlet reads otherwise at another flow.
    classes, reads = np.unique(np.append(run.step_class[1:], run.step_class[-1]), return_inverse=True)
    outputs = np.array([run.operators[int(number)].outputs[base.columns] for number in classes])
    return LinearAnswer(np.array(advance), np.array(loss), group, entering, begins, reads, outputs)


def without(fit: Fit, left_out: Candidate) -> tuple[tuple[Candidate, ...], dict[str, float]]:
    """The other candidates of a fit, and their values."""
    own = {c.name for c in candidate_coordinates(left_out)}
    values = {name: value for name, value in fit.values.items() if name not in own}
    return tuple(c for c in fit.candidates if c is not left_out), values


def readings_about(
    problem: Problem, fit: Fit, number: int, left_out: Candidate | None = None, *, everything: bool = False
) -> Readings:
    """Residuals of a fit for one recording, at the ends of the steps of its run.

    Parameters
    ----------
    left_out : Candidate, optional
        One of the fit's, whose part is given back to what is left.
    everything : bool
        Readings that are held out as well.
    """
    predictor = problem.predictor
    recording, drive = predictor.recordings[number], predictor.drives[number]
    grid, times = drive.grid, predictor.stamps(number)
    rest, values = (fit.candidates, fit.values) if left_out is None else without(fit, left_out)
    kept = [i for i, c in enumerate(fit.coordinates) if c.name in values]
    coordinates = [fit.coordinates[i] for i in kept]
    # About the machine without what is left out, whose part would else pass for that of the parameters.
    predicted = predictor.predict(number, values, rest, [c.name for c in coordinates])
    root, mean = fit.known.beside(len(coordinates))
    by = predicted.sensitivity * np.array([c.sigma for c in coordinates])
    model = predicted.temperature
    if everything:
        # Parameters stay as they were fitted, as far as that knows them.
        slopes = by @ np.linalg.cholesky(fit.covariance[np.ix_(kept, kept)])
    else:
        # Coordinates count from what is known of them before, in units of what is not known.
        model = model - by @ (fit.position[kept] - mean)
        slopes = np.linalg.solve(root.T, by.reshape(-1, by.shape[2]).T).T.reshape(by.shape)
    usable = recording.usable & (True if everything else predictor.use[number][:, None])
    owner = np.searchsorted(0.5 * (grid[1:] + grid[:-1]), times)
    slow = [problem.slow.of(key_of(recording, channel)) for channel in range(usable.shape[1])]
    residual = np.full((len(grid), usable.shape[1]), np.nan)
    variance = np.ones_like(residual)
    for channel in range(usable.shape[1]):
        rows = np.flatnonzero(usable[:, channel])
        left = recording.temperature[rows, channel]
        left = left - np.interp(times[rows], grid, model[:, channel])
        if channel >= recording.temperature_count and rows.size:
            # A displacement counts from a zero that is unknown: a coordinate beside its slopes.
            left = left - left[0]
        count = np.bincount(owner[rows], minlength=len(grid))
        seen = count > 0
        residual[seen, channel] = np.bincount(owner[rows], left, minlength=len(grid))[seen] / count[seen]
        rounding = recording.noise[channel].resolution / np.sqrt(12.0)
        variance[seen, channel] = np.hypot(recording.sigma[channel], rounding) ** 2 / count[seen]
    # Where a run starts anew its readings are what it starts from, as at the first point.
    residual[list(drive.restarts)] = np.nan
    return Readings(
        residual[1:],
        variance[1:],
        np.ascontiguousarray(_with_zeros(slopes[1:], recording.temperature_count)),
        np.diff(grid),
        np.array([item.sigma for item in slow]),
        np.array([item.time for item in slow]),
    )


def _with_zeros(slopes: Array, temperatures: int) -> Array:
    """Slopes (T, c, p) and the zero of each displacement, which follow the temperatures, as coordinates."""
    zeros = np.eye(slopes.shape[1])[:, temperatures:]
    return np.concatenate((slopes, np.broadcast_to(ZERO_SIGMA * zeros, (len(slopes), *zeros.shape))), axis=2)


def intervals_of(level: Array, grid: Array) -> list[tuple[float, float]]:
    """Intervals at one level, none of 0, from the levels of steps (T,) and their ends (T + 1,) [s]."""
    return [(float(grid[a]), float(grid[b])) for a, b in _runs(level)]


def levels_of(level: Array) -> list[int]:
    """Level in each of these intervals."""
    return [int(level[a]) for a, _ in _runs(level)]


def _runs(level: Array) -> list[tuple[int, int]]:
    """First step of every run of equal levels that are not 0, and that after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], level.astype(int), [0]))))
    return [(a, b) for a, b in pairwise(edges.tolist()) if level[a] > 0]


def conditions_of_inputs(base: BaseRun) -> dict[str, NDArray[np.int64]]:
    """Whether each input is zero in each step, of those that are now and then, by name."""
    found = {}
    for name, values in base.start_inputs.items():
        zero = np.abs(values) <= ZERO_SHARE * np.abs(values).max(initial=0.0)
        if LEAST_SHARE < zero.mean() < 1.0 - LEAST_SHARE:
            found[name] = zero.astype(np.int64)
    return found
