"""Axisymmetric finite elements of a machine without helix: what a refined network converges to.

Second-order quadrilaterals in the meridian plane, parts with nodes of their
own, joints as films between coincident edges. The channel is smeared or drawn
as rings, as in the network; films, heat and coolant are those of a network
state, so the two differ by discretisation only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementQuad2, FacetBasis, LinearForm, MeshQuad

from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.errors import ConvergenceError
from spindle_fem.model.lumped.cells import Faces, MeridianCells
from spindle_fem.model.lumped.heat_laws import CoolantLaw
from spindle_fem.model.lumped.machine_network import MachineNetwork, cells_of
from spindle_fem.operation.circuits import CircuitMarch, wall_cells
from spindle_fem.operation.coefficients import (
    ball_conductances,
    film_coefficient,
    fluid_temperature,
    gap_coefficient,
    joint_conductances,
    stream_coefficients,
)
from spindle_fem.physics.coolant.linear_march import outlet_stretch
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.solvers.machine_network_steady import MachineNetworkState

Array = NDArray[np.float64]
FULL_TURN = 2.0 * np.pi
# W; a machine without heat is measured by this.
AT_REST = 1.0


@BilinearForm
def _conduction(u, v, w):
    return FULL_TURN * w.x[1] * (w.k_axial * u.grad[0] * v.grad[0] + w.k_radial * u.grad[1] * v.grad[1])


@BilinearForm
def _exchange(u, v, w):
    return FULL_TURN * w.x[1] * w.h * u * v


@LinearForm
def _supply(v, w):
    return FULL_TURN * w.x[1] * w.q * v


@dataclass(frozen=True, slots=True)
class AxisymmetricState:
    """A solved meridian plane.

    Attributes
    ----------
    cells : MeridianCells
        One element each.
    mean : (n_cells,) ndarray, [K]
        Volume mean of each element.
    balls, air, coolant : (n,) ndarray, [K]
        In the order of the network's nodes; coolant at the end of each cell.
    residual_relative : float
        Heat in less heat out over heat in (over 1 W where there is less).
    """

    cells: MeridianCells
    mean: Array
    balls: Array
    air: Array
    coolant: Array
    residual_relative: float
    n_unknowns: int


class _Assembly:
    """Element mesh and running sums of matrix and load."""

    def __init__(self, machine: MachineNetwork) -> None:
        self.machine, self.cells = machine, machine.cells
        cells = self.cells
        i, j = cells.grid_index.T
        width = len(cells.r_lines)
        corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        keys = np.stack([cells.part * 10**9 + a * width + b for a, b in corners])
        unique, inverse = np.unique(keys, return_inverse=True)
        position = unique % 10**9
        points = np.array([cells.z_lines[position // width], cells.r_lines[position % width]])
        self.mesh = MeshQuad(points, inverse.reshape(keys.shape))
        self.element = ElementQuad2()
        self.basis = Basis(self.mesh, self.element, intorder=5)
        self.n_field = self.basis.N
        self.n = self.n_field + machine.n_nodes - machine.n_solid
        self.rows: list[NDArray] = []
        self.columns: list[NDArray] = []
        self.values: list[Array] = []
        self.load = np.zeros(self.n)
        self._facet_of = self._find_facets()

    def _find_facets(self) -> NDArray[np.int64]:
        """Edge of each element by whether it is radial and on the low side, (n_cells, 2, 2)."""
        edges, cells = self.mesh.t2f, self.cells
        z, r = self.mesh.p[:, self.mesh.facets].mean(axis=1)[:, edges]
        radial = np.isclose(z, cells.z.mean(axis=1), atol=1e-12)
        low = np.where(radial, r < cells.r.mean(axis=1), z < cells.z.mean(axis=1))
        found = np.empty((edges.shape[1], 2, 2), dtype=np.int64)
        found[np.arange(edges.shape[1]), radial.astype(int), low.astype(int)] = edges
        return found

    def facets(self, faces: Faces, cell: NDArray[np.int64]) -> NDArray[np.int64]:
        """Mesh edges of faces as seen from one side's cells."""
        return self._facet_of[cell, faces.radial.astype(int), (cell == faces.second).astype(int)]

    def edge_basis(self, facets: NDArray[np.int64]) -> FacetBasis:
        return FacetBasis(self.mesh, self.element, facets=facets, intorder=5)

    def add(self, matrix: sparse.spmatrix, row: int = 0, column: int = 0) -> None:
        entries = sparse.coo_array(matrix)
        self.rows.append(entries.row + row)
        self.columns.append(entries.col + column)
        self.values.append(entries.data)

    def tie(self, basis, coefficient: Array, lump: int) -> None:
        """Exchange of an edge (or area) with a lumped unknown."""
        local = np.broadcast_to(coefficient[:, None], basis.dx.shape)
        self.add(_exchange.assemble(basis, h=local))
        load = _supply.assemble(basis, q=local)
        at = np.flatnonzero(load)
        self.rows += [at, np.full(len(at), lump), [lump]]
        self.columns += [np.full(len(at), lump), at, [lump]]
        self.values += [-load[at], -load[at], [load.sum()]]

    def entry(self, row: int, column: int, value: float) -> None:
        self.rows.append([row])
        self.columns.append([column])
        self.values.append([value])


