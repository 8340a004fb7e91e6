"""Tables of a machine definition: types of bearing, with balls and with rollers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from spindle_fem.definition.field_types import (
    Angle,
    Fault,
    Name,
    PositiveForce,
    PositiveLength,
    PositiveNumber,
    Pressure,
    SpecModel,
    choice_field,
    quantity_field,
    raise_faults,
)


def has_rollers(kind: str) -> bool:
    """Whether a kind's rolling elements are rollers.

    >>> has_rollers("cylindrical_roller"), has_rollers("angular_contact_ball")
    (True, False)
    """
    return kind.endswith("_roller")


_KINDS = "spindle_fem.physics.bearings.bearing_kinds"
BallKind = choice_field(_KINDS, keep=lambda name: not has_rollers(name))
RollerKind = choice_field(_KINDS, keep=has_rollers)
GrooveCurvature = quantity_field("", at_least=0.505, at_most=0.6)
PoissonRatio = quantity_field("", at_least=0.0, at_most=0.5)
SealMoment = quantity_field("N*m", at_least=0.0, at_most=10.0)
RadialClearance = quantity_field("m", at_least=-1.0e-4, at_most=1.0e-3)


class Cage(SpecModel):
    """A cage that runs on a ring's land and shears the oil between, by Petroff's law; heat model `full`."""

    land_diameter: PositiveLength
    """Diameter of the ring's land."""
    land_width: PositiveLength
    """Width of the land that guides the cage, both sides together."""
    clearance: PositiveLength
    """Between cage and land, on the radius."""
    land: Literal["inner", "outer"] = "outer"
    """Ring that guides it."""


class _BearingType(SpecModel):
    """Keys common to all bearings; ``catalogue`` supplies missing ones."""

    catalogue: str | None = None
    """Designation of a bearing that ships, such as ``7014 C``, ``NN3014 K``, which supplies missing keys."""
    bore_diameter: PositiveLength
    """Bore of the inner ring."""
    outer_diameter: PositiveLength
    """Outside of the outer ring."""
    width: PositiveLength
    """Width of both rings."""
    inner_ring_outer_diameter: PositiveLength
    """Cylinder that represents the inner ring's outside, where its heat enters."""
    outer_ring_inner_diameter: PositiveLength
    """Cylinder that represents the outer ring's inside, where its heat enters."""
    pitch_diameter: PositiveLength | None = None
    """The middle of bore and outside where none is given."""
    ring_material: Name
    """A key of `[materials]`."""
    young_modulus: Pressure = 206.0e9
    """Young's modulus of the rings, and of balls or rollers of the same material."""
    poisson_ratio: PoissonRatio = 0.3
    """Poisson's ratio of the rings, and of balls or rollers of the same material."""
    roughness_raceway: PositiveLength = 0.05e-6
    """Root mean square (Rq)."""
    seal_moment: SealMoment | None = None
    """Friction moment of the rubbing seals of one bearing, both together; their heat joins the bearing's."""

    @model_validator(mode="after")
    def _check(self) -> _BearingType:
        raise_faults([*self._ring_faults(), *self._element_faults()])
        return self

    def _ring_faults(self) -> list[Fault]:
        names = ("bore_diameter", "inner_ring_outer_diameter", "outer_ring_inner_diameter", "outer_diameter")
        diameters = [getattr(self, name) for name in names]
        return [
            Fault(
                names[position],
                f"{diameters[position] * 1e3:g} mm does not exceed "
                f"{names[position - 1]} {diameters[position - 1] * 1e3:g} mm.",
                f"Diameters must grow in the order {', '.join(names)}.",
            )
            for position in range(1, 4)
            if diameters[position] <= diameters[position - 1]
        ]

    def _element_faults(self) -> list[Fault]:
        """Balls or rollers that cut through a ring, or are too many for their pitch circle."""
        faults, word = [], self.element_word
        size, pitch = f"{self.element_diameter * 1e3:g}", f"{self.pitch * 1e3:g}"
        key = "pitch_diameter" if self.pitch_diameter is not None else f"{word}_diameter"
        if (
            not self.bore_diameter
            < self.pitch - self.element_diameter
            < self.pitch + self.element_diameter
            < self.outer_diameter
        ):
            faults.append(
                Fault(
                    key,
                    f"{word}s of {size} mm on {pitch} mm cut through a ring.",
                    f"pitch_diameter ± {word}_diameter must lie between the bore "
                    f"{self.bore_diameter * 1e3:g} mm and the outside {self.outer_diameter * 1e3:g} mm.",
                )
            )
        most = int(math.pi / math.asin(min(1.0, self.element_diameter / self.pitch)))
        if self.element_count > most:
            faults.append(
                Fault(
                    f"{word}_count",
                    f"{self.element_count} {word}s of {size} mm do not fit the pitch diameter {pitch} mm.",
                    f"Allowed: at most {most}.",
                )
            )
        return faults

    @property
    def pitch(self) -> float:
        """Pitch diameter in m; the middle of bore and outside where none is given."""
        if self.pitch_diameter is not None:
            return self.pitch_diameter
        return 0.5 * (self.bore_diameter + self.outer_diameter)


