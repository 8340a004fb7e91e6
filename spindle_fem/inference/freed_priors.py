"""Fits about one in which a single direction's prior is given up for one many times as wide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.belief import THETA_BOUND, Belief, Coordinate
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.linearised_fit import Box, LinearProblem, bounded_minimum
from spindle_fem.inference.misdescription import Factored, Misdescription

Array = NDArray[np.float64]

# Width of the prior of what is wrong, in standard deviations of the one that is given up; of a factor no more
# than this many times, one standard deviation: beyond it readings often tell hardly anything.
WIDER, TIMES_OFF = 10.0, 10.0
# Misfit by which giving up one prior lowers a fit to first order, from which on it is fitted instead: three
# deviations. Numbers that are several times what a definition says are undervalued to first order.
FITTED_FROM = 9.0


@dataclass(frozen=True, slots=True)
class Freed:
    """Fits about one, to first order, each with the prior of one direction given up.

    Attributes
    ----------
    items : list of Misdescription
        Those that are free in the fit and belong to the machine.
    rows : list of int
        Their coordinates.
    misfit : (n,) ndarray
        What the cost falls by.
    position : (n,) ndarray
        Where each goes, in deviations of its prior.
    widths : (n,) ndarray
        Of the priors that take the place of those given up, likewise.
    """

    items: list[Misdescription]
    rows: list[int]
    misfit: Array
    position: Array
    widths: Array

    @classmethod
    def of(cls, problem: Problem, null: Fit, directions: Sequence[Misdescription]) -> Freed:
        """About a fit of that problem."""
        belief = problem.belief
        names = [c.name for c in belief.coordinates]
        items = [
            item
            for item in directions
            if item.recording is None and not item.of_sensor and item.coordinate in names
        ]
        rows = [names.index(item.coordinate) for item in items]
        box = LinearProblem.about(problem, null).box
        settled, _ = _least(box)
        freed = [_least(_freed(box, belief, null, row)) for row in rows]
        misfit = [settled - cost for cost, _ in freed]
        position = [null.position[row] + move[row] for row, (_, move) in zip(rows, freed, strict=True)]
        widths = [_width(belief.coordinates[row]) for row in rows]
        return cls(items, rows, np.array(misfit), np.array(position), np.array(widths))

    def fitted(self, problem: Problem, null: Fit) -> Freed:
        """Those that explain much fitted as factors of the model, which hold far off, not to first order."""
        misfit, position = self.misfit.copy(), self.position.copy()
        for k, (item, row) in enumerate(zip(self.items, self.rows, strict=True)):
            change = item.change
            if not isinstance(change, Factored) or misfit[k] < FITTED_FROM:
                continue
            belief = without_prior(problem.belief, row)
            factor = replace(belief.coordinates[row], name=change.parameter, value=1.0, logarithmic=True)
            before, after = belief.coordinates[:row], belief.coordinates[row + 1 :]
            freed = replace(problem, belief=replace(belief, coordinates=(*before, factor, *after)))
            begin = null.values | {factor.name: factor.at(position[k])}
            own = freed.simulated(null.candidates, begin)
            if own is not None:
                misfit[k] = null.misfit_with_prior - own.misfit_with_prior
                position[k] = change.of_factor(own.values[factor.name]) / item.sigma
        return replace(self, misfit=misfit, position=position)

    def only(self, wanted: Sequence[Misdescription]) -> Freed:
        """Some of them."""
        kept = [k for k, item in enumerate(self.items) if item in wanted]
        items, rows = ([own[k] for k in kept] for own in (self.items, self.rows))
        return Freed(items, rows, self.misfit[kept], self.position[kept], self.widths[kept])


def without_prior(belief: Belief, row: int) -> Belief:
    """The belief with many more standard deviations of one coordinate, and bounds as much wider."""
    unit = np.zeros(len(belief.mean))
    unit[row] = _width(belief.coordinates[row])
    covariance = np.linalg.inv(belief.root.T @ belief.root) + np.outer(unit, unit)
    precision = np.linalg.inv(covariance)
    root = np.linalg.cholesky(0.5 * (precision + precision.T)).T
    coordinates = list(belief.coordinates)
    low, high = _wider(coordinates[row])
    coordinates[row] = replace(coordinates[row], low=low, high=high)
    return replace(belief, coordinates=tuple(coordinates), root=root)


def _least(box: Box) -> tuple[float, Array]:
    """Least cost within a box, and the move to it."""
    move = bounded_minimum(box.hessian, box.downhill, box.low, box.high)
    return box.cost + float(move @ (box.hessian @ move)) - 2.0 * float(box.downhill @ move), move


def _width(coordinate: Coordinate) -> float:
    """Width of the prior that takes the place of one given up, in deviations of that."""
    return min(WIDER, float(np.log(TIMES_OFF)) / coordinate.sigma) if coordinate.logarithmic else WIDER


def _wider(coordinate: Coordinate) -> tuple[float, float]:
    """Bounds of a coordinate whose prior is given up; those that have another reason stay."""
    bound = THETA_BOUND * _width(coordinate)
    low = -bound if coordinate.low <= -THETA_BOUND else coordinate.low
    return low, bound if coordinate.high >= THETA_BOUND else coordinate.high


def _freed(box: Box, belief: Belief, null: Fit, row: int) -> Box:
    """A box about a fit with the prior of one coordinate given up, as :func:`without_prior` has it."""
    precision = belief.root.T @ belief.root
    departure = null.position[: len(precision)] - belief.mean
    less = np.outer(precision[row], precision[row]) / (
        precision[row, row] + _width(belief.coordinates[row]) ** -2
    )
    hessian, downhill = box.hessian.copy(), box.downhill.copy()
    hessian[: len(less), : len(less)] -= less
    downhill[: len(less)] += less @ departure
    low, high = box.low.copy(), box.high.copy()
    least, most = _wider(belief.coordinates[row])
    low[row], high[row] = least - null.position[row], most - null.position[row]
    cost = box.cost - float(departure @ less @ departure)
    return replace(box, hessian=hessian, downhill=downhill, low=low, high=high, cost=cost)
