"""The machine definition as frozen models, one class a table of the file.

Every number is SI and every temperature kelvin once it has been read. What
concerns one table is checked here and in :mod:`spindle_fem.definition.solid_tables` and
:mod:`spindle_fem.definition.exchange_tables`; what needs several tables in
:mod:`spindle_fem.definition.consistency`, what needs the geometry in
:mod:`spindle_fem.machine.geometry`.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from spindle_fem.definition.bearing_types import BallBearingType, BearingType, RollerBearingType
from spindle_fem.definition.circuit_tables import CircuitFilm, Film
from spindle_fem.definition.displacement_tables import DisplacementSensor
from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.exchange_tables import (
    Channel,
    ConstantFilm,
    Coolant,
    FaceSelector,
    Gap,
    JointGroup,
    NaturalFilm,
    Ports,
    RotatingFilm,
    Surface,
    raceway_surfaces,
)
from spindle_fem.definition.field_types import (
    Angle,
    Fault,
    Flag,
    Fraction,
    Length,
    Name,
    Number,
    PositiveForce,
    PositiveLength,
    PositiveNumber,
    Power,
    Radius,
    RotationalSpeed,
    SpecModel,
    UncertainNumber,
    UncertainShare,
    choice_field,
    quantity_field,
    raise_faults,
)
from spindle_fem.definition.lubrication_tables import Lubrication, LubricationFilm
from spindle_fem.definition.operation_table import Operation
from spindle_fem.definition.solid_tables import (
    AnnulusSegment,
    BallRow,
    BearingSet,
    Grease,
    Material,
    Part,
    SetBearing,
)
from spindle_fem.definition.source_tables import HeatSource, SourceTable
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.units import Uncertain

MACHINE_SCHEMA = "spindle-fem/machine/1"

HeatModel = choice_field("spindle_fem.physics.bearings.heat_models")
SizeFactor = quantity_field("", at_least=0.2, at_most=5.0)
SigmaRel = quantity_field("", above=0.0, at_most=3.0)


class RadialLoad(SpecModel):
    """A force across the shaft: the pull of a belt, a tool's.

    Sets with `carries_radial` hold it as supports hold a rigid beam; bearings of a set share what
    reaches it.
    """

    name: Name
    """Name in messages."""
    force: PositiveForce
    """Constant."""
    z: Length
    """Place along the axis; may be beside the bearings."""
    angle: Angle = 0.0
    """Direction of the force; 0 is up."""


class HeatTable(SpecModel):
    """Heat of each bearing against speed, linear between entries."""

    speed: tuple[RotationalSpeed, ...]
    """At least two increasing entries."""
    heat: dict[str, tuple[Power, ...]]
    """One row per bearing, as long as ``speed``."""
    thrust_coefficient: dict[str, Number] = Field(default_factory=dict)
    """c of the factor 1 + c (thrust/reference_thrust - 1), by bearing; 0 where none is given."""
    reference_thrust: PositiveForce = 1750.0
    """Thrust at which the table holds."""

    @model_validator(mode="after")
    def _check(self) -> HeatTable:
        faults = []
        if len(self.speed) < 2 or any(b <= a for a, b in zip(self.speed, self.speed[1:], strict=False)):
            faults.append(
                Fault(
                    "speed",
                    f"has {len(self.speed)} entries that do not all grow.",
                    "Allowed: at least two, growing.",
                )
            )
        faults += [
            Fault(
                f"heat.{name}",
                f"has {len(values)} entries.",
                f"Allowed: {len(self.speed)}, as many as speed.",
            )
            for name, values in self.heat.items()
            if len(values) != len(self.speed)
        ]
        raise_faults(faults)
        return self


class Heat(SpecModel):
    """Friction heat of the bearings and where it enters.

    ``ball_share`` of it goes to the balls, ``inner_share`` of the rest to the
    inner ring.
    """

    model: HeatModel
    """A table, an empirical friction model or an analytical one."""
    ball_share: Fraction = 0.5
    """Share of the heat that enters the balls."""
    inner_share: UncertainShare = Uncertain(0.5)
    """Share of the rest that enters the inner ring."""
    palmgren_f0: PositiveNumber = 2.0
    """Palmgren's lubrication factor: about 2 for grease, up to 4 with a fresh fill."""
    skf_mu_ehl: PositiveNumber = 0.04
    """Sliding friction coefficient in full film: 0.04 synthetic, 0.05 mineral oil."""
    thermal_preload: Flag | None = None
    """Whether ring, ball, shaft and housing expansion changes the preload and with it the heat. Where none
    is given, it does wherever all preloaded sets have a `fit`; models that cannot follow it then take
    bearings of the size of assembly and say so."""
    table: HeatTable | None = None
    """Needed with `model = "table"`."""

    @model_validator(mode="after")
    def _check(self) -> Heat:
        if self.model == "table" and self.table is None:
            raise_faults([Fault("table", "is missing.", 'model = "table" needs a [heat.table].')])
        return self


