"""Causes of the differences between network and FEM, found by exchanging one assumption at a time.

Between the paper's lumps and the three-dimensional elements lies a chain of models that
differ from their neighbour in one thing only. The differences of neighbours
add up to the whole difference, exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec, RollerBearingType
from spindle_fem.model.lumped.machine_network import MachineNetwork, build_machine_network
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures, HeatModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.coupled_steady import CoupledState, solve_coupled
from spindle_fem.solvers.machine_network_steady import MachineNetworkState, solve_machine_network
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.crosscheck.axisymmetric import solve_axisymmetric
from spindle_fem.studies.crosscheck.gather_fields import gather_axisymmetric, gather_network
from spindle_fem.studies.crosscheck.regions import build_regions, node_temperatures

Array = NDArray[np.float64]
Progress = Callable[[str], None]
REFERENCE_REFINEMENT = 4
# Distances from a narrow raceway, in half widths, at which cells end.
BAND_CELLS = 8
BAND_LINES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)

CAUSES = {
    "few_columns": "few nodes along z: a column is one temperature",
    "few_rows": "few nodes along r: a body is one temperature, heat reaches its middle",
    "smeared_helix": (
        "helix smeared over its pitch: constriction of the heat between the turns and the drop along "
        "the lands"
    ),
    "closed_rings": "closed rings for a helix: ends of the channel, inclination, temperature around the axis",
    "port_region": "no ports: drillings with a film of their own, metal missing there",
}
CHECKS = {
    "perfect_fins": "lands between the turns without a drop along r (fin effect left out)",
    "raceway_bands": "heat and balls on the width of the contact ellipse instead of the ring's whole face",
    "circumferential_averaging": "turning parts without averaging around the axis (elements)",
}


@dataclass(frozen=True, slots=True)
class CauseStudy:
    """Contributions to network less elements, K, at every node.

    Attributes
    ----------
    contribution : mapping of cause to (n_nodes,) ndarray, [K]
        They add up to the difference.
    check : mapping of further exchanged assumption to (n_nodes,) ndarray, [K]
        What each changes by itself; not part of the sum.
    """

    contribution: Mapping[str, Array]
    check: Mapping[str, Array]

    def largest(self, node: int) -> tuple[str, float]:
        """The cause that moves a node most, and by how much in K."""
        name = max(self.contribution, key=lambda key: abs(float(self.contribution[key][node])))
        return name, float(self.contribution[name][node])


def without_ports(spec: MachineSpec) -> MachineSpec:
    """The machine with solid metal in place of its ports."""
    channel = spec.channel
    if channel is None or channel.ports is None:
        return spec
    return spec.model_copy(update={"channel": channel.model_copy(update={"ports": None})})


def study_causes(
    coarse: MachineNetwork,
    state: MachineNetworkState,
    prepared: PreparedMachine,
    coupled: CoupledState,
    fem_temperature: Array,
    heat_model: HeatModel,
    *,
    progress: Progress = lambda stage: None,
) -> CauseStudy:
    """Exchange one assumption after the other between the network and the elements.

    Parameters
    ----------
    coarse, state : MachineNetwork, MachineNetworkState
        The paper's lumps.
    prepared, coupled : PreparedMachine, CoupledState
        The three-dimensional elements, as defined.
    fem_temperature : (n_nodes,) ndarray, [K]
        Their averages over the lumps' regions.
    """
    spec, point = coarse.spec, state.network.point
    refinement = REFERENCE_REFINEMENT

    def refined(**settings: object) -> MachineNetworkState:
        network = build_machine_network(spec, refinement=refinement, assembly=coarse.assembly, **settings)
        return solve_machine_network(network, point, heat_model=heat_model)

    progress("network refined along z")
    chain = [state.temperature, gather_network(coarse, refined(lumped_along_r=True))]
    names = ["few_columns", "few_rows"]
    progress("axisymmetric elements, helix smeared")
    smeared = refined()
    chain.append(gather_axisymmetric(coarse, smeared.network.machine, solve_axisymmetric(smeared)))
    if spec.channel is not None:
        progress("axisymmetric elements, closed rings")
        rings = refined(channelling="rings")
        closed = gather_axisymmetric(coarse, rings.network.machine, solve_axisymmetric(rings))
        # lands that a closed ring takes away keep the smeared value: their whole step is the next one's
        chain.append(np.where(np.isnan(closed), chain[-1], closed))
        names += ["smeared_helix", "closed_rings"]
        if spec.channel.ports is not None:
            progress("elements without ports")
            bare = without_ports(spec)
            chain.append(_elements_of(bare, coarse, point))
            names.append("port_region")
    else:
        names.append("closed_rings")
    chain.append(fem_temperature)
    contribution = {name: chain[i] - chain[i + 1] for i, name in enumerate(names)}
    check = _checks(coarse, smeared, heat_model)
    if spec.mesh.circumferential_averaging:
        progress("elements without averaging around the axis")
        mesh = spec.mesh.model_copy(update={"circumferential_averaging": False})
        plain = _elements_of(spec.model_copy(update={"mesh": mesh}), coarse, point)
        check["circumferential_averaging"] = fem_temperature - plain
    return CauseStudy(contribution, check)


def _elements_of(spec: MachineSpec, coarse: MachineNetwork, point: OperatingPoint) -> Array:
    prepared = prepare_machine(spec)
    coupled = solve_coupled(prepared, point)
    return node_temperatures(build_regions(prepared, coarse), prepared, coupled)


def _checks(coarse: MachineNetwork, smeared: MachineNetworkState, heat_model: HeatModel) -> dict[str, Array]:
    """Assumptions that both models make or that lie inside the chain's steps."""
    machine, point = smeared.network.machine, smeared.network.point
    base = gather_network(coarse, smeared)
    found = {}
    if machine.coolant is not None:
        perfect = _with_perfect_lands(machine)
        state = solve_machine_network(perfect, point, heat_model=heat_model)
        found["perfect_fins"] = gather_network(coarse, state) - base
    if machine.spec.bearing_set and machine.spec.knows_lubricants:
        found["raceway_bands"] = _narrow_raceways(coarse, smeared, heat_model)
    return found