class BallBearingType(_BearingType):
    """Catalogue dimensions of a ball bearing.

    With ``catalogue``, and of a bearing that ships and that a set names
    directly, what is given here replaces the catalogue's.
    """

    kind: BallKind = "angular_contact_ball"
    """Kind of bearing, for the empirical friction models."""
    ball_diameter: PositiveLength
    """Between the groove bottoms."""
    ball_count: Annotated[int, Field(ge=3, le=200, strict=True)]
    """Number in one row."""
    contact_angle: Angle
    """Unloaded, above 0 up to 60 degrees; of a `deep_groove_ball` it follows from `radial_clearance`."""
    radial_clearance: PositiveLength | None = None
    """Clearance on the diameter as mounted, for a `deep_groove_ball`."""
    groove_curvature_inner: GrooveCurvature
    """Groove radius over ball diameter."""
    groove_curvature_outer: GrooveCurvature
    """Groove radius over ball diameter."""
    basic_static_load: PositiveForce | None = None
    """C0 of the catalogue, for the empirical friction models."""
    ball_material: Name
    """A key of `[materials]`."""
    roughness_ball: PositiveLength = 0.01e-6
    """Root mean square (Rq)."""
    cage: Cage | None = None
    """Guidance of the cage by a land, for the heat model `full`."""

    def _element_faults(self) -> list[Fault]:
        faults = super()._element_faults()
        if self.radial_clearance is not None and self.kind != "deep_groove_ball":
            what = f"a {self.kind} has a contact_angle instead."
            faults.append(Fault("radial_clearance", what, 'Leave it out, or give kind = "deep_groove_ball".'))
        if not 0.0 < self.contact_angle <= math.radians(60.0) + 1e-9:
            faults.append(
                Fault(
                    "contact_angle",
                    f"{math.degrees(self.contact_angle):g} deg is no angular contact.",
                    "Allowed: above 0 up to 60 deg.",
                )
            )
        return faults

    element_word: ClassVar[str] = "ball"
    element_length: ClassVar[float] = 0.0
    rows: ClassVar[int] = 1

    @property
    def element_diameter(self) -> float:
        """Diameter of a ball, m."""
        return self.ball_diameter

    @property
    def element_count(self) -> int:
        """Balls of a row."""
        return self.ball_count

    @property
    def element_material(self) -> str:
        """A key of the materials."""
        return self.ball_material

    @property
    def element_volume(self) -> float:
        """Volume of all balls, m³."""
        return self.ball_count * math.pi / 6.0 * self.ball_diameter**3

    @property
    def element_surface(self) -> float:
        """Surface of all balls, m²."""
        return self.ball_count * math.pi * self.ball_diameter**2

    @property
    def play(self) -> float:
        """Play of the raceways on the diameter before mounting, m."""
        apart = (self.groove_curvature_inner + self.groove_curvature_outer - 1.0) * self.ball_diameter
        return 2.0 * apart * (1.0 - math.cos(self.contact_angle))


class RollerBearingType(_BearingType):
    """Catalogue dimensions of a cylindrical roller bearing, which carries no thrust.

    With ``catalogue``, and of a bearing that ships and that a set names
    directly, what is given here replaces the catalogue's. With `heat.thermal_preload` its rings and
    rollers grow freely from `radial_clearance`; a `fit` of its own it does not take.
    """

    kind: RollerKind
    """Kind of bearing, for the empirical friction models."""
    roller_diameter: PositiveLength
    """Rollers are cylinders that end in relieved edges."""
    roller_length: PositiveLength
    """Bearing length, without edges."""
    roller_count: Annotated[int, Field(ge=3, le=200, strict=True)]
    """Number in one row."""
    rows: Annotated[int, Field(ge=1, le=2, strict=True)] = 1
    """Two are staggered by half a pitch."""
    radial_clearance: RadialClearance = 0.0
    """Clearance on the diameter as mounted, cold and at rest; negative: preloaded. Machine-tool bearings are
    driven up their taper to about 0."""
    palmgren_f0: PositiveNumber | None = None
    """Palmgren's lubrication factor of a row; that of the kind, 1 with grease, where none is given."""
    roller_material: Name
    """A key of `[materials]`."""
    roughness_roller: PositiveLength = 0.05e-6
    """Root mean square (Rq)."""

    element_word: ClassVar[str] = "roller"

    def _element_faults(self) -> list[Fault]:
        faults = super()._element_faults()
        if self.rows * self.roller_length > self.width:
            faults.append(
                Fault(
                    "roller_length",
                    f"{self.rows} x {self.roller_length * 1e3:g} mm is longer than the rings are wide.",
                    f"Allowed: up to {self.width / self.rows * 1e3:g} mm.",
                )
            )
        return faults

    @property
    def element_diameter(self) -> float:
        """Diameter of a roller, m."""
        return self.roller_diameter

    @property
    def element_length(self) -> float:
        """Bearing length of a roller, m."""
        return self.roller_length

    @property
    def element_count(self) -> int:
        """Rollers of a row."""
        return self.roller_count

    @property
    def element_material(self) -> str:
        """A key of the materials."""
        return self.roller_material

    @property
    def element_volume(self) -> float:
        """Volume of all rollers, m³."""
        one = 0.25 * math.pi * self.roller_diameter**2 * self.roller_length
        return self.rows * self.roller_count * one

    @property
    def element_surface(self) -> float:
        """Surface of all rollers without their ends, m²."""
        return self.rows * self.roller_count * math.pi * self.roller_diameter * self.roller_length


def _elements(given: Any) -> str:
    kind = given.get("kind") if isinstance(given, Mapping) else getattr(given, "kind", None)
    return "rollers" if isinstance(kind, str) and has_rollers(kind) else "balls"


BearingType = Annotated[
    Annotated[BallBearingType, Tag("balls")] | Annotated[RollerBearingType, Tag("rollers")],
    Discriminator(_elements),
]

__all__ = ["BallBearingType", "BearingType", "Cage", "RollerBearingType"]
