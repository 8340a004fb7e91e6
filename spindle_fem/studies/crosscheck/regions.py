"""Finite-element averages over the regions of network nodes, and flux through their surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

from spindle_fem.errors import GeometryError
from spindle_fem.model.lumped.cells import Faces, MeridianCells
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.mesh.element_integrals import evaluate_shape
from spindle_fem.model.mesh.evaluate import quadratic_shape
from spindle_fem.operation.channel_cells import helix_coordinates
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.solvers.coupled_steady import CoupledState
from spindle_fem.solvers.prepared_machine import PreparedMachine

Array = NDArray[np.float64]
# Keast (1986), degree 2, four points; weights of the unit tetrahedron sum to 1/6.
_A, _B = 0.5854101966249685, 0.1381966011250105
_POINTS = np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]])
_CHUNK = 2_000
# Larger elements across a border are cut into 64 pieces, smaller ones into eight.
_LARGE_ELEMENT = 9.0e-3
_NEAR_ELEMENTS = 24
# In reference coordinates: curved walls lie a little outside their straight elements.
_OUTSIDE_LIMIT = -0.25
_ANGLES = 48
_MARGIN = 0.3e-3
_INTO_METAL = 0.2e-3
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, slots=True)
class NodeRegions:
    """Part of a finite-element mesh that corresponds to each network node.

    Attributes
    ----------
    average : (n_solid, n_unknowns) csr_array
        Rows give volume means over the nodes' regions.
    volume : (n_solid,) ndarray, [m³]
    """

    machine: MachineNetwork
    average: sparse.csr_array
    volume: Array


def cells_at(cells: MeridianCells, parts: tuple[str, ...], part: NDArray, points: Array) -> NDArray[np.int64]:
    """Cell of each point, in its own part; a point that curvature puts just outside takes the nearest.

    Parameters
    ----------
    parts : tuple of str
        Names that ``part`` counts in.
    part : (n,) int ndarray
    points : (n, 3) ndarray, [m]
    """
    translate = np.array([cells.part_names.index(name) for name in parts])
    own = translate[part]
    z, r = points[:, 2], np.hypot(points[:, 0], points[:, 1])
    number = np.full((len(cells.z_lines) - 1, len(cells.r_lines) - 1), -1, dtype=np.int64)
    number[tuple(cells.grid_index.T)] = np.arange(cells.n_cells)
    i = np.clip(np.searchsorted(cells.z_lines, z) - 1, 0, number.shape[0] - 1)
    j = np.clip(np.searchsorted(cells.r_lines, r) - 1, 0, number.shape[1] - 1)
    found = number[i, j]
    wrong = np.flatnonzero((found < 0) | (cells.part[found] != own))
    for index in np.unique(own[wrong]):
        rows = wrong[own[wrong] == index]
        members = np.flatnonzero(cells.part == index)
        bounds = np.column_stack([cells.z[members], cells.r[members]])
        place = np.column_stack([z[rows], r[rows]])
        _, near = KDTree(np.column_stack([bounds[:, :2].mean(axis=1), bounds[:, 2:].mean(axis=1)])).query(
            place, k=min(16, len(members))
        )
        near = np.reshape(near, (len(rows), -1))
        box = bounds[near]
        distance = np.hypot(
            np.maximum(0.0, np.maximum(box[..., 0] - place[:, None, 0], place[:, None, 0] - box[..., 1])),
            np.maximum(0.0, np.maximum(box[..., 2] - place[:, None, 1], place[:, None, 1] - box[..., 3])),
        )
        found[rows] = members[near[np.arange(len(rows)), distance.argmin(axis=1)]]
    return found


def build_regions(prepared: PreparedMachine, machine: MachineNetwork) -> NodeRegions:
    """Averaging rows of every solid node of a network on a mesh.

    Elements inside one node are integrated whole; those across a border are
    cut into eight or 64 and each quadrature point goes to the node it lies in.
    """
    mesh, operators = prepared.mesh, prepared.operators
    cells, _node_of_cell = machine.cells, machine.partition.node_of_cell
    straddles = _crosses(cells, mesh.points[mesh.tetrahedra])
    n_shape = 4 if operators.order == 1 else 10
    corners = mesh.points[mesh.tetrahedra[:, :4]]
    large = np.ptp(corners, axis=1).max(axis=1) > _LARGE_ELEMENT
    eight, sixty_four = _subdivided(_POINTS), _subdivided(_subdivided(_POINTS))
    blocks = []
    for rows, points, weight in (
        (np.flatnonzero(~straddles), _POINTS, 1.0 / 24.0),
        (np.flatnonzero(straddles & ~large), eight, 1.0 / 24.0 / 8.0),
        (np.flatnonzero(straddles & large), sixty_four, 1.0 / 24.0 / 64.0),
    ):
        for start in range(0, len(rows), _CHUNK):
            blocks.append(
                _integrate(prepared, machine, rows[start : start + _CHUNK], points, weight, n_shape)
            )
    row, column, value = (np.concatenate(items) for items in zip(*blocks, strict=True))
    n = len(machine.partition.node_names)
    integral = sparse.csr_array((value, (row, column)), shape=(n, operators.n_unknowns))
    volume = np.asarray(integral.sum(axis=1)).ravel()
    average = sparse.csr_array(sparse.diags_array(1.0 / volume) @ integral)
    return NodeRegions(machine, average, volume)


def _crosses(cells: MeridianCells, nodes: Array) -> NDArray[np.bool_]:
    """Whether an element reaches over a line of the grid, by its nodes."""
    margin = 1.0e-6
    z, r = nodes[..., 2], np.hypot(nodes[..., 0], nodes[..., 1])
    crossing = np.zeros(len(nodes), dtype=bool)
    for values, lines in ((z, cells.z_lines), (r, cells.r_lines)):
        low = np.searchsorted(lines, values.min(axis=1) + margin)
        high = np.searchsorted(lines, values.max(axis=1) - margin)
        crossing |= low != high
    return crossing


def _subdivided(points: Array) -> Array:
    """A quadrature rule repeated in eight tetrahedra that make the unit one."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    mid = {(a, b): 0.5 * (corner[a] + corner[b]) for a in range(4) for b in range(a + 1, 4)}
    tets = [
        (corner[0], mid[0, 1], mid[0, 2], mid[0, 3]),
        (corner[1], mid[0, 1], mid[1, 2], mid[1, 3]),
        (corner[2], mid[0, 2], mid[1, 2], mid[2, 3]),
        (corner[3], mid[0, 3], mid[1, 3], mid[2, 3]),
        (mid[0, 1], mid[2, 3], mid[0, 2], mid[0, 3]),
        (mid[0, 1], mid[2, 3], mid[0, 3], mid[1, 3]),
        (mid[0, 1], mid[2, 3], mid[1, 3], mid[1, 2]),
        (mid[0, 1], mid[2, 3], mid[1, 2], mid[0, 2]),
    ]
    barycentric = np.column_stack([1.0 - points.sum(axis=1), points])
    return np.concatenate([barycentric @ np.array(tet) for tet in tets])


