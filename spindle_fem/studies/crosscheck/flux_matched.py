"""A reduced network whose conductances come from the finite elements by flux matching.

Its nodes are those of the machine's network; the coolant becomes a boundary at
inlet temperature. Each conductance is a constant factor times what the network
computes from geometry and films, so that films which follow the speed still
do. The factors are those with which the elements' node temperatures balance
exactly at the matched state and in the least-squares sense at further ones,
while staying as near as that allows to the elements' flux through each link.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from spindle_fem.model.lumped.heat_laws import CircuitLaw, CoolantLaw, WallFilmLaw
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.lumped.operating_state import operate
from spindle_fem.model.lumped.thermal_network import link_matrix
from spindle_fem.operation.bearing_heat import BearingTemperatures, HeatModel
from spindle_fem.operation.coefficients import fluid_temperature
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.solvers.coupled_steady import CoupledState
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.studies.crosscheck.node_comparison import fem_flows
from spindle_fem.studies.crosscheck.regions import NodeRegions, node_temperatures

Array = NDArray[np.float64]
FACTOR_RANGE = (0.02, 50.0)
# Least-squares weights: a watt of imbalance at the matched state, at the others, and a
# doubled conductance against the flux-matched one.
MATCHED_WEIGHT, OTHER_WEIGHT, PRIOR_WEIGHT = 1.0e4, 3.0, 1.0e-1
TRUSTED_DIFFERENCE = 0.3
TRUSTED_RATIO = (0.2, 5.0)
# Of the largest conductance of a stream's walls; walls that it joins by less are not linked.
SMALLEST_SHARE = 1.0e-3
RELIEF_ROUNDS = 4
RELIEF_RESIDUAL = 1.0e-3


@dataclass(frozen=True, slots=True)
class ElementState:
    """A finite-element state on the nodes of a network.

    Attributes
    ----------
    temperature : (n,) ndarray, [K]
        Of every network node; coolant entries are not used.
    heat : mapping of bearing, and of source, to float, [W]
    around : mapping of bearing to BearingTemperatures
    flows : mapping
        As :func:`fem_flows` gives them.
    coolant_outlet : float, [K]
    """

    point: OperatingPoint
    temperature: Array
    heat: Mapping[str, float]
    around: Mapping[str, BearingTemperatures]
    flows: Mapping
    coolant_outlet: float


@dataclass(frozen=True, slots=True)
class MatchedNetwork:
    """The reduced network.

    Attributes
    ----------
    node_names : tuple of str
        Of the machine's network without its coolant.
    boundary_names : tuple of str
        ``ambient``, fluids of films with a temperature of their own and of
        streams at their inlets, ``coolant_inlet``.
    first, second : (m,) int64 ndarray
        Ends; boundaries follow nodes.
    factor : (m,) ndarray, [-]
        On the network's own conductance.
    base : (m,) ndarray, [W/K]
        That conductance at the matched state.
    spread : (n, n_heated) ndarray, [-]
        Where the heat of each bearing, then of each source, goes.
    coolant_rate : float, [W/K]
        Mass flow times heat capacity; 0 without coolant.
    """

    machine: MachineNetwork
    node_names: tuple[str, ...]
    boundary_names: tuple[str, ...]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    factor: Array
    base: Array
    spread: Array
    matched: ElementState
    coolant_rate: float

    @property
    def n_nodes(self) -> int:
        """Number of unknown temperatures."""
        return len(self.node_names)

    @property
    def capacity(self) -> Array:
        """Heat capacity of every node, (n,) [J/K]."""
        return self.machine.capacity[: self.n_nodes]

    @property
    def heated_by(self) -> tuple[str, ...]:
        """Bearings and sources in the order of ``spread``."""
        return _heated_by(self.machine)

    def boundary_temperature(self, point: OperatingPoint) -> Array:
        """Temperature of every boundary at an operating point, (b,) [K]."""
        return _boundary_values(self.machine, self.boundary_names, point)

    def conductance(self, point: OperatingPoint, heat_model: HeatModel) -> Array:
        """Conductance of every link at an operating point, (m,) [W/K]; films follow the speed."""
        around = self.matched.around
        pairs = base_conductances(self.machine, point, heat_model, around, self.matched.temperature)
        both = zip(self.first.tolist(), self.second.tolist(), strict=True)
        value = np.array([pairs.get(pair, np.nan) for pair in both])
        # a link that only the elements have (through the lands) is the same at every speed
        return self.factor * np.where(np.isnan(value), self.base, value)

    def steady(
        self, point: OperatingPoint, heat: Mapping[str, float], conductance: Array | None = None
    ) -> Array:
        """Node temperatures for given heat of bearings and sources [W], (n,) [K]."""
        matrix, to_boundary = self.matrices(self.factor * self.base if conductance is None else conductance)
        power = self.spread @ np.array([heat[name] for name in self.heated_by])
        return np.linalg.solve(matrix, power + to_boundary @ self.boundary_temperature(point))

    def matrices(self, conductance: Array) -> tuple[Array, Array]:
        """``K (n, n)`` and ``K_b (n, b)`` in W/K: ``C dT/dt = q - K T + K_b T_b``."""
        n = self.n_nodes
        matrix = link_matrix(self.first, self.second, conductance, n + len(self.boundary_names))
        return matrix[:n, :n], -matrix[:n, n:]


def element_state(
    prepared: PreparedMachine, coupled: CoupledState, point: OperatingPoint, regions: NodeRegions
) -> ElementState:
    """A solved finite-element state on the nodes of a network."""
    solution = coupled.solution
    lumped = dict(zip(solution.problem.lumped_names, solution.lumped_temperature.tolist(), strict=True))
    around = prepared.builder.bearing_temperatures(prepared.field_state(solution.temperature, lumped))
    march = coupled.coolant
    return ElementState(
        point=point,
        temperature=node_temperatures(regions, prepared, coupled),
        heat={name: heat.total for name, heat in coupled.loads.bearing_heat.items()}
        | {source.name: float(source_heat(source, point.inputs)) for source in prepared.spec.source},
        around=around,
        flows=fem_flows(prepared, coupled, regions.machine),
        coolant_outlet=float("nan") if march is None else march.march.march.mixed_outlet_temperature,
    )


def _heated_by(machine: MachineNetwork) -> tuple[str, ...]:
    return (*machine.ball_nodes, *(source.name for source in machine.spec.source))


def _boundary_values(machine: MachineNetwork, names: Sequence[str], point: OperatingPoint) -> Array:
    known = {"ambient": point.ambient_temperature, "coolant_inlet": point.coolant_inlet_temperature}
    known |= {
        f"{film.name}.fluid": film.temperature for film in machine.spec.film if film.temperature != "ambient"
    }
    return np.array([known[name] for name in names])


def _boundary_names(machine: MachineNetwork) -> tuple[str, ...]:
    names = ["ambient"]
    names += [f"{film.name}.fluid" for film in machine.spec.film if film.temperature != "ambient"]
    if machine.coolant is not None:
        names.append("coolant_inlet")
    return tuple(names)


def base_conductances(
    machine: MachineNetwork,
    point: OperatingPoint,
    heat_model: HeatModel,
    around: Mapping[str, BearingTemperatures],
    temperature: Array,
) -> dict[tuple[int, int], float]:
    """Conductance between nodes, and nodes and boundaries, as the network has it, W/K.

    Coolant cells count as the boundary ``coolant_inlet``, a stream as its inlet and links between its
    walls; films that follow the wall are taken at the given temperatures.
    """
    network = operate(machine, point, heat_model, around=around)
    n = machine.coolant_start
    boundaries = _boundary_names(machine)
    place = {name: n + i for i, name in enumerate(boundaries)}
    outside = {machine.n_nodes + i: place[name] for i, name in enumerate(network.boundary_names)}
    inlet = place.get("coolant_inlet", -1)
    found: dict[tuple[int, int], float] = {}

    def add(first: int, second: int, value: float) -> None:
        if second >= machine.n_nodes:
            second = outside[second]
        elif second >= n:
            second = inlet
        found[first, second] = found.get((first, second), 0.0) + value

    for a, b, g in zip(
        network.first.tolist(), network.second.tolist(), network.conductance.tolist(), strict=True
    ):
        add(a, b, g)
    full = np.concatenate(
        [temperature, np.full(machine.n_nodes - len(temperature), point.coolant_inlet_temperature)]
    )
    for law in network.laws:
        if isinstance(law, WallFilmLaw):
            fluid = _film_fluid(machine, law.name, point)
            heat = law.heat(full)[0]
            excess = full[law.patch.node] - fluid
            for node in np.unique(law.patch.node):
                own = law.patch.node == node
                if abs(excess[own][0]) > 1.0e-6:
                    found_key = (int(node), place[_film_boundary(machine, law.name)])
                    found[found_key] = found.get(found_key, 0.0) + float(heat[own].sum() / excess[own][0])
        elif isinstance(law, CoolantLaw):
            value = law.conductances(law.coefficients(full)[0])[0]
            for node, g in zip(law.patch.node.tolist(), value.tolist(), strict=True):
                add(node, int(law.nodes[0]), g)
        elif isinstance(law, CircuitLaw):
            to_inlet, between = _stream_conductances(law)
            for node, g in to_inlet.items():
                key = (node, place[_film_boundary(machine, law.name)])
                found[key] = found.get(key, 0.0) + g
            for pair, g in between.items():
                add(*pair, g)
    return found


def _stream_conductances(law: CircuitLaw) -> tuple[dict[int, float], dict[tuple[int, int], float]]:
    """What a stream amounts to between its walls and its inlet, and between walls past it, W/K.

    What warms a wall downstream does not cool the one upstream; a link does both, with half of it.
    """
    nodes, number = np.unique(law.patch.node, return_inverse=True)
    passed = np.zeros((len(nodes), len(nodes)))
    np.add.at(passed, (number[:, None], number[None, :]), law.conductance[:, None] * law.warming)
    own = np.bincount(number, law.conductance)
    to_inlet = dict(zip(nodes.tolist(), (own - passed.sum(axis=1)).tolist(), strict=True))
    mean = 0.5 * (passed + passed.T)
    pairs = np.argwhere(np.triu(mean > SMALLEST_SHARE * own.max(), 1))
    return to_inlet, {(int(nodes[a]), int(nodes[b])): float(mean[a, b]) for a, b in pairs}


def _film_of(machine: MachineNetwork, name: str):
    """The film of a surface, or the stream of that name."""
    streams = {film.name: film for film in machine.spec.circuits}
    return streams.get(name) or next(film for film in machine.spec.film if name in film.surface)


def _film_boundary(machine: MachineNetwork, name: str) -> str:
    film = _film_of(machine, name)
    return "ambient" if film.temperature == "ambient" else f"{film.name}.fluid"


def _film_fluid(machine: MachineNetwork, surface: str, point: OperatingPoint) -> float:
    film = _film_of(machine, surface)
    return fluid_temperature(film, point.ambient_temperature)


def _element_fluxes(machine: MachineNetwork, state: ElementState) -> dict[tuple[int, int], float]:
    """Heat between nodes, and nodes and boundaries, as the elements have it, W."""
    n = machine.coolant_start
    place = {name: n + i for i, name in enumerate(_boundary_names(machine))}
    found: dict[tuple[int, int], float] = {}
    for (first, second, kind), (heat, _) in state.flows.items():
        if isinstance(second, str):
            end = place[_film_boundary(machine, second)]
        elif kind == "coolant":
            end = place["coolant_inlet"]
        else:
            end = second
        found[first, end] = found.get((first, end), 0.0) + heat
    return found


def match_fluxes(
    machine: MachineNetwork,
    states: Sequence[ElementState],
    heat_model: HeatModel,
) -> MatchedNetwork:
    """Reduced network from finite-element states; the first is matched exactly.

    Parameters
    ----------
    machine : MachineNetwork
        Unrefined.
    states : sequence of ElementState
        The matched one first; further ones (other speeds) are met in the
        least-squares sense.
    heat_model : HeatModel
        For the conductance of the balls.
    """
    matched = states[0]
    n, boundaries = machine.coolant_start, _boundary_names(machine)
    network = operate(machine, matched.point, heat_model, around=matched.around)
    spread = _heat_spread(machine, network)
    base = [
        base_conductances(machine, s.point, heat_model, matched.around, matched.temperature) for s in states
    ]
    flux = _element_fluxes(machine, matched)
    bases = [dict(item) for item in base]
    for pair in flux:
        if pair not in bases[0] and _conducts(pair, flux, matched, boundaries, machine):
            for item in bases:
                item[pair] = _ratio(pair, flux, matched, boundaries, machine)
    both = [
        np.concatenate([s.temperature[:n], _boundary_values(machine, boundaries, s.point)]) for s in states
    ]
    heats = [spread @ np.array([state.heat[name] for name in _heated_by(machine)]) for state in states]
    bypass = _bypass(machine, network, matched)
    for _ in range(RELIEF_ROUNDS):
        pairs = sorted(bases[0])
        first, second = np.array(pairs, dtype=np.int64).T
        prior = _prior(pairs, bases[0], flux, bypass, both[0])
        factor, residual = _fit(pairs, bases, both, heats, prior, n)
        needy = np.flatnonzero(np.abs(residual) > RELIEF_RESIDUAL)
        extra = _second_neighbours(needy, residual, bases[0], both[0], n)
        if not extra:
            break
        for pair, value in extra.items():
            for item in bases:
                item[pair] = value
    own = np.array([bases[0][pair] for pair in pairs])
    rate = network.stream_rate
    return MatchedNetwork(
        machine, machine.node_names[:n], boundaries, first, second, factor, own, spread, matched, rate
    )


def _prior(pairs, base, flux, bypass, temperature: Array) -> Array:
    """Factor that gives each link the elements' flux, where that is well defined; else 1."""
    prior = np.ones(len(pairs))
    for i, (first, second) in enumerate(pairs):
        difference = float(temperature[first] - temperature[second])
        if abs(difference) < TRUSTED_DIFFERENCE or (first, second) not in flux:
            continue
        ratio = (flux[first, second] - bypass.get((first, second), 0.0)) / difference / base[first, second]
        if TRUSTED_RATIO[0] < ratio < TRUSTED_RATIO[1]:
            prior[i] = ratio
    return prior


