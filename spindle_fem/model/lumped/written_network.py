"""Convert a written network to one that can be solved."""

from __future__ import annotations

import numpy as np

from spindle_fem.definition.network_tables import NetworkMachineSpec, NetworkSpec
from spindle_fem.model.lumped.thermal_network import Parameter, ThermalNetwork
from spindle_fem.units import Uncertain


def build_network(spec: NetworkSpec) -> ThermalNetwork:
    """Solvable network of a written one; every value with a prior becomes a parameter.

    Parameters
    ----------
    spec : NetworkSpec
        Already free of faults.

    Returns
    -------
    ThermalNetwork
        A source's gain holds its reference: ``gain / reference^exponent``.
    """
    nodes = [node.name for node in spec.node]
    boundaries = [boundary.name for boundary in spec.boundary]
    place = {name: position for position, name in enumerate([*nodes, *boundaries])}
    parameters: list[Parameter] = []

    def amount(kind: str, label: str, index: int, value: Uncertain, scale: float, unit: str) -> float:
        if not value.is_fixed:
            parameters.append(
                Parameter(f"{kind}.{label}", kind, index, value.value * scale, value.sigma_log, unit)
            )
        return value.value * scale

    capacity = [amount("capacity", n.name, i, n.capacity, 1.0, "J/K") for i, n in enumerate(spec.node)]
    conductance = [
        amount("conductance", link.label, i, link.conductance, 1.0, "W/K") for i, link in enumerate(spec.link)
    ]
    gains, gain_units = [], []
    for i, source in enumerate(spec.source):
        scale, unit = 1.0, source.gain.unit
        if source.reference is not None:
            scale = source.reference.amount.value**-source.exponent
            if source.reference.unit:
                unit = f"({unit}) / ({source.reference.unit}) ** {source.exponent!r}"
        gains.append(amount("gain", source.label, i, source.gain.amount, scale, unit))
        gain_units.append(unit)
    temperature, driven = [], []
    for i, boundary in enumerate(spec.boundary):
        if isinstance(boundary.temperature, str):
            temperature.append(np.nan)
            driven.append(boundary.temperature)
        else:
            temperature.append(amount("temperature", boundary.name, i, boundary.temperature, 1.0, "K"))
            driven.append(None)
    return ThermalNetwork(
        node_names=tuple(nodes),
        capacity=np.array(capacity),
        link_first=np.array([place[link.between[0]] for link in spec.link], dtype=np.int64),
        link_second=np.array([place[link.between[1]] for link in spec.link], dtype=np.int64),
        link_conductance=np.array(conductance),
        boundary_names=tuple(boundaries),
        boundary_temperature=np.array(temperature),
        boundary_input=tuple(driven),
        link_names=tuple(link.label for link in spec.link),
        source_node=np.array([place[source.node] for source in spec.source], dtype=np.int64),
        source_input=tuple(source.input for source in spec.source),
        source_gain=np.array(gains),
        source_exponent=np.array([source.exponent for source in spec.source]),
        source_gain_unit=tuple(gain_units),
        source_names=tuple(source.label for source in spec.source),
        parameters=tuple(parameters),
    )


def value_in_definition(spec: NetworkMachineSpec, network: ThermalNetwork, name: str, factor: float) -> float:
    """Value of a parameter with a factor, in the definition's own unit.

    Parameters
    ----------
    network : ThermalNetwork
        Made of it.
    name : str
        As the network's parameters are named.
    """
    kind, _, label = name.partition(".")
    if kind == "gain":
        source = next(item for item in spec.network.source if item.label == label)
        return source.gain.amount.value * factor
    return next(p.value for p in network.parameters if p.name == name) * factor
