"""Pressure of rings on their seats and gaps where they open, solved for all seats together.

Seats of one body yield together. With gap g and pressure p at every seat, g = g0 + M p, g ≥ 0, p ≥ 0 and
g p = 0: the separate bodies would leave gaps g0 (negative: overlap), M is their compliance. That is
the minimum of a convex energy, found by non-negative least squares.

Source: Johnson, Contact Mechanics (1985), section 5.4, for the complementary form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import nnls

Array = NDArray[np.float64]


class SeatPressures:
    """Pressures of seats that yield to each other in one way, whatever their gaps without pressure.

    The answer is unique, so that the seats that were tight last are tried first.

    Parameters
    ----------
    compliance : (n, n) ndarray, [m/Pa]
        Opening of each gap by a pressure in each seat.
    areas : (n,) ndarray, [m²]
    """

    def __init__(self, compliance: Array, areas: Array) -> None:
        self.compliance, self.areas = compliance, areas
        # Work of the pressures on the gaps is symmetric: area times compliance.
        energy = areas[:, None] * compliance
        self._energy = 0.5 * (energy + energy.T)
        self._tight: NDArray[np.bool_] | None = None
        self._inverse = np.zeros((0, 0))

    def solve(self, gap: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Pressures [Pa] and gaps [m], neither negative, and which seats are tight, each (n,).

        Parameters
        ----------
        gap : (n,) ndarray, [m]
            Without any pressure; negative where the bodies would overlap.
        """
        if self._tight is not None:
            tight = self._tight
            pressure = np.zeros(len(gap))
            pressure[tight] = self._inverse @ (self.areas * gap)[tight]
            opening = gap + self.compliance @ pressure
            if pressure[tight].min(initial=1.0) > 0.0 and opening[~tight].min(initial=0.0) >= 0.0:
                opening[tight] = 0.0
                return pressure, opening, tight
        lower = np.linalg.cholesky(self._energy)
        pressure, _ = nnls(lower.T, np.linalg.solve(lower, -self.areas * gap))
        opening = gap + self.compliance @ pressure
        tight = pressure > 0.0
        self._tight, self._inverse = tight, -np.linalg.inv(self._energy[np.ix_(tight, tight)])
        return pressure, np.where(tight, 0.0, np.maximum(opening, 0.0)), tight


def solve_seats(gap: Array, compliance: Array, areas: Array) -> tuple[Array, Array]:
    """Pressures [Pa] and gaps [m] of seats, both (n,) and neither negative.

    Parameters as of :class:`SeatPressures`.

    >>> compliance = np.array([[2e-12, 0.5e-12], [0.5e-12, 2e-12]])
    >>> p, g = solve_seats(np.array([-4e-6, 2e-6]), compliance, np.ones(2))
    >>> (p / 1e6).round(6), (g * 1e6).round(6)
    (array([2., 0.]), array([0., 3.]))
    """
    return SeatPressures(compliance, areas).solve(gap)[:2]


@dataclass(frozen=True, slots=True, eq=False)
class SeatedLaw:
    """Rings of k bearings on their n seats at one state of temperature and speed, over the ball forces.

    Gaps are ``opening + yielding p + by_force F`` and raceway growths (inner less outer)
    ``growth + by_pressure p - by_load F``, with p the seat pressures and F the radial ball force of each
    bearing on its inner ring.

    Attributes
    ----------
    bodies : SeatBodies
        With all that no state changes.
    opening : (n,) ndarray, [m]
    free_growth : (k,) ndarray, [m]
    """

    bodies: SeatBodies
    opening: Array
    free_growth: Array

    def seats(self, force: Array) -> tuple[Array, Array]:
        """Pressures [Pa] and gaps [m] of the seats (n,) under ball forces (k,) [N]."""
        bodies = self.bodies
        return bodies.under_forces.solve(self.opening + bodies.by_force @ force)[:2]

    def growth(self, force: Array) -> Array:
        """Raceway growth (k,) [m] under ball forces (k,) [N]."""
        bodies = self.bodies
        return self.free_growth + bodies.by_pressure @ self.seats(force)[0] - bodies.by_ball_force * force

    def force(self, growth: Array) -> tuple[Array, Array]:
        """Ball forces (k,) [N] that leave raceway growths (k,) [m], and how they fall with these, (k, k) N/m.

        Negative: the rings would have to be pulled.
        """
        bodies = self.bodies
        pressure, _, tight = bodies.under_growths.solve(
            self.opening + bodies.by_growth @ (self.free_growth - growth)
        )
        force = (self.free_growth + bodies.by_pressure @ pressure - growth) / bodies.by_ball_force
        return force, bodies.fall(tight)


