"""Geometry of one ball bearing and the rows bearings are mounted in."""

from __future__ import annotations

import math
from dataclasses import dataclass

from spindle_fem.errors import GeometryError, SpecError, did_you_mean
from spindle_fem.physics.bearings.bearing_kind import BearingKind
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.cage_guidance import CageGuidance

STEEL_YOUNG_MODULUS = 206.0e9
STEEL_POISSON_RATIO = 0.3
STEEL_DENSITY = 7800.0
STEEL_EXPANSION = 12.5e-6


@dataclass(frozen=True, slots=True)
class BearingGeometry:
    """Internal geometry and material of a ball bearing, in SI and radians.

    Attributes
    ----------
    ball_diameter, pitch_diameter : float, [m]
    contact_angle : float, [rad]
        Free contact angle, before load.
    groove_curvature_inner, groove_curvature_outer : float, [-]
        Groove radius over ball diameter, above 0.5.
    young_modulus : float, [Pa]
    poisson_ratio : float, [-]
        Of rings and balls.
    density : float, [kg/m³]
        Of the balls.
    ball_young_modulus, ball_poisson_ratio : float or None
        Where the balls differ from the rings (silicon nitride); None: as the rings.
    ring_density : float, [kg/m³]
        Of the inner ring, which turns.
    thermal_expansion, ball_thermal_expansion : float, [1/K]
        Of the rings and of the balls.
    bore_diameter, outer_diameter, width : float or None, [m]
        Boundary dimensions; only empirical heat, ring growth and set spacing need them.
    shoulder_angle : float or None, [rad]
        Contact angle at which the ellipse's centre reaches the edge of the
        groove. None: unknown; free angles up to that of the kind and running
        ones up to 90° pass.
    static_load_rating : float or None, [N]
        Catalogue C0; None: from the contact pressure of 4200 MPa (ISO 76).
    dynamic_load_rating : float or None, [N]
        Catalogue C, for the rating life; None: by ISO 281.
    kind : str
        Kind of bearing, one of ``BEARING_KINDS``.
    seal_moment : float or None, [N m]
        Friction moment of rubbing seals, both together (K_S1 d_s^β + K_S2 of a catalogue), 0 without.
        None: unknown.
    cage : CageGuidance or None
        Land that guides the cage. None: unknown; only the heat model ``full`` needs it.

    Raises
    ------
    GeometryError
        A bearing that cannot be assembled.

    >>> BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52).total_curvature
    0.04
    """

    ball_diameter: float
    ball_count: int
    pitch_diameter: float
    contact_angle: float
    groove_curvature_inner: float
    groove_curvature_outer: float
    young_modulus: float = STEEL_YOUNG_MODULUS
    poisson_ratio: float = STEEL_POISSON_RATIO
    density: float = STEEL_DENSITY
    ball_young_modulus: float | None = None
    ball_poisson_ratio: float | None = None
    ring_density: float = STEEL_DENSITY
    thermal_expansion: float = STEEL_EXPANSION
    ball_thermal_expansion: float = STEEL_EXPANSION
    bore_diameter: float | None = None
    outer_diameter: float | None = None
    width: float | None = None
    shoulder_angle: float | None = None
    static_load_rating: float | None = None
    dynamic_load_rating: float | None = None
    kind: str = "angular_contact_ball"
    seal_moment: float | None = None
    cage: CageGuidance | None = None

    def __post_init__(self) -> None:
        faults = bearing_faults(self)
        if faults:
            key, what, how_to_fix = faults[0]
            raise GeometryError(key, what, how_to_fix)

    @property
    def catalogue(self) -> BearingKind:
        """Catalogue constants of the bearing's kind."""
        return BEARING_KINDS[self.kind]

    @property
    def rated_contact_angle(self) -> float:
        """Contact angle with which load ratings count, rad."""
        rated = self.catalogue.rated_contact_angle
        return self.contact_angle if rated is None else rated

    @property
    def total_curvature(self) -> float:
        """B = f_i + f_o - 1, the distance of the groove centres over the ball diameter."""
        return round(self.groove_curvature_inner + self.groove_curvature_outer - 1.0, 14)

    @property
    def curvature_centre_distance(self) -> float:
        """Distance of the two groove centres without load, m."""
        return self.total_curvature * self.ball_diameter

    @property
    def diameter_ratio(self) -> float:
        """γ' = ball diameter over pitch diameter."""
        return self.ball_diameter / self.pitch_diameter

    @property
    def ball_mass(self) -> float:
        """Mass of one ball, kg."""
        return math.pi / 6.0 * self.density * self.ball_diameter**3

    @property
    def ball_inertia(self) -> float:
        """Moment of inertia of one ball about its centre, kg m²."""
        return self.ball_mass * self.ball_diameter**2 / 10.0

    @property
    def contact_compliance(self) -> float:
        """(1-ν1²)/E1 + (1-ν2²)/E2 of ring and ball, 1/Pa."""
        ball_modulus = self.ball_young_modulus or self.young_modulus
        ball_ratio = self.poisson_ratio if self.ball_poisson_ratio is None else self.ball_poisson_ratio
        return (1.0 - self.poisson_ratio**2) / self.young_modulus + (1.0 - ball_ratio**2) / ball_modulus

    @property
    def reduced_modulus(self) -> float:
        """E' with 2/E' the contact compliance, Pa."""
        return 2.0 / self.contact_compliance

    @property
    def inner_groove_centre_radius(self) -> float:
        """Radius of the circle of the inner groove's centres, m."""
        offset = (self.groove_curvature_inner - 0.5) * self.ball_diameter * math.cos(self.contact_angle)
        return 0.5 * self.pitch_diameter + offset

    @property
    def outer_groove_centre_radius(self) -> float:
        """Radius of the circle of the outer groove's centres, m."""
        offset = (self.groove_curvature_outer - 0.5) * self.ball_diameter * math.cos(self.contact_angle)
        return 0.5 * self.pitch_diameter - offset

    @property
    def largest_contact_angle(self) -> float:
        """Contact angle at which the ball climbs the shoulder, rad."""
        return 0.5 * math.pi if self.shoulder_angle is None else self.shoulder_angle


