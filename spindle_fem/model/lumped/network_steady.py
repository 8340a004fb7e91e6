"""Steady state of a thermal network by Newton–Raphson with its analytic Jacobian."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, EnergyBalanceError, NoSteadyStateError
from spindle_fem.model.lumped.node_balance import NetworkBalance
from spindle_fem.model.lumped.thermal_network import Array, Inputs, ThermalNetwork

BALANCE_TOLERANCE = 1.0e-10


@dataclass(frozen=True, slots=True)
class NetworkSteady:
    """A steady state with its heat flows.

    Attributes
    ----------
    temperature : (n,) float64 ndarray, [K]
    boundary_temperature : (b,) float64 ndarray, [K]
    link_heat : (m,) float64 ndarray, [W]
        From the first to the second end of each link.
    boundary_heat : mapping of str to float, [W]
        Into each boundary through links.
    stream_heat : float, [W]
        Carried away by fluid streams, net.
    heat_in : float, [W]
        Sources and heat laws.
    imbalance_relative : float
        ``|in - out|`` over the sum of the magnitudes of all flows through
        sources, boundaries and streams.
    iterations : int
        Newton steps.
    """

    temperature: Array
    boundary_temperature: Array
    link_heat: Array
    boundary_heat: Mapping[str, float]
    stream_heat: float
    heat_in: float
    imbalance_relative: float
    iterations: int


def solve_steady(
    network: ThermalNetwork,
    inputs: Inputs | None = None,
    *,
    initial: NDArray[np.float64] | None = None,
    max_iterations: int = 60,
    tolerance: float = 1.0e-12,
    temperature_limit: float = 3000.0,
) -> NetworkSteady:
    """Temperatures at which every node's heat balance is zero.

    Parameters
    ----------
    network : ThermalNetwork
    inputs : mapping of str to float, optional
        SI values of every input the network needs.
    initial : (n,) ndarray, [K], optional
        Start of the iteration; default: the mean boundary temperature.
    max_iterations : int
    tolerance : float
        Largest node imbalance over the sum of all heat flows.
    temperature_limit : float, [K]
        Beyond it the iteration of a network with laws is taken to run away.

    Returns
    -------
    NetworkSteady

    Raises
    ------
    NoSteadyStateError
        Temperatures run away, or the state that was found is unstable: a
        small disturbance would grow.
    ConvergenceError
        Newton steps used up.
    EnergyBalanceError
        Heat in and out differ by more than 1e-10 of the flows.

    Source: damped Newton iteration, Deuflhard (2004), Newton Methods for
    Nonlinear Problems, chapter 3 (residual monotonicity).

    >>> import numpy as np
    >>> wall = ThermalNetwork(("body",), [100.0], [0], [1], [2.0], ("room",), [290.0],
    ...     source_node=[0], source_input=(None,), source_gain=[10.0], source_exponent=[1.0])
    >>> float(solve_steady(wall).temperature[0].round(9))
    295.0
    """
    inputs = {} if inputs is None else inputs
    balance = NetworkBalance(network)
    boundary = network.boundary_values(inputs)
    node_heat = network.node_heat(network.source_values(inputs))
    start = float(boundary.mean()) if boundary.size else 293.15
    temperature = np.full(network.n_nodes, start) if initial is None else np.array(initial, dtype=float)

    net, derivative = balance(temperature, boundary, node_heat, inputs)
    norm = float(np.abs(net).max(initial=0.0))
    for iteration in range(1, max_iterations + 1):
        try:
            step = np.linalg.solve(derivative, -net)
        except np.linalg.LinAlgError as error:
            raise NoSteadyStateError(
                "network",
                f"the heat balance is singular at iteration {iteration}.",
                "A node loses no heat at this state, or heat grows with temperature as fast as it is lost.",
            ) from error
        damping = 1.0
        while True:
            trial = temperature + damping * step
            sensible = bool(np.all(np.isfinite(trial)) and np.all(trial > 0.0))
            if sensible:
                trial_net, trial_derivative = balance(trial, boundary, node_heat, inputs)
                trial_norm = float(np.abs(trial_net).max(initial=0.0))
                scale = _flow_scale(balance, trial, boundary, node_heat)
                if trial_norm <= max((1.0 - 0.25 * damping) * norm, tolerance * scale):
                    break
            damping *= 0.5
            if damping < 1.0e-4:
                raise NoSteadyStateError(
                    "network",
                    f"no step lowers the imbalance of {norm:.3g} W at node "
                    f'"{network.node_names[int(np.abs(net).argmax())]}".',
                    "Heat grows faster than it is lost, or a law and its derivative disagree.",
                )
        moved = float(np.abs(trial - temperature).max(initial=0.0))
        temperature, net, derivative, norm = trial, trial_net, trial_derivative, trial_norm
        if not network.is_linear and float(temperature.max(initial=0.0)) > temperature_limit:
            raise NoSteadyStateError(
                "network",
                f'node "{network.node_names[int(temperature.argmax())]}" passes {temperature_limit:g} K.',
                "Heat grows with temperature faster than it is lost.",
            )
        # a linear balance is solved in one step; a nonlinear one must also have stopped moving
        if norm <= tolerance * scale and (network.is_linear or moved < 1.0e-8):
            require_stable(derivative, network)
            return _state(network, balance, temperature, boundary, node_heat, inputs, iteration)
    raise ConvergenceError(
        "network",
        f"{max_iterations} Newton steps left an imbalance of {norm:.3g} W.",
        "Start nearer to the solution (initial) or allow more steps.",
    )


def _flow_scale(balance: NetworkBalance, temperature: Array, boundary: Array, node_heat: Array) -> float:
    # the rounding of K T is that of conductance times absolute temperature, so this is the attainable scale
    rounding = np.abs(balance.node_matrix).sum() * float(temperature.max(initial=0.0)) * 1.0e-2
    return float(np.abs(node_heat).sum() + rounding)


def require_stable(derivative: Array, network: ThermalNetwork) -> None:
    """Refuse a steady state from which a small disturbance grows.

    Parameters
    ----------
    derivative : (n, n) float64 ndarray, [W/K]
        Of the net heat to the temperatures.
    network : ThermalNetwork

    Raises
    ------
    NoSteadyStateError

    With no positive entry off the diagonal, ``A = -derivative`` is stable if
    and only if ``A x = 1`` has a positive solution (nonsingular M-matrix);
    otherwise the eigenvalues decide.

    Source: Berman and Plemmons (1994), Nonnegative Matrices in the
    Mathematical Sciences, chapter 6, theorem 2.3 (conditions I27, N38).
    """
    matrix = -derivative
    off_diagonal = matrix - np.diag(np.diag(matrix))
    if np.all(off_diagonal <= 0.0):
        stable = bool(np.all(np.linalg.solve(matrix, np.ones(len(matrix))) > 0.0))
    else:
        rates = scipy.linalg.eigvals(derivative / network.capacity[:, None])
        stable = bool(np.all(rates.real < 0.0))
    if not stable:
        raise NoSteadyStateError(
            "network",
            "the balance that was found is unstable: a small disturbance grows.",
            "Heat grows with temperature faster than it is lost.",
        )


def _state(
    network: ThermalNetwork,
    balance: NetworkBalance,
    temperature: Array,
    boundary: Array,
    node_heat: Array,
    inputs: Inputs,
    iterations: int,
) -> NetworkSteady:
    both = np.concatenate([temperature, boundary])
    conductance = balance.link_conductances(temperature, boundary, inputs)
    link_heat = conductance * (both[network.link_first] - both[network.link_second])
    n = network.n_nodes
    into_boundary = np.bincount(
        np.concatenate([network.link_second, network.link_first]),
        np.concatenate([link_heat, -link_heat]),
        len(both),
    )[n:]
    streams = network.stream_rate * (both[network.stream_downstream] - both[network.stream_upstream])
    law_heat = sum((law(temperature, boundary, inputs)[0] for law in network.heat_laws), np.zeros(n))
    heat_in = float(node_heat.sum() + law_heat.sum())
    heat_out = float(into_boundary.sum() + streams.sum())
    scale = float(
        np.abs(node_heat).sum() + np.abs(law_heat).sum() + np.abs(into_boundary).sum() + np.abs(streams).sum()
    )
    # a network at rest has no flow to compare with: its rounding is that of conductance times temperature
    scale = max(scale, 1.0e-5 * float(conductance.sum()) * float(np.abs(both).max(initial=0.0)))
    imbalance = abs(heat_in - heat_out) / scale if scale > 0.0 else 0.0
    if imbalance > BALANCE_TOLERANCE:
        raise EnergyBalanceError(
            "network",
            f"heat in {heat_in:.9g} W and out {heat_out:.9g} W differ by {imbalance:.2g} of the flows.",
            "Check that every law returns the conductance it claims.",
        )
    return NetworkSteady(
        temperature=temperature,
        boundary_temperature=boundary,
        link_heat=link_heat,
        boundary_heat=dict(zip(network.boundary_names, into_boundary.tolist(), strict=True)),
        stream_heat=float(streams.sum()),
        heat_in=heat_in,
        imbalance_relative=imbalance,
        iterations=iterations,
    )
