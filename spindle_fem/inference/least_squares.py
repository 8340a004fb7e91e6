"""Regularised, robust nonlinear least squares over one or several recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import norm

from spindle_fem.errors import ConvergenceError, RecordingError
from spindle_fem.inference.predictor import Predictor, Prior
from spindle_fem.inference.reading_noise import (
    ChannelBins,
    SlowError,
    channel_bins,
    likely_slow_error,
    whiten,
)

Array = NDArray[np.float64]
Progress = Callable[[str], None]

# Whitened residuals beyond this count linearly.
OUTLIER_SIGMAS = 3.0
BOUND_SIGMAS = 3.0
LEVEL = 0.90
# A posterior narrower than this share of the prior was told something by the data.
LEARNED_BELOW = 0.8
CORRELATED_ABOVE = 0.9


@dataclass(frozen=True, slots=True)
class Estimate:
    """What is known of one parameter after the fit.

    Attributes
    ----------
    name, unit : str
    value : float
        In ``unit``.
    low, high : float
        90 % interval.
    prior : float
        Value before the data.
    factor : float
        ``value / prior``.
    sigma_log : float
        Posterior standard deviation of the logarithm.
    prior_sigma_log : float
    learned : bool
        Whether the data say more than the prior did.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    prior: float
    factor: float
    sigma_log: float
    prior_sigma_log: float
    learned: bool


@dataclass(frozen=True, slots=True)
class Calibration:
    """Outcome of a fit.

    Attributes
    ----------
    priors : tuple of Prior
    log_factors : (p,) ndarray
        Logarithm of the factor on each prior value.
    covariance : (p, p) ndarray
        Of ``log_factors``.
    slow : SlowError
        As the covariance of the readings used it.
    chi_square : float
        Sum of squared whitened residuals over their number.
    cost : float
        Half the robust sum at the optimum, prior included.
    evaluations : int
    outlier_share : float
        Share of the whitened residuals beyond the robust limit.
    """

    priors: tuple[Prior, ...]
    log_factors: Array
    covariance: Array
    slow: SlowError
    chi_square: float
    cost: float
    evaluations: int
    outlier_share: float

    @property
    def factors(self) -> dict[str, float]:
        """Factor on every prior value, by name."""
        return {p.name: float(np.exp(v)) for p, v in zip(self.priors, self.log_factors, strict=True)}

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every parameter with its 90 % interval."""
        width = norm.ppf(0.5 + 0.5 * LEVEL)
        found = []
        for prior, value, variance in zip(
            self.priors, self.log_factors, np.diag(self.covariance), strict=True
        ):
            sigma = float(np.sqrt(variance))
            found.append(
                Estimate(
                    prior.name,
                    prior.unit,
                    prior.value * float(np.exp(value)),
                    prior.value * float(np.exp(value - width * sigma)),
                    prior.value * float(np.exp(value + width * sigma)),
                    prior.value,
                    float(np.exp(value)),
                    sigma,
                    prior.sigma_log,
                    sigma < LEARNED_BELOW * prior.sigma_log,
                )
            )
        return tuple(found)

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the logarithms, (p, p)."""
        sigma = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(sigma, sigma)

    def cannot_tell_apart(self) -> list[tuple[str, str, float]]:
        """Pairs that the data know together but not one by one, with their correlation."""
        correlation = self.correlation
        found = []
        for i in range(len(self.priors)):
            for j in range(i):
                if abs(correlation[i, j]) > CORRELATED_ABOVE:
                    found.append((self.priors[j].name, self.priors[i].name, float(correlation[i, j])))
        return sorted(found, key=lambda pair: -abs(pair[2]))

    def unlearned(self) -> tuple[str, ...]:
        """Parameters that the data say nothing about."""
        return tuple(item.name for item in self.estimates if not item.learned)


