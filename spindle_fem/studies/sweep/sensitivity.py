"""Importance of parameters: shares of the variance of an output, and designs near a given one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from spindle_fem.studies.sweep.designs import Axis
from spindle_fem.studies.sweep.results_table import OK, Row

Array = NDArray[np.float64]
SOBOL_POINTS = 1024
# A response surface that predicts left-out designs worse than this says nothing about sensitivities.
LEAST_PREDICTION = 0.8


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Shares of the variance of one output over the design space.

    Attributes
    ----------
    first : tuple of float
        Share that each parameter makes alone.
    total : tuple of float
        Share that vanishes where it is held, with its interactions.
    slope : tuple of float or None
        Mean change of the output from the lower to the upper end of each
        parameter; None for words.
    method : str
        How they were found.
    prediction : float
        Share of the variance that the response surface predicts of designs
        left out; 1 for a whole grid, which needs none.
    """

    output: str
    paths: tuple[str, ...]
    first: tuple[float, ...]
    total: tuple[float, ...]
    slope: tuple[float | None, ...]
    method: str
    prediction: float


def sensitivities(axes: Sequence[Axis], rows: Sequence[Row], outputs: Sequence[str]) -> list[Sensitivity]:
    """Sensitivity of every numeric output that varies.

    A whole grid is decomposed exactly; of a sample a quadratic response
    surface is, where it predicts left-out designs.

    Source: Saltelli et al. (2010), Comput. Phys. Commun. 181, 259-270 (estimator of
    ``scipy.stats.sobol_indices``); Allen (1974), Technometrics 16, 125-127 (left-out prediction).
    """
    solved = [row for row in rows if row["status"] == OK]
    varying = [axis for axis in axes if len({row[axis.path] for row in solved}) > 1]
    found = []
    for output in outputs:
        values = [row[output] for row in solved]
        if not varying or any(not isinstance(value, (int, float)) for value in values):
            continue
        response = np.array(values, dtype=np.float64)
        if np.ptp(response) <= 1e-9 * max(1.0, float(np.abs(response).max())):
            continue
        one = _of_grid(varying, solved, response) or _of_sample(varying, solved, response)
        if one is not None:
            first, total, method, prediction = one
            slope = tuple(_slope(axis, solved, response) for axis in varying)
            paths = tuple(axis.path for axis in varying)
            found.append(Sensitivity(output, paths, first, total, slope, method, prediction))
    return found


def _levels(axis: Axis, rows: Sequence[Row]) -> tuple[list[Any], NDArray[np.int64]]:
    levels = sorted({row[axis.path] for row in rows}, key=lambda value: (isinstance(value, str), value))
    return levels, np.array([levels.index(row[axis.path]) for row in rows])


def _of_grid(axes: Sequence[Axis], rows: Sequence[Row], response: Array) -> tuple[Any, ...] | None:
    """Exact decomposition where every combination of levels is there once."""
    levels = [_levels(axis, rows) for axis in axes]
    shape = tuple(len(values) for values, _ in levels)
    if int(np.prod(shape)) != len(rows):
        return None
    flat = np.ravel_multi_index([index for _, index in levels], shape)
    if len(set(flat.tolist())) != len(rows):
        return None
    cube = np.empty(len(rows))
    cube[flat] = response
    cube = cube.reshape(shape)
    variance = cube.var()
    first, total = [], []
    for position in range(len(axes)):
        others = tuple(axis for axis in range(len(axes)) if axis != position)
        first.append(float(cube.mean(axis=others).var() / variance))
        total.append(float(cube.var(axis=position).mean() / variance))
    return tuple(first), tuple(total), "whole grid", 1.0


def _of_sample(axes: Sequence[Axis], rows: Sequence[Row], response: Array) -> tuple[Any, ...] | None:
    if any(isinstance(row[axis.path], str) for axis in axes for row in rows):
        return None
    points = scaled_points(axes, rows)
    terms = _quadratic(points)
    if len(rows) < 1.5 * terms.shape[1]:
        terms = _linear(points)
    if len(rows) < 1.5 * terms.shape[1]:
        return None
    make = _quadratic if terms.shape[1] > points.shape[1] + 1 else _linear
    coefficients, *_ = np.linalg.lstsq(terms, response, rcond=None)
    leverage = np.einsum("ij,ji->i", terms, np.linalg.pinv(terms))
    left_out = (response - terms @ coefficients) / np.maximum(1.0 - leverage, 1e-12)
    prediction = float(1.0 - (left_out**2).sum() / ((response - response.mean()) ** 2).sum())
    if prediction < LEAST_PREDICTION:
        return None
    unit = stats.uniform(loc=-1.0, scale=2.0)
    indices = stats.sobol_indices(
        func=lambda x: make(x.T) @ coefficients,
        n=SOBOL_POINTS,
        dists=[unit] * len(axes),
        rng=np.random.default_rng(1),
    )
    name = "quadratic response surface" if make is _quadratic else "linear response surface"
    first = tuple(float(value) for value in np.ravel(indices.first_order))
    return first, tuple(float(value) for value in np.ravel(indices.total_order)), name, prediction


def scaled_points(axes: Sequence[Axis], rows: Sequence[Row]) -> Array:
    """Parameters from -1 at their least to 1 at their largest value among rows; words by their order."""
    points = np.empty((len(rows), len(axes)))
    for column, axis in enumerate(axes):
        values = [row[axis.path] for row in rows]
        numbers = np.array(
            _levels(axis, rows)[1] if any(isinstance(v, str) for v in values) else values, dtype=float
        )
        span = np.ptp(numbers)
        points[:, column] = 2.0 * (numbers - numbers.min()) / span - 1.0 if span > 0.0 else 0.0
    return points


def _linear(points: Array) -> Array:
    return np.column_stack([np.ones(len(points)), points])


def _quadratic(points: Array) -> Array:
    first, second = np.triu_indices(points.shape[1])
    return np.column_stack([_linear(points), points[:, first] * points[:, second]])


def _slope(axis: Axis, rows: Sequence[Row], response: Array) -> float | None:
    if any(isinstance(row[axis.path], str) for row in rows):
        return None
    position = scaled_points([axis], rows)[:, 0]
    return float(2.0 * np.polyfit(position, response, 1)[0])


def neighbours(axes: Sequence[Axis], rows: Sequence[Row], of: Row, number: int) -> list[Row]:
    """Solved designs nearest to one, by the scaled distance of their parameters."""
    solved = [row for row in rows if row["status"] == OK]
    points = scaled_points(axes, solved)
    centre = next(index for index, row in enumerate(solved) if row["design"] == of["design"])
    distance = np.linalg.norm(points - points[centre], axis=1)
    order = [
        index for index in np.argsort(distance, kind="stable") if index != centre and distance[index] > 0.0
    ]
    return [solved[index] for index in order[:number]]
