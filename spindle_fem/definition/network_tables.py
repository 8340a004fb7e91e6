"""A machine without drawings: the thermal network that a user writes down."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pint
import tomli_w
from pydantic import BeforeValidator, Field, PlainSerializer, ValidationError

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.field_types import Name, SpecModel, uncertain_field
from spindle_fem.definition.inherit import apply_overrides
from spindle_fem.definition.load import find_machine, read_toml
from spindle_fem.errors import (
    FaultsError,
    SpecError,
    SpindleFemError,
    UnitError,
    UnknownSurfaceError,
    did_you_mean,
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


def _base_unit(text: Any) -> str:
    """SI unit of a quantity's text in a form that reads back, ``""`` for a pure number."""
    match = _NUMBER_AND_UNIT.fullmatch(str(text))
    if match is None or not match[1]:
        return ""
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
        unit = _base_unit(sample)
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
        unit = _base_unit(value)
        return Gain(Uncertain(to_si(value, unit, where="")), unit)
    except SpindleFemError as error:
        raise ValueError(f"{error.what} {error.how_to_fix}".strip()) from error


GainField = Annotated[Gain, BeforeValidator(_read_gain), PlainSerializer(_write_gain)]
ReferenceField = Annotated[
    Gain | None,
    BeforeValidator(_read_reference),
    PlainSerializer(lambda value: None if value is None else _write_gain(value)),
]
BoundaryTemperature = Annotated[
    Uncertain | str,
    BeforeValidator(_read_boundary_temperature),
    PlainSerializer(_write_boundary_temperature),
]


class NodeSpec(SpecModel):
    """A lump with one temperature.

    ``capacity`` is its mass times specific heat, J/K.
    """

    name: Name
    capacity: uncertain_field("J/K")  # type: ignore[valid-type]


class BoundarySpec(SpecModel):
    """Something whose temperature does not answer to the machine: room, coolant, frame.

    ``temperature`` is the name of an input (a channel's ``drives``), a
    quantity, or a prior. ``sigma_rel`` counts on the absolute temperature;
    ``{low, high}`` is the plain way.
    """

    name: Name
    temperature: BoundaryTemperature


class LinkSpec(SpecModel):
    """Heat conducted between two nodes, or a node and a boundary.

    ``name`` is needed only for a second link between the same two.
    """

    between: tuple[Name, Name]
    conductance: uncertain_field("W/K")  # type: ignore[valid-type]
    name: Name | None = None

    @property
    def label(self) -> str:
        """The given name, or ``first|second``."""
        return self.name or "|".join(self.between)


class SourceSpec(SpecModel):
    """Heat of a node: ``gain · input^exponent``, or ``gain · (input / reference)^exponent``.

    Without ``input`` the gain is the heat itself.
    """

    node: Name
    input: Name | None = None
    gain: GainField
    exponent: Annotated[float, Field(gt=0.0, le=6.0, allow_inf_nan=False)] = 1.0
    reference: ReferenceField = None

    @property
    def label(self) -> str:
        """``node.input``, as parameters and tables name it."""
        return f"{self.node}.{self.input or 'constant'}"


class NetworkSpec(SpecModel):
    """Nodes, boundaries, links and sources."""

    node: Annotated[tuple[NodeSpec, ...], Field(min_length=1)]
    boundary: tuple[BoundarySpec, ...] = ()
    link: tuple[LinkSpec, ...] = ()
    source: tuple[SourceSpec, ...] = ()


class NetworkMachineSpec(SpecModel):
    """A whole ``[network]`` machine file."""

    schema_: Annotated[Literal["spindle-fem/machine/1"], Field(alias="schema")]
    name: str
    description: str = ""
    initial: Literal["first_reading", "ambient", "steady"] = "first_reading"
    network: NetworkSpec
    effects: Annotated[tuple[EffectEntry, ...], Field(alias="effect")] = ()


