"""Cylindrical roller bearing under radial load: the load of each roller, single and double row."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.bracketed_root import bracketed_root
from spindle_fem.errors import GeometryError
from spindle_fem.physics.bearings.bearing_geometry import (
    STEEL_DENSITY,
    STEEL_EXPANSION,
    STEEL_POISSON_RATIO,
    STEEL_YOUNG_MODULUS,
)
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.line_contact import (
    half_width,
    line_approach,
    line_pressure,
    load_of_approach,
)
from spindle_fem.physics.bearings.roller_kind import RollerKind

FloatArray = NDArray[np.float64]
# of the approach over the load
_EXPONENT = 10.0 / 9.0
_REMEMBERED_STATES = 4096


def _half_circle(exponent: float) -> float:
    """Integral of a power of the cosine over half a circle."""
    return math.sqrt(math.pi) * math.gamma(0.5 * exponent + 0.5) / math.gamma(0.5 * exponent + 1.0)


# Sum of the rollers' loads over the radial load that they carry: no clearance, many rollers (1.258).
LOAD_SUM = _half_circle(_EXPONENT) / _half_circle(_EXPONENT + 1.0)


@dataclass(frozen=True, slots=True)
class RollerGeometry:
    """Rollers between a shaft-side and a housing-side cylinder, in SI.

    Attributes
    ----------
    roller_diameter, roller_length, pitch_diameter : float, [m]
        The length is that which bears.
    roller_count : int
        Of one row.
    rows : int
        1, or 2 staggered by half a pitch.
    radial_clearance : float, [m]
        On the diameter, as mounted and warm; negative: preloaded.
    young_modulus, roller_young_modulus : float, [Pa]
        Of rings and rollers.
    poisson_ratio, roller_poisson_ratio : float, [-]
    density, ring_density : float, [kg/m³]
        Of the rollers, and of the inner ring, which turns.
    thermal_expansion, roller_thermal_expansion : float, [1/K]
        Of rings and rollers.
    bore_diameter, outer_diameter : float or None, [m]
        Boundary dimensions; only empirical heat needs them.
    palmgren_lubrication_factor : float or None, [-]
        f_0 of a row; None: that of the kind.
    kind : str
        One of ``BEARING_KINDS`` with rollers.
    seal_moment : float or None, [N m]
        Friction moment of rubbing seals; None: none.
    dynamic_load_rating : float or None, [N]
        Catalogue C of all rows, for the rating life; None: by ISO 281.

    Raises
    ------
    GeometryError
        Rollers that do not fit beside each other, or sizes that are not positive.
    """

    roller_diameter: float
    roller_length: float
    roller_count: int
    pitch_diameter: float
    rows: int = 1
    radial_clearance: float = 0.0
    young_modulus: float = STEEL_YOUNG_MODULUS
    poisson_ratio: float = STEEL_POISSON_RATIO
    roller_young_modulus: float = STEEL_YOUNG_MODULUS
    roller_poisson_ratio: float = STEEL_POISSON_RATIO
    density: float = STEEL_DENSITY
    ring_density: float = STEEL_DENSITY
    thermal_expansion: float = STEEL_EXPANSION
    roller_thermal_expansion: float = STEEL_EXPANSION
    bore_diameter: float | None = None
    outer_diameter: float | None = None
    palmgren_lubrication_factor: float | None = None
    kind: str = "cylindrical_roller"
    seal_moment: float | None = None
    dynamic_load_rating: float | None = None

    def __post_init__(self) -> None:
        for key, what, how_to_fix in roller_faults(self):
            raise GeometryError(key, what, how_to_fix)

    @property
    def catalogue(self) -> RollerKind:
        """Catalogue constants of the bearing's kind."""
        return BEARING_KINDS[self.kind]

    @property
    def number(self) -> int:
        """Rollers of all rows."""
        return self.rows * self.roller_count

    @property
    def diameter_ratio(self) -> float:
        """γ: roller diameter over pitch diameter."""
        return self.roller_diameter / self.pitch_diameter

    @property
    def raceway_diameters(self) -> tuple[float, float]:
        """Diameters of the inner and of the outer raceway, m."""
        return self.pitch_diameter - self.roller_diameter, self.pitch_diameter + self.roller_diameter

    @property
    def compliance(self) -> float:
        """(1-ν1²)/E1 + (1-ν2²)/E2, 1/Pa."""
        ring = (1.0 - self.poisson_ratio**2) / self.young_modulus
        return ring + (1.0 - self.roller_poisson_ratio**2) / self.roller_young_modulus

    @property
    def contact_radius(self) -> FloatArray:
        """Combined radius of inner and outer contact, m."""
        ratio = self.diameter_ratio
        return 0.5 * self.roller_diameter * np.array([1.0 - ratio, 1.0 + ratio])

    @property
    def azimuth(self) -> FloatArray:
        """Azimuth of every roller, row after row, from the load's direction, rad; (rows * roller_count,)."""
        row = 2.0 * np.pi * np.arange(self.roller_count) / self.roller_count
        return np.concatenate([row + number * np.pi / self.roller_count for number in range(self.rows)])

    def centrifugal_force(self, speed: float) -> float:
        """Centrifugal force of one roller at a speed of the inner ring [rad/s], N, for pure rolling."""
        mass = self.density * 0.25 * math.pi * self.roller_diameter**2 * self.roller_length
        return 0.5 * mass * self.pitch_diameter * self.orbital_speed(speed) ** 2

    def orbital_speed(self, speed: float) -> float:
        """Orbital speed of the rollers at a speed of the inner ring, rad/s, for pure rolling."""
        return 0.5 * speed * (1.0 - self.diameter_ratio)

    def spin_speed(self, speed: float) -> float:
        """Speed of a roller about its own axis, relative to the cage, rad/s."""
        return 0.5 * speed * (1.0 / self.diameter_ratio - self.diameter_ratio)

    def entrainment_speed(self, speed: float) -> float:
        """Mean speed of both surfaces of either contact past it, m/s."""
        return 0.5 * self.roller_diameter * self.spin_speed(speed)

    def clearance_at(self, inner: float, outer: float, roller: float) -> float:
        """Clearance on the diameter with rings and rollers warmer by so much than as mounted [K], m."""
        inside, outside = self.raceway_diameters
        rings = self.thermal_expansion * (inside * inner - outside * outer)
        rollers = 2.0 * self.roller_thermal_expansion * self.roller_diameter * roller
        return self.radial_clearance - rings - rollers


