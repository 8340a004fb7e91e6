"""A written network as the effects see it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.machine_view import MachineView, Seat
from spindle_fem.machine.view.defined_point import defined_recording
from spindle_fem.machine.view.usual_sizes import LEAST_HEAT, LEAST_ON, lowest_speed, quantities_of, usual_rise
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.recordings.align import Recording
from spindle_fem.units import ANGULAR_SPEED_UNIT, ZERO_CELSIUS_K

Array = NDArray[np.float64]

ROOM = ZERO_CELSIUS_K + 20.0
COOLANT_WORD = re.compile("coolant|oil|water|chiller", re.IGNORECASE)


def view_of_network(
    network: ThermalNetwork, recording: Recording, *, has: frozenset[str] = frozenset()
) -> MachineView:
    """A written network on one recording.

    Every source is a bearing, every node a place, every link a joint, and
    those to boundaries are films. An input is speed-like where its unit is
    that of an angular speed.

    Parameters
    ----------
    has : frozenset of str
        Effects that the definition switches on.
    """
    names = (*network.node_names, *network.boundary_names)
    n = network.n_nodes
    scale = {
        name: float(np.nanmax(np.abs(recording.input_at(name, recording.times))))
        for name in recording.input_names
    }
    units = dict(zip(recording.input_names, recording.input_units, strict=True))
    turning = tuple(name for name in recording.input_names if units[name] == ANGULAR_SPEED_UNIT)
    boundary = _boundary_temperatures(network)
    films: dict[str, tuple[str, ...]] = {}
    walls: dict[str, str] = {}
    fluids: dict[str, str | float] = {}
    surroundings: dict[str, list[str]] = {}
    joints: dict[str, tuple[str, ...]] = {}
    conductance: dict[str, float] = {}
    seats: list[Seat] = []
    heated = {int(node) for node in network.source_node}
    for link, first, second, value in zip(
        network.link_names, network.link_first, network.link_second, network.link_conductance, strict=True
    ):
        coefficient = f"link.{link}"
        conductance[coefficient] = float(value)
        seats.append(Seat(link, "", (coefficient,), f"conductance.{link}"))
        ends = sorted((int(first), int(second)))
        if ends[1] >= n > ends[0]:
            other = names[ends[1]]
            films[link], walls[coefficient] = (coefficient,), names[ends[0]]
            fluids[coefficient] = boundary[other]
            surroundings.setdefault(other, []).append(coefficient)
        elif ends[1] < n:
            # The heated end expands into the end that encloses it.
            hot, cold = ends if ends[0] in heated or ends[1] not in heated else ends[::-1]
            walls[coefficient], fluids[coefficient] = names[hot], names[cold]
            joints[link] = (coefficient,)
    # More air movement, or a warmer room, changes all films to that air by the same factor.
    for other, links in surroundings.items():
        if len(links) > 1:
            largest = max(links, key=conductance.__getitem__).removeprefix("link.")
            seats.append(Seat(largest, f"with all links to {other}", tuple(links)))
    nodes = {name: (name,) for name in network.node_names}
    inner, outer, speeds, reported = _sources(network, turning)
    speeds |= dict.fromkeys((*nodes, *films), turning)
    coolants = {name: tuple(links) for name, links in surroundings.items() if COOLANT_WORD.search(name)}
    heat = _network_heat(network, scale)
    ambient, room = _room(network, recording, boundary)
    return MachineView(
        kind="network",
        sets={name: (name,) for name in network.source_names},
        inner=inner,
        outer=outer,
        heat=nodes,
        films=films,
        joints={link: (f"conductance.{link}",) for link in network.link_names},
        joint_coefficients=joints,
        parameters={item.name: item.sigma_log for item in network.parameters if item.sigma_log > 0.0},
        channels=recording.temperature_names,
        inputs=tuple(dict.fromkeys((*recording.input_names, *network.input_names))),
        quantities=quantities_of(recording, turning),
        has=has,
        reference_temperature=room,
        highest_speed=max((scale[name] for name in turning), default=0.0),
        duration=float(recording.times[-1] - recording.times[0]),
        lowest_speed=min(
            (lowest_speed(np.abs(recording.input_at(t, recording.times))) for t in turning), default=0.0
        ),
        seats=tuple(seats),
        spots=nodes,
        reported=reported,
        walls=walls,
        fluids=fluids,
        probes=dict(zip(recording.temperature_names, recording.probes, strict=True)),
        speed_inputs=speeds,
        input_scale=scale,
        capacity=dict(zip(network.node_names, network.capacity.tolist(), strict=True)),
        typical_heat=max(LEAST_HEAT, heat),
        typical_rise=usual_rise(recording, ambient),
        coolant_links=coolants,
        conductance=conductance,
        source_inputs={
            name: source
            for name, source in zip(network.source_names, network.source_input, strict=True)
            if source is not None
        },
        source_heat=_heat_while_on(network, recording),
        surroundings={name: tuple(links) for name, links in surroundings.items()},
    )


def _boundary_temperatures(network: ThermalNetwork) -> dict[str, str | float]:
    return {
        name: float(value) if driven is None else driven
        for name, value, driven in zip(
            network.boundary_names, network.boundary_temperature, network.boundary_input, strict=True
        )
    }


def _sources(
    network: ThermalNetwork, turning: tuple[str, ...]
) -> tuple[dict[str, str], dict[str, str], dict[str, tuple[str, ...]], dict[str, str]]:
    """Node heated by each source, the node it is joined to, its speed-like input, and its name in reports."""
    inner: dict[str, str] = {}
    outer: dict[str, str] = {}
    speeds: dict[str, tuple[str, ...]] = {}
    reported: dict[str, str] = {}
    n = network.n_nodes
    heated = set(network.source_node.tolist())
    for name, node, source in zip(
        network.source_names, network.source_node, network.source_input, strict=True
    ):
        inner[name] = network.node_names[node]
        reported[name] = network.node_names[node]
        speeds[name] = (source,) if source in turning else ()
        # Nodes without heat of their own come first: they hold the bearing.
        joined = [
            (int(b if a == node else a) not in heated, float(value), int(b if a == node else a))
            for a, b, value in zip(
                network.link_first, network.link_second, network.link_conductance, strict=True
            )
            if node in (a, b) and max(a, b) < n
        ]
        if joined:
            outer[name] = network.node_names[max(joined)[2]]
    return inner, outer, speeds, reported


def _network_heat(network: ThermalNetwork, scale: Mapping[str, float]) -> float:
    """All sources with every input at its largest, W."""
    return float(
        sum(
            gain * (1.0 if name is None else scale.get(name, 0.0) ** exponent)
            for gain, name, exponent in zip(
                network.source_gain, network.source_input, network.source_exponent, strict=True
            )
        )
    )


def _heat_while_on(network: ThermalNetwork, recording: Recording) -> dict[str, float]:
    """Mean heat of every driven source while it is on, W."""
    found = {}
    for source, gain, name, exponent in zip(
        network.source_names,
        network.source_gain,
        network.source_input,
        network.source_exponent,
        strict=True,
    ):
        if name in recording.input_names:
            size = np.abs(recording.input_at(name, recording.times))
            on = size[size > LEAST_ON * size.max()]
            if on.size:
                found[source] = float(gain * np.mean(on**exponent))
    return found


def _room(
    network: ThermalNetwork, recording: Recording, boundary: Mapping[str, str | float]
) -> tuple[Array, float]:
    """Temperature of the surroundings at every stamp and its mean: ambient, or the first boundary."""
    name = "ambient" if "ambient" in boundary else next(iter(boundary), "")
    given = boundary.get(name, "")
    if isinstance(given, float):
        series = np.full(recording.times.size, given)
    elif given in recording.input_names:
        series = recording.input_at(given, recording.times)
    else:
        series = np.full(recording.times.size, float(np.nanmean(recording.temperature)))
    return series, float(np.nanmean(series))


def day_of_a_network(network: ThermalNetwork, speeds: Sequence[str] = ()) -> Recording:
    """A day in which every input of a written network is 1 in SI, temperatures 20 °C, and every node is read.

    Parameters
    ----------
    speeds : sequence of str
        Inputs in rad/s, beside those of the network or among them.
    """
    temperatures = {name for name in network.boundary_input if name is not None}
    names = dict.fromkeys((*network.input_names, *speeds))
    values = {name: ROOM if name in temperatures else 1.0 for name in names}
    ends = {name: (value, value) for name, value in values.items()}
    units = dict.fromkeys(speeds, ANGULAR_SPEED_UNIT)
    return defined_recording("network", network.node_names, ROOM, ends, units)
