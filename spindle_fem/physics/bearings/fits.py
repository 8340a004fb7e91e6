"""Rings on shaft and in housing: fit pressure, expansion, rotation and ball load in Lamé's relations.

A ring gives way under the radial part of its ball loads, is stretched or
squeezed by its fit, grows with temperature and speed, and lets go of its seat
or meets it. The growth of the raceways against each other is therefore a
decreasing function of the radial force of the balls, straight in pieces: one
piece for each state of the two seats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from spindle_fem.bracketed_root import bracketed_root
from spindle_fem.definition.bearing_seats import LARGEST_FIT
from spindle_fem.errors import GeometryError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import STEEL_DENSITY, BearingGeometry
from spindle_fem.physics.bearings.hertz import contact_polynomials
from spindle_fem.physics.bearings.rings import STEEL, Annulus, RingLaw, SeatMaterial
from spindle_fem.physics.bearings.seat_contact import SeatBodies

# rad; where the contact angle of a mounted bearing is looked for
_ANGLES = (1.0e-3, 0.5 * math.pi - 1.0e-6)
# m; seats that yield together have settled
_GROWTH_TOLERANCE = 1.0e-13
_MOST_ROUNDS = 100


@dataclass(frozen=True, slots=True)
class RingFits:
    """Fits of the rings of one bearing, at assembly temperature and at rest.

    Attributes
    ----------
    inner_interference : float, [m]
        Of the inner ring on the shaft, on the diameter; negative: clearance.
    outer_clearance : float, [m]
        Of the outer ring in the housing, on the diameter; negative: interference.
    housing_outer_diameter : float, [m]
        Of the wall around the outer ring.
    shaft_bore_diameter : float, [m]
        0 for a solid shaft.
    inner_ring_outer_diameter, outer_ring_inner_diameter : float or None, [m]
        Cylinders that represent the grooved faces; None: through the groove bottoms.
    ring_density : float, [kg/m³]

    Range: mean growth around the axis; a ring bent out of round by radial load
    is not covered. The seats are as long as the ring is wide.
    """

    inner_interference: float
    outer_clearance: float
    housing_outer_diameter: float
    shaft_bore_diameter: float = 0.0
    inner_ring_outer_diameter: float | None = None
    outer_ring_inner_diameter: float | None = None
    ring_density: float = STEEL_DENSITY
    shaft: SeatMaterial = STEEL
    housing: SeatMaterial = STEEL


@dataclass(frozen=True, slots=True)
class FitTemperatures:
    """Rises above assembly of both rings, shaft seat and housing seat, K."""

    inner_ring: float = 0.0
    outer_ring: float = 0.0
    shaft: float = 0.0
    housing: float = 0.0


@dataclass(frozen=True, slots=True)
class FitState:
    """State of the seats of one bearing.

    Attributes
    ----------
    inner_pressure, outer_pressure : float, [Pa]
        0 where the ring is loose.
    inner_gap, outer_gap : float, [m]
        Radial; 0 where it is tight.
    inner_growth, outer_growth : float, [m]
        Of the raceway's radius beyond the ring's own free thermal expansion.
    """

    inner_pressure: float
    outer_pressure: float
    inner_gap: float
    outer_gap: float
    inner_growth: float
    outer_growth: float


@dataclass(frozen=True, slots=True)
class SeatedRings:
    """Rings of one bearing with shaft and housing, as cylinder walls.

    Attributes
    ----------
    width : float, [m]
    """

    shaft: Annulus
    inner_ring: Annulus
    outer_ring: Annulus
    housing: Annulus
    width: float
    inner_interference: float
    outer_clearance: float

    def state(
        self, force: float, rise: FitTemperatures, speed: float = 0.0, centrifugal: float = 0.0
    ) -> FitState:
        """Pressures, gaps and growths at a radial ball force on the inner ring.

        Parameters
        ----------
        force : float, [N]
            Sum of the radial ball loads on the inner ring.
        speed : float, [rad/s]
        centrifugal : float, [N]
            Of all balls: what the outer ring carries beyond ``force``.
        """
        inner, outer = self._inner(rise, speed), self._outer(rise)
        on_inner = force / (2.0 * math.pi * self.inner_ring.outside * self.width)
        on_outer = (force + centrifugal) / (2.0 * math.pi * self.outer_ring.inside * self.width)
        p_inner, gap_inner = inner.contact(on_inner)
        p_outer, gap_outer = outer.contact(on_outer)
        return FitState(
            p_inner, p_outer, gap_inner, gap_outer,
            inner.free + inner.by_pressure * p_inner - inner.by_load * on_inner,
            -(outer.free + outer.by_pressure * p_outer - outer.by_load * on_outer),
        )  # fmt: skip

    def law(self, rise: FitTemperatures, speed: float = 0.0, centrifugal: float = 0.0) -> RingLaw:
        """Growth over force at given temperatures and speed; arguments as of :meth:`state`."""
        per_inner = 1.0 / (2.0 * math.pi * self.inner_ring.outside * self.width)
        per_outer = 1.0 / (2.0 * math.pi * self.outer_ring.inside * self.width)
        level, compliance = [], []
        for inner_level, inner_slope in self._inner(rise, speed).lines():
            for outer_level, outer_slope in self._outer(rise).lines():
                slope = outer_slope * per_outer
                level.append(inner_level + outer_level - slope * centrifugal)
                compliance.append(inner_slope * per_inner + slope)
        return RingLaw(tuple(level), tuple(compliance))

    def _inner(self, rise: FitTemperatures, speed: float) -> _Seat:
        ring, shaft = self.inner_ring, self.shaft
        bore, outside = ring.spin_growth(speed)
        seat = shaft.outside
        thermal = seat * (
            shaft.material.thermal_expansion * rise.shaft - ring.material.thermal_expansion * rise.inner_ring
        )
        return _Seat(
            overlap=0.5 * self.inner_interference + thermal + shaft.spin_growth(speed)[1] - bore,
            overlap_by_load=ring.bore_by_outside_pressure,
            softness=ring.bore_by_bore_pressure + shaft.outside_by_outside_pressure,
            free=outside,
            by_pressure=ring.outside_by_bore_pressure,
            by_load=ring.outside_by_outside_pressure,
        )

    def _outer(self, rise: FitTemperatures) -> _Seat:
        """Mirrored: what pushes the outer raceway inwards counts positive."""
        ring, housing = self.outer_ring, self.housing
        thermal = ring.outside * (
            ring.material.thermal_expansion * rise.outer_ring
            - housing.material.thermal_expansion * rise.housing
        )
        return _Seat(
            overlap=thermal - 0.5 * self.outer_clearance,
            overlap_by_load=ring.outside_by_bore_pressure,
            softness=ring.outside_by_outside_pressure + housing.bore_by_bore_pressure,
            free=0.0,
            by_pressure=ring.bore_by_outside_pressure,
            by_load=ring.bore_by_bore_pressure,
        )


@dataclass(frozen=True, slots=True)
class _Seat:
    """One ring and its counterpart: raceway growth = free + by_pressure p - by_load q, p from the overlap.

    ``overlap`` (m, radial) is that of the separate bodies, ``softness`` (m/Pa) that of both together.
    """

    overlap: float
    overlap_by_load: float
    softness: float
    free: float
    by_pressure: float
    by_load: float

    def contact(self, load: float) -> tuple[float, float]:
        """Seat pressure (Pa) and radial gap (m) under a raceway pressure (Pa)."""
        overlap = self.overlap + self.overlap_by_load * load
        return max(overlap, 0.0) / self.softness, max(-overlap, 0.0)

    def lines(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Level and slope over raceway pressure of the growth with the seat loose and tight."""
        stiffening = self.by_pressure / self.softness
        return (
            (self.free, self.by_load),
            (self.free + stiffening * self.overlap, self.by_load - stiffening * self.overlap_by_load),
        )


