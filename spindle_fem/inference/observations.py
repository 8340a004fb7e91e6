"""Readings averaged over bins of time, and the same averages of a prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.reading_noise import ChannelBins, channel_bins
from spindle_fem.model.reduced.reduced_transient import grid_weights
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Observation:
    """Readings of one channel of one recording, averaged over bins.

    Attributes
    ----------
    channel : int
        Column of the recording.
    values : (b,) ndarray, [K]
        Mean reading of each bin.
    right : (b,) int ndarray or None
        Point of the prediction's grid after each bin's mean time; None where
        it has a value at every stamp of the recording, which are averaged.
    part : (b,) ndarray or None
        Share of the step before it that has passed.
    """

    recording: int
    channel: int
    bins: ChannelBins
    values: Array
    right: NDArray[np.int64] | None = None
    part: Array | None = None

    def at(self, predicted: Array) -> Array:
        """Values at the bins, (b, ...), from values (G + 1, ...) on the grid or (N, ...) at the stamps."""
        if self.right is None:
            return self.bins.average(predicted)
        part = self.part.reshape(-1, *([1] * (predicted.ndim - 1)))
        left = predicted[self.right - 1]
        return left + part * (predicted[self.right] - left)


def observe(
    recordings: Sequence[Recording],
    use: Sequence[NDArray[np.bool_] | None],
    grids: Sequence[Array | None],
    widths: Sequence[float | None],
) -> tuple[Observation, ...]:
    """Observations of every channel that has usable readings.

    Parameters
    ----------
    use : sequence of (N,) bool ndarray or None
        Stamps of each recording that count; all when None.
    grids : sequence of (G + 1,) ndarray or None, [s]
        Grid of each recording's prediction; None where that has a value at every stamp.
    widths : sequence of float or None, [s]
        Width of the bins of each recording, as :func:`channel_bins` takes it.
    """
    found = []
    for number, (recording, mask, grid, width) in enumerate(zip(recordings, use, grids, widths, strict=True)):
        for bins in channel_bins(recording, mask, width=width):
            values = bins.average(recording.temperature[:, bins.channel])
            weights = () if grid is None else grid_weights(bins.times, grid)
            found.append(Observation(number, bins.channel, bins, values, *weights))
    return tuple(found)
