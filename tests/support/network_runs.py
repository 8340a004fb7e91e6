"""Written networks over time: by the fast model as the product runs it, and by their modes as a reference."""

from types import SimpleNamespace

import numpy as np
import scipy.linalg

from spindle_fem.model.lumped.driven_inputs import boundary_temperatures, source_heat
from spindle_fem.model.reduced.drive import Drive, inputs_on_steps
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.operation.operating_point import OperatingPoint


def run_network(network, history, start, derivatives=(), start_by=None):
    """The fast model of a network on a history of its inputs, from given temperatures of all nodes."""
    grid, begin, end = inputs_on_steps(history.times, history.values, history.held, np.inf)
    classes = np.zeros(len(begin), dtype=np.int64)
    point = OperatingPoint(*[np.nan] * 5)
    drive = Drive(history.times, grid, history.names, begin, end, classes, (point,), ())
    states = np.asarray(start, dtype=float)[None, :]
    given = Start(np.zeros(1, dtype=np.int64), states, start_by or {})
    return simulate_fast(fast_network(network), drive, given, derivatives=derivatives)


def run_on_recording(network, recording, parameters=(), initial="first_reading"):
    """What the channels of a recording should read, its derivatives, the starts and the notes."""
    fast, names = fast_network(network), tuple(item.name for item in parameters)
    drive = fast.inputs.drive(recording)
    own = tuple(item for item in parameters if item.kind == "initial")
    start = fast.inputs.start(recording, drive, {}, names, kind=initial, initial=own)
    run = simulate_fast(fast, drive, start, derivatives=names)
    rows = fast.require_channels(recording.probes, "test")
    return SimpleNamespace(
        predicted=run.temperature[:, rows],
        sensitivity=run.sensitivity[:, rows],
        initial=start.states,
        notes=drive.notes,
    )


def modal_solution(network, history, start):
    """Temperatures of all nodes at every time from the modes of the network, (N, n) K; every mode decays."""
    n, matrix, root = network.n_nodes, network.conductance_matrix(), np.sqrt(network.capacity)
    rates, modes = scipy.linalg.eigh(matrix[:, :n] / np.outer(root, root))
    forcing = []
    for values in history.ends():
        inputs, number = dict(zip(history.names, values.T, strict=True)), len(values)
        heat = np.zeros((number, n))
        np.add.at(heat, (slice(None), network.source_node), source_heat(network, inputs, number))
        heat -= boundary_temperatures(network, inputs, number) @ matrix[:, n:].T
        forcing.append((heat / root) @ modes)
    found = [modes.T @ (root * np.asarray(start, dtype=float))]
    for step, first, last in zip(np.diff(history.times), *forcing, strict=True):
        decay, slope = np.exp(-rates * step), (last - first) / step
        gained = -np.expm1(-rates * step) / rates
        found.append(decay * found[-1] + gained * first + (step - gained) / rates * slope)
    return np.array(found) @ modes.T / root
