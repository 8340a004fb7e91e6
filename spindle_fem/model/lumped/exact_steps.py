"""Exact steps of a linear symmetric network under piecewise linear forcing.

With ``y = C^(1/2) T`` the balance is ``y' = -S y + f``, ``S = C^(-1/2) K C^(-1/2)``
symmetric. One eigendecomposition serves every step length, and the whole
history is one first-order recurrence for each mode. Derivatives to the
parameters are those of the same matrix functions (divided differences).

Source: Higham (2008), Functions of Matrices, sections 2.1, 3.2 (Daletskii–Krein
theorem) and 10.7.4 (phi functions).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from spindle_fem.model.lumped.driven_inputs import boundary_history, source_history
from spindle_fem.model.lumped.thermal_network import Array, Parameter, ThermalNetwork
from spindle_fem.recordings.input_samples import InputHistory

# Taylor series of the phi functions below this argument; the recursion above loses at most 1e-13 there.
SERIES_BELOW = 0.5
SERIES_TERMS = 16
# Divided differences of nearer arguments become derivatives: their error is then below spacing²/24 ≈ 4e-10.
NEAR_ARGUMENTS = 1.0e-4
MANY_STEP_LENGTHS = 256


def phi_functions(argument: Array) -> tuple[Array, Array, Array, Array]:
    """``phi_0 ... phi_3`` of ``-x`` for ``x >= 0``.

    ``phi_0 = exp(-x)``, ``phi_{k+1}(-x) = (1/k! - phi_k(-x)) / x``.

    >>> [float(v.round(6)) for v in phi_functions(np.array(0.0))]
    [1.0, 1.0, 0.5, 0.166667]
    """
    x = np.asarray(argument, dtype=float)
    values = [np.exp(-x)]
    small = np.abs(x) < SERIES_BELOW
    safe = np.where(small, 1.0, x)
    factorial = 1.0
    for order in range(1, 4):
        direct = (1.0 / factorial - values[-1]) / safe
        if order == 1:
            direct = -np.expm1(-safe) / safe
        term = np.full_like(x, 1.0 / np.prod(np.arange(1, order + 1)))
        series = term.copy()
        for k in range(1, SERIES_TERMS):
            term = term * (-x) / (order + k)
            series = series + term
        values.append(np.where(small, series, direct))
        factorial *= order
    return values[0], values[1], values[2], values[3]


def phi_derivatives(argument: Array) -> tuple[Array, Array, Array]:
    """Derivatives to ``x`` of ``phi_0, phi_1, phi_2`` of ``-x``.

    From ``phi_k'(z) = phi_k(z) - k phi_{k+1}(z)`` at ``z = -x``.
    """
    zero, one, two, three = phi_functions(argument)
    return -zero, -(one - two), -(two - 2.0 * three)


def divided_differences(argument: Array) -> tuple[Array, Array, Array]:
    """Matrices ``(phi_k(-x_i) - phi_k(-x_j)) / (x_i - x_j)`` of ``(..., n)``, each ``(..., n, n)``."""
    x = np.asarray(argument, dtype=float)
    spacing = x[..., :, None] - x[..., None, :]
    middle = 0.5 * (x[..., :, None] + x[..., None, :])
    near = np.abs(spacing) < NEAR_ARGUMENTS
    safe = np.where(near, 1.0, spacing)
    result = []
    for value, derivative in zip(phi_functions(x)[:3], phi_derivatives(middle), strict=True):
        quotient = (value[..., :, None] - value[..., None, :]) / safe
        result.append(np.where(near, derivative, quotient))
    return result[0], result[1], result[2]


def first_order_recurrence(decay: Array, drive: Array, start: Array) -> Array:
    """All terms of ``z[k + 1] = decay[k] z[k] + drive[k]``, ``(N + 1, ...)``.

    Done in blocks, so that the number of Python steps grows with the square
    root of N. ``decay`` may have fewer trailing columns than ``drive`` if they
    broadcast.

    >>> first_order_recurrence(np.full((3, 1), 0.5), np.ones((3, 1)), np.zeros(1)).ravel().tolist()
    [0.0, 1.0, 1.5, 1.75]
    """
    number = len(drive)
    length = max(1, int(np.sqrt(number)))
    blocks = -(-number // length)
    padding = blocks * length - number
    if padding:
        decay = np.concatenate([decay, np.ones((padding, *decay.shape[1:]))])
        drive = np.concatenate([drive, np.zeros((padding, *drive.shape[1:]))])
    decay = decay.reshape(blocks, length, *decay.shape[1:])
    local = drive.reshape(blocks, length, *drive.shape[1:]).copy()
    carried = decay.copy()
    for k in range(1, length):
        local[:, k] += decay[:, k] * local[:, k - 1]
        carried[:, k] *= carried[:, k - 1]
    entering = np.empty((blocks, *local.shape[2:]))
    state = np.broadcast_to(start, entering.shape[1:])
    for block in range(blocks):
        entering[block] = state
        state = carried[block, -1] * state + local[block, -1]
    local += carried * entering[:, None]
    result = np.empty((number + 1, *drive.shape[1:]))
    result[0] = start
    result[1:] = local.reshape(blocks * length, *drive.shape[1:])[:number]
    return result


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """The symmetrised matrices of a linear network and their modes.

    Attributes
    ----------
    root_capacity : (n,) float64 ndarray, [(J/K)^(1/2)]
    system : (n, n) float64 ndarray, [1/s]
        S, symmetric.
    boundary : (n, b) float64 ndarray, [W/K]
    rates : (n,) float64 ndarray, [1/s]
        Eigenvalues of S: reciprocals of the time constants.
    modes : (n, n) float64 ndarray
        Orthonormal columns.
    """

    root_capacity: Array
    system: Array
    boundary: Array
    rates: Array
    modes: Array

    @classmethod
    def of(cls, network: ThermalNetwork) -> LinearSystem:
        """Assemble and diagonalise."""
        n = network.n_nodes
        matrix = network.conductance_matrix()
        root = np.sqrt(network.capacity)
        system = matrix[:, :n] / np.outer(root, root)
        system = 0.5 * (system + system.T)
        rates, modes = scipy.linalg.eigh(system)
        # rounding may leave the slowest rate of a weakly tied network at -1e-20
        return cls(root, system, -matrix[:, n:], np.maximum(rates, 0.0), modes)


def exact_transient(
    network: ThermalNetwork,
    history: InputHistory,
    initial: Array,
    outputs: Array,
    parameters: tuple[Parameter, ...] = (),
    initial_derivative: Array | None = None,
    system: LinearSystem | None = None,
) -> tuple[Array, Array, Array]:
    """Temperatures at every time and their derivatives to log-parameters.

    Parameters
    ----------
    network : ThermalNetwork
        Linear, without streams.
    initial : (n,) ndarray, [K]
    outputs : (q,) int ndarray
        Nodes to return.
    initial_derivative : (n, p) ndarray, [K], optional
        Of the initial temperatures to the logarithms of the parameters.
    system : LinearSystem, optional
        Of the same network, to share between segments.

    Returns
    -------
    temperature : (N, q) ndarray, [K]
    sensitivity : (N, q, p) ndarray, [K]
        ``dT / d ln(parameter)``.
    final : (n,) ndarray, [K]
        Every node at the last time.
    """
    system = LinearSystem.of(network) if system is None else system
    root, modes = system.root_capacity, system.modes
    start_values, end_values = history.ends()
    steps, kind = np.unique(np.diff(history.times), return_inverse=True)
    boundary = [boundary_history(network, history, v) for v in (start_values, end_values)]
    sources = [source_history(network, history, v) for v in (start_values, end_values)]
    forcing = [
        ((network.node_heat(s) + b @ system.boundary.T) / root) @ modes
        for s, b in zip(sources, boundary, strict=True)
    ]
    arguments = steps[:, None] * system.rates
    decay, one, two, _ = phi_functions(arguments)
    level, slope = (steps[:, None] * one)[kind], (steps[:, None] * two)[kind]
    decay = decay[kind]
    change = forcing[1] - forcing[0]
    modal = first_order_recurrence(decay, level * forcing[0] + slope * change, modes.T @ (root * initial))
    readout = modes[outputs] / root[outputs, None]
    temperature = modal @ readout.T
    final = (modes @ modal[-1]) / root
    if not parameters:
        return temperature, np.zeros((*temperature.shape, 0)), final

    number, n = len(parameters), network.n_nodes
    initial_derivative = np.zeros((n, number)) if initial_derivative is None else initial_derivative
    turning = np.empty((number, n, n))
    forcing_derivative = np.zeros((2, len(kind), n, number))
    start_derivative = modes.T @ (root[:, None] * initial_derivative)
    for p, parameter in enumerate(parameters):
        system_derivative, per_end = _parameter_terms(network, system, parameter, boundary, sources)
        turning[p] = modes.T @ system_derivative @ modes
        for end in range(2):
            node, scaled = per_end[end]
            if parameter.kind == "capacity":
                full = forcing[end] @ modes.T[:, [node]]
                forcing_derivative[end, :, :, p] = -0.5 * full * modes[node]
            elif scaled is not None:
                forcing_derivative[end, :, :, p] = scaled @ modes
        if parameter.kind == "capacity":
            node = parameter.index
            start_derivative[:, p] += 0.5 * modes[node] * root[node] * initial[node]
    drive = _turned(arguments, steps, kind, turning, modal[:-1], forcing[0], change)
    drive += level[:, :, None] * forcing_derivative[0]
    drive += slope[:, :, None] * (forcing_derivative[1] - forcing_derivative[0])
    modal_derivative = first_order_recurrence(decay[:, :, None], drive, start_derivative)
    sensitivity = np.einsum("qi,kip->kqp", readout, modal_derivative, optimize=True)
    for p, parameter in enumerate(parameters):
        if parameter.kind == "capacity":
            matching = np.flatnonzero(outputs == parameter.index)
            sensitivity[:, matching, p] -= 0.5 * temperature[:, matching]
    return temperature, sensitivity, final


def _parameter_terms(network, system, parameter, boundary, sources):
    """Derivative of S, and of the scaled forcing at both ends of each interval."""
    n, root, index = network.n_nodes, system.root_capacity, parameter.index
    system_derivative = np.zeros((n, n))
    if parameter.kind == "capacity":
        system_derivative[index] -= 0.5 * system.system[index]
        system_derivative[:, index] -= 0.5 * system.system[:, index]
        return system_derivative, [(index, None)] * 2
    scaled: list[Array | None] = [None, None]
    if parameter.kind == "conductance":
        value = network.link_conductance[index]
        first, second = network.link_first[index], network.link_second[index]
        inside = [end for end in (first, second) if end < n]
        for end in inside:
            system_derivative[end, end] += value / root[end] ** 2
        if len(inside) == 2:
            system_derivative[first, second] -= value / (root[first] * root[second])
            system_derivative[second, first] -= value / (root[first] * root[second])
        else:
            (node,) = inside
            outside = max(first, second) - n
            for end in range(2):
                scaled[end] = np.zeros((len(boundary[end]), n))
                scaled[end][:, node] = value * boundary[end][:, outside] / root[node]
    elif parameter.kind == "gain":
        node = network.source_node[index]
        for end in range(2):
            scaled[end] = np.zeros((len(sources[end]), n))
            scaled[end][:, node] = sources[end][:, index] / root[node]
    elif parameter.kind == "temperature":
        for end in range(2):
            row = system.boundary[:, index] * network.boundary_temperature[index] / root
            scaled[end] = np.broadcast_to(row, (len(boundary[end]), n))
    return system_derivative, [(-1, scaled[0]), (-1, scaled[1])]


def _turned(arguments, steps, kind, turning, modal, forcing, change):
    """Part of the drive that comes from the change of the propagators, ``(N - 1, n, p)``."""
    number, n = len(turning), arguments.shape[1]
    result = np.empty((len(kind), n, number))
    order = np.argsort(kind, kind="stable")
    edges = np.searchsorted(kind[order], np.arange(len(steps) + 1))
    if len(steps) <= MANY_STEP_LENGTHS:
        for group, step in enumerate(steps):
            rows = order[edges[group] : edges[group + 1]]
            zero, one, two = divided_differences(arguments[group])
            for p in range(number):
                turned = step * turning[p]
                part = modal[rows] @ (zero * turned).T
                part += step * (forcing[rows] @ (one * turned).T + change[rows] @ (two * turned).T)
                result[rows, :, p] = part
        return result
    chunk = max(1, 2_000_000 // n**2)
    for begin in range(0, len(kind), chunk):
        rows = slice(begin, min(begin + chunk, len(kind)))
        step = steps[kind[rows]][:, None, None]
        zero, one, two = divided_differences(arguments[kind[rows]])
        weighted = zero * modal[rows, None, :]
        weighted += step * (one * forcing[rows, None, :] + two * change[rows, None, :])
        result[rows] = np.einsum("kij,pij->kip", step * weighted, turning, optimize=True)
    return result