def validate_network_machine(content: Mapping[str, Any], source: str) -> NetworkMachineSpec:
    """Typed ``[network]`` machine of raw tables; every fault at once.

    Parameters
    ----------
    content : mapping
        The parsed file.
    source : str
        File name for messages.

    Raises
    ------
    FaultsError
        One or more faults; each names file, key, value and what is allowed.
    """
    schema = content.get("schema")
    if schema != NETWORK_SCHEMA:
        fault = SpecError(f"{source}: schema", f"{schema!r} is not known.", f'Allowed: "{NETWORK_SCHEMA}".')
        raise FaultsError(source, [fault])
    try:
        spec = NetworkMachineSpec.model_validate(dict(content))
    except ValidationError as error:
        raise FaultsError(source, validation_faults(error, source, NetworkMachineSpec)) from error
    from spindle_fem.definition.network_faults import network_faults

    faults = network_faults(spec.network)
    if faults:
        raise FaultsError(
            source,
            [type(fault)(f"{source}: {fault.where}", fault.what, fault.how_to_fix) for fault in faults],
        )
    return spec


def is_network_machine(content: Mapping[str, Any]) -> bool:
    """Whether raw tables describe a machine without drawings."""
    return "network" in content and "part" not in content


def load_network_machine(machine: str | Path, overrides: Iterable[str] = ()) -> NetworkMachineSpec:
    """Read a ``[network]`` machine file, or one that ships by its name.

    Parameters
    ----------
    machine : str or Path
    overrides : iterable of str
        ``path=value`` texts, such as ``network.node.winding.capacity=50 J/K``.

    Raises
    ------
    SpecError
        Anything wrong with the file or the overrides.
    """
    found = find_machine(machine)
    content = apply_overrides(read_toml(found), overrides, NetworkMachineSpec)
    return validate_network_machine(content, found.name)


def write_network_machine(spec: NetworkMachineSpec) -> str:
    """TOML text of a network machine; reads back to an equal one."""
    content = spec.model_dump(mode="json", by_alias=True, exclude_none=True)
    return tomli_w.dumps(_without_empty(content))


def _without_empty(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_empty(item) for key, item in value.items() if item not in ({}, [], "")}
    return [_without_empty(item) for item in value] if isinstance(value, list) else value


def with_parameters(spec: NetworkMachineSpec, values: Mapping[str, Uncertain]) -> NetworkMachineSpec:
    """The same machine with some values replaced, for example by calibrated ones.

    Parameters
    ----------
    spec : NetworkMachineSpec
    values : mapping of str to Uncertain
        By the names that :func:`spindle_fem.model.lumped.written_network.build_network` gives
        its parameters, in the units of the definition: a gain with a reference
        is the heat there.

    Raises
    ------
    UnknownSurfaceError
        A name that this machine does not have.
    """
    network = spec.network
    changed: dict[str, list[SpecModel]] = {
        "node": list(network.node),
        "boundary": list(network.boundary),
        "link": list(network.link),
        "source": list(network.source),
    }
    places = {f"capacity.{node.name}": ("node", i, "capacity") for i, node in enumerate(network.node)}
    places |= {
        f"temperature.{b.name}": ("boundary", i, "temperature") for i, b in enumerate(network.boundary)
    }
    places |= {f"conductance.{link.label}": ("link", i, "conductance") for i, link in enumerate(network.link)}
    places |= {f"gain.{source.label}": ("source", i, "gain") for i, source in enumerate(network.source)}
    for name, value in values.items():
        if name not in places:
            raise UnknownSurfaceError("parameters", f'"{name}" is unknown.', did_you_mean(name, places))
        kind, index, field = places[name]
        item = changed[kind][index]
        given = Gain(value, item.gain.unit) if isinstance(item, SourceSpec) else value
        changed[kind][index] = item.model_copy(update={field: given})
    tables = {kind: tuple(items) for kind, items in changed.items()}
    return spec.model_copy(update={"network": network.model_copy(update=tables)})