class SharedFactor(SpecModel):
    """One uncertain factor, 1 when nominal, on several coefficients at once.

    ``applies_to`` names them as ``film.NAME``, ``gap.NAME``, ``joint.NAME``,
    ``heat.SET`` or ``ball_row.SET``.
    """

    name: Name
    """Name of the parameter."""
    sigma_rel: SigmaRel
    """Standard deviation of its logarithm."""
    applies_to: Annotated[tuple[str, ...], Field(min_length=1)]
    """Coefficients that it multiplies."""


class Probe(SpecModel):
    """A temperature reading: a point on a part, the mixed outlet of the channel, or that of a circuit."""

    name: Name
    """Results and recordings use it."""
    kind: Literal["point", "coolant_outlet", "circuit_outlet"] = "point"
    """Quantity that it reads."""
    circuit: Name | None = None
    """Name of the circuit, with ``kind = "circuit_outlet"`` only."""
    part: Name | None = None
    """A part, or a ring such as ``F1.outer_ring``; for a point only, like r, z and angle."""
    r: Radius | None = None
    """Radius of the point."""
    z: Length | None = None
    """Place of the point along the axis."""
    angle: Angle = 0.0
    """Around the axis; 0 is up."""

    @model_validator(mode="after")
    def _check(self) -> Probe:
        given = {"part": self.part is not None, "r": self.r is not None, "z": self.z is not None}
        if self.kind == "point":
            raise_faults(
                Fault(key, "is missing.", 'A probe of kind "point" needs part, r and z.')
                for key, present in given.items()
                if not present
            )
        else:
            raise_faults(
                Fault(key, "is given.", f'A probe of kind "{self.kind}" takes no part, r or z.')
                for key, present in given.items()
                if present
            )
        if (self.circuit is not None) != (self.kind == "circuit_outlet"):
            what = "is missing." if self.circuit is None else "is given."
            raise_faults([Fault("circuit", what, 'It goes with kind = "circuit_outlet".')])
        return self


class MeshSettings(SpecModel):
    """Mesh and interpolation of the machine."""

    preset: Literal["coarse", "normal", "fine"] = "normal"
    """Fineness."""
    order: Literal[1, 2] = 2
    """Order of the temperature's polynomials."""
    size_factor: SizeFactor = 1.0
    """Factor on every element size of the preset."""
    size: dict[str, PositiveLength] = Field(default_factory=dict)
    """Element size by part, ring, or ``channel``."""
    circumferential_averaging: Flag = True
    """Rotating parts take the mean temperature around the axis."""


