"""The reduced network as files for other programs: TOML machine, numpy arrays, plain JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.network_load import validate_network_machine, write_network_machine
from spindle_fem.operation.bearing_heat import HeatModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.crosscheck.flux_matched import MatchedNetwork
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]
# Not that of exported models, which hold other arrays under other names.
STATE_SPACE_SCHEMA = "spindle-fem/network-state-space/1"
RPM = np.pi / 30.0


@dataclass(frozen=True, slots=True)
class StateSpace:
    """``dx/dt = A x + B u``, ``y = C x + D u``; x in K, u in W and K, time in s.

    Attributes
    ----------
    states, inputs, outputs : tuple of str
        Inputs are ``heat.<bearing>`` and ``heat.<source>`` [W], and boundary temperatures [K];
        outputs the node temperatures [K] and ``coolant_outlet`` [K].
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    a: Array
    b: Array
    c: Array
    d: Array


def state_space(network: MatchedNetwork, conductance: Array | None = None) -> StateSpace:
    """Linear state-space model of a reduced network at fixed conductances.

    Parameters
    ----------
    conductance : (m,) ndarray, [W/K], optional
        Those of the matched state by default.
    """
    g = network.factor * network.base if conductance is None else conductance
    matrix, to_boundary = network.matrices(g)
    n, boundaries = network.n_nodes, network.boundary_names
    inverse = 1.0 / network.capacity[:, None]
    b = np.hstack([network.spread, to_boundary]) * inverse
    c, d = np.eye(n), np.zeros((n, b.shape[1]))
    outputs = network.node_names
    if network.coolant_rate > 0.0:
        inlet = n + boundaries.index("coolant_inlet")
        to_inlet = np.where(network.second == inlet, g, 0.0)
        row = np.bincount(network.first, to_inlet, n) / network.coolant_rate
        feed = np.zeros(b.shape[1])
        feed[network.spread.shape[1] + boundaries.index("coolant_inlet")] = 1.0 - row.sum()
        c, d, outputs = np.vstack([c, row]), np.vstack([d, feed]), (*outputs, "coolant_outlet")
    inputs = (*(f"heat.{name}" for name in network.heated_by), *boundaries)
    return StateSpace(network.node_names, inputs, tuple(outputs), -matrix * inverse, b, c, d)


def export_network(
    network: MatchedNetwork,
    folder: Path,
    points: Sequence[OperatingPoint],
    heat_model: HeatModel,
) -> list[str]:
    """Write ``reduced_network.toml``, ``state_space.npz`` and ``state_space.json``.

    Parameters
    ----------
    points : sequence of OperatingPoint
        The state-space has one set of matrices for the speed of each; the
        TOML machine is that of the matched state.

    Returns
    -------
    list of str
        Names of the files.
    """
    text = network_toml(network)
    (folder / "reduced_network.toml").write_text(text, encoding="utf-8")
    spaces = [state_space(network, network.conductance(point, heat_model)) for point in points]
    speeds = np.array([point.speed / RPM for point in points])
    first = spaces[0]
    np.savez_compressed(
        folder / "state_space.npz",
        schema=STATE_SPACE_SCHEMA,
        speed_rpm=speeds,
        A=np.stack([s.a for s in spaces]),
        B=np.stack([s.b for s in spaces]),
        C=np.stack([s.c for s in spaces]),
        D=np.stack([s.d for s in spaces]),
        states=np.array(first.states),
        inputs=np.array(first.inputs),
        outputs=np.array(first.outputs),
        capacity_J_K=network.capacity,
    )
    content = {
        "schema": STATE_SPACE_SCHEMA,
        "machine": network.machine.spec.name,
        "equations": "dx/dt = A x + B u, y = C x + D u; temperatures in K, heat in W, time in s; "
        "between speeds, interpolate the matrices",
        "matched_speed_rpm": network.matched.point.speed / RPM,
        "states": list(first.states),
        "inputs": list(first.inputs),
        "outputs": list(first.outputs),
        "speeds": [
            {"speed_rpm": float(speed), "A": _rows(s.a), "B": _rows(s.b), "C": _rows(s.c), "D": _rows(s.d)}
            for speed, s in zip(speeds, spaces, strict=True)
        ],
    }
    (folder / "state_space.json").write_text(json.dumps(content), encoding="utf-8")
    return ["reduced_network.toml", "state_space.npz", "state_space.json"]


def _rows(matrix: Array) -> list[list[float]]:
    return [[float(f"{value:.12g}") for value in row] for row in matrix]


def network_toml(network: MatchedNetwork) -> str:
    """The reduced network at its matched state as a ``[network]`` machine."""
    names = (*network.node_names, *network.boundary_names)
    g = network.factor * network.base
    boundary = []
    values = network.boundary_temperature(network.matched.point)
    for name, value in zip(network.boundary_names, values, strict=True):
        driven = name in ("ambient", "coolant_inlet")
        fixed = f"{float(value) - ZERO_CELSIUS_K!r} degC"
        boundary.append({"name": name, "temperature": name if driven else fixed})
    links = [
        {"between": [names[a], names[b]], "conductance": f"{float(value)!r} W/K"}
        for a, b, value in zip(network.first, network.second, g, strict=True)
        if value > 0.0
    ]
    node, heated_by = np.nonzero(network.spread)
    content: dict[str, Any] = {
        "schema": "spindle-fem/machine/1",
        "name": f"{network.machine.spec.name} reduced",
        "description": (
            "Conductances by flux matching to the finite elements at "
            f"{network.matched.point.speed / RPM:.0f} rpm; inputs heat.<bearing> and heat.<source> in W."
        ),
        "initial": "ambient",
        "network": {
            "node": [
                {"name": name, "capacity": f"{float(capacity)!r} J/K"}
                for name, capacity in zip(network.node_names, network.capacity, strict=True)
            ],
            "boundary": boundary,
            "link": links,
            "source": [
                {
                    "node": network.node_names[n],
                    "input": f"heat.{network.heated_by[b]}",
                    "gain": f"{float(network.spread[n, b])!r} W/W",
                }
                for n, b in zip(node, heated_by, strict=True)
            ],
        },
    }
    return write_network_machine(validate_network_machine(content, "reduced_network.toml"))
