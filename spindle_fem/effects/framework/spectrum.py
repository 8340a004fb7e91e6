"""Dominant periods of readings at arbitrary stamps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_SAMPLES = 6000
MOST_FREQUENCIES = 4000


def strongest_periods(
    times: Array, residual: Array, shortest: float, longest: float, *, number: int = 3
) -> list[float]:
    """Periods of the largest least-squares sines, best first.

    The Lomb-Scargle spectrum of every channel, each in units of its own
    variance after a running mean has taken out what is slower than
    ``longest``, summed over the channels.

    Parameters
    ----------
    times : (N,) ndarray, [s]
    residual : (N, c) ndarray
        NaN where nothing was read.
    shortest, longest : float, [s]

    Source: Scargle (1982), Astrophys. J. 263, 835-853.

    >>> time = np.arange(0.0, 7200.0, 10.0)
    >>> wave = np.sin(2 * np.pi * time / 437.0)[:, None]
    >>> abs(strongest_periods(time, wave, 100.0, 3000.0)[0] - 437.0) < 5.0
    True
    """
    every = max(1, times.size // MOST_SAMPLES)
    times, residual = times[::every], residual[::every]
    span = float(times[-1] - times[0]) if times.size > 1 else 0.0
    longest = min(longest, 0.5 * span)
    shortest = max(shortest, 2.5 * span / max(times.size - 1, 1))
    if longest <= shortest:
        return []
    count = min(MOST_FREQUENCIES, int(4.0 * span * (1.0 / shortest - 1.0 / longest)) + 2)
    angular = 2.0 * np.pi * np.linspace(1.0 / longest, 1.0 / shortest, count)
    strength = np.zeros(count)
    for column in residual.T:
        present = np.isfinite(column)
        if present.sum() < 20:
            continue
        own_times, values = times[present], column[present]
        values = values - _running_mean(own_times, values, longest)
        variance = float(values @ values)
        if variance > 0.0:
            strength += _sine_power(own_times, values, angular) / variance
    found: list[float] = []
    resolution = 2.0 * np.pi / span
    for index in np.argsort(strength)[::-1]:
        if strength[index] <= 0.0 or len(found) == number:
            break
        if all(abs(angular[index] - 2.0 * np.pi / period) > 1.5 * resolution for period in found):
            found.append(float(2.0 * np.pi / angular[index]))
    return found


def _running_mean(times: Array, values: Array, width: float) -> Array:
    """Mean over all readings within half a width on either side."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    first = np.searchsorted(times, times - 0.5 * width)
    last = np.searchsorted(times, times + 0.5 * width, side="right")
    return (total[last] - total[first]) / (last - first)


def _sine_power(times: Array, values: Array, angular: Array) -> Array:
    """Reduction of the sum of squares by a sine of each angular frequency."""
    found = np.empty(angular.size)
    for start in range(0, angular.size, 256):
        part = angular[start : start + 256]
        angle = part[:, None] * times
        cosine, sine = np.cos(angle), np.sin(angle)
        by_cosine, by_sine = cosine @ values, sine @ values
        cosines, both = np.einsum("ij,ij->i", cosine, cosine), np.einsum("ij,ij->i", cosine, sine)
        sines = times.size - cosines
        determinant = np.maximum(cosines * sines - both**2, 1e-12)
        found[start : start + 256] = (
            sines * by_cosine**2 - 2.0 * both * by_cosine * by_sine + cosines * by_sine**2
        ) / determinant
    return found