class MachineSpec(SpecModel):
    """A complete machine with geometry."""

    schema_: Annotated[str, Field(alias="schema")]
    """The version of this format."""
    name: Name
    """Short name of the machine."""
    title: str = ""
    """One line for reports."""
    description: str = ""
    """Longer text for reports."""
    initial: Literal["ambient", "first_reading"] = "ambient"
    """Temperatures at the start of a simulation."""
    remaining_surfaces: Literal["adiabatic", "error"] = "error"
    """Treatment of exposed faces that no surface names."""
    heat_capacity_factor: UncertainNumber = Uncertain(1.0)
    """Factor on every heat capacity."""
    surroundings: Literal["workshop"] | None = None
    """Rules that give joints, outer surfaces and air gaps where the file gives none."""
    operation: Operation
    """Operating point."""
    radial_load: tuple[RadialLoad, ...] = ()
    """Forces across the shaft."""
    materials: dict[str, Material] = Field(default_factory=dict)
    """Solids by name; those that ship need not be given."""
    part: Annotated[tuple[Part, ...], Field(min_length=1)]
    """Solids of revolution."""
    bearing_types: dict[str, BearingType] = Field(default_factory=dict)
    """Catalogue data by name."""
    bearing_set: tuple[BearingSet, ...] = ()
    """Bearings in their sets."""
    grease: Grease | None = None
    """Needed unless ``heat.model = "table"`` or every bearing set has its `lubrication`."""
    channel: Channel | None = None
    """Goes with ``[coolant]``."""
    coolant: Coolant | None = None
    """Goes with ``[channel]``."""
    heat: Heat
    """Friction heat."""
    source: tuple[HeatSource, ...] = ()
    """Heat beside friction."""
    joint: tuple[JointGroup, ...] = ()
    """Conductances of contacts."""
    surface: tuple[Surface, ...] = ()
    """Names for exposed faces."""
    film: tuple[Film, ...] = ()
    """Heat exchange with the surroundings."""
    gap: tuple[Gap, ...] = ()
    """Heat exchange across air gaps."""
    factor: tuple[SharedFactor, ...] = ()
    """Uncertain factors that several coefficients share."""
    probe: tuple[Probe, ...] = ()
    """Temperature probes."""
    displacement_sensor: tuple[DisplacementSensor, ...] = ()
    """Sensors of growth."""
    mesh: MeshSettings = MeshSettings()
    """Fineness of the mesh."""
    effects: Annotated[tuple[EffectEntry, ...], Field(alias="effect")] = ()
    """Effects of the catalogue that are switched on."""

    def __repr__(self) -> str:
        counts = f"{len(self.part)} parts, {len(self.bearings)} bearings"
        return f"<{type(self).__name__}: {self.name}, {counts}>"

    __str__ = __repr__

    @model_validator(mode="after")
    def _add_streams(self) -> MachineSpec:
        """Streams through bearings are films like all others; a machine that is read again gets them once."""
        given = {film.name: film for film in self.film if isinstance(film, LubricationFilm)}
        own = tuple(film for film in self.film if not isinstance(film, LubricationFilm))
        streams = (
            _lubrication_film(group, bearing, self.bearing_types[group.type_name(bearing)])
            for group, bearing in self.bearings
            if group.lubrication is not None and group.type_name(bearing) in self.bearing_types
        )
        found = tuple(
            film.model_copy(update={"factor": given[film.name].factor}) if film.name in given else film
            for film in streams
        )
        if found or given:
            # Frozen for everybody else.
            self.__dict__["film"] = own + found
        return self

    @model_validator(mode="after")
    def _tell_sources(self) -> MachineSpec:
        """Heat that follows a torque knows that of the operation."""
        torque = self.operation.load_torque if self.operation else None
        if torque is not None and any(source.follows_torque for source in self.source):
            self.__dict__["source"] = tuple(
                source.at_torque(torque) if source.follows_torque else source for source in self.source
            )
        return self

    def lubricant_of(self, group: BearingSet) -> Grease | Lubrication | None:
        """Lubricant of a set: its own oil, or the machine's grease."""
        return group.lubrication or self.grease

    @property
    def knows_lubricants(self) -> bool:
        """Whether every bearing set has grease or oil."""
        return all(self.lubricant_of(group) is not None for group in self.bearing_set)

    @property
    def bearings(self) -> tuple[tuple[BearingSet, SetBearing], ...]:
        """Every bearing with its set, in file order."""
        return tuple((group, bearing) for group in self.bearing_set for bearing in group.bearing)

    def axial_load(self, group: BearingSet, thrust: float) -> float:
        """External axial force on a set, N, at a thrust on the shaft [N]; both positive towards the rear."""
        if group.spring_force:
            return -group.spring_force
        if not group.carries_thrust:
            return 0.0
        return thrust + sum(other.spring_force for other in self.bearing_set)

    @property
    def follows_preload(self) -> bool:
        """Whether expansion changes the preload of its bearings, and with it their heat."""
        if not self.bearing_set or self.heat.model == "table":
            return False
        if self.heat.thermal_preload is not None:
            return self.heat.thermal_preload
        preloaded = [group for group in self.bearing_set if group.preload > 0.0]
        return bool(preloaded) and all(group.fit is not None for group in preloaded)

    @property
    def rolling_elements(self) -> str:
        """Rolling elements: "balls", "rollers" or "balls and rollers"; empty without bearings."""
        names = [group.type_name(bearing) for group, bearing in self.bearings]
        words = {f"{self.bearing_types[name].element_word}s" for name in names}
        return " and ".join(sorted(words))

    @property
    def has_pump_limit(self) -> bool:
        """Whether the pump's pressure can keep the coolant's flow below the requested flow."""
        coolant = self.coolant
        return coolant is not None and (coolant.pressure_limit, coolant.pump_curve) != (None, None)

    @property
    def is_the_papers(self) -> bool:
        """Whether its cooling or operation is marked P: only then are the paper's questions put to it."""
        tables = (self.operation, self.channel, self.coolant)
        return any("P" in table.marks.values() for table in tables if table is not None)

    @property
    def highest_speed(self) -> float:
        """Highest speed that operation and heat table speak of, rad/s."""
        table = self.heat.table
        ends = (self.operation.speed_range or (), () if table is None else table.speed)
        return max((self.operation.speed, *(speed for end in ends for speed in end[-1:])))

    @property
    def circuits(self) -> tuple[StreamFilm, ...]:
        """Streams beside the channel: circuits, oil or air through bearings."""
        return tuple(film for film in self.film if isinstance(film, StreamFilm))

    @property
    def wetted_rows(self) -> dict[str, LubricationFilm]:
        """Streams by the row of balls or rollers that they flow around (``F1.balls``)."""
        return {film.ball_row: film for film in self.film if isinstance(film, LubricationFilm)}

    @property
    def source_inputs(self) -> tuple[str, ...]:
        """Recorded quantities that heat sources follow."""
        torque = ("torque",) if any(source.follows_torque for source in self.source) else ()
        named = (source.input for source in self.source if source.input is not None)
        return tuple(dict.fromkeys((*named, *torque)))

    @property
    def all_surfaces(self) -> tuple[Surface, ...]:
        """The named surfaces of the file, the raceways of every bearing and the walls of circuits.

        ``F1.inner_raceway`` is the outer cylinder of ``F1.inner_ring``,
        ``F1.outer_raceway`` the inner cylinder of ``F1.outer_ring``.
        """
        raceways = (surface for _, bearing in self.bearings for surface in raceway_surfaces(bearing.name))
        return (*self.surface, *raceways, *(wall for film in self.circuits for wall in film.walls))

    def part_material(self, part_name: str) -> Material:
        """Material of a part, the rings of bearings included (``F1.inner_ring``)."""
        for part in self.part:
            if part.name == part_name:
                return self.materials[part.material]
        bearing_name, _, ring = part_name.rpartition(".")
        for group, bearing in self.bearings:
            if bearing.name == bearing_name and ring in ("inner_ring", "outer_ring"):
                return self.materials[self.bearing_types[group.type_name(bearing)].ring_material]
        raise KeyError(part_name)


