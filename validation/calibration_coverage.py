"""Whether stated intervals hold the truth: a calibration of recordings whose machine is known.

Machines are drawn from the prior, their recordings made with white noise and a
slow error, and each is calibrated as if it were measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from spindle_fem.inference.calibration import BOUND_SIGMAS, LEVEL, calibrate
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]
PredictorOf = Callable[[tuple[Recording, ...]], Predictor]

# Ranges of the slow error that a case is made with: size [K] and correlation time [s].
SLOW_SIGMA = (0.02, 0.05)
SLOW_TIME = (600.0, 2400.0)


@dataclass(frozen=True, slots=True)
class Coverage:
    """Deviations of calibrated parameters from the true ones.

    Attributes
    ----------
    names : tuple of str
    deviation : (n, p) ndarray
        Estimate less truth, both as logarithms of factors, in the stated standard deviations.
    sigma_share : (n, p) ndarray
        Stated standard deviation over the prior's.
    """

    names: tuple[str, ...]
    deviation: Array
    sigma_share: Array

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Whether the 90 % interval holds the truth, (n, p)."""
        return np.abs(self.deviation) < norm.ppf(0.5 + 0.5 * LEVEL)

    def by_parameter(self) -> dict[str, float]:
        """Share of the cases whose interval holds the truth."""
        return dict(zip(self.names, self.inside.mean(axis=0).tolist(), strict=True))


def coverage_study(
    predictor_of: PredictorOf, recordings: tuple[Recording, ...], cases: int, *, seed: int = 0
) -> Coverage:
    """Calibrate machines that are drawn from the prior.

    Parameters
    ----------
    predictor_of : callable
        Makes the predictor of some recordings, a :class:`Predictor` at the stamps with some fast model.
    recordings : tuple of Recording
        Inputs, stamps, channels, flags and noise of every case; their readings do not matter.
    cases : int
    seed : int

    Returns
    -------
    Coverage
    """
    rng = np.random.default_rng(seed)
    truth_of = predictor_of(recordings)
    priors = (*truth_of.uncertain(), *truth_of.starts())
    sigma = np.array([prior.sigma_log for prior in priors])
    highest = np.log([prior.highest for prior in priors])
    deviations, shares = [], []
    for _ in range(cases):
        truth = _drawn(rng, sigma, highest)
        slow = SlowError(float(rng.uniform(*SLOW_SIGMA)), float(rng.uniform(*SLOW_TIME)))
        factors = {prior.name: float(np.exp(value)) for prior, value in zip(priors, truth, strict=True)}
        made = tuple(
            replace(
                recording,
                temperature=truth_of.predict(number, factors).temperature + _errors(rng, recording, slow),
            )
            for number, recording in enumerate(recordings)
        )
        found = calibrate(predictor_of(made))
        stated = np.sqrt(np.diag(found.covariance))
        deviations.append((found.log_factors - truth) / stated)
        shares.append(stated / sigma)
    names = tuple(prior.name for prior in priors)
    return Coverage(names, np.array(deviations), np.array(shares))


def _drawn(rng: np.random.Generator, sigma: Array, highest: Array) -> Array:
    """Logarithms of factors from the prior, drawn anew where a fit could not reach them."""
    limit = np.minimum(BOUND_SIGMAS * sigma, highest)
    found = rng.normal(size=sigma.size) * sigma
    while (outside := (found > limit) | (found < -BOUND_SIGMAS * sigma)).any():
        found[outside] = rng.normal(size=int(outside.sum())) * sigma[outside]
    return found


def _errors(rng: np.random.Generator, recording: Recording, slow: SlowError) -> Array:
    """Errors of all readings, (N, c) K: white, and an Ornstein-Uhlenbeck process on every channel."""
    shape = recording.temperature.shape
    drawn = rng.normal(size=shape)
    found = np.empty(shape)
    found[0] = slow.sigma * drawn[0]
    kept = np.exp(-np.diff(recording.times) / slow.time)
    for row, share in enumerate(kept, 1):
        found[row] = share * found[row - 1] + slow.sigma * np.sqrt(1.0 - share**2) * drawn[row]
    return found + rng.normal(size=shape) * recording.sigma
