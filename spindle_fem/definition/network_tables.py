"""A machine without drawings: the thermal network that a user writes down."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainSerializer

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.field_types import AllowedText, Name, SpecModel, uncertain_field
from spindle_fem.errors import (
    SpindleFemError,
    UnitError,
)
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain, registry, to_si, uncertain_to_si

NETWORK_SCHEMA = "spindle-fem/machine/1"
_NUMBER_AND_UNIT = re.compile(r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*(.*?)\s*")
_INPUT_NAME = re.compile(r"^[A-Za-z_][A-Za-z0-9_.]*$")


@dataclass(frozen=True, slots=True)
class Gain:
    """Factor of a source in SI base units.

    Attributes
    ----------
    amount : Uncertain
        Magnitude in ``unit``.
    unit : str
        Base units as pint writes them, ``""`` for a pure number.
    """

    amount: Uncertain
    unit: str


def base_unit_of(text: Any) -> str:
    """SI unit of a quantity's text in a form that reads back, ``""`` for a pure number."""
    match = _NUMBER_AND_UNIT.fullmatch(str(text))
    if match is None or not match[1]:
        return ""
    import pint  # takes as long to load as a definition to read, which often has no gain

    units = registry()
    try:
        base = units.Quantity(1.0, units.parse_units(match[1])).to_base_units().units
    except (pint.errors.PintError, TypeError, ValueError) as error:
        raise UnitError(
            "", f'"{text}" has the unknown unit "{match[1]}".', 'Write it as "0.9 W/W".'
        ) from error
    if base.dimensionality == units.Unit("W").dimensionality:
        return "W"
    return "" if str(base) == "dimensionless" else f"{base:~C}"


def _read_gain(value: Any) -> Any:
    if isinstance(value, Gain):
        return value
    sample = value
    if isinstance(value, Mapping):
        sample = value.get("value", value.get("low"))
    try:
        unit = base_unit_of(sample)
        return Gain(uncertain_to_si(value, unit, where=""), unit)
    except SpindleFemError as error:
        offer = "Where the exponent is not whole, give the gain in W and a reference."
        raise ValueError(f"{error.what} {error.how_to_fix} {offer}") from error


def _write_gain(gain: Gain) -> Any:
    text = f"{gain.amount.value!r} {gain.unit}".strip()
    return text if gain.amount.is_fixed else {"value": text, "sigma_rel": gain.amount.sigma_log}


def _read_boundary_temperature(value: Any) -> Any:
    if isinstance(value, Uncertain) or (isinstance(value, str) and _INPUT_NAME.match(value)):
        return value
    try:
        if isinstance(value, Mapping):
            return uncertain_to_si(dict(value), "K", where="")
        return Uncertain(to_si(value, "K", where="", kind="temperature"))
    except SpindleFemError as error:
        raise ValueError(f'{error.what} {error.how_to_fix} Or an input\'s name such as "ambient".') from error


def _write_boundary_temperature(value: Uncertain | str) -> Any:
    if isinstance(value, str):
        return value
    text = f"{value.value - ZERO_CELSIUS_K:.12g} degC"
    return text if value.is_fixed else {"value": text, "sigma_rel": value.sigma_log}


def _read_reference(value: Any) -> Any:
    if value is None or isinstance(value, Gain):
        return value
    try:
        unit = base_unit_of(value)
        return Gain(Uncertain(to_si(value, unit, where="")), unit)
    except SpindleFemError as error:
        raise ValueError(f"{error.what} {error.how_to_fix}".strip()) from error


HIGHEST_EXPONENT = 6.0

