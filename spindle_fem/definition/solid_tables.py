"""Tables of a machine definition: materials, parts, bearing sets and their grease."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from spindle_fem.definition.bearing_catalogue import PRELOAD_CLASSES
from spindle_fem.definition.field_types import (
    Conductivity,
    Density,
    Fault,
    Flag,
    Fraction,
    HeatCapacity,
    Name,
    OilViscosity,
    PositiveLength,
    Preload,
    Pressure,
    PressureViscosity,
    Radius,
    Range,
    SpecificHeat,
    SpecModel,
    Temperature,
    UncertainConductance,
    UncertainLength,
    UncertainNumber,
    quantity_field,
    raise_faults,
)
from spindle_fem.definition.lubrication_tables import Lubrication
from spindle_fem.units import Uncertain

PoissonRatio = quantity_field("", at_least=0.0, at_most=0.5)
SeatFriction = quantity_field("", at_least=0.0, at_most=1.0)
PathFill = quantity_field("", at_least=0.0, at_most=0.3)
FilmStarvation = quantity_field("", at_least=0.1, at_most=1.0)
ShearRatio = quantity_field("", at_least=0.005, at_most=0.2)
ShearSlope = quantity_field("1/K", at_least=0.0, at_most=0.02)
ThermalExpansion = quantity_field("1/K", at_least=0.0, at_most=1.0e-4)
FitDiameter = quantity_field("m", at_least=-1.0e-3, at_most=1.0e-3)


def _read_preload(value: Any) -> Any:
    """A force; classes of bearings that ship have become forces before."""
    if isinstance(value, str) and value.isalpha():
        classes = ", ".join(PRELOAD_CLASSES)
        allowed = f"Allowed: a force, or {classes} of ball bearings that ship, mounted against each other."
        raise_faults([Fault("", f'"{value}" gives no force here.', allowed)])
    return value


PreloadOrClass = Annotated[Preload, BeforeValidator(_read_preload)]


class Material(SpecModel):
    """Isotropic solid with constant properties."""

    thermal_conductivity: Conductivity
    """Constant over temperature."""
    density: Density
    """Constant over temperature."""
    specific_heat_capacity: SpecificHeat
    """Constant over temperature."""
    young_modulus: Pressure = 206.0e9
    """Used where bearings sit with a `fit`, and for balls of another material than their rings, which must
    give it (310 GPa for silicon nitride); rings take that of their type."""
    poisson_ratio: PoissonRatio = 0.3
    """Used like `young_modulus`; 0.26 for silicon nitride."""
    thermal_expansion: ThermalExpansion = 12.5e-6
    """Linear, for rings, balls, shaft and housing; growth and `heat.thermal_preload` follow it."""

    @property
    def volumetric_heat_capacity(self) -> float:
        """ρ c_p in J/(m³·K)."""
        return self.density * self.specific_heat_capacity


# m; a unit was mistaken beyond it.
_LARGEST_PART = 5.0
# Least bore as a share of the outer diameter: a finer one takes millions of elements and carries no heat.
_LEAST_BORE = 0.01


class AnnulusSegment(SpecModel):
    """A ring of rectangular meridian section."""

    name: Name
    """Unique within its part."""
    z: Range
    """Start and end along the axis; z = 0 is the spindle nose."""
    inner_diameter: Radius
    """0 for a solid shaft, else at least a hundredth of the outer one."""
    outer_diameter: UncertainLength
    """Larger than the inner one; with a `sigma` where it is an outside of a standing part."""

    @model_validator(mode="after")
    def _check(self) -> AnnulusSegment:
        sizes = {"z": max(map(abs, self.z)), "outer_diameter": self.outer_diameter}
        vast = [
            Fault(
                key, f"{size:g} m is no spindle's.", f"Allowed: up to {_LARGEST_PART:g} m; is the unit right?"
            )
            for key, size in sizes.items()
            if size > _LARGEST_PART
        ]
        if vast:
            raise_faults(vast)
        if self.inner_diameter >= self.outer_diameter:
            raise_faults(
                [
                    Fault(
                        "outer_diameter",
                        f"{self.outer_diameter * 1e3:g} mm leaves no wall around "
                        f"inner_diameter {self.inner_diameter * 1e3:g} mm.",
                        f"Allowed: above {self.inner_diameter * 1e3:g} mm.",
                    )
                ]
            )
        least = _LEAST_BORE * self.outer_diameter
        if 0.0 < self.inner_diameter < least:
            raise_faults(
                [
                    Fault(
                        "inner_diameter",
                        f"{self.inner_diameter * 1e3:g} mm is no bore of a part of "
                        f"{self.outer_diameter * 1e3:g} mm that can be meshed.",
                        f"Allowed: 0 mm for a solid one, or {least * 1e3:g} mm and more.",
                    )
                ]
            )
        return self


class Part(SpecModel):
    """One solid of revolution: its segments are fused."""

    name: Name
    """Name in joints, surfaces and probes."""
    material: Name
    """A key of ``[materials]``, or one that ships."""
    rotating: Flag = False
    """Whether it turns with the shaft."""
    segment: Annotated[tuple[AnnulusSegment, ...], Field(min_length=1)]
    """Rings that are fused to the solid; they share faces or overlap."""


class SetBearing(SpecModel):
    """One bearing of a set."""

    name: Name
    """Its rings are the parts `NAME.inner_ring` and `NAME.outer_ring`."""
    z: Range
    """Start and end of its rings, as long as the type is wide; or their start only."""
    takes_thrust: Literal["towards_rear", "towards_nose"] | None = None
    """Direction of the force on the shaft that this ball bearing carries; rollers carry none. `towards_rear`
    in front and `towards_nose` behind it are back to back (contact lines above the axis: ``/ \\``), the other
    way round face to face, twice the same tandem."""
    bearing_type: Annotated[str, Field(strict=True)] | None = None
    """Type if different from its set's: other balls, another contact angle; balls with balls only."""


