"""Cost of a hypothesis over its coordinates, its derivatives, and steps within bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Belief, Coordinate, Departure
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.robust_size import huber, outlier_weight

Array = NDArray[np.float64]


class Readings(Protocol):
    """What a hypothesis is held against, as a problem has it: whitened data (n,), and what is known."""

    data: Array
    belief: Belief

    def whitened(self, on_grid: Sequence[Array]) -> Array:
        """Values (G + 1, c, ...) of every recording at the data."""

    def straight(self, candidates: Sequence[Candidate]) -> Mapping[str, Array]:
        """Derivatives of the data by coordinates on which nothing else depends, by their name."""

    def predict(
        self,
        candidates: Sequence[Candidate],
        coordinates: Sequence[Coordinate],
        position: Array,
        *,
        by: Sequence[int] | None = None,
        near: Sequence[Prediction] | None = None,
    ) -> list[Prediction]:
        """Every recording, with derivatives by some of the coordinates, by all when absent."""


@dataclass(frozen=True, slots=True)
class Point:
    """A hypothesis at one position, and how far that is from what was known."""

    position: Array
    cost: float
    residual: Array
    predicted: list[Prediction]
    apart: Departure


@dataclass(frozen=True, slots=True)
class Slopes:
    """Derivatives of a hypothesis at a point.

    Attributes
    ----------
    point : Point
    jacobian : (n, p) ndarray
        Of the whitened readings.
    pulled : (m, q) ndarray
        Of the departures from what was known, by the machine's ``q`` coordinates; the rest has a unit prior.
    predicted : list of Prediction
        With derivatives by the coordinates ``bent``, which readings follow along curves.
    kept : int
        Steps since they were worked out.
    """

    point: Point
    jacobian: Array
    pulled: Array
    predicted: list[Prediction]
    bent: list[int]
    scale: Array
    kept: int = 0

    def kept_at(self, point: Point) -> Slopes | None:
        """These derivatives with what the step to a point adds to them; None where they do not hold.

        Source of the update: Broyden (1965), Mathematics of Computation 19, 577-593.
        """
        move = point.position - self.point.position
        expected = self.jacobian @ move
        missed = self.point.residual - point.residual - expected
        holds = np.linalg.norm(missed) <= tuned.SLOPES_HOLD * np.linalg.norm(expected)
        if self.kept >= tuned.SLOPES_KEPT or not holds:
            return None
        jacobian = self.jacobian + np.outer(missed, move / (move @ move))
        predicted = [
            replace(item, sensitivity=old.sensitivity, tangents=old.tangents, columns=old.columns)
            for item, old in zip(point.predicted, self.predicted, strict=True)
        ]
        return replace(
            self,
            point=point,
            jacobian=jacobian,
            pulled=point.apart.slopes,
            predicted=predicted,
            kept=self.kept + 1,
        )

    def curvature(self, point: Point) -> Array:
        """Half the second derivatives of the cost, to first order of the readings, (p, p)."""
        rooted = np.sqrt(outlier_weight(point.residual))[:, None] * self.jacobian
        found = rooted.T @ rooted
        machine = self.pulled.shape[1]
        found[:machine, :machine] += self.pulled.T @ self.pulled
        rest = range(machine, len(found))
        found[rest, rest] += 1.0
        return found

    def downhill(self, point: Point) -> Array:
        """Minus half the gradient of the cost, (p,)."""
        machine = self.pulled.shape[1]
        found = self.jacobian.T @ (outlier_weight(point.residual) * point.residual)
        found[:machine] -= self.pulled.T @ point.apart.residual
        found[machine:] -= point.position[machine:]
        return found

    def predicted_after(self, move: Array) -> list[Prediction]:
        """Predictions after a step to first order."""
        return [item.moved((self.scale * move)[self.bent]) for item in self.predicted]


class Objective:
    """Cost of a hypothesis and its derivatives."""

    def __init__(
        self, problem: Readings, candidates: Sequence[Candidate], coordinates: Sequence[Coordinate]
    ) -> None:
        self.problem, self.candidates, self.coordinates = problem, candidates, coordinates
        self.evaluations = 0
        self._scale = np.array([c.sigma for c in coordinates])
        straight = problem.straight(candidates)
        self._bent = [index for index, c in enumerate(coordinates) if c.name not in straight]
        self._straight = {i: straight[c.name] for i, c in enumerate(coordinates) if c.name in straight}

    def at(self, position: Array, near: list[Prediction] | None) -> Point:
        """The hypothesis at a position; ``near`` are predictions that these begin from."""
        self.evaluations += 1
        problem, machine = self.problem, len(self.problem.belief.coordinates)
        predicted = problem.predict(self.candidates, self.coordinates, position, by=(), near=near)
        residual = problem.data - problem.whitened([p.temperature for p in predicted])
        apart = problem.belief.at(position[:machine])
        added = float(position[machine:] @ position[machine:])
        cost = float(np.sum(huber(residual))) + apart.cost + added
        return Point(position, cost, residual, predicted, apart)

    def slopes(self, point: Point, before: Slopes | None = None) -> Slopes:
        """Derivatives at a point; those ``before`` the step to it where it showed that they hold."""
        if before is not None and (kept := before.kept_at(point)) is not None:
            return kept
        predicted = self.problem.predict(
            self.candidates, self.coordinates, point.position, by=self._bent, near=point.predicted
        )
        jacobian = np.empty((len(self.problem.data), len(self.coordinates)))
        for index, column in self._straight.items():
            jacobian[:, index] = self._scale[index] * column
        jacobian[:, self._bent] = self.problem.whitened([p.sensitivity for p in predicted])
        return Slopes(point, jacobian, point.apart.slopes, predicted, self._bent, self._scale)


def bounded_step(
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