def _integrate(prepared, machine, elements, points, weight, n_shape):
    """(row, column, value) of the integrals over each node's share of some elements."""
    mesh = prepared.mesh
    nodes = mesh.points[mesh.tetrahedra[elements]]
    geometry, gradient = quadratic_shape(points)
    shape = geometry if n_shape == 10 else evaluate_shape(_linear(), points.T)[0]
    along = np.moveaxis(np.tensordot(nodes, gradient, axes=(1, 1)), 1, -1)
    measure = np.abs(np.sum(np.cross(along[:, :, 0], along[:, :, 1]) * along[:, :, 2], axis=-1)) * weight
    places = geometry @ nodes
    part = np.repeat(mesh.part_of_element[elements], len(points))
    owner = machine.partition.node_of_cell[
        cells_at(machine.cells, mesh.part_names, part, places.reshape(-1, 3))
    ].reshape(measure.shape)
    rows, columns, values = [], [], []
    unknowns = mesh.tetrahedra[elements, :n_shape]
    todo = np.ones(measure.shape, dtype=bool)
    while todo.any():
        # each pass takes, in every element, all points of one node
        pick = todo.argmax(axis=1)
        active = todo.any(axis=1)
        current = owner[np.arange(len(owner)), pick]
        mask = todo & (owner == current[:, None])
        part_values = (measure * mask) @ shape
        rows.append(np.repeat(current[active], n_shape))
        columns.append(unknowns[active].ravel())
        values.append(part_values[active].ravel())
        todo &= ~mask
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def _linear():
    from skfem import ElementTetP1

    return ElementTetP1()


def node_temperatures(regions: NodeRegions, prepared: PreparedMachine, coupled: CoupledState) -> Array:
    """Finite-element temperature of every network node, (n_nodes,) [K].

    Solids are volume means; balls are the ball rows themselves; gap air is the
    mean of the bands in the same range of z; coolant is the bulk temperature at
    the end of each node's stretch of channel.
    """
    machine = regions.machine
    lumped = dict(
        zip(coupled.solution.problem.lumped_names, coupled.solution.lumped_temperature, strict=True)
    )
    values = [regions.average @ coupled.solution.temperature]
    builder = prepared.builder
    for _, bearing in machine.spec.bearings:
        values.append(np.array([np.mean([lumped[name] for name in builder.ball_nodes(bearing.name)])]))
    for name, gap in machine.gaps.items():
        values.append(_air_means(builder, lumped, name, gap.edges))
    if machine.coolant is not None:
        values.append(_coolant_ends(machine, prepared, coupled))
    return np.concatenate(values)


