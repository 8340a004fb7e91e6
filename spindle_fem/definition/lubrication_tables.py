"""Oil lubrication of a bearing set, and the stream of oil or air through each of its bearings."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from spindle_fem.definition.field_types import (
    Conductivity,
    Density,
    Fault,
    Fraction,
    Name,
    OilViscosity,
    PositiveLength,
    PositiveNumber,
    PressureViscosity,
    SpecModel,
    Temperature,
    UncertainNumber,
    VolumeFlow,
    choice_field,
    quantity_field,
    raise_faults,
)
from spindle_fem.definition.standard_materials import OILS
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.units import Uncertain

LubricationKind = choice_field("spindle_fem.physics.coolant.lubrication_kinds")
OilShare = quantity_field("", at_least=0.0, at_most=0.3)
FilmShare = quantity_field("", at_least=0.1, at_most=1.0)
OilFlow = quantity_field("m**3/s", above=0.0, at_most=1.0e-3)


class Lubrication(SpecModel):
    """Oil instead of grease, for every bearing of a set.

    Films and friction follow this oil. What flows carries heat away from both raceways and the balls or
    rollers of each bearing (``NAME.inner_raceway``, ``NAME.outer_raceway``, ``NAME.balls``): it enters at
    `inlet_temperature`, warms by what it takes and leaves the machine; the stream is called
    ``NAME.lubrication``.
    """

    kind: LubricationKind
    """Way of supplying the oil to the balls."""
    oil: Literal[tuple(OILS)] | None = None
    """A mineral oil that ships, which gives its viscosities and density where they are missing."""
    kinematic_viscosity_40: OilViscosity
    """Kinematic viscosity at 40 °C."""
    kinematic_viscosity_100: OilViscosity
    """Kinematic viscosity at 100 °C."""
    density: Density = 870.0
    """Density at 15 °C."""
    pressure_viscosity: PressureViscosity = 2.0e-8
    """Coefficient at ambient pressure."""
    thermal_conductivity: Conductivity = 0.13
    """Thermal conductivity of the oil in the contacts."""
    oil_flow: OilFlow
    """Through each bearing: oil-air some 0.1 to 1 cm³/h, jets 0.5 to 5 L/min."""
    air_flow: VolumeFlow | None = None
    """Through each bearing with ``kind = "oil_air"``, at 20 °C and 1.013 bar: some 20 to 60 L/min."""
    inlet_temperature: Temperature
    """Temperature of the oil, or of the air with its oil, at the inlet of the bearing."""
    palmgren_f0: PositiveNumber | None = None
    """Palmgren's lubrication factor of a row; that of the kind where none is given."""
    path_fill: OilShare | None = None
    """Share of the balls' path that oil fills, which drags on them; that of the kind where none is given."""
    wetted_share: Fraction | None = None
    """Share of the balls' surface in oil, half of it to each raceway; the filled share of their path where
    none is given."""
    film_starvation: FilmShare = 1.0
    """Film over the fully flooded one."""
    film_factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficients between stream and raceways, balls or rollers."""
    temperature_limit: Temperature = 373.15
    """The oil is checked against it."""

    @model_validator(mode="after")
    def _check(self) -> Lubrication:
        faults = []
        if self.kinematic_viscosity_100 >= self.kinematic_viscosity_40:
            what = (
                f"{self.kinematic_viscosity_100 * 1e6:g} mm²/s is not below kinematic_viscosity_40 "
                f"{self.kinematic_viscosity_40 * 1e6:g} mm²/s."
            )
            faults.append(Fault("kinematic_viscosity_100", what, "Oil thins with temperature."))
        if self.kind == "oil_air" and self.air_flow is None:
            faults.append(Fault("air_flow", "is missing.", 'kind = "oil_air" needs it.'))
        if self.kind != "oil_air" and self.air_flow is not None:
            faults.append(Fault("air_flow", "is given.", 'Only kind = "oil_air" takes it.'))
        raise_faults(faults)
        return self


class LubricationFilm(StreamFilm):
    """The stream through one bearing; made from the set's ``lubrication``, never written."""

    made: ClassVar[bool] = True
    kind: Literal["lubrication"]
    """Tells the films apart."""
    name: Name
    """Name of the bearing and ``.lubrication``."""
    bearing: Name
    """Bearing whose raceways and rolling elements it wets."""
    lubrication: Lubrication
    """Lubrication of the set."""
    pitch_diameter: PositiveLength
    """Pitch diameter of the row."""
    element_diameter: PositiveLength
    """Diameter of ball or roller."""
    axial_cosine: Annotated[float, Field(ge=0.0, le=1.0)]
    """Cosine of the contact angle."""
    inner_diameter: PositiveLength
    """Inner diameter of the annulus between the rings."""
    outer_diameter: PositiveLength
    """Outer diameter of the annulus between the rings."""
    rolls_on_balls: bool
    """Or on rollers."""
    element_surface: Annotated[float, Field(gt=0.0)]
    """Of all balls, or of all rollers without their ends, m²."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient."""

    @property
    def inlet_temperature(self) -> float:
        """Temperature of the stream at the inlet, K."""
        return self.lubrication.inlet_temperature

    @property
    def flow(self) -> float:
        """Flow of the fluid that carries the heat, air or oil, m³/s."""
        return self.lubrication.air_flow or self.lubrication.oil_flow

    @property
    def cell_surfaces(self) -> tuple[tuple[str, ...], ...]:
        """Raceways and rolling elements meet one mixed stream."""
        return ((f"{self.bearing}.inner_raceway", f"{self.bearing}.outer_raceway", self.ball_row),)

    @property
    def ball_row(self) -> str:
        """The row of the bearing."""
        return f"{self.bearing}.balls"


__all__ = ["Lubrication", "LubricationFilm"]
