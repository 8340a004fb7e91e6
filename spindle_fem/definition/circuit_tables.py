"""Circuits of their own beside the channel: straight ducts through a part, each with its coolant."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from spindle_fem.definition.exchange_tables import (
    ConstantFilm,
    FaceSelector,
    Fluid,
    NaturalFilm,
    PumpCurve,
    RotatingFilm,
    Surface,
)
from spindle_fem.definition.field_types import (
    Fault,
    Name,
    PositiveLength,
    PositiveNumber,
    Pressure,
    Range,
    Temperature,
    UncertainNumber,
    VolumeFlow,
    choice_field,
    raise_faults,
)
from spindle_fem.definition.lubrication_tables import LubricationFilm
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.units import Uncertain

DuctKind = choice_field("spindle_fem.physics.coolant.duct_kinds")
DuctLaw = choice_field("spindle_fem.physics.coolant.duct_films")


class CircuitFilm(StreamFilm):
    """A separate coolant that flows along a duct and warms on its way.

    Bores and annuli are drawn as they are. Grooves around a sleeve and rows of bores are not: a plain
    cylinder of the part, beside a void, stands for them and gives their heat. Of grooves that cylinder is
    their floor: draw the sleeve turned down to it, without the lands between. The walls need no
    ``[[surface]]``: cells along the flow name them ``NAME.1``, ``NAME.2`` and so on from the inlet
    (``NAME.inner.1``, ``NAME.outer.1`` of an annulus, ``NAME.cover.1`` where a part covers grooves). Cells of
    ring grooves and of bores with several passes are side by side, each with its share of the flow.
    Properties are those of the inlet. A recording gives the inlet temperature as the input ``inlet.NAME``.
    """

    kind: Literal["circuit"]
    """Type of film."""
    name: Name
    """Name in results, factors and probes."""
    duct: DuctKind = "bore"
    """Shape of the duct."""
    part: Name
    """The part whose wall it wets: around a bore, inside an annulus, with the grooves or bores in it."""
    outer_part: Name | None = None
    """The part around an annulus, ``part`` itself where none is given; the part that covers grooves, at their
    depth from the floor, whose wall is dry where none is given."""
    diameter: PositiveLength
    """Diameter of the wall as drawn, a face of ``part``: of the bore, inside an annulus, of the floor of
    grooves, or of what stands for a row of axial bores."""
    outer_diameter: PositiveLength | None = None
    """Diameter of the outer wall of an annulus, at most twice the inner."""
    z: Range
    """Start and end of the wetted walls."""
    wall: Literal["inside", "outside"] | None = None
    """Side of the part that has grooves, or stands for axial bores; outside for grooves, inside for bores."""
    width: PositiveLength | None = None
    """Axial width of a groove."""
    depth: PositiveLength | None = None
    """Radial depth of a groove."""
    number: Annotated[int, Field(ge=1, le=200, strict=True)] = 1
    """Ring grooves, starts of a helical groove, or axial bores."""
    turns: PositiveNumber | None = None
    """Of each start of a helical groove; they need not be whole."""
    bore_diameter: PositiveLength | None = None
    """Diameter of an axial bore."""
    passes: Annotated[int, Field(ge=1, le=200, strict=True)] = 1
    """Axial bores one after another that the coolant flows through, with turns between."""
    flows_to: Literal["front", "rear"] = "rear"
    """Towards the nose or away from it."""
    cells: Annotated[int, Field(ge=2, le=40, strict=True)] = 8
    """Along the flow; each has one temperature of the coolant, exact between cells of uniform wall."""
    fluid: Fluid
    """Coolant, for its properties."""
    inlet_temperature: Temperature
    """Temperature at the inlet."""
    flow: VolumeFlow
    """Through the duct; less flows where the pump's pressure does not suffice."""
    pressure_limit: Pressure | None = None
    """Of the pump's relief valve: the flow through the duct takes no more."""
    pump_curve: PumpCurve | None = None
    """What the pump gives: no more flows than the duct takes at its pressure."""
    law: DuctLaw = "straight"
    """Correlation of the film."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient: fouling, rotation, inlets."""

    @model_validator(mode="after")
    def _check(self) -> CircuitFilm:
        faults = []
        annulus = self.duct == "annulus"
        if annulus and self.outer_diameter is not None:
            low, high = self.diameter, 2.0 * self.diameter
            if not low < self.outer_diameter <= high + 1e-9:
                what = f"{self.outer_diameter * 1e3:g} mm is no narrow annulus."
                fix = f"Allowed: above {low * 1e3:g} up to {high * 1e3:g} mm."
                faults.append(Fault("outer_diameter", what, fix))
        raise_faults([*faults, *self._duct_faults()])
        return self

    def _duct_faults(self) -> Iterator[Fault]:
        """Measures that the duct lacks or does not take; of ducts of other packages nothing is known."""
        needed, possible = _MEASURES.get(self.duct, ((), tuple(_ONLY_SOME)))
        for key in needed:
            if getattr(self, key) is None:
                yield Fault(key, "is missing.", f'duct = "{self.duct}" needs it.')
        for key in _ONLY_SOME:
            if key not in (*needed, *possible) and getattr(self, key) not in (None, 1):
                takers = [f'"{name}"' for name, keys in _MEASURES.items() if key in (*keys[0], *keys[1])]
                yield Fault(key, "is given.", f"Only duct = {', '.join(takers)} takes it.")
        grooves = self.number * (self.turns or 1.0) * (self.width or 0.0)
        if self.duct in _GROOVES and grooves > self.length:
            what = f"{1e3 * grooves:g} mm of grooves do not fit into {1e3 * self.length:g} mm of z."
            yield Fault("width", what, "Give fewer or narrower grooves.")
        if self.number % self.passes:
            what = f"{self.number} bores are no multiple of {self.passes} passes."
            yield Fault("passes", what, "Give passes that share the bores evenly.")

    @property
    def in_parallel(self) -> bool:
        """Ring grooves, and bores there and back: what is beside a place did not all pass those before it."""
        return self.duct == "ring_grooves" or self.passes > 1

    @property
    def length(self) -> float:
        """Length of the duct, m."""
        return self.z[1] - self.z[0]

    @property
    def cell_surfaces(self) -> tuple[tuple[str, ...], ...]:
        """Names of the walls of each cell, from the inlet."""
        numbers = range(1, self.cells + 1)
        if self.duct == "annulus":
            return tuple((f"{self.name}.inner.{n}", f"{self.name}.outer.{n}") for n in numbers)
        if self.is_covered:
            return tuple((f"{self.name}.{n}", f"{self.name}.cover.{n}") for n in numbers)
        return tuple((f"{self.name}.{n}",) for n in numbers)

    @property
    def is_covered(self) -> bool:
        """Grooves whose cover is a wall too."""
        return self.duct in _GROOVES and self.outer_part is not None

    @property
    def walls(self) -> tuple[Surface, ...]:
        """Surfaces for the names of its walls."""
        step = self.length / self.cells
        edges = [*(round(self.z[0] + step * n, 9) for n in range(self.cells)), self.z[1]]
        ends = list(pairwise(edges))
        if self.flows_to == "front":
            ends.reverse()
        outside = (self.wall or ("outside" if self.duct in _GROOVES else "inside")) == "outside"
        sides = [(self.part, "outward" if outside else "inward", self.diameter)]
        if self.is_covered:
            depth = 2.0 * self.depth if outside else -2.0 * self.depth
            sides.append((self.outer_part, "inward" if outside else "outward", self.diameter + depth))
        if self.duct == "annulus":
            sides = [(self.part, "outward", self.diameter)]
            sides.append((self.outer_part or self.part, "inward", self.outer_diameter))
        return tuple(
            Surface.model_construct(
                name=name,
                part=part,
                where=(FaceSelector.model_construct(facing=facing, z=z, r=(0.5 * size, 0.5 * size)),),
            )
            for names, z in zip(self.cell_surfaces, ends, strict=True)
            for name, (part, facing, size) in zip(names, sides, strict=True)
        )


