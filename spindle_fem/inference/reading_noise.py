"""Errors of readings: white noise, and a slow error that neighbouring readings share.

The slow error (drift of the logger, of what a probe touches, and of the model
itself) is an Ornstein-Uhlenbeck process: covariance ``σ² exp(−|t − t'|/τ)``.
Residuals are averaged over bins and whitened with the covariance of the
averages, so that a reading repeated every second does not count as a new one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded, solve_triangular

from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Shortest bin over which readings are averaged, s, and most bins of a recording by default.
SHORTEST_BIN = 60.0
MOST_BINS = 500
# Most bins that are whitened by a Cholesky factor, whose cost grows with the cube of their number.
MOST_DENSE = 700
# Key of the channels that share one slow error.
COMMON = None


@dataclass(frozen=True, slots=True)
class SlowError:
    """Slow error of every channel.

    Attributes
    ----------
    sigma : float, [K]
        One standard deviation.
    time : float, [s]
        Correlation time.
    channels : tuple of (int, float, float)
        Channels with a size and a time of their own, by the key of their bins; of temperatures the common
        ones are means.
    """

    sigma: float = 0.035
    time: float = 1500.0
    channels: tuple[tuple[int, float, float], ...] = ()

    def of(self, channel: int | None) -> SlowError:
        """Slow error of one channel."""
        for number, sigma, time in self.channels:
            if number == channel:
                return SlowError(sigma, time)
        return self

    def no_less_than(self, other: SlowError) -> SlowError:
        """The slow error where another is nowhere larger or longer.

        >>> SlowError(0.02, 3000.0).no_less_than(SlowError(0.04, 1500.0))
        SlowError(sigma=0.04, time=3000.0, channels=())
        """
        keys = dict.fromkeys(key for key, _, _ in (*self.channels, *other.channels))
        channels = [(key, self.of(key), other.of(key)) for key in keys]
        return SlowError(
            max(self.sigma, other.sigma),
            max(self.time, other.time),
            tuple((key, max(a.sigma, b.sigma), max(a.time, b.time)) for key, a, b in channels),
        )

    @classmethod
    def each(cls, channels: Mapping[int, SlowError]) -> SlowError:
        """A slow error for every channel, by the key of its bins; the common one is that of temperatures."""
        warm = [own for key, own in channels.items() if key >= 0] or list(channels.values())
        sigma = float(np.sqrt(np.mean([item.sigma**2 for item in warm])))
        time = float(np.exp(np.mean([np.log(item.time) for item in warm])))
        return cls(sigma, time, tuple((number, own.sigma, own.time) for number, own in channels.items()))


@dataclass(frozen=True, slots=True)
class ChannelBins:
    """Usable readings of one channel, averaged.

    Attributes
    ----------
    channel : int
        Column of the recording.
    rows : (k,) int ndarray
        Usable readings.
    owner : (k,) int ndarray
        Bin of each.
    times : (b,) ndarray, [s]
        Mean time of each bin.
    number : (b,) ndarray
        Readings in each.
    spacing : (b,) ndarray, [s]
        Mean distance of the readings in each; 0 where there is one.
    white : float, [K]
        Noise of a single reading, rounding included.
    key : int
        By which a slow error of its own is known, as :func:`key_of` gives it.
    """

    channel: int
    rows: NDArray[np.int64]
    owner: NDArray[np.int64]
    times: Array
    number: Array
    spacing: Array
    white: float
    key: int

    @property
    def is_relative(self) -> bool:
        """Whether it has a free constant: a displacement counts from its sensor's unknown zero."""
        return self.key < 0

    def average(self, values: Array) -> Array:
        """Means over the bins of values (N, ...) at all stamps of the recording."""
        chosen = values[self.rows]
        total = np.zeros((len(self.times), *values.shape[1:]))
        np.add.at(total, self.owner, chosen)
        return total / self.number.reshape(-1, *([1] * (values.ndim - 1)))

    def factor(self, slow: SlowError) -> Array:
        """Lower Cholesky factor of the covariance of the bin means, (b, b) [K]."""
        slow = slow.of(self.key)
        # Exact for readings at equal distances: what an average keeps of the slow error, ...
        half = 0.5 * self.spacing / slow.time
        kept = np.ones_like(half)
        several = half > 0.0
        n, h = self.number[several], half[several]
        kept[several] = np.sinh(n * h) / (n * np.sinh(h))
        apart = np.abs(self.times[:, None] - self.times)
        covariance = slow.sigma**2 * np.exp(-apart / slow.time) * np.outer(kept, kept)
        # ... and its variance.
        own = np.ones_like(half)
        ratio = np.exp(-2.0 * h)
        own[several] = (n * (1.0 - ratio**2) - 2.0 * ratio * (1.0 - ratio**n)) / (n * (1.0 - ratio)) ** 2
        covariance[np.diag_indices_from(covariance)] = slow.sigma**2 * own + self.white**2 / self.number
        return np.linalg.cholesky(covariance)


