"""Circuits of their own beside the channel: straight ducts through a part, each with its coolant."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from spindle_fem.definition.exchange_tables import (
    ConstantFilm,
    FaceSelector,
    Fluid,
    NaturalFilm,
    RotatingFilm,
    Surface,
)
from spindle_fem.definition.field_types import (
    Fault,
    Name,
    PositiveLength,
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
    """A separate coolant that flows along a straight duct and warms on its way.

    The walls need no ``[[surface]]``: cells along the flow name them ``NAME.1``, ``NAME.2`` and so on from
    the inlet (``NAME.inner.1``, ``NAME.outer.1`` of an annulus). Properties are those of the inlet.
    """

    kind: Literal["circuit"]
    """Type of film."""
    name: Name
    """Name in results, factors and probes."""
    duct: DuctKind = "bore"
    """Shape of the duct."""
    part: Name
    """The part whose wall it wets: around a bore, inside an annulus."""
    outer_part: Name | None = None
    """The part around an annulus; ``part`` itself where none is given."""
    diameter: PositiveLength
    """Diameter of the bore, or of the inner wall of an annulus, as drawn."""
    outer_diameter: PositiveLength | None = None
    """Diameter of the outer wall of an annulus, at most twice the inner."""
    z: Range
    """Start and end of the wetted walls."""
    flows_to: Literal["front", "rear"] = "rear"
    """Towards the nose or away from it."""
    cells: Annotated[int, Field(ge=2, le=40, strict=True)] = 8
    """Along the flow; each has one temperature of the coolant, exact between cells of uniform wall."""
    fluid: Fluid
    """Coolant, for its properties."""
    inlet_temperature: Temperature
    """Temperature at the inlet."""
    flow: VolumeFlow
    """Through the duct."""
    law: DuctLaw = "straight"
    """Correlation of the film."""
    factor: UncertainNumber = Uncertain(1.0)
    """Factor on the coefficient: fouling, rotation, inlets."""

    @model_validator(mode="after")
    def _check(self) -> CircuitFilm:
        faults = []
        annulus = self.duct == "annulus"
        if annulus and self.outer_diameter is None:
            faults.append(Fault("outer_diameter", "is missing.", 'duct = "annulus" needs it.'))
        if annulus and self.outer_diameter is not None:
            low, high = self.diameter, 2.0 * self.diameter
            if not low < self.outer_diameter <= high + 1e-9:
                what = f"{self.outer_diameter * 1e3:g} mm is no narrow annulus."
                fix = f"Allowed: above {low * 1e3:g} up to {high * 1e3:g} mm."
                faults.append(Fault("outer_diameter", what, fix))
        for key in ("outer_diameter", "outer_part"):
            if not annulus and getattr(self, key) is not None:
                faults.append(Fault(key, "is given.", 'Only duct = "annulus" takes it.'))
        raise_faults(faults)
        return self

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
        return tuple((f"{self.name}.{n}",) for n in numbers)

    @property
    def walls(self) -> tuple[Surface, ...]:
        """Surfaces for the names of its walls."""
        step = self.length / self.cells
        edges = [*(round(self.z[0] + step * n, 9) for n in range(self.cells)), self.z[1]]
        ends = list(pairwise(edges))
        if self.flows_to == "front":
            ends.reverse()
        sides = [(self.part, "inward", self.diameter)]
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


Film = Annotated[
    ConstantFilm | NaturalFilm | RotatingFilm | CircuitFilm | LubricationFilm, Field(discriminator="kind")
]
