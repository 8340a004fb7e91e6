"""What calibration recordings say of a machine's coordinates, wherever those are moved.

A posterior that is normal about the fit to a calibration holds in its neighbourhood only: a network whose
values are guesses can leave it along curved valleys in which that normal form forbids little and the readings
forbid much. So the readings themselves are asked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Coordinate, GivenUp
from spindle_fem.inference.coordinate_names import OF_ONE_RECORDING
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.input_sampling import error_over_noise, left_over_noise
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.robust_size import outlier_weight

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class EarlierReadings:
    """Calibration readings as a function of the coordinates that the machine keeps.

    Quantities of one recording (its start, its gaps, its clocks) are marginalised to first order about the
    fit, and what counts of an outlier is that of the fit. Residuals are divided by ``INTERVAL_WIDENING``: a
    model that is not exact has other best parameters in another duty.

    Attributes
    ----------
    problem : Problem
        The calibration, about whose fit this is.
    own : dict
        Fitted values of what belongs to its recordings.
    offset : (n,) ndarray
        What those fitted values do to the whitened readings.
    weight : (n,) ndarray
        Root of what each reading counts.
    modes, share : (n, k) and (k,) ndarray
        Directions in which what belongs to one recording moves the readings, and the share by which residuals
        in them count less.
    least : float
        Sum of squares at the fit.
    least_left : float
        What single readings leave at the fit, as :func:`left_over_noise` has it.
    least_error : float
        What is left at the fit, as :func:`error_over_noise` has it.
    columns : tuple of (b, k) ndarray
        What each quantity of one recording does to the means over bins of every observation, [K].
    fitted : (k,) ndarray
        Coordinates of those quantities at the fit.
    settled : (k, n) ndarray
        Their best coordinates by the whitened residuals about zero.
    straight : dict of str to (n,) ndarray
        What directions in which the machine may differ do, as it counts, by their coordinate.
    """

    problem: Problem
    own: dict[str, float]
    offset: Array
    weight: Array
    modes: Array
    share: Array
    least: float = 0.0
    least_left: float = 0.0
    least_error: float = 0.0
    columns: tuple[Array, ...] = ()
    fitted: Array = field(default_factory=lambda: np.zeros(0))
    settled: Array = field(default_factory=lambda: np.zeros((0, 0)))
    straight: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def about(cls, problem: Problem, fit: Fit) -> EarlierReadings:
        """From the fit of a calibration."""
        weight = np.sqrt(outlier_weight(fit.residual))
        rows = [i for i, c in enumerate(fit.coordinates) if c.name.startswith(OF_ONE_RECORDING)]
        predicted = problem.predict((), fit.coordinates, fit.position, by=rows)
        columns = problem.whitened([p.sensitivity for p in predicted])
        modes, size, turned = np.linalg.svd(weight[:, None] * columns, full_matrices=False)
        values = fit.values
        found = cls(
            problem,
            {fit.coordinates[i].name: values[fit.coordinates[i].name] for i in rows},
            columns @ fit.position[rows],
            weight,
            modes,
            1.0 - 1.0 / np.hypot(1.0, size),
            columns=tuple(
                item.at(predicted[item.recording].sensitivity[:, item.channel])
                for item in problem.observations
            ),
            fitted=fit.position[rows],
            settled=turned.T @ ((size / (1.0 + size**2))[:, None] * modes.T) * weight,
        )
        kept = [i for i in range(len(fit.coordinates)) if i not in set(rows)]
        own = [fit.coordinates[i] for i in kept]
        residual, predicted = found.residual(own, fit.position[kept])
        straight = {name: found._counted(column) for name, column in problem.straight(()).items()}
        left, error = found._left(predicted, values)
        return replace(
            found,
            least=float(residual @ residual),
            least_left=left,
            least_error=error,
            straight=straight,
        )

    def residual(self, coordinates: Sequence[Coordinate], position: Array) -> tuple[Array, list[Prediction]]:
        """Whitened residuals (n,) of the calibration for coordinates of the machine, and its predictions."""
        predicted = self._predicted(coordinates, position, (), None)
        whitened = self.problem.whitened([p.temperature for p in predicted])
        return self._counted(self.problem.data - whitened + self.offset), predicted

    def given_up(self, coordinates: Sequence[Coordinate], position: Array) -> GivenUp:
        """By how much these readings are predicted worse than by their own fit."""
        residual, predicted = self.residual(coordinates, position)
        values = {c.name: c.at(u) for c, u in zip(coordinates, position, strict=True)}
        left, error = self._left(predicted, values)
        return GivenUp(
            max(0.0, float(residual @ residual) - self.least),
            max(0.0, left**2 - self.least_left**2),
            max(0.0, error - self.least_error),
        )

    def _left(self, predicted: list[Prediction], factors: Mapping[str, float]) -> tuple[float, float]:
        """What single readings and means over bins leave where what belongs to one recording follows."""
        seen = self.problem.observations
        rest = self.problem.data - self.problem.whitened([p.temperature for p in predicted])
        moved = self.settled @ (rest + self.offset) - self.fitted
        readings = [
            item.at(predicted[item.recording].temperature[:, item.channel]) + own @ moved
            for item, own in zip(seen, self.columns, strict=True)
        ]
        left = left_over_noise(self.problem.predictor, seen, readings, factors)
        return left, error_over_noise(seen, readings)

    def slopes(self, coordinates: Sequence[Coordinate], position: Array, near: list[Prediction]) -> Array:
        """Derivatives of :meth:`residual` by the coordinates, (n, p)."""
        known = {c.name for c in self.problem.belief.coordinates}
        found = np.zeros((len(self.offset), len(coordinates)))
        bent = []
        for index, coordinate in enumerate(coordinates):
            if coordinate.name in self.straight:
                found[:, index] = -coordinate.sigma * self.straight[coordinate.name]
            elif coordinate.name in known and not coordinate.name.startswith(OF_ONE_RECORDING):
                bent.append(index)
        predicted = self._predicted(coordinates, position, bent, near)
        found[:, bent] = -self._counted(self.problem.whitened([p.sensitivity for p in predicted]))
        return found

    def _predicted(
        self,
        coordinates: Sequence[Coordinate],
        position: Array,
        by: Sequence[int],
        near: list[Prediction] | None,
    ) -> list[Prediction]:
        """Predictions of the calibration with what belongs to its recordings as it was fitted."""
        kept = [i for i, c in enumerate(coordinates) if not c.name.startswith(OF_ONE_RECORDING)]
        derived = [kept.index(i) for i in by]
        shared = [coordinates[i] for i in kept]
        return self.problem.predict((), shared, position[kept], by=derived, near=near, beside=self.own)

    def _counted(self, values: Array) -> Array:
        """Whitened values (n, ...) as they count: less where they may belong to one recording."""
        rows = self.weight.reshape(-1, *([1] * (values.ndim - 1)))
        values = rows * values
        inside = self.modes.T @ values
        less = self.share.reshape(-1, *([1] * (values.ndim - 1)))
        return (values - self.modes @ (less * inside)) / tuned.INTERVAL_WIDENING
