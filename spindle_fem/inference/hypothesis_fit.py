"""Most probable parameters of a hypothesis, and how probable the data make it.

A hypothesis is a set of candidates added to the machine. Its parameters, the
machine's uncertain ones and the places of the probes are fitted together,
each in units of its prior; the evidence is Laplace's, about the optimum.

Source of the evidence: MacKay (2003), Information Theory, Inference, and
Learning Algorithms, chapter 27-28.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.inference import tuned
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.observations import Observation
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import ChannelBins, SlowError, Whitener

Array = NDArray[np.float64]

# Whitened residuals beyond this count linearly.
OUTLIER_SIGMAS = 3.0
# Steps of a fit at most.
MOST_ITERATIONS = 30
# An exact fit ends with a step that lowers the misfit by less than this share: rounding comes next.
EXACT_SHARE = 1.0e-8
# Largest change of any coordinate in one step, and bound of the machine's coordinates, in prior deviations.
LARGEST_MOVE = 2.0
THETA_BOUND = 4.0


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One free number in units of its prior.

    Attributes
    ----------
    name : str
        As :class:`Predictor` takes it.
    value : float
        At zero.
    sigma : float
        1 σ, of the logarithm where ``logarithmic``.
    low, high : float
        Bounds of the coordinate.
    """

    name: str
    value: float
    sigma: float
    logarithmic: bool
    low: float
    high: float
    unit: str = ""

    def at(self, coordinate: float) -> float:
        """Value at a coordinate."""
        if self.logarithmic:
            return self.value * float(np.exp(self.sigma * coordinate))
        # of a row of an array: values are written into definitions
        return float(self.value + self.sigma * coordinate)

    def of(self, value: float) -> float:
        """Coordinate of a value, within the bounds."""
        if self.logarithmic:
            found = np.log(value / self.value) / self.sigma
        else:
            found = (value - self.value) / self.sigma
        return float(np.clip(found, self.low, self.high))


@dataclass(frozen=True, slots=True)
class Belief:
    """Knowledge of the machine's own coordinates before the diagnosed recording.

    Attributes
    ----------
    mean : (p,) ndarray
    root : (p, p) ndarray
        ``rootᵀ root`` is the precision.
    """

    coordinates: tuple[Coordinate, ...]
    mean: Array
    root: Array

    @classmethod
    def prior(cls, coordinates: Sequence[Coordinate]) -> Belief:
        """Belief from the definition alone."""
        return cls(tuple(coordinates), np.zeros(len(coordinates)), np.eye(len(coordinates)))


@dataclass(frozen=True, slots=True)
class Fit:
    """A hypothesis at its optimum.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        The machine's, then the candidates'.
    position : (p,) ndarray
    covariance : (p, p) ndarray
        Covariance of the coordinates.
    log_evidence : float
        Up to what all hypotheses share.
    misfit : float
        Robust sum of squared whitened residuals.
    misfit_with_prior : float
        The same with the squared distance from what was known before.
    residual : (n,) ndarray
        Whitened.
    evaluations : int
        Number of predictions.
    """

    candidates: tuple[Candidate, ...]
    coordinates: tuple[Coordinate, ...]
    position: Array
    covariance: Array
    log_evidence: float
    misfit: float
    misfit_with_prior: float
    residual: Array
    slow: SlowError
    evaluations: int = 0

    @property
    def values(self) -> dict[str, float]:
        """Values by name."""
        return {c.name: c.at(u) for c, u in zip(self.coordinates, self.position, strict=True)}

    @property
    def keys(self) -> frozenset[tuple[str, str]]:
        """Effects with their places."""
        return frozenset((c.effect, c.component) for c in self.candidates)

    @property
    def reduced_misfit(self) -> float:
        """Misfit for each datum."""
        return self.misfit / max(len(self.residual), 1)

    def interval(self, name: str, level_sigmas: float) -> tuple[float, float]:
        """Values at ``level_sigmas`` posterior standard deviations to either side."""
        index = next(i for i, c in enumerate(self.coordinates) if c.name == name)
        coordinate = self.coordinates[index]
        spread = level_sigmas * float(np.sqrt(self.covariance[index, index]))
        ends = [
            coordinate.at(
                float(np.clip(self.position[index] + sign * spread, coordinate.low, coordinate.high))
            )
            for sign in (-1.0, 1.0)
        ]
        return min(ends), max(ends)