def _air_means(builder, lumped, name: str, edges: Array) -> Array:
    bands = builder.gaps[name]
    sectors = builder.n_sectors
    n = bands.n_cells // sectors
    cell = np.array([lumped[f"{name}[{k}]"] for k in range(bands.n_cells)]).reshape(n, sectors).mean(axis=1)
    own = np.linspace(edges[0], edges[-1], n + 1)
    overlap = np.maximum(
        0.0, np.minimum(own[1:, None], edges[None, 1:]) - np.maximum(own[:-1, None], edges[None, :-1])
    )
    return (cell @ overlap) / overlap.sum(axis=0)


def _coolant_ends(machine, prepared, coupled) -> Array:
    """Bulk temperature where the helix passes each edge of the network's coolant cells, K."""
    cells, march = prepared.builder.cells, coupled.coolant.march.march
    edge = np.atleast_2d(march.edge_temperature).mean(axis=0)
    is_channel = ~cells.is_port
    n = int(is_channel.sum())
    first = int(np.argmax(is_channel))
    along = np.linspace(0.0, machine.spec.channel.turns, n + 1)
    wanted = (machine.coolant.edges[1:] - machine.spec.channel.z_start) / machine.spec.channel.pitch
    return np.interp(wanted, along, edge[first : first + n + 1])


