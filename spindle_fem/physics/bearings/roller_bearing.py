"""Cylindrical roller bearing under radial load: the load of each roller, single and double row."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.optimize.elementwise import find_root

from spindle_fem.errors import GeometryError
from spindle_fem.physics.bearings.bearing_geometry import (
    STEEL_DENSITY,
    STEEL_POISSON_RATIO,
    STEEL_YOUNG_MODULUS,
)
from spindle_fem.physics.bearings.hertz import OUTER
from spindle_fem.physics.bearings.line_contact import (
    half_width,
    line_approach,
    line_pressure,
    load_of_approach,
)

FloatArray = NDArray[np.float64]


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
    density : float, [kg/m³]
        Of the rollers.

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

    def __post_init__(self) -> None:
        for key, what, how_to_fix in roller_faults(self):
            raise GeometryError(key, what, how_to_fix)

    @property
    def compliance(self) -> float:
        """(1-ν1²)/E1 + (1-ν2²)/E2, 1/Pa."""
        ring = (1.0 - self.poisson_ratio**2) / self.young_modulus
        return ring + (1.0 - self.roller_poisson_ratio**2) / self.roller_young_modulus

    @property
    def contact_radius(self) -> FloatArray:
        """Combined radius of inner and outer contact, m."""
        ratio = self.roller_diameter / self.pitch_diameter
        return 0.5 * self.roller_diameter * np.array([1.0 - ratio, 1.0 + ratio])

    @property
    def azimuth(self) -> FloatArray:
        """Of every roller, row after row, from the load's direction, rad; (rows * roller_count,)."""
        row = 2.0 * np.pi * np.arange(self.roller_count) / self.roller_count
        return np.concatenate([row + number * np.pi / self.roller_count for number in range(self.rows)])

    def centrifugal_force(self, speed: float) -> float:
        """Of one roller at a speed of the inner ring [rad/s], N: rollers orbit as rolling asks."""
        orbit = 0.5 * speed * (1.0 - self.roller_diameter / self.pitch_diameter)
        mass = self.density * 0.25 * math.pi * self.roller_diameter**2 * self.roller_length
        return 0.5 * mass * self.pitch_diameter * orbit**2


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
        loads[touching] = find_root(excess, (np.zeros_like(wanted), most), args=(wanted,)).x
    return loads


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
        found = float(brentq(lambda value: carried(value) - radial_load, 0.0, most, xtol=1e-15, rtol=1e-12))
    inner = inner_loads(geometry, approach(found), centrifugal)
    load = np.stack([inner, inner + centrifugal], axis=1)
    load[:, OUTER] = np.where(inner > 0.0, load[:, OUTER], centrifugal)
    radius = geometry.contact_radius
    step = 1e-4 * max(most, 1e-9)
    stiffness = (carried(found + step) - carried(found - step)) / (2.0 * step)
    return RollerStates(
        geometry.azimuth,
        load,
        line_pressure(load, length, radius, compliance),
        half_width(load, length, radius, compliance),
        line_approach(load, length, compliance),
        found,
        stiffness,
        centrifugal,
    )