def key_of(recording: Recording, channel: int) -> int:
    """By which the slow error of a channel is known: itself.

    Of a displacement, in µm, the place from the end among the columns of the recording, below 0.
    """
    every = len(recording.temperature_names)
    return channel if channel < recording.temperature_count else channel - every


def channel_bins(
    recording: Recording, use: NDArray[np.bool_] | None = None, *, width: float | None = None
) -> tuple[ChannelBins, ...]:
    """Bins of every channel that has usable readings.

    Parameters
    ----------
    use : (N,) bool ndarray, optional
        Stamps to use; the others are held out.
    width : float, optional, [s]
        A minute, or more where that gives more than 500 bins, when absent.
    """
    times = recording.times
    if width is None:
        width = max(SHORTEST_BIN, float(times[-1] - times[0]) / MOST_BINS)
    found = []
    for channel in range(recording.temperature.shape[1]):
        usable = recording.usable[:, channel] & (True if use is None else use)
        rows = np.flatnonzero(usable)
        if rows.size == 0:
            continue
        _, owner = np.unique(np.floor((times[rows] - times[0]) / width), return_inverse=True)
        number = np.bincount(owner).astype(float)
        rounding = recording.noise[channel].resolution / np.sqrt(12.0)
        # A declared sigma is that of the sensor; rounding of the file comes on top where it is coarse.
        white = float(np.hypot(recording.sigma[channel], rounding))
        mean_time = np.bincount(owner, weights=times[rows]) / number
        first, last = np.full(number.size, np.inf), np.full(number.size, -np.inf)
        np.minimum.at(first, owner, times[rows])
        np.maximum.at(last, owner, times[rows])
        spacing = (last - first) / np.maximum(number - 1.0, 1.0)
        key = key_of(recording, channel)
        found.append(ChannelBins(channel, rows, owner, mean_time, number, spacing, white, key))
    return tuple(found)


