"""A thermal network: named nodes, boundaries, links and sources, linear in the temperatures.

The balance of node i is

    C_i dT_i/dt = Q_i(inputs) + sum_links G (T_other - T_i)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError, UnknownSurfaceError, did_you_mean

Array = NDArray[np.float64]
Inputs = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a network that may be given a prior.

    Attributes
    ----------
    name : str
        ``capacity.<node>``, ``conductance.<link>``, ``gain.<source>``,
        ``temperature.<boundary>`` or ``initial.<node>``.
    kind : str
        The word before the point.
    index : int
        Position among the nodes, links, sources or boundaries.
    value : float
        SI; positive unless fixed.
    sigma_log : float
        One standard deviation of the natural logarithm; 0 means fixed.
    unit : str
        SI unit of ``value``.
    """

    name: str
    kind: str
    index: int
    value: float
    sigma_log: float
    unit: str


@dataclass(frozen=True, slots=True)
class ThermalNetwork:
    """A lumped heat-conducting system.

    Ends of links are positions in ``node_names + boundary_names``.

    Attributes
    ----------
    capacity : (n,) float64 ndarray, [J/K]
    link_first, link_second : (m,) int64 ndarray
    link_conductance : (m,) float64 ndarray, [W/K]
    boundary_temperature : (b,) float64 ndarray, [K]
        NaN where ``boundary_input`` names the input that drives it.
    source_node : (s,) int64 ndarray
    source_input : tuple of str or None
        None: the heat is the gain itself, in W.
    source_gain, source_exponent : (s,) float64 ndarray
        Heat = gain · input^exponent, all in SI (angular speed in rad/s).
    source_gain_unit : tuple of str
        SI base units of each gain, to be checked against the input's.
    parameters : tuple of Parameter
        Values that carry a prior.
    """

    node_names: tuple[str, ...]
    capacity: Array
    link_first: NDArray[np.int64]
    link_second: NDArray[np.int64]
    link_conductance: Array
    boundary_names: tuple[str, ...] = ()
    boundary_temperature: Array = field(default_factory=lambda: np.empty(0))
    boundary_input: tuple[str | None, ...] = ()
    link_names: tuple[str, ...] = ()
    source_node: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    source_input: tuple[str | None, ...] = ()
    source_gain: Array = field(default_factory=lambda: np.empty(0))
    source_exponent: Array = field(default_factory=lambda: np.empty(0))
    source_gain_unit: tuple[str, ...] = ()
    source_names: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()

    def __post_init__(self) -> None:
        converted = {
            "capacity": np.float64,
            "link_first": np.int64,
            "link_second": np.int64,
            "link_conductance": np.float64,
            "boundary_temperature": np.float64,
            "source_node": np.int64,
            "source_gain": np.float64,
            "source_exponent": np.float64,
        }
        for name, kind in converted.items():
            array = np.array(getattr(self, name), dtype=kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        names = self.node_names + self.boundary_names
        if not self.boundary_input:
            object.__setattr__(self, "boundary_input", (None,) * len(self.boundary_names))
        if not self.link_names:
            pairs = zip(self.link_first, self.link_second, strict=True)
            object.__setattr__(self, "link_names", tuple(f"{names[a]}|{names[b]}" for a, b in pairs))
        if not self.source_names:
            pairs = zip(self.source_node, self.source_input, strict=True)
            labels = tuple(f"{self.node_names[n]}.{i or 'constant'}" for n, i in pairs)
            object.__setattr__(self, "source_names", labels)
        require_sound_network(self)

    @property
    def n_nodes(self) -> int:
        """Number of unknown temperatures."""
        return len(self.node_names)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Every input the network needs, once, in order of first use."""
        used = [*self.boundary_input, *self.source_input]
        return tuple(dict.fromkeys(name for name in used if name is not None))

    def conductance_matrix(self) -> Array:
        """Heat out of node i is ``(K T)_i``: (n, n + b) [W/K], columns nodes, then boundaries."""
        total = self.n_nodes + len(self.boundary_names)
        whole = link_matrix(self.link_first, self.link_second, self.link_conductance, total)
        return whole[: self.n_nodes]

    def boundary_values(self, inputs: Inputs) -> Array:
        """Boundary temperatures, ``(b,) [K]``, at given inputs (SI)."""
        values = self.boundary_temperature.copy()
        for position, name in enumerate(self.boundary_input):
            if name is not None:
                values[position] = _input_value(inputs, name)
        return values

    def source_values(self, inputs: Inputs) -> Array:
        """Heat of each source, ``(s,) [W]``, at given inputs (SI)."""
        heat = self.source_gain.copy()
        for position, name in enumerate(self.source_input):
            if name is not None:
                heat[position] *= np.float64(_input_value(inputs, name)) ** self.source_exponent[position]
        return heat

    def node_heat(self, source_heat: Array) -> Array:
        """Sum of source heat over each node, ``(..., n) [W]``, of ``(..., s) [W]``."""
        spread = np.zeros((self.source_node.size, self.n_nodes))
        spread[np.arange(self.source_node.size), self.source_node] = 1.0
        return source_heat @ spread


def link_matrix(first: NDArray[np.int64], second: NDArray[np.int64], conductance: Array, total: int) -> Array:
    """Heat that leaves each of so many places through links is this times their temperatures, W/K.

    >>> link_matrix(np.array([0]), np.array([1]), np.array([2.0]), 2).tolist()
    [[2.0, -2.0], [-2.0, 2.0]]
    """
    rows = np.concatenate([first, second, first, second])
    columns = np.concatenate([first, second, second, first])
    values = np.concatenate([conductance, conductance, -conductance, -conductance])
    return np.bincount(rows * total + columns, values, total * total).reshape(total, total)


def _input_value(inputs: Inputs, name: str) -> float:
    try:
        return float(inputs[name])
    except KeyError as error:
        raise UnknownSurfaceError(
            "inputs", f'the network needs "{name}".', did_you_mean(name, inputs)
        ) from error


def floating_nodes(n_nodes: int, n_total: int, first: Array, second: Array) -> list[int]:
    """Nodes from which no chain of links reaches a boundary.

    >>> floating_nodes(3, 4, [0, 1], [3, 2])
    [1, 2]
    """
    neighbours: dict[int, list[int]] = {}
    for a, b in zip(first, second, strict=True):
        neighbours.setdefault(int(a), []).append(int(b))
        neighbours.setdefault(int(b), []).append(int(a))
    reached = set(range(n_nodes, n_total))
    frontier = list(reached)
    while frontier:
        for other in neighbours.get(frontier.pop(), ()):
            if other not in reached:
                reached.add(other)
                frontier.append(other)
    return [node for node in range(n_nodes) if node not in reached]


def require_sound_network(network: ThermalNetwork) -> None:
    """Refuse a network that has no solution, naming every cause.

    Raises
    ------
    SpecError
        A capacity or conductance that is negative or not finite, a floating
        node, a name used twice, a link to itself.
    """
    faults = []
    names = network.node_names + network.boundary_names
    faults += [f'the name "{name}" is used twice.' for name in dict.fromkeys(names) if names.count(name) > 1]
    for name, value in zip(network.node_names, network.capacity, strict=True):
        if not (np.isfinite(value) and value > 0.0):
            faults.append(f'capacity of node "{name}" is {value:g} J/K, it must be above 0.')
    for name, value in zip(network.link_names, network.link_conductance, strict=True):
        if not (np.isfinite(value) and value >= 0.0):
            faults.append(f'conductance of link "{name}" is {value:g} W/K, it must not be negative.')
    for a in network.link_first[network.link_first == network.link_second]:
        faults.append(f'a link joins "{names[a]}" to itself.')
    floating = floating_nodes(network.n_nodes, len(names), network.link_first, network.link_second)
    faults += [f'node "{names[node]}" floats: no chain of links joins it to a boundary.' for node in floating]
    if faults:
        raise SpecError("network", " ".join(faults))
