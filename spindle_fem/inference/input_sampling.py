"""Residuals beyond the noise of readings, and the uncertainty left by rarely recorded inputs.

A held input is unknown until its next row. It is modelled as white noise with the
variance of its changes from row to row, and the network responds as a filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from spindle_fem.inference import tuned
from spindle_fem.inference.observations import Observation
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.robust_size import huber
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]


def unseen_power(network: ThermalNetwork, recording: Recording) -> Array:
    """Spectral density of every source's unseen heat at a gain of one, (n_sources,) (input^exponent)² s."""
    found = np.zeros(len(network.source_names))
    for index, (name, exponent) in enumerate(zip(network.source_input, network.source_exponent, strict=True)):
        if name is None or name not in recording.input_names:
            continue
        column = recording.input_names.index(name)
        written = np.isfinite(recording.inputs[:, column])
        if recording.held[column] and written.sum() > 2:
            heat = np.abs(recording.inputs[written, column]) ** exponent
            apart = float(np.median(np.diff(recording.times[written])))
            # Two rows of a process that forgets between them differ by twice its variance.
            found[index] = 0.5 * float(np.mean(np.diff(heat) ** 2)) * apart
    return found


def sampling_errors(network: ThermalNetwork, power: Array) -> Array:
    """Standard deviation of every node's temperature for unseen heat, (n_nodes,) K.

    Parameters
    ----------
    power : (n_sources,) ndarray
        :func:`unseen_power`.

    Notes
    -----
    Stationary covariance P of ``C dT/dt = -G T + heat``: ``A P + P Aᵀ + B S Bᵀ = 0``.

    Source: Gelb (1974), Applied Optimal Estimation, section 3.7.
    """
    n = network.n_nodes
    matrix = network.conductance_matrix()[:n, :n]
    # Sources that follow one input heat together.
    inputs = list(dict.fromkeys(network.source_input))
    heated = np.zeros((n, len(inputs)))
    owners = [inputs.index(name) for name in network.source_input]
    np.add.at(heated, (network.source_node, owners), network.source_gain * np.sqrt(power))
    heated /= network.capacity[:, None]
    # A network that nothing cools has no stationary state: the least leak gives it one.
    leak = 1e-9 * np.trace(matrix) * np.eye(n)
    state = -(matrix + leak) / network.capacity[:, None]
    covariance = solve_continuous_lyapunov(state, -heated @ heated.T)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def own_times(network: ThermalNetwork) -> Array:
    """Time constant of every node by itself, (n_nodes,) s."""
    return network.capacity / np.maximum(np.diag(network.conductance_matrix())[: network.n_nodes], 1e-12)


def sampled_errors(network: ThermalNetwork, powers: Sequence[Array]) -> dict[str, SlowError]:
    """Errors of the nodes by what rarely read inputs did unseen, by name, each with the time of its node.

    Parameters
    ----------
    powers : sequence of (n_sources,) ndarray
        :func:`unseen_power` of each recording; the largest counts.
    """
    beside = np.max([sampling_errors(network, power) for power in powers], axis=0)
    each = zip(network.node_names, beside.tolist(), own_times(network).tolist(), strict=True)
    return {name: SlowError(sigma, time) for name, sigma, time in each}


def left_over_noise(
    predictor: Predictor,
    observations: Sequence[Observation],
    predicted: Sequence[Array],
    factors: Mapping[str, float],
) -> float:
    """Robust root mean square of single residuals over their noise, all temperatures weighted equally.

    Sensors of a machine with geometry also have the slow error expected of them before any fit; for
    those of a network only ``sigma`` is known.

    Parameters
    ----------
    predicted : sequence of (b,) ndarray, [K]
        At the bins of every observation.
    factors : mapping of str to float
        Fitted factors of a network's parameters.
    """
    beside = []
    if predictor.is_network:
        network = predictor.fast.inputs.moved(factors)
        beside = [sampling_errors(network, power) for power in predictor.unseen]
    ratios = []
    for item, values in zip(observations, predicted, strict=True):
        if item.bins.is_relative:
            continue
        recording = predictor.recordings[item.recording]
        thinned = recording.defects.thinned
        each = 1.0 if thinned is None else thinned.rows / thinned.bins
        noise = item.bins.white**2 * each
        # Restore the noise that averaging removed.
        averaged = noise * (1.0 - float(np.mean(1.0 / item.bins.number)) / each)
        if not predictor.is_network:
            noise += tuned.EXPECTED_SLOW_SIGMA**2
        if beside:
            node = predictor.fast.inputs.channels.index(recording.probes[item.channel])
            noise += float(beside[item.recording][node]) ** 2
        # Few readings far off, as about the edge of an interval, count as they do in a fit.
        ratios.append(np.mean(huber((values - item.values) / np.sqrt(noise))) + averaged / noise)
    return float(np.sqrt(np.mean(ratios)))


def error_over_noise(observations: Sequence[Observation], predicted: Sequence[Array]) -> float:
    """Mean square of residuals of means over bins over the white noise left in them, channels alike.

    Displacements count from a zero of their own.

    Parameters
    ----------
    predicted : sequence of (b,) ndarray, [K, µm]
        At the bins of every observation.
    """
    errors = []
    for item, values in zip(observations, predicted, strict=True):
        residual = values - item.values
        if item.bins.is_relative:
            residual = residual - residual.mean()
        errors.append(np.mean(residual**2) / item.bins.white**2)
    return float(np.mean(errors))
