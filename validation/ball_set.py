"""Preloaded sets of angular-contact ball bearings between elastic rings, written a second time.

Static: balls at the angle that their deformed contacts leave, rings as thin hoops on a stiff shaft and in
a housing with clearance, a set locked along the axis by its spacers. Temperatures °C, forces N, lengths m.

Source: Harris, Rolling Bearing Analysis (contact stiffness by Hamrock and Brewe, ball loads from the
distance of the curvature centres).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

YOUNG, POISSON = 2.06e11, 0.3
STEEL_EXPANSION, IRON_EXPANSION = 12.5e-6, 10.5e-6
ASSEMBLED_AT = 20.0
# Of the equations: shares of the preload, micrometres.
RESIDUAL = 1.0e-6
MOST_STEPS, SHORTEST = 60, 1.0e-3


@dataclass(frozen=True, slots=True)
class Bearing:
    """Geometry of a bearing: m and rad."""

    ball: float
    count: int
    pitch: float
    bore: float
    outside: float
    width: float
    inner_shoulder: float
    outer_shoulder: float
    angle: float = np.deg2rad(15.0)
    groove: float = 0.52

    @property
    def centres(self) -> float:
        """Distance of the curvature centres of an unloaded bearing."""
        return (2.0 * self.groove - 1.0) * self.ball

    def stiffness(self) -> float:
        """Ball load over deformation^1.5, both contacts in series, N/m^1.5."""
        along = self.ball * np.cos(self.angle) / self.pitch
        total = 0.0
        for sign in (-1.0, 1.0):
            rolling = 0.5 * self.ball * (1.0 + sign * along)
            across = self.groove * self.ball / (2.0 * self.groove - 1.0)
            ratio = across / rolling
            k = 1.0339 * ratio**0.636
            second = 1.0003 + 0.5968 / ratio
            first = 1.5277 + 0.6023 * np.log(ratio)
            radius = 1.0 / (1.0 / rolling + 1.0 / across)
            modulus = YOUNG / (1.0 - POISSON**2)
            contact = np.pi * k * modulus * np.sqrt(radius * second / (4.5 * first**3))
            total += contact ** (-2.0 / 3.0)
        return total**-1.5


FRONT = Bearing(14.2875e-3, 30, 0.165, 0.140, 0.190, 0.024, 0.158, 0.172)
REAR = Bearing(13.494e-3, 27, 0.1425, 0.120, 0.165, 0.022, 0.135, 0.150)


@dataclass(slots=True)
class Warmth:
    """Temperatures around the bearings of a set, (k,) °C each; that of the housing stands for its growth."""

    inner: Array
    outer: Array
    shaft: Array
    housing: Array


@dataclass(slots=True)
class BallSet:
    """A locked set.

    ``sides`` +1 where thrust towards the rear loads a bearing; ``places`` of the middles along the axis.
    ``clearance`` on the diameter. ``wall`` is how much of its growth the housing has, ``yielding`` the share
    of an outer ring's overlap that it gives.
    """

    bearing: Bearing
    sides: tuple[int, ...]
    places: tuple[float, ...]
    preload: float
    clearance: float
    wall: float = 1.0
    yielding: float = 0.2
    _last: Array | None = field(default=None, init=False, repr=False)
    _lock: Array | None = field(default=None, init=False, repr=False)

    def ball_loads(self, warmth: Warmth, thrust: float) -> Array:
        """Ball load of every bearing, N."""
        if self._lock is None:
            self._lock = self._assembled()
        cold = Warmth(*(np.full(len(self.sides), ASSEMBLED_AT) for _ in range(4)))
        if self._last is None:
            start = np.concatenate(([0.0], self._growth(cold, np.zeros(len(self.sides)))))
            self._last = self._solve(start, cold, 0.0)
        self._last = self._solve(self._last, warmth, thrust)
        load, _ = self._contact(self._last, warmth)
        return load

    def _assembled(self) -> Array:
        """Axial approach of each bearing at assembly that leaves it its share of the preload."""
        count = len(self.sides)
        share = [self.preload / sum(s == side for s in self.sides) for side in self.sides]
        cold = Warmth(*(np.full(count, ASSEMBLED_AT) for _ in range(4)))
        self._lock = np.zeros(count)

        def missing(unknown: Array) -> Array:
            self._lock = 1e-6 * unknown[:count]
            state = np.concatenate(([0.0], 1e-6 * unknown[count:]))
            load, angle = self._contact(state, cold)
            radial = self.bearing.count * load * np.cos(angle)
            axial = self.bearing.count * load * np.sin(angle)
            growth = self._growth(cold, radial)
            return np.concatenate((axial / np.array(share) - 1.0, 1e6 * (growth - state[1:])))

        return 1e-6 * solved(missing, np.concatenate((np.full(count, 20.0), np.zeros(count))))[:count]

    def _solve(self, start: Array, warmth: Warmth, thrust: float) -> Array:
        def missing(unknown: Array) -> Array:
            state = 1e-6 * unknown
            load, angle = self._contact(state, warmth)
            axial = self.bearing.count * load * np.sin(angle)
            growth = self._growth(warmth, self.bearing.count * load * np.cos(angle))
            balance = float(np.array(self.sides) @ axial) - thrust
            return np.concatenate(([balance / self.preload], 1e6 * (growth - state[1:])))

        return 1e-6 * solved(missing, 1e6 * start)

    def _contact(self, state: Array, warmth: Warmth) -> tuple[Array, Array]:
        """Ball load and contact angle from the shaft's shift and the closing of every bearing."""
        b, sides = self.bearing, np.array(self.sides)
        along = np.array(self.places) - np.mean(self.places)
        spacers = STEEL_EXPANSION * along * (warmth.inner - warmth.outer)
        approach = self._lock + sides * (state[0] + spacers)
        ball = STEEL_EXPANSION * b.ball * (0.5 * (warmth.inner + warmth.outer) - ASSEMBLED_AT)
        axial = b.centres * np.sin(b.angle) + approach
        radial = b.centres * np.cos(b.angle) + state[1:]
        pressed = np.maximum(np.hypot(axial, radial) - b.centres + ball, 1e-9)
        return b.stiffness() * pressed**1.5, np.arctan2(axial, radial)

    def _growth(self, warmth: Warmth, radial: Array) -> Array:
        """Growth of the inner raceway less that of the outer one under radial ball forces, m."""
        b = self.bearing
        rise = [value - ASSEMBLED_AT for value in (warmth.inner, warmth.outer, warmth.shaft, warmth.housing)]
        inner_ring, outer_ring, shaft, housing = rise
        # A thin ring tight on the shaft follows it; its own warmth adds up to the bottom of its groove.
        wall = 0.5 * (b.pitch - b.ball - b.bore)
        inner = STEEL_EXPANSION * (0.5 * b.bore * (0.9 * shaft + 0.1 * inner_ring) + wall * inner_ring)
        inner = inner - 0.1 * self._hoop() * radial
        spread = self._hoop() * radial
        outer = 0.5 * (b.pitch + b.ball) * STEEL_EXPANSION * outer_ring + spread
        room = 0.5 * self.clearance + 0.5 * b.outside * IRON_EXPANSION * self.wall * housing
        overlap = 0.5 * b.outside * STEEL_EXPANSION * outer_ring + spread - room
        # Smooth over a tenth of a micrometre where the ring meets its seat.
        overlap = 1e-7 * np.logaddexp(0.0, overlap / 1e-7)
        return inner - (outer - (1.0 - self.yielding) * overlap)

    def _hoop(self) -> float:
        """How far a newton of radial ball force spreads the free outer ring, m."""
        b = self.bearing
        section = 0.5 * (b.outside - b.outer_shoulder) * b.width
        return 0.25 * (b.outside + b.outer_shoulder) / (2.0 * np.pi * YOUNG * section)


def solved(missing: Callable[[Array], Array], start: Array) -> Array:
    """Root of a system by Newton's method with differences and shorter steps where it must.

    Raises
    ------
    ArithmeticError

    >>> solved(lambda x: x**2 - np.array([4.0, 9.0]), np.ones(2)).round(6).tolist()
    [2.0, 3.0]
    """
    state, left = start, missing(start)
    for _ in range(MOST_STEPS):
        if np.abs(left).max() < RESIDUAL:
            return state
        slope = np.stack(
            [(missing(state + 1e-6 * unit) - left) / 1e-6 for unit in np.eye(len(state))], axis=1
        )
        step, share = np.linalg.solve(slope, -left), 1.0
        while share > SHORTEST:
            tried = missing(state + share * step)
            if np.isfinite(tried).all() and np.linalg.norm(tried) < np.linalg.norm(left):
                break
            share *= 0.5
        state = state + share * step
        left = missing(state)
    raise ArithmeticError("the set finds no equilibrium.")
