"""Gaps of a recording: what may have happened in them unseen, and what that does to the temperatures.

Two things are left open to first order: when, within a gap, an input changed
that is another after it; and friction or an input temperature that differed
within a piece of the gap.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.model.reduced.term_march import Tracks
from spindle_fem.model.reduced.trbdf2_matrices import build_propagator
from spindle_fem.recordings.align import GAP_STEPS, Recording

Array = NDArray[np.float64]

# Input temperatures, by the name of their load.
WARMTH = ("ambient", "coolant_inlet")
# Times that are followed of those that an input may have changed earlier.
TIMES = 4


def gap_pieces(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Gaps long enough for something to have happened in them, in pieces of some minutes, [s]."""
    spacing = np.diff(recording.times)
    rows = np.flatnonzero((spacing > GAP_STEPS * recording.usual_spacing) & (spacing >= tuned.SHORTEST_GAP))
    found = []
    for row in rows:
        first, last = recording.times[row : row + 2]
        edges = np.linspace(
            first, last, 1 + min(tuned.MOST_PIECES, int(np.ceil((last - first) / tuned.GAP_PIECE)))
        )
        found += [(float(a), float(b)) for a, b in itertools.pairwise(edges)]
    return tuple(found)


def long_spacings(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Distances of stamps within a segment that are gaps, whatever their length, [s]."""
    rows = np.flatnonzero(np.diff(recording.times) > GAP_STEPS * recording.usual_spacing)
    begins = set(recording.segments[1:, 0].tolist())
    return tuple(
        (float(recording.times[i]), float(recording.times[i + 1])) for i in rows if i + 1 not in begins
    )


def held_columns(recording: Recording, drive: Drive) -> list[int]:
    """Columns of a drive that are inputs of its recording held from reading to reading."""
    held = dict(zip(recording.input_names, recording.held.tolist(), strict=True))
    return [column for column, name in enumerate(drive.names) if held.get(name, False)]


def with_changes_amid(recording: Recording) -> Recording:
    """A recording whose rarely read held inputs change amid the readings between which they did.

    An input may be read more rarely than the temperatures beside it: held until its next reading every change
    would come late. Between which readings each was is kept in ``unseen_changes``.
    """
    usual = recording.usual_spacing
    begins = recording.times[recording.segments[1:, 0]]
    inputs, found = recording.inputs.copy(), []
    for column in np.flatnonzero(recording.held):
        rows = np.flatnonzero(np.isfinite(inputs[:, column]))
        times, read = recording.times[rows], inputs[rows, column]
        for i in np.flatnonzero((np.diff(read) != 0.0) & (np.diff(times) > GAP_STEPS * usual)):
            # in a gap of all rows there is nothing to be put
            unread = slice(rows[i] + 1, rows[i + 1])
            if unread.stop == unread.start or np.any((begins > times[i]) & (begins <= times[i + 1])):
                continue
            late = recording.times[unread] >= 0.5 * (times[i] + times[i + 1])
            inputs[unread, column] = np.where(late, read[i + 1], read[i])
            found.append((recording.input_names[column], float(times[i]), float(times[i + 1])))
    return replace(recording, inputs=inputs, unseen_changes=tuple(found)) if found else recording


@dataclass(frozen=True, slots=True)
class Hidden:
    """Unrecorded event between two times.

    Attributes
    ----------
    begin, end : float, [s]
    what : str
        Bearing set, or input temperature.
    size : float
        1, or change of the input over the gap [K].
    sigma : float
        How much of the size may have been: one standard deviation.
    """

    begin: float
    end: float
    what: str
    size: float
    sigma: float = tuned.GAP_SIGMA


def hidden_in(
    recording: Recording, pieces: Sequence[tuple[float, float]], sets: Sequence[str]
) -> tuple[Hidden, ...]:
    """Possible events in pieces of gaps, beyond what the inputs beside them indicate.

    Parameters
    ----------
    pieces : sequence of (float, float), [s]
    sets : sequence of str
        Bearing sets: friction of each, as a share of the highest that it gives. Input temperatures that
        are others after a gap come on top, as a share of their change.
    """
    found = []
    for begin, end in pieces:
        sigma = max(tuned.GAP_SIGMA, spread_within(recording, begin, end))
        found += [Hidden(begin, end, name, 1.0, sigma) for name in sets]
    for name in WARMTH:
        if name not in recording.input_names:
            continue
        for begin, end in pieces:
            row = int(np.searchsorted(recording.times, begin + 1e-6))
            before, after = recording.input_at(name, recording.times[row - 1 : row + 1])
            if abs(after - before) >= tuned.LEAST_CHANGE:
                found.append(Hidden(begin, end, name, float(after - before)))
        found += _between_rows(recording, name)
    return tuple(found)


def spread_within(recording: Recording, begin: float, end: float) -> float:
    """How far the speed strays from what is held over a gap, as a share of the highest.

    Root mean square over the rest of the recording, amid a piece of the gap: a machine that starts and stops
    every few minutes may have done so unseen, one that runs for hours hardly has.
    """
    if "speed" not in recording.input_names:
        return 0.0
    times = recording.times
    row = int(np.searchsorted(times, begin + 1e-6))
    length, amid = times[row] - times[row - 1], 0.5 * (begin + end) - times[row - 1]
    starts = times[times + length <= times[-1]]
    # Windows with a gap of their own know nothing of it.
    gaps = times[:-1][np.diff(times) > GAP_STEPS * recording.usual_spacing]
    starts = starts[np.searchsorted(gaps, starts) == np.searchsorted(gaps, starts + length)]
    if not starts.size:
        return 0.0
    speed = np.abs(recording.input_at("speed", np.concatenate((starts, starts + length, starts + amid))))
    before, after, between = np.split(speed, 3)
    strayed = between - np.where(amid < 0.5 * length, before, after)
    return float(np.sqrt(np.mean(strayed**2)) / max(speed.max(), 1e-9))


def _between_rows(recording: Recording, name: str) -> list[Hidden]:
    """Where an input temperature changes much from row to row it need not have gone along a straight line."""
    spacing = np.diff(recording.times)
    change = np.diff(recording.input_at(name, recording.times))
    near = (spacing >= tuned.LEAST_SPACING) & (spacing <= GAP_STEPS * recording.usual_spacing)
    rows = np.flatnonzero(near & (np.abs(change) >= tuned.LEAST_CHANGE))
    largest = np.sort(rows[np.argsort(-np.abs(change[rows]))[: tuned.MOST_BETWEEN]])
    return [
        Hidden(float(recording.times[row]), float(recording.times[row + 1]), name, float(change[row]))
        for row in largest
    ]


def unseen_jumps(recording: Recording, drive: Drive) -> tuple[tuple[int, float, float], ...]:
    """Changes of held inputs that fell into gaps, which :func:`coarse_drive` puts amid them, or between rows.

    Inputs that are sampled are held until the next sample: a change between two rows shows in the second.

    Returns
    -------
    tuple of (int, float, float)
        Step at whose start each is put; how much earlier [s], least and most,
        it may have been: in a gap up to half of it either way.
    """
    usual = recording.usual_spacing
    columns = held_columns(recording, drive)
    changes = np.abs(drive.start[1:, columns] - drive.end[:-1, columns])
    largest = np.maximum(np.ptp(drive.start[:, columns], axis=0), 1e-9)
    found = []
    for step in 1 + np.flatnonzero(np.any(changes > 0.0, axis=1)):
        time = drive.grid[step]
        row = int(np.searchsorted(recording.times, time - 1e-6))
        if not 0 < row < recording.times.size:
            continue
        first, last = recording.times[row - 1], recording.times[row]
        in_gap = last - first > GAP_STEPS * usual
        if in_gap or last - first >= tuned.LEAST_SPACING:
            size = np.inf if in_gap else float((changes[step - 1] / largest).max())
            found.append((size, (int(step), float(time - last), float(time - first))))
    chosen = sorted(found, key=lambda item: -item[0])[: tuned.MOST_JUMPS]
    return tuple(sorted(item for _, item in chosen))


def about_rows_amid(
    recording: Recording, drive: Drive, jumps: Sequence[tuple[int, float, float]]
) -> tuple[list[int], list[int], list[int]]:
    """Which changes lead to rows whose inputs lie between those of the rows beside them.

    Such rows show how a logger makes its rows, as means over some time or in passing, and does so for all.

    Parameters
    ----------
    jumps : sequence of (int, float, float)
        As :func:`unseen_jumps` gives them.

    Returns
    -------
    three lists of int
        Those that begin a change over several rows, that go on with it and that end it.
    """
    usual, columns = recording.usual_spacing, held_columns(recording, drive)
    goes_on = [False]
    for (first, begins, _), (second, ends, _) in itertools.pairwise(jumps):
        changes = [drive.start[step, columns] - drive.end[step - 1, columns] for step in (first, second)]
        between_rows = min(begins, ends) > -1e-6
        near = between_rows and drive.grid[second] - drive.grid[first] <= GAP_STEPS * usual
        goes_on.append(bool(near and np.any(changes[0] * changes[1] > 0.0)))
    # Whether each follows on the one before, and is followed by the next.
    beside = list(enumerate(itertools.pairwise([*goes_on, False])))
    kinds = ((False, True), (True, True), (True, False))
    return tuple([index for index, own in beside if own == kind] for kind in kinds)


def jump_forcing(run: TransientRun, states: Array, jumps: Sequence[tuple[int, float, float]]) -> Array:
    """Change of the states of a run where an input changed earlier than it is drawn, (G, r, n * TIMES) K.

    By equal parts of the longest time that it may have been, input after input: bearings that settle within a
    minute change by far less than their first rate times the time.

    Parameters
    ----------
    states : (G + 1, r) ndarray, [K]
        States of the run.
    jumps : sequence of (int, float, float)
        As :func:`unseen_jumps` gives them.
    """
    forcing = np.zeros((len(run.drive.steps), states.shape[1], len(jumps), TIMES))
    parts: dict[tuple[int, float], tuple[Array, Array]] = {}
    for index, (step, _, most) in enumerate(jumps):
        before, after = (int(run.drive.step_class[i]) for i in (step - 1, step))
        conduction = run.operators[after].conduction
        gained = run.loads[after] @ run.start[step] - run.loads[before] @ run.end[step - 1]
        gained -= (conduction - run.operators[before].conduction) @ states[step]
        if (after, most) not in parts:
            one = build_propagator(run.built.storage, conduction, most / TIMES)
            parts[after, most] = one.advance, one.from_start + one.from_end
        advance, answer = parts[after, most]
        change = np.zeros(states.shape[1])
        for part in range(TIMES):
            change = advance @ change + answer @ gained
            forcing[step - 1, :, index, part] = change
    return forcing.reshape(*forcing.shape[:2], -1)


def weights_of_earlier(most: Array, seconds: Array) -> tuple[Array, Array]:
    """Weights of the times followed where inputs changed some seconds earlier, and with each second more.

    Cubic between those times, with slopes from the times to either side (Catmull and Rom), as a fit stops at
    a kink; straight on beyond them.

    Parameters
    ----------
    most, seconds : (n,) ndarray, [s]
        Longest time that was followed of each, and the time in question.

    Returns
    -------
    two (n, TIMES) ndarray

    >>> [item.tolist() for item in weights_of_earlier(np.array([40.0]), np.array([20.0]))]
    [[[0.0, 1.0, 0.0, 0.0]], [[-0.05, 0.0, 0.05, 0.0]]]
    """
    part = most / TIMES
    piece = np.clip(seconds / part, 0, TIMES - 1).astype(int)
    value = np.eye(TIMES + 1)
    slope = np.gradient(value, axis=0)
    ends = np.stack((value[piece], value[piece + 1], slope[piece], slope[piece + 1]))
    place = seconds / part - piece
    s = np.clip(place, 0.0, 1.0)
    rest, later = 1.0 - s, s**2 * (3.0 - 2.0 * s)
    at = np.array([1.0 - later, later, s * rest**2, -(s**2) * rest])
    by = np.array([-6.0 * s * rest, 6.0 * s * rest, rest * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)])
    slopes = np.einsum("en,enk->nk", by, ends)
    weights = np.einsum("en,enk->nk", at, ends) + (place - s)[:, None] * slopes
    return weights[:, 1:], slopes[:, 1:] / part[:, None]


def hidden_forcing(run: TransientRun, fast: FastModel, hidden: Sequence[Hidden]) -> Array:
    """Change of the states of a run by events in pieces of gaps, (G, r, n) K.

    Parameters
    ----------
    fast : FastModel
        Whose run it is.
    """
    highest = run.start.max(axis=0)
    members = {
        group.name: [row for item in group.bearing for row in fast.heat_rows(item.name)]
        for group in fast.spec.bearing_set
    }
    forcing = np.zeros((len(run.drive.steps), fast.model.size, len(hidden)))
    for key, rows in run.groups.items():
        propagator, loads = run.propagators[key], run.loads[key[0]]
        along = {name: loads[:, own] @ highest[own] for name, own in members.items()}
        along |= {name: loads[:, fast.load_names.index(name)] for name in WARMTH}
        middles = 0.5 * (run.drive.grid[rows] + run.drive.grid[rows + 1])
        for index, item in enumerate(hidden):
            inside = rows[(middles > item.begin) & (middles < item.end)]
            answer = (propagator.from_start + propagator.from_end) @ along[item.what]
            forcing[inside, :, index] = item.size * answer
    return forcing


def channel_changes(
    run: TransientRun, tracks: Tracks | None, forcing: Array, columns: Sequence[int]
) -> Array:
    """Change of the channels of a run by changes of its states in each step, (G + 1, c, n) K.

    Parameters
    ----------
    tracks : Tracks or None
        Of the run's terms.
    forcing : (G, r, n) ndarray, [K]
    columns : sequence of int
        Outputs that are the channels.
    """
    owner = np.append(run.drive.step_class, run.drive.step_class[-1])
    outputs = np.array([item.outputs[columns] for item in run.operators])
    return outputs[owner] @ run.tangents(forcing, tracks)