def roller_faults(geometry: RollerGeometry) -> list[tuple[str, str, str]]:
    """Key, what is wrong and how to fix it of everything that keeps rollers from being a bearing."""
    faults = [
        (key, f"{getattr(geometry, key):g}.", "It must be positive.")
        for key in ("roller_diameter", "roller_length", "pitch_diameter", "young_modulus", "density")
        if not getattr(geometry, key) > 0.0
    ]
    if geometry.roller_count < 3:
        faults.append(("roller_count", f"{geometry.roller_count}.", "Allowed: a whole number from 3."))
    if geometry.rows not in (1, 2):
        faults.append(("rows", f"{geometry.rows}.", "Allowed: 1, 2."))
    if not faults:
        between = geometry.pitch_diameter * math.sin(math.pi / geometry.roller_count)
        if between < geometry.roller_diameter:
            what = (
                f"{geometry.roller_count} rollers of {geometry.roller_diameter * 1e3:g} mm touch each other."
            )
            faults.append(("roller_count", what, f"Room for rollers below {between * 1e3:.4g} mm."))
    return faults


@dataclass(frozen=True, slots=True, eq=False)
class RollerStates:
    """Rollers of a bearing in equilibrium, (n,) or (n, 2) with the inner contact first.

    Attributes
    ----------
    azimuth : (n,) ndarray, [rad]
    load, pressure, half_width, approach : (n, 2) ndarray, [N], [Pa], [m], [m]
        The approach is negative across a gap.
    radial_displacement : float, [m]
        Of the inner ring along the load, from the middle of the clearance.
    radial_stiffness : float, [N/m]
        Change of the load with displacement.
    centrifugal_force : float, [N]
        Of one roller.
    """

    azimuth: FloatArray
    load: FloatArray
    pressure: FloatArray
    half_width: FloatArray
    approach: FloatArray
    radial_displacement: float
    radial_stiffness: float
    centrifugal_force: float

    @property
    def driving_load(self) -> float:
        """Radial load that a bearing without clearance carries with as much load on its rollers, N.

        The load moments of catalogues go with the radial load; this makes them follow the
        rollers, so that a preloaded bearing has friction without any radial load. Mean of
        inner and outer contacts, centrifugal force among them.
        """
        return float(self.load.sum()) / (2.0 * LOAD_SUM)


