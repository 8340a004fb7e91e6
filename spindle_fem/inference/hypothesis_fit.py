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
from scipy.special import ndtr

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.unrecorded import followed_name
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Belief, Coordinate
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX, NO_VALUES
from spindle_fem.inference.fit_objective import Objective, bounded_step
from spindle_fem.inference.observations import Observation
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import Absorbed, ChannelBins, SlowError, Whitener, whiteners_of
from spindle_fem.inference.robust_size import huber, outlier_weight

Array = NDArray[np.float64]

# Errors of what cannot be simulated: a share above one, a runaway.
NOT_SIMULATED = (ConvergenceError, OutOfValidityError, SpecError)
# Steps of a fit at most.
MOST_ITERATIONS = 30
# An exact fit ends with a step that lowers the misfit by less than this share: rounding comes next.
EXACT_SHARE = 1.0e-8
# Largest change of any coordinate in one step, in prior deviations.
LARGEST_MOVE = 2.0
FIRST_DAMPING = 1e-3


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
    known : Belief
        What was known of the machine before, as a normal distribution about the optimum.
    evaluations : int
        Number of predictions.
    others : tuple of Fit
        Less likely answers of the same set, at which fits from other starts ended.
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
    known: Belief
    evaluations: int = 0
    others: tuple[Fit, ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """Values by name."""
        return {c.name: c.at(u) for c, u in zip(self.coordinates, self.position, strict=True)}

    @property
    def keys(self) -> frozenset[tuple[str, str, int | None]]:
        """Effects with their places and recordings."""
        return frozenset(c.key for c in self.candidates)

    @property
    def named(self) -> tuple[Candidate, ...]:
        """Members that a set names: of heat that follows one recorded quantity at several spots, the largest.

        Places are known to the spots of a model. What follows one law at two of them enters between or
        around them.
        """
        values = self.values

        def largest_like(candidate: Candidate) -> Candidate:
            law = candidate.effect, followed_name(candidate)
            alike = [c for c in self.candidates if (c.effect, followed_name(c)) == law]
            return max(alike, key=lambda c: abs(values.get(c.amplitude, 0.0)))

        return tuple(c for c in self.candidates if not followed_name(c) or largest_like(c) is c)

    @property
    def named_keys(self) -> frozenset[tuple[str, str, int | None]]:
        """Effects with their places and recordings, of the members that are named."""
        return frozenset(c.key for c in self.named)

    @property
    def without_candidates(self) -> Fit:
        """The same machine with nothing missing; its misfit and evidence stay those of the fit."""
        size = len(self.known.coordinates)
        return replace(
            self,
            candidates=(),
            coordinates=self.coordinates[:size],
            position=self.position[:size],
            covariance=self.covariance[:size, :size],
        )

    @property
    def reduced_misfit(self) -> float:
        """Misfit for each datum."""
        return self.misfit / max(len(self.residual), 1)

    @property
    def stated_sigmas(self) -> Array:
        """Standard deviations as they are stated of the coordinates, in those of their priors, (n,).

        What the readings told beyond what was known counts less: a model that is not exact has other best
        parameters in another duty.
        """
        known = np.ones(len(self.position))
        machine = len(self.known.coordinates)
        known[:machine] = 1.0 / np.diag(np.linalg.inv(self.known.root.T @ self.known.root))
        told = np.maximum(1.0 / np.diag(self.covariance) - known, 0.0)
        return (known + told / tuned.INTERVAL_WIDENING**2) ** -0.5

    def interval(self, name: str, level_sigmas: float, sigmas: Array | None = None) -> tuple[float, float]:
        """Values at ``level_sigmas`` standard deviations to either side.

        Those of the posterior by default, or other ones of all coordinates, such as :attr:`stated_sigmas`.
        """
        sigmas = np.sqrt(np.diag(self.covariance)) if sigmas is None else sigmas
        index = next(i for i, c in enumerate(self.coordinates) if c.name == name)
        coordinate, spread = self.coordinates[index], level_sigmas * float(sigmas[index])
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
        self.whiteners = whiteners_of([item.bins for item in self.observations], self.slow)
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

    def absorbed(self, fit: Fit) -> Absorbed:
        """What the coordinates of a fit take up of an error of the temperatures."""
        predicted = self.predict(fit.candidates, fit.coordinates, fit.position)
        root, _ = fit.known.beside(len(fit.coordinates))
        warm = [item for item in self.observations if not item.bins.is_relative]
        return Absorbed(
            [item.at(predicted[item.recording].sensitivity[:, item.channel]) for item in warm], root
        )

    def predict(
        self,
        candidates: Sequence[Candidate],
        coordinates: Sequence[Coordinate],
        position: Array,
        *,
        by: Sequence[int] | None = None,
        near: Sequence[Prediction] | None = None,
        beside: Mapping[str, float] = NO_VALUES,
    ) -> list[Prediction]:
        """Every recording, with derivatives by some of the coordinates, by all when absent.

        ``near`` are predictions at a position that is near, which these begin from; ``beside`` are values
        of what is not among the coordinates.
        """
        values = {c.name: c.at(u) for c, u in zip(coordinates, position, strict=True)} | dict(beside)
        derived = coordinates if by is None else [coordinates[index] for index in by]
        names = [c.name for c in derived]
        scale = np.array([c.sigma for c in derived])
        found = []
        for number in range(len(self.predictor.recordings)):
            begun = None if near is None else near[number]
            prediction = self.predictor.predict(number, values, candidates, names, begun)
            found.append(replace(prediction, sensitivity=prediction.sensitivity * scale))
        return found

    def begins_better(self, fit: Fit, start: Mapping[str, float]) -> bool:
        """Whether values leave less of a set than its fit, which ended elsewhere."""
        try:
            return self.cost_at(fit.candidates, start) < fit.misfit_with_prior
        except NOT_SIMULATED:
            return False

    def cost_at(self, candidates: Sequence[Candidate], start: Mapping[str, float]) -> float:
        """Misfit of a set with its prior at values by name, without fitting any."""
        coordinates, position = self._begun(candidates, start)
        return Objective(self, candidates, coordinates).at(position, None).cost

    def averaged_misfit(self, fit: Fit) -> float:
        """Minus twice the logarithm of the likelihood of these readings given those of a fit, but a constant.

        Averaged over all values that the readings of the fit leave possible: what those do not tell must not
        count against a set. To second order about the fit (Laplace's method).
        """
        objective = Objective(self, fit.candidates, fit.coordinates)
        point = objective.at(fit.position, None)
        jacobian = objective.slopes(point).jacobian
        rooted = np.sqrt(outlier_weight(point.residual))[:, None] * jacobian
        before = np.linalg.inv(fit.covariance)
        precision = before + rooted.T @ rooted
        move = np.linalg.solve(precision, jacobian.T @ (outlier_weight(point.residual) * point.residual))
        left = float(np.sum(huber(point.residual - jacobian @ move))) + float(move @ before @ move)
        return left + float(np.linalg.slogdet(precision)[1] - np.linalg.slogdet(before)[1])

    def _begun(
        self, candidates: Sequence[Candidate], start: Mapping[str, float]
    ) -> tuple[tuple[Coordinate, ...], Array]:
        """Coordinates of a set, and the position of values by name within their bounds.

        What is known of the machine, and the candidates' nominal values, where a name is absent.
        """
        own = tuple(c for candidate in candidates for c in candidate_coordinates(candidate))
        coordinates = (*self.belief.coordinates, *own)
        position = np.concatenate((self.belief.start, np.zeros(len(own))))
        for index, coordinate in enumerate(coordinates):
            if coordinate.name in start:
                position[index] = coordinate.of(start[coordinate.name])
        return coordinates, np.clip(position, [c.low for c in coordinates], [c.high for c in coordinates])

    def simulated(
        self,
        candidates: Sequence[Candidate],
        start: Mapping[str, float],
        iterations: int = MOST_ITERATIONS,
    ) -> Fit | None:
        """A fit; None where the set cannot be simulated from there."""
        try:
            return self.fit(candidates, start, iterations=iterations)
        except NOT_SIMULATED:
            return None

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
        coordinates, position = self._begun(candidates, start or {})
        low = np.array([c.low for c in coordinates])
        high = np.array([c.high for c in coordinates])
        objective = Objective(self, candidates, coordinates)
        point = objective.at(position, None)
        slopes = objective.slopes(point)
        damping = FIRST_DAMPING
        for iteration in range(iterations):
            hessian, gradient = slopes.curvature(point), slopes.downhill(point)
            enough = EXACT_SHARE * point.cost
            if not exact:
                enough = tuned.SMALLEST_DECREASE + tuned.SMALLEST_DECREASE_SHARE * point.cost
            if iteration and np.isfinite(hopeless):
                whole = bounded_step(hessian, gradient, 0.0, point.position, low, high)
                promised = float(2.0 * gradient @ whole - whole @ hessian @ whole)
                if promised > 0.0 and point.cost - tuned.HOPELESS_REACH * promised > hopeless:
                    break
            gain, refused = 0.0, None
            while damping < 1e8:
                move = bounded_step(hessian, gradient, damping, point.position, low, high)
                largest = float(np.abs(move).max()) if move.size else 0.0
                if largest > LARGEST_MOVE:
                    move *= LARGEST_MOVE / largest
                if (
                    refused is not None
                    and np.abs(move - refused).max() < tuned.SAME_STEP_WITHIN * np.abs(refused).max()
                ):
                    damping *= 10.0
                    continue
                promised = float(2.0 * gradient @ move - move @ hessian @ move)
                if 0.0 <= promised <= enough:
                    break
                try:
                    trial = objective.at(point.position + move, slopes.predicted_after(move))
                except NOT_SIMULATED:
                    # A shorter step.
                    trial = None
                if trial is not None and trial.cost < point.cost - 1e-9:
                    gain = point.cost - trial.cost
                    point = trial
                    # What had to be damped more has to be damped as much in the next step.
                    damping = max(damping / 10.0, 1e-6) if refused is None else damping
                    break
                if largest < 1e-6:
                    break
                refused = move
                damping *= 10.0
            # A step that was taken gains more than nothing. The last one gains so little that the derivatives
            # before it serve: they say how certain all values are. Those of an earlier step may promise too
            # little.
            if gain <= enough:
                if not slopes.kept:
                    break
                slopes, damping = objective.slopes(point), FIRST_DAMPING
                continue
            if iteration >= tuned.HOPELESS_AFTER and point.cost - tuned.HOPELESS_REACH * gain > hopeless:
                break
            slopes = objective.slopes(point, None if exact else slopes)
        if not np.isfinite(point.cost):
            raise ConvergenceError("diagnosis", "a hypothesis cannot be simulated at any of its parameters.")
        precision = slopes.curvature(point)
        covariance = np.linalg.inv(precision)
        _, log_det = np.linalg.slogdet(precision)
        _, log_root = np.linalg.slogdet(self.belief.root)
        # A prior that ends at bounds is so much denser between them.
        own = coordinates[len(self.belief.coordinates) :]
        cut_off = -sum(float(np.log(ndtr(c.high) - ndtr(c.low))) for c in own)
        return Fit(
            tuple(candidates),
            coordinates,
            point.position,
            0.5 * (covariance + covariance.T),
            -0.5 * point.cost - 0.5 * log_det + log_root + cut_off,
            float(np.sum(huber(point.residual))),
            point.cost,
            point.residual,
            self.slow,
            point.apart.local(slopes.pulled),
            objective.evaluations,
        )