def solve_axisymmetric(state: MachineNetworkState) -> AxisymmetricState:
    """Second-order elements on the cells of a refined network, with its films, heat and coolant.

    Parameters
    ----------
    state : MachineNetworkState
        Of a refined network (every cell a node).

    Raises
    ------
    ConvergenceError
        The heat balance does not close to 1e-8.
    """
    network, machine = state.network, state.network.machine
    system = _Assembly(machine)
    cells = system.cells
    k = machine.conductivity[cells.part]
    shape = system.basis.dx.shape
    system.add(
        _conduction.assemble(
            system.basis,
            k_radial=np.broadcast_to((k * cells.solid_radial)[:, None], shape),
            k_axial=np.broadcast_to((k * cells.solid_axial)[:, None], shape),
        )
    )
    _joints(system, machine)
    heat = _balls(system, state) + _sources(system, state)
    lost = _films(system, state)
    _gaps(system, state)
    _coolant(system, state)
    matrix = sparse.csc_array(
        (
            np.concatenate([np.asarray(v, dtype=float) for v in system.values]),
            (
                np.concatenate([np.asarray(r, dtype=np.int64) for r in system.rows]),
                np.concatenate([np.asarray(c, dtype=np.int64) for c in system.columns]),
            ),
        ),
        shape=(system.n, system.n),
    )
    solution = splu(matrix).solve(system.load)
    field = solution[: system.n_field]
    out = sum(float(vector @ (solution[: len(vector)] - ambient)) for vector, ambient in lost)
    coolant = solution[machine.coolant_start - machine.n_solid + system.n_field :]
    if machine.coolant is not None:
        out += network.stream_rate * (float(coolant[-1]) - network.point.coolant_inlet_temperature)
    residual = (heat - out) / max(heat, AT_REST)
    if abs(residual) > 1.0e-8:
        raise ConvergenceError("axisymmetric elements", f"heat in and out differ by {residual:.1e}.")
    weight = system.basis.dx * FULL_TURN * system.basis.global_coordinates()[1]
    mean = (system.basis.interpolate(field) * weight).sum(axis=1) / weight.sum(axis=1)
    lumps = solution[system.n_field :]
    n_balls, n_air = machine.air_start - machine.n_solid, machine.coolant_start - machine.n_solid
    return AxisymmetricState(
        cells, np.asarray(mean), lumps[:n_balls], lumps[n_balls:n_air], coolant, residual, system.n
    )