def angle_of_clearance(
    clearance: float, ball_diameter: float, groove_curvature_inner: float, groove_curvature_outer: float
) -> float:
    """Contact angle at which the rings of a deep-groove bearing meet without load, rad.

    Parameters
    ----------
    clearance : float, [m]
        On the diameter; up to twice the distance of the groove centres.
    ball_diameter : float, [m]

    Source: Harris & Kotzalas, vol. 1: cos α = 1 - P_d / (2 A).

    >>> round(math.degrees(angle_of_clearance(15e-6, 12.7e-3, 0.52, 0.52)), 2)
    9.86
    """
    distance = (groove_curvature_inner + groove_curvature_outer - 1.0) * ball_diameter
    return math.acos(max(1.0 - clearance / (2.0 * distance), -1.0))


def bearing_faults(geometry: BearingGeometry) -> list[tuple[str, str, str]]:
    """Every reason why a bearing cannot be assembled: (key, fault, what is allowed)."""
    faults: list[tuple[str, str, str]] = []
    for key in (
        "ball_diameter", "pitch_diameter", "groove_curvature_inner", "groove_curvature_outer",
        "young_modulus", "density", "ring_density", "ball_young_modulus", "bore_diameter", "outer_diameter",
        "width", "static_load_rating", "dynamic_load_rating",
    ):  # fmt: skip
        value = getattr(geometry, key)
        if value is not None and not (math.isfinite(value) and value > 0.0):
            faults.append((key, f"{key} is {value:g}.", "It must be above 0."))
    if faults:
        return faults
    ball, pitch, count = geometry.ball_diameter, geometry.pitch_diameter, geometry.ball_count
    if isinstance(count, bool) or int(count) != count or count < 3:
        faults.append(("ball_count", f"ball_count is {count}.", "It must be a whole number from 3."))
    elif pitch <= ball:
        faults.append(
            ("pitch_diameter", f"the ball ({ball * 1e3:g} mm) is not smaller than the pitch circle "
             f"({pitch * 1e3:g} mm).", "Give a pitch diameter above the ball diameter.")
        )  # fmt: skip
    else:
        room = math.floor(math.pi / math.asin(ball / pitch) + 1e-9)
        if count > room:
            faults.append(
                ("ball_count", f"{count} balls of {ball * 1e3:g} mm do not fit on a pitch circle of "
                 f"{pitch * 1e3:g} mm.", f"At most {room} balls fit.")
            )  # fmt: skip
    for ring in ("inner", "outer"):
        value = getattr(geometry, f"groove_curvature_{ring}")
        if not 0.5 < value <= 0.7:
            faults.append(
                (f"groove_curvature_{ring}", f"groove radius over ball diameter is {value:g}.",
                 "It must be above 0.5 (the ball must enter the groove) and at most 0.7.")
            )  # fmt: skip
    limit = geometry.shoulder_angle
    if limit is None:
        limit = BEARING_KINDS[geometry.kind].largest_free_angle
    if not 0.0 < limit <= 0.5 * math.pi:
        faults.append(("shoulder_angle", f"it is {math.degrees(limit):g}°.", "Allowed: above 0 to 90°."))
    elif not 0.0 <= geometry.contact_angle < limit:
        where = "the shoulder" if geometry.shoulder_angle is not None else "any shoulder"
        faults.append(
            ("contact_angle", f"a contact angle of {math.degrees(geometry.contact_angle):g}° lies over "
             f"{where} ({math.degrees(limit):g}°) or below 0.",
             f"Allowed: 0 to below {math.degrees(limit):g}°.")
        )  # fmt: skip
    for key in ("poisson_ratio", "ball_poisson_ratio"):
        value = getattr(geometry, key)
        if value is not None and not 0.0 <= value < 0.5:
            faults.append((key, f"it is {value:g}.", "Allowed: 0 to below 0.5."))
    if geometry.seal_moment is not None and not geometry.seal_moment >= 0.0:
        faults.append(("seal_moment", f"it is {geometry.seal_moment:g} N m.", "It must not be negative."))
    bore, outer = geometry.bore_diameter, geometry.outer_diameter
    if bore is not None and bore >= pitch - ball:
        faults.append(
            ("bore_diameter", f"{bore * 1e3:g} mm leaves no inner ring under balls that reach in to "
             f"{(pitch - ball) * 1e3:g} mm.", "Give a smaller bore.")
        )  # fmt: skip
    if outer is not None and outer <= pitch + ball:
        faults.append(
            ("outer_diameter", f"{outer * 1e3:g} mm leaves no outer ring over balls that reach out to "
             f"{(pitch + ball) * 1e3:g} mm.", "Give a larger outer diameter.")
        )  # fmt: skip
    return faults