GainField = Annotated[
    Gain,
    BeforeValidator(_read_gain),
    PlainSerializer(_write_gain),
    AllowedText('uncertain: a quantity in W per unit of the input, such as "0.9 W/W", or in W'),
]
ReferenceField = Annotated[
    Gain | None,
    BeforeValidator(_read_reference),
    PlainSerializer(lambda value: None if value is None else _write_gain(value)),
    AllowedText('a quantity of the input\'s kind, such as "3000 rpm"'),
]
BoundaryTemperature = Annotated[
    Uncertain | str,
    BeforeValidator(_read_boundary_temperature),
    PlainSerializer(_write_boundary_temperature),
    AllowedText("an input's name (a channel's `drives`), or uncertain: a temperature such as \"20 degC\""),
]
Exponent = Annotated[
    float,
    Field(gt=0.0, le=HIGHEST_EXPONENT, allow_inf_nan=False),
    AllowedText(f"a number above 0, at most {HIGHEST_EXPONENT:g}"),
]
Ends = Annotated[tuple[Name, Name], AllowedText("two names of nodes or boundaries, one of them a node")]


class NodeSpec(SpecModel):
    """A lump with one temperature."""

    name: Name
    """Its name, which a channel's `probe` may read."""
    capacity: uncertain_field("J/K")  # type: ignore[valid-type]
    """Mass times specific heat."""


class BoundarySpec(SpecModel):
    """Something whose temperature is independent of the machine: room, coolant, frame."""

    name: Name
    """Its name."""
    temperature: BoundaryTemperature
    """In a prior, `sigma_rel` counts on the absolute temperature; use `{low, high}` instead."""


class LinkSpec(SpecModel):
    """Heat conducted between two nodes, or a node and a boundary."""

    between: Ends
    """The names of both ends."""
    conductance: uncertain_field("W/K")  # type: ignore[valid-type]
    """Heat per kelvin between them."""
    name: Name | None = None
    """Needed only for a second link between the same two."""

    @property
    def label(self) -> str:
        """The given name, or ``first|second``."""
        return self.name or "|".join(self.between)


class SourceSpec(SpecModel):
    """Heat of a node: ``gain · input^exponent``, or ``gain · (input / reference)^exponent``.

    Without ``input`` the gain is the heat itself.
    """

    node: Name
    """Node that is heated."""
    input: Name | None = None
    """An input of the recording (a channel's `drives`) that the heat follows."""
    gain: GainField
    """In the unit that makes W: "0.9 W/W" of a power, "0.02 W/rpm" of a speed; in W with a reference."""
    exponent: Exponent = 1.0
    """Power of the input."""
    reference: ReferenceField = None
    """Input at which the heat is the gain itself."""

    @property
    def label(self) -> str:
        """``node.input``, as parameters and tables name it."""
        return f"{self.node}.{self.input or 'constant'}"


class NetworkSpec(SpecModel):
    """Nodes, boundaries, links and sources."""

    node: Annotated[tuple[NodeSpec, ...], Field(min_length=1)]
    """At least one."""
    boundary: tuple[BoundarySpec, ...] = ()
    """Boundaries that the nodes lose heat to."""
    link: tuple[LinkSpec, ...] = ()
    """Links that conduct heat between nodes and boundaries."""
    source: tuple[SourceSpec, ...] = ()
    """Heat sources."""


class NetworkMachineSpec(SpecModel):
    """A whole ``[network]`` machine file."""

    schema_: Annotated[Literal["spindle-fem/machine/1"], Field(alias="schema")]
    """The version of this format."""
    name: str
    """Name of the machine, in reports."""
    description: str = ""
    """Description of the network and origin of its values."""
    initial: Literal["first_reading", "ambient", "steady"] = "first_reading"
    """Temperatures at the start; those of nodes without a sensor are estimated."""
    network: NetworkSpec
    """Nodes, boundaries, links and sources."""
    effects: Annotated[tuple[EffectEntry, ...], Field(alias="effect")] = ()
    """Physics that the network does not hold, switched on; see `[[effect]]` above."""

    def __repr__(self) -> str:
        nodes, links = len(self.network.node), len(self.network.link)
        return f"<{type(self).__name__}: {self.name}, {nodes} nodes, {links} links>"

    __str__ = __repr__
