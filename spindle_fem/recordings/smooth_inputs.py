"""Measured inputs without their own noise.

A room or oil temperature that drives a model is itself a reading. Fed in as it
is, its noise passes straight into what follows it closely (the coolant's
outlet), where a lag or a filter would seem to be missing. The temperature is
taken as a random walk that is read with white noise, both estimated from the
reading itself, and replaced by the smoother's estimate.

Source of the model: Harvey (1989), Forecasting, Structural Time Series Models
and the Kalman Filter, section 4.3 (local level; its smoother is a two-sided
exponential).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from spindle_fem.recordings.align import Recording
from spindle_fem.units import TEMPERATURE_UNIT

Array = NDArray[np.float64]

LAGS = 20
FEWEST = 60
# Median of the square of a standard normal number.
MEDIAN_OF_SQUARE = 0.4549
# Differences count no more than this many of their usual size: a jump is not noise.
USUAL_SIZES = 3.0
# Readings that differ by less than this are the same, K.
SAME = 1e-9
# Readings at most, to either side; weights below exp(-4) do not count.
LONGEST_REACH, NEGLIGIBLE = 60, 4.0
# A level that differs by more than the walk and the noise explain lies beyond a jump.
JUMP_SIGMAS, MEDIAN_WINDOW = 2.0, 5
# A random walk slower than this share of the noise in each reading is indistinguishable from none.
SLOWEST = 1.0e-3


def walk_and_noise(values: Array) -> tuple[float, float]:
    """Variance of a random walk's step and of the white noise on it, jumps apart.

    From the squared differences over 1 to 20 readings, whose mean is ``lag * step + 2 * noise``. Each counts
    no more than a few times their median, or the square of the last digit where most readings are the same,
    so that jumps do not matter.

    Parameters
    ----------
    values : (n,) ndarray
        Evenly read, finite.

    Returns
    -------
    float, float
        Both in the square of the unit, none below zero.

    Examples
    --------
    >>> generator = np.random.default_rng(0)
    >>> walk = np.cumsum(0.01 * generator.standard_normal(20_000))
    >>> walk[9_000:] += 5.0
    >>> step, noise = walk_and_noise(walk + 0.05 * generator.standard_normal(20_000))
    >>> bool(abs(step**0.5 - 0.01) < 2e-3 and abs(noise**0.5 - 0.05) < 2e-3)
    True
    """
    lags = np.arange(1, min(LAGS, len(values) // 3) + 1)
    apart = np.abs(np.diff(values))
    digit = np.min(apart, where=apart > SAME, initial=np.inf)
    if not np.isfinite(digit):
        return 0.0, 0.0
    squares = np.empty(len(lags))
    for index, lag in enumerate(lags):
        found = (values[lag:] - values[:-lag]) ** 2
        usual = max(np.median(found) / MEDIAN_OF_SQUARE, digit**2)
        squares[index] = np.mean(np.minimum(found, USUAL_SIZES**2 * usual))
    # A difference of one reading has the most independent samples.
    slope, offset = np.polyfit(lags, squares, 1, w=1.0 / lags)
    return max(float(slope), 0.0), max(0.5 * float(offset), 0.0)


def smoothed(values: Array, step: float, noise: float) -> Array:
    """Most probable random walk behind noisy readings; ends and jumps are not averaged over.

    Parameters
    ----------
    values : (n,) ndarray
    step, noise : float
        As :func:`walk_and_noise` gives them; ``noise`` positive.

    Examples
    --------
    >>> smoothed(np.full(50, 293.0), 1e-4, 1e-2).round(9).tolist() == [293.0] * 50
    True
    """
    ratio = max(step / noise, SLOWEST)
    # Steady gain of the filter: K² = ratio (1 - K); its smoother weighs by (1 - K)^|lag|.
    gain = 0.5 * (np.sqrt(ratio**2 + 4.0 * ratio) - ratio)
    reach = min(LONGEST_REACH, int(np.ceil(NEGLIGIBLE / gain)), len(values) - 1)
    level = median_filter(values, size=MEDIAN_WINDOW, mode="nearest")
    total, weights = values.copy(), np.ones_like(values)
    for lag in range(1, reach + 1):
        apart = level[lag:] - level[:-lag]
        spread = JUMP_SIGMAS**2 * (noise + step * lag)
        weight = (1.0 - gain) ** lag * np.exp(-0.5 * apart**2 / spread)
        total[lag:] += weight * values[:-lag]
        total[:-lag] += weight * values[lag:]
        weights[lag:] += weight
        weights[:-lag] += weight
    return total / weights


def without_input_noise(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """The recording with its measured input temperatures smoothed, and what was done in words.

    Inputs that are held between readings (speeds, set points) stay as they are.
    """
    inputs = recording.inputs.copy()
    notes = []
    for column, name in enumerate(recording.input_names):
        if recording.held[column] or recording.input_units[column] != TEMPERATURE_UNIT:
            continue
        done = []
        for begin, end in recording.segments:
            rows = begin + np.flatnonzero(np.isfinite(inputs[begin:end, column]))
            if rows.size < FEWEST:
                continue
            step, noise = walk_and_noise(inputs[rows, column])
            if noise > 0.0 and step < noise:
                inputs[rows, column] = smoothed(inputs[rows, column], step, noise)
                done.append(noise)
        if done:
            notes.append(f'input "{name}": noise of {np.sqrt(np.mean(done)):.2g} K smoothed away')
    return replace(recording, inputs=inputs), tuple(notes)
