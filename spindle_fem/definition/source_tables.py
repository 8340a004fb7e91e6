"""Heat that enters a part or a surface beside the friction of the bearings: motor, belt, coupling, seal."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, PrivateAttr, Tag, model_validator

from spindle_fem.definition.field_types import (
    Fault,
    Force,
    Name,
    PositiveTorque,
    Power,
    RotationalSpeed,
    SpecModel,
    Torque,
    raise_faults,
)
from spindle_fem.definition.network_tables import GainField


class SourceTable(SpecModel):
    """Heat over speed, or over speed and a load: linear between entries, the last value beyond the ends."""

    speed: Annotated[tuple[RotationalSpeed, ...], Field(min_length=2)]
    """At least two increasing entries."""
    heat: tuple[Power, ...]
    """As long as ``speed``; with ``thrust`` or ``torque`` one row after the other, a row for each of them."""
    thrust: tuple[Force, ...] = ()
    """External axial forces on the shaft, growing; none where the heat follows the speed alone."""
    torque: tuple[Torque, ...] = ()
    """Torques of the drive in the place of ``thrust``, growing."""

    @model_validator(mode="after")
    def _check(self) -> SourceTable:
        faults = [
            Fault(key, "its entries do not all grow.", "Allowed: growing entries.")
            for key in ("speed", "thrust", "torque")
            if any(b <= a for a, b in zip(getattr(self, key), getattr(self, key)[1:], strict=False))
        ]
        faults += [
            Fault(key, "has one entry.", "Allowed: none, or at least two.")
            for key in ("thrust", "torque")
            if len(getattr(self, key)) == 1
        ]
        if self.thrust and self.torque:
            faults.append(Fault("torque", "is given beside thrust.", "Allowed: one of both."))
        entries = len(self.speed) * max(1, len(self.load))
        if len(self.heat) != entries:
            what = "as many as speed" + (f" for each {self.load_input}" if self.load else "")
            faults.append(Fault("heat", f"has {len(self.heat)} entries.", f"Allowed: {entries}, {what}."))
        raise_faults(faults)
        return self

    @property
    def load_input(self) -> str | None:
        """The load that it follows beside the speed: "thrust", "torque" or none."""
        return "torque" if self.torque else "thrust" if self.thrust else None

    @property
    def load(self) -> tuple[float, ...]:
        """Its entries along that load, SI."""
        return self.torque or self.thrust


class HeatSource(SpecModel):
    """Heat that enters a part evenly over its volume, or a surface evenly over its area.

    A built-in motor: `copper_loss` at a `rated_torque` for what grows with the square of the torque, and
    `heat` over speed for its iron, in one source or in several. The torque is `operation.torque`, or that of
    a recording's input that drives ``torque``.

    A recording's input that drives ``heat.NAME`` gives the heat instead.
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
    copper_loss: Power | None = None
    """Further heat of windings at `rated_torque`; it grows with the square of the torque."""
    rated_torque: PositiveTorque | None = None
    """Torque of the drive at which `copper_loss` is known."""
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
        if self.heat is None and self.input is None and self.copper_loss is None:
            allowed = "A source takes a heat, a copper_loss, an input, or several of them."
            faults.append(Fault("heat", "is missing.", allowed))
        if (self.copper_loss is None) != (self.rated_torque is None):
            key = "copper_loss" if self.copper_loss is None else "rated_torque"
            faults.append(Fault(key, "is missing.", "A copper_loss goes with its rated_torque."))
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

    _usual_torque: float = PrivateAttr(default=0.0)

    @property
    def usual_torque(self) -> float:
        """Torque of the machine's operation, N m."""
        return self._usual_torque

    def at_torque(self, torque: float) -> HeatSource:
        """The same source of a machine whose operation has this torque."""
        found = self.model_copy()
        found._usual_torque = torque
        return found

    @property
    def follows_torque(self) -> bool:
        """Whether its own heat follows the torque of the drive."""
        by_table = isinstance(self.heat, SourceTable) and self.heat.load_input == "torque"
        return by_table or self.copper_loss is not None
