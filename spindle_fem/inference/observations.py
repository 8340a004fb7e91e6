"""Readings averaged over bins of time, and the same averages of a prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from spindle_fem.inference.reading_noise import ChannelBins, channel_bins
from spindle_fem.model.reduced.reduced_transient import grid_weights
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Points of a row at which a prediction is averaged.
ROW_POINTS = 4


@dataclass(frozen=True, slots=True)
class Observation:
    """Readings of one channel of one recording, averaged over bins.

    Attributes
    ----------
    channel : int
        Column of the recording.
    values : (b,) ndarray, [K]
        Mean reading of each bin.
    means : (b, G + 1) csr_array or None
        Averages over the rows of each bin of what is linear between points of the prediction's grid; None
        where that has a value at every stamp of the recording.
    """

    recording: int
    channel: int
    bins: ChannelBins
    values: Array
    means: csr_array | None = None

    def at(self, predicted: Array) -> Array:
        """Values at the bins, (b, ...), from values (G + 1, ...) on the grid or (N, ...) at the stamps."""
        if self.means is None:
            return self.bins.average(predicted)
        flat = self.means @ predicted.reshape(len(predicted), int(np.prod(predicted.shape[1:])))
        return flat.reshape(len(flat), *predicted.shape[1:])


def observe(
    recordings: Sequence[Recording],
    use: Sequence[NDArray[np.bool_] | None],
    grids: Sequence[Array | None],
    widths: Sequence[float | None],
    rows: Sequence[float] | None = None,
    stamps: Sequence[Array] | None = None,
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
    rows : sequence of float, optional, [s]
        Time over which each row of a recording is a mean: predictions are averaged as the readings were.
        Otherwise rows are of their moment.
    stamps : sequence of (N,) ndarray, optional, [s]
        Stamps of the readings on the grid's clock, where that is another one than theirs.
    """
    found = []
    for number, (recording, mask, grid, width) in enumerate(zip(recordings, use, grids, widths, strict=True)):
        for bins in channel_bins(recording, mask, width=width):
            values = bins.average(recording.temperature[:, bins.channel])
            row = 0.0 if rows is None else rows[number]
            times = recording.times if stamps is None else stamps[number]
            means = None if grid is None else _means(bins, times, grid, row)
            found.append(Observation(number, bins.channel, bins, values, means))
    return tuple(found)


def _means(bins: ChannelBins, times: Array, grid: Array, row: float) -> csr_array:
    """Average of what is linear between grid points over the rows of each bin, (b, G + 1)."""
    within = (np.arange(ROW_POINTS) + 0.5) / ROW_POINTS - 0.5 if row > 0.0 else np.zeros(1)
    at = (times[bins.rows][:, None] + row * within).ravel()
    owner = np.repeat(bins.owner, within.size)
    right, part = grid_weights(at, grid)
    share = 1.0 / (bins.number[owner] * within.size)
    return csr_array(
        (
            np.concatenate(((1.0 - part) * share, part * share)),
            (np.concatenate((owner, owner)), np.concatenate((right - 1, right))),
        ),
        shape=(len(bins.times), grid.size),
    )
