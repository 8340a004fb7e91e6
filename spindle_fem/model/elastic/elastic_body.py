"""One body of revolution: its stiffness, factored, and shifts of its faces by any cause.

A shift of a face is a linear output J(u) of the displacement. K λ = J is solved once; by
reciprocity λ then gives the output for every load: an inner product with a temperature field, with
the centrifugal load, with a pressure on any other face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu
from skfem import Basis, ElementQuad1, ElementQuad2, ElementVector, FacetBasis

from spindle_fem.errors import GeometryError
from spindle_fem.machine.geometry.faces import revolved_area
from spindle_fem.model.elastic import forms
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.physics.elasticity.elastic_material import Stiffness

Array = NDArray[np.float64]
# Highest degree that the quadrature of biquadratic elements integrates exactly, radius included.
QUADRATURE_DEGREE = 5
ON_LINE = 1.0e-9


@dataclass(frozen=True, slots=True)
class Face:
    """A face of revolution: a line in the meridian plane.

    Attributes
    ----------
    z, r : (low, high), [m]
        Equal bounds of one of them.
    """

    z: tuple[float, float]
    r: tuple[float, float]

    @property
    def area(self) -> float:
        """m²."""
        return revolved_area(self.z, self.r)


@dataclass(frozen=True)
class ElasticBody:
    """A body in one harmonic of the angle.

    Attributes
    ----------
    stiffnesses : sequence of Stiffness
        Of every region of the section.
    harmonic : int
        0: stretched evenly round the axis; 1: bent, its sections shifted upwards.
    twin : ElasticBody, optional
        The same body at another place of the axis: what does not depend on the place is worked out there.
    """

    name: str
    section: MeridianMesh
    stiffnesses: Sequence[Stiffness]
    harmonic: int = 0
    twin: ElasticBody | None = None

    def __post_init__(self) -> None:
        assert self.twin is None or self.twin.harmonic == self.harmonic

    def moved(self, name: str, distance: float) -> ElasticBody:
        """A twin of this body, further along the axis by a distance in m."""
        return replace(self, name=name, section=self.section.moved(distance), twin=self)

    @cached_property
    def basis(self) -> Basis:
        """Biquadratic displacements, two components or three; of a twin at the place of the first."""
        if self.twin is not None:
            return self.twin.basis
        element = ElementVector(ElementQuad2(), dim=3 if self.harmonic else 2)
        return Basis(self.section.mesh, element, intorder=QUADRATURE_DEGREE)

    @cached_property
    def coefficients(self) -> dict[str, Array]:
        """Elastic constants of every element, as the forms take them."""
        if self.twin is not None:
            return self.twin.coefficients
        region = self.section.region
        stack = {
            name: np.array([getattr(s, name) for s in self.stiffnesses])[region]
            for name in ("normal", "shear", "thermal", "density")
        }
        return {name: np.moveaxis(values, 0, -1)[..., None] for name, values in stack.items()}

    @cached_property
    def _held(self) -> NDArray[np.int64]:
        """Unknowns held so that the body cannot move as a whole; loads in balance do not pull at them."""
        where, last = self.basis.doflocs, self.section.mesh.nvertices - 1
        nodal = self.basis.nodal_dofs
        if not self.harmonic:
            return nodal[0, :1]
        assert where[1, nodal[0, last]] > 0.0
        return np.array([nodal[2, 0], nodal[0, last]])

    @cached_property
    def _factor(self) -> tuple[SuperLU, NDArray[np.int64]]:
        if self.twin is not None:
            return self.twin._factor
        matrix = self.stiffness_matrix()
        free = np.setdiff1d(np.arange(self.basis.N), self._held)
        return splu(matrix[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0), free

    def stiffness_matrix(self) -> sparse.csr_matrix:
        """Stiffness over all unknowns, none constrained, [N/m]."""
        normal, shear = (self.coefficients[name][..., 0] for name in ("normal", "shear"))
        return forms.stiffness_matrix(self.basis, self.harmonic, normal, shear)

    def solve(self, load: Array) -> Array:
        """Displacement (n,) under a load (n,) in balance [N]."""
        factor, free = self._factor
        found = np.zeros(self.basis.N)
        found[free] = factor.solve(load[free])
        return found

    @cached_property
    def spin_load(self) -> Array:
        """Centrifugal load of 1 rad/s, to be multiplied by the speed squared, N s²."""
        if self.twin is not None:
            return self.twin.spin_load
        density = np.broadcast_to(self.coefficients["density"], self.basis.dx.shape)
        return forms.rotation.assemble(self.basis, density=density)

    def mean_shift(self, face: Face, direction: Sequence[float], *, lever: bool = False) -> Array:
        """Output: area mean of the displacement's amplitude along (z, r, θ) over a face.

        Parameters
        ----------
        direction : sequence of float
            A body moved up by 1 shifts by 1 along (0, 1/2, -1/2) in the first harmonic.
        lever : bool
            Whether to multiply by the radius (m), for turns of a plane face.

        Raises
        ------
        GeometryError
            A face that is not on this body.
        """
        basis = self._on(face)
        load = forms.mean_shift.assemble(basis, direction=tuple(direction), lever=int(lever))
        return load / float(np.sum(basis.dx * basis.default_parameters()["x"][1]))

    def middle_of(self, face: Face) -> tuple[float, float]:
        """Area means of z and of r over a face, m."""
        basis = self._on(face)
        z, r = basis.default_parameters()["x"]
        weight = basis.dx * r / float(np.sum(basis.dx * r))
        return float(np.sum(weight * z)) + self._beyond_twin, float(np.sum(weight * r))

    @cached_property
    def _faces(self) -> dict[Face, FacetBasis]:
        return {}

    def _on(self, face: Face) -> FacetBasis:
        """Sides of elements on the boundary that make up a face."""
        if self.twin is not None:
            return self.twin._on(Face(tuple(z - self._beyond_twin for z in face.z), face.r))
        if face not in self._faces:
            self._faces[face] = self._sides(face)
        return self._faces[face]

    @property
    def _beyond_twin(self) -> float:
        """How much further along the axis than the twin it lies, m."""
        return 0.0 if self.twin is None else float(self.section.z[0] - self.twin.section.z[0])

    def _sides(self, face: Face) -> FacetBasis:
        middle = self.section.mesh.p[:, self.section.mesh.facets].mean(axis=1)
        inside = np.ones(middle.shape[1], dtype=bool)
        for values, (low, high) in zip(middle, (face.z, face.r), strict=True):
            inside &= (values > low - ON_LINE) & (values < high + ON_LINE)
        facets = np.flatnonzero(inside)
        boundary = np.intersect1d(facets, self.section.mesh.boundary_facets())
        if not len(boundary):
            raise GeometryError(
                self.name, f"no face at z {face.z}, r {face.r} m.", "Give a face of the body."
            )
        return FacetBasis(self.section.mesh, self.basis.elem, facets=boundary, intorder=QUADRATURE_DEGREE)

    def side_at(self, z: float, r: float) -> Face:
        """The boundary's element side nearest to a spot."""
        points = self.section.mesh.p[:, self.section.mesh.facets[:, self.section.mesh.boundary_facets()]]
        nearest = np.argmin(np.hypot(*(points.mean(axis=1) - np.array([[z], [r]]))))
        low, high = points[:, :, nearest].min(axis=1), points[:, :, nearest].max(axis=1)
        return Face(*zip(low.tolist(), high.tolist(), strict=True))

    @cached_property
    def expansion_load(self) -> sparse.csr_array:
        """Load (n_unknowns, n_corners) of a kelvin at each corner of the section's cells, N/K."""
        if self.twin is not None:
            return self.twin.expansion_load
        corners = Basis(self.section.mesh, ElementQuad1(), quadrature=self.basis.quadrature)
        thermal = np.broadcast_to(self.coefficients["thermal"], (3, *self.basis.dx.shape))
        return forms.expansion.assemble(corners, self.basis, harmonic=self.harmonic, thermal=thermal)