# Orientation +1: the bearing is loaded when the shaft moves towards +z. A
# back-to-back pair (O) therefore reads (+1, -1), a face-to-face pair (X) (-1, +1).
ARRANGEMENTS: dict[str, tuple[int, ...]] = {
    "single": (1,),
    "tandem": (1, 1),
    "DT": (1, 1),
    "TT": (1, 1, 1),
    "back_to_back": (1, -1),
    "DB": (1, -1),
    "face_to_face": (-1, 1),
    "DF": (-1, 1),
    "TBT": (1, 1, -1),
    "TFT": (-1, -1, 1),
    "QBC": (1, 1, -1, -1),
    "QFC": (-1, -1, 1, 1),
    "QBT": (1, 1, 1, -1),
    "QFT": (-1, -1, -1, 1),
    "QT": (1, 1, 1, 1),
}


def select_orientations(
    arrangement: str | tuple[int, ...] | list[int], where: str = "arrangement"
) -> tuple[int, ...]:
    """Orientations of a row of bearings, +1 where shaft motion towards +z loads it.

    Parameters
    ----------
    arrangement : str or sequence of int
        A name of ``ARRANGEMENTS``, or the row itself as +1 and -1.
    where : str
        Key for the message.

    Raises
    ------
    SpecError
        A name or row that does not exist.

    >>> select_orientations("TBT")
    (1, 1, -1)
    """
    if isinstance(arrangement, str):
        if arrangement not in ARRANGEMENTS:
            raise SpecError(
                where, f"arrangement {arrangement!r} is unknown.",
                did_you_mean(arrangement, ARRANGEMENTS) + " Or a row such as [1, 1, -1].",
            )  # fmt: skip
        return ARRANGEMENTS[arrangement]
    row = tuple(arrangement)
    if not row or any(isinstance(value, bool) or value not in (1, -1) for value in row):
        raise SpecError(where, f"row {list(row)} is not a row of bearings.", "Allowed: a list of 1 and -1.")
    return tuple(int(value) for value in row)
