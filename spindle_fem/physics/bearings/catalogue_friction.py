"""Catalogue quantities of a bearing that the empirical friction models need: ratings, boundary dimensions."""

from __future__ import annotations

import math
from dataclasses import dataclass

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.hertz import INNER, STATIC_PRESSURE, bearing_contact_constants
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry


@dataclass(frozen=True, slots=True)
class FrictionMoment:
    """Friction moment by parts, N m; ``parts`` add up to ``total``."""

    parts: dict[str, float]

    @property
    def total(self) -> float:
        """Sum of the parts, N m."""
        return sum(self.parts.values())

    def heat(self, model: str, speed: float, geometry: BearingGeometry | RollerGeometry) -> BearingHeat:
        """Heat at a speed [rad/s], with that of the bearing's contact seals."""
        terms = {name: part * speed for name, part in self.parts.items()}
        if geometry.seal_moment is not None:
            terms["seal"] = geometry.seal_moment * speed
        return BearingHeat(model, terms, {})


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
    load = (STATIC_PRESSURE * area / 1.5) ** 3
    return geometry.ball_count * load * math.cos(geometry.contact_angle) / 5.0


def static_equivalent_load(geometry: BearingGeometry, axial_load: float, radial_load: float) -> float:
    """P0 = max(X0 F_r + Y0 F_a, F_r) of a single bearing (ISO 76), N."""
    kind = geometry.catalogue
    return max(
        kind.static_radial_factor * radial_load
        + kind.static_axial_factor(geometry.contact_angle) * axial_load,
        radial_load,
    )


def boundary_diameters(geometry: BearingGeometry) -> tuple[float, float]:
    """Bore and outer diameter, m; 1.75 ball diameters off the pitch circle where not given."""
    reach = 1.75 * geometry.ball_diameter
    bore = geometry.pitch_diameter - reach if geometry.bore_diameter is None else geometry.bore_diameter
    outer = geometry.pitch_diameter + reach if geometry.outer_diameter is None else geometry.outer_diameter
    return bore, outer


def roller_boundary(geometry: RollerGeometry) -> tuple[float, float]:
    """Bore and outer diameter of rollers' rings, m; two rollers off the pitch circle where not given."""
    reach = 2.0 * geometry.roller_diameter
    bore = geometry.pitch_diameter - reach if geometry.bore_diameter is None else geometry.bore_diameter
    outer = geometry.pitch_diameter + reach if geometry.outer_diameter is None else geometry.outer_diameter
    return bore, outer