def _lubrication_film(group: BearingSet, bearing: SetBearing, kind: BearingType) -> LubricationFilm:
    balls = isinstance(kind, BallBearingType)
    return LubricationFilm.model_construct(
        kind="lubrication",
        name=f"{bearing.name}.lubrication",
        bearing=bearing.name,
        lubrication=group.lubrication,
        pitch_diameter=kind.pitch,
        element_diameter=kind.element_diameter,
        axial_cosine=math.cos(kind.contact_angle) if balls else 1.0,
        inner_diameter=kind.inner_ring_outer_diameter,
        outer_diameter=kind.outer_ring_inner_diameter,
        rolls_on_balls=balls,
        element_surface=kind.element_surface,
        factor=group.lubrication.film_factor,
    )


__all__ = [
    "MACHINE_SCHEMA",
    "AnnulusSegment",
    "BallBearingType",
    "BallRow",
    "BearingSet",
    "BearingType",
    "Channel",
    "CircuitFilm",
    "ConstantFilm",
    "Coolant",
    "DisplacementSensor",
    "EffectEntry",
    "FaceSelector",
    "Film",
    "Gap",
    "Grease",
    "Heat",
    "HeatSource",
    "HeatTable",
    "JointGroup",
    "Lubrication",
    "LubricationFilm",
    "MachineSpec",
    "Material",
    "MeshSettings",
    "NaturalFilm",
    "Operation",
    "Part",
    "Ports",
    "Probe",
    "RadialLoad",
    "RollerBearingType",
    "RotatingFilm",
    "SetBearing",
    "SharedFactor",
    "SourceTable",
    "StreamFilm",
    "Surface",
]
