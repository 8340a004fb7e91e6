"""The tagged mesh inside scikit-fem, with the node order of both matched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from skfem import Basis, ElementTetP1, ElementTetP2, FacetBasis, MeshTet2
from skfem.mapping import MappingIsoparametric

from spindle_fem.errors import MeshQualityError, MeshTagError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh

# Highest degree that the quadrature integrates exactly. The Jacobian of a
# quadratic tetrahedron has degree 3, so volumes are exact with 4; the area
# element of a curved facet is no polynomial and takes 6.
ELEMENT_QUADRATURE_DEGREE = 4
FACET_QUADRATURE_DEGREE = 6
# Newton's last change of reference coordinates: aimed at, and what rounding may leave in thin elements.
PLACE_TOLERANCE, PLACE_ROUNDING = 1.0e-12, 1.0e-9


def tetrahedron_element(order: int) -> ElementTetP1 | ElementTetP2:
    """scikit-fem's tetrahedron of order 1 or 2."""
    return ElementTetP1() if order == 1 else ElementTetP2()


class CurvedMapping(MappingIsoparametric):
    """scikit-fem's mapping of curved elements; its inverse accepts what rounding leaves in thin ones."""

    def invF(  # noqa: N802
        self,
        x: NDArray[np.float64],
        tind: NDArray[np.int64] | None = None,
        newton_max_iters: int = 25,
        newton_tol: float = PLACE_TOLERANCE,
    ) -> NDArray[np.float64]:
        """Reference coordinates of points, by Newton's method.

        Raises
        ------
        MeshQualityError
            Elements so bent that it does not converge.
        """
        found = np.full(x.shape, 0.25)
        change = np.inf
        for _ in range(newton_max_iters):
            step = np.einsum("ijkl,jkl->ikl", self.invDF(found, tind), x - self.F(found, tind))
            found += step
            change = np.abs(step).max(initial=0.0)
            if change < newton_tol:
                break
        if not change < PLACE_ROUNDING:
            raise MeshQualityError("mesh", "elements are bent too far.", "Refine or optimise the mesh.")
        return found


@dataclass(frozen=True, slots=True)
class SkfemMesh:
    """A ``MeshTet2`` and where its unknowns are in the tagged mesh.

    Attributes
    ----------
    mesh : skfem.MeshTet2
    basis : skfem.CellBasis
    unknown_of_dof : (n_unknowns,) int64 ndarray
        Node of the tagged mesh for each degree of freedom of ``basis``.
    vertex_of_corner : (n_corners,) int64 ndarray
        scikit-fem's number of each corner node of the tagged mesh.
    """

    mesh: MeshTet2
    basis: Basis
    unknown_of_dof: NDArray[np.int64]
    vertex_of_corner: NDArray[np.int64]

    def facet_basis(self, facets: NDArray[np.int64]) -> FacetBasis:
        """scikit-fem's basis on tagged facets, for facet forms.

        Both sides of a joint have their quadrature points at the same places.

        Parameters
        ----------
        facets : (n, 6) int64 ndarray
            Quadratic triangles of the tagged mesh.

        Raises
        ------
        MeshTagError
            A triangle that is no facet of the mesh.
        """
        mapping = CurvedMapping(self.mesh, self.mesh.elem(), self.mesh.bndelem)
        return FacetBasis(
            self.mesh,
            self.basis.elem,
            mapping=mapping,
            facets=self.find_facets(facets),
            intorder=FACET_QUADRATURE_DEGREE,
        )

    def find_facets(self, facets: NDArray[np.int64]) -> NDArray[np.int64]:
        """Indices of scikit-fem facets with the same three corners."""
        n = np.int64(self.mesh.nvertices)
        known = np.sort(self.mesh.facets, axis=0).astype(np.int64)
        asked = np.sort(self.vertex_of_corner[facets[:, :3]], axis=1).T
        known_keys = (known[0] * n + known[1]) * n + known[2]
        asked_keys = (asked[0] * n + asked[1]) * n + asked[2]
        order = np.argsort(known_keys)
        place = np.minimum(np.searchsorted(known_keys, asked_keys, sorter=order), len(order) - 1)
        found = order[place]
        missing = int(np.sum(known_keys[found] != asked_keys))
        if missing:
            raise MeshTagError("facets", f"{missing} tagged triangles are no facets of the mesh.")
        return found

    def in_our_order(self, matrix: sparse.sparray) -> sparse.csr_array:
        """A matrix that scikit-fem assembled, its rows and columns numbered as the tagged mesh's nodes."""
        entries = matrix.tocoo()
        place = self.unknown_of_dof
        return sparse.csr_array((entries.data, (place[entries.row], place[entries.col])), shape=matrix.shape)


def load_into_skfem(mesh: TaggedMesh, order: int) -> SkfemMesh:
    """Curved ``MeshTet2`` with P1 or P2 unknowns.

    Parameters
    ----------
    order : int
        1 or 2.
    """
    number = _numbers(mesh)
    points = np.empty_like(mesh.points)
    points[number] = mesh.points
    tetrahedra = number[mesh.tetrahedra]
    loaded = MeshTet2(np.ascontiguousarray(points.T), np.ascontiguousarray(tetrahedra.T))
    element = tetrahedron_element(order)
    basis = Basis(loaded, element, intorder=ELEMENT_QUADRATURE_DEGREE)
    local_nodes = 4 if order == 1 else 10
    unknown_of_dof = np.empty(basis.N, dtype=np.int64)
    unknown_of_dof[basis.element_dofs.ravel()] = mesh.tetrahedra[:, :local_nodes].T.ravel()
    if not np.array_equal(np.sort(unknown_of_dof), np.arange(basis.N)):
        raise MeshTagError("mesh", "corner nodes are not numbered first, or a node belongs to no element.")
    return SkfemMesh(loaded, basis, unknown_of_dof, number[: mesh.n_corners])


def _numbers(mesh: TaggedMesh) -> NDArray[np.int64]:
    """New number of each node, in the same order on both sides of a joint.

    scikit-fem turns each facet so that its nodes' numbers rise; sides numbered in the same order then
    have quadrature points that coincide.
    """
    n = len(mesh.points)
    pairs = [np.array([joint.facets_a.ravel(), joint.facets_b.ravel()]) for joint in mesh.joints.values()]
    one, other = np.hstack(pairs) if pairs else np.empty((2, 0), dtype=np.int64)
    _, leader = connected_components(sparse.coo_array((np.ones(len(one)), (one, other)), shape=(n, n)))
    is_midside = np.arange(n) >= mesh.n_corners
    number = np.empty(n, dtype=np.int64)
    number[np.lexsort((leader, is_midside))] = np.arange(n)
    return number
