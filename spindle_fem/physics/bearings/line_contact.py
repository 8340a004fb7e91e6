"""Contact of a roller with a raceway: width, pressure, approach, film and heat path of a line contact."""

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


def film_minimum_dowson_higginson(
    speed_group: ArrayLike, material_group: ArrayLike, load_group: ArrayLike
) -> FloatArray:
    """Minimum film of a line contact over its radius, isothermal and flooded.

    Parameters
    ----------
    speed_group, material_group, load_group : array_like, [-]
        As :func:`~spindle_fem.physics.bearings.lubricant_film.film_groups` gives them, with the load on
        the contact's length times its radius.

    Source: Dowson (1968), Proc. Instn Mech. Engrs 182 3A; Harris & Kotzalas, vol. 2.

    >>> film = film_minimum_dowson_higginson(1e-11, 5000.0, 3e-5)
    >>> round(float(film) * 1e5, 2)
    2.04
    """
    film = 2.65 * np.power(speed_group, 0.70) * np.power(material_group, 0.54)
    return film * np.power(load_group, -0.13)


def film_central_dowson_toyoda(
    speed_group: ArrayLike, material_group: ArrayLike, load_group: ArrayLike
) -> FloatArray:
    """Central film of a line contact over its radius; parameters as of the minimum film.

    Source: Dowson & Toyoda (1979), 5th Leeds-Lyon Symposium; Harris & Kotzalas, vol. 2.
    """
    film = 3.06 * np.power(speed_group, 0.69) * np.power(material_group, 0.56)
    return film * np.power(load_group, -0.10)


def ring_constriction(
    half_width: ArrayLike, half_spacing: ArrayLike, length: float, thermal_conductivity: float
) -> FloatArray:
    """Resistance in a ring between its whole raceway and the strip under one of its rollers, K/W.

    ln(1/sin(π b/2c)) / (π k L): isothermal strips of half width b, 2c apart, on a thick body.

    Parameters
    ----------
    half_width, half_spacing : array_like, [m]
    length : float, [m]
    thermal_conductivity : float, [W/(m K)]

    Source: Veziroglu & Chandra (1969); Bejan & Kraus, Heat Transfer Handbook, ch. 4.

    Strips that touch leave none:

    >>> abs(float(ring_constriction(1e-3, 1e-3, 1e-2, 46.0)))
    0.0
    """
    share = np.sin(0.5 * np.pi * np.asarray(half_width, float) / np.asarray(half_spacing, float))
    return -np.log(share) / (np.pi * thermal_conductivity * length)


def half_roller_resistance(
    half_width: ArrayLike, diameter: float, length: float, thermal_conductivity: float
) -> FloatArray:
    """Resistance of a roller from the strip that it touches to its middle, K/W.

    ln(2D/b) / (π k L): half of a cylinder between opposite isothermal strips of half width b.

    Source: Yovanovich, in Bejan & Kraus, Heat Transfer Handbook, ch. 4.
    """
    strip = np.asarray(half_width, float)
    return np.log(2.0 * diameter / strip) / (np.pi * thermal_conductivity * length)


def wedge_conductance(
    gap: ArrayLike, radius: ArrayLike, length: float, thermal_conductivity: float
) -> FloatArray:
    """Conductance of lubricant at rest between a cylinder and a wall that it does not touch, W/K.

    k L times the integral of 1/(h + x²/2R): π √(2R/h) k L.

    Parameters
    ----------
    gap : array_like, [m]
        h, where cylinder and wall are nearest.
    radius : array_like, [m]
        As of :func:`half_width`.
    """
    nearest = np.asarray(gap, float)
    slenderness = np.sqrt(2.0 * np.asarray(radius, float) / nearest)
    return np.pi * slenderness * thermal_conductivity * length
