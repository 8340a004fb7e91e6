"""Steady state of a written thermal network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from spindle_fem.errors import EnergyBalanceError, NoSteadyStateError
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
    heat_in : float, [W]
        Of the sources.
    imbalance_relative : float
        ``|in - out|`` over the sum of the magnitudes of all flows through
        sources and boundaries.
    """

    temperature: Array
    boundary_temperature: Array
    link_heat: Array
    boundary_heat: Mapping[str, float]
    heat_in: float
    imbalance_relative: float


def solve_steady(network: ThermalNetwork, inputs: Inputs | None = None) -> NetworkSteady:
    """Temperatures at which every node's heat balance is zero.

    Parameters
    ----------
    inputs : mapping of str to float, optional
        SI values of every input the network needs.

    Raises
    ------
    NoSteadyStateError
        No conductance above zero leads from some node to a boundary.
    EnergyBalanceError
        Heat in and out differ by more than 1e-10 of the flows.

    >>> import numpy as np
    >>> wall = ThermalNetwork(("body",), [100.0], [0], [1], [2.0], ("room",), [290.0],
    ...     source_node=[0], source_input=(None,), source_gain=[10.0], source_exponent=[1.0])
    >>> float(solve_steady(wall).temperature[0].round(9))
    295.0
    """
    inputs = {} if inputs is None else inputs
    n, boundary = network.n_nodes, network.boundary_values(inputs)
    node_heat = network.node_heat(network.source_values(inputs))
    matrix = network.conductance_matrix()
    try:
        temperature = np.linalg.solve(matrix[:, :n], node_heat - matrix[:, n:] @ boundary)
    except np.linalg.LinAlgError as error:
        raise NoSteadyStateError(
            "network", "the heat balance is singular.", "A body loses no heat at this state."
        ) from error
    both = np.concatenate([temperature, boundary])
    conductance = network.link_conductance
    link_heat = conductance * (both[network.link_first] - both[network.link_second])
    into_boundary = np.bincount(
        np.concatenate([network.link_second, network.link_first]),
        np.concatenate([link_heat, -link_heat]),
        len(both),
    )[n:]
    heat_in, heat_out = float(node_heat.sum()), float(into_boundary.sum())
    # a network at rest has no flow to compare with: its rounding is that of conductance times temperature
    scale = max(
        float(np.abs(node_heat).sum() + np.abs(into_boundary).sum()),
        1.0e-5 * float(conductance.sum()) * float(np.abs(both).max(initial=0.0)),
    )
    imbalance = abs(heat_in - heat_out) / scale if scale > 0.0 else 0.0
    if imbalance > BALANCE_TOLERANCE:
        raise EnergyBalanceError(
            "network",
            f"heat in {heat_in:.9g} W and out {heat_out:.9g} W differ by {imbalance:.2g} of the flows.",
            "Bring the conductances nearer to each other.",
        )
    return NetworkSteady(
        temperature,
        boundary,
        link_heat,
        dict(zip(network.boundary_names, into_boundary.tolist(), strict=True)),
        heat_in,
        imbalance,
    )