class Whitener:
    """Makes the errors of bin means independent, of unit variance.

    Of a channel with a constant of its own nothing is left of that constant: what remains has the likelihood
    with every constant as likely.

    Up to ``MOST_DENSE`` bins by the Cholesky factor of their covariance; beyond,
    by the innovations of a Kalman filter, which for a process of this kind are
    the same (the loss of variance within a bin apart) at a cost in proportion
    to the number of bins.

    Parameters
    ----------
    Source of the filter: Anderson & Moore (1979), Optimal Filtering, chapter 5.
    """

    def __init__(self, bins: ChannelBins, slow: SlowError) -> None:
        self.factor: Array | None = None
        self._constant: Array | None = None
        self._prepare(bins, slow)
        if bins.is_relative:
            one = self._whitened(np.ones((len(bins.times), 1)))
            size = float(np.linalg.norm(one))
            self._constant = one / size
            self.log_root_determinant += float(np.log(size))

    def _prepare(self, bins: ChannelBins, slow: SlowError) -> None:
        slow = slow.of(bins.key)
        if len(bins.times) <= MOST_DENSE:
            self.factor = bins.factor(slow)
            self.log_root_determinant = float(np.log(np.diag(self.factor)).sum())
            return
        kept = np.exp(-np.diff(bins.times, prepend=bins.times[0]) / slow.time)
        white = bins.white**2 / bins.number
        gain, self._scale = np.empty_like(kept), np.empty_like(kept)
        variance = slow.sigma**2
        for step, (share, own) in enumerate(zip(kept.tolist(), white.tolist(), strict=True)):
            variance = share**2 * variance + slow.sigma**2 * (1.0 - share**2)
            total = variance + own
            gain[step], self._scale[step] = variance / total, np.sqrt(total)
            variance *= own / total
        # Expected value of a bin: share kept of the previous one, corrected by its gain. One row per bin.
        self._corrected = (kept[1:] * gain[:-1])[:, None]
        self._expecting = np.ones((2, len(kept)))
        self._expecting[1, :-1] = -kept[1:] * (1.0 - gain[:-1])
        self.log_root_determinant = float(np.log(self._scale).sum())

    def __call__(self, values: Array) -> Array:
        """Whitened values (b, ...)."""
        white = self._whitened(values)
        if self._constant is None:
            return white
        flat = white.reshape(len(white), -1)
        return (flat - self._constant @ (self._constant.T @ flat)).reshape(white.shape)

    def _whitened(self, values: Array) -> Array:
        if self.factor is not None:
            return whiten(self.factor, values)
        flat = values.reshape(len(values), -1)
        expected = np.zeros(flat.shape)
        expected[1:] = self._corrected * flat[:-1]
        expected = solve_banded((1, 0), self._expecting, expected, overwrite_b=True, check_finite=False)
        return ((flat - expected) / self._scale[:, None]).reshape(values.shape)


def whiteners_of(every: Sequence[ChannelBins], slow: SlowError) -> list[Whitener]:
    """A whitener for each of several bins; those read at the same times with the same errors share one."""
    made: dict[tuple, Whitener] = {}
    found = []
    for bins in every:
        own = slow.of(bins.key)
        read = (item.tobytes() for item in (bins.times, bins.number, bins.spacing))
        alike = (own.sigma, own.time, bins.white, bins.is_relative, *read)
        if alike not in made:
            made[alike] = Whitener(bins, slow)
        found.append(made[alike])
    return found


def whiten(factor: Array, values: Array) -> Array:
    """``L⁻¹ x``: unit variance, uncorrelated."""
    return solve_triangular(factor, values, lower=True, check_finite=False)


@dataclass(frozen=True, slots=True)
class Absorbed:
    """What a fit's coordinates can take up of an error.

    Attributes
    ----------
    columns : sequence of (b, p) ndarray, [K]
        Derivatives of the bin means by the coordinates, one for each observation of a temperature.
    root : (p, p) ndarray
        Root of their prior's precision.
    """

    columns: Sequence[Array]
    root: Array

    def log_determinant(self, whiteners: Sequence[Whitener]) -> float:
        """Logarithm of the determinant of the coordinates' precision after these observations."""
        precision = self.root.T @ self.root
        for whitener, columns in zip(whiteners, self.columns, strict=True):
            white = whitener(columns)
            precision += white.T @ white
        return float(np.linalg.slogdet(precision)[1])