def fit_faults(geometry: BearingGeometry, fits: RingFits) -> list[tuple[str, str, str]]:
    """Every reason why ``fits`` is impossible: (key, fault, what is allowed)."""
    lacking = [
        (key, "it is missing, but a fit needs it.", "Give it.")
        for key in ("bore_diameter", "outer_diameter", "width")
        if getattr(geometry, key) is None
    ]
    if lacking:
        return lacking
    faults = []
    inner, outer = _ring_diameters(geometry, fits)
    order = (
        ("shaft_bore_diameter", fits.shaft_bore_diameter),
        ("bore_diameter", geometry.bore_diameter),
        ("inner_ring_outer_diameter", inner),
        ("outer_ring_inner_diameter", outer),
        ("outer_diameter", geometry.outer_diameter),
        ("housing_outer_diameter", fits.housing_outer_diameter),
    )
    for (below, small), (key, large) in pairwise(order):
        if not small < large:
            what = f"{large * 1e3:g} mm does not exceed {below} {small * 1e3:g} mm."
            rule = f"Diameters must grow in the order {', '.join(name for name, _ in order)}."
            faults.append((key, what, rule))
    if fits.shaft_bore_diameter < 0.0:
        faults.append(
            ("shaft_bore_diameter", f"it is {fits.shaft_bore_diameter * 1e3:g} mm.", "Allowed: from 0.")
        )
    for key, diameter in (
        ("inner_interference", geometry.bore_diameter),
        ("outer_clearance", geometry.outer_diameter),
    ):
        value = getattr(fits, key)
        if not abs(value) <= LARGEST_FIT * diameter:
            what = f"{value * 1e6:g} µm on {diameter * 1e3:g} mm is no fit."
            rule = f"Allowed: ± {LARGEST_FIT * diameter * 1e6:.0f} µm on the diameter."
            faults.append((key, what, rule))
    return faults


