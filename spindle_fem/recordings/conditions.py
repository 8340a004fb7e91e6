"""Operating conditions of a recording: standstill, speed bands, heating, cooling."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from spindle_fem.recordings.align import Recording
from spindle_fem.units import registry

RPM = 2.0 * np.pi / 60.0
ROUND_STEPS_RPM = (50.0, 100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0, 2500.0, 5000.0, 10000.0)
MOST_BANDS = 6
# Edges are moved by the first of these shares of a band that keeps them off the speeds that are held; a speed
# within EDGE_SHARE of a band from an edge is on it.
EDGE_SHIFTS = (0.0, 0.5, 0.25, 0.75, 0.4, 0.6, 0.2, 0.8, 0.1, 0.9, 0.3, 0.7)
EDGE_SHARE = 0.05
# Below this share of its largest value an input counts as off.
OFF_SHARE = 0.005
TREND_SHARE = 0.05
TREND_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class Conditions:
    """Marks of every stamp; conditions of different kinds overlap.

    Attributes
    ----------
    names : tuple of str
        ``standstill`` or ``off``, ``running`` or speed bands such as
        ``0-500 rpm``, ``heating``, ``cooling``, ``steady``.
    marks : (N, len(names)) bool ndarray
    """

    names: tuple[str, ...]
    marks: NDArray[np.bool_]

    def of(self, name: str) -> NDArray[np.bool_]:
        """Stamps at which a condition holds."""
        return self.marks[:, self.names.index(name)]


def operating_conditions(recording: Recording) -> Conditions:
    """Classify every stamp of a recording.

    Returns
    -------
    Conditions
        Speed bands where an input is a rotational speed (the fastest, if
        several), otherwise on and off by the inputs that are no temperatures;
        heating, cooling, steady by the smoothed rate of the mean of the
        temperature channels.
    """
    named: dict[str, NDArray[np.bool_]] = {}
    units = [registry().Unit(text) for text in recording.input_units]
    history = recording.input_history()
    rotating = [k for k, text in enumerate(recording.input_units) if "radian" in text]
    driving = [k for k, unit in enumerate(units) if str(unit) != "kelvin"]
    if rotating:
        speed = np.abs(history.values[:, rotating]).max(axis=1) / RPM
        named |= _speed_bands(speed)
    elif driving:
        size = np.abs(history.values[:, driving])
        on = np.any(size > OFF_SHARE * size.max(axis=0), axis=1)
        named |= {"off": ~on, "on": on}
    named |= _trends(recording)
    names = tuple(name for name, marks in named.items() if marks.any())
    return Conditions(names, np.stack([named[name] for name in names], axis=1))


def _speed_bands(speed: NDArray[np.float64]) -> dict[str, NDArray[np.bool_]]:
    # whole numbers of turns a minute come back from rad/s with a rounding error
    largest = float(np.round(speed.max(), 6))
    still = speed <= OFF_SHARE * largest
    bands = {"standstill": still}
    if largest == 0.0:
        return bands
    width = next((step for step in ROUND_STEPS_RPM if largest <= MOST_BANDS * step), largest / MOST_BANDS)
    edges = _edges(speed[~still], largest, width)
    for low, high in pairwise(edges):
        inside = ~still & (speed > low * (1.0 + 1.0e-6)) & (speed <= high * (1.0 + 1.0e-6))
        bands[f"{low:g}-{high:g} rpm"] = inside
    return bands


def _edges(speed: NDArray[np.float64], largest: float, width: float) -> list[float]:
    """Edges of bands of one width from 0 on; the first is narrower where held speeds would lie on them.

    >>> _edges(np.array([1999.0, 2001.0, 3999.0, 4001.0]), 4001.0, 1000.0)
    [0.0, 500.0, 1500.0, 2500.0, 3500.0, 4500.0]
    """
    on_edge = [
        np.mean(np.abs((speed / width - shift + 0.5) % 1.0 - 0.5) <= EDGE_SHARE) for shift in EDGE_SHIFTS
    ]
    best = int(np.argmin(on_edge))
    # While a speed only drifts through its range no edges are better than round ones.
    shift = EDGE_SHIFTS[best] if on_edge[best] < 0.5 * on_edge[0] else 0.0
    first = round(shift * width, 9)
    count = int(np.ceil(round((largest - first) / width, 9)))
    found = [first + width * number for number in range(max(count, 0) + 1)]
    return found if first == 0.0 else [0.0, *found]


def _trends(recording: Recording) -> dict[str, NDArray[np.bool_]]:
    count = recording.temperature_count
    usable, sigma = recording.usable[:, :count], recording.sigma[:count]
    rate = np.zeros(recording.times.size)
    smoothing = np.zeros(recording.times.size)
    for begin, end in recording.segments:
        length = end - begin
        if length < 5:
            continue
        columns = []
        for column in range(count):
            rows = np.flatnonzero(usable[begin:end, column])
            if rows.size >= 2:
                times = recording.times[begin:end]
                columns.append(np.interp(times, times[rows], recording.temperature[begin + rows, column]))
        if not columns:
            continue
        window = int(min(max(5, length // 60), 121))
        mean = uniform_filter1d(np.mean(columns, axis=0), window, mode="nearest")
        rate[begin:end] = np.gradient(mean, recording.times[begin:end])
        step = np.median(np.diff(recording.times[begin:end]))
        noise = float(np.sqrt(np.mean(sigma**2) / len(columns)))
        # difference of two window means, one window apart
        smoothing[begin:end] = TREND_SIGMAS * noise * np.sqrt(2.0 / window) / (window * step)
    threshold = np.maximum(TREND_SHARE * np.quantile(np.abs(rate), 0.98), smoothing)
    heating, cooling = rate > threshold, rate < -threshold
    return {"heating": heating, "cooling": cooling, "steady": ~heating & ~cooling}