def candidate_coordinates(candidate: Candidate) -> tuple[Coordinate, ...]:
    """Free parameters of a candidate, in units of their priors."""
    factors = {item.name for item in candidate.factors}
    found = []
    for name, item in candidate.free.items():
        if item.logarithmic:
            low = np.log(item.low / item.value) / item.sigma if item.low > 0.0 else -np.inf
            high = np.log(item.high / item.value) / item.sigma if np.isfinite(item.high) else np.inf
        else:
            low, high = (item.low - item.value) / item.sigma, (item.high - item.value) / item.sigma
        own = EFFECT_PREFIX + name if name in factors else name
        found.append(Coordinate(own, item.value, item.sigma, item.logarithmic, low, high, item.unit))
    return tuple(found)


def amplitude_name(candidate: Candidate) -> str:
    """Name of the coordinate that switches a candidate on."""
    own = candidate.amplitude
    return EFFECT_PREFIX + own if own in {item.name for item in candidate.factors} else own


@dataclass(slots=True)
class Problem:
    """Data, noise and what is known of the machine."""

    predictor: Predictor
    belief: Belief
    slow: SlowError
    observations: tuple[Observation, ...]
    whiteners: list[Whitener] = field(init=False)
    data: Array = field(init=False)
    _straight: dict[str, Array] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.whiteners = [Whitener(item.bins, self.slow) for item in self.observations]
        self.data = np.concatenate(
            [white(item.values) for item, white in zip(self.observations, self.whiteners, strict=True)]
        )

    def whitened(self, on_grid: Sequence[Array]) -> Array:
        """Values (G + 1, c, ...) of every recording at the data, whitened and stacked."""
        return np.concatenate(
            [
                white(item.at(on_grid[item.recording][:, item.channel]))
                for item, white in zip(self.observations, self.whiteners, strict=True)
            ]
        )

    def straight(self, candidates: Sequence[Candidate]) -> Mapping[str, Array]:
        """Derivatives of the whitened data by coordinates on which nothing else depends, by their name.

        Directions in which the machine may differ, unless a sensor changes what its channel reads. There may
        be hundreds of them.
        """
        if self.predictor.effects.readings or any(c.reading is not None for c in candidates):
            return {}
        if self._straight is None:
            rows = np.cumsum([0, *(len(item.values) for item in self.observations)])
            found: dict[str, Array] = {}
            for item, white, first in zip(self.observations, self.whiteners, rows[:-1], strict=True):
                names, slopes = self.predictor.directions_of(item.recording)
                if names:
                    own = white(item.at(slopes[:, item.channel]))
                    for name, column in zip(names, own.T, strict=True):
                        whole = found.setdefault(name, np.zeros(rows[-1]))
                        whole[first : first + len(column)] = column
            self._straight = found
        return self._straight

    def binned_residuals(self, fit: Fit) -> list[tuple[ChannelBins, Array]]:
        """Predicted less read, K, averaged over the bins of every observation."""
        predicted = [
            item.temperature for item in self.predict(fit.candidates, fit.coordinates, fit.position, by=())
        ]
        return [
            (item.bins, item.at(predicted[item.recording][:, item.channel]) - item.values)
            for item in self.observations
        ]

    def predict(
        self,
        candidates: Sequence[Candidate],
        coordinates: Sequence[Coordinate],
        position: Array,
        *,
        by: Sequence[int] | None = None,
        near: Sequence[Prediction] | None = None,
    ) -> list[Prediction]:
        """Every recording, with derivatives by some of the coordinates, by all when absent.

        ``near`` are predictions at a position that is near, which these begin from.
        """
        values = {c.name: c.at(u) for c, u in zip(coordinates, position, strict=True)}
        derived = coordinates if by is None else [coordinates[index] for index in by]
        names = [c.name for c in derived]
        scale = np.array([c.sigma for c in derived])
        found = []
        for number in range(len(self.predictor.recordings)):
            beside = None if near is None else near[number]
            prediction = self.predictor.predict(number, values, candidates, names, beside)
            found.append(replace(prediction, sensitivity=prediction.sensitivity * scale))
        return found

    def fit(
        self,
        candidates: Sequence[Candidate] = (),
        start: Mapping[str, float] | None = None,
        *,
        iterations: int = MOST_ITERATIONS,
        hopeless: float = np.inf,
        exact: bool = False,
    ) -> Fit:
        """Most probable values of everything that is free.

        Parameters
        ----------
        start : mapping of str to float
            Values to begin from, by name; what is known of the machine, and the
            candidates' nominal values, where absent.
        hopeless : float
            Misfit that must be within reach of the next steps; else the search ends where it is.
        exact : bool
            Whether to continue until steps gain almost nothing, not only less than what matters for ranking.

        Raises
        ------
        ConvergenceError
            No step lowers the misfit from a point that can be simulated.
        """
        own = tuple(c for candidate in candidates for c in candidate_coordinates(candidate))
        coordinates = (*self.belief.coordinates, *own)
        n_own, n_machine = len(own), len(self.belief.coordinates)
        given = dict(start or {})
        position = np.concatenate((self.belief.mean, np.zeros(n_own)))
        for index, coordinate in enumerate(coordinates):
            if coordinate.name in given:
                position[index] = coordinate.of(given[coordinate.name])
        low = np.array([c.low for c in coordinates])
        high = np.array([c.high for c in coordinates])
        position = np.clip(position, low, high)
        root = np.eye(len(coordinates))
        root[:n_machine, :n_machine] = self.belief.root
        mean = np.concatenate((self.belief.mean, np.zeros(n_own)))

        def cost_at(at: Array, near: list[Prediction] | None) -> tuple[float, Array, list[Prediction] | None]:
            nonlocal evaluations
            evaluations += 1
            predicted = self.predict(candidates, coordinates, at, by=(), near=near)
            residual = self.data - self.whitened([p.temperature for p in predicted])
            pull = root @ (at - mean)
            return float(np.sum(huber(residual)) + pull @ pull), residual, predicted

        def slopes_at(at: Array, near: list[Prediction]) -> tuple[Array, list[Prediction]]:
            predicted = self.predict(candidates, coordinates, at, by=bent, near=near)
            slopes[:, bent] = self.whitened([p.sensitivity for p in predicted])
            return slopes, predicted

        evaluations = 0
        scale = np.array([c.sigma for c in coordinates])
        straight = self.straight(candidates)
        bent = [index for index, c in enumerate(coordinates) if c.name not in straight]
        slopes = np.empty((len(self.data), len(coordinates)))
        for index, coordinate in enumerate(coordinates):
            if coordinate.name in straight:
                slopes[:, index] = coordinate.sigma * straight[coordinate.name]
        cost, residual, predicted = cost_at(position, None)
        jacobian, predicted = slopes_at(position, predicted)
        damping = 1e-3
        for iteration in range(iterations):
            weight = np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(np.abs(residual), 1e-12))
            hessian = jacobian.T @ (weight[:, None] * jacobian) + root.T @ root
            gradient = jacobian.T @ (weight * residual) - root.T @ (root @ (position - mean))
            if iteration and np.isfinite(hopeless):
                whole = _bounded_step(hessian, gradient, 0.0, position, low, high)
                promised = float(2.0 * gradient @ whole - whole @ hessian @ whole)
                if promised > 0.0 and cost - tuned.HOPELESS_REACH * promised > hopeless:
                    break
            improved, gain, refused = False, 0.0, None
            while damping < 1e8:
                move = _bounded_step(hessian, gradient, damping, position, low, high)
                largest = float(np.abs(move).max()) if move.size else 0.0
                if largest > LARGEST_MOVE:
                    move *= LARGEST_MOVE / largest
                if (
                    refused is not None
                    and np.abs(move - refused).max() < tuned.SAME_STEP_WITHIN * np.abs(refused).max()
                ):
                    damping *= 10.0
                    continue
                try:
                    trial = cost_at(position + move, [item.moved((scale * move)[bent]) for item in predicted])
                except (ConvergenceError, OutOfValidityError, SpecError):
                    # Outside what can be simulated (a share above one, a runaway): a shorter step.
                    trial = (np.inf, residual, None)
                if trial[0] < cost - 1e-9:
                    gain = cost - trial[0]
                    position = position + move
                    cost, residual, predicted = trial
                    jacobian, predicted = slopes_at(position, predicted)
                    damping = max(damping / 10.0, 1e-6)
                    improved = True
                    break
                if largest < 1e-6:
                    break
                refused = move
                damping *= 10.0
            if not improved or gain < (
                EXACT_SHARE * cost
                if exact
                else tuned.SMALLEST_DECREASE + tuned.SMALLEST_DECREASE_SHARE * cost
            ):
                break
            if iteration >= tuned.HOPELESS_AFTER and cost - tuned.HOPELESS_REACH * gain > hopeless:
                break
        if not np.isfinite(cost):
            raise ConvergenceError("diagnosis", "a hypothesis cannot be simulated at any of its parameters.")
        weight = np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(np.abs(residual), 1e-12))
        precision = jacobian.T @ (weight[:, None] * jacobian) + root.T @ root
        covariance = np.linalg.inv(precision)
        _, log_det = np.linalg.slogdet(precision)
        _, log_root = np.linalg.slogdet(root)
        # A prior that ends at bounds is so much denser between them.
        cut_off = -sum(float(np.log(norm.cdf(c.high) - norm.cdf(c.low))) for c in own)
        return Fit(
            tuple(candidates),
            coordinates,
            position,
            0.5 * (covariance + covariance.T),
            -0.5 * cost - 0.5 * log_det + log_root + cut_off,
            float(np.sum(huber(residual))),
            cost,
            residual,
            self.slow,
            evaluations,
        )


def huber(residual: Array) -> Array:
    """Square of a whitened residual, beyond ``OUTLIER_SIGMAS`` linear."""
    size = np.abs(residual)
    return np.where(size <= OUTLIER_SIGMAS, residual**2, 2.0 * OUTLIER_SIGMAS * size - OUTLIER_SIGMAS**2)


def _bounded_step(
    hessian: Array, gradient: Array, damping: float, position: Array, low: Array, high: Array
) -> Array:
    """Damped Newton step that stays within bounds: what would leave is held and the rest solved again."""
    free = np.ones(len(position), dtype=bool)
    move = np.zeros(len(position))
    for _ in range(len(position)):
        rows = np.flatnonzero(free)
        if rows.size == 0:
            break
        matrix = hessian[np.ix_(rows, rows)].copy()
        matrix[np.diag_indices_from(matrix)] *= 1.0 + damping
        held = np.flatnonzero(~free)
        right = gradient[rows] - hessian[np.ix_(rows, held)] @ move[held]
        move[rows] = np.linalg.solve(matrix, right)
        target = position + move
        outside = free & ((target < low) | (target > high))
        if not outside.any():
            break
        move[outside] = np.clip(target, low, high)[outside] - position[outside]
        free &= ~outside
    return move
