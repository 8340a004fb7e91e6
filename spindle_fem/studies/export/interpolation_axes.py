"""Points of a table's axes, set where straight lines between them need them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Shares of a range: first points, and the narrowest interval, where a jump is taken for one.
FIRST_POINTS = 5
NARROWEST = 1e-6


def refined_axis(function: Callable[[float], Array], low: float, high: float, tolerance: float) -> Array:
    """Points between which straight lines hold every value of a function.

    Intervals are halved until the values in their middle are those of the straight line.

    Parameters
    ----------
    function : callable
        Of a place on the axis, to values (n,).
    low, high : float
        Ends of the axis, among the points.
    tolerance : float, [-]
        Largest departure, as a share of the value at that place.

    Returns
    -------
    (m,) ndarray
        Increasing.

    >>> refined_axis(lambda x: np.array([1.0 + abs(x - 0.5)]), 0.0, 1.0, 1e-6).tolist()
    [0.0, 0.25, 0.5, 0.75, 1.0]
    """
    found = {float(x): function(float(x)) for x in np.linspace(low, high, FIRST_POINTS)}
    first = sorted(found)
    left = list(pairwise(first))
    while left:
        begin, end = left.pop()
        middle = 0.5 * (begin + end)
        value = function(middle)
        between = 0.5 * (found[begin] + found[end])
        if np.all(np.abs(value - between) <= tolerance * np.abs(value)):
            continue
        if end - begin <= 2.0 * NARROWEST * (high - low):
            continue
        found[middle] = value
        left += [(begin, middle), (middle, end)]
    return np.array(sorted(found))
