"""Points of a table's axes, set where straight lines between them need them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Shares of a range: first points, and the narrowest interval, where a jump is taken for one.
FIRST_POINTS = 5
NARROWEST = 1e-6
# Share of the largest of the first values below which no value counts for less.
LEAST_VALUE = 1e-2


def refined_axis(function: Callable[[float], Array], low: float, high: float, tolerance: ArrayLike) -> Array:
    """Points between which straight lines hold every value of a function.

    Intervals are halved until the values in their middle are those of the straight line.

    Parameters
    ----------
    function : callable
        Of a place on the axis, to values (n,).
    low, high : float
        Ends of the axis, among the points.
    tolerance : float or (n,) array_like, [-]
        Largest departure, as a share of the value at that place, or of a hundredth of the largest.

    Returns
    -------
    (m,) ndarray
        Increasing.

    >>> refined_axis(lambda x: np.array([1.0 + abs(x - 0.5)]), 0.0, 1.0, 1e-6).tolist()
    [0.0, 0.25, 0.5, 0.75, 1.0]
    """
    found = {float(x): function(float(x)) for x in np.linspace(low, high, FIRST_POINTS)}
    first = sorted(found)
    least = LEAST_VALUE * np.max(np.abs(list(found.values())), axis=0)
    left = list(pairwise(first))
    while left:
        begin, end = left.pop()
        middle = 0.5 * (begin + end)
        value = function(middle)
        between = 0.5 * (found[begin] + found[end])
        if np.all(np.abs(value - between) <= np.asarray(tolerance) * np.maximum(np.abs(value), least)):
            continue
        if end - begin <= 2.0 * NARROWEST * (high - low):
            continue
        found[middle] = value
        left += [(begin, middle), (middle, end)]
    return np.array(sorted(found))


def values_on(function: Callable[..., Array], axes: tuple[Array, ...]) -> Array:
    """Values (n, ..., m) of a function at every place of some axes.

    >>> axes = np.array([0.0, 1.0]), np.array([2.0, 4.0])
    >>> values_on(lambda x, y: np.array([x + y]), axes)[:, :, 0].tolist()
    [[2.0, 4.0], [3.0, 5.0]]
    """
    places = np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1).T
    values = np.array([function(*place) for place in places.tolist()])
    return values.reshape(*(axis.size for axis in axes), -1)
