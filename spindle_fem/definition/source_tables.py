"""Heat that enters a part or a surface beside the friction of the bearings: motor, belt, coupling, seal."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag, model_validator

from spindle_fem.definition.field_types import (
    Fault,
    Force,
    Name,
    Power,
    RotationalSpeed,
    SpecModel,
    raise_faults,
)
from spindle_fem.definition.network_tables import GainField


class SourceTable(SpecModel):
    """Heat over speed, or over speed and thrust: linear between entries, the last value beyond the ends."""

    speed: Annotated[tuple[RotationalSpeed, ...], Field(min_length=2)]
    """At least two increasing entries."""
    heat: tuple[Power, ...]
    """As long as ``speed``; with ``thrust`` one row after the other, a row for each thrust."""
    thrust: tuple[Force, ...] = ()
    """External axial forces on the shaft, growing; none where the heat follows the speed alone."""

    @model_validator(mode="after")
    def _check(self) -> SourceTable:
        faults = [
            Fault(key, "its entries do not all grow.", "Allowed: growing entries.")
            for key in ("speed", "thrust")
            if any(b <= a for a, b in zip(getattr(self, key), getattr(self, key)[1:], strict=False))
        ]
        if len(self.thrust) == 1:
            faults.append(Fault("thrust", "has one entry.", "Allowed: none, or at least two."))
        entries = len(self.speed) * max(1, len(self.thrust))
        if len(self.heat) != entries:
            what = "as many as speed" + (" for each thrust" if self.thrust else "")
            faults.append(Fault("heat", f"has {len(self.heat)} entries.", f"Allowed: {entries}, {what}."))
        raise_faults(faults)
        return self


class HeatSource(SpecModel):
    """Heat that enters a part evenly over its volume, or a surface evenly over its area.

    A recording's input that drives ``heat.NAME`` gives it instead.
    """

    name: Name
    """Results and recordings use it."""
    part: str | None = None
    """A part, a segment such as ``shaft.nose``, or a ring such as ``F1.outer_ring``; or a ``surface``."""
    surface: Name | None = None
    """A named surface, in place of ``part``."""
    heat: (
        Annotated[
            Annotated[Power, Tag("power")] | Annotated[SourceTable, Tag("table")],
            Discriminator(lambda given: "table" if isinstance(given, dict | SourceTable) else "power"),
        ]
        | None
    ) = None
    """A quantity such as "200 W", or a table over speed. With ``input``: where that is not recorded."""
    input: Name | None = None
    """Recorded quantity that the heat follows, as a channel's ``drives`` names it."""
    gain: GainField | None = None
    """Heat for each unit of ``input``, such as "0.08 W/W"; the input itself where not given."""

    @model_validator(mode="after")
    def _check(self) -> HeatSource:
        faults = []
        if (self.part is None) == (self.surface is None):
            what = "is missing." if self.part is None else "is given beside surface."
            faults.append(Fault("part", what, "A source takes a part or a surface."))
        if self.heat is None and self.input is None:
            faults.append(Fault("heat", "is missing.", "A source takes a heat, an input, or both."))
        if self.input is None and self.gain is not None:
            faults.append(Fault("gain", "is given.", "Only a source with an input takes a gain."))
        if self.gain is not None and not self.gain.amount.is_fixed:
            faults.append(Fault("gain", "is uncertain.", "Allowed: a quantity such as 0.08 W/W."))
        raise_faults(faults)
        return self

    @property
    def place(self) -> str:
        """Place where the heat enters, as models name places."""
        return str(self.part or self.surface)