def _narrow_raceways(coarse: MachineNetwork, smeared: MachineNetworkState, heat_model: HeatModel) -> Array:
    """Raceways as narrow as their contact ellipses, less raceways as wide as the rings, on one grid."""
    machine, point = smeared.network.machine, smeared.network.point
    spec = machine.spec
    bands = contact_bands(spec, point, smeared.bearing_temperatures())
    along_z, along_r = [], []
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        for side, face, inwards in (
            ("inner", 0.5 * kind.inner_ring_outer_diameter, -1.0),
            ("outer", 0.5 * kind.outer_ring_inner_diameter, 1.0),
        ):
            low, high = bands[f"{bearing.name}.{side}_raceway"]
            own_z, depth = band_lines(low, high)
            along_z += own_z.tolist()
            along_r += (face + inwards * depth).tolist()
    lines = (tuple(along_z), tuple(along_r))

    def solved(narrow: Mapping[str, tuple[float, float]]) -> Array:
        network = build_machine_network(
            spec, refinement=machine.refinement, assembly=coarse.assembly, lines=lines, bands=narrow
        )
        return gather_network(coarse, solve_machine_network(network, point, heat_model=heat_model))

    return solved(bands) - solved({})


def band_lines(low: float, high: float) -> tuple[Array, Array]:
    """Lines that resolve the heat spreading from a band (m): along z, and as depths below it."""
    half = 0.5 * (high - low)
    spread = half * np.array(BAND_LINES)
    within = np.linspace(low, high, BAND_CELLS + 1)
    return np.concatenate([low - spread, within, high + spread]), spread


def contact_bands(
    spec: MachineSpec, point: OperatingPoint, temperatures: Mapping[str, BearingTemperatures]
) -> dict[str, tuple[float, float]]:
    """Mean contact of balls or rollers on each raceway: start and end along z, m."""
    states = BearingMechanics(spec).states(point, temperatures, expand=False)
    bands = {}
    for group, bearing in spec.bearings:
        state = states[bearing.name]
        kind = spec.bearing_types[group.type_name(bearing)]
        middle = 0.5 * (bearing.z[0] + bearing.z[1])
        if isinstance(kind, RollerBearingType):
            half = 0.5 * kind.rows * kind.roller_length
            for side in ("inner", "outer"):
                bands[f"{bearing.name}.{side}_raceway"] = (middle - half, middle + half)
            continue
        towards = 1.0 if bearing.takes_thrust == "towards_rear" else -1.0
        radius = 0.5 * kind.ball_diameter
        for index, side in enumerate(("inner", "outer")):
            # the inner ring pushes the balls along the thrust, the outer one holds them
            sign = towards * (-1.0 if side == "inner" else 1.0)
            angle = state.mean("contact_angle", index)
            place = middle + sign * radius * np.sin(angle)
            half = state.mean("semi_major", index) * np.cos(angle)
            bands[f"{bearing.name}.{side}_raceway"] = (float(place - half), float(place + half))
    return bands


def _with_perfect_lands(machine: MachineNetwork) -> MachineNetwork:
    """The network with lands that conduct along r a thousand times better."""
    zone = machine.cells.side_area > 0.0
    node = machine.partition.node_of_cell
    in_zone = np.zeros(machine.n_solid, dtype=bool)
    in_zone[node[zone]] = True
    both = in_zone[machine.links.first] & in_zone[machine.links.second]
    links = replace(machine.links, conductance=np.where(both, 1.0e3, 1.0) * machine.links.conductance)
    return replace(machine, links=links)
