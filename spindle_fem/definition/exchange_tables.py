"""Tables of a machine definition: cooling channel, joints, surfaces, films and gaps."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from spindle_fem.definition.field_types import (
    AmbientOrTemperature,
    Fault,
    FilmCoefficient,
    FilmOrPerfect,
    Flag,
    Fraction,
    Name,
    Place,
    PositiveLength,
    PositiveNumber,
    Pressure,
    SpecModel,
    Temperature,
    UncertainFilm,
    UncertainLength,
    UncertainNumber,
    UncertainPlace,
    VolumeFlow,
    choice_field,
    quantity_field,
    raise_faults,
)
from spindle_fem.units import Uncertain

# Least wall left between neighbouring turns of the channel, for the milling cutter.
LEAST_LAND = 3.0e-3

Fluid = choice_field("spindle_fem.physics.coolant.coolants")
FilmModel = choice_field("spindle_fem.physics.coolant.film_models")
Orientation = choice_field("spindle_fem.physics.surroundings.natural_films")
RotatingCorrelation = choice_field("spindle_fem.physics.surroundings.rotating_films")
GapLaw = choice_field("spindle_fem.physics.surroundings.gap_laws")
ReferenceSpeed = quantity_field("rad/s", above=0.0)
CurveFlow = quantity_field("m**3/s", at_least=0.0)
CurvePressure = quantity_field("Pa", at_least=0.0)


class Ports(SpecModel):
    """Radial drillings from the channel to the outside."""

    diameter: PositiveLength
    """At most width - 2 mm fits the channel."""
    wetted: Flag = True
    """Whether the coolant exchanges heat with the walls of the drillings."""


class Channel(SpecModel):
    """Helical rectangular coolant channel."""

    part: Name
    """The standing part that it is milled into."""
    inner_radius: UncertainLength
    """Radius of the wall nearer to the axis."""
    depth: UncertainLength
    """Radial height of the section."""
    width: PositiveLength
    """Axial width of the section; width + 3 mm must not exceed pitch / starts."""
    pitch: PositiveLength
    """Advance in one turn of one start."""
    turns: PositiveNumber
    """Turns of each start; they need not be whole."""
    starts: Annotated[int, Field(ge=1, le=4, strict=True)] = 1
    """Channels side by side, evenly around the axis."""
    hand: Literal["right", "left"] = "right"
    """Right-handed advances to the rear as the angle grows."""
    z_start: UncertainPlace
    """Centre line of the section at angle 0, where the coolant enters."""
    ports: Ports | None = None
    """None leaves the channel closed in the solid at both ends."""

    @model_validator(mode="after")
    def _check(self) -> Channel:
        room = self.pitch / self.starts
        if self.width + LEAST_LAND > room + 1e-9:
            raise_faults(
                [
                    Fault(
                        "width",
                        f"{self.width * 1e3:g} mm leaves less than 3 mm between turns: pitch / starts is "
                        f"{room * 1e3:g} mm.",
                        f"Allowed: at most {(room - LEAST_LAND) * 1e3:g} mm."
                        if room > LEAST_LAND
                        else "Give a larger pitch or fewer starts.",
                    )
                ]
            )
        return self


class PumpCurve(SpecModel):
    """Pressure of a pump over its flow, linear between entries.

    Before the first entry it is level; beyond the last one the last stretch goes on.
    """

    flow: Annotated[tuple[CurveFlow, ...], Field(min_length=2)]
    """At least two increasing entries."""
    pressure: Annotated[tuple[CurvePressure, ...], Field(min_length=2)]
    """As many entries as `flow`, decreasing."""

    @model_validator(mode="after")
    def _check(self) -> PumpCurve:
        faults = []
        if any(b <= a for a, b in pairwise(self.flow)):
            faults.append(Fault("flow", "its entries do not all grow.", "Allowed: growing entries."))
        if any(b >= a for a, b in pairwise(self.pressure)):
            faults.append(Fault("pressure", "its entries do not all fall.", "Allowed: falling entries."))
        if len(self.flow) != len(self.pressure):
            fault = f"has {len(self.pressure)} entries."
            faults.append(Fault("pressure", fault, f"Allowed: {len(self.flow)}, as many as flow."))
        raise_faults(faults)
        return self


class Coolant(SpecModel):
    """Coolant in the channel."""

    fluid: Fluid = "iso_vg_32"
    """Coolant, for its properties."""
    inlet_temperature: Temperature
    """Mixed, where the coolant enters."""
    flow: VolumeFlow
    """Volume flow of all starts together; less flows where the pump's pressure does not suffice."""
    pressure_limit: Pressure | None = None
    """Pressure of the pump's relief valve: the flow through channel and drillings takes no more."""
    pump_curve: PumpCurve | None = None
    """Characteristic of the pump: the flow is at most where it meets that of channel and drillings."""
    film_model: FilmModel = "helical"
    """Correlation of the channel's film."""
    film_factor: UncertainNumber = Uncertain(1.0)
    """Factor on the film coefficient of the channel."""
    properties_at: Literal["inlet", "bulk"] = "bulk"
    """Temperature of its properties: at the inlet, or along the channel."""
    pumping_heat: Flag = False
    """Whether the pressure loss heats it."""


