"""Temperatures of a network over time, by the exact or the implicit scheme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.model.lumped.exact_steps import LinearSystem, exact_transient
from spindle_fem.model.lumped.implicit_steps import StepCounts, implicit_transient
from spindle_fem.model.lumped.thermal_network import Array, Parameter, ThermalNetwork
from spindle_fem.recordings.input_samples import InputHistory

METHODS = ("auto", "exact", "implicit")


@dataclass(frozen=True, slots=True)
class NetworkTransient:
    """Temperatures of chosen nodes over time.

    Attributes
    ----------
    times : (N,) float64 ndarray, [s]
    node_names : tuple of str
        The q nodes that were asked for.
    temperature : (N, q) float64 ndarray, [K]
    sensitivity : (N, q, p) float64 ndarray, [K]
        Derivative to the natural logarithm of each parameter.
    final : (n,) float64 ndarray, [K]
        All nodes at the last time: the state to restart from.
    method : str
        "exact" or "implicit".
    counts : StepCounts or None
        Of the implicit scheme.
    """

    times: Array
    node_names: tuple[str, ...]
    temperature: Array
    parameter_names: tuple[str, ...]
    sensitivity: Array
    final: Array
    method: str
    counts: StepCounts | None


@dataclass(frozen=True, slots=True)
class TimeScheme:
    """How a network is followed in time.

    Attributes
    ----------
    method : {"auto", "exact", "implicit"}
        Exact needs a linear network without streams; auto takes it where it can.
    step_error : float or None, [K]
        Of the implicit scheme, for each step.
    max_step : float, [s]
        Of the implicit scheme.
    """

    method: str = "auto"
    step_error: float | None = 1.0e-3
    max_step: float = np.inf


DEFAULT_SCHEME = TimeScheme()


def simulate_transient(
    network: ThermalNetwork,
    history: InputHistory,
    initial: NDArray[np.float64],
    *,
    nodes: tuple[str, ...] | None = None,
    parameters: tuple[Parameter, ...] = (),
    initial_derivative: NDArray[np.float64] | None = None,
    scheme: TimeScheme = DEFAULT_SCHEME,
    system: LinearSystem | None = None,
) -> NetworkTransient:
    """Follow a network through a history of inputs.

    Parameters
    ----------
    initial : (n,) ndarray, [K]
    nodes : tuple of str, optional
        Nodes to return; default all.
    parameters : tuple of Parameter
        Those to differentiate by.
    initial_derivative : (n, p) ndarray, [K], optional
        Of the initial state to the log-parameters.
    scheme : TimeScheme
        Method, step error and longest step.
    system : LinearSystem, optional
        Modes of this network, to share between calls.

    Raises
    ------
    SpecError
        The exact method was asked for a network that has none.
    ConvergenceError
        An implicit step fails at any length.

    A source with an exponent other than 1 takes the heat, not the input, to
    run straight between two samples that are not held.

    >>> body = ThermalNetwork(("body",), [100.0], [0], [1], [2.0], ("room",), [290.0])
    >>> history = InputHistory.constant(np.array([0.0, 50.0]), {})
    >>> run = simulate_transient(body, history, np.array([300.0]))
    >>> float(run.temperature[-1, 0].round(6))  # 290 + 10 exp(-1)
    293.678794
    """
    method = scheme.method
    if method not in METHODS:
        raise SpecError("method", f'"{method}" is unknown.', f"Allowed: {', '.join(METHODS)}.")
    possible = network.is_linear and network.is_symmetric
    if method == "exact" and not possible:
        raise SpecError(
            "method", '"exact" needs a linear network without streams.', 'Allowed here: "implicit".'
        )
    names = network.node_names if nodes is None else nodes
    outputs = np.array([network.node_index(name) for name in names], dtype=np.int64)
    for name in network.input_names:
        history.column(name)
    counts = None
    if possible and method != "implicit":
        temperature, sensitivity, final = exact_transient(
            network,
            history,
            np.asarray(initial, dtype=float),
            outputs,
            parameters,
            initial_derivative,
            system,
        )
        used = "exact"
    else:
        temperature, sensitivity, final, counts = implicit_transient(
            network,
            history,
            np.asarray(initial, dtype=float),
            outputs,
            parameters,
            initial_derivative,
            step_error=scheme.step_error,
            max_step=scheme.max_step,
        )
        used = "implicit"
    return NetworkTransient(
        times=history.times,
        node_names=tuple(names),
        temperature=temperature,
        parameter_names=tuple(parameter.name for parameter in parameters),
        sensitivity=sensitivity,
        final=final,
        method=used,
        counts=counts,
    )
