"""Free numbers of a fit in units of their priors, and what is known of them before a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.prediction import Prediction

Array = NDArray[np.float64]

# Bound of the machine's coordinates, in prior deviations.
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
class GivenUp:
    """By how much earlier readings are predicted worse than by their own best fit.

    Attributes
    ----------
    misfit : float
        In their sum of squared whitened residuals.
    left : float
        In the mean square of single residuals over their noise.
    error : float
        In the mean square of residuals of means over bins over what noise is left in those.
    """

    misfit: float = 0.0
    left: float = 0.0
    error: float = 0.0


class Witness(Protocol):
    """Readings that speak of a machine's coordinates, wherever those are.

    Attributes
    ----------
    least : float
        Sum of squared residuals where they are fitted best.
    """

    least: float

    def residual(self, coordinates: Sequence[Coordinate], position: Array) -> tuple[Array, list[Prediction]]:
        """Whitened residuals (n,), and the predictions behind them."""

    def slopes(self, coordinates: Sequence[Coordinate], position: Array, near: list[Prediction]) -> Array:
        """Derivatives of the residuals by the coordinates, (n, p); ``near`` are the predictions there."""

    def given_up(self, coordinates: Sequence[Coordinate], position: Array) -> GivenUp:
        """By how much they are predicted worse than by their own best fit."""


@dataclass(frozen=True, slots=True)
class Belief:
    """Knowledge of the machine's own coordinates before the diagnosed recording.

    Attributes
    ----------
    mean : (p,) ndarray
    root : (p, p) ndarray
        ``rootᵀ root`` is the precision.
    earlier : Witness or None
        Readings that speak of the coordinates beside that, wherever they are.
    begin : (p,) ndarray or None
        Where a fit begins; at the mean when None.
    """

    coordinates: tuple[Coordinate, ...]
    mean: Array
    root: Array
    earlier: Witness | None = None
    begin: Array | None = None

    @classmethod
    def prior(cls, coordinates: Sequence[Coordinate]) -> Belief:
        """Belief from the definition alone."""
        return cls(tuple(coordinates), np.zeros(len(coordinates)), np.eye(len(coordinates)))

    @property
    def start(self) -> Array:
        """Where a fit begins, (p,)."""
        return self.mean if self.begin is None else self.begin

    def beside(self, number: int) -> tuple[Array, Array]:
        """Root of the precision (n, n) and mean (n,) of ``number`` coordinates that begin with these.

        The others have unit normal priors.
        """
        own = len(self.coordinates)
        root, mean = np.eye(number), np.zeros(number)
        root[:own, :own], mean[:own] = self.root, self.mean
        return root, mean

    def at(self, position: Array) -> Departure:
        """How far coordinates (p,) are from what is known of them."""
        own = self.root @ (position - self.mean)
        if self.earlier is None:
            return Departure(self, position, own)
        rest, predicted = self.earlier.residual(self.coordinates, position)
        return Departure(self, position, np.concatenate((own, rest)), predicted)


@dataclass(frozen=True, slots=True)
class Departure:
    """Coordinates beside what is known of them.

    Attributes
    ----------
    residual : (m,) ndarray
        Whose squares are the cost.
    predicted : list of Prediction
        Of the earlier readings.
    """

    belief: Belief
    position: Array
    residual: Array
    predicted: list[Prediction] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Sum of squares, less what the earlier readings leave where they are fitted best."""
        earlier = self.belief.earlier
        return float(self.residual @ self.residual) - (0.0 if earlier is None else earlier.least)

    @property
    def slopes(self) -> Array:
        """Derivatives of the residual by the coordinates, (m, p)."""
        known = self.belief
        if known.earlier is None:
            return known.root
        return np.vstack((known.root, known.earlier.slopes(known.coordinates, self.position, self.predicted)))

    def local(self, slopes: Array) -> Belief:
        """The belief about the position, in which earlier readings are normal with these slopes (m, p)."""
        known = self.belief
        if known.earlier is None:
            return known
        # The prior among the residuals keeps the normal equations well conditioned.
        precision = slopes.T @ slopes
        mean = self.position - np.linalg.solve(precision, slopes.T @ self.residual)
        return Belief(known.coordinates, mean, np.linalg.cholesky(precision).T)
