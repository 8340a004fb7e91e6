"""Fine fields gathered onto the nodes of the unrefined network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.solvers.machine_network_steady import MachineNetworkState
from spindle_fem.studies.crosscheck.axisymmetric import AxisymmetricState
from spindle_fem.studies.crosscheck.regions import cells_at

Array = NDArray[np.float64]


def gather(
    coarse: MachineNetwork, fine: MachineNetwork, solid: Array, balls: Array, air: Array, coolant: Array
) -> Array:
    """Temperatures of a fine model at the nodes of a coarse network, (n_nodes,) [K].

    Solids by volume, gap air by length along z, coolant at the end of each
    coarse cell. NaN where the fine model has no metal: lands that a closed
    ring takes away.
    """
    cells = fine.cells
    middle = np.column_stack([np.zeros(cells.n_cells), cells.r.mean(axis=1), cells.z.mean(axis=1)])
    node = coarse.partition.node_of_cell[cells_at(coarse.cells, cells.part_names, cells.part, middle)]
    n = coarse.n_solid
    volume = np.bincount(node, cells.volume, n)
    mean = np.full(n, np.nan)
    np.divide(np.bincount(node, cells.volume * solid, n), volume, out=mean, where=volume > 0.0)
    values = [mean, balls]
    start = 0
    for name, bands in coarse.gaps.items():
        own = fine.gaps[name]
        values.append(_overlap_mean(own.edges, air[start : start + own.n_bands], bands.edges))
        start += own.n_bands
    if coarse.coolant is not None:
        values.append(np.interp(coarse.coolant.edges[1:], fine.coolant.edges[1:], coolant))
    return np.concatenate(values)


def _overlap_mean(own: Array, values: Array, wanted: Array) -> Array:
    overlap = np.maximum(
        0.0, np.minimum(own[1:, None], wanted[None, 1:]) - np.maximum(own[:-1, None], wanted[None, :-1])
    )
    return (values @ overlap) / overlap.sum(axis=0)


def gather_network(coarse: MachineNetwork, state: MachineNetworkState) -> Array:
    """A refined network's temperatures at the nodes of the unrefined one, K."""
    fine, t = state.network.machine, state.temperature
    return gather(
        coarse,
        fine,
        t[fine.partition.node_of_cell],
        t[fine.n_solid : fine.air_start],
        t[fine.air_start : fine.coolant_start],
        t[fine.coolant_start :],
    )


def gather_axisymmetric(coarse: MachineNetwork, fine: MachineNetwork, state: AxisymmetricState) -> Array:
    """Axisymmetric elements' temperatures at the nodes of the unrefined network, K."""
    return gather(coarse, fine, state.mean, state.balls, state.air, state.coolant)