class SeatSurface(SpecModel):
    """Rough surfaces of ring and seat, for the law ``tight_seat``.

    With `heat.thermal_preload` the joint conducts as its fit presses or opens: by the law at
    the fit's pressure and gap over the law as assembled, where `conductance` holds.
    """

    roughness: PositiveLength = 1.0e-6
    """Combined rms of both surfaces."""
    slope: PositiveNumber = 0.1
    """Combined rms of the profiles' slopes."""
    microhardness: Pressure = 3.0e9
    """Microhardness of the softer surface."""


class JointGroup(SpecModel):
    """Contact faces that share one conductance (one factor when uncertain).

    ``contacts`` are names ``part_a|part_b`` (parts in sorted order) of a
    cylindrical contact and ``part_a|part_b:face`` of a plane one, as
    ``spindle-fem check`` lists them; ``*`` matches any text. ``perfect``
    means no resistance.
    """

    name: Name
    """Shared factors and overrides use it."""
    conductance: FilmOrPerfect
    """Heat-transfer coefficient of the joint, ``"perfect"``, or a law with its quantities."""
    contacts: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names, with `*` for any text."""
    seat: SeatSurface | None = None
    """Given for seats of rings whose fit changes what they conduct."""


class FaceSelector(SpecModel):
    """Exposed faces of a part: which way they look, and where they lie.

    Normals: ``outward`` +r, ``inward`` -r, ``front`` -z, ``rear`` +z.
    """

    facing: Literal["outward", "inward", "front", "rear"]
    """Direction of the normal."""
    z: Place | None = None
    """A place or from and to; everywhere when left out."""
    r: Place | None = None
    """A radius or from and to; everywhere when left out."""


class Surface(SpecModel):
    """A named exposed surface."""

    name: Name
    """By convention ``part.surface``."""
    part: Name
    """A part or a ring."""
    where: Annotated[tuple[FaceSelector, ...], Field(min_length=1)]
    """The union of these faces."""


def raceway_surfaces(bearing: str) -> tuple[Surface, Surface]:
    """Surfaces that a bearing names itself: inner and outer raceway."""
    sides = (("inner", "outward"), ("outer", "inward"))
    inner, outer = (
        Surface(
            name=f"{bearing}.{ring}_raceway",
            part=f"{bearing}.{ring}_ring",
            where=(FaceSelector(facing=facing),),
        )
        for ring, facing in sides
    )
    return inner, outer


class ConstantFilm(SpecModel):
    """Fixed heat-transfer coefficient."""

    kind: Literal["constant"]
    """Tells the films apart."""
    surface: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of surfaces; each surface takes one film or gap."""
    coefficient: UncertainFilm
    """Convection and radiation together."""
    temperature: AmbientOrTemperature = "ambient"
    """Temperature of the surroundings."""
    name: Name | None = None
    """Needed where a shared factor applies."""


class NaturalFilm(SpecModel):
    """Natural convection and radiation by the surface temperature."""

    kind: Literal["natural_convection_radiation"]
    """Tells the films apart."""
    surface: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of surfaces; each surface takes one film or gap."""
    characteristic_length: PositiveLength
    """Diameter of the cylinder or height of the plate."""
    orientation: Orientation = "horizontal_cylinder"
    """Correlation of natural convection."""
    emissivity: Fraction = 0.9
    """Emissivity of the surface, in large grey surroundings."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient."""
    temperature: AmbientOrTemperature = "ambient"
    """Temperature of the surroundings."""
    name: Name | None = None
    """Needed where a shared factor applies."""


class RotatingFilm(SpecModel):
    """Film of a rotating surface in air, with a floor at rest."""

    kind: Literal["rotating"]
    """Tells the films apart."""
    surface: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of surfaces; each surface takes one film or gap."""
    correlation: RotatingCorrelation = "becker"
    """Correlation of the coefficient with speed."""
    diameter: PositiveLength
    """Diameter in the Reynolds and Nusselt numbers."""
    minimum: FilmCoefficient
    """Floor, the coefficient at rest."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient."""
    temperature: AmbientOrTemperature = "ambient"
    """Temperature of the surroundings."""
    name: Name | None = None
    """Needed where a shared factor applies."""


class Gap(SpecModel):
    """Air between a rotating surface and the standing one around it.

    ``h = at_rest + rise (speed/reference_speed)**exponent`` on the rotating
    surface, or the annulus correlation of Becker & Kaye.
    """

    name: Name
    """Shared factors and overrides use it."""
    rotating: Name
    """Name of the rotating surface."""
    standing: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of the standing surfaces that face it."""
    kind: GapLaw = "power_law"
    """Law of the coefficient over speed."""
    at_rest: FilmCoefficient | None = None
    """With ``kind = "power_law"`` only."""
    rise: FilmCoefficient = 0.0
    """Added at the reference speed."""
    reference_speed: ReferenceSpeed = 314.159265359
    """3000 rpm where none is given."""
    exponent: PositiveNumber = 0.75
    """Exponent of the relative speed."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient."""

    @model_validator(mode="after")
    def _check(self) -> Gap:
        if self.kind == "power_law" and self.at_rest is None:
            raise_faults([Fault("at_rest", "is missing.", 'kind = "power_law" needs it, in W/m**2/K.')])
        if self.kind != "power_law" and self.at_rest is not None:
            raise_faults(
                [
                    Fault(
                        "at_rest",
                        f'is given, but kind = "{self.kind}" computes it.',
                        'Set kind = "power_law".',
                    )
                ]
            )
        return self