def _ring_diameters(geometry: BearingGeometry, fits: RingFits) -> tuple[float, float]:
    inner, outer = fits.inner_ring_outer_diameter, fits.outer_ring_inner_diameter
    return (
        geometry.pitch_diameter - geometry.ball_diameter if inner is None else inner,
        geometry.pitch_diameter + geometry.ball_diameter if outer is None else outer,
    )


@lru_cache(maxsize=256)
def seated_rings(geometry: BearingGeometry, fits: RingFits) -> SeatedRings:
    """Cylinder walls of a mounted bearing.

    Raises
    ------
    GeometryError
        Walls that do not fit into each other.

    The rings of a 71928 in the reference spindle give way by 3.3e-11 (inner, on
    its shaft) and 3.3e-10 m/N (outer, loose):

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, 0.2618, 0.52, 0.52,
    ...                     bore_diameter=0.140, outer_diameter=0.190, width=0.024)
    >>> rings = seated_rings(g, RingFits(5e-6, 5e-6, 0.3, 0.06, 0.158, 0.172))
    >>> law = rings.law(FitTemperatures())
    >>> [float(f"{value:.2g}") for value in law.compliance]
    [5.9e-10, 3.3e-10, 3.7e-10, 1.1e-10]
    """
    faults = fit_faults(geometry, fits)
    if faults:
        raise GeometryError(*faults[0])
    ring = SeatMaterial(
        geometry.young_modulus, geometry.poisson_ratio, fits.ring_density, geometry.thermal_expansion
    )
    inner, outer = _ring_diameters(geometry, fits)
    return SeatedRings(
        shaft=Annulus(0.5 * fits.shaft_bore_diameter, 0.5 * geometry.bore_diameter, fits.shaft),
        inner_ring=Annulus(0.5 * geometry.bore_diameter, 0.5 * inner, ring),
        outer_ring=Annulus(0.5 * outer, 0.5 * geometry.outer_diameter, ring),
        housing=Annulus(0.5 * geometry.outer_diameter, 0.5 * fits.housing_outer_diameter, fits.housing),
        width=geometry.width,
        inner_interference=fits.inner_interference,
        outer_clearance=fits.outer_clearance,
    )


@dataclass(frozen=True, slots=True)
class MountedState:
    """A mounted bearing under axial force at rest and assembly temperature.

    Attributes
    ----------
    approach : float, [m]
        Axial, from where the unmounted bearing touches.
    contact_angle : float, [rad]
    ball_load : float, [N]
    radial_force : float, [N]
        Sum of the radial ball loads.
    growth : float, [m]
        Inner less outer raceway growth, beyond free expansion.
    """

    approach: float
    contact_angle: float
    ball_load: float
    radial_force: float
    growth: float