def facet_nodes(
    prepared: PreparedMachine, machine: MachineNetwork, facets: NDArray, part: str
) -> NDArray[np.int64]:
    """Network node behind each boundary facet of a part."""
    mesh = prepared.mesh
    corners = mesh.points[facets[:, :3]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # a little way into the metal: at a border between nodes the wall belongs to what it bounds
    centres = facet_centres(mesh.points, facets) - _INTO_METAL * normal
    index = np.full(len(centres), mesh.part_names.index(part))
    return machine.partition.node_of_cell[cells_at(machine.cells, mesh.part_names, index, centres)]


def in_channel(machine: MachineNetwork, points: Array) -> NDArray[np.bool_]:
    """Points in the coolant or so near its walls that no element is sure to hold them."""
    channel = machine.spec.channel
    inside = np.zeros(len(points), dtype=bool)
    if channel is None:
        return inside
    r = np.hypot(points[:, 0], points[:, 1])
    _, angle = helix_coordinates(points, channel)
    centre = channel.z_start + channel.pitch * np.clip(angle, 0.0, 2.0 * np.pi * channel.turns) / (
        2.0 * np.pi
    )
    beyond = np.maximum(np.maximum(-angle, angle - 2.0 * np.pi * channel.turns), 0.0) * r
    inside |= (
        (np.abs(points[:, 2] - centre) < 0.5 * channel.width + _MARGIN)
        & (r > channel.inner_radius - 1e-9)
        & (r < channel.inner_radius + channel.depth + 1e-9)
        & (beyond < _MARGIN)
    )
    geometry = machine.assembly.channel
    for port in geometry.ports:
        x, y = port.direction
        along = points[:, 0] * x + points[:, 1] * y
        across = np.hypot(points[:, 0] * y - points[:, 1] * x, points[:, 2] - port.z)
        inside |= (along > port.start_radius) & (across < port.radius + _MARGIN)
    return inside


def flux_through_cuts(
    prepared: PreparedMachine, machine: MachineNetwork, temperature: Array
) -> dict[tuple[int, int], float]:
    """Heat through every surface between two nodes that lies inside a part, W, from first to second node.

    The gradient of the field is integrated over the cut (48 angles by three
    Gauss points in each face); coolant and ports are left out.
    """
    cells, node_of = machine.cells, machine.partition.node_of_cell
    faces = Faces.joined([cells.conduction, cells.blocked])
    a, b = node_of[faces.first], node_of[faces.second]
    rows = np.flatnonzero(a != b)
    angle = (np.arange(_ANGLES) + 0.5) * 2.0 * np.pi / _ANGLES
    low, high = faces.span[rows].T
    other = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * _GAUSS
    radial = faces.radial[rows]
    position = np.broadcast_to(faces.position[rows][:, None], other.shape)
    z, r = np.where(radial[:, None], other, position), np.where(radial[:, None], position, other)
    full = np.where(radial, 2.0 * np.pi * faces.position[rows] * (high - low), np.pi * (high**2 - low**2))
    jacobian = np.where(radial[:, None], 1.0, r / np.maximum(0.5 * (low + high)[:, None], 1e-12))
    weight = (full[:, None] * jacobian * 0.5 * _GAUSS_WEIGHTS)[..., None] / _ANGLES * np.ones(_ANGLES)
    shape = (*other.shape, _ANGLES)
    points = np.stack(
        [
            np.broadcast_to(-r[..., None] * np.sin(angle), shape),
            np.broadcast_to(r[..., None] * np.cos(angle), shape),
            np.broadcast_to(z[..., None], shape),
        ],
        axis=-1,
    )
    normal = np.zeros((*shape, 3))
    normal[..., 0] = np.where(radial[:, None, None], -np.sin(angle), 0.0)
    normal[..., 1] = np.where(radial[:, None, None], np.cos(angle), 0.0)
    normal[..., 2] = np.where(radial[:, None, None], 0.0, 1.0)
    part = np.broadcast_to(cells.part[faces.first[rows]][:, None, None], shape)
    flat, part, weight, normal = points.reshape(-1, 3), part.ravel(), weight.ravel(), normal.reshape(-1, 3)
    link = np.broadcast_to(np.arange(len(rows))[:, None, None], shape).ravel()
    channel = machine.spec.channel
    keep = np.ones(len(flat), dtype=bool)
    if channel is not None:
        of_body = part == cells.part_names.index(channel.part)
        keep[of_body] = ~in_channel(machine, flat[of_body])
    names = [cells.part_names[index] for index in part[keep]]
    element, place = locate(prepared, flat[keep], names)
    gradient = _gradients(prepared, temperature, element, place)
    k = np.array([prepared.conductivity[name] for name in names])
    heat = -k * np.einsum("nx,nx->n", gradient, normal[keep]) * weight[keep]
    per_face = np.bincount(link[keep], heat, len(rows))
    found: dict[tuple[int, int], float] = {}
    for face, value in zip(rows, per_face, strict=True):
        first, second, sign = int(a[face]), int(b[face]), 1.0
        if first > second:
            first, second, sign = second, first, -1.0
        found[first, second] = found.get((first, second), 0.0) + sign * float(value)
    return found


def _gradients(prepared: PreparedMachine, temperature: Array, element: NDArray, place: Array) -> Array:
    """Temperature gradient at places in elements, (n, 3) [K/m]."""
    mesh = prepared.mesh
    _, gradient = quadratic_shape(place)
    jacobian = np.einsum("enx,enk->exk", mesh.points[mesh.tetrahedra[element]], gradient)
    if prepared.operators.order == 1:
        _, gradient = evaluate_shape(_linear(), place.T)
    values = temperature[mesh.tetrahedra[element, : gradient.shape[1]]]
    reference = np.einsum("en,enk->ek", values, gradient)
    return np.linalg.solve(jacobian.transpose(0, 2, 1), reference[..., None])[..., 0]


def locate(prepared: PreparedMachine, points: Array, parts: list[str]) -> tuple[NDArray[np.int64], Array]:
    """Element that holds each point, in its part, and the place in it (reference coordinates).

    Nearest elements first; what they do not hold is searched in every element
    whose box does, so that graded meshes lose no point.

    Raises
    ------
    GeometryError
        A point outside its part.
    """
    mesh = prepared.mesh
    element, place = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
    part = np.array([mesh.part_names.index(name) for name in parts])
    for index in np.unique(part):
        rows = np.flatnonzero(part == index)
        own = np.flatnonzero(mesh.part_of_element == index)
        corners = mesh.points[mesh.tetrahedra[own, :4]]
        inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
        k = min(_NEAR_ELEMENTS, len(own))
        near = np.reshape(KDTree(corners.mean(axis=1)).query(points[rows], k=k)[1], (len(rows), k))
        offset = points[rows][:, None] - corners[near, 0]
        inside = np.einsum("pkij,pkj->pki", inverse[near], offset)
        worst = np.minimum(inside.min(axis=2), 1.0 - inside.sum(axis=2))
        best = worst.argmax(axis=1)
        lines = np.arange(len(rows))
        chosen, found, depth = near[lines, best], inside[lines, best], worst[lines, best]
        low, high = corners.min(axis=1), corners.max(axis=1)
        for row in np.flatnonzero(depth < 0.0):
            point = points[rows[row]]
            slack = 0.05 * (high - low)
            holding = np.flatnonzero(((low - slack <= point) & (point <= high + slack)).all(axis=1))
            if not holding.size:
                continue
            local = np.einsum("kij,kj->ki", inverse[holding], point - corners[holding, 0])
            least = np.minimum(local.min(axis=1), 1.0 - local.sum(axis=1))
            top = int(least.argmax())
            if least[top] > depth[row]:
                chosen[row], found[row], depth[row] = holding[top], local[top], least[top]
        if depth.min() < _OUTSIDE_LIMIT:
            lost = int(depth.argmin())
            raise GeometryError(
                f"point {np.round(1e3 * points[rows[lost]], 3).tolist()} mm",
                f'no element of part "{mesh.part_names[index]}" holds it.',
                "The mesh and the network were made from different geometry.",
            )
        element[rows], place[rows] = own[chosen], found
    return element, place
