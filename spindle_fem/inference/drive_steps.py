"""Inputs of recordings on the steps of a diagnosis: minutes, shorter about changes, or even ones."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.recording_gaps import held_columns, long_spacings
from spindle_fem.model.reduced.drive import (
    ClassWidths,
    Drive,
    classes_of,
    covariate_columns,
    drive_of_recording,
)
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.recordings.align import GAP_STEPS, Recording

Array = NDArray[np.float64]

# 3 K of oil change film and capacity by 0.1 %, readings by millikelvins; films that follow speed are small
# beside the oil's.
DIAGNOSED = ClassWidths(3.0, 0.01, 0.01, 120)
# Oil temperatures of classes are rounded to this, K: classes of one temperature share the channel's maps.
INLET_STEP = 0.5
# After a change of the inputs what follows at once, balls, rings and films, takes minutes: steps of a minute
# leave up to 0.25 K there (recorded spindle, started and stopped every quarter of an hour), these 0.02 K.
# The last step before a change is short as well: what changed between two rows may have changed before the
# later one. Changes below a share of an input, as of a speed that was measured, do not count.
SETTLING, SHORT_STEP, SMALL_CHANGE = 120.0, 20.0, 0.02


def centred(fine: Drive, recording: Recording) -> Drive:
    """The drive with changes that fell into gaps put amid them instead of at their ends."""
    usual = recording.usual_spacing
    columns = held_columns(recording, fine)
    start, end = fine.start.copy(), fine.end.copy()
    for row in 1 + np.flatnonzero(np.diff(recording.times) > GAP_STEPS * usual):
        first, last = recording.times[row - 1], recording.times[row]
        begin = np.searchsorted(fine.grid, first - 1e-6)
        stop = np.searchsorted(fine.grid, last + 1e-6) - 1
        if stop < len(start) and stop - begin > 1:
            middle = begin + int(np.argmin(np.abs(fine.grid[begin:stop] - 0.5 * (first + last))))
            start[middle:stop, columns] = end[middle:stop, columns] = fine.start[stop, columns]
    return replace(fine, start=start, end=end)


def coarse_drive(spec, recording: Recording, step: float) -> Drive:
    """Inputs on steps from change to change, none longer than ``step``, short about changes."""
    fine = centred(drive_of_recording(spec, recording), recording)
    begin, finish = fine.grid[0], fine.grid[-1]
    beside = covariate_columns(fine.names)
    inputs = np.setdiff1d(np.arange(len(fine.names)), beside)
    changed = np.abs(fine.start[1:, inputs] - fine.end[:-1, inputs])
    least = SMALL_CHANGE * np.abs(fine.start[:, inputs]).max(axis=0)
    jumps, large = (fine.grid[1:-1][np.any(changed > size, axis=1)] for size in (0.0, least))
    edges = np.unique(np.concatenate(([begin], jumps, [finish])))
    large = np.append(begin, large)
    since = edges[:-1] - large[np.searchsorted(large, edges[:-1], side="right") - 1]
    settling = np.maximum(0.0, SETTLING - since)
    last = np.where(np.isin(edges[1:], large), min(SHORT_STEP, step), 0.0)
    pieces = map(_steps_between, edges[:-1], edges[1:], settling, last, itertools.repeat(step))
    grid = np.append(np.concatenate(list(pieces)), finish)
    middle = 0.5 * (grid[:-1] + grid[1:])
    start, end = np.empty((middle.size, len(fine.names))), np.empty((middle.size, len(fine.names)))
    first = np.clip(np.searchsorted(fine.grid, grid[:-1], side="right") - 1, 0, fine.steps.size - 1)
    last = np.clip(np.searchsorted(fine.grid, grid[1:], side="left") - 1, 0, fine.steps.size - 1)
    for ends, owner, at in ((start, first, grid[:-1]), (end, last, grid[1:])):
        part = ((at - fine.grid[owner]) / fine.steps[owner])[:, None]
        ends[:] = fine.start[owner] + part * (fine.end[owner] - fine.start[owner])
    start[:, beside] = end[:, beside] = _means(fine, grid)[:, beside]
    step_class, points = classes_of(0.5 * (start + end), DIAGNOSED)
    # Clipped to the range that occurs, so that no property is evaluated outside it.
    inlets = np.array([p.coolant_inlet_temperature for p in points])
    steps = np.round((inlets - inlets.min()) / INLET_STEP) * INLET_STEP
    shared = np.minimum(inlets.min() + steps, inlets.max()).tolist()
    points = tuple(
        replace(p, coolant_inlet_temperature=inlet) for p, inlet in zip(points, shared, strict=True)
    )
    return Drive(grid, grid, fine.names, start, end, step_class, points, fine.notes)


def _steps_between(begin: float, end: float, settling: float, last: float, step: float) -> Array:
    """Starts of the steps between two changes, the first seconds and the last ones in short steps.

    Between them whole long ones, for one length makes one matrix of the model. Stamps a second apart that all
    jump (an input that flickers) would only cost: no step is cut below them.
    """
    whole = max(0, int((end - begin - settling - last + 1e-6) // step))
    settled, before = end - last - whole * step, end - last
    short = min(SHORT_STEP, step) if settling > 0.0 or last > 0.0 else step
    spans = (
        [(begin, settled, short), (settled, before, step), (before, end, short)]
        if whole
        else [(begin, end, short)]
    )
    return np.concatenate([_evenly(*span) for span in spans])


def _evenly(begin: float, end: float, longest: float) -> Array:
    """Starts of equal steps, none longer than asked."""
    number = int(np.ceil((end - begin) / longest - 1e-6))
    return begin + (end - begin) * np.arange(number) / max(1, number)


def _means(fine: Drive, grid: Array) -> Array:
    """Means of inputs over the steps of another grid, their integral kept, (G, m)."""
    total = np.vstack(
        (
            np.zeros(fine.start.shape[1]),
            np.cumsum(0.5 * (fine.start + fine.end) * fine.steps[:, None], axis=0),
        )
    )
    integral = np.column_stack([np.interp(grid, fine.grid, column) for column in total.T])
    # Beyond the last reading of a segment the last input goes on; the gap that follows counts for nothing.
    covered = np.diff(np.minimum(grid, fine.grid[-1]))
    means = np.diff(integral, axis=0) / np.maximum(covered, 1e-9)[:, None]
    means[covered <= 1e-9] = fine.end[-1]
    return means


def even_drive(fast: FastModel, recording: Recording) -> Drive:
    """Inputs of a network on equal steps of the recording's usual spacing, means over each step.

    The means keep the integral of every input; one length of step makes one
    matrix of the model. A held input that is another after a gap changes amid it.
    """
    fine = fast.inputs.drive(recording, largest_step=np.inf)
    begins = np.array([0, *fine.restarts])
    ends = np.array([*(begins[1:] - 1), len(fine.grid) - 1])
    inside = np.ones(len(fine.steps), dtype=bool)
    inside[begins[1:] - 1] = False
    step = float(np.median(fine.steps[inside])) if inside.any() else float(fine.steps[0])
    pieces, restarts, count = [], [], 0
    for number, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        first, last = fine.grid[begin], fine.grid[end]
        whole = max(1, int(np.ceil((last - first) / step - 1e-6)))
        edges = first + step * np.arange(whole + 1)
        if number + 1 < len(begins) and edges[-1] >= fine.grid[begins[number + 1]]:
            edges[-1] = 0.5 * (last + fine.grid[begins[number + 1]])
        if number:
            restarts.append(count)
        pieces.append(edges)
        count += len(edges)
    grid = np.concatenate(pieces)
    means = _means(_amid_gaps(fine, recording), grid)
    classes = np.zeros(len(means), dtype=np.int64)
    return replace(
        fine, times=grid, grid=grid, start=means, end=means, step_class=classes, restarts=tuple(restarts)
    )


def _amid_gaps(fine: Drive, recording: Recording) -> Drive:
    """The drive with held inputs that are others after a gap changing amid it instead of at its end.

    A gap is one step, or several where stamps jitter.
    """
    columns = held_columns(recording, fine)
    spans = [span for span in long_spacings(recording) if span[1] < fine.grid[-1] - 1e-6]
    if not spans:
        return fine
    middles = np.mean(spans, axis=1)
    owners = np.searchsorted(fine.grid, middles, side="right") - 1
    part = ((middles - fine.grid[owners]) / fine.steps[owners])[:, None]
    amid = fine.start[owners] + part * (fine.end[owners] - fine.start[owners])
    grid = np.insert(fine.grid, owners + 1, middles)
    start, end = np.insert(fine.start, owners + 1, amid, axis=0), np.insert(fine.end, owners, amid, axis=0)
    for middle, (_, last) in zip(middles, spans, strict=True):
        # Where stamps jitter the last one need not end a step: that in which it lies has its inputs.
        begin, stop = np.searchsorted(grid, middle), np.searchsorted(grid, last + 1e-6) - 1
        start[begin:stop, columns] = end[begin:stop, columns] = start[stop, columns]
    return replace(fine, grid=grid, start=start, end=end)
