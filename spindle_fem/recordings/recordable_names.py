"""Names of a machine that the channels of a recording may refer to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.definition.network_load import is_network_machine, load_network_machine
from spindle_fem.recordings.manifest import DRIVES_UNITS


@dataclass(frozen=True, slots=True)
class RecordableNames:
    """Names that recordings of a machine may use; all empty if no machine is given.

    Attributes
    ----------
    probes, sensors : tuple of str
        Probes or network nodes; displacement sensors.
    inputs : dict of str to str
        What may be driven, with its SI unit; empty where any unit will do.
    outlets : tuple of str
        Probes that read the coolant where it leaves.
    needed : tuple of str
        Inputs that must be driven.
    takes_others : bool
        Whether inputs that drive nothing are left out, as a network does.
    """

    probes: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    inputs: dict[str, str] | None = None
    outlets: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()
    takes_others: bool = False


def recordable_names(machine: str | Path, overrides: Iterable[str] = ()) -> RecordableNames:
    """Names of a machine, with geometry or a ``[network]``.

    Raises
    ------
    SpindleFemError
    """
    if is_network_machine(read_definition(find_machine(machine))):
        tables = load_network_machine(machine, overrides).network
        inputs = {item.temperature: "K" for item in tables.boundary if isinstance(item.temperature, str)}
        driven = [source.input for source in tables.source if source.input is not None]
        inputs = {name: DRIVES_UNITS.get(name, "") for name in driven} | inputs
        nodes = tuple(node.name for node in tables.node)
        return RecordableNames(nodes, inputs=inputs, needed=tuple(inputs), takes_others=True)
    spec = load_machine(machine, overrides)
    heat = {f"heat.{source.name}": "W" for source in spec.source}
    # without a gain the input is the heat itself
    heat |= {source.input: "W" if source.gain is None else "" for source in spec.source if source.input}
    heat |= {"torque": "N*m"} if any(source.follows_torque for source in spec.source) else {}
    return RecordableNames(
        tuple(probe.name for probe in spec.probe),
        tuple(sensor.name for sensor in spec.displacement_sensor),
        {**DRIVES_UNITS, **heat},
        tuple(probe.name for probe in spec.probe if probe.kind == "coolant_outlet"),
        ("speed",),
    )
