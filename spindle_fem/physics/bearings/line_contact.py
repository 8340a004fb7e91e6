"""Contact of a roller with a raceway: width, pressure and approach of a line contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
# of the approach: 3.84e-5 mm of steel on steel for 1 N on 1 mm
_PALMGREN_FACTOR = 0.39
_LOAD_EXPONENT = 0.9
_LENGTH_EXPONENT = 0.8


def half_width(load: ArrayLike, length: float, radius: ArrayLike, compliance: float) -> FloatArray:
    """Half the width of the strip that two parallel cylinders touch on, m.

    Parameters
    ----------
    load : array_like, [N]
    length : float, [m]
    radius : array_like, [m]
        1 / (1/R1 + 1/R2), a hollow cylinder negative.
    compliance : float, [1/Pa]
        (1-ν1²)/E1 + (1-ν2²)/E2.

    Source: Hertz 1881; K. L. Johnson, Contact Mechanics, eq. 4.43.
    """
    force = np.asarray(load, float)
    return np.sqrt(4.0 * force * np.asarray(radius, float) * compliance / (np.pi * length))


def line_pressure(load: ArrayLike, length: float, radius: ArrayLike, compliance: float) -> FloatArray:
    """Hertz pressure in the middle of the strip, Pa; 0 without load. Parameters as of :func:`half_width`.

    Source: K. L. Johnson, Contact Mechanics, eq. 4.45.
    """
    force = np.asarray(load, float)
    return np.sqrt(force / (np.pi * length * np.asarray(radius, float) * compliance))


def line_approach(load: ArrayLike, length: float, compliance: float) -> FloatArray:
    """Approach of roller and ring, each as a body far from the strip, m. Parameters as of :func:`half_width`.

    Unlike the strip, the approach of long cylinders depends on the bodies; this
    is Palmgren's law measured on rollers with relieved ends.

    Source: Palmgren, Grundlagen der Wälzlagertechnik, 3rd ed. (1964); Harris & Kotzalas, vol. 1.

    Steel, 1 N on 1 mm, in units of 1e-5 mm:

    >>> round(float(line_approach(1.0, 1e-3, 2 * (1 - 0.3**2) / 206e9)) * 1e8, 2)
    3.84
    """
    force = np.asarray(load, float)
    # dimensional: newton and millimetre
    softness = (4e6 * compliance * force) ** _LOAD_EXPONENT
    return 1e-3 * _PALMGREN_FACTOR * softness / (1e3 * length) ** _LENGTH_EXPONENT


def load_of_approach(approach: ArrayLike, length: float, compliance: float) -> FloatArray:
    """Load that brings roller and ring together by an approach [m], N; 0 across a gap."""
    closed = np.maximum(np.asarray(approach, float), 0.0)
    return (closed / line_approach(1.0, length, compliance)) ** (1.0 / _LOAD_EXPONENT)
