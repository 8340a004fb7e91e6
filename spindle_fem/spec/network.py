"""A machine without drawings: the thermal network that a user writes down."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pint
from pydantic import BeforeValidator, Field, PlainSerializer, ValidationError

from spindle_fem.errors import (
    FaultsError,
    SpecError,
    SpindleFemError,
    UnitError,
    UnknownSurfaceError,
    did_you_mean,
)
from spindle_fem.spec.fields import Name, SpecModel, uncertain_field
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


def network_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    """Everything that makes a well-formed network unusable, by name.

    Floating nodes, capacities and conductances that are not positive, unknown
    or repeated names, links to themselves, gains without a power.
    """
    faults: list[SpindleFemError] = []
    seen: dict[str, str] = {}
    for kind, items in (("node", spec.node), ("boundary", spec.boundary)):
        for number, item in enumerate(items, 1):
            where = f"network.{kind}[{number}].name"
            if item.name in seen:
                earlier = seen[item.name]
                faults.append(
                    SpecError(
                        where, f'"{item.name}" is defined twice, first as {earlier}.', "Use one definition."
                    )
                )
            seen.setdefault(item.name, f"network.{kind}[{number}]")
    for number, node in enumerate(spec.node, 1):
        if not node.capacity.value > 0.0:
            faults.append(
                SpecError(
                    f"network.node[{number}].capacity",
                    f'"{node.name}" has {node.capacity.value:g} J/K.',
                    "Allowed: above 0 J/K.",
                )
            )
    for number, boundary in enumerate(spec.boundary, 1):
        value = boundary.temperature
        if isinstance(value, Uncertain) and not value.value > 0.0:
            faults.append(
                SpecError(
                    f"network.boundary[{number}].temperature",
                    f"{value.value:g} K is below absolute zero.",
                    'Allowed: such as "20 degC".',
                )
            )
    faults += _link_faults(spec, seen)
    faults += _source_faults(spec)
    if not faults:
        faults += _floating_faults(spec)
    return faults


def _link_faults(spec: NetworkSpec, known: Mapping[str, str]) -> list[SpindleFemError]:
    faults: list[SpindleFemError] = []
    labels: dict[frozenset[str] | str, int] = {}
    boundaries = {boundary.name for boundary in spec.boundary}
    for number, link in enumerate(spec.link, 1):
        where = f"network.link[{number}]"
        unknown = [end for end in dict.fromkeys(link.between) if end not in known]
        faults += [
            UnknownSurfaceError(
                f"{where}.between", f'"{end}" is neither a node nor a boundary.', did_you_mean(end, known)
            )
            for end in unknown
        ]
        if link.between[0] == link.between[1]:
            faults.append(
                SpecError(
                    f"{where}.between", f'joins "{link.between[0]}" to itself.', "Name two different ends."
                )
            )
        elif set(link.between) <= boundaries:
            faults.append(
                SpecError(
                    f"{where}.between",
                    f'joins the boundaries "{link.between[0]}" and "{link.between[1]}".',
                    "At least one end must be a node.",
                )
            )
        if not link.conductance.value > 0.0:
            faults.append(
                SpecError(
                    f"{where}.conductance",
                    f'"{link.label}" has {link.conductance.value:g} W/K.',
                    "Allowed: above 0 W/K.",
                )
            )
        label = link.name or frozenset(link.between)
        if label in labels:
            faults.append(
                SpecError(
                    where,
                    f'"{link.label}" is the same link as network.link[{labels[label]}].',
                    "Give the second one a name of its own, or add the conductances.",
                )
            )
        labels.setdefault(label, number)
    return faults


def _source_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    faults: list[SpindleFemError] = []
    names = [node.name for node in spec.node]
    labels: dict[str, int] = {}
    for number, source in enumerate(spec.source, 1):
        where = f"network.source[{number}]"
        if source.node not in names:
            faults.append(
                UnknownSurfaceError(
                    f"{where}.node", f'"{source.node}" is not a node.', did_you_mean(source.node, names)
                )
            )
        if source.label in labels:
            faults.append(
                SpecError(
                    where,
                    f'node "{source.node}" already takes heat from {source.input or "a constant"} in '
                    f"network.source[{labels[source.label]}].",
                    "Use one source for each node and input.",
                )
            )
        labels.setdefault(source.label, number)
        faults += _gain_faults(source, where)
    return faults


def _gain_faults(source: SourceSpec, where: str) -> list[SpindleFemError]:
    units = registry()
    power = units.Unit("W").dimensionality
    is_power = units.Unit(source.gain.unit).dimensionality == power
    example = 'For example gain = "5 W".'
    if source.input is None:
        if source.exponent != 1.0 or source.reference is not None:
            return [
                SpecError(where, "exponent and reference need an input.", "Name the input, or drop them.")
            ]
        if not is_power:
            return [UnitError(f"{where}.gain", "a source without input needs a power.", example)]
    elif source.reference is not None:
        if not source.reference.amount.value > 0.0:
            return [SpecError(f"{where}.reference", "must be above 0.", 'For example "1000 rpm".')]
        if not is_power:
            return [
                UnitError(f"{where}.gain", "with a reference the gain is the heat there, a power.", example)
            ]
    return []


def _floating_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    neighbours: dict[str, set[str]] = {}
    for link in spec.link:
        first, second = link.between
        neighbours.setdefault(first, set()).add(second)
        neighbours.setdefault(second, set()).add(first)
    reached = {boundary.name for boundary in spec.boundary}
    frontier = list(reached)
    while frontier:
        new = neighbours.get(frontier.pop(), set()) - reached
        reached |= new
        frontier += new
    return [
        SpecError(
            f"network.node[{number}]",
            f'"{node.name}" floats: no chain of links joins it to a boundary.',
            "Link it, directly or through other nodes, to a boundary.",
        )
        for number, node in enumerate(spec.node, 1)
        if node.name not in reached
    ]


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
    from spindle_fem.spec.load import validation_faults

    schema = content.get("schema")
    if schema != NETWORK_SCHEMA:
        fault = SpecError(f"{source}: schema", f"{schema!r} is not known.", f'Allowed: "{NETWORK_SCHEMA}".')
        raise FaultsError(source, [fault])
    try:
        spec = NetworkMachineSpec.model_validate(dict(content))
    except ValidationError as error:
        raise FaultsError(source, validation_faults(error, source, NetworkMachineSpec)) from error
    faults = network_faults(spec.network)
    if faults:
        raise FaultsError(
            source,
            [type(fault)(f"{source}: {fault.where}", fault.what, fault.how_to_fix) for fault in faults],
        )
    return spec


def load_network_machine(path: str | Path) -> NetworkMachineSpec:
    """Read a ``[network]`` machine file.

    Raises
    ------
    SpecError
        Anything wrong with the file.
    """
    from spindle_fem.spec.load import find_machine, read_toml

    found = find_machine(path)
    return validate_network_machine(read_toml(found), found.name)
