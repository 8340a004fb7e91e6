"""A mesh whose faces have moved a little, on the same elements: dimensions that differ from the drawing.

Moved cylinders and planes carry their neighbourhood along: the displacement within is harmonic, radially
with every cylinder held where it belongs, axially with every plane. The parts of a contact move together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU, splu

from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.mesh_operators import prolongation_from_corners
from spindle_fem.model.mesh.thermal_operators import ThermalOperators

Array = NDArray[np.float64]
Nodes = NDArray[np.int64]

# Corners of a face of one radius or one place along the axis differ by less, m.
FACE_TOLERANCE = 1e-7


@dataclass(frozen=True, slots=True)
class MovedFace:
    """An exposed face of a part and how far it moves for one unit.

    Attributes
    ----------
    shape : {"cylinder", "plane"}
        Moved along r, or along z.
    place : float, [m]
        Its radius, or its place along the axis.
    extent : (float, float), [m]
        Of it along the axis, or of its radius.
    distance : float, [m]
    """

    part: str
    shape: Literal["cylinder", "plane"]
    place: float
    extent: tuple[float, float]
    distance: float


@dataclass(frozen=True, slots=True)
class MovedChannel:
    """Movement of the cooling channel's walls per unit, m: inner and outer along r, all along z."""

    inner: float = 0.0
    outer: float = 0.0
    axial: float = 0.0