def inner_loads(geometry: RollerGeometry, approach: FloatArray, centrifugal: float) -> FloatArray:
    """Load of the inner contact of rollers whose rings come closer by an approach [m], N.

    The outer contact carries the centrifugal force [N] beside it; a roller that
    the rings leave alone rests on the outer one.
    """
    length, compliance = geometry.roller_length, geometry.compliance

    def excess(load: FloatArray, wanted: FloatArray) -> FloatArray:
        outer = line_approach(load + centrifugal, length, compliance)
        return line_approach(load, length, compliance) + outer - wanted

    loads = np.zeros_like(approach)
    touching = approach > float(line_approach(centrifugal, length, compliance))
    if touching.any():
        wanted = approach[touching]
        most = load_of_approach(wanted, length, compliance)
        from scipy.optimize.elementwise import find_root  # slow to load

        loads[touching] = find_root(excess, (np.zeros_like(wanted), most), args=(wanted,)).x
    return loads


@functools.lru_cache(maxsize=_REMEMBERED_STATES)
def solve_roller_bearing(geometry: RollerGeometry, radial_load: float, speed: float = 0.0) -> RollerStates:
    """Load of each roller where rigid rings stay parallel and the inner one balances a radial load.

    Parameters
    ----------
    radial_load : float, [N]
        Along azimuth 0, from 0.
    speed : float, [rad/s]
        Of the inner ring.

    Range: rings that keep their shape, no tilt, no axial load; edges carry no more than the middle.

    Source: Sjovall 1933; Harris & Kotzalas, Rolling Bearing Analysis, 5th ed., vol. 1.

    Greatest load over the mean; 4.08 (Stribeck) where there are many rollers:

    >>> tight = RollerGeometry(10e-3, 10e-3, 14, 65e-3)
    >>> load = solve_roller_bearing(tight, 1000.0).load[:, 0].max()
    >>> round(float(load) * 14 / 1000.0, 2)
    4.09
    """
    centrifugal = geometry.centrifugal_force(speed)
    cosine = np.cos(geometry.azimuth)

    def approach(displacement: float) -> FloatArray:
        return displacement * cosine - 0.5 * geometry.radial_clearance

    def carried(displacement: float) -> float:
        return float(inner_loads(geometry, approach(displacement), centrifugal) @ cosine)

    length, compliance = geometry.roller_length, geometry.compliance
    # one roller under the load alone needs no more than this
    most = 2.0 * float(line_approach(radial_load + centrifugal, length, compliance)) + 0.5 * abs(
        geometry.radial_clearance
    )
    found = 0.0
    if radial_load > 0.0:
        found = bracketed_root(
            lambda value: carried(value) - radial_load, 0.0, most, absolute=1e-15, relative=1e-12
        )
    inner = inner_loads(geometry, approach(found), centrifugal)
    load = np.stack([inner, inner + centrifugal], axis=1)
    radius = geometry.contact_radius
    closer = line_approach(load, length, compliance)
    free = inner <= 0.0
    # a roller that nothing throws outwards floats in the middle of its gap
    closer[free, INNER] = approach(found)[free] - closer[free, OUTER]
    if centrifugal == 0.0:
        closer[free] = 0.5 * closer[free, INNER][:, None]
    step = 1e-4 * max(most, 1e-9)
    stiffness = (carried(found + step) - carried(found - step)) / (2.0 * step)
    return RollerStates(
        geometry.azimuth,
        load,
        line_pressure(load, length, radius, compliance),
        half_width(load, length, radius, compliance),
        closer,
        found,
        stiffness,
        centrifugal,
    )