def _joints(system: _Assembly, machine: MachineNetwork) -> None:
    contact = system.cells.contact
    value = joint_conductances(machine.spec, machine.assembly.joint_names)
    h = np.array([value[name] for name in contact.name], dtype=float)
    # a perfect contact is a very good one: 1e9 W/(m²K) leaves 1e-5 K at 10 kW/m²
    h = np.where(np.isinf(h), 1.0e9, h)
    one = system.edge_basis(system.facets(contact, contact.first))
    other = system.edge_basis(system.facets(contact, contact.second))
    local = np.broadcast_to(h[:, None], one.dx.shape)
    system.add(_exchange.assemble(one, h=local))
    system.add(_exchange.assemble(other, h=local))
    cross = -_exchange.assemble(one, other, h=local)
    system.add(cross)
    system.add(cross.T)


def _surface(system: _Assembly, name: str) -> FacetBasis:
    exposed = system.cells.exposed
    faces = exposed.pick(exposed.name == name)
    return system.edge_basis(system.facets(faces, faces.inside))


def _balls(system: _Assembly, state: MachineNetworkState) -> float:
    network, machine = state.network, state.network.machine
    heat = network.friction_heat(state.temperature)
    for group, bearing in machine.spec.bearings:
        lump = system.n_field + machine.ball_nodes[bearing.name] - machine.n_solid
        given = network.bearing_heat[bearing.name]
        for side, conductance in zip(("inner", "outer"), ball_conductances(group, given), strict=True):
            surface = f"{bearing.name}.{side}_raceway"
            area = float(machine.surfaces[surface].area.sum())
            basis = _surface(system, surface)
            n = basis.dx.shape[0]
            system.tie(basis, np.full(n, conductance / area), lump)
            flux = network.heat_to[bearing.name][side] * heat[bearing.name] / area
            system.load[: system.n_field] += _supply.assemble(basis, q=np.full(basis.dx.shape, flux))
        system.load[lump] += network.heat_to[bearing.name]["balls"] * heat[bearing.name]
    return float(sum(heat.values())) + float(_coolant_heat(state).sum())


def _sources(system: _Assembly, state: MachineNetworkState) -> float:
    """Heat sources of the definition, even over the volume or surface that each one heats."""
    network, machine = state.network, state.network.machine
    total = 0.0
    for source in machine.spec.source:
        heat = float(source_heat(source, network.point.inputs))
        if source.place in machine.surfaces:
            basis = _surface(system, source.place)
        else:
            cells = cells_of(machine.spec, machine.cells, source.place)
            basis = Basis(system.mesh, system.element, elements=cells, intorder=5)
        load = _supply.assemble(basis, q=np.ones(basis.dx.shape))
        system.load[: system.n_field] += heat * load / load.sum()
        total += heat
    return total


def _coolant_heat(state: MachineNetworkState) -> Array:
    return state.network.heat[state.network.machine.coolant_start :]


def _films(system: _Assembly, state: MachineNetworkState) -> list[tuple[Array, float]]:
    """Films at the coefficients that the network's wall temperatures give."""
    network = state.network
    lost = []
    for film in network.machine.spec.film:
        if isinstance(film, StreamFilm):
            lost.append(_stream(system, state, film))
            continue
        fluid = fluid_temperature(film, network.point.ambient_temperature)
        for surface in film.surface:
            wall = state.temperature[network.machine.surfaces[surface].node]
            value, _ = film_coefficient(film, network.point, wall, fluid)
            basis = _surface(system, surface)
            local = np.broadcast_to(value[:, None], basis.dx.shape)
            system.add(_exchange.assemble(basis, h=local))
            vector = _supply.assemble(basis, q=local)
            system.load[: system.n_field] += fluid * vector
            lost.append((vector, fluid))
    return lost