class MovableMesh:
    """A mesh with the displacements that its faces may have.

    Parameters
    ----------
    operators : ThermalOperators
        Of order 1.
    channel : (str, float, float) or None
        Part of the cooling channel, radii of its inner and outer wall [m].
    """

    def __init__(self, operators: ThermalOperators, channel: tuple[str, float, float] | None = None) -> None:
        self.operators, self.mesh, self.channel = operators, operators.mesh, channel
        corners = self.mesh.points[: self.mesh.n_corners]
        self.radius, self.z = np.hypot(corners[:, 0], corners[:, 1]), corners[:, 2]
        self._channel_nodes = self._wetted()
        self._cylinders = self._nodes_of("cylinder")
        self._planes = self._nodes_of("plane")

    # ---------------------------------------------------------------- faces
    def _wetted(self) -> Nodes:
        if self.channel is None:
            return np.zeros(0, dtype=np.int64)
        wall = self.mesh.surfaces[f"{self.channel[0]}.channel_wall"]
        return np.unique(wall[:, :3])

    def _is(self, facets: Nodes, shape: str) -> NDArray[np.bool_]:
        coordinate = (self.radius if shape == "cylinder" else self.z)[facets]
        return np.ptp(coordinate, axis=1) < FACE_TOLERANCE

    def _boundary(self) -> list[Nodes]:
        sides = [side for joint in self.mesh.joints.values() for side in (joint.facets_a, joint.facets_b)]
        return [facets[:, :3] for facets in (*self.mesh.surfaces.values(), *sides)]

    def _nodes_of(self, shape: str) -> Nodes:
        """Corner nodes on faces of a shape."""
        return np.unique(np.concatenate([f[self._is(f, shape)].ravel() for f in self._boundary()]))

    def nodes_of(self, face: MovedFace) -> Nodes:
        """Corner nodes of an exposed face.

        Raises
        ------
        GeometryError
            The part has no exposed face there.
        """
        found = []
        along, across = (self.radius, self.z) if face.shape == "cylinder" else (self.z, self.radius)
        for name, facets in self.mesh.surfaces.items():
            if self.mesh.part_of_surface[name] == face.part:
                own = facets[:, :3][self._is(facets[:, :3], face.shape)]
                middle = across[own].mean(axis=1)
                there = np.abs(along[own] - face.place).max(axis=1, initial=0.0) < FACE_TOLERANCE
                there &= (middle > face.extent[0]) & (middle < face.extent[1])
                found.append(own[there].ravel())
        nodes = np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)
        if not nodes.size:
            raise GeometryError(
                f'part "{face.part}"', f"has no exposed {face.shape} at {face.place * 1e3:g} mm."
            )
        return nodes

    # --------------------------------------------------------- displacements
    @cached_property
    def _weld(self) -> NDArray[np.int64]:
        """Number of the common node of corners that touch, (n_corners,)."""
        pairs = np.concatenate(
            [
                np.column_stack((joint.facets_a[:, :3].ravel(), joint.facets_b[:, :3].ravel()))
                for joint in self.mesh.joints.values()
            ]
            or [np.zeros((0, 2), dtype=np.int64)]
        )
        n = self.mesh.n_corners
        graph = sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
        return connected_components(graph, directed=False)[1]

    @cached_property
    def _stiffness(self) -> sparse.csr_array:
        """Stiffness of the Laplace operator on welded nodes."""
        n = self.mesh.n_corners
        weld = sparse.csr_array((np.ones(n), (np.arange(n), self._weld)))
        matrix = self.operators.matrix(self.operators.conduction)
        return (weld.T @ matrix @ weld).tocsr()

    @cached_property
    def _radially(self) -> tuple[NDArray[np.bool_], SuperLU]:
        return self._extension(np.union1d(self._cylinders, self._channel_nodes))

    @cached_property
    def _axially(self) -> tuple[NDArray[np.bool_], SuperLU]:
        return self._extension(np.union1d(self._planes, self._channel_nodes))

    def _extension(self, held: Nodes) -> tuple[NDArray[np.bool_], SuperLU]:
        """Welded nodes that are held, and the factor of the rest."""
        fixed = np.zeros(self._stiffness.shape[0], dtype=bool)
        fixed[self._weld[held]] = True
        rest = self._stiffness[~fixed][:, ~fixed].tocsc()
        return fixed, splu(rest, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def _extended(self, extension: tuple[NDArray[np.bool_], SuperLU], given: Array) -> Array:
        """Displacement of every corner from that of the held ones (n_corners,), which is 0 elsewhere."""
        fixed, factor = extension
        welded = np.zeros(len(fixed))
        moved = np.flatnonzero(given)
        welded[self._weld[moved]] = given[moved]
        welded[~fixed] = factor.solve(-(self._stiffness[~fixed][:, fixed] @ welded[fixed]))
        return welded[self._weld]

    def displacement(
        self, faces: Sequence[MovedFace], channel: MovedChannel | None = None
    ) -> tuple[Array, Array]:
        """Displacement of every corner along r and along z for one unit, (n_corners,) m each.

        Raises
        ------
        GeometryError
            A face that is not there, or a channel that the mesh does not have.
        """
        radial, axial = np.zeros((2, self.mesh.n_corners))
        for face in faces:
            (radial if face.shape == "cylinder" else axial)[self.nodes_of(face)] = face.distance
        if channel is not None:
            if self.channel is None:
                raise GeometryError("channel", "this machine has none.")
            nodes, (_, inner, outer) = self._channel_nodes, self.channel
            share = (self.radius[nodes] - inner) / (outer - inner)
            radial[nodes] = channel.inner + share * (channel.outer - channel.inner)
            axial[nodes] = channel.axial
        return tuple(
            self._extended(getattr(self, way), given) if given.any() else given
            for way, given in (("_radially", radial), ("_axially", axial))
        )

    def moved(self, displacement: tuple[Array, Array], amount: float) -> TaggedMesh:
        """The mesh with some units of a displacement; middles of edges follow their ends."""
        points = self.mesh.points
        along = self.mesh_prolongation @ np.column_stack(displacement) * amount
        radius = np.hypot(points[:, 0], points[:, 1])
        stretch = 1.0 + along[:, 0] / np.maximum(radius, np.finfo(float).tiny)
        stretch = np.where(radius > 0.0, stretch, 1.0)
        moved = np.column_stack((points[:, :2] * stretch[:, None], points[:, 2] + along[:, 1]))
        return replace(self.mesh, points=moved, digest="")

    @cached_property
    def mesh_prolongation(self) -> sparse.csr_array:
        """Prolongation from corners to all nodes."""
        if len(self.mesh.points) == self.mesh.n_corners:
            return sparse.eye_array(self.mesh.n_corners, format="csr")
        return prolongation_from_corners(self.mesh)
