"""Unrecorded heat of a network within gaps of its recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.recording_gaps import long_spacings
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Modes of one gap and source: those that hold less than this share of the variance are left out, and most.
LEAST_VARIANCE, MOST_MODES = 0.02, 6
# A gap of more steps is followed at as many points.
MOST_POINTS = 200
# Instants of change that are open for one source.
MOST_CHANGES = 150
# Left out if it would raise no node by this share of the least noise, even if the node kept all the heat.
LEAST_RISE = 0.2


@dataclass(frozen=True, slots=True)
class HeatWithinGap:
    """Heat of a source beside what is held, over some steps.

    Attributes
    ----------
    source : str
    edges : tuple of float, [s]
        Ends of these steps, one more than there are.
    course : tuple of float, [W]
        Mean over each step, for an amplitude of one.
    """

    source: str
    edges: tuple[float, ...]
    course: tuple[float, ...]

    def __call__(self, base: BaseRun) -> Change:
        """Loads of the heat, in means over the steps of a run, which may be others."""
        fast = base.predictor.fast
        (row,) = fast.heat_rows(self.source)
        energy = np.append(0.0, np.cumsum(np.diff(self.edges) * self.course))
        heat = np.diff(np.interp(base.drive.grid, self.edges, energy)) / base.drive.steps
        load = heat[:, None] * fast.model.place(fast.heat_places[row])
        return Change(load, load)


def gap_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """Directions of a network whose sources follow inputs that are held over gaps.

    How much a source may have differed from the value held is estimated from its record elsewhere: its heat
    is modelled as a stationary Gaussian process with the autocovariance of the rest of the recording, known
    at both ends of the gap.

    Source: Rasmussen & Williams (2006), Gaussian Processes for Machine Learning, section 2.2.
    """
    if not predictor.is_network:
        return
    for number in range(len(predictor.recordings)):
        if _held_sources(predictor, number) and has_unread(predictor.recordings[number]):
            yield from unread_heat(predictor, number, predictor.transient(number, {}))


def has_unread(recording: Recording) -> bool:
    """Whether inputs may have done in a recording what none of its rows shows."""
    return bool(long_spacings(recording) or recording.unseen_changes)


def _held_sources(predictor: Predictor, number: int) -> list[int]:
    """Sources of a network that follow a held input of a recording."""
    recording = predictor.recordings[number]
    held = dict(zip(recording.input_names, recording.held.tolist(), strict=True))
    return [i for i, name in enumerate(predictor.fast.network.source_input) if held.get(name)]


def unread_heat(
    predictor: Predictor, number: int, run: TransientRun, earlier: Array | None = None
) -> Iterator[Misdescription]:
    """Directions of one recording, by the heat of a run of it.

    Parameters
    ----------
    run : TransientRun
    earlier : (n, s) ndarray, [W], optional
        Heat of every source over as many steps before the recording, from which is also seen how it varies.
    """
    network, recording = predictor.fast.network, predictor.recordings[number]
    heat, grid = heat_over_steps(run), run.drive.grid
    if earlier is not None:
        heat = np.concatenate((earlier, heat))
        grid = np.concatenate((grid[0] - recording.usual_spacing * np.arange(len(earlier), 0, -1), grid))
    spans, changes = long_spacings(recording), recording.unseen_changes
    noise = float(np.min(recording.sigma))
    for row in _held_sources(predictor, number):
        source = network.source_names[row]
        least = LEAST_RISE * noise * float(network.capacity[network.source_node[row]])
        for gap, order, edges, size, course in _modes_in(heat[:, row], grid, spans, least):
            yield Misdescription(
                f"gap.{source}.{gap}.{order}",
                f"heat of {source} within a gap",
                "W",
                size,
                f"heat of {source} within the gap from {spans[gap][0]:.0f} s, beside what its input was "
                f"before and after: mode {order}",
                HeatWithinGap(source, tuple(edges.tolist()), tuple(course.tolist())),
                number,
            )
        own = [span for name, *span in changes if name == network.source_input[row]]
        for begin, end, edges, size, course in _changes_in(heat[:, row], grid, own, spans, least):
            yield Misdescription(
                f"change.{source}.{begin:.0f}",
                f"instant at which heat of {source} changed",
                "W",
                size,
                f"heat of {source} between {begin:.0f} s and {end:.0f} s, readings of its input between "
                "which it changed, beside a change amid them",
                HeatWithinGap(source, tuple(edges.tolist()), tuple(course.tolist())),
                number,
            )


def heat_over_steps(run: TransientRun) -> Array:
    """Mean heat of every source over every step of a run, (G, s) W."""
    return 0.5 * (run.friction_start + run.friction_end)


def _changes_in(
    heat: Array,
    grid: Array,
    changes: Sequence[Sequence[float]],
    gaps: Sequence[tuple[float, float]],
    least: float,
) -> Iterator[tuple[float, float, Array, float, Array]]:
    """Span, ends of steps, standard deviation [W] and course of each change that may bring ``least`` J.

    The instant is anywhere between the two readings with the same probability: a uniform distribution's
    spread. Gaps have courses of their own. Of an input that changes with every reading the largest.
    """
    middle = 0.5 * (grid[:-1] + grid[1:])
    found = []
    for begin, end in changes:
        own = np.flatnonzero((middle > begin) & (middle < end))
        if not own.size or any(a < end and b > begin for a, b in gaps):
            continue
        beside = heat[[max(own[0] - 1, 0), min(own[-1] + 1, len(heat) - 1)]]
        size = float(abs(np.diff(beside)[0])) / np.sqrt(12.0)
        if size * (end - begin) >= least:
            found.append((begin, end, grid[own[0] : own[-1] + 2], size, np.ones(own.size)))
    yield from sorted(found, key=lambda item: -item[3] * (item[1] - item[0]))[:MOST_CHANGES]


def _modes_in(
    heat: Array, grid: Array, spans: Sequence[tuple[float, float]], least: float
) -> Iterator[tuple[int, int, Array, float, Array]]:
    """Gap, order, ends of steps, standard deviation [W] and course of each mode that brings ``least`` J."""
    middle, steps = 0.5 * (grid[:-1] + grid[1:]), np.diff(grid)
    inside = [np.flatnonzero((middle > begin) & (middle < end)) for begin, end in spans]
    known = np.ones(len(heat), dtype=bool)
    for own in inside:
        known[own] = False
    if not known.any() or np.ptp(heat[known]) == 0.0:
        return
    longest = max((len(own) for own in inside), default=0)
    covariance = autocovariance(np.where(known, heat - heat[known].mean(), 0.0), known, longest + 2)
    for gap, own in enumerate(inside):
        if not len(own):
            continue
        at = np.unique(np.linspace(0, len(own) - 1, min(len(own), MOST_POINTS)).round().astype(int))
        for order, (size, shape) in enumerate(bridge_modes(covariance, at + 1, len(own) + 1), 1):
            course = np.interp(np.arange(len(own)), at, shape)
            if size * np.abs(np.cumsum(course * steps[own])).max() >= least:
                yield gap, order, grid[own[0] : own[-1] + 2], size, course


def autocovariance(values: Array, known: NDArray[np.bool_], lags: int) -> Array:
    """Autocovariance at lags of 0, 1, ... steps from the pairs that are known, (lags,).

    Parameters
    ----------
    values : (n,) ndarray
        Deviations from the mean; zero where unknown.
    """
    size = 2 * len(values)
    power = np.abs(np.fft.rfft(values, size)) ** 2
    pairs = np.abs(np.fft.rfft(known.astype(float), size)) ** 2
    total, count = (np.fft.irfft(item, size)[:lags] for item in (power, pairs))
    found = np.zeros(lags)
    found[: len(total)] = total / np.maximum(count, 1.0)
    return found


def bridge_modes(covariance: Array, at: NDArray[np.int64], end: int) -> list[tuple[float, Array]]:
    """Independent courses of a stationary process between two instants at which it is known.

    Parameters
    ----------
    covariance : (n,) ndarray
        At lags of 0, 1, ...
    at : (m,) ndarray of int
        Instants between 0 and ``end``, at which the process is known.

    Returns
    -------
    list of (float, (m,) ndarray)
        Standard deviation of each, the largest first, and its course, whose largest magnitude is 1.
    """
    points = np.concatenate(([0], at, [end]))
    values, vectors = np.linalg.eigh(toeplitz(covariance[: end + 1])[np.ix_(points, points)])
    # An estimate at few pairs need not be a covariance: what is below zero is none.
    whole = (vectors * np.maximum(values, 0.0)) @ vectors.T
    inner, ends = slice(1, -1), [0, -1]
    gained = np.linalg.pinv(whole[np.ix_(ends, ends)], rcond=1e-9, hermitian=True)
    left = whole[inner, inner] - whole[inner, ends] @ gained @ whole[ends, inner]
    values, vectors = np.linalg.eigh(0.5 * (left + left.T))
    found = []
    for value, vector in zip(values[::-1][:MOST_MODES], vectors.T[::-1], strict=False):
        if value < LEAST_VARIANCE * max(float(np.trace(left)), 1e-30):
            break
        peak = vector[np.argmax(np.abs(vector))]
        found.append((float(np.sqrt(value) * abs(peak)), vector / peak))
    return found
