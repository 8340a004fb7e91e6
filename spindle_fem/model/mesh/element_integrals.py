"""Element and facet integrals of the forms: by scikit-fem, or on many elements by kernels that give the same.

:mod:`spindle_fem.model.mesh.forms` says what is integrated; shape functions and quadrature are
scikit-fem's everywhere. scikit-fem takes some ten times as long as a kernel, which is seconds on a
machine's mesh and nothing on a small one. Only the upper triangle of each symmetric element matrix
is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from spindle_fem.errors import MeshQualityError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh import forms
from spindle_fem.model.mesh.kernels.assembly_loops import integrate_tetrahedra
from spindle_fem.model.mesh.skfem_mesh import (
    ELEMENT_QUADRATURE_DEGREE,
    FACET_QUADRATURE_DEGREE,
    SkfemMesh,
    load_into_skfem,
    tetrahedron_element,
)
from spindle_fem.model.mesh.threads import row_blocks, run_blocks, unsigned

# From here on kernels integrate; scikit-fem takes about 0.1 s on so many elements.
MANY_ELEMENTS = 3_000
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])


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
    return ReferenceTable(weights, *evaluate_shape(tetrahedron_element(order), places))


@cache
def triangle_table(order: int) -> ReferenceTable:
    """Reference triangle of order 1 or 2 at the facet quadrature."""
    places, weights = get_quadrature(RefTri, FACET_QUADRATURE_DEGREE)
    element = ElementTriP1() if order == 1 else ElementTriP2()
    return ReferenceTable(weights, *evaluate_shape(element, places))


def upper_pairs(n_nodes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the upper triangle of an element matrix, in storage order."""
    return np.triu_indices(n_nodes)


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


def integrate_elements(mesh: TaggedMesh, order: int, chosen: slice) -> ElementIntegrals:
    """Conduction, storage and source with unit coefficients on a range of curved elements.

    Parameters
    ----------
    order : int
        Of the temperature, 1 or 2.
    chosen : slice
        Elements; all of a small mesh.

    Raises
    ------
    MeshQualityError
        An element that is inverted at a quadrature point.
    """
    if len(mesh.tetrahedra) < MANY_ELEMENTS:
        return elements_by_forms(load_into_skfem(mesh, order))
    return elements_by_kernel(mesh.points, mesh.tetrahedra[chosen], order)


def elements_by_forms(loaded: SkfemMesh) -> ElementIntegrals:
    """The integrals of all elements, assembled by scikit-fem; see :func:`integrate_elements`."""
    _require_upright(int(np.sum(np.any(loaded.basis.mapping.detDF(loaded.basis.X) <= 0.0, axis=1))))
    rows, columns = upper_pairs(loaded.basis.Nbfun)
    load = forms.source.elemental(loaded.basis).tolocal()
    conduction, storage = (
        np.ascontiguousarray(form.elemental(loaded.basis).tolocal()[:, rows, columns])
        for form in (forms.conduction, forms.capacity)
    )
    return ElementIntegrals(
        conduction,
        storage,
        np.ascontiguousarray(load),
        # shape functions sum to one
        load.sum(axis=1),
    )


def elements_by_kernel(
    points: NDArray[np.float64], tetrahedra: NDArray[np.int64], order: int
) -> ElementIntegrals:
    """Element integrals by a kernel, on quadratic tetrahedra (n, 10)."""
    table, mapping = tetrahedron_table(order), tetrahedron_table(2)
    n, n_nodes = len(tetrahedra), table.values.shape[1]
    shape = n, len(upper_pairs(n_nodes)[0])
    found = ElementIntegrals(np.empty(shape), np.empty(shape), np.empty((n, n_nodes)), np.empty(n))
    # copies: of one type for the kernel, whether or not the mesh may be written to
    given = (np.array(points), unsigned(np.ascontiguousarray(tetrahedra))[0], mapping.gradients)
    tables = (table.gradients, table.values, table.weights)
    results = (found.conduction, found.storage, found.load, found.volume)
    _require_upright(sum(run_blocks(integrate_tetrahedra, row_blocks(n), *given, *tables, *results)))
    return found


def _require_upright(inverted: int) -> None:
    if inverted:
        raise MeshQualityError(
            "mesh",
            f"{inverted} elements are inverted at a quadrature point.",
            "Refine or optimise the mesh.",
        )


def integrate_facets(mesh: TaggedMesh, facets: NDArray[np.int64], order: int) -> FacetIntegrals:
    """Film and source with unit coefficients on facets, (n_facets, 6) curved or (n_facets, 3) straight."""
    if mesh.tetrahedra.shape[1] == 10 and len(mesh.tetrahedra) < MANY_ELEMENTS:
        return facets_by_forms(load_into_skfem(mesh, order), facets)
    return facets_in_bulk(mesh.points, facets, order)


def facets_by_forms(loaded: SkfemMesh, facets: NDArray[np.int64]) -> FacetIntegrals:
    """The integrals of facets (n, 6), assembled by scikit-fem; see :func:`integrate_facets`."""
    basis = loaded.facet_basis(facets)
    unknowns = loaded.unknown_of_dof[basis.element_dofs].T
    own = facets[:, : 3 if basis.Nbfun == 4 else 6]
    # positions of the facet's nodes among those of its element
    place = np.argmax(unknowns[:, None, :] == own[:, :, None], axis=2)
    rows, columns = upper_pairs(own.shape[1])
    element = np.arange(len(facets))[:, None]
    load = forms.source.elemental(basis).tolocal()
    return FacetIntegrals(
        forms.film.elemental(basis).tolocal()[element, place[:, rows], place[:, columns]],
        load[element, place],
        load.sum(axis=1),
    )


def facets_in_bulk(points: NDArray[np.float64], facets: NDArray[np.int64], order: int) -> FacetIntegrals:
    """Facet integrals in a few array operations.

    Each integral over all facets is one matrix product: area elements at the quadrature points times
    the form's values on the reference triangle.
    """
    table = triangle_table(order)
    rows, columns = upper_pairs(table.values.shape[1])
    # a straight triangle has one area element at all points
    gradients = triangle_table(1).gradients[:1] if facets.shape[1] == 3 else triangle_table(2).gradients
    nodes = points[facets]
    first, second = ((nodes.transpose(0, 2, 1) @ gradients[:, :, k].T) for k in range(2))
    area_element = np.linalg.norm(np.cross(first, second, axis=1), axis=1)
    products = table.values[:, rows] * table.values[:, columns]
    weighted = area_element * table.weights
    return FacetIntegrals(weighted @ products, weighted @ table.values, weighted.sum(axis=1))
