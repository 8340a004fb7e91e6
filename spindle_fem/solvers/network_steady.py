"""Steady state of a written thermal network, and whether it is a stable one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from spindle_fem.errors import EnergyBalanceError, NoSteadyStateError
from spindle_fem.model.lumped.node_balance import NetworkBalance
from spindle_fem.model.lumped.thermal_network import Array, Inputs, ThermalNetwork
from spindle_fem.solvers.newton import newton

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
    inputs : mapping of str to float, optional
        SI values of every input the network needs.
    initial : (n,) ndarray, [K], optional
        Start of the iteration; default: the mean boundary temperature.
    tolerance : float
        Largest node imbalance over the sum of all heat flows.
    temperature_limit : float, [K]
        Beyond it the iteration of a network with laws is taken to run away.

    Raises
    ------
    NoSteadyStateError
        Temperatures run away, or the state that was found is unstable: a
        small disturbance would grow.
    ConvergenceError
        Newton steps used up.
    EnergyBalanceError
        Heat in and out differ by more than 1e-10 of the flows.

    >>> import numpy as np
    >>> wall = ThermalNetwork(("body",), [100.0], [0], [1], [2.0], ("room",), [290.0],
    ...     source_node=[0], source_input=(None,), source_gain=[10.0], source_exponent=[1.0])
    >>> float(solve_steady(wall).temperature[0].round(9))
    295.0
    """
    inputs = {} if inputs is None else inputs
    boundary = network.boundary_values(inputs)
    node_heat = network.node_heat(network.source_values(inputs))
    balance = _AtInputs(network, boundary, node_heat, inputs, tolerance)
    start = float(boundary.mean()) if boundary.size else 293.15
    first = np.full(network.n_nodes, start) if initial is None else np.array(initial, dtype=float)
    temperature, derivative, steps = newton(balance, first, hottest=temperature_limit, most=max_iterations)
    require_stable(derivative, network)
    return _state(network, balance.balance, temperature, boundary, node_heat, inputs, steps)


class _AtInputs:
    """Heat balance of a written network at fixed inputs."""

    name = "network"

    def __init__(
        self, network: ThermalNetwork, boundary: Array, node_heat: Array, inputs: Inputs, tolerance: float
    ) -> None:
        self.balance = NetworkBalance(network)
        self.node_names, self.is_linear = network.node_names, network.is_linear
        self.boundary, self.node_heat, self.inputs = boundary, node_heat, inputs
        self._tolerance = tolerance
        self._conductance = 1.0e-2 * float(np.abs(self.balance.node_matrix).sum())
        self._given = float(np.abs(node_heat).sum())

    def __call__(self, temperature: Array) -> tuple[Array, Array]:
        return self.balance(temperature, self.boundary, self.node_heat, self.inputs)

    def rounding(self, temperature: Array, derivative: Array) -> float:
        """That of conductance times absolute temperature is the least that can be reached."""
        del derivative
        scale = self._given + self._conductance * float(temperature.max(initial=0.0))
        return self._tolerance * scale


def require_stable(derivative: Array, network: ThermalNetwork) -> None:
    """Refuse a steady state from which a small disturbance grows.

    Parameters
    ----------
    derivative : (n, n) float64 ndarray, [W/K]
        Of the net heat to the temperatures.

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
