"""A machine's uncertain parameters fitted to recordings: a diagnosis without candidates.

Minimises ``Σ ρ(whitened residual) + Σ (ln factor / σ)²`` with Huber's ρ
(:mod:`spindle_fem.inference.hypothesis_fit`), within 3 σ of the prior. The
size of the slow error is found from the residuals and the fit repeated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from spindle_fem.errors import RecordingError
from spindle_fem.inference.belief import Belief, Coordinate
from spindle_fem.inference.coordinate_names import START_PREFIX
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.priors import Prior
from spindle_fem.inference.reading_noise import SlowError, likely_slow_error
from spindle_fem.inference.robust_size import OUTLIER_SIGMAS

Array = NDArray[np.float64]
Progress = Callable[[str], None]

# Largest departure of a parameter from its prior, in the prior's standard deviations.
BOUND_SIGMAS = 3.0
# Probability of stated intervals.
LEVEL = 0.90
# The data have determined a parameter if its posterior is narrower than this share of the prior.
LEARNED_BELOW = 0.8
# Parameters are called inseparable above this correlation.
CORRELATED_ABOVE = 0.9


@dataclass(frozen=True, slots=True)
class Estimate:
    """Result of the fit for one parameter.

    Attributes
    ----------
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
        Temperatures at the start of a network's recording are named ``initial.<node>``, with the number of
        the recording (``[2]``) where there are several.
    log_factors : (p,) ndarray
        Logarithm of the factor on each prior value.
    covariance : (p, p) ndarray
        Covariance of ``log_factors``.
    slow : SlowError
        As the covariance of the readings used it.
    chi_square : float
        Sum of squared whitened residuals over their number.
    cost : float
        Half the robust sum at the optimum, prior included.
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
        width = ndtri(0.5 + 0.5 * LEVEL)
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
        """Parameters that the data do not determine."""
        return tuple(item.name for item in self.estimates if not item.learned)


def calibrate(
    predictor: Predictor,
    *,
    slow: SlowError | None = None,
    rounds: int = 2,
    progress: Progress = lambda stage: None,
) -> Calibration:
    """Most probable parameters and their uncertainty.

    Parameters
    ----------
    predictor : Predictor
        At the stamps of its recordings; what it holds out is not fitted.
    slow : SlowError, optional
        Known slow error; found from the data when absent.
    rounds : int
        Fits, the slow error found anew between them.

    Raises
    ------
    RecordingError
        No usable reading.
    ConvergenceError
        The machine cannot be simulated with any parameters near its prior.
    """
    if not predictor.observations:
        raise RecordingError("calibration", "the recordings have no usable reading.")
    priors = (*predictor.uncertain(), *predictor.starts())
    belief = Belief.prior([coordinate_of(prior, BOUND_SIGMAS) for prior in priors])
    error, evaluations = slow or SlowError(), 0
    problem: Problem | None = None
    fit: Fit | None = None
    for attempt in range(1 if slow is not None else rounds):
        if problem is not None and fit is not None:
            left = problem.binned_residuals(fit)
            error = likely_slow_error(left, prior=SlowError(), absorbed=problem.absorbed(fit))
        progress(f"calibration: fit {attempt + 1}")
        problem = Problem(predictor, belief, error, predictor.observations)
        fit = problem.fit((), None if fit is None else fit.values, exact=True)
        evaluations += fit.evaluations
    sigma = np.array([prior.sigma_log for prior in priors])
    return Calibration(
        tuple(_told(prior, len(predictor.recordings)) for prior in priors),
        fit.position * sigma,
        fit.covariance * np.outer(sigma, sigma),
        error,
        float(np.mean(fit.residual**2)),
        0.5 * fit.misfit_with_prior,
        evaluations,
        float(np.mean(np.abs(fit.residual) > OUTLIER_SIGMAS)),
    )


def coordinate_of(prior: Prior, bound: float) -> Coordinate:
    """Factor on a parameter as a coordinate; ``bound`` limits it, in standard deviations of its prior."""
    highest = min(bound, float(np.log(prior.highest)) / prior.sigma_log)
    return Coordinate(prior.name, 1.0, prior.sigma_log, True, -bound, highest)


def _told(prior: Prior, recordings: int) -> Prior:
    """A prior by the name that a result gives it."""
    if not prior.name.startswith(START_PREFIX):
        return prior
    number, _, name = prior.name.removeprefix(START_PREFIX).partition(".")
    return replace(prior, name=f"{name}[{int(number) + 1}]" if recordings > 1 else name)


def prediction_interval(
    covariance: Array, slow: SlowError, sensitivity: Array, white: Array, *, level: float = LEVEL
) -> Array:
    """Half width of the interval that holds a new reading, (N, c) [K].

    Parameters
    ----------
    covariance : (p, p) ndarray
        Covariance of the parameters' logarithms.
    sensitivity : (N, c, p) ndarray, [K]
        Derivatives of the prediction to the same logarithms.
    white : (c,) ndarray, [K]
        Noise of the channels.
    """
    from_parameters = np.einsum("ncp,pq,ncq->nc", sensitivity, covariance, sensitivity, optimize=True)
    total = from_parameters + slow.sigma**2 + np.asarray(white) ** 2
    return ndtri(0.5 + 0.5 * level) * np.sqrt(total)
