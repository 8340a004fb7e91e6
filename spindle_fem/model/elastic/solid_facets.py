"""Facets of a mesh in three dimensions: means of fields, loads of tractions, and rigid motions that fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.elastic.elastic_body import Face
from spindle_fem.model.elastic.solid_body import joined_parts, rigid_motions
from spindle_fem.model.mesh.element_integrals import triangle_table

Array = NDArray[np.float64]
# Nodes of a face of revolution lie on it within this distance, m.
ON_FACE = 1.0e-6


@dataclass(frozen=True)
class Facets:
    """Quadratic triangles, at their quadrature points.

    Attributes
    ----------
    mesh_points : (n_nodes, 3) ndarray, [m]
    nodes : (n_facets, 6) int64 ndarray
    """

    mesh_points: Array
    nodes: NDArray[np.int64]

    def at(self, field: Array) -> Array:
        """A field (n_nodes, k) at the quadrature points, (n, k)."""
        values = triangle_table(2).values
        return (values @ field[self.nodes]).reshape(-1, field.shape[1])

    @cached_property
    def points(self) -> Array:
        """Quadrature points, (n, 3) m."""
        return self.at(self.mesh_points)

    @cached_property
    def weights(self) -> Array:
        """Area of each quadrature point, (n,) m²."""
        table, corners = triangle_table(2), self.mesh_points[self.nodes]
        first, second = (np.einsum("qi,fia->fqa", table.gradients[:, :, k], corners) for k in range(2))
        return (np.linalg.norm(np.cross(first, second), axis=2) * table.weights).ravel()

    @cached_property
    def outwards(self) -> Array:
        """Unit vectors away from the axis, (n, 3)."""
        radial = self.points * [1.0, 1.0, 0.0]
        return radial / np.linalg.norm(radial, axis=1)[:, None]

    @property
    def centre(self) -> Array:
        """Area mean of the places, (3,) m."""
        return self.mean(self.points)

    def mean(self, values: Array) -> Array:
        """Area mean of values (n,) or (n, k) at the quadrature points."""
        return self.weights @ values / self.weights.sum()

    def shift(self, field: Array) -> Array:
        """Area mean (3,) of a displacement (n_nodes, 3)."""
        return self.mean(self.at(field))

    def growth(self, field: Array) -> float:
        """Area mean of the shift away from the axis, m."""
        return float(self.mean((self.at(field) * self.outwards).sum(axis=1)))

    def load(self, traction: Array) -> Array:
        """Forces (n_nodes, 3) [N] of a traction (n, 3) [Pa] at the quadrature points."""
        values = triangle_table(2).values
        forces = (traction * self.weights[:, None]).reshape(len(self.nodes), -1, 3)
        found = np.zeros_like(self.mesh_points)
        np.add.at(found, self.nodes, np.einsum("qi,fqa->fia", values, forces))
        return found

    def rigid_fit(self, wanted: Array) -> Array:
        """Rigid motion (6,), shift and turn, nearest to ``wanted`` (n, 3) [m] in the area's mean."""
        motions = rigid_motions(self.points)
        root = np.sqrt(self.weights)
        rows = (motions * root[:, None, None]).reshape(-1, 6)
        return np.linalg.lstsq(rows, (wanted * root[:, None]).ravel(), rcond=None)[0]


def outside_of(mesh: TaggedMesh, parts: Sequence[str]) -> NDArray[np.int64]:
    """Facets (n, 6) on the surfaces of parts and in joints with other parts."""
    exposed = [facets for name, facets in mesh.surfaces.items() if mesh.part_of_surface[name] in parts]
    return np.concatenate([*exposed, met(mesh, parts, set(mesh.part_names) - set(parts))[0].nodes])


def lie_on(points: Array, face: Face) -> NDArray[np.bool_]:
    """Which groups of points (n, m, 3) lie on a face of revolution, (n,)."""
    inside = np.ones(len(points), dtype=bool)
    places = (points[..., 2], np.hypot(points[..., 0], points[..., 1]))
    for values, (low, high) in zip(places, (face.z, face.r), strict=True):
        inside &= np.all((values > low - ON_FACE) & (values < high + ON_FACE), axis=1)
    return inside


def on_face(mesh: TaggedMesh, parts: Sequence[str], face: Face) -> Facets:
    """Facets of parts on a face of revolution.

    Raises
    ------
    GeometryError
        There are none.
    """
    facets = outside_of(mesh, parts)
    facets = facets[lie_on(mesh.points[facets[:, :3]], face)]
    if not len(facets):
        raise GeometryError(
            ", ".join(parts),
            f"the mesh has no facet at z {face.z}, r {face.r} m.",
            "Give a face of the body.",
        )
    return Facets(mesh.points, facets)


def met(mesh: TaggedMesh, parts: Collection[str], others: Collection[str]) -> tuple[Facets, Facets]:
    """Facets of parts where they touch others, and those of the others, at the same places in turn."""
    pairs = []
    for name, joint in mesh.joints.items():
        one, other = joined_parts(name)
        if one in parts and other in others:
            pairs.append((joint.facets_a, joint.facets_b))
        elif other in parts and one in others:
            pairs.append((joint.facets_b, joint.facets_a))
    none = np.empty((0, 6), dtype=np.int64)
    mine, theirs = (np.concatenate([none, *(pair[k] for pair in pairs)]) for k in range(2))
    return Facets(mesh.points, mine), Facets(mesh.points, theirs)