class BallRow(SpecModel):
    """Heat paths between raceways through the balls.

    ``contact`` takes the constriction, ball and lubricant resistances of the
    paper's Table 1; ``constant`` a conductance to each raceway.
    """

    kind: Literal["contact", "constant"] = "contact"
    """Model of the conductances between balls and raceways."""
    conductance: UncertainConductance | None = None
    """Balls of one bearing to each raceway, with ``kind = "constant"`` only."""
    capacity: HeatCapacity | None = None
    """Heat capacity of the balls of one bearing; from their volume where none is given."""

    @model_validator(mode="after")
    def _check(self) -> BallRow:
        if self.kind == "constant" and self.conductance is None:
            raise_faults([Fault("conductance", "is missing.", 'kind = "constant" needs it, in W/K.')])
        if self.kind == "contact" and self.conductance is not None:
            raise_faults(
                [
                    Fault(
                        "conductance", 'is given, but kind = "contact" computes it.', 'Set kind = "constant".'
                    )
                ]
            )
        return self


class Fit(SpecModel):
    """Seats of a set's rings, cold and at rest.

    With `heat.thermal_preload` they change with temperature and speed, rings
    and seats give way as the parts around them do, and `contact_angle` is that
    of the unmounted bearing. Without it, or without a fit, rings are rigid and
    `contact_angle` is that of the mounted one.
    """

    inner_interference: FitDiameter
    """Interference of the inner rings on the shaft, on the diameter; negative: clearance."""
    outer_clearance: FitDiameter
    """Clearance of the outer rings in the housing, on the diameter; negative: interference."""
    housing_outer_diameter: PositiveLength | None = None
    """Outer diameter of the wall around the outer rings; that of the part they sit in where none is given."""
    outer_ring: Literal["slides", "held"] | None = None
    """Springs find outer rings that slide in the housing, so that their force stays and lengthening by
    temperature is taken up by travel, or rings held in stuck seats: the loop then closes as a locknut's,
    whose rings are held, with the springs' force at assembly. Sliding with springs where nothing is given."""
    seat_friction: SeatFriction = 0.12
    """Friction of outer rings that slide in the housing: 0.12 of rings pressed in, 0.18 of rings pulled out
    (NTN, Rolling bearings). Seats that hold more than the set's force are warned of."""


