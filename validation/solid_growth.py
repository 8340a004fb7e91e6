"""Growth of one body of a machine as elasticity in three dimensions, on the tetrahedra of its thermal mesh.

Each body is free: quadratic displacements, linear temperatures, the helix of the channel cut out as meshed,
no lands made even, no mean round the axis. It shares nothing with the elastic bodies of the package but the
mesh, the temperatures and the materials.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg
from skfem.helpers import ddot, div, sym_grad

from spindle_fem.definition.solid_tables import Material
from spindle_fem.solvers.prepared_machine import PreparedMachine

Array = NDArray[np.float64]
# A corner lies on a face within this distance along the radius, m.
ON_FACE = 2.0e-4


class Solid(NamedTuple):
    """Corners of a body (3, n), its outer facets (3, m), and the shift of every corner (3, n), m."""

    points: Array
    facets: NDArray[np.int64]
    shift: Array

    def mean(self, values: Array, on: NDArray[np.bool_]) -> float:
        """Mean of values at corners over the facets that lie on some of them."""
        own = self.facets[:, on[self.facets].all(axis=0)]
        first, second, third = self.points[:, own].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross((second - first).T, (third - first).T), axis=1)
        return float(area @ values[own].mean(axis=0) / area.sum())

    def on(self, z: tuple[float, float], r: tuple[float, float]) -> NDArray[np.bool_]:
        """Corners between places along the axis and radii."""
        radius = np.hypot(*self.points[:2])
        along = (self.points[2] > z[0] - 1e-6) & (self.points[2] < z[1] + 1e-6)
        return along & (radius > r[0] - ON_FACE) & (radius < r[1] + ON_FACE)

    @property
    def outwards(self) -> Array:
        """Shift of every corner away from the axis, (n,) m."""
        return (self.points[:2] * self.shift[:2]).sum(axis=0) / np.hypot(*self.points[:2])


@dataclass(frozen=True)
class WarmBody:
    """A body and how much warmer than at assembly each of its corners is.

    Attributes
    ----------
    mesh : skfem.MeshTet
        Straight tetrahedra.
    rise : (n_corners,) ndarray, [K]
    """

    mesh: skfem.MeshTet
    rise: Array
    material: Material

    def equations(self) -> tuple[skfem.Basis, skfem.Basis, Array]:
        """Basis, stiffness [N/m] and load [N] of the free body."""
        young, poisson = self.material.young_modulus, self.material.poisson_ratio
        first_lame = young * poisson / (1.0 + poisson) / (1.0 - 2.0 * poisson)
        shear = young / 2.0 / (1.0 + poisson)
        stress = (3.0 * first_lame + 2.0 * shear) * self.material.thermal_expansion
        basis = skfem.Basis(self.mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)

        @skfem.BilinearForm
        def stiffness(u, v, w):
            return first_lame * div(u) * div(v) + 2.0 * shear * ddot(sym_grad(u), sym_grad(v))

        @skfem.LinearForm
        def expansion(v, w):
            return stress * w["rise"] * div(v)

        rise = basis.with_element(skfem.ElementTetP1()).interpolate(self.rise)
        return basis, stiffness.assemble(basis).tocsr(), expansion.assemble(basis, rise=rise)

    def solid(self, shift: Array) -> Solid:
        """The body with shifts (3, n) of its corners."""
        return Solid(self.mesh.p, self.mesh.facets[:, self.mesh.boundary_facets()], shift)


def warm_body(machine: PreparedMachine, field: Array, name: str) -> WarmBody:
    """A body of a machine at temperatures (n_corners,) [K] of its mesh.

    Parameters
    ----------
    name : str
        Of the elastic bodies: shaft, housing, a ring.
    """
    mesh, growth = machine.mesh, machine.growth
    parts = growth.bodies.parts[name]
    own = [mesh.part_names.index(part) for part in parts]
    corners = mesh.tetrahedra[np.isin(mesh.part_of_element, own)][:, :4]
    used = np.unique(corners)
    # Parts that move as one body are joined where their nodes meet.
    places = np.round(mesh.points[used] / 1e-8).astype(np.int64)
    _, first, joined = np.unique(places, axis=0, return_index=True, return_inverse=True)
    local = np.full(mesh.n_corners, -1)
    local[used] = joined.ravel()
    tetrahedra = skfem.MeshTet(
        np.ascontiguousarray(mesh.points[used][first].T), np.ascontiguousarray(local[corners].T)
    )
    rise = field[used][first] - growth.assembly_temperature
    return WarmBody(tetrahedra, rise, machine.spec.part_material(parts[0]))


def free_growth(body: WarmBody) -> Solid:
    """The free body at its temperatures; its motion as a whole is left open.

    Raises
    ------
    RuntimeError
        Conjugate gradients that do not converge.
    """
    basis, matrix, load = body.equations()
    diagonal = matrix.diagonal()
    scaled = LinearOperator(matrix.shape, matvec=lambda vector: vector / diagonal)
    # Free in space, and the load is in balance: conjugate gradients leave the rigid motion alone.
    shift, failed = cg(matrix, load, rtol=1e-6, maxiter=4000, M=scaled)
    if failed:
        raise RuntimeError("conjugate gradients did not converge")
    return body.solid(shift[basis.nodal_dofs])
