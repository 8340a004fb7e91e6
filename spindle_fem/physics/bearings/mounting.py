"""Mounting of bearings: sets, preload, temperatures and loads."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings.bearing_geometry import STEEL_EXPANSION, BearingGeometry
from spindle_fem.physics.bearings.fits import (
    MountedState,
    RingFits,
    mounted_state,
    mounted_states,
    seated_rings,
)
from spindle_fem.physics.bearings.preload import require_force, tandem_approach
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry
from spindle_fem.physics.bearings.rough_surface import SurfaceRoughness, roughness_from_rms
from spindle_fem.physics.bearings.seat_contact import SeatBodies

FloatArray = NDArray[np.float64]
ROOM_TEMPERATURE = 293.15


@dataclass(frozen=True, slots=True)
class MountedBearing:
    """A bearing of a set.

    Attributes
    ----------
    orientation : {+1, -1}
        +1: shaft motion towards +z loads it.
    axial_position : float, [m]
        Of the bearing's middle along z.
    fits : RingFits or None
        Seats of its rings; None: rigid rings that keep their size on any seat.
    """

    name: str
    geometry: BearingGeometry
    orientation: int = 1
    axial_position: float = 0.0
    fits: RingFits | None = None

    def __post_init__(self) -> None:
        if self.fits is not None:
            seated_rings(self.geometry, self.fits)
        if self.orientation not in (1, -1):
            raise SpecError(f"{self.name}.orientation", f"it is {self.orientation}.", "Allowed: 1, -1.")


@dataclass(frozen=True, slots=True)
class BearingSet:
    """Bearings mounted against one another on one shaft.

    Attributes
    ----------
    preload : float, [N]
        Force through the set at assembly, at rest: bearings in tandem share it.
    preload_kind : {"rigid", "spring"}
        Rigid (locknut) keeps the displacement of the rings; a spring on the
        outer rings of the bearings with orientation -1 keeps the force.
    assembled_force : float, [N]
        Of springs, of this set or another, through bearings that all face one way, which is a load on them
        and no preload: what seats their rings at assembly.
    loop_stiffness : float or None, [N/m]
        Of shaft, housing and spacers between the two sides of a rigid set: how they give way to its force
        beyond that of assembly. None: not at all.
    shaft_expansion, housing_expansion : float, [1/K]
    shaft_bore_diameter : float or None, [m]
        Of a hollow shaft; with it the inner ring grows by rotation. None: no growth.
    raceway_roughness, ball_roughness : float, [m]
        Rq.
    roughness : SurfaceRoughness or None
        Composite moments from measured profiles; None: assumed from both Rq.
    seats : SeatBodies or None
        Elastic bodies that carry the rings, in place of the cylinders of each bearing's ``fits``.
    recent : dict or None
        Filled with the last equilibria and their speeds, from which the next search begins; None: each
        search begins at rest.

    Raises
    ------
    SpecError
        No bearing, or preload that is negative or has nothing to act against.
    """

    bearings: tuple[MountedBearing, ...]
    preload: float = 0.0
    preload_kind: Literal["rigid", "spring"] = "rigid"
    assembled_force: float = 0.0
    shaft_expansion: float = STEEL_EXPANSION
    housing_expansion: float = STEEL_EXPANSION
    shaft_bore_diameter: float | None = None
    raceway_roughness: float = 0.05e-6
    ball_roughness: float = 0.01e-6
    roughness: SurfaceRoughness | None = None
    seats: SeatBodies | None = None
    loop_stiffness: float | None = None
    recent: dict[tuple, Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.bearings:
            raise SpecError("bearings", "the set has no bearing.", "Give at least one.")
        require_force("preload", self.preload)
        if self.preload_kind not in ("rigid", "spring"):
            raise SpecError("preload_kind", f"{self.preload_kind!r} is unknown.", "Allowed: rigid, spring.")
        if self.preload > 0.0 and not self.has_counter_bearings:
            raise SpecError(
                "preload", f"{self.preload:g} N through bearings that all face one way.",
                "Preload needs a counter bearing; give the force as axial load instead.",
            )  # fmt: skip
        for key in ("raceway_roughness", "ball_roughness"):
            if not getattr(self, key) > 0.0:
                raise SpecError(key, f"it is {getattr(self, key):g} m.", "It must be above 0.")
        if self.loop_stiffness is not None and not self.loop_stiffness > 0.0:
            raise SpecError("loop_stiffness", f"it is {self.loop_stiffness:g} N/m.", "It must be above 0.")

    @property
    def has_counter_bearings(self) -> bool:
        """Whether bearings of both orientations are in the set."""
        return len({bearing.orientation for bearing in self.bearings}) == 2

    @property
    def composite_roughness(self) -> SurfaceRoughness:
        """Moments of raceway and ball together."""
        if self.roughness is not None:
            return self.roughness
        return roughness_from_rms(self.raceway_roughness) + roughness_from_rms(self.ball_roughness)

    def with_rigid_rings(self) -> BearingSet:
        """The set with rings that keep their size: the contact angle is that of the mounted bearing."""
        bearings = tuple(replace(bearing, fits=None) for bearing in self.bearings)
        return replace(self, bearings=bearings, seats=None, loop_stiffness=None, recent=None)

    def assembly_approaches(self) -> FloatArray:
        """Axial approach of each bearing after assembly, (n_bearings,), m.

        Counts from where the unmounted bearing touches. Bearings with fits share
        the force of their side equally, as matched rings do.
        """
        approach = np.zeros(len(self.bearings))
        if self.preload == 0.0:
            return approach
        for side in (1, -1):
            group = [index for index, bearing in enumerate(self.bearings) if bearing.orientation == side]
            together = tandem_approach(tuple(self.bearings[index].geometry for index in group), self.preload)
            for index in group:
                bearing = self.bearings[index]
                approach[index] = together
                if bearing.fits is not None and self.seats is None:
                    share = self.preload / len(group)
                    approach[index] = mounted_state(bearing.geometry, bearing.fits, share).approach
        if self.seats is not None:
            approach[:] = [state.approach for state in self.mounted_states()]
        return approach

    def mounted_states(self) -> tuple[MountedState, ...]:
        """Every bearing as assembled with its preload, or the force of its springs, on elastic seats."""
        sides = [bearing.orientation for bearing in self.bearings]
        force = self.preload or self.assembled_force
        shares = tuple(force / sides.count(side) for side in sides)
        return mounted_states(tuple(bearing.geometry for bearing in self.bearings), self.seats, shares)


@dataclass(frozen=True, slots=True)
class BearingTemperatures:
    """Temperatures of one bearing, K.

    ``lubricant`` None: the mean of rings and balls. ``shaft_seat`` and
    ``housing_seat`` None: shaft and housing of the set.
    """

    inner_ring: float
    outer_ring: float
    ball: float
    lubricant: float | None = None
    shaft_seat: float | None = None
    housing_seat: float | None = None

    @property
    def film(self) -> float:
        """Temperature at which viscosity is taken, K."""
        if self.lubricant is not None:
            return self.lubricant
        return 0.25 * (self.inner_ring + self.outer_ring) + 0.5 * self.ball


@dataclass(frozen=True, slots=True)
class SetTemperatures:
    """Temperatures of a set, K.

    Attributes
    ----------
    shaft, housing : float
        Between the bearings.
    assembly : float
        At which the preload was set.
    shifts : (n_bearings, 4) ndarray or None, [m]
        What temperature alone does where elastic bodies carry the rings, as ``SeatBodies.law`` takes it.
    """

    bearings: tuple[BearingTemperatures, ...]
    shaft: float
    housing: float
    assembly: float = ROOM_TEMPERATURE
    shifts: FloatArray | None = None


def uniform_temperatures(number: int, temperature: float) -> SetTemperatures:
    """A set at one temperature (K) that was assembled at it: no thermal displacement."""
    one = BearingTemperatures(temperature, temperature, temperature)
    return SetTemperatures((one,) * number, temperature, temperature, temperature)


@dataclass(frozen=True, slots=True)
class ExternalLoad:
    """Load on the shaft at a set.

    Attributes
    ----------
    thrust : float, [N]
        Towards +z; loads bearings of orientation +1.
    radial : float, [N]
        Along azimuth 0.
    moment : float, [N m]
        Moves the shaft towards +z at azimuth 0.
    """

    thrust: float = 0.0
    radial: float = 0.0
    moment: float = 0.0

    @property
    def is_axial(self) -> bool:
        """Whether all balls of a bearing see the same load."""
        return self.radial == 0.0 and self.moment == 0.0


def rotation_growth(geometry: BearingGeometry, speed: float, shaft_bore: float | None) -> float:
    """Radial growth of the inner raceway by rotation, ring and shaft as one hollow body, m.

    Raises
    ------
    SpecError
        A bore that is not inside the ring.
    """
    if shaft_bore is None or speed == 0.0:
        return 0.0
    outside = 0.5 * (geometry.pitch_diameter - geometry.ball_diameter * math.cos(geometry.contact_angle))
    return disc_growth(geometry, speed, outside, 0.5 * shaft_bore)


def disc_growth(
    geometry: BearingGeometry | RollerGeometry, speed: float, outside: float, inside: float
) -> float:
    """Radial growth by rotation at the outside of an inner ring and its shaft as one hollow body, m.

    u = ρω²b/(4E) [(1-ν) b² + (3+ν) a²] at the outside b of a bore a.

    Parameters
    ----------
    speed : float, [rad/s]
    outside, inside : float, [m]
        b and a.

    Raises
    ------
    SpecError
        A bore that is not inside the ring.

    Source: Timoshenko & Goodier, rotating discs.
    """
    if not 0.0 <= inside < outside:
        raise SpecError("shaft_bore_diameter", f"it is {2e3 * inside:g} mm.", "It must lie inside the ring.")
    ratio = geometry.poisson_ratio
    shape = (1.0 - ratio) * outside**2 + (3.0 + ratio) * inside**2
    return geometry.ring_density * speed**2 * outside / (4.0 * geometry.young_modulus) * shape
