"""Analytic building blocks of the terms: smooth steps, powers, relaxation, parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.effects.framework.term import TermContext, TermParameter

Complex = NDArray[np.complex128]

RPM = np.pi / 30.0


def smooth_step(argument: ArrayLike) -> Complex:
    """Logistic function, 0 far below and 1 far above; analytic.

    >>> float(smooth_step(0.0).real)
    0.5
    """
    value = np.asarray(argument, dtype=complex)
    above = value.real > 0.0
    small = np.exp(np.where(above, -value, value))
    return np.where(above, 1.0, small) / (1.0 + small)


def softplus(argument: ArrayLike) -> Complex:
    """``ln(1 + e^x)``: 0 far below, x far above; analytic.

    >>> float(softplus(800.0).real)
    800.0
    """
    value = np.asarray(argument, dtype=complex)
    above = value.real > 0.0
    return np.log1p(np.exp(np.where(above, -value, value))) + np.where(above, value, 0.0)


def power(base: ArrayLike, exponent: ArrayLike) -> Complex:
    """``base^exponent`` for a base that is not negative; 0 at 0.

    >>> float(power(0.0, 0.5).real), float(power(4.0, 0.5).real)
    (0.0, 2.0)
    """
    value, exponent = np.broadcast_arrays(
        np.asarray(base, dtype=complex), np.asarray(exponent, dtype=complex)
    )
    positive = value.real > 0.0
    return np.where(positive, np.exp(exponent * np.log(np.where(positive, value, 1.0))), 0.0)


def relaxed(state: ArrayLike, target: ArrayLike, step: float, time_constant: ArrayLike) -> Complex:
    """First-order lag after a step towards a target that stays, exactly.

    >>> float(relaxed(0.0, 1.0, 10.0, 10.0).round(4).real)
    0.6321
    """
    target = np.asarray(target, dtype=complex)
    return target + (np.asarray(state) - target) * np.exp(-step / np.asarray(time_constant, dtype=complex))


def switched(time: ArrayLike, start: ArrayLike, end: ArrayLike, lag: ArrayLike, width: float) -> Complex:
    """First-order response to something that is on between two instants, with edges of a finite width.

    Without a width it is ``1 - e^(-(t - start)/lag)`` and after the end a decay with the same lag.

    Parameters
    ----------
    time, start, end, lag : array_like, [s]
    width : float, [s]
        Of the edges: those of a logistic step where the lag equals it.

    >>> float(switched(1.0e5, 0.0, 2.0e5, 100.0, 20.0).real)
    1.0
    """
    since_start = width * softplus((time - np.asarray(start, dtype=complex)) / width)
    since_end = width * softplus((time - np.asarray(end, dtype=complex)) / width)
    return np.exp(-since_end / lag) - np.exp(-since_start / lag)


def columns(context: TermContext) -> int:
    """Perturbations, or instants, that a context holds."""
    return context.temperatures.shape[-1]


def rows(context: TermContext, *values: ArrayLike) -> Complex:
    """Values as rows over the last axis, (n, k)."""
    width = columns(context)
    return np.array([np.broadcast_to(np.asarray(value, dtype=complex), (width,)) for value in values])


def repeated(context: TermContext, value: ArrayLike, number: int) -> Complex:
    """One row repeated several times, (number, k)."""
    return np.repeat(rows(context, value), number, axis=0)


def fluid_temperature(context: TermContext, fluid: str | float) -> ArrayLike:
    """Temperature of a fluid, of an input or constant, [K]."""
    return context.inputs[fluid] if isinstance(fluid, str) else fluid


def amplitude(
    name: str,
    sigma: float,
    unit: str = "",
    *,
    null: float = 0.0,
    low: float = 0.0,
    high: float = np.inf,
) -> TermParameter:
    """The parameter that switches an effect on: linear, nothing at ``null``, ``sigma`` its usual size."""
    return TermParameter(name, null, sigma, unit, logarithmic=False, low=low, high=high)


def shape(
    name: str, value: float, sigma: float, unit: str = "", *, low: float = 0.0, high: float = np.inf
) -> TermParameter:
    """A positive parameter of an effect's shape; ``sigma`` of its logarithm."""
    return TermParameter(name, value, sigma, unit, low=low, high=high)


def linear(
    name: str, value: float, sigma: float, unit: str = "", *, low: float = -np.inf, high: float = np.inf
) -> TermParameter:
    """A parameter of an effect's shape that may change sign or vanish."""
    return TermParameter(name, value, sigma, unit, logarithmic=False, low=low, high=high)


def factor(name: str, own_sigma: float | None, sigma: float = 0.5) -> TermParameter:
    """Factor on a machine's parameter: wider than the definition's own prior where it has one."""
    wide = sigma if own_sigma is None else max(sigma, 2.5 * own_sigma)
    return TermParameter(name, 1.0, wide, low=0.0)
