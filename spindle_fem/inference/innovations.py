"""Information of readings beyond those before them: a Kalman filter over parameters and slow errors.

Unknown are the machine's coordinates (in units of their priors) and one slow error per channel. A reading is
the prediction, plus its derivatives times the departure of the coordinates, plus the slow error, plus white
noise. As long as the machine is as its model and the noise as stated, the differences between readings and
what those before them lead to expect are independent from instant to instant, of known spread.

Source: Anderson & Moore (1979), Optimal Filtering, chapters 3 and 5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.cumulative_sums import OUTLIER
from spindle_fem.inference.reading_noise import SlowError

Array = NDArray[np.float64]


class InnovationFilter:
    """Departures of the coordinates and slow errors of the channels, carried from instant to instant.

    Parameters
    ----------
    covariance : (p, p) ndarray
        Of the coordinates about where the machine is linearised.
    slow : SlowError
    channels : int

    Attributes
    ----------
    mean : (p + c,) ndarray
        Departures of the coordinates, then slow errors [K].
    covariance : (p + c, p + c) ndarray
    """

    def __init__(self, covariance: Array, slow: SlowError, channels: int) -> None:
        self.slow, self._own = slow, len(covariance)
        size = self._own + channels
        self.mean = np.zeros(size)
        self.covariance = np.zeros((size, size))
        self.covariance[: self._own, : self._own] = covariance
        self.covariance[self._own :, self._own :] = slow.sigma**2 * np.eye(channels)

    @property
    def slow_errors(self) -> Array:
        """Estimated slow error of every channel, K."""
        return self.mean[self._own :]

    def step(self, elapsed: float, residual: Array, slopes: Array, white: Array, *, learn: bool) -> Array:
        """Take the readings of one instant.

        Parameters
        ----------
        elapsed : float, [s]
            Since the instant before.
        residual : (c,) ndarray, [K]
            Read less predicted; NaN where nothing was read.
        slopes : (c, p) ndarray, [K]
            Derivatives of the prediction to the coordinates.
        white : (c,) ndarray, [K]
            Standard deviation of the white noise.
        learn : bool
            Whether the coordinates learn from the readings, or only the slow errors.

        Returns
        -------
        (c,) ndarray
            Innovations over their standard deviations; NaN where nothing was read.
        """
        own, kept = self._own, np.exp(-elapsed / self.slow.time)
        self.mean[own:] *= kept
        self.covariance[own:] *= kept
        self.covariance[:, own:] *= kept
        errors = np.arange(own, len(self.mean))
        self.covariance[errors, errors] += self.slow.sigma**2 * (1.0 - kept**2)
        read = np.flatnonzero(np.isfinite(residual))
        told = np.full(len(residual), np.nan)
        if not read.size:
            return told
        observes = np.zeros((read.size, len(self.mean)))
        observes[:, :own] = slopes[read]
        observes[np.arange(read.size), own + read] = 1.0
        noise = np.diag(white[read] ** 2)
        across = self.covariance @ observes.T
        spread = observes @ across + noise
        innovation = residual[read] - observes @ self.mean
        sigma = np.sqrt(np.diag(spread))
        told[read] = innovation / sigma
        gain = np.linalg.solve(spread, across.T).T
        if not learn:
            gain[:own] = 0.0
        self.mean += gain @ np.clip(innovation, -OUTLIER * sigma, OUTLIER * sigma)
        left = np.eye(len(self.mean)) - gain @ observes
        self.covariance = left @ self.covariance @ left.T + gain @ noise @ gain.T
        return told

    def moved(self) -> Array:
        """Departures of the coordinates, (p,), which count from there afterwards."""
        found = self.mean[: self._own].copy()
        self.mean[: self._own] = 0.0
        return found
