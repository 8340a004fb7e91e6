"""Sizes that a recording has: speeds, rises, inputs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Channels rise at least this much, K, and heat is at least this much, W, for usual sizes of effects.
LEAST_RISE = 2.0
LEAST_HEAT = 1.0


def input_series(recording: Recording, name: str, otherwise: float) -> Array:
    """An input at every stamp; a constant where it is not recorded."""
    if name not in recording.input_names:
        return np.full(recording.times.size, otherwise)
    return recording.input_at(name, recording.times)


def lowest_speed(speed: Array) -> float:
    """Lowest speed above standstill."""
    turning = speed[speed > 1e-3 * max(float(speed.max()), 1e-12)]
    return float(turning.min()) if turning.size else 0.0


def usual_rise(recording: Recording, ambient: Array) -> float:
    """How far the channels leave the surroundings, the 95th percentile."""
    difference = np.abs(np.where(recording.usable, recording.temperature, np.nan) - ambient[:, None])
    if not np.isfinite(difference).any():
        return LEAST_RISE
    return max(LEAST_RISE, float(np.nanpercentile(difference, 95.0)))
