"""Zeros of functions of one number, without loading scipy's optimisation before one is asked for."""

from __future__ import annotations

from collections.abc import Callable


def bracketed_root(
    function: Callable[[float], float], low: float, high: float, *, absolute: float, relative: float
) -> float:
    """Zero of a continuous function between two numbers at which its signs differ, by Brent's method.

    Parameters
    ----------
    absolute, relative : float
        How near: in the unit of the number, and as a share of it (at least 9e-16).

    Raises
    ------
    ValueError
        The signs at both ends are the same.

    >>> round(bracketed_root(lambda x: x * x - 2.0, 0.0, 2.0, absolute=1e-15, relative=1e-14), 12)
    1.414213562373
    """
    # half a second to load, a third of what ``check`` takes
    from scipy.optimize import brentq

    return float(brentq(function, low, high, xtol=absolute, rtol=relative))
