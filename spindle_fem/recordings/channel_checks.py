"""Defects and noise of one channel's readings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import chdtri

from spindle_fem.validity import PLAUSIBLE_KELVIN

Array = NDArray[np.float64]


class Flag(IntFlag):
    """Why a reading is not used; none means it is."""

    MISSING = 1
    SPIKE = 2
    DROPOUT = 4
    STUCK = 8
    IMPLAUSIBLE = 16


# Lengths are in samples, temperatures in K.
SPIKE_WINDOW, SWING_WINDOW = 5, 6
SPIKE_PASSES = 4
SPIKE_SIGMAS = 6.0
SPIKE_FLOOR = 0.5
SPIKE_STANDS_OUT = 3.0
SPIKE_ROUGHNESS_SIGMAS = 4.0
SPIKE_EDGE_FACTOR = 4.0
DROPOUT_SIGMAS = 12.0
DROPOUT_FLOOR = 3.0
DROPOUT_LONGEST = 200
STUCK_JUDGED = 50
STUCK_CHANCE = 1.0e-9
STUCK_MOST_EQUAL = 0.6
STALE_READINGS = 60
STALE_SECONDS = 1800.0
STALE_APPROACH = 600.0
QUIET_SHARE = 0.25

# The standard deviation of a normal sample cut to its 95 % smallest magnitudes is this fraction:
# sqrt(1 - 2 z phi(z) / 0.95) at z = 1.959964.
_KEPT_FRACTION = 0.95
_TRIMMED_NORMAL = 0.87112
_RESOLUTIONS = [factor * 10.0**power for power in range(2, -5, -1) for factor in (5.0, 2.5, 2.0, 1.0)]
_SAMPLE_FOR_RESOLUTION = 20_000


@dataclass(frozen=True, slots=True)
class ChannelNoise:
    """Noise of a channel, in SI.

    Attributes
    ----------
    white : float
        One standard deviation of independent noise, rounding included.
    slow : float
        One standard deviation of errors that last many samples, see
        :func:`slow_error`; half steps of a coarse sensor included.
    resolution : float
        Largest step that 99 % of the readings are multiples of, 0 if none.
    coarse_step : float
        Largest step that half of the readings are multiples of, 0 if none.
    """

    white: float
    slow: float
    resolution: float
    coarse_step: float


def resolution(values: Array, share: float = 0.99) -> float:
    """Largest round step that a share of the readings are multiples of, 0 if none.

    >>> resolution(np.array([20.0, 20.2, 20.4, 21.0, 19.8]))
    0.2
    """
    finite = values[np.isfinite(values)]
    if finite.size > _SAMPLE_FOR_RESOLUTION:
        finite = finite[:: -(-finite.size // _SAMPLE_FOR_RESOLUTION)]
    if np.unique(finite[:: max(1, finite.size // 1000)]).size < 3:
        return 0.0
    for step in _RESOLUTIONS:
        quotient = finite / step
        # chance multiples of a fine step by values of a few digits are excluded by the share
        matching = np.abs(quotient - np.round(quotient)) < 1.0e-6 * np.maximum(1.0, np.abs(quotient))
        if np.mean(matching) >= share:
            return float(f"{step:.6g}")
    return 0.0


def white_noise(values: Array) -> float:
    """Standard deviation of independent noise, from second differences.

    Parameters
    ----------
    values : (n,) ndarray
        Present readings in time order.

    Returns
    -------
    float
        Linear drift drops out; the largest 5 % (curvature, spikes) are cut and
        the cut is corrected for a normal distribution. NaN below 8 readings.

    >>> rng = np.random.default_rng(1)
    >>> round(white_noise(0.1 * rng.standard_normal(20000) + np.arange(20000)), 3)
    0.1
    """
    if values.size < 8:
        return float("nan")
    second = np.abs(values[2:] - 2.0 * values[1:-1] + values[:-2])
    kept = max(1, int(_KEPT_FRACTION * second.size))
    smallest = np.partition(second, kept - 1)[:kept]
    return float(np.sqrt(np.mean(smallest**2) / 6.0) / _TRIMMED_NORMAL)


def slow_error(times: Array, values: Array, white: float, block: int = 16, blocks: int = 12) -> float:
    """Size, to a factor of two, of errors that last some 20 to 200 readings.

    Block means are compared with a parabola through a dozen of them; what the
    white noise does not explain is left. The quietest quarter of the windows
    decides, where the machine itself changes least; where it never rests, its
    own changes are in the figure. NaN when the record is shorter than three
    windows.
    """
    window = block * blocks
    number = values.size // window
    if number < 3 or not np.isfinite(white):
        return float("nan")
    means = values[: number * window].reshape(number, blocks, block).mean(axis=2)
    at = times[: number * window].reshape(number, blocks, block).mean(axis=2)
    centred = at - at.mean(axis=1, keepdims=True)
    half = np.maximum(np.abs(centred).max(axis=1, keepdims=True), 1.0e-30)
    scaled = centred / half
    basis = np.stack([np.ones_like(scaled), scaled, scaled**2], axis=2)
    projector, _ = np.linalg.qr(basis)
    fitted = np.einsum("wbj,wj->wb", projector, np.einsum("wbj,wb->wj", projector, means))
    freedom = blocks - 3
    # a quarter of purely random windows lie below this quantile of chi-square
    expected = float(chdtri(freedom, 1.0 - QUIET_SHARE)) / freedom
    variance = np.quantile(np.sum((means - fitted) ** 2, axis=1) / freedom, QUIET_SHARE) / expected
    return float(np.sqrt(max(0.0, float(variance) - white**2 / block)))


def channel_noise(times: Array, values: Array, grid: float, coarse: float) -> ChannelNoise:
    """Noise of the readings that are in use.

    Parameters
    ----------
    times : (n,) ndarray, [s]
    values : (n,) ndarray
    grid, coarse : float
        Resolution and coarse step in the same unit as ``values``.
    """
    white = white_noise(values)
    slow = slow_error(times, values, white)
    white = float(np.fmax(white, grid / np.sqrt(12.0)))
    if coarse > 2.0 * white:
        # a slow signal on a coarse sensor is wrong by up to half a step for a long time
        slow = float(np.fmax(slow, coarse / np.sqrt(12.0)))
    return ChannelNoise(white=white, slow=slow, resolution=grid, coarse_step=coarse)


def temperature_flags(
    kelvin: Array, sigma: float | None, grid: float, *, judge_stuck: bool
) -> NDArray[np.uint8]:
    """Flags of one temperature channel's readings.

    Parameters
    ----------
    kelvin : (n,) ndarray, [K]
        NaN where missing; in time order.
    sigma : float or None, [K]
        Declared white noise.
    grid : float, [K]
        Resolution.
    judge_stuck : bool
        Whether a run of equal readings may be held against the sensor.

    Returns
    -------
    (n,) uint8 ndarray of :class:`Flag`
    """
    flags = np.zeros(kelvin.size, dtype=np.uint8)
    present = np.isfinite(kelvin)
    flags[~present] |= np.uint8(Flag.MISSING)
    outside = present & ((kelvin < PLAUSIBLE_KELVIN[0]) | (kelvin > PLAUSIBLE_KELVIN[1]))
    flags[outside] |= np.uint8(Flag.IMPLAUSIBLE)
    rows = np.flatnonzero(present & ~outside)
    if rows.size < 2 * SPIKE_WINDOW:
        return flags
    values = kelvin[rows]
    # a step wider than a degree is a jump of the reading, no resolution
    white = white_noise(values)
    noise = max(white, min(grid, 1.0), 0.0 if sigma is None else sigma)
    kept = rows
    for _ in range(SPIKE_PASSES):  # a spike beside another shows once the first is out
        spikes = _spikes(kelvin[kept], noise, white) | _swings(kelvin[kept], noise, white)
        spikes |= _spikes_amid_changes(kelvin[kept], noise, white)
        flags[kept[spikes]] |= np.uint8(Flag.SPIKE)
        if not spikes.any():
            break
        kept = kept[~spikes]
    flags[kept[_dropouts(kelvin[kept], noise)]] |= np.uint8(Flag.DROPOUT)
    if judge_stuck:
        kept = kept[flags[kept] == 0]
        flags[kept[_stuck(kelvin[kept])]] |= np.uint8(Flag.STUCK)
    return flags


def _spikes(values: Array, noise: float, white: float) -> NDArray[np.bool_]:
    """Readings that depart from their neighbours, while those agree with each other.

    A true peak has steep flanks: the departure must exceed the
    differences between the neighbours too.
    """
    departures = np.abs(values - median_filter(values, SPIKE_WINDOW, mode="mirror"))
    padded = np.pad(values, 2, mode="reflect")
    flanks = np.maximum(np.abs(padded[1:-3] - padded[:-4]), np.abs(padded[4:] - padded[3:-1]))
    roughness = np.maximum(flanks, np.abs(padded[3:-1] - padded[1:-3]))
    roughness = np.maximum(0.0, roughness - SPIKE_ROUGHNESS_SIGMAS * white)
    least = np.full(values.size, max(SPIKE_SIGMAS * noise, SPIKE_FLOOR))
    # the first and the last reading have neighbours on one side only: they may be the start of a change
    least[[0, -1]] *= SPIKE_EDGE_FACTOR
    return departures > np.maximum(least, SPIKE_STANDS_OUT * roughness)


def _spikes_amid_changes(values: Array, noise: float, white: float) -> NDArray[np.bool_]:
    """Readings beyond both neighbours amid a steep change that goes on after them as it came.

    The change common to both flanks is no roughness here. With the reading
    replaced by the mean of its neighbours nothing near it may bend as sharply
    as it departs: a true peak and a swinging temperature do.
    """
    reach = SPIKE_WINDOW
    windows = sliding_window_view(np.pad(values, reach, mode="reflect"), 2 * reach + 1).copy()
    earlier, before, after, later = windows[:, [reach - 2, reach - 1, reach + 1, reach + 2]].T
    line = windows[:, reach] = 0.5 * (before + after)
    slopes = np.stack([before - earlier, 0.5 * (after - before), later - after])
    roughness = np.abs(slopes - np.median(slopes, axis=0)).max(axis=0)
    bends = np.abs(np.diff(windows, n=2, axis=1)).max(axis=1)
    roughness, bends = (np.maximum(0.0, item - SPIKE_ROUGHNESS_SIGMAS * white) for item in (roughness, bends))
    beyond = np.maximum(values - np.maximum(before, after), np.minimum(before, after) - values)
    least = np.full(values.size, max(DROPOUT_SIGMAS * noise, DROPOUT_FLOOR))
    least[[0, 1, -2, -1]] = np.inf  # one flank is not known there
    found = beyond > np.maximum(least, SPIKE_STANDS_OUT * roughness)
    return found & (np.abs(values - line) > SPIKE_STANDS_OUT * bends)


def _swings(values: Array, noise: float, white: float) -> NDArray[np.bool_]:
    """Pairs of readings that depart to either side of those before and after them, as no temperature does."""
    found = np.zeros(values.size, dtype=bool)
    if values.size < SWING_WINDOW:
        return found
    earlier, before, first, second, after, later = sliding_window_view(values, SWING_WINDOW).T
    departures = first - (2.0 * before + after) / 3.0, second - (before + 2.0 * after) / 3.0
    roughness = np.abs([before - earlier, after - before, later - after]).max(axis=0)
    roughness = np.maximum(0.0, roughness - SPIKE_ROUGHNESS_SIGMAS * white)
    least = np.maximum(max(SPIKE_SIGMAS * noise, SPIKE_FLOOR), SPIKE_STANDS_OUT * roughness)
    swings = (np.prod(departures, axis=0) < 0.0) & (np.abs(departures).min(axis=0) > least)
    rows = np.flatnonzero(swings)[:, None] + (2, 3)
    found[rows] = True
    return found


def _dropouts(values: Array, noise: float) -> NDArray[np.bool_]:
    """Stretches that are left and entered again in a single jump each."""
    inside = np.zeros(values.size, dtype=bool)
    change = np.diff(values)
    jumps = np.flatnonzero(np.abs(change) > max(DROPOUT_SIGMAS * noise, DROPOUT_FLOOR))
    position = 0
    while position < jumps.size:
        out = jumps[position]
        later = jumps[position + 1 :]
        later = later[later <= out + DROPOUT_LONGEST]
        level = values[out]
        size = abs(change[out])
        back = later[
            (np.sign(change[later]) != np.sign(change[out]))
            & (np.abs(values[later + 1] - level) < 0.25 * size)
        ]
        # the flanks of a true excursion are steep on both sides of each jump, those of a drop-out are not
        before = abs(change[out - 1]) if out else 0.0
        sudden = size > SPIKE_STANDS_OUT * before
        if back.size and sudden and np.ptp(values[out + 1 : back[0] + 1]) < 0.25 * size:
            inside[out + 1 : back[0] + 1] = True
            position = int(np.searchsorted(jumps, back[0])) + 1
        else:
            position += 1
    return inside


def _stuck(values: Array) -> NDArray[np.bool_]:
    """Runs of one value so long that chance repeats do not explain them."""
    stuck = np.zeros(values.size, dtype=bool)
    if values.size < STUCK_JUDGED:
        return stuck
    equal = np.diff(values) == 0.0
    chance = float(equal.mean())
    if chance > STUCK_MOST_EQUAL:  # the resolution hides the noise: a constant reading proves nothing
        return stuck
    longest = int(np.ceil(np.log(STUCK_CHANCE) / np.log(max(chance, 0.1))))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    for begin, end in edges.reshape(-1, 2):
        if end - begin >= longest:
            # the first reading of the run is a true one
            stuck[begin + 1 : end + 1] = True
    return stuck


def never_changes(values: Array) -> bool:
    """Whether a channel has many readings, NaN where missing, and all of them are one value.

    >>> never_changes(np.full(60, 296.35)), never_changes(np.append(np.full(60, 296.35), 296.4))
    (True, False)
    """
    present = values[np.isfinite(values)]
    return present.size >= STUCK_JUDGED and float(np.ptp(present)) == 0.0


def stale_readings(
    times: Array, values: Array, inputs_missing: NDArray[np.bool_], coarse_step: float
) -> NDArray[np.bool_]:
    """Readings that a logger repeats after their source has failed.

    Parameters
    ----------
    times : (n,) ndarray, [s]
    values : (n,) ndarray
        One temperature channel, NaN where missing.
    inputs_missing : (n,) bool ndarray
        Whether no input has a reading.
    coarse_step : float
        Noise of the channel, see :class:`ChannelNoise`.

    Returns
    -------
    (n,) bool ndarray
        All but the first reading of a run of one value that lasts at least
        60 readings and half an hour, and in which either no input reads
        anything, or which begins straight out of a change of two coarse steps
        within ten minutes: no body stops like that.
    """
    stale = np.zeros(values.size, dtype=bool)
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size < STALE_READINGS:
        return stale
    equal = np.diff(values[rows]) == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    for begin, end in edges.reshape(-1, 2):
        run = rows[begin : end + 1]
        if run.size < STALE_READINGS or times[run[-1]] - times[run[0]] < STALE_SECONDS:
            continue
        before = rows[np.searchsorted(times[rows], times[run[0]] - STALE_APPROACH) : begin]
        moved = np.ptp(values[np.append(before, run[0])]) if before.size else 0.0
        abrupt = coarse_step > 0.0 and moved > 2.0 * coarse_step
        if abrupt:
            stale[run[1:]] = True
        else:
            stale[run[1:]] = _in_long_runs(inputs_missing[run], times[run])[1:]
    return stale


def _in_long_runs(marked: NDArray[np.bool_], times: Array) -> NDArray[np.bool_]:
    """Marks that belong to runs of at least 60 readings and half an hour."""
    kept = np.zeros(marked.size, dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))).reshape(-1, 2)
    for begin, end in edges:
        if end - begin >= STALE_READINGS and times[end - 1] - times[begin] >= STALE_SECONDS:
            kept[begin:end] = True
    return kept


def longest_run(marked: NDArray[np.bool_], times: Array) -> float:
    """Longest time, in s, from the last reading before to the first after a marked run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))).reshape(-1, 2)
    if edges.size == 0:
        return 0.0
    before = times[np.maximum(edges[:, 0] - 1, 0)]
    after = times[np.minimum(edges[:, 1], times.size - 1)]
    return float((after - before).max())
