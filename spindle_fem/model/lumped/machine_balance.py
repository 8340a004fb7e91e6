"""Heat balance of a machine's network at an operating point, and the bearing temperatures in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.lumped.operating_state import OperatingNetwork
from spindle_fem.operation.bearing_heat import BearingTemperatures

Array = NDArray[np.float64]
# Up to this many nodes a full matrix is quicker than a sparse one.
DENSE_UP_TO = 200


class SparseBalance:
    """Net heat into every node and its derivative: sparse, full for a small network."""

    def __init__(self, network: OperatingNetwork) -> None:
        self.network = network
        n, total = network.n_nodes, network.n_nodes + len(network.boundary_names)
        first, second, g = network.first, network.second, network.conductance
        up, down = network.streams
        rate = np.full(len(up), network.stream_rate)
        rows = np.concatenate([first, second, first, second, down, down])
        columns = np.concatenate([first, second, second, first, down, up])
        values = np.concatenate([g, g, -g, -g, rate, -rate])
        self.full: Array | None = None
        if total <= DENSE_UP_TO:
            whole = np.bincount(rows * total + columns, values, total * total).reshape(total, total)
            self.matrix = self.full = np.ascontiguousarray(whole[:n, :n])
        else:
            whole = sparse.csr_array((values, (rows, columns)), shape=(total, total))
            self.matrix = whole[:n, :n].tocsc()
        self.load = network.heat - whole[:n, n:] @ network.boundary_temperature
        self.n = n

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self.network.machine.spec.name

    @property
    def node_names(self) -> tuple[str, ...]:
        """Names of the nodes of the machine's network."""
        return self.network.machine.node_names

    @property
    def is_linear(self) -> bool:
        """Whether no heat depends on temperature."""
        return not self.network.laws

    def rounding(self, temperature: Array, derivative: sparse.csc_array | Array) -> float:
        """Imbalance that rounding leaves: that of conductance times absolute temperature, W."""
        return 1.0e-13 * float(np.abs(derivative.diagonal()).max()) * float(temperature.max())

    def __call__(self, temperature: Array) -> tuple[Array, sparse.csc_array | Array]:
        """Net heat (n,) [W] and derivative (n, n) [W/K]."""
        net = self.load - self.matrix @ temperature
        if self.full is not None:
            return self._full(net, temperature)
        derivative = -self.matrix
        if self.network.laws:
            pieces = [law(temperature) for law in self.network.laws]
            net = net + sum(heat for heat, _ in pieces)
            rows, columns, values = (np.concatenate([item[1][k] for item in pieces]) for k in range(3))
            derivative = derivative + sparse.csc_array((values, (rows, columns)), shape=(self.n, self.n))
        return net, derivative.tocsc()

    def _full(self, net: Array, temperature: Array) -> tuple[Array, Array]:
        derivative = -self.full
        for law in self.network.laws:
            heat, (rows, columns, values) = law(temperature)
            net = net + heat
            derivative = derivative + np.bincount(rows * self.n + columns, values, self.n * self.n).reshape(
                self.n, self.n
            )
        return net, derivative


def bearing_temperatures(network: OperatingNetwork, temperature: Array) -> dict[str, BearingTemperatures]:
    """Raceways, balls and seats of every bearing at node temperatures (n,), K."""
    machine = network.machine
    found = {}
    shifts = {} if machine.growth is None else machine.growth.shifts(temperature[: machine.n_solid])
    for name, ball in machine.ball_nodes.items():
        inner, outer = network.raceway_temperatures(temperature, name)
        shaft = _seat(machine, temperature, f"{name}.inner_ring", inner)
        housing = _seat(machine, temperature, f"{name}.outer_ring", outer)
        found[name] = BearingTemperatures(
            inner, outer, float(temperature[ball]), shaft, housing, shifts.get(name)
        )
    return found


def _seat(machine: MachineNetwork, temperature: Array, ring: str, default: float) -> float:
    """Mean of what a ring sits on, taken at the nodes behind the joint."""
    nodes, share = machine.seats[ring]
    return float(temperature[nodes] @ share) if nodes.size else default
