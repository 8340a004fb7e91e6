"""Element and facet integrals in bulk.

Shape functions and quadrature are scikit-fem's. Each integral of a form over
all elements is one matrix product: geometry factors at the quadrature points
times a table that depends on the reference element alone. Only the upper
triangle of each symmetric element matrix is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTetP1, ElementTetP2, ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from spindle_fem.errors import MeshQualityError
from spindle_fem.model.mesh.skfem_mesh import ELEMENT_QUADRATURE_DEGREE, FACET_QUADRATURE_DEGREE
from spindle_fem.model.mesh.threads import use_compiled

CHUNK = 16384
# Edge middles this close to the chord, relative to the edge, count as straight.
STRAIGHT_TOLERANCE = 1e-10
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
_METRIC_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, slots=True)
class ReferenceTable:
    """Shape functions of a reference element at its quadrature points.

    Attributes
    ----------
    weights : (n_points,) ndarray
    values : (n_points, n_nodes) ndarray
    gradients : (n_points, n_nodes, dimension) ndarray
    """

    weights: NDArray[np.float64]
    values: NDArray[np.float64]
    gradients: NDArray[np.float64]


def evaluate_shape(element: object, places: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
    """Values (n_points, n_nodes) and gradients (n_points, n_nodes, d) at reference places (d, n_points)."""
    pairs = [element.lbasis(places, i) for i in range(element.doflocs.shape[0])]
    values = np.stack([np.broadcast_to(value, places.shape[1]) for value, _ in pairs], axis=1)
    gradients = np.stack([np.asarray(gradient).T for _, gradient in pairs], axis=1)
    return values, gradients


@cache
def tetrahedron_table(order: int) -> ReferenceTable:
    """Reference tetrahedron of order 1 or 2 at the element quadrature."""
    places, weights = get_quadrature(RefTet, ELEMENT_QUADRATURE_DEGREE)
    element = ElementTetP1() if order == 1 else ElementTetP2()
    return ReferenceTable(weights, *evaluate_shape(element, places))


@cache
def triangle_table(order: int) -> ReferenceTable:
    """Reference triangle of order 1 or 2 at the facet quadrature."""
    places, weights = get_quadrature(RefTri, FACET_QUADRATURE_DEGREE)
    element = ElementTriP1() if order == 1 else ElementTriP2()
    return ReferenceTable(weights, *evaluate_shape(element, places))


def upper_pairs(n_nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the upper triangle of an element matrix, in storage order."""
    return np.triu_indices(n_nodes)


@cache
def _metric_table(order: int) -> NDArray[np.float64]:
    """(n_points, 6, n_upper): weight · (∂N_i/∂a ∂N_j/∂b), symmetrised."""
    table = tetrahedron_table(order)
    rows, columns = upper_pairs(table.values.shape[1])
    slices = []
    for a, b in _METRIC_PAIRS:
        product = table.gradients[:, rows, a] * table.gradients[:, columns, b]
        if a != b:
            product = product + table.gradients[:, rows, b] * table.gradients[:, columns, a]
        slices.append(table.weights[:, None] * product)
    return np.stack(slices, axis=1)


def product_table(table: ReferenceTable) -> NDArray[np.float64]:
    """(n_points, n_upper): weight · N_i N_j."""
    rows, columns = upper_pairs(table.values.shape[1])
    return table.weights[:, None] * table.values[:, rows] * table.values[:, columns]