@dataclass(frozen=True, eq=False)
class SeatBodies:
    """Compliance of the seats of k bearings, whatever the state: two seats per bearing, inner ring first.

    Attributes
    ----------
    clearance : (2k,) ndarray, [m]
        Radial, as assembled; negative: interference.
    yielding : (2k, 2k) ndarray, [m/Pa]
    by_force : (2k, k) ndarray, [m/N]
    areas : (2k,) ndarray, [m²]
    by_pressure : (k, 2k) ndarray, [m/Pa]
        Openings by pressures and by radial ball forces, growth by pressures: see :class:`SeatedLaw`.
    by_load : (k, 2) ndarray, [m/N]
        How far a newton of radial ball force moves the inner raceway inwards and the outer one outwards.
    spin_opening : (2k,) ndarray, [m s²]
    spin_growth : (k,) ndarray, [m s²]
        At 1 rad/s.
    raceway_radius : (k, 2) ndarray, [m]
        Inner, outer.
    """

    clearance: Array
    yielding: Array
    by_force: Array
    areas: Array
    by_pressure: Array
    by_load: Array
    spin_opening: Array
    spin_growth: Array
    raceway_radius: Array

    @cached_property
    def by_ball_force(self) -> Array:
        """How far a newton of radial ball force closes the raceways of its bearing, (k,) m/N."""
        return self.by_load.sum(axis=1)

    @cached_property
    def by_growth(self) -> Array:
        """Opening of the seats by what closes the raceways, (n, k)."""
        return self.by_force / self.by_ball_force

    @cached_property
    def under_forces(self) -> SeatPressures:
        """Pressures at given ball forces."""
        return SeatPressures(self.yielding, self.areas)

    @cached_property
    def under_growths(self) -> SeatPressures:
        """Pressures at given raceway growths, which the ball forces follow."""
        return SeatPressures(self.yielding + self.by_growth @ self.by_pressure, self.areas)

    def fall(self, tight: NDArray[np.bool_]) -> Array:
        """How ball forces fall with the raceway growths while these seats are tight, (k, k) N/m."""
        key = tight.tobytes()
        if key not in self._falls:
            yielding = self.under_growths.compliance[np.ix_(tight, tight)]
            more = np.linalg.solve(yielding, self.by_growth[tight])
            softer = (self.by_pressure[:, tight] / self.by_ball_force[:, None]) @ more
            self._falls[key] = np.diag(1.0 / self.by_ball_force) - softer
        return self._falls[key]

    @cached_property
    def _falls(self) -> dict[bytes, Array]:
        return {}

    def of(self, bearings: Sequence[int]) -> SeatBodies:
        """Compliance of the seats of some bearings, as if no others pressed on the same bodies."""
        own = np.asarray(bearings)
        seats = (2 * own[:, None] + np.arange(2)).ravel()
        return SeatBodies(
            self.clearance[seats],
            self.yielding[np.ix_(seats, seats)],
            self.by_force[np.ix_(seats, own)],
            self.areas[seats],
            self.by_pressure[np.ix_(own, seats)],
            self.by_load[own],
            self.spin_opening[seats],
            self.spin_growth[own],
            self.raceway_radius[own],
        )

    def law(
        self, thermal: Array | None = None, speed: float = 0.0, centrifugal: Array | float = 0.0
    ) -> SeatedLaw:
        """The law at a state.

        Parameters
        ----------
        thermal : (k, 4) ndarray, optional, [m]
            By temperature alone: opening of the inner and of the outer seat, outward shift of the inner
            and of the outer raceway. Zero by default.
        speed : float, [rad/s]
        centrifugal : (k,) ndarray or float, [N]
            Radial force on the outer raceways beyond that on the inner ones.
        """
        thermal = np.zeros((len(self.by_load), 4)) if thermal is None else thermal
        beyond = np.broadcast_to(centrifugal, len(self.by_load))
        on_outer = self.by_force * beyond * (np.arange(len(self.areas)) % 2)[:, None]
        return SeatedLaw(
            self,
            self.clearance + thermal[:, :2].ravel() + self.spin_opening * speed**2 + on_outer.sum(axis=1),
            thermal[:, 2] - thermal[:, 3] + self.spin_growth * speed**2 - self.by_load[:, 1] * beyond,
        )


@dataclass(frozen=True, slots=True, eq=False)
class CoupledRings:
    """Laws of sets as restoring forces on displacements of a ball system.

    Attributes
    ----------
    columns : (k,) int64 ndarray
        Displacements that are raceway growths, inner less outer.
    laws : tuple of SeatedLaw
        One a set, in the order of the columns.
    """

    columns: NDArray[np.int64]
    laws: tuple[SeatedLaw, ...]

    def force(self, displacement: Array) -> tuple[Array, Array]:
        """Radial force of every law (N) and its fall with the growths, (k,) and (k, k) N/m."""
        growths = displacement[self.columns]
        if len(self.laws) == 1:
            return self.laws[0].force(growths)
        ends = np.cumsum([len(law.free_growth) for law in self.laws])
        found = [law.force(g) for law, g in zip(self.laws, np.split(growths, ends[:-1]), strict=True)]
        return np.concatenate([force for force, _ in found]), block_diag(*(fall for _, fall in found))

    @classmethod
    def joined(cls, parts: Sequence[tuple[int, CoupledRings]]) -> CoupledRings:
        """Join systems side by side, each given with the number of its first displacement."""
        columns = np.concatenate([first + part.columns for first, part in parts])
        return cls(columns, tuple(law for _, part in parts for law in part.laws))