class BearingSet(SpecModel):
    """Bearings mounted and preloaded against one another."""

    name: Name
    """Shared factors and overrides use it."""
    bearing_type: Annotated[str, Field(strict=True)]
    """A key of ``[bearing_types]``, or a bearing that ships, such as ``7014 C`` or ``NN3014 K``."""
    preload: PreloadOrClass = 0.0
    """Force through the set, which sets of ball bearings must give; bearings in tandem share it. `light`,
    `medium` or `heavy` of bearings that ship; `"0 N"` of bearings that all face one way and that the springs
    of another set load. Rollers have `radial_clearance` instead."""
    preload_kind: Literal["rigid", "elastic", "spring"] = "rigid"
    """Held by a distance (rings, locknut), by a distance between shaft, housing and spacers that give way
    along the axis, or by a force (springs). Springs may load a set whose bearings all
    face one way, as two at the rear in tandem: each carries its share whatever the thrust, and the set
    that carries the thrust holds against them."""
    fit: Fit | None = None
    """Fits of its rings; rigid rings if not given."""
    assembly_temperature: Temperature = 293.15
    """Temperature at which preload and fits are measured."""
    carries_thrust: Flag = False
    """Exactly one set of a machine, of ball bearings, takes the external thrust."""
    carries_radial: Flag = True
    """Whether the set holds the shaft against radial loads; false for one with play in its housing."""
    heat_factor: UncertainNumber = Uncertain(1.0)
    """Factor on the friction heat of every bearing of the set."""
    ball_row: BallRow = BallRow()
    """Heat paths through the balls."""
    lubrication: Lubrication | None = None
    """Oil in the place of ``[grease]``."""
    bearing: Annotated[tuple[SetBearing, ...], Field(min_length=1)]
    """From the nose to the rear."""
    spacers: Name | None = None
    """A material: bearings with gaps get rings between them, the parts `NAME_inner_spacer` and
    `NAME_outer_spacer` of the set NAME (numbered where there are several), unless the file has such parts."""

    def type_name(self, bearing: SetBearing) -> str:
        """Key of a bearing's type: its own, or that of the set."""
        return self.bearing_type if bearing.bearing_type is None else bearing.bearing_type

    @property
    def faces_one_way(self) -> bool:
        """Whether all of its bearings take thrust in one direction."""
        directions = {bearing.takes_thrust for bearing in self.bearing}
        return len(directions) == 1 and None not in directions

    @property
    def is_sprung(self) -> bool:
        """Whether springs push rings that slide."""
        held = self.fit is not None and self.fit.outer_ring == "held"
        return self.preload_kind == "spring" and not held

    @property
    def spring_force(self) -> float:
        """Force of its springs on the shaft, N, positive towards the rear; 0 of springs within the set."""
        if self.preload_kind != "spring" or not self.faces_one_way:
            return 0.0
        return self.preload if self.bearing[0].takes_thrust == "towards_nose" else -self.preload

    @model_validator(mode="after")
    def _check(self) -> BearingSet:
        if self.preload_kind != "spring" and self.preload > 0.0 and self.faces_one_way:
            raise_faults(
                [
                    Fault(
                        "preload",
                        f"{self.preload:g} N is {self.preload_kind}, but every bearing of the set "
                        f'takes_thrust "{self.bearing[0].takes_thrust}".',
                        'Allowed: bearings of both directions, preload_kind = "spring", or no preload.',
                    )
                ]
            )
        return self


class Grease(SpecModel):
    """Lubricating grease by its base oil."""

    catalogue: str | None = None
    """A grease that ships, which gives what is missing: ``high_speed_grease``, ``general_grease``."""
    name: str
    """Name in reports."""
    kinematic_viscosity_40: OilViscosity
    """Base oil at 40 °C."""
    kinematic_viscosity_100: OilViscosity
    """Base oil at 100 °C."""
    base_oil_density: Density = 890.0
    """Density of the oil, lighter than the grease."""
    pressure_viscosity: PressureViscosity = 1.8e-8
    """Coefficient at ambient pressure."""
    path_fill: PathFill = 0.01
    """Share of the balls' path that grease fills once channelled; it drags on the balls."""
    free_volume_fill: Fraction = 0.3
    """Share of the bearing's free volume that grease fills."""
    wetted_share: Fraction | None = None
    """Share of the balls' surface in grease, half of it to each raceway; the fill where none is given."""
    thermal_conductivity: Conductivity = 0.14
    """Thermal conductivity of the base oil."""
    temperature_limit: Temperature = 393.15
    """The grease is checked against it."""
    film_starvation: FilmStarvation = 1.0
    """Film over the fully flooded one; 0.5 to 0.7 in aged grease."""
    limiting_shear_ratio: ShearRatio = 0.07
    """Limiting shear stress of the film over its pressure, at 40 °C: 0.03 to 0.05 of synthetic oils, up to
    0.1 of naphthenic ones. It says how friction grows with a preload of several times that of assembly."""
    limiting_shear_slope: ShearSlope = 0.0
    """Relative fall of that ratio with temperature, about 0.5 % a kelvin."""

    @model_validator(mode="after")
    def _check(self) -> Grease:
        if self.kinematic_viscosity_100 >= self.kinematic_viscosity_40:
            raise_faults(
                [
                    Fault(
                        "kinematic_viscosity_100",
                        f"{self.kinematic_viscosity_100 * 1e6:g} mm²/s is not below kinematic_viscosity_40 "
                        f"{self.kinematic_viscosity_40 * 1e6:g} mm²/s.",
                        "Oil thins with temperature.",
                    )
                ]
            )
        return self


__all__ = [
    "AnnulusSegment",
    "BallRow",
    "BearingSet",
    "Fit",
    "Grease",
    "Material",
    "Part",
    "SetBearing",
]
