"""The heat balance of a network's nodes, its Jacobian, and its derivatives to the parameters."""

from __future__ import annotations

import numpy as np

from spindle_fem.model.lumped.thermal_network import Array, ConductanceLaw, Inputs, Parameter, ThermalNetwork


class NetworkBalance:
    """Net heat into every node and its derivative, prepared for repeated evaluation."""

    def __init__(self, network: ThermalNetwork) -> None:
        self.network = network
        n = network.n_nodes
        matrix = network.conductance_matrix()
        self.node_matrix = matrix[:, :n]
        self.boundary_matrix = -matrix[:, n:]
        self._laws = [_PlacedLaw(network, law) for law in network.conductance_laws]

    def __call__(
        self, temperature: Array, boundary: Array, source_heat: Array, inputs: Inputs
    ) -> tuple[Array, Array]:
        """Net heat and its Jacobian.

        Parameters
        ----------
        temperature : (n,) float64 ndarray, [K]
        boundary : (b,) float64 ndarray, [K]
        source_heat : (n,) float64 ndarray, [W]
            Sources summed over nodes.
        inputs : mapping of str to float
            For the laws, SI.

        Returns
        -------
        net : (n,) float64 ndarray, [W]
        derivative : (n, n) float64 ndarray, [W/K]
        """
        net = source_heat - self.node_matrix @ temperature + self.boundary_matrix @ boundary
        derivative = -self.node_matrix
        if self._laws or self.network.heat_laws:
            derivative = derivative.copy()
            both = np.concatenate([temperature, boundary])
            for law in self._laws:
                law.add(both, inputs, net, derivative)
            for function in self.network.heat_laws:
                heat, heat_derivative = function(temperature, boundary, inputs)
                net = net + heat
                derivative += heat_derivative
        return net, derivative

    def link_conductances(self, temperature: Array, boundary: Array, inputs: Inputs) -> Array:
        """Conductance of every link, ``(m,) [W/K]``, laws evaluated."""
        conductance = self.network.link_conductance.copy()
        both = np.concatenate([temperature, boundary])
        for law in self._laws:
            conductance[law.links] = law.evaluate(both, inputs)[0]
        return conductance


class _PlacedLaw:
    """A conductance law with the places of its contributions worked out once."""

    def __init__(self, network: ThermalNetwork, law: ConductanceLaw) -> None:
        n = network.n_nodes
        self.n_nodes = n
        self.links = np.asarray(law.links, dtype=np.int64)
        self.function = law.function
        self.first = network.link_first[self.links]
        self.second = network.link_second[self.links]
        rows = np.concatenate([self.first, self.first, self.second, self.second])
        columns = np.concatenate([self.first, self.second, self.first, self.second])
        self._inside = (rows < n) & (columns < n)
        self._flat = (rows * n + columns)[self._inside]
        self._nodes = np.concatenate([self.first, self.second])
        self._n_total = n + len(network.boundary_names)

    def evaluate(self, both: Array, inputs: Inputs) -> tuple[Array, Array, Array]:
        return self.function(both[self.first], both[self.second], inputs)

    def add(self, both: Array, inputs: Inputs, net: Array, derivative: Array) -> None:
        conductance, to_first, to_second = self.evaluate(both, inputs)
        difference = both[self.first] - both[self.second]
        flow = conductance * difference
        gathered = np.bincount(self._nodes, np.concatenate([-flow, flow]), self._n_total)
        net += gathered[: self.n_nodes]
        by_first = conductance + to_first * difference
        by_second = to_second * difference - conductance
        weights = np.concatenate([-by_first, -by_second, by_first, by_second])[self._inside]
        derivative += np.bincount(self._flat, weights, self.n_nodes**2).reshape(derivative.shape)


def explicit_derivative(
    network: ThermalNetwork,
    balance: NetworkBalance,
    parameters: tuple[Parameter, ...],
    temperature: Array,
    boundary: Array,
    sources: Array,
) -> Array:
    """Derivative of the net heat to the log-parameters at fixed temperatures, ``(n, p) [W]``."""
    n = network.n_nodes
    both = np.concatenate([temperature, boundary])
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
            result[:, p] += balance.boundary_matrix[:, index] * network.boundary_temperature[index]
    return result
