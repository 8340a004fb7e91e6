"""Names and unit operators of a thermal network, in the form the fast model needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.thermal_model import ThermalModel

Array = NDArray[np.float64]

LINK = "link."


@dataclass(frozen=True, slots=True)
class NetworkTable:
    """Factors on the numbers of a network, like :class:`CoefficientTable` for a machine.

    Attributes
    ----------
    groups : mapping of coefficient to tuple of str
        ``link.<link>`` and ``capacity.<node>`` to the parameter that scales it.
    names : tuple of str
        Every name that a factor may have.
    """

    groups: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...]

    @classmethod
    def of(cls, network: ThermalNetwork) -> NetworkTable:
        """Table of a network."""
        groups = {f"{LINK}{name}": (f"conductance.{name}",) for name in network.link_names}
        groups |= {f"capacity.{name}": (f"capacity.{name}",) for name in network.node_names}
        names = [name for entry in groups.values() for name in entry]
        names += [f"gain.{name}" for name in network.source_names]
        fixed = zip(network.boundary_names, network.boundary_input, strict=True)
        names += [f"temperature.{name}" for name, driven in fixed if driven is None]
        names += [f"initial.{name}" for name in network.node_names]
        return cls(groups, tuple(names))

    def heat_groups(self, source: str) -> tuple[str, ...]:
        """Names whose factors multiply the heat of a source."""
        return (f"gain.{source}",)

    def targets(self, parameter: str) -> tuple[str, ...]:
        """The parameter itself, if the network has it.

        Raises
        ------
        SpecError
        """
        if parameter not in self.names:
            raise SpecError(
                parameter, "is no parameter of this network.", did_you_mean(parameter, self.names)
            )
        return (parameter,)

    def factors(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factor of every name that parameters touch."""
        return {target: value for name, value in parameters.items() for target in self.targets(name)}

    def scale(self, coefficient: str, factors: Mapping[str, float]) -> float:
        """Product of the factors on one coefficient."""
        return float(np.prod([factors.get(name, 1.0) for name in self.groups[coefficient]]))


def boundary_of_links(network: ThermalNetwork) -> dict[str, str]:
    """Boundary of every link that joins a node to one, by coefficient."""
    found = {}
    for name, a, b in zip(network.link_names, network.link_first, network.link_second, strict=True):
        ends = [int(end) - network.n_nodes for end in (a, b) if end >= network.n_nodes]
        if len(ends) == 1:
            found[f"{LINK}{name}"] = network.boundary_names[ends[0]]
    return found


def network_thermal_model(network: ThermalNetwork, fluids: tuple[str, ...]) -> ThermalModel:
    """Unit operators of a network; a link between two boundaries moves nothing."""
    n, unit = network.n_nodes, np.eye(network.n_nodes)
    names = tuple(f"{LINK}{name}" for name in network.link_names)
    operators = np.zeros((len(names), n, n))
    for row, ends in enumerate(zip(network.link_first, network.link_second, strict=True)):
        vector = np.zeros(n)
        for end, sign in zip(ends, (1.0, -1.0), strict=True):
            if end < n:
                vector[end] += sign
        operators[row] = np.outer(vector, vector)
    loads = [np.diag(operators[names.index(name)]) for name in fluids]
    storage = np.zeros((n, n, n))
    storage[np.arange(n), np.arange(n), np.arange(n)] = 1.0
    return ThermalModel(
        coefficient_names=names,
        operators=operators,
        fluid_names=fluids,
        fluid_load=np.array(loads).reshape(-1, n),
        storage_names=tuple(f"capacity.{name}" for name in network.node_names),
        storage=storage,
        place_names=network.node_names,
        places=unit,
        probe_names=network.node_names,
        probes=unit,
        one=np.ones(n),
        n_full=n,
    )
