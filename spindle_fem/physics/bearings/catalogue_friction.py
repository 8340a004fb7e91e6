"""Catalogue friction moments of Palmgren and SKF for angular-contact ball bearings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import INNER, bearing_contact_constants
from spindle_fem.physics.bearings.lubricant_film import inlet_shear_factor, replenishment_factor

# ISO 76: static axial factor Y0 of a single bearing against the contact angle
_STATIC_ANGLE = np.radians([15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0])
_STATIC_AXIAL_FACTOR = np.array([0.46, 0.42, 0.38, 0.33, 0.29, 0.26, 0.22])
_STATIC_PRESSURE = 4200.0e6

_SKF_R = (5.03e-7, 1.97, 1.90e-12)
_SKF_S = (1.30e-2, 0.68, 1.91e-12)


@dataclass(frozen=True, slots=True)
class FrictionMoment:
    """Friction moment by parts, N m; ``parts`` add up to ``total``."""

    parts: dict[str, float]

    @property
    def total(self) -> float:
        """Sum of the parts, N m."""
        return sum(self.parts.values())


def static_load_rating(geometry: BearingGeometry) -> float:
    """C0, N: the catalogue value if given, else from 4200 MPa at the inner contact.

    C0 = Z Q cos α / 5 with Q the ball load at that pressure (ISO 76).

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> round(static_load_rating(g) / 1e3, 1)
    100.4
    """
    if geometry.static_load_rating is not None:
        return geometry.static_load_rating
    constants = bearing_contact_constants(geometry, geometry.contact_angle, INNER)
    area = math.pi * float(constants.semi_major) * float(constants.semi_minor)
    load = (_STATIC_PRESSURE * area / 1.5) ** 3
    return geometry.ball_count * load * math.cos(geometry.contact_angle) / 5.0


def static_equivalent_load(geometry: BearingGeometry, axial_load: float, radial_load: float) -> float:
    """P0 = max(0.5 F_r + Y0 F_a, F_r) of a single bearing (ISO 76), N."""
    factor = float(np.interp(geometry.contact_angle, _STATIC_ANGLE, _STATIC_AXIAL_FACTOR))
    return max(0.5 * radial_load + factor * axial_load, radial_load)


def palmgren_moment(
    geometry: BearingGeometry,
    speed: float,
    kinematic_viscosity: float,
    axial_load: float,
    radial_load: float = 0.0,
    *,
    lubrication_factor: float = 2.0,
) -> FrictionMoment:
    """Friction moment after Palmgren: ``viscous`` (M_0) and ``load`` (M_1).

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    axial_load, radial_load : float, [N]
    lubrication_factor : float
        f_0: grease about 2 (fresh fill up to 4), oil-air about 1.7.

    Source: Harris & Kotzalas, vol. 1; Palmgren (1959).
    """
    if not lubrication_factor > 0.0:
        raise SpecError("palmgren_f0", f"it is {lubrication_factor:g}.", "It must be above 0.")
    pitch = geometry.pitch_diameter * 1e3
    product = kinematic_viscosity * 1e6 * abs(speed) * 30.0 / math.pi
    rate = 1e-7 * product ** (2.0 / 3.0) if product >= 2000.0 else 160e-7
    viscous = rate * lubrication_factor * pitch**3 if speed else 0.0
    axial, radial = abs(axial_load), abs(radial_load)
    ratio = static_equivalent_load(geometry, axial, radial) / static_load_rating(geometry)
    tangent = math.tan(geometry.contact_angle)
    driving = radial if tangent == 0.0 else max(0.9 * axial / tangent - 0.1 * radial, radial)
    # the factor grows from 0.0010 up to 30° to 0.0013 at 40° of contact angle
    factor = float(np.interp(geometry.contact_angle, np.radians([30.0, 40.0]), [1.0e-3, 1.3e-3]))
    load = factor * ratio**0.33 * driving * pitch
    return FrictionMoment({"viscous": viscous * 1e-3, "load": load * 1e-3})


def skf_moment(
    geometry: BearingGeometry,
    speed: float,
    kinematic_viscosity: float,
    axial_load: float,
    radial_load: float = 0.0,
    *,
    friction_ehl: float = 0.04,
    friction_boundary: float = 0.15,
) -> FrictionMoment:
    """Friction moment of the SKF model: ``rolling`` and ``sliding`` (no contact seal, no oil bath).

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    axial_load, radial_load : float, [N]
    friction_ehl : float
        Full-film friction coefficient: 0.05 mineral, 0.04 synthetic.
    friction_boundary : float
        0.12-0.15.

    The constants are those of 40° single-row bearings: an upper bound at 15°.

    Source: SKF rolling bearings catalogue (2013).
    """
    bore, outer = boundary_diameters(geometry)
    mean = 0.5 * (bore + outer) * 1e3
    rpm = abs(speed) * 30.0 / math.pi
    viscosity = kinematic_viscosity * 1e6
    axial, radial = abs(axial_load), abs(radial_load)
    inertia = mean**4 * rpm**2
    rolling = _SKF_R[0] * mean**1.97 * (radial + _SKF_R[2] * inertia + _SKF_R[1] * axial) ** 0.54
    reduction = float(inlet_shear_factor(speed, mean * 1e-3, kinematic_viscosity)) * float(
        replenishment_factor(speed, bore, outer, kinematic_viscosity)
    )
    third = 4.0 / 3.0
    sliding = _SKF_S[0] * mean**0.26 * ((radial + _SKF_S[2] * inertia) ** third + _SKF_S[1] * axial**third)
    boundary = math.exp(-2.6e-8 * (rpm * viscosity) ** 1.4 * mean)
    coefficient = boundary * friction_boundary + (1.0 - boundary) * friction_ehl
    return FrictionMoment(
        {
            "rolling": reduction * rolling * (viscosity * rpm) ** 0.6 * 1e-3,
            "sliding": coefficient * sliding * 1e-3,
        }
    )


def boundary_diameters(geometry: BearingGeometry) -> tuple[float, float]:
    """Bore and outer diameter, m; 1.75 ball diameters off the pitch circle where not given."""
    reach = 1.75 * geometry.ball_diameter
    bore = geometry.pitch_diameter - reach if geometry.bore_diameter is None else geometry.bore_diameter
    outer = geometry.pitch_diameter + reach if geometry.outer_diameter is None else geometry.outer_diameter
    return bore, outer