def _fit(pairs, bases, temperatures, heats, prior: Array, n: int) -> tuple[Array, Array]:
    """Factors, and what the balance of every node at the matched state lacks, W."""
    first, second = np.array(pairs, dtype=np.int64).T
    inside = second < n
    blocks, targets = [PRIOR_WEIGHT * np.diag(1.0 / prior)], [np.full(len(pairs), PRIOR_WEIGHT)]
    matched = None
    for position, (base, values, heat) in enumerate(zip(bases, temperatures, heats, strict=True)):
        flow = np.array([base[pair] for pair in pairs]) * (values[first] - values[second])
        rows = np.zeros((n, len(pairs)))
        rows[first, np.arange(len(pairs))] += flow
        rows[second[inside], np.flatnonzero(inside)] -= flow[inside]
        weight = MATCHED_WEIGHT if position == 0 else OTHER_WEIGHT
        matched = rows if position == 0 else matched
        blocks.append(weight * rows)
        targets.append(weight * heat)
    solved = lsq_linear(
        np.concatenate(blocks), np.concatenate(targets), bounds=FACTOR_RANGE, tol=1e-14, method="bvls"
    )
    return solved.x, heats[0] - matched @ solved.x


def _second_neighbours(
    needy, residual: Array, base, temperature: Array, n: int
) -> dict[tuple[int, int], float]:
    """Links past a neighbour for nodes that no positive conductances can balance.

    A volume mean may lie above (below) those of all neighbours although heat
    passes through; what is beyond them is then what feeds it.
    """
    around: dict[int, dict[int, float]] = {}
    for (first, second), value in base.items():
        around.setdefault(first, {})[second] = value
        around.setdefault(second, {})[first] = value
    extra = {}
    for node in needy.tolist():
        # what lacks heat to lose must gain from something hotter
        wanted = -np.sign(residual[node])
        for neighbour, one in around[node].items():
            if neighbour >= n:
                continue
            for beyond, other in around[neighbour].items():
                pair = (min(node, beyond), max(node, beyond))
                fits = wanted * (temperature[beyond] - temperature[node]) > 0.0
                if beyond != node and pair not in base and fits and pair[0] < n:
                    extra[pair] = max(extra.get(pair, 0.0), one * other / (one + other))
    return extra


