"""The machine definition as frozen models, one class a table of the file.

Every number is SI and every temperature kelvin once it has been read.
Consistency inside one table is checked here; what needs several tables is
checked in :mod:`spindle_fem.spec.consistency`, what needs the geometry in
:mod:`spindle_fem.geometry`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from spindle_fem.spec.fields import (
    Angle,
    Conductivity,
    Density,
    FilmCoefficient,
    Force,
    Fraction,
    HeatCapacity,
    KinematicViscosity,
    Length,
    Name,
    Number,
    Power,
    Pressure,
    PressureViscosity,
    Range,
    RotationalSpeed,
    SpecificHeat,
    SpecModel,
    Temperature,
    UncertainConductance,
    UncertainFilm,
    UncertainNumber,
    VolumeFlow,
)
from spindle_fem.units import Uncertain

MACHINE_SCHEMA = "spindle-fem/machine/1"


def _require_positive(model: SpecModel, *names: str) -> None:
    for name in names:
        value = getattr(model, name)
        if value is not None and value <= 0.0:
            raise ValueError(f"{name} is {value:g} in SI, it must be above 0.")


def _require_between(model: SpecModel, low: float, high: float, *names: str) -> None:
    for name in names:
        value = getattr(model, name)
        if not low <= value <= high:
            raise ValueError(f"{name} is {value:g}, allowed: {low:g} to {high:g}.")


class Operation(SpecModel):
    """Steady operating point."""

    speed: RotationalSpeed
    thrust: Force
    ambient_temperature: Temperature

    @model_validator(mode="after")
    def _check(self) -> Operation:
        if self.speed < 0.0:
            raise ValueError(f"speed is {self.speed:g} rad/s, it must not be negative.")
        return self


class Material(SpecModel):
    """Isotropic solid with constant properties."""

    thermal_conductivity: Conductivity
    density: Density
    specific_heat_capacity: SpecificHeat

    @model_validator(mode="after")
    def _check(self) -> Material:
        _require_positive(self, "thermal_conductivity", "density", "specific_heat_capacity")
        return self

    @property
    def volumetric_heat_capacity(self) -> float:
        """ρ c_p in J/(m³·K)."""
        return self.density * self.specific_heat_capacity


class AnnulusSegment(SpecModel):
    """A ring of rectangular meridian section."""

    name: Name
    z: Range
    inner_diameter: Length
    outer_diameter: Length

    @model_validator(mode="after")
    def _check(self) -> AnnulusSegment:
        if self.z[1] <= self.z[0]:
            raise ValueError(f"z runs from {self.z[0]:g} m to {self.z[1]:g} m, the end must lie beyond the start.")
        if not 0.0 <= self.inner_diameter < self.outer_diameter:
            raise ValueError(
                f"inner_diameter {self.inner_diameter:g} m and outer_diameter {self.outer_diameter:g} m "
                "must obey 0 <= inner < outer."
            )
        return self


class Part(SpecModel):
    """One solid of revolution: its segments are fused."""

    name: Name
    material: Name
    rotating: bool = False
    segment: Annotated[tuple[AnnulusSegment, ...], Field(min_length=1)]


class BearingType(SpecModel):
    """Catalogue dimensions of an angular-contact ball bearing."""

    bore_diameter: Length
    outer_diameter: Length
    width: Length
    inner_ring_outer_diameter: Length
    outer_ring_inner_diameter: Length
    inner_raceway_diameter: Length | None = None
    outer_raceway_diameter: Length | None = None
    ball_diameter: Length
    ball_count: Annotated[int, Field(ge=3, le=200)]
    pitch_diameter: Length | None = None
    contact_angle: Angle
    groove_curvature_inner: Fraction
    groove_curvature_outer: Fraction
    basic_static_load: Force | None = None
    ring_material: Name
    ball_material: Name
    young_modulus: Pressure = 206.0e9
    poisson_ratio: Fraction = 0.3
    roughness_raceway: Length = 0.05e-6
    roughness_ball: Length = 0.01e-6

    @model_validator(mode="after")
    def _check(self) -> BearingType:
        _require_positive(self, "bore_diameter", "width", "ball_diameter", "young_modulus")
        diameters = (
            self.bore_diameter,
            self.inner_ring_outer_diameter,
            self.outer_ring_inner_diameter,
            self.outer_diameter,
        )
        if sorted(diameters) != list(diameters) or len(set(diameters)) != 4:
            raise ValueError(
                "diameters must grow in the order bore, inner ring outer, outer ring inner, outer; they are "
                + ", ".join(f"{diameter * 1e3:g} mm" for diameter in diameters)
                + "."
            )
        if not self.bore_diameter < self.pitch < self.outer_diameter:
            raise ValueError(f"pitch_diameter {self.pitch * 1e3:g} mm lies outside the rings.")
        if self.ball_count * self.ball_diameter >= 3.1415 * self.pitch:
            raise ValueError(
                f"ball_count {self.ball_count} of ball_diameter {self.ball_diameter * 1e3:g} mm does not fit "
                f"the pitch diameter {self.pitch * 1e3:g} mm."
            )
        for name in ("groove_curvature_inner", "groove_curvature_outer"):
            _require_between(self, 0.505, 0.6, name)
        _require_between(self, 0.0, 0.5, "poisson_ratio")
        if not 0.0 < self.contact_angle < 1.05:
            raise ValueError(f"contact_angle is {self.contact_angle:g} rad, allowed: above 0 up to 60 degrees.")
        return self

    @property
    def pitch(self) -> float:
        """Pitch diameter in m; the middle of bore and outside where none is given."""
        if self.pitch_diameter is not None:
            return self.pitch_diameter
        return 0.5 * (self.bore_diameter + self.outer_diameter)


class SetBearing(SpecModel):
    """One bearing of a set."""

    name: Name
    z: Range
    takes_thrust: Literal["towards_rear", "towards_nose"]


class BallRow(SpecModel):
    """Heat paths between raceways through the balls.

    ``contact`` takes the constriction, ball and lubricant resistances of the
    paper's Table 1; ``constant`` a conductance to each raceway.
    """

    kind: Literal["contact", "constant"] = "contact"
    conductance: UncertainConductance | None = None
    capacity: HeatCapacity | None = None
    grease_conductance: UncertainConductance | None = None

    @model_validator(mode="after")
    def _check(self) -> BallRow:
        if (self.kind == "constant") != (self.conductance is not None):
            raise ValueError('conductance goes with kind = "constant", and only with it.')
        return self


class BearingSet(SpecModel):
    """Bearings mounted and preloaded against one another."""

    name: Name
    bearing_type: Name
    preload: Force
    preload_kind: Literal["rigid", "spring"] = "rigid"
    carries_thrust: bool = False
    heat_factor: UncertainNumber = Uncertain(1.0)
    ball_row: BallRow = BallRow()
    bearing: Annotated[tuple[SetBearing, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> BearingSet:
        if self.preload < 0.0:
            raise ValueError(f"preload is {self.preload:g} N, it must not be negative.")
        return self


class Grease(SpecModel):
    """Lubricating grease by its base oil."""

    name: str
    kinematic_viscosity_40: KinematicViscosity
    kinematic_viscosity_100: KinematicViscosity
    base_oil_density: Density = 890.0
    pressure_viscosity: PressureViscosity = 1.8e-8
    path_fill: Fraction = 0.01
    thermal_conductivity: Conductivity = 0.14
    temperature_limit: Temperature = 393.15
    film_starvation: Fraction = 1.0

    @model_validator(mode="after")
    def _check(self) -> Grease:
        if not 0.0 < self.kinematic_viscosity_100 < self.kinematic_viscosity_40:
            raise ValueError("kinematic viscosity must fall from 40 °C to 100 °C and stay above 0.")
        _require_between(self, 0.0, 0.3, "path_fill")
        _require_between(self, 0.1, 1.0, "film_starvation")
        return self


class Ports(SpecModel):
    """Radial drillings from the channel to the outside."""

    diameter: Length
    wetted: bool = True

    @model_validator(mode="after")
    def _check(self) -> Ports:
        _require_positive(self, "diameter")
        return self


class Channel(SpecModel):
    """Helical rectangular oil channel."""

    part: Name
    inner_radius: Length
    depth: Length
    width: Length
    pitch: Length
    turns: Number
    starts: Annotated[int, Field(ge=1, le=4)] = 1
    hand: Literal["right", "left"] = "right"
    z_start: Length
    ports: Ports | None = None

    @model_validator(mode="after")
    def _check(self) -> Channel:
        _require_positive(self, "inner_radius", "depth", "width", "pitch", "turns")
        if self.width + 3.0e-3 > self.pitch / self.starts + 1e-9:
            raise ValueError(
                f"width {self.width * 1e3:g} mm + 3 mm must not exceed pitch / starts = "
                f"{self.pitch / self.starts * 1e3:g} mm."
            )
        return self


class Coolant(SpecModel):
    """Oil in the channel."""

    fluid: Literal["iso_vg_32", "water"] = "iso_vg_32"
    inlet_temperature: Temperature
    flow: VolumeFlow
    film_model: Literal["paper", "sieder_tate", "helical"] = "helical"
    film_factor: UncertainNumber = Uncertain(1.0)
    properties_at: Literal["inlet", "bulk"] = "bulk"
    pumping_heat: bool = False

    @model_validator(mode="after")
    def _check(self) -> Coolant:
        _require_positive(self, "flow")
        return self


class HeatTable(SpecModel):
    """Heat of each bearing against speed, linear between entries."""

    speed: tuple[RotationalSpeed, ...]
    heat: dict[str, tuple[Power, ...]]
    thrust_coefficient: dict[str, Number] = Field(default_factory=dict)
    reference_thrust: Force = 1750.0

    @model_validator(mode="after")
    def _check(self) -> HeatTable:
        if len(self.speed) < 2 or any(b <= a for a, b in zip(self.speed, self.speed[1:], strict=False)):
            raise ValueError("speed needs at least two entries that grow.")
        for name, values in self.heat.items():
            if len(values) != len(self.speed):
                raise ValueError(f"heat.{name} has {len(values)} entries, speed has {len(self.speed)}.")
            if min(values) < 0.0:
                raise ValueError(f"heat.{name} has a negative entry.")
        return self


class Heat(SpecModel):
    """Friction heat of the bearings and where it enters.

    ``ball_share`` of it goes to the balls, ``inner_share`` of the rest to the
    inner ring.
    """

    model: Literal["table", "palmgren", "skf", "paper", "full"]
    ball_share: Fraction = 0.5
    inner_share: UncertainNumber = Uncertain(0.5)
    palmgren_f0: Number = 2.0
    skf_mu_ehl: Number = 0.04
    table: HeatTable | None = None

    @model_validator(mode="after")
    def _check(self) -> Heat:
        _require_between(self, 0.0, 1.0, "ball_share")
        if not 0.0 <= self.inner_share.value <= 1.0:
            raise ValueError(f"inner_share is {self.inner_share.value:g}, allowed: 0 to 1.")
        if self.model == "table" and self.table is None:
            raise ValueError('model = "table" needs a [heat.table].')
        return self


class JointGroup(SpecModel):
    """Contact faces that share one conductance (one factor when uncertain).

    ``contacts`` are names ``part_a|part_b`` (parts in sorted order) of a
    cylindrical contact and ``part_a|part_b:face`` of a plane one, as
    ``spindle-fem check`` lists them; ``*`` stands for any text. ``perfect``
    means no resistance.
    """

    name: Name
    conductance: UncertainFilm | Literal["perfect"]
    contacts: Annotated[tuple[str, ...], Field(min_length=1)]

    @field_validator("conductance", mode="after")
    @classmethod
    def _check(cls, value: Any) -> Any:
        if value != "perfect" and value.value < 0.0:
            raise ValueError(f"conductance is {value.value:g} W/(m²·K), it must not be negative.")
        return value


class FaceSelector(SpecModel):
    """Exposed faces of a part: which way they look, and where they lie.

    Normals: ``outward`` +r, ``inward`` -r, ``front`` -z, ``rear`` +z.
    """

    facing: Literal["outward", "inward", "front", "rear"]
    z: Range | None = None
    r: Range | None = None

    @model_validator(mode="before")
    @classmethod
    def _single_values(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        return {
            key: [value, value] if key in ("z", "r") and isinstance(value, str) else value
            for key, value in data.items()
        }


class Surface(SpecModel):
    """A named exposed surface."""

    name: Name
    part: Name
    where: Annotated[tuple[FaceSelector, ...], Field(min_length=1)]


class ConstantFilm(SpecModel):
    """Fixed heat-transfer coefficient."""

    kind: Literal["constant"]
    surface: tuple[Name, ...]
    coefficient: UncertainFilm
    temperature: Literal["ambient"] | Temperature = "ambient"
    name: Name | None = None


class NaturalFilm(SpecModel):
    """Natural convection and radiation by the surface temperature."""

    kind: Literal["natural_convection_radiation"]
    surface: tuple[Name, ...]
    characteristic_length: Length
    orientation: Literal["horizontal_cylinder", "vertical_plate"] = "horizontal_cylinder"
    emissivity: Fraction = 0.9
    factor: UncertainNumber = Uncertain(1.0)
    temperature: Literal["ambient"] | Temperature = "ambient"
    name: Name | None = None

    @model_validator(mode="after")
    def _check(self) -> NaturalFilm:
        _require_positive(self, "characteristic_length")
        _require_between(self, 0.0, 1.0, "emissivity")
        return self


class RotatingFilm(SpecModel):
    """Film of a rotating surface in air (Becker), with a floor at rest."""

    kind: Literal["rotating"]
    surface: tuple[Name, ...]
    diameter: Length
    minimum: FilmCoefficient
    factor: UncertainNumber = Uncertain(1.0)
    temperature: Literal["ambient"] | Temperature = "ambient"
    name: Name | None = None

    @model_validator(mode="after")
    def _check(self) -> RotatingFilm:
        _require_positive(self, "diameter")
        return self


Film = Annotated[ConstantFilm | NaturalFilm | RotatingFilm, Field(discriminator="kind")]


class Gap(SpecModel):
    """Air between a rotating surface and the standing one around it.

    ``h = at_rest + rise (speed/reference_speed)**exponent`` on the rotating
    surface, or the annulus correlation of Becker & Kaye.
    """

    name: Name
    rotating: Name
    standing: tuple[Name, ...]
    kind: Literal["power_law", "becker_kaye"] = "power_law"
    at_rest: FilmCoefficient | None = None
    rise: FilmCoefficient = 0.0
    reference_speed: RotationalSpeed = 314.159265359
    exponent: Number = 0.75
    factor: UncertainNumber = Uncertain(1.0)

    @model_validator(mode="after")
    def _check(self) -> Gap:
        if (self.kind == "power_law") != (self.at_rest is not None):
            raise ValueError('at_rest goes with kind = "power_law", and only with it.')
        return self


class SharedFactor(SpecModel):
    """One uncertain factor, 1 when nominal, on several coefficients at once.

    ``applies_to`` names them as ``film.NAME``, ``gap.NAME``, ``joint.NAME``,
    ``heat.SET`` or ``ball_row.SET``.
    """

    name: Name
    sigma_rel: Number
    applies_to: Annotated[tuple[str, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> SharedFactor:
        _require_positive(self, "sigma_rel")
        return self


class Probe(SpecModel):
    """A temperature reading: a point on a part, or the mixed coolant outlet."""

    name: Name
    kind: Literal["point", "coolant_outlet"] = "point"
    part: Name | None = None
    r: Length | None = None
    z: Length | None = None
    angle: Angle = 0.0

    @model_validator(mode="after")
    def _check(self) -> Probe:
        given = [self.part is not None, self.r is not None, self.z is not None]
        if self.kind == "point" and not all(given):
            raise ValueError('a probe of kind "point" needs part, r and z.')
        if self.kind == "coolant_outlet" and any(given):
            raise ValueError('a probe of kind "coolant_outlet" takes no part, r or z.')
        return self


class MeshSettings(SpecModel):
    """How the machine is meshed and interpolated."""

    preset: Literal["coarse", "normal", "fine"] = "normal"
    order: Literal[1, 2] = 2
    size_factor: Number = 1.0
    size: dict[str, Length] = Field(default_factory=dict)
    circumferential_averaging: bool = True

    @model_validator(mode="after")
    def _check(self) -> MeshSettings:
        _require_between(self, 0.2, 5.0, "size_factor")
        for name, value in self.size.items():
            if value <= 0.0:
                raise ValueError(f"size.{name} must be above 0.")
        return self


class MachineSpec(SpecModel):
    """A complete machine with geometry."""

    schema_: Annotated[str, Field(alias="schema")]
    name: Name
    title: str = ""
    description: str = ""
    initial: Literal["ambient", "first_reading"] = "ambient"
    remaining_surfaces: Literal["adiabatic", "error"] = "error"
    heat_capacity_factor: UncertainNumber = Uncertain(1.0)
    operation: Operation
    materials: dict[str, Material]
    part: Annotated[tuple[Part, ...], Field(min_length=1)]
    bearing_types: dict[str, BearingType] = Field(default_factory=dict)
    bearing_set: tuple[BearingSet, ...] = ()
    grease: Grease | None = None
    channel: Channel | None = None
    coolant: Coolant | None = None
    heat: Heat
    joint: tuple[JointGroup, ...] = ()
    surface: tuple[Surface, ...] = ()
    film: tuple[Film, ...] = ()
    gap: tuple[Gap, ...] = ()
    factor: tuple[SharedFactor, ...] = ()
    probe: tuple[Probe, ...] = ()
    mesh: MeshSettings = MeshSettings()
    effects: dict[str, dict[str, Any]] = Field(default_factory=dict)

    @property
    def bearings(self) -> tuple[tuple[BearingSet, SetBearing], ...]:
        """Every bearing with its set, in file order."""
        return tuple((group, bearing) for group in self.bearing_set for bearing in group.bearing)

    @property
    def all_surfaces(self) -> tuple[Surface, ...]:
        """The named surfaces of the file and the raceways of every bearing.

        ``F1.inner_raceway`` is the outer cylinder of ``F1.inner_ring``,
        ``F1.outer_raceway`` the inner cylinder of ``F1.outer_ring``.
        """
        raceways = []
        for _, bearing in self.bearings:
            for ring, facing in (("inner", "outward"), ("outer", "inward")):
                raceways.append(
                    Surface(
                        name=f"{bearing.name}.{ring}_raceway",
                        part=f"{bearing.name}.{ring}_ring",
                        where=(FaceSelector(facing=facing),),
                    )
                )
        return self.surface + tuple(raceways)

    def part_material(self, part_name: str) -> Material:
        """Material of a part, the rings of bearings included (``F1.inner_ring``)."""
        for part in self.part:
            if part.name == part_name:
                return self.materials[part.material]
        bearing_name, _, ring = part_name.rpartition(".")
        for group, bearing in self.bearings:
            if bearing.name == bearing_name and ring in ("inner_ring", "outer_ring"):
                return self.materials[self.bearing_types[group.bearing_type].ring_material]
        raise KeyError(part_name)
