"""Information of readings beyond those before them: a Kalman filter over parameters and slow errors.

Unknown are the machine's coordinates (in units of their priors), what rows and gaps leave open, the slow
errors of every channel and the zero of every displacement sensor. A reading is the prediction, plus its
derivatives times the departure of the first two, plus the slow errors, plus white noise, of a displacement
plus the zero.
As long as the machine is as its model and the noise as stated, the differences between readings and what
those before them lead to expect are independent from instant to instant, of known spread.

Source: Anderson & Moore (1979), Optimal Filtering, chapters 3 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.cumulative_sums import OUTLIER
from spindle_fem.inference.reading_noise import SlowError

Array = NDArray[np.float64]

# Prior of a displacement sensor's zero about its first reading, µm: nothing is known of it.
ZERO_SIGMA = 1.0e3


class InnovationFilter:
    """Departures of the coordinates, slow errors and zeros of the channels, carried from instant to instant.

    Parameters
    ----------
    covariance : (p, p) ndarray
        Of the coordinates about where the machine is linearised.
    slow : sequence of SlowError
        Of every channel, K or µm.
    relative : sequence of int
        The d channels with an unknown zero: displacements. Their first reading sets it and says nothing else.
    beside : sequence of (int, SlowError)
        Further slow errors, and of which channel each is.

    Attributes
    ----------
    mean : (p + e + s + d,) ndarray
        Departures of the coordinates, then of what is open, slow errors [K, µm], zeros [µm].
    covariance : (p + e + s + d, p + e + s + d) ndarray
    open : int
        Number e of what rows and gaps left open.
    slow_sigma : (c,) ndarray, [K, µm]
        Usual size of the slow errors of every channel together.
    """

    def __init__(
        self,
        covariance: Array,
        slow: Sequence[SlowError],
        relative: Sequence[int] = (),
        beside: Sequence[tuple[int, SlowError]] = (),
    ) -> None:
        every = [*enumerate(slow), *beside]
        self._sigma = np.array([item.sigma for _, item in every])
        self._time = np.array([item.time for _, item in every])
        # Which slow errors a channel reads, (c, s).
        self._reads = np.arange(len(slow))[:, None] == [channel for channel, _ in every]
        self.slow_sigma = np.sqrt(self._reads @ self._sigma**2)
        self._own, self.open = len(covariance), 0
        self._zero = {channel: place for place, channel in enumerate(relative)}
        self._known = np.array([channel not in self._zero for channel in range(len(slow))])
        variances = np.concatenate((self._sigma**2, np.full(len(relative), ZERO_SIGMA**2)))
        size = len(covariance) + len(variances)
        self.mean = np.zeros(size)
        self.covariance = np.zeros((size, size))
        self.covariance[: len(covariance), : len(covariance)] = covariance
        self.covariance[len(covariance) :, len(covariance) :] = np.diag(variances)

    @property
    def _errors(self) -> slice:
        first = self._own + self.open
        return slice(first, first + len(self._sigma))

    def open_further(self, number: int) -> None:
        """Begin with further numbers that rows and gaps leave open, each of unit variance."""
        first = self._errors.start
        self.mean = np.insert(self.mean, [first] * number, 0.0)
        for axis in (0, 1):
            self.covariance = np.insert(self.covariance, [first] * number, 0.0, axis=axis)
        fresh = np.arange(first, first + number)
        self.covariance[fresh, fresh] = 1.0
        self.open += number

    def forget_open(self, number: int) -> None:
        """Drop the oldest numbers that are open: what they did has faded."""
        gone = slice(self._own, self._own + number)
        self.mean = np.delete(self.mean, gone)
        self.covariance = np.delete(np.delete(self.covariance, gone, axis=0), gone, axis=1)
        self.open -= number

    @property
    def slow_errors(self) -> Array:
        """Estimated slow error of every channel, (c,) K or µm."""
        return self._reads @ self.mean[self._errors]

    @property
    def zeros(self) -> Array:
        """Estimated zero of every channel, (c,) µm; nothing for temperatures."""
        found = np.zeros(len(self._known))
        for channel, place in self._zero.items():
            found[channel] = self.mean[self._errors.stop + place]
        return found

    def step(self, elapsed: float, residual: Array, slopes: Array, white: Array, *, learn: bool) -> Array:
        """Take the readings of one instant.

        Parameters
        ----------
        elapsed : float, [s]
            Since the instant before.
        residual : (c,) ndarray, [K, µm]
            Read less predicted; NaN where nothing was read.
        slopes : (c, p + e) ndarray, [K, µm]
            Derivatives of the prediction to the coordinates, and to what is open.
        white : (c,) ndarray, [K, µm]
            Standard deviation of the white noise.
        learn : bool
            Whether the coordinates learn from the readings, or only slow errors and zeros.

        Returns
        -------
        (c,) ndarray
            Innovations over their standard deviations; NaN where nothing was read, or only a zero set.
        """
        errors, kept = self._errors, np.exp(-elapsed / self._time)
        self.mean[errors] *= kept
        self.covariance[errors] *= kept[:, None]
        self.covariance[:, errors] *= kept
        diagonal = np.arange(errors.start, errors.stop)
        self.covariance[diagonal, diagonal] += self._sigma**2 * (1.0 - kept**2)
        read = np.flatnonzero(np.isfinite(residual))
        scaled = np.full(len(residual), np.nan)
        if not read.size:
            return scaled
        observes = np.zeros((read.size, len(self.mean)))
        observes[:, : errors.start] = slopes[read]
        observes[:, errors] = self._reads[read]
        fresh = ~self._known[read]
        for row, channel in enumerate(read.tolist()):
            if channel in self._zero:
                zero = errors.stop + self._zero[channel]
                if fresh[row]:
                    self.mean[zero] = residual[channel] - observes[row] @ self.mean
                observes[row, zero] = 1.0
        self._known[read] = True
        noise = np.diag(white[read] ** 2)
        across = self.covariance @ observes.T
        spread = observes @ across + noise
        innovation = residual[read] - observes @ self.mean
        sigma = np.sqrt(np.diag(spread))
        scaled[read] = np.where(fresh, np.nan, innovation / sigma)
        gain = np.linalg.solve(spread, across.T).T
        if not learn:
            gain[: self._own] = 0.0
        self.mean += gain @ np.clip(innovation, -OUTLIER * sigma, OUTLIER * sigma)
        left = np.eye(len(self.mean)) - gain @ observes
        self.covariance = left @ self.covariance @ left.T + gain @ noise @ gain.T
        return scaled

    def moved(self) -> Array:
        """Departures of the coordinates, (p,), which count from there afterwards."""
        found = self.mean[: self._own].copy()
        self.mean[: self._own] = 0.0
        return found
