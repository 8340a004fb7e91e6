"""Tables of friction over ring temperatures, fits and loads, by bearing mechanics, with interpolation.

Friction depends on four numbers: by how much the inner rings are warmer than the outer ones, the
gap that temperatures alone leave between outer rings and housing (negative: interference), the
speed, and the thrust, which loads some bearings of a set and relieves others. Whatever the housing does to
the set it does through that gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import NdBSpline, make_interp_spline

Array = NDArray[np.float64]
CUBIC, LINEAR = 3, 1


@dataclass(frozen=True, eq=False)
class PreloadResponse:
    """Friction of the bearings of one set over ring difference, gap of the outer rings, speed and thrust.

    Attributes
    ----------
    bearings : tuple of str
    difference : (n_x,) ndarray, [K]
        Inner less outer rings.
    gap : (n_g,) ndarray, [m]
        Radial, of the outer rings in the housing, by temperatures alone.
    speed : (n_n,) ndarray, [rad/s]
    thrust : (n_t,) ndarray, [N]
        A single one where the set carries none.
    log_friction : (n_x, n_g, n_n, n_t, n_bearings) ndarray
        Logarithm of the friction.
    clearance, clearance_sigma : float, [m]
        Of the outer rings as assembled, on the diameter; how widely the fit's tolerance spreads it.
    assembly_temperature : float, [K]
    outer_ring : float, [m/K]
        How far a kelvin of the outer rings closes the gap.
    housing : mapping of place to float, [m/K]
        How far a kelvin of the growth of each seat in the housing opens it.
    shaft : mapping of place to float
        Share of what warm inner rings do that the growth of each seat on the shaft does, on which they are
        tight.
    reference_speed : float, [rad/s]
    reference_thrust : float, [N]
    """

    bearings: tuple[str, ...]
    difference: Array
    gap: Array
    speed: Array
    thrust: Array
    log_friction: Array
    clearance: float
    clearance_sigma: float
    assembly_temperature: float
    outer_ring: float
    housing: Mapping[str, float]
    shaft: Mapping[str, float]
    reference_speed: float
    reference_thrust: float

    @cached_property
    def _spline(self) -> NdBSpline:
        """Cubic between the points, over the logarithm of the speed; straight over the thrust."""
        axes, degrees = [self.difference, self.gap, np.log(self.speed)], [CUBIC] * 3
        values, knots = self.log_friction, []
        if len(self.thrust) > 1:
            axes, degrees = [*axes, self.thrust], [*degrees, LINEAR]
        else:
            values = values[:, :, :, 0]
        for axis, (points, degree) in enumerate(zip(axes, degrees, strict=True)):
            line = make_interp_spline(points, values, k=degree, axis=axis)
            # coefficients have the spline's axis first, whichever it went along
            values = np.moveaxis(line.c, 0, axis)
            knots.append(line.t)
        return NdBSpline(tuple(knots), values, tuple(degrees))

    def friction(
        self, difference: ArrayLike, gap: ArrayLike, speed: ArrayLike, thrust: ArrayLike
    ) -> NDArray[np.complex128]:
        """Logarithm of the friction, (n_bearings, k), with the derivatives that complex steps carry.

        Beyond the points of the mechanics it goes on along its tangent, over speed and thrust it stays.

        Parameters
        ----------
        difference, gap : (k,) array_like, [K] and [m]
            May be complex.
        speed, thrust : (k,) array_like, [rad/s] and [N]
        """
        given = np.broadcast_arrays(np.asarray(difference, complex), np.asarray(gap, complex), speed, thrust)
        asked = np.array([value.real for value in given], dtype=float)
        # Perturbations of one instant lie side by side and differ in their imaginary parts only.
        fresh = np.append(True, np.any(asked[:, 1:] != asked[:, :-1], axis=0))
        own = np.cumsum(fresh) - 1
        points = asked[:, fresh]
        inside = np.clip(points, self._ends[0], self._ends[1])
        inside[2] = np.log(inside[2])
        at = inside[: len(self._spline.t)].T
        rest = (0,) * (at.shape[1] - 2)
        value = self._spline(at)
        by_difference, by_gap = self._spline(at, nu=(1, 0, *rest)), self._spline(at, nu=(0, 1, *rest))
        beyond_difference, beyond_gap = (given[axis] - inside[axis][own] for axis in (0, 1))
        found = value[own] + by_difference[own] * beyond_difference[:, None]
        return (found + by_gap[own] * beyond_gap[:, None]).T

    @cached_property
    def _ends(self) -> Array:
        """Ends of the points, (2, 4, 1)."""
        axes = (self.difference, self.gap, self.speed, self.thrust)
        return np.array([[[axis[end]] for axis in axes] for end in (0, -1)])

    def log_ratio(
        self,
        difference: ArrayLike,
        closed: ArrayLike,
        clearance: ArrayLike,
        speed: ArrayLike,
        thrust: ArrayLike,
    ) -> NDArray[np.complex128]:
        """Logarithm of every bearing's friction over that without differences, (n_bearings, k).

        Parameters
        ----------
        difference : (k,) array_like, [K]
        closed : (k,) array_like, [K]
            Of the outer rings over the housing, as :meth:`closing` gives it.
        clearance : (k,) array_like, [m]
            As assembled, on the diameter.
        speed, thrust : (k,) array_like, [rad/s] and [N]
            The thrust's share in the friction is there without differences, too.
        """
        cold = 0.5 * np.asarray(clearance)
        gap = cold - self.outer_ring * np.asarray(closed)
        still = np.zeros_like(np.asarray(difference, complex))
        return self.friction(difference, gap, speed, thrust) - self.friction(still, cold, speed, thrust)

    def spreading(self, inner: NDArray, shaft: NDArray) -> NDArray:
        """Kelvins of inner rings and shaft alike that do what these (k,) and seats on the shaft (n, k) do."""
        shares = np.array(list(self.shaft.values()))
        return (1.0 - shares.sum()) * inner + shares @ shaft

    def closing(self, outer: NDArray, housing: NDArray, share: ArrayLike = 1.0) -> NDArray:
        """Kelvins by which outer rings (k,) close their gap beyond what seats in the housing (n, k) open it.

        ``share`` is how much of its growth by temperatures and drawing the housing has.
        """
        opening = np.array(list(self.housing.values())) / self.outer_ring
        warmer = outer - self.assembly_temperature
        return warmer - share * (opening @ (housing - self.assembly_temperature))

    def increase(self, difference: float) -> float:
        """Mean increase of the friction at a ring difference (K), nominal clearance, reference point."""
        at = ([self.reference_speed], [self.reference_thrust])
        found = self.log_ratio([difference], [0.0], [self.clearance], *at)
        return float(np.exp(found.real).mean() - 1.0)

    def exponent(self, difference: float) -> float:
        """Power of the difference with which the set's friction grows at a difference (K)."""
        step = 1.0e-3
        more, less = (self.increase(difference * (1.0 + side * step)) for side in (1.0, -1.0))
        return float(np.log(more / less) / np.log((1.0 + step) / (1.0 - step)))
