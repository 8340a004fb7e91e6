"""Machines without drawings: read from a file, checked, written, with other values of their parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.field_types import SpecModel
from spindle_fem.definition.inherit import apply_overrides
from spindle_fem.definition.load import find_machine, read_toml
from spindle_fem.definition.network_faults import network_faults
from spindle_fem.definition.network_tables import NETWORK_SCHEMA, Gain, NetworkMachineSpec, SourceSpec
from spindle_fem.errors import FaultsError, SpecError, UnknownSurfaceError, did_you_mean
from spindle_fem.units import Uncertain


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
    """The machine with some values replaced, for example by calibrated ones.

    Parameters
    ----------
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