@lru_cache(maxsize=1024)
def mounted_state(geometry: BearingGeometry, fits: RingFits, axial_force: float) -> MountedState:
    """Contact angle and approach of a bearing that is mounted with its fits.

    The fits close the play, ball loads open it again: at a given axial force
    one radial force is consistent with both the contact angle and the ring growth.

    Parameters
    ----------
    axial_force : float, [N]

    Raises
    ------
    SpecError
        A negative force.
    GeometryError
    """
    _require_force(axial_force)
    law = seated_rings(geometry, fits).law(FitTemperatures())
    angle = bracketed_root(
        lambda angle: _excess(geometry, axial_force, angle) - law.growth(axial_force / math.tan(angle)),
        *_ANGLES,
        absolute=1e-15,
        relative=1e-14,
    )
    return _mounted(geometry, axial_force, angle)


@lru_cache(maxsize=64)
def mounted_states(
    geometries: tuple[BearingGeometry, ...], seats: SeatBodies, axial_forces: tuple[float, ...]
) -> tuple[MountedState, ...]:
    """Every bearing of a set on bodies that carry their seats together.

    Each bearing's angle is found under the growth that all ball forces leave, in turn until they agree.

    Parameters
    ----------
    axial_forces : tuple of float, [N]

    Raises
    ------
    SpecError
        As :func:`mounted_state`.
    """
    for force in axial_forces:
        _require_force(force)
    law = seats.law()
    growth = np.zeros(len(geometries))
    for _ in range(_MOST_ROUNDS):
        angles = [
            bracketed_root(
                lambda angle, g=geometry, f=force, up=grown: _excess(g, f, angle) - up,
                *_ANGLES,
                absolute=1e-15,
                relative=1e-14,
            )
            for geometry, force, grown in zip(geometries, axial_forces, growth.tolist(), strict=True)
        ]
        before, growth = growth, law.growth(np.array(axial_forces) / np.tan(angles))
        if np.abs(growth - before).max() < _GROWTH_TOLERANCE:
            break
    return tuple(
        _mounted(geometry, force, angle)
        for geometry, force, angle in zip(geometries, axial_forces, angles, strict=True)
    )


def _require_force(axial_force: float) -> None:
    if not axial_force >= 0.0:
        raise SpecError("axial force", f"it is {axial_force:g} N.", "It must not be negative.")


def _lengths(geometry: BearingGeometry, axial_force: float, angle: float) -> tuple[float, float]:
    """Ball load (N) and distance of the groove centres (m) at a contact angle."""
    load = axial_force / (geometry.ball_count * math.sin(angle))
    stretch = (load / _normal_constant(geometry, math.cos(angle))) ** (2.0 / 3.0)
    return load, geometry.curvature_centre_distance + stretch


def _excess(geometry: BearingGeometry, axial_force: float, angle: float) -> float:
    """Raceway growth required by a contact angle under an axial force, m."""
    radial = geometry.curvature_centre_distance * math.cos(geometry.contact_angle)
    return _lengths(geometry, axial_force, angle)[1] * math.cos(angle) - radial


def _mounted(geometry: BearingGeometry, axial_force: float, angle: float) -> MountedState:
    load, length = _lengths(geometry, axial_force, angle)
    free = geometry.curvature_centre_distance * math.sin(geometry.contact_angle)
    return MountedState(
        length * math.sin(angle) - free,
        angle,
        load,
        axial_force / math.tan(angle),
        _excess(geometry, axial_force, angle),
    )


def _normal_constant(geometry: BearingGeometry, cosine: float) -> float:
    """K of Q = K δ^1.5 of both contacts together at a contact angle, N/m^1.5."""
    table = contact_polynomials(geometry)[:, 0, :]
    constants = np.exp(np.polynomial.polynomial.polyval(2.0 * cosine - 1.0, table.T))
    return float(np.sum(constants ** (-2.0 / 3.0)) ** -1.5)


__all__ = [
    "FitState",
    "FitTemperatures",
    "MountedState",
    "RingFits",
    "SeatedRings",
    "fit_faults",
    "mounted_state",
    "mounted_states",
    "seated_rings",
]
