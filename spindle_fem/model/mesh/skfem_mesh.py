"""The tagged mesh inside scikit-fem, with the node order of both matched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementTetP1, ElementTetP2, FacetBasis, MeshTet2

from spindle_fem.errors import MeshTagError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh

# Highest degree that the quadrature integrates exactly. The Jacobian of a
# quadratic tetrahedron has degree 3, so volumes are exact with 4; the area
# element of a curved facet is no polynomial and takes 6.
ELEMENT_QUADRATURE_DEGREE = 4
FACET_QUADRATURE_DEGREE = 6


@dataclass(frozen=True, slots=True)
class SkfemMesh:
    """A ``MeshTet2`` and where its unknowns are in the tagged mesh.

    Attributes
    ----------
    mesh : skfem.MeshTet2
    basis : skfem.CellBasis
    unknown_of_dof : (n_unknowns,) int64 ndarray
        Node of the tagged mesh for each degree of freedom of ``basis``.
    order : int
        1 or 2.
    """

    mesh: MeshTet2
    basis: Basis
    unknown_of_dof: NDArray[np.int64]
    order: int

    def facet_basis(self, facets: NDArray[np.int64]) -> FacetBasis:
        """scikit-fem's basis on tagged facets, for facet forms.

        Parameters
        ----------
        facets : (n, 6) int64 ndarray
            Quadratic triangles of the tagged mesh.

        Raises
        ------
        MeshTagError
            A triangle that is no facet of the mesh.
        """
        return FacetBasis(
            self.mesh, self.basis.elem, facets=self.find_facets(facets), intorder=FACET_QUADRATURE_DEGREE
        )

    def find_facets(self, facets: NDArray[np.int64]) -> NDArray[np.int64]:
        """Indices of scikit-fem facets with the same three corners."""
        n = np.int64(self.mesh.nvertices)
        known = np.sort(self.mesh.facets, axis=0).astype(np.int64)
        asked = np.sort(facets[:, :3], axis=1).T.astype(np.int64)
        known_keys = (known[0] * n + known[1]) * n + known[2]
        asked_keys = (asked[0] * n + asked[1]) * n + asked[2]
        order = np.argsort(known_keys)
        place = np.minimum(np.searchsorted(known_keys, asked_keys, sorter=order), len(order) - 1)
        found = order[place]
        missing = int(np.sum(known_keys[found] != asked_keys))
        if missing:
            raise MeshTagError("facets", f"{missing} tagged triangles are no facets of the mesh.")
        return found


def load_into_skfem(mesh: TaggedMesh, order: int) -> SkfemMesh:
    """Curved ``MeshTet2`` with P1 or P2 unknowns.

    Parameters
    ----------
    mesh : TaggedMesh
    order : int
        1 or 2.
    """
    loaded = MeshTet2(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.tetrahedra.T))
    element = ElementTetP1() if order == 1 else ElementTetP2()
    basis = Basis(loaded, element, intorder=ELEMENT_QUADRATURE_DEGREE)
    local_nodes = 4 if order == 1 else 10
    unknown_of_dof = np.empty(basis.N, dtype=np.int64)
    unknown_of_dof[basis.element_dofs.ravel()] = mesh.tetrahedra[:, :local_nodes].T.ravel()
    if not np.array_equal(np.sort(unknown_of_dof), np.arange(basis.N)):
        raise MeshTagError("mesh", "corner nodes are not numbered first, or a node belongs to no element.")
    return SkfemMesh(loaded, basis, unknown_of_dof, order)