def likely_slow_error(
    residuals: Sequence[tuple[ChannelBins, Array]],
    *,
    prior: SlowError | None = None,
    prior_width: float = 0.35,
    sigmas: Sequence[float] = (0.01, 0.02, 0.035, 0.05, 0.075, 0.11, 0.17, 0.25, 0.4, 0.65, 1.0, 1.6, 2.5),
    times: Sequence[float] = (600.0, 1200.0, 2400.0, 4800.0, 9600.0),
    by_channel: bool = False,
    absorbed: Absorbed | None = None,
) -> SlowError:
    """Most probable slow error of binned residuals.

    Parameters
    ----------
    residuals : sequence of (ChannelBins, (b,) ndarray)
        Residuals of the bin means [K].
    prior : SlowError, optional
        Where the magnitude is expected; its logarithm has the standard
        deviation ``prior_width``. Without it every listed value is as likely.
    sigmas, times : sequence of float, [K], [s]
        Values to choose from.
    by_channel : bool
        Whether every channel has its own; displacements always do, as likely whatever their size.
    absorbed : Absorbed, optional
        What the coordinates of the fit take up of the common slow error: the likelihood is then the
        restricted one, without which an error is taken for smaller and shorter than it is.

    Source: Patterson & Thompson (1971), Biometrika 58, 545-554.
    """
    several = [(bins, values[:, None]) for bins, values in residuals]
    choices = {"prior": prior, "prior_width": prior_width, "sigmas": sigmas, "times": times}
    return slow_errors_of(several, **choices, by_channel=by_channel, absorbed=absorbed)[0][0]


def slow_errors_of(
    residuals: Sequence[tuple[ChannelBins, Array]],
    *,
    prior: SlowError | None = None,
    prior_width: float = 0.35,
    sigmas: Sequence[float],
    times: Sequence[float],
    size: Callable[[Array], Array] = np.square,
    by_channel: bool = False,
    absorbed: Absorbed | None = None,
) -> list[tuple[SlowError, float]]:
    """Most probable slow error of each of several fits, and minus twice the logarithm of its likelihood.

    Parameters
    ----------
    residuals : sequence of (ChannelBins, (b, m) ndarray)
        Residuals of the bin means of m fits [K].
    size : callable
        What a whitened residual counts; its square by default.
    Others as :func:`likely_slow_error` has them.
    """
    choices = [SlowError(sigma, time) for sigma in sigmas for time in times]
    # Temperatures together, unless requested one by one, and every displacement by itself.
    group = [bins.key if by_channel or bins.is_relative else COMMON for bins, _ in residuals]
    keys = list(dict.fromkeys(group))
    fits = residuals[0][1].shape[1]
    found = np.zeros((len(choices), len(keys), fits))
    taken_up = np.zeros(len(choices))
    for number, (row, slow) in enumerate(zip(found, choices, strict=True)):
        whiteners = whiteners_of([bins for bins, _ in residuals], SlowError(slow.sigma, slow.time))
        if absorbed is not None:
            common = [item for own, item in zip(group, whiteners, strict=True) if own is COMMON]
            taken_up[number] = absorbed.log_determinant(common)
        for own, whitener, (_, values) in zip(group, whiteners, residuals, strict=True):
            size_of = 2.0 * whitener.log_root_determinant + size(whitener(values)).sum(axis=0)
            row[keys.index(own)] += size_of
        if prior is not None:
            for place, key in enumerate(keys):
                if key is COMMON or key >= 0:
                    row[place] += (np.log(slow.sigma / prior.of(key).sigma) / prior_width) ** 2
    if COMMON in keys:
        found[:, keys.index(COMMON)] += (taken_up - taken_up.min())[:, None]
    best, least = found.argmin(axis=0), found.min(axis=0).sum(axis=0)
    errors = [_joined({key: choices[best[i, fit]] for i, key in enumerate(keys)}) for fit in range(fits)]
    return list(zip(errors, least.tolist(), strict=True))


def _joined(chosen: Mapping[int | None, SlowError]) -> SlowError:
    """The common slow error with those of single channels beside it."""
    if COMMON not in chosen:
        return SlowError.each(chosen)
    common = chosen[COMMON]
    own = tuple((key, item.sigma, item.time) for key, item in chosen.items() if key is not COMMON)
    return SlowError(common.sigma, common.time, own)