def _ratio(pair, flux, state: ElementState, boundaries, machine: MachineNetwork) -> float:
    first, second = pair
    n = machine.coolant_start
    values = np.concatenate([state.temperature[:n], _boundary_values(machine, boundaries, state.point)])
    return flux[pair] / float(values[first] - values[second])


def _conducts(pair, flux, state: ElementState, boundaries, machine: MachineNetwork) -> bool:
    """Whether a link that only the elements have carries heat down its temperature difference."""
    first, second = pair
    n = machine.coolant_start
    if second >= n:
        other = float(_boundary_values(machine, boundaries, state.point)[second - n])
    else:
        other = float(state.temperature[second])
    difference = float(state.temperature[first]) - other
    return abs(difference) > TRUSTED_DIFFERENCE and flux[pair] / difference > 0.0 and abs(flux[pair]) > 1.0e-3


def _heat_spread(machine: MachineNetwork, network) -> Array:
    """Share of the heat of each bearing, then of each source, that enters each node, (n, n_heated)."""
    n, sources = machine.coolant_start, machine.spec.source
    spread = np.zeros((n, len(machine.ball_nodes) + len(sources)))
    for column, (name, ball) in enumerate(machine.ball_nodes.items()):
        shares = network.heat_to[name]
        spread[ball, column] += shares["balls"]
        for side, way in zip(("inner", "outer"), network.raceways[name], strict=True):
            patch = machine.raceway(name, side)
            area = np.bincount(patch.node, patch.area)[way.nodes]
            spread[way.nodes, column] += shares[side] * area / area.sum() - way.bypass
            spread[ball, column] += float(way.bypass.sum())
    for column, source in enumerate(sources, len(machine.ball_nodes)):
        spread[:, column] = machine.spread(source.place)[:n]
    return spread


def _bypass(machine: MachineNetwork, network, state: ElementState) -> dict[tuple[int, int], float]:
    """Heat of links that goes beside the flux the elements have there, W.

    What the network sends past a ball link, straight from raceway to balls; what passes between a
    stream's walls, which the elements have as heat to and from the stream.
    """
    given: dict[tuple[int, int], float] = {}
    for name, ball in machine.ball_nodes.items():
        for way in network.raceways[name]:
            for node, share in zip(way.nodes.tolist(), way.bypass.tolist(), strict=True):
                given[node, ball] = given.get((node, ball), 0.0) + share * state.heat[name]
    boundaries = _boundary_names(machine)
    for law in network.laws:
        if isinstance(law, CircuitLaw):
            fluid = machine.coolant_start + boundaries.index(_film_boundary(machine, law.name))
            for (a, b), g in _stream_conductances(law)[1].items():
                heat = g * float(state.temperature[a] - state.temperature[b])
                for key, part in (((a, fluid), heat), ((b, fluid), -heat), ((a, b), -heat)):
                    given[key] = given.get(key, 0.0) + part
    return given
