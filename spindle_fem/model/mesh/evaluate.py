"""Temperatures at points, on surfaces, maxima, and heat flux."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.spatial import KDTree

from spindle_fem.errors import GeometryError, SpecError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import evaluate_shape
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, prolongation_from_corners
from spindle_fem.model.mesh.skfem_mesh import tetrahedron_element

CANDIDATES = 48
# A search tree costs as much as looking at all elements for this many points.
FEW_POINTS = 8
NEWTON_STEPS = 30
NEWTON_TOLERANCE = 1e-12
# A point may lie this far outside its element, in reference coordinates,
# because a curved wall and its quadratic mesh differ.
OUTSIDE_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class Location:
    """Elements and reference places of points.

    Attributes
    ----------
    element : (n,) int64 ndarray
    place : (n, 3) ndarray
        Reference coordinates.
    distance : (n,) ndarray, [m]
        Distance from the given point to the nearest point of its element; 0 inside.
    """

    element: NDArray[np.int64]
    place: NDArray[np.float64]
    distance: NDArray[np.float64]


def locate_points(mesh: TaggedMesh, points: ArrayLike, parts: Sequence[str]) -> Location:
    """Curved elements that hold points, searched in one part each.

    Parameters
    ----------
    points : (n, 3) array_like, [m]
    parts : sequence of str
        Part of each point: at a joint, both sides have a temperature.

    Raises
    ------
    GeometryError
        A point outside its part, with its distance.
    SpecError
        Unknown part or wrong shape.
    """
    asked = np.atleast_2d(np.asarray(points, dtype=float))
    if asked.shape != (len(parts), 3):
        raise SpecError(
            "points", f"shape {asked.shape} for {len(parts)} parts.", "Allowed: (n, 3), one part each."
        )
    element = np.empty(len(asked), dtype=np.int64)
    place = np.empty((len(asked), 3))
    distance = np.empty(len(asked))
    part_of_point = np.asarray(parts, dtype=object)
    for part in dict.fromkeys(parts):
        if part not in mesh.part_names:
            raise SpecError("points", f'part "{part}" is not in this mesh.', f"Allowed: {mesh.part_names}.")
        chosen = np.flatnonzero(part_of_point == part)
        own = np.flatnonzero(mesh.part_of_element == mesh.part_names.index(part))
        element[chosen], place[chosen], distance[chosen] = _locate_in(mesh, own, asked[chosen], part)
    return Location(element, place, distance)


def _locate_in(
    mesh: TaggedMesh, own: NDArray[np.int64], asked: NDArray[np.float64], part: str
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    corners = mesh.points[mesh.tetrahedra[own, :4]]
    n_candidates = min(CANDIDATES, len(own))
    candidates = own[_nearest(corners.mean(axis=1), asked, n_candidates)]
    nodes = mesh.points[mesh.tetrahedra[candidates.ravel()]]
    targets = np.repeat(asked, n_candidates, axis=0)
    places = _invert_mapping(nodes, targets)
    outside = _outside(places).reshape(candidates.shape)
    best = np.argmin(outside, axis=1)
    row = np.arange(len(asked))
    chosen_places = places.reshape(*candidates.shape, 3)[row, best]
    excess = outside[row, best]
    chosen = candidates[row, best]
    extent = np.ptp(mesh.points[mesh.tetrahedra[chosen, :4]], axis=1).max(axis=1)
    far = np.flatnonzero(excess > OUTSIDE_TOLERANCE)
    if far.size:
        first = far[0]
        millimetres = np.round(1e3 * asked[first], 3).tolist()
        raise GeometryError(
            f"point {millimetres} mm",
            f'it lies about {1e3 * excess[first] * extent[first]:.3g} mm outside part "{part}".',
            "Move the point into the part or name another part.",
        )
    return chosen, chosen_places, np.maximum(excess, 0.0) * extent


def _nearest(centres: NDArray[np.float64], asked: NDArray[np.float64], number: int) -> NDArray[np.int64]:
    """Centres nearest to each point, (len(asked), number), the nearest first."""
    if len(asked) > FEW_POINTS:
        return np.reshape(KDTree(centres).query(asked, k=number)[1], (len(asked), number))
    found = np.empty((len(asked), number), dtype=np.int64)
    for row, point in enumerate(asked):
        squared = np.sum((centres - point) ** 2, axis=1)
        near = np.argpartition(squared, number - 1)[:number]
        found[row] = near[np.argsort(squared[near], kind="stable")]
    return found


def _outside(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest negative barycentric coordinate; infinite where Newton failed."""
    lowest = np.minimum(places.min(axis=1), 1.0 - places.sum(axis=1))
    return np.where(np.isfinite(lowest), np.maximum(-lowest, 0.0), np.inf)