def is_straight(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which tetrahedra are linear or have every edge middle on its chord, (n_elements,)."""
    if tetrahedra.shape[1] == 4:
        return np.ones(len(tetrahedra), dtype=bool)
    ends = points[tetrahedra[:, EDGES]]
    bow = np.abs(points[tetrahedra[:, 4:]] - 0.5 * (ends[:, :, 0] + ends[:, :, 1])).max(axis=(1, 2))
    return bow <= STRAIGHT_TOLERANCE * np.abs(ends[:, :, 1] - ends[:, :, 0]).max(axis=(1, 2))


def _cofactors(jacobian: list[list[NDArray]]) -> tuple[list[list[NDArray]], NDArray]:
    """Cofactor arrays and determinant of 3 x 3 arrays ``jacobian[physical][reference]``."""
    j = jacobian
    cofactor = [
        [
            j[(i + 1) % 3][(k + 1) % 3] * j[(i + 2) % 3][(k + 2) % 3]
            - j[(i + 1) % 3][(k + 2) % 3] * j[(i + 2) % 3][(k + 1) % 3]
            for k in range(3)
        ]
        for i in range(3)
    ]
    determinant = j[0][0] * cofactor[0][0] + j[0][1] * cofactor[0][1] + j[0][2] * cofactor[0][2]
    return cofactor, determinant


def _geometry(
    nodes: NDArray[np.float64], geometry_gradients: NDArray[np.float64]
) -> tuple[list[list[NDArray]], NDArray]:
    """Cofactors and determinant at places, each (n_elements, n_places); nodes (n_elements, n, 3)."""
    jacobian = [[nodes[:, :, i] @ geometry_gradients[:, :, k].T for k in range(3)] for i in range(3)]
    return _cofactors(jacobian)


def _require_positive(determinant: NDArray[np.float64]) -> None:
    bad = int(np.sum(np.any(determinant <= 0.0, axis=1)))
    if bad:
        raise MeshQualityError(
            "mesh", f"{bad} elements are inverted at a quadrature point.", "Refine or optimise the mesh."
        )


@dataclass(frozen=True, slots=True)
class ElementIntegrals:
    """Upper element matrices and integrals of every element.

    Attributes
    ----------
    conduction, storage : (n_elements, n_upper) ndarray, [m], [m³]
    load : (n_elements, n_nodes) ndarray, [m³]
    volume : (n_elements,) ndarray, [m³]
    """

    conduction: NDArray[np.float64]
    storage: NDArray[np.float64]
    load: NDArray[np.float64]
    volume: NDArray[np.float64]


def integrate_elements(
    points: NDArray[np.float64], tetrahedra: NDArray[np.int64], order: int
) -> ElementIntegrals:
    """Conduction and storage matrices with unit coefficients on curved elements.

    Parameters
    ----------
    points : (n_nodes, 3) ndarray, [m]
    tetrahedra : (n_elements, 10) or (n_elements, 4) int ndarray
        Quadratic, or linear: straight.
    order : int
        Of the temperature, 1 or 2.

    Raises
    ------
    MeshQualityError
        An element that is inverted at a quadrature point.
    """
    table = tetrahedron_table(order)
    metric, product = _metric_table(order), product_table(table)
    load_table = table.weights[:, None] * table.values
    n_nodes, n_upper = table.values.shape[1], metric.shape[2]
    n = len(tetrahedra)
    result = ElementIntegrals(
        np.empty((n, n_upper)), np.empty((n, n_upper)), np.empty((n, n_nodes)), np.empty(n)
    )
    straight = is_straight(points, tetrahedra)
    curved_gradients = tetrahedron_table(2).gradients
    straight_gradients = tetrahedron_table(1).gradients[:1]
    for chosen, is_curved in ((np.flatnonzero(straight), False), (np.flatnonzero(~straight), True)):
        gradients = curved_gradients if is_curved else straight_gradients
        table_metric = metric if is_curved else metric.sum(axis=0, keepdims=True)
        flat_metric = table_metric.reshape(-1, n_upper)
        for start in range(0, len(chosen), CHUNK):
            index = chosen[start : start + CHUNK]
            nodes = points[tetrahedra[index, : 10 if is_curved else 4]]
            cofactor, determinant = _geometry(nodes, gradients)
            _require_positive(determinant)
            weights = np.stack(
                [
                    (
                        cofactor[0][a] * cofactor[0][b]
                        + cofactor[1][a] * cofactor[1][b]
                        + cofactor[2][a] * cofactor[2][b]
                    )
                    / determinant
                    for a, b in _METRIC_PAIRS
                ],
                axis=2,
            )
            result.conduction[index] = weights.reshape(len(index), -1) @ flat_metric
            if is_curved:
                result.storage[index] = determinant @ product
                result.load[index] = determinant @ load_table
                result.volume[index] = determinant @ table.weights
            else:
                result.storage[index] = determinant * product.sum(axis=0)
                result.load[index] = determinant * load_table.sum(axis=0)
                result.volume[index] = determinant[:, 0] * table.weights.sum()
    return result


def integrate_circumferential(
    points: NDArray[np.float64], tetrahedra: NDArray[np.int64], order: int
) -> NDArray[np.float64]:
    """Upper matrices of ``∫ (∂u/∂s)(∂v/∂s) dV`` with s around the z axis, (n_elements, n_upper) [m]."""
    metric = _metric_table(order)
    flat_metric = metric.reshape(-1, metric.shape[2])
    geometry = tetrahedron_table(1 if tetrahedra.shape[1] == 4 else 2)
    out = np.empty((len(tetrahedra), metric.shape[2]))
    for start in range(0, len(tetrahedra), CHUNK):
        nodes = points[tetrahedra[start : start + CHUNK]]
        cofactor, determinant = _geometry(nodes, geometry.gradients)
        x, y = nodes[:, :, 0] @ geometry.values.T, nodes[:, :, 1] @ geometry.values.T
        radius = np.hypot(x, y)
        if np.any(radius < 1e-12):
            raise MeshQualityError(
                "mesh", "a quadrature point lies on the axis, where no circumferential direction exists."
            )
        along = [(-y * cofactor[0][a] + x * cofactor[1][a]) / radius for a in range(3)]
        weights = np.stack([along[a] * along[b] / determinant for a, b in _METRIC_PAIRS], axis=2)
        out[start : start + CHUNK] = weights.reshape(len(nodes), -1) @ flat_metric
    return out


@dataclass(frozen=True, slots=True)
class FacetIntegrals:
    """Upper facet matrices and integrals of every facet.

    Attributes
    ----------
    film : (n_facets, n_upper) ndarray, [m²]
    load : (n_facets, n_nodes) ndarray, [m²]
    area : (n_facets,) ndarray, [m²]
    """

    film: NDArray[np.float64]
    load: NDArray[np.float64]
    area: NDArray[np.float64]


def integrate_facets(points: NDArray[np.float64], facets: NDArray[np.int64], order: int) -> FacetIntegrals:
    """Film matrices with unit coefficient on facets, (n_facets, 6) curved or (n_facets, 3) straight."""
    is_flat = facets.shape[1] == 3
    if is_flat and order == 1 and use_compiled(len(points)):
        return _flat_facets(points, facets)
    table = triangle_table(order)
    geometry = triangle_table(1).gradients[:1] if is_flat else triangle_table(2).gradients
    nodes = points[facets]
    tangents = [[nodes[:, :, i] @ geometry[:, :, k].T for i in range(3)] for k in range(2)]
    first, second = tangents
    area_element = np.sqrt(
        sum(
            (first[(i + 1) % 3] * second[(i + 2) % 3] - first[(i + 2) % 3] * second[(i + 1) % 3]) ** 2
            for i in range(3)
        )
    )
    tables = (product_table(table), table.weights[:, None] * table.values, table.weights[:, None])
    if is_flat:
        tables = tuple(each.sum(axis=0, keepdims=True) for each in tables)
    film, load, area = (area_element @ each for each in tables)
    return FacetIntegrals(film, load, area[:, 0])


def _flat_facets(points: NDArray[np.float64], facets: NDArray[np.int64]) -> FacetIntegrals:
    from spindle_fem.model.mesh.kernels.facet_loops import integrate_flat_facets

    n = len(facets)
    answer = FacetIntegrals(np.empty((n, 6)), np.empty((n, 3)), np.empty(n))
    integrate_flat_facets(0, n, points, facets, answer.film, answer.load, answer.area)
    return answer
