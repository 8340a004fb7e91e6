"""A written network on a recording: whether they fit, its inputs, and the temperatures it starts from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import (
    FaultsError,
    RecordingError,
    SpecError,
    SpindleFemError,
    UnitError,
    did_you_mean,
)
from spindle_fem.model.lumped.driven_inputs import boundary_temperatures, source_heat
from spindle_fem.model.lumped.thermal_network import Parameter, ThermalNetwork
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.faults_beside import how_to_drive
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.network_steady import solve_steady
from spindle_fem.units import ANGULAR_SPEED_UNIT, registry

Array = NDArray[np.float64]

INITIAL_KINDS = ("first_reading", "ambient", "steady")
# K; standard deviation of a node that nothing reads, about its estimate.
UNREAD_SIGMA = 5.0
# 1 σ of what a thermocouple or a resistance sensor reads beside the truth, K (IEC 60584 and 60751): a node
# may begin that far from its first reading, which is fitted like all others.
READ_SIGMA = 1.5


def require_compatible(network: ThermalNetwork, recording: Recording) -> tuple[str, ...]:
    """Check that a recording drives and reads a network; notes on what is left over.

    Raises
    ------
    FaultsError
        Every missing input, unknown probe and wrong unit at once.
    """
    faults: list[SpindleFemError] = []
    where = recording.source
    for column, probe in zip(recording.temperature_names, recording.probes, strict=True):
        if probe not in network.node_names:
            faults.append(
                RecordingError(
                    f"{where}: channel {column}",
                    f'probe "{probe}" is not a node of the machine.',
                    did_you_mean(probe, network.node_names),
                )
            )
    for name in network.input_names:
        if name not in recording.input_names:
            faults.append(
                RecordingError(
                    where,
                    f'no channel drives "{name}", which the machine needs.',
                    how_to_drive(name, recording.input_names),
                )
            )
    units = dict(zip(recording.input_names, recording.input_units, strict=True))
    for boundary, name in zip(network.boundary_names, network.boundary_input, strict=True):
        if name in units and units[name] != "kelvin":
            faults.append(
                UnitError(
                    f'{where}: input "{name}"',
                    f'drives the boundary "{boundary}" but is no temperature.',
                    "Allowed: degC, K, degF.",
                )
            )
    faults += _gain_unit_faults(network, units, where)
    if faults:
        raise FaultsError(where, faults)
    notes = [
        f'input "{name}" drives nothing' for name in recording.input_names if name not in network.input_names
    ]
    notes += [f'node "{name}" is not read' for name in network.node_names if name not in recording.probes]
    if len(recording.segments) > 1:
        notes.append(
            f"{len(recording.segments)} segments between gaps above {recording.defects.long_gap_s:g} s: "
            "each starts from its first readings"
        )
    return tuple(notes)


def _gain_unit_faults(network: ThermalNetwork, units: dict[str, str], where: str) -> list[SpindleFemError]:
    pint_units = registry()
    power = dict(pint_units.Unit("W").dimensionality)
    faults: list[SpindleFemError] = []
    if not network.source_gain_unit:
        return faults
    for position, name in enumerate(network.source_input):
        if name is None or name not in units:
            continue
        gain = network.source_gain_unit[position]
        exponent = float(network.source_exponent[position])
        found = dict(pint_units.Quantity(1.0, gain).dimensionality) if gain else {}
        for dimension, number in pint_units.Unit(units[name]).dimensionality.items():
            found[dimension] = found.get(dimension, 0.0) + number * exponent
        keys = set(found) | set(power)
        if any(abs(found.get(key, 0.0) - power.get(key, 0.0)) > 1.0e-9 for key in keys):
            faults.append(
                UnitError(
                    f'{where}: source "{network.source_names[position]}"',
                    f'gain in "{gain or "1"}" times "{name}" in "{units[name] or "1"}"'
                    f" to the power {exponent:g} is no heat.",
                    "Give the gain in W over the input's unit, or in W with a reference.",
                )
            )
    return faults


def magnitude_history(
    network: ThermalNetwork, recording: Recording, names: tuple[str, ...] | None = None
) -> InputHistory:
    """The inputs a network needs, or others by name, rotational speeds without their direction.

    Friction and windage do not know which way a spindle turns.
    """
    history = recording.input_history(network.input_names if names is None else names)
    units = dict(zip(recording.input_names, recording.input_units, strict=True))
    values = history.values.copy()
    for column, name in enumerate(history.names):
        if units[name] == ANGULAR_SPEED_UNIT:
            values[:, column] = np.abs(values[:, column])
    return replace(history, values=values)


def initial_state(
    network: ThermalNetwork,
    history: InputHistory,
    readings: dict[str, float],
    parameters: tuple[Parameter, ...] = (),
    *,
    kind: str = "first_reading",
) -> tuple[Array, Array]:
    """Temperatures at the start of a history and their derivatives to log-parameters.

    Parameters
    ----------
    history : InputHistory
        Its first row counts.
    readings : mapping of str to float, [K]
        First reading of the nodes that have one.
    parameters : tuple of Parameter
        Of kind "initial": their value replaces the node's reading.
    kind : {"first_reading", "ambient", "steady"}
        With "first_reading", a node without reading takes the temperature at
        which its own balance is zero, its neighbours being as read. "ambient"
        is the boundary of that name, or the only one. "steady" is the balance
        of the whole network at the first inputs.

    Returns
    -------
    state : (n,) ndarray, [K]
    derivative : (n, p) ndarray, [K]

    Raises
    ------
    SpecError
        "ambient" in a network without such a boundary.
    """
    n, number = network.n_nodes, len(parameters)
    matrix, inputs = network.conductance_matrix(), history.at_first()
    first = {name: history.values[:1, history.column(name)] for name in network.input_names}
    boundary = boundary_temperatures(network, first, 1)[0]
    sources = source_heat(network, first, 1)[0]
    node_heat = network.node_heat(sources)
    derivative = np.zeros((n, number))
    if kind == "ambient":
        names = network.boundary_names
        if "ambient" not in names and len(names) != 1:
            raise SpecError(
                "initial", '"ambient" needs a boundary of that name.', did_you_mean("ambient", names)
            )
        place = names.index("ambient") if "ambient" in names else 0
        for p, parameter in enumerate(parameters):
            if parameter.kind == "temperature" and parameter.index == place:
                derivative[:, p] = boundary[place]
        return np.full(n, boundary[place]), derivative
    if kind == "steady":
        state = solve_steady(network, inputs).temperature.copy()
        known = np.zeros(n, dtype=bool)
    elif kind == "first_reading":
        known = np.array([name in readings for name in network.node_names])
        mean = np.mean([*readings.values()]) if readings else float(boundary.mean())
        state = np.array([readings.get(name, mean) for name in network.node_names], dtype=float)
    else:
        raise SpecError("initial", f'"{kind}" is unknown.', f"Allowed: {', '.join(INITIAL_KINDS)}.")
    for p, parameter in enumerate(parameters):
        if parameter.kind == "initial":
            state[parameter.index] = parameter.value
            derivative[parameter.index, p] = parameter.value
            known[parameter.index] = True
    unread = np.flatnonzero(~known)
    if unread.size == 0:
        return state, derivative
    # The nodes that are not read are where the others, the sources and the boundaries hold them.
    own, rest = matrix[np.ix_(unread, unread)], np.flatnonzero(known)
    load = node_heat - matrix[:, n:] @ boundary
    state[unread] = np.linalg.solve(own, load[unread] - matrix[np.ix_(unread, rest)] @ state[rest])
    explicit = _balance_slope(network, matrix, parameters, np.concatenate([state, boundary]), sources)
    driven = explicit[unread] - matrix[np.ix_(unread, rest)] @ derivative[rest]
    derivative[unread] = np.linalg.solve(own, driven)
    return state, derivative


def _balance_slope(
    network: ThermalNetwork, matrix: Array, parameters: tuple[Parameter, ...], both: Array, sources: Array
) -> Array:
    """Derivative of the net heat to the log-parameters at fixed temperatures, ``(n, p) [W]``."""
    n = network.n_nodes
    result = np.zeros((n, len(parameters)))
    for p, parameter in enumerate(parameters):
        index = parameter.index
        if parameter.kind == "conductance":
            first, second = network.link_first[index], network.link_second[index]
            flow = network.link_conductance[index] * (both[first] - both[second])
            for end, sign in ((first, -1.0), (second, 1.0)):
                if end < n:
                    result[end, p] += sign * flow
        elif parameter.kind == "gain":
            result[network.source_node[index], p] += sources[index]
        elif parameter.kind == "temperature":
            result[:, p] -= matrix[:, n + index] * network.boundary_temperature[index]
    return result


def initial_parameters(network: ThermalNetwork, recording: Recording) -> tuple[Parameter, ...]:
    """Initial temperatures of the first segment as parameters with priors.

    Returns
    -------
    tuple of Parameter
        Kind "initial", named ``initial.<node>``; the logarithm of the
        absolute temperature carries the spread.
    """
    begin, end = recording.segments[0]
    part = magnitude_history(network, recording).cut(begin, end)
    readings = recording.first_readings(0)
    state, _ = initial_state(network, part, readings)
    sigma = dict(zip(recording.probes, recording.sigma.tolist(), strict=True))
    return tuple(
        Parameter(
            name=f"initial.{name}",
            kind="initial",
            index=index,
            value=float(state[index]),
            sigma_log=(math.hypot(sigma[name], READ_SIGMA) if name in readings else UNREAD_SIGMA)
            / float(state[index]),
            unit="K",
        )
        for index, name in enumerate(network.node_names)
    )
