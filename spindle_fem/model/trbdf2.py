"""The TR-BDF2 scheme: its constants and the algebra of a step, for any model ``C u' = F(t, u)``.

One step of length h from ``u₀``, with ``γ = 2 − √2``, ``d = γ/2``, ``w = √2/4`` and the net heats
``F₀, F₁, F₂`` at its start, its inner time ``γ h`` and its end:

    C (u₁ − u₀) = h d (F₀ + F₁)
    C (u₂ − u₀) = h (w F₀ + w F₁ + d F₂)

Both stages have the matrix ``C + h d K`` where ``F = f − K u``; the scheme is of second order and
L-stable, and an embedded third-order quadrature gives the error of each step. Eliminating ``F₀`` and
``F₁`` turns the second stage into the BDF2 form ``C (u₂ − a u₁ + b u₀) = h d F₂``.

Heat stored = heat in − heat out holds exactly with ``WEIGHTS`` as the quadrature.

Sources: Bank et al. (1985), IEEE Trans. CAD 4, 436-451; error estimate: Hosea & Shampine (1996),
Appl. Numer. Math. 20, 21-37.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Value = TypeVar("Value", float, NDArray[np.float64])

# Inner time of a step, relative to its length.
GAMMA = 2.0 - np.sqrt(2.0)
# Weight of a stage's own heat, the same in both stages.
DIAGONAL = GAMMA / 2.0
# Weight of the heats at the start and at the inner time in the second stage.
OUTER_WEIGHT = np.sqrt(2.0) / 4.0
# Quadrature of the whole step: heats at its start, inner time and end.
WEIGHTS = np.array([OUTER_WEIGHT, OUTER_WEIGHT, DIAGONAL])
# Third-order quadrature on the same three heats.
EMBEDDED = np.array([(1.0 - OUTER_WEIGHT) / 3.0, (3.0 * OUTER_WEIGHT + 1.0) / 3.0, DIAGONAL / 3.0])
# Coefficients a and b of the BDF2 form of the second stage.
STAGE_WEIGHT = 1.0 / (GAMMA * (2.0 - GAMMA))
START_WEIGHT = (1.0 - GAMMA) ** 2 / (GAMMA * (2.0 - GAMMA))


def right_of_middle(stored: Value, step: float, first: Value) -> Value:
    """Known side of the first stage ``(C + h d K) u₁ = C u₀ + h d F₀ + h d f₁``, without ``f₁``, [J].

    Parameters
    ----------
    stored : (n,) ndarray, [J]
        ``C u₀``.
    step : float, [s]
    first : (n,) ndarray, [W]
        ``F₀``.
    """
    return stored + step * DIAGONAL * first


def right_of_end(stored: Value, step: float, first: Value, middle: Value) -> Value:
    """Known side of the second stage, without its own load, [J]; see :func:`right_of_middle`."""
    return stored + step * OUTER_WEIGHT * (first + middle)


def error_defect(step: float, rates: tuple[Value, Value, Value]) -> Value:
    """Embedded minus used quadrature of the three heats, [J].

    Solved with the step's matrix it is the estimated error of ``u₂``; the matrix keeps it bounded
    for stiff modes.
    """
    return step * sum(
        (embedded - weight) * rate for embedded, weight, rate in zip(EMBEDDED, WEIGHTS, rates, strict=True)
    )


def extrapolated(places: Sequence[float], values: Sequence[Value], at: float) -> Value:
    """The polynomial through values at some places, at another place: a first guess of a stage.

    >>> extrapolated((0.0, 1.0), (1.0, 3.0), 2.0)
    5.0
    >>> extrapolated((0.0, 1.0, 3.0), (0.0, 1.0, 9.0), 4.0)
    16.0
    """
    weights = [
        np.prod([(at - other) / (place - other) for other in places if other != place]) for place in places
    ]
    return sum(float(weight) * value for weight, value in zip(weights, values, strict=True))


def interpolate_step(place: Value, start: Value, middle: Value, end: Value) -> Value:
    """The parabola through a step's start, inner time and end, at ``place`` of its length (0 to 1).

    >>> round(float(interpolate_step(0.5, 0.0, GAMMA**2, 1.0)), 12)
    0.25
    """
    return (
        start * (place - GAMMA) * (place - 1.0) / GAMMA
        + middle * place * (place - 1.0) / (GAMMA * (GAMMA - 1.0))
        + end * place * (place - GAMMA) / (1.0 - GAMMA)
    )