class WettedFilm(StreamFilm):
    """A liquid that runs down over surfaces in a film, as cutting fluid over a nose, and leaves mixed.

    Its surfaces give it their heat together; how warm it gets follows from its flow.
    """

    kind: Literal["wetted"]
    """Type of film."""
    name: Name
    """Name in results, factors and probes."""
    surface_names: Annotated[tuple[Name, ...], Field(min_length=1, alias="surface")]
    """Names of surfaces; each surface takes one film or gap."""
    width: PositiveLength
    """Across the flow; twice the length of a lying cylinder, which is wet on both sides."""
    length: PositiveLength
    """Down the flow; half the circumference of a lying cylinder."""
    fluid: Fluid
    """Liquid, for its properties."""
    inlet_temperature: Temperature
    """Temperature where it meets the surfaces."""
    flow: VolumeFlow
    """What runs over the surfaces; not what splashes off."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient: dry places, turning surfaces, jets."""

    @property
    def cell_surfaces(self) -> tuple[tuple[str, ...], ...]:
        """All surfaces meet one mixed stream."""
        return (self.surface_names,)


_GROOVES = ("ring_grooves", "helical_groove")
# Measures that a duct needs, and may have beside.
_MEASURES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "bore": ((), ()),
    "annulus": (("outer_diameter",), ("outer_part",)),
    "ring_grooves": (("width", "depth"), ("number", "wall", "outer_part")),
    "helical_groove": (("width", "depth", "turns"), ("number", "wall", "outer_part")),
    "axial_bores": (("bore_diameter",), ("number", "passes", "wall")),
}
_ONLY_SOME = tuple(dict.fromkeys(key for keys in _MEASURES.values() for key in (*keys[0], *keys[1])))

Film = Annotated[
    ConstantFilm | NaturalFilm | RotatingFilm | CircuitFilm | WettedFilm | LubricationFilm,
    Field(discriminator="kind"),
]