def _stream(system: _Assembly, state: MachineNetworkState, film: StreamFilm) -> tuple[Array, float]:
    """A stream that its walls warm, eliminated: they exchange with its inlet and, past it, with each other.

    Returns
    -------
    What each unknown's temperature above the inlet gives to it (n,) [W/K], and its inlet [K].
    """
    inlet = film.inlet_temperature
    values, _ = stream_coefficients(film, state.network.point)
    machine = state.network.machine
    walls = np.zeros((system.n, len(film.surface)))
    for number, (surface, value) in enumerate(values.items()):
        if surface == film.ball_row:
            lump = system.n_field + machine.surfaces[surface].node[0] - machine.n_solid
            walls[lump, number] = value * machine.surfaces[surface].area[0]
            system.entry(lump, lump, walls[lump, number])
            continue
        basis = _surface(system, surface)
        local = np.full(basis.dx.shape, value)
        system.add(_exchange.assemble(basis, h=local))
        walls[: system.n_field, number] = _supply.assemble(basis, q=local)
    conductance = walls.sum(axis=0)
    warming = CircuitMarch.of(film, conductance, wall_cells(film)).warming
    wetted = np.flatnonzero(walls.any(axis=1))
    between = (walls[wetted] @ warming) @ (walls[wetted] / conductance).T
    system.rows.append(np.repeat(wetted, len(wetted)))
    system.columns.append(np.tile(wetted, len(wetted)))
    system.values.append(-between.ravel())
    system.load += inlet * (walls @ (1.0 - warming.sum(axis=1)))
    return walls @ (1.0 - conductance @ warming / conductance), inlet


def _gaps(system: _Assembly, state: MachineNetworkState) -> None:
    machine, point = state.network.machine, state.network.point
    lump = system.n_field + machine.air_start - machine.n_solid
    for gap in machine.spec.gap:
        bands = machine.gaps[gap.name]
        value, _ = gap_coefficient(gap, point, *bands.radii)
        standing_area = np.bincount(bands.standing_band, bands.standing.area, bands.n_bands)
        exposed = system.cells.exposed
        labels = exposed.name
        for names, area in (((gap.rotating,), bands.area), (gap.standing, standing_area)):
            rows = np.flatnonzero(np.isin(labels, names))
            faces = exposed.pick(rows)
            band = np.clip(np.searchsorted(bands.edges, faces.middle[:, 0]) - 1, 0, bands.n_bands - 1)
            facets = system.facets(faces, faces.inside)
            for index in np.unique(band):
                basis = system.edge_basis(facets[band == index])
                h = 2.0 * value * bands.area[index] / area[index]
                system.tie(basis, np.full(basis.dx.shape[0], h), lump + int(index))
        lump += bands.n_bands


def _coolant(system: _Assembly, state: MachineNetworkState) -> None:
    network, machine = state.network, state.network.machine
    if machine.coolant is None:
        return
    law: CoolantLaw = network.coolant_law
    h = law.coefficients(state.temperature)[0]
    coolant, cells = machine.coolant, system.cells
    start = system.n_field + machine.coolant_start - machine.n_solid
    units = h * coolant.area / law.capacity_rate
    stretched = h * outlet_stretch(units)[0]
    wall = cells.wall
    position = wall.middle[:, 0]
    of_wall = np.clip(np.searchsorted(coolant.edges, position) - 1, 0, len(h) - 1)
    facets = system.facets(wall, wall.inside)
    inside = np.flatnonzero(cells.side_area > 0.0)
    of_cell = np.clip(np.searchsorted(coolant.edges, cells.z[inside].mean(axis=1)) - 1, 0, len(h) - 1)
    full = cells.volume / np.maximum(cells.solid_radial, 1e-12)
    for c in range(len(h)):
        pick = of_wall == c
        if pick.any():
            basis = system.edge_basis(facets[pick])
            system.tie(basis, stretched[c] * wall.share[pick], start + c)
        elements = inside[of_cell == c]
        if elements.size:
            basis = Basis(system.mesh, system.element, elements=elements, intorder=5)
            system.tie(basis, stretched[c] * cells.side_area[elements] / full[elements], start + c)
    rate = law.capacity_rate
    extra = _coolant_heat(state)
    for c in range(len(h)):
        system.entry(start + c, start + c, rate)
        system.load[start + c] += extra[c]
        if c:
            system.entry(start + c, start + c - 1, -rate)
        else:
            system.load[start] += rate * law.inlet
