"""First-order lag, exact for straight lines between the stamps, and delay of readings at any stamps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicHermiteSpline

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]

# A lag below this share of the shortest step follows at once.
PROMPT = 1e-4


def first_order_lag(times: Array, values: ArrayLike, time_constant: ArrayLike) -> Complex:
    """``τ y' = x - y`` from ``y = x`` at the first stamp, x straight between the stamps.

    Parameters
    ----------
    times : (N,) ndarray, [s]
        Increasing, not uniform.
    values : (N, k) array_like
        May be complex.
    time_constant : (k,) or (N - 1, k) array_like, [s]
        Of the whole, or of every step. May be complex; 0 follows at once.

    Returns
    -------
    (N, k) ndarray

    >>> time = np.array([0.0, 3.0, 4.0, 60.0])
    >>> lagged = first_order_lag(time, 2.0 * time[:, None], np.array([5.0]))
    >>> bool(np.allclose(lagged[:, 0], 2.0 * (time - 5.0 * (1.0 - np.exp(-time / 5.0)))))
    True
    """
    x = np.asarray(values, dtype=complex)
    if len(times) < 2:
        return x.copy()
    step = np.diff(times)[:, None]
    tau = np.broadcast_to(np.asarray(time_constant, dtype=complex), (len(step), *x.shape[1:]))
    slope = np.diff(x, axis=0) / step
    prompt = tau.real <= PROMPT * step
    keep = np.where(prompt, 0.0, np.exp(-step / np.where(prompt, 1.0, tau)))
    # y = x - τ x' + decaying part, on every step.
    target = x[1:] - tau * slope
    gain = target - keep * (x[:-1] - tau * slope)
    return np.concatenate((x[:1], scan(keep, gain, x[0])))


def scan(keep: Complex, gain: Complex, first: Complex) -> Complex:
    """``y_i = keep_i y_(i-1) + gain_i`` by doubling, (N, k) from y_0 (k,).

    Source: Hillis & Steele (1986), Commun. ACM 29, 1170-1183.

    >>> scan(np.full((3, 1), 0.5), np.ones((3, 1)), np.zeros(1)).ravel()
    array([1.  , 1.5 , 1.75])
    """
    keep, gain = keep.copy(), gain.copy()
    gain[0] = gain[0] + keep[0] * first
    distance = 1
    while distance < len(gain):
        gain[distance:] = gain[distance:] + keep[distance:] * gain[:-distance]
        keep[distance:] = keep[distance:] * keep[:-distance]
        distance *= 2
    return gain


def delayed(times: Array, values: ArrayLike, shift: ArrayLike) -> Complex:
    """Values ``shift`` seconds earlier, on smooth curves; the ends go on as they are.

    Cubic between the stamps, with the slopes of parabolas through three of them: on straight lines a fit of a
    shift ends where it is a whole number of steps.

    Parameters
    ----------
    times : (N,) ndarray, [s]
    values : (N, k) array_like
    shift : (k,) array_like, [s]
        Positive: the reading is late.

    Returns
    -------
    (N, k) ndarray

    >>> time = np.arange(5.0)
    >>> delayed(time, time[:, None], np.array([0.5])).real.ravel()
    array([0. , 0.5, 1.5, 2.5, 3.5])
    """
    x = np.asarray(values, dtype=complex)
    late = np.broadcast_to(np.asarray(shift, dtype=complex), x.shape[1:])
    if len(times) < 2:
        return x.copy()
    found = np.empty_like(x)
    slopes = np.gradient(x, times, axis=0)
    for amount in np.unique(late.real):
        chosen = np.flatnonzero(late.real == amount)
        curve = CubicHermiteSpline(times, x[:, chosen], slopes[:, chosen])
        wanted = np.clip(times - amount, times[0], times[-1])
        inside = (wanted == times - amount)[:, None]
        found[:, chosen] = curve(wanted) - 1j * late[chosen].imag * np.where(inside, curve(wanted, 1), 0.0)
    return found
