"""Tables of friction over ring temperatures and fits, computed by bearing mechanics, with interpolation.

Friction depends on three numbers: by how much the inner rings are warmer than the outer ones, the
gap that temperatures alone leave between outer rings and housing (negative: interference), and the
speed. Whatever the housing does to the set it does through that gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import NdBSpline, make_interp_spline

Array = NDArray[np.float64]
CUBIC = 3


@dataclass(frozen=True, eq=False)
class PreloadResponse:
    """Friction of the bearings of one set over ring difference, gap of the outer rings and speed.

    Attributes
    ----------
    bearings : tuple of str
    difference : (n_x,) ndarray, [K]
        Inner less outer rings.
    gap : (n_g,) ndarray, [m]
        Radial, of the outer rings in the housing, by temperatures alone.
    speed : (n_n,) ndarray, [rad/s]
    log_friction : (n_x, n_g, n_n, n_bearings) ndarray
        Logarithm of the friction.
    clearance, clearance_sigma : float, [m]
        Of the outer rings as assembled, on the diameter; how widely the fit's tolerance spreads it.
    assembly_temperature : float, [K]
    outer_ring : float, [m/K]
        How far a kelvin of the outer rings closes the gap.
    housing : mapping of place to float, [m/K]
        How far a kelvin of each part of the housing opens it.
    reference_speed : float, [rad/s]
    """

    bearings: tuple[str, ...]
    difference: Array
    gap: Array
    speed: Array
    log_friction: Array
    clearance: float
    clearance_sigma: float
    assembly_temperature: float
    outer_ring: float
    housing: Mapping[str, float]
    reference_speed: float

    @cached_property
    def _spline(self) -> NdBSpline:
        """Cubic between the points, over the logarithm of the speed."""
        axes = (self.difference, self.gap, np.log(self.speed))
        values, knots = self.log_friction, []
        for axis, points in enumerate(axes):
            line = make_interp_spline(points, values, k=CUBIC, axis=axis)
            # coefficients have the spline's axis first, whichever it went along
            values = np.moveaxis(line.c, 0, axis)
            knots.append(line.t)
        return NdBSpline(tuple(knots), values, CUBIC)

    def friction(self, difference: ArrayLike, gap: ArrayLike, speed: ArrayLike) -> NDArray[np.complex128]:
        """Logarithm of the friction, (n_bearings, k), with the derivatives that complex steps carry.

        Beyond the points of the mechanics it goes on along its tangent, over the speed it stays.

        Parameters
        ----------
        difference, gap : (k,) array_like, [K] and [m]
            May be complex.
        speed : (k,) array_like, [rad/s]
        """
        given = np.broadcast_arrays(np.asarray(difference, complex), np.asarray(gap, complex), speed)
        asked = np.array([value.real for value in given], dtype=float)
        # Perturbations of one instant lie side by side and differ in their imaginary parts only.
        fresh = np.append(True, np.any(asked[:, 1:] != asked[:, :-1], axis=0))
        own = np.cumsum(fresh) - 1
        points = asked[:, fresh]
        inside = np.clip(points, self._ends[0], self._ends[1])
        at = np.stack((inside[0], inside[1], np.log(inside[2])), axis=1)
        value = self._spline(at)
        by_difference, by_gap = self._spline(at, nu=(1, 0, 0)), self._spline(at, nu=(0, 1, 0))
        beyond_difference, beyond_gap = (given[axis] - inside[axis][own] for axis in (0, 1))
        found = value[own] + by_difference[own] * beyond_difference[:, None]
        return (found + by_gap[own] * beyond_gap[:, None]).T

    @cached_property
    def _ends(self) -> Array:
        """Ends of the points, (2, 3, 1)."""
        axes = (self.difference, self.gap, self.speed)
        return np.array([[[axis[end]] for axis in axes] for end in (0, -1)])

    def log_ratio(
        self, difference: ArrayLike, closed: ArrayLike, clearance: ArrayLike, speed: ArrayLike
    ) -> NDArray[np.complex128]:
        """Logarithm of every bearing's friction over that without differences, (n_bearings, k).

        Parameters
        ----------
        difference : (k,) array_like, [K]
        closed : (k,) array_like, [K]
            Of the outer rings over the housing, as :meth:`closing` gives it.
        clearance : (k,) array_like, [m]
            As assembled, on the diameter.
        """
        cold = 0.5 * np.asarray(clearance)
        gap = cold - self.outer_ring * np.asarray(closed)
        still = np.zeros_like(np.asarray(difference, complex))
        return self.friction(difference, gap, speed) - self.friction(still, cold, speed)

    def closing(self, outer: NDArray, housing: NDArray) -> NDArray:
        """Kelvins by which outer rings (k,) close their gap beyond what the housing (n, k) opens it."""
        opening = np.array(list(self.housing.values())) / self.outer_ring
        return outer - self.assembly_temperature - opening @ (housing - self.assembly_temperature)

    def increase(self, difference: float) -> float:
        """Mean increase of the friction at a ring difference (K), nominal clearance, reference speed."""
        found = self.log_ratio([difference], [0.0], [self.clearance], [self.reference_speed])
        return float(np.exp(found.real).mean() - 1.0)

    def exponent(self, difference: float) -> float:
        """Power of the difference with which the set's friction grows at a difference (K)."""
        step = 1.0e-3
        more, less = (self.increase(difference * (1.0 + side * step)) for side in (1.0, -1.0))
        return float(np.log(more / less) / np.log((1.0 + step) / (1.0 - step)))