def calibrate(
    predictor: Predictor,
    *,
    use: Sequence[NDArray[np.bool_] | None] | None = None,
    slow: SlowError | None = None,
    start: Array | None = None,
    rounds: int = 2,
    progress: Progress = lambda stage: None,
) -> Calibration:
    """Most probable parameters and their uncertainty.

    Minimises ``Σ ρ(whitened residual) + Σ (ln factor / σ)²`` with Huber's ρ,
    within 3 σ of the prior. The magnitude of the slow error is found from the
    residuals and the fit repeated.

    Parameters
    ----------
    predictor : Predictor
    use : sequence of (N,) bool ndarray or None, optional
        Stamps to use in each recording; the others are held out.
    slow : SlowError, optional
        Known slow error; found from the data when absent.
    start : (p,) ndarray, optional
        Where to begin; the prior when absent.
    rounds : int
        Fits, the slow error found anew between them.
    progress : callable

    Returns
    -------
    Calibration

    Raises
    ------
    RecordingError
        No usable reading.
    ConvergenceError
        The optimiser gives up.
    """
    kept = use if use is not None else [None] * len(predictor.recordings)
    bins = [channel_bins(recording, mask) for recording, mask in zip(predictor.recordings, kept, strict=True)]
    if not any(bins):
        raise RecordingError("calibration", "the recordings have no usable reading.")
    sigma = np.array([prior.sigma_log for prior in predictor.priors])
    highest = np.log([prior.highest for prior in predictor.priors])
    scaled = np.zeros(len(sigma)) if start is None else np.asarray(start, dtype=float) / sigma
    upper = np.minimum(BOUND_SIGMAS, highest / sigma)
    scaled = np.clip(scaled, -BOUND_SIGMAS + 1e-6, upper - 1e-6)
    error = slow or SlowError()
    evaluations = 0
    for attempt in range(1 if slow is not None else rounds):
        problem = _Problem(predictor, bins, error, sigma)
        progress(f"calibration: fit {attempt + 1}")
        found = least_squares(
            problem.residuals,
            scaled,
            jac=problem.jacobian,
            bounds=(-BOUND_SIGMAS, upper),
            loss="huber",
            f_scale=OUTLIER_SIGMAS,
            xtol=1e-5,
            ftol=1e-6,
            gtol=1e-6,
            max_nfev=40,
        )
        if found.status < 0 or not np.all(np.isfinite(found.x)):
            raise ConvergenceError("calibration", f"the optimiser gave up: {found.message}")
        evaluations += found.nfev
        scaled = found.x
        if slow is None and attempt + 1 < rounds:
            error = likely_slow_error(problem.binned_residuals(scaled), prior=SlowError())
    residual, jacobian = problem.residuals(scaled), problem.jacobian(scaled)
    number = problem.n_data
    # Huber's weights: what counts linearly also informs less.
    weight = np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(np.abs(residual), 1e-12))
    precision = jacobian.T @ (weight[:, None] * jacobian)
    covariance = np.linalg.inv(precision) * np.outer(sigma, sigma)
    return Calibration(
        predictor.priors,
        scaled * sigma,
        0.5 * (covariance + covariance.T),
        error,
        float(np.mean(residual[:number] ** 2)),
        float(found.cost),
        evaluations,
        float(np.mean(np.abs(residual[:number]) > OUTLIER_SIGMAS)),
    )


class _Problem:
    """Whitened residuals and their Jacobian in units of the prior's standard deviations."""

    def __init__(
        self, predictor: Predictor, bins: Sequence[tuple[ChannelBins, ...]], slow: SlowError, sigma: Array
    ) -> None:
        self.predictor, self.bins, self.sigma = predictor, bins, sigma
        self.factor = [[item.factor(slow) for item in items] for items in bins]
        self.n_data = sum(len(item.times) for items in bins for item in items)
        self._at: Array | None = None
        self._runs: list[tuple[Array, Array]] = []

    def _predict(self, scaled: Array) -> list[tuple[Array, Array]]:
        if self._at is None or not np.array_equal(self._at, scaled):
            self._runs = self.predictor.predict(scaled * self.sigma)
            self._at = scaled.copy()
        return self._runs

    def binned_residuals(self, scaled: Array) -> list[tuple[ChannelBins, Array]]:
        """Predicted minus read, averaged over the bins."""
        found = []
        for recording, (predicted, _), items in zip(
            self.predictor.recordings, self._predict(scaled), self.bins, strict=True
        ):
            for item in items:
                difference = predicted[:, item.channel] - recording.temperature[:, item.channel]
                found.append((item, item.average(difference)))
        return found

    def residuals(self, scaled: Array) -> Array:
        factors = [factor for items in self.factor for factor in items]
        blocks = [
            whiten(factor, values)
            for factor, (_, values) in zip(factors, self.binned_residuals(scaled), strict=True)
        ]
        return np.concatenate([*blocks, scaled])

    def jacobian(self, scaled: Array) -> Array:
        blocks = []
        for (_, sensitivity), items, factors in zip(
            self._predict(scaled), self.bins, self.factor, strict=True
        ):
            for item, factor in zip(items, factors, strict=True):
                blocks.append(whiten(factor, item.average(sensitivity[:, item.channel]) * self.sigma))
        return np.vstack([*blocks, np.eye(len(self.sigma))])


def prediction_interval(
    covariance: Array, slow: SlowError, sensitivity: Array, white: Array, *, level: float = LEVEL
) -> Array:
    """Half width of the interval that holds a new reading, (N, c) [K].

    Parameters
    ----------
    covariance : (p, p) ndarray
        Of the parameters' logarithms.
    slow : SlowError
    sensitivity : (N, c, p) ndarray, [K]
        Of the prediction to the same logarithms.
    white : (c,) ndarray, [K]
        Noise of the channels.
    level : float
    """
    from_parameters = np.einsum("ncp,pq,ncq->nc", sensitivity, covariance, sensitivity, optimize=True)
    total = from_parameters + slow.sigma**2 + np.asarray(white) ** 2
    return norm.ppf(0.5 + 0.5 * level) * np.sqrt(total)
