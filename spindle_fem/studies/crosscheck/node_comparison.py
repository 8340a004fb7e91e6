"""Compare network and FEM node by node and link by link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.operation.channel_cells import helix_coordinates
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.solvers.coupled_steady import CoupledState
from spindle_fem.solvers.machine_network_steady import MachineNetworkState
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.studies.crosscheck.regions import (
    NodeRegions,
    facet_nodes,
    flux_through_cuts,
    node_temperatures,
)

Array = NDArray[np.float64]
INSIDE_PART = "cut through a part: flux of the field integrated over it"
BOTH = "joint and cut through a part"
JOINT = "joint"


@dataclass(frozen=True, slots=True)
class LinkComparison:
    """Heat along one link, from its first end to its second, W.

    Attributes
    ----------
    link : str
        ``first|second``; for a film, ``node|surface``.
    kind : str
        solid, balls, gap.<name>, coolant, or the name of a film's surface or of a stream.
    network, fem : float, [W]
    surface : str
        What the flux was integrated over.
    """

    link: str
    first: int
    second: int
    kind: str
    network: float
    fem: float
    surface: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """A network state beside a finite-element state of the same machine.

    Attributes
    ----------
    network_temperature, fem_temperature : (n,) ndarray, [K]
    """

    machine: MachineNetwork
    network_temperature: Array
    fem_temperature: Array
    links: tuple[LinkComparison, ...]

    @property
    def difference(self) -> Array:
        """Network less elements, (n,) [K]."""
        return self.network_temperature - self.fem_temperature


def compare(
    prepared: PreparedMachine, coupled: CoupledState, state: MachineNetworkState, regions: NodeRegions
) -> Comparison:
    """Compare both models at the same operating point.

    Parameters
    ----------
    prepared, coupled : PreparedMachine, CoupledState
        The finite elements.
    regions : NodeRegions
        Of the state's network on the prepared mesh.
    """
    machine = state.network.machine
    flows = fem_flows(prepared, coupled, machine)
    names = (*machine.node_names, *state.network.boundary_names)
    bypass = _bypass(state)
    links = []
    for first, second, kind, heat in state.links():
        is_film = second >= machine.n_nodes
        key = (first, kind if is_film else second, kind)
        fem, surface = flows.get(key, (0.0, "none in the mesh"))
        if kind == "balls":
            heat += bypass.get((first, second), 0.0)
        label = f"{names[first]}|{kind if is_film else names[second]}"
        links.append(LinkComparison(label, first, second, kind, heat, fem, surface))
    listed = {(item.first, item.second) for item in links if item.kind == "solid"}
    for (first, second, kind), (fem, surface) in flows.items():
        if kind == "solid" and (first, second) not in listed:
            links.append(
                LinkComparison(f"{names[first]}|{names[second]}", first, second, kind, 0.0, fem, surface)
            )
    links.sort(key=lambda item: (item.kind != "solid", item.first, item.second, item.kind))
    return Comparison(machine, state.temperature, node_temperatures(regions, prepared, coupled), tuple(links))


def _bypass(state: MachineNetworkState) -> dict[tuple[int, int], float]:
    """Friction heat that passes from a raceway directly to the balls, W."""
    found: dict[tuple[int, int], float] = {}
    heat = state.network.friction_heat(state.temperature)
    for name, ball in state.network.machine.ball_nodes.items():
        for way in state.network.raceways[name]:
            for node, share in zip(way.nodes.tolist(), way.bypass.tolist(), strict=True):
                found[node, ball] = found.get((node, ball), 0.0) + share * heat[name]
    return found


def fem_flows(
    prepared: PreparedMachine, coupled: CoupledState, machine: MachineNetwork
) -> dict[tuple[int, int | str, str], tuple[float, str]]:
    """Heat of the finite-element field along every link of a network, W.

    Keys are (first, second node or film surface, kind); all walls of a stream together go by its name.
    """
    temperature = coupled.solution.temperature
    flows: dict[tuple[int, int | str, str], tuple[float, str]] = {}

    def add(first: int, second: int | str, kind: str, heat: float, surface: str) -> None:
        before, seen = flows.get((first, second, kind), (0.0, surface))
        flows[first, second, kind] = (before + heat, surface if seen == surface else BOTH)

    for (first, second), heat in flux_through_cuts(prepared, machine, temperature).items():
        add(first, second, "solid", heat, INSIDE_PART)
    _joint_flows(prepared, machine, temperature, add)
    _surface_flows(prepared, coupled, machine, add)
    return flows


def _joint_flows(prepared, machine, temperature, add) -> None:
    operators, mesh = prepared.operators, prepared.mesh
    for name, (rows_a, rows_b) in operators.joint_rows.items():
        conductance = prepared.joint_conductance[name]
        if not np.isfinite(conductance) or conductance == 0.0:
            continue
        part_a, part_b = name.removesuffix(":face").split("|")
        jump = operators.facet_integral(temperature, rows_a) - operators.facet_integral(temperature, rows_b)
        node_a = facet_nodes(prepared, machine, mesh.joints[name].facets_a, part_a)
        node_b = facet_nodes(prepared, machine, mesh.joints[name].facets_b, part_b)
        for a, b, heat in _summed(node_a, node_b, conductance * jump):
            if a != b:
                first, second, sign = (a, b, 1.0) if a < b else (b, a, -1.0)
                add(first, second, "solid", sign * heat, JOINT)


def _summed(a: NDArray, b: NDArray, values: Array) -> list[tuple[int, int, float]]:
    pairs, inverse = np.unique(np.column_stack([a, b]), axis=0, return_inverse=True)
    total = np.bincount(inverse.ravel(), values, len(pairs))
    return [(int(x), int(y), float(value)) for (x, y), value in zip(pairs, total, strict=True)]


def _surface_flows(prepared, coupled, machine, add) -> None:
    """Films, balls, gap air and coolant, facet by facet."""
    operators, mesh = prepared.operators, prepared.mesh
    temperature = coupled.solution.temperature
    behind = {}

    def nodes_of(surface: str) -> NDArray[np.int64]:
        if surface not in behind:
            part = mesh.part_of_surface[surface]
            behind[surface] = facet_nodes(prepared, machine, mesh.surfaces[surface], part)
        return behind[surface]

    stream_of = {name: film.name for film in machine.spec.circuits for name in film.surface}
    wetted = set(prepared.builder.cells.surfaces) if prepared.builder.cells is not None else set()
    for surface, film in coupled.loads.films.items():
        if surface in machine.spec.wetted_rows:
            node, taker = machine.ball_nodes[surface.removesuffix(".balls")], stream_of[surface]
            add(node, taker, taker, coupled.solution.balance.films[surface], taker)
            continue
        rows = operators.surface_rows[surface]
        heat = film.coefficient * (
            operators.facet_integral(temperature, rows) - film.temperature * operators.facet_area[rows]
        )
        if surface in wetted:
            for a, b, value in _summed(nodes_of(surface), _coolant_nodes(prepared, machine, surface), heat):
                add(a, b, "coolant", value, surface)
        else:
            taker = stream_of.get(surface, surface)
            for node, value in enumerate(np.bincount(nodes_of(surface), heat, machine.n_solid)):
                if value:
                    add(node, taker, taker, float(value), taker)
    lumped = dict(
        zip(coupled.solution.problem.lumped_names, coupled.solution.lumped_temperature, strict=True)
    )
    balls = {
        ball: machine.ball_nodes[name]
        for name in machine.ball_nodes
        for ball in prepared.builder.ball_nodes(name)
    }
    for load in coupled.loads.lumped:
        for surface, coefficient in load.connections.items():
            rows = operators.surface_rows[surface]
            heat = coefficient * (
                operators.facet_integral(temperature, rows) - lumped[load.name] * operators.facet_area[rows]
            )
            if load.name in balls:
                target, kind = np.full(len(heat), balls[load.name]), "balls"
            else:
                gap = load.name.rpartition("[")[0]
                target, kind = _air_nodes(machine, gap, mesh, surface), f"gap.{gap}"
            active = np.asarray(coefficient) > 0.0
            for a, b, value in _summed(nodes_of(surface)[active], target[active], heat[active]):
                add(a, b, kind, value, surface)


def _coolant_nodes(prepared, machine, surface: str) -> NDArray[np.int64]:
    mesh, channel = prepared.mesh, machine.spec.channel
    centres = facet_centres(mesh.points, mesh.surfaces[surface])
    _, angle = helix_coordinates(centres, channel)
    along = channel.z_start + channel.pitch * np.clip(angle, 0.0, 2.0 * np.pi * channel.turns) / (2.0 * np.pi)
    edges = machine.coolant.edges
    return machine.coolant_start + np.clip(np.searchsorted(edges, along) - 1, 0, len(edges) - 2)


def _air_nodes(machine: MachineNetwork, gap: str, mesh, surface: str) -> NDArray[np.int64]:
    start = machine.air_start
    for name, bands in machine.gaps.items():
        if name == gap:
            z = facet_centres(mesh.points, mesh.surfaces[surface])[:, 2]
            return start + np.clip(np.searchsorted(bands.edges, z) - 1, 0, bands.n_bands - 1)
        start += bands.n_bands
    raise KeyError(gap)