def _invert_mapping(nodes: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reference places of targets (n, 3) in quadratic tetrahedra (n, 10, 3)."""
    edges = (nodes[:, 1:4] - nodes[:, :1]).transpose(0, 2, 1)
    places = np.linalg.solve(edges, (targets - nodes[:, 0])[:, :, None])[:, :, 0]
    straight = places.copy()
    active = np.flatnonzero(np.abs(places).max(axis=1) < 4.0)
    rejected = np.ones(len(places), dtype=bool)
    rejected[active] = False
    for _ in range(NEWTON_STEPS):
        if not active.size:
            break
        values, gradients = quadratic_shape(places[active])
        residual = targets[active] - np.einsum("en,enx->ex", values, nodes[active])
        jacobian = np.einsum("enx,enk->exk", nodes[active], gradients)
        determinant = np.linalg.det(jacobian)
        sound = np.abs(determinant) > 1e-14 * np.abs(np.linalg.det(edges[active]))
        step = np.zeros_like(residual)
        step[sound] = np.linalg.solve(jacobian[sound], residual[sound][:, :, None])[:, :, 0]
        places[active] += step
        rejected[active[~sound]] = True
        moving = np.abs(step).max(axis=1) > NEWTON_TOLERANCE
        inside_range = np.abs(places[active]).max(axis=1) < 10.0
        rejected[active[~inside_range]] = True
        active = active[moving & sound & inside_range]
    rejected[active] = True
    return np.where(rejected[:, None], np.where(np.abs(straight) < 4.0, np.nan, straight), places)


def quadratic_shape(places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values (n, 10) and gradients (n, 10, 3) of the quadratic tetrahedron at places (n, 3)."""
    return evaluate_shape(tetrahedron_element(2), places.T)


def probe_matrix(operators: ThermalOperators, points: ArrayLike, parts: Sequence[str]) -> sparse.csr_array:
    """Rows that give the temperature at points, (n_points, n_unknowns).

    Parameters
    ----------
    points : (n, 3) array_like, [m]
    parts : sequence of str
        Part of each point.

    Raises
    ------
    GeometryError
        A point outside its part.
    """
    location = locate_points(operators.mesh, points, parts)
    element = tetrahedron_element(operators.order)
    values, _ = evaluate_shape(element, location.place.T)
    columns = operators.mesh.tetrahedra[location.element, : values.shape[1]]
    rows = np.repeat(np.arange(len(values)), values.shape[1])
    return sparse.csr_array(
        (values.ravel(), (rows, columns.ravel())), shape=(len(values), operators.n_unknowns)
    )


def mean_matrix(operators: ThermalOperators, surfaces: Sequence[str]) -> sparse.csr_array:
    """Rows that give area-mean temperatures of surfaces, (n_surfaces, n_unknowns)."""
    rows = []
    for surface in surfaces:
        facets = operators.rows_of(surface, "mean temperature")
        weights = operators.facet_vector(np.ones(facets.stop - facets.start), facets)
        rows.append(sparse.csr_array(weights[None, :] / operators.facet_area[facets].sum()))
    return sparse.vstack(rows, format="csr")


def surface_mean(operators: ThermalOperators, temperature: NDArray[np.float64], surface: str) -> float:
    """Area-mean temperature of a surface, [K]."""
    rows = operators.rows_of(surface, "mean temperature")
    return float(operators.facet_integral(temperature, rows).sum() / operators.facet_area[rows].sum())


def temperature_at_nodes(
    operators: ThermalOperators, temperature: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Temperature at every node of the mesh, edge middles included, (n_nodes,) [K].

    Linear temperatures are interpolated: the mean of an edge's two ends.
    """
    if operators.order == 2:
        return temperature
    return prolongation_from_corners(operators.mesh) @ temperature
