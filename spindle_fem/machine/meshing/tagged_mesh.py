"""The mesh that every later stage reads: named parts, named surfaces, joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import UnknownSurfaceError, did_you_mean


@dataclass(frozen=True, slots=True)
class Joint:
    """Two coincident faces of different parts, with nodes of their own.

    Attributes
    ----------
    name : str
        ``"part_a|part_b"`` of a cylindrical contact, for example
        ``"F1.inner_ring|shaft"``, and ``"part_a|part_b:face"`` of a plane one;
        parts in sorted order. One joint may hold several separate faces.
    facets_a, facets_b : (n, 6) int64 ndarray
        Nodes of each quadratic triangle (three corners, then the middles of
        edges 01, 12, 20); row ``i`` and column ``j`` of both lie at the same
        point.
    """

    name: str
    facets_a: NDArray[np.int64]
    facets_b: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TaggedMesh:
    """Curved (second-order) tetrahedra with names for parts, surfaces and joints.

    Parts never share a node: where two touch, the nodes are doubled and the
    pair of faces is listed in ``joints``. Segments of one part share nodes.

    Attributes
    ----------
    points : (n_nodes, 3) float64 ndarray, [m]
        Corner nodes first, then edge middles; z is the axis, θ = 0 along +y
        (up), θ turning from +y towards −x when seen from the nose is fixed by
        ``r cos θ = y, r sin θ = -x`` (right-handed about +z).
    n_corners : int
        Number of leading points that are element corners.
    tetrahedra : (n_elements, 10) int64 ndarray; (n_elements, 4) for a linear mesh
        Corners 0–3, then middles of edges 01, 12, 02, 03, 13, 23 (the order
        of scikit-fem's quadratic tetrahedron); positive volume.
    part_of_element : (n_elements,) int32 ndarray
        Index into ``part_names``.
    surfaces : mapping of str to (n, 6) int64 ndarray
        Quadratic triangles of each named exposed surface, corners ordered so
        that the normal points out of the part. Together with the joints they
        cover every boundary facet exactly once.
    joints : mapping of str to Joint
    part_of_surface : mapping of str to str
    cad_area : mapping of str to float, [m²]
        Area of each surface and joint in the solid model.
    cad_volume : mapping of str to float, [m³]
        Volume of each part in the solid model.
    rotating : mapping of str to bool
        Whether a part turns with the shaft.
    min_quality : float
        Smallest gmsh minSICN over all elements after curving.
    digest : str
        Hash of the geometry, sizes and library versions that made the mesh.
    notes : tuple of str
        What was decided on the way: ports drilled narrower, other mesh
        settings than the first.
    """

    points: NDArray[np.float64]
    n_corners: int
    tetrahedra: NDArray[np.int64]
    part_names: tuple[str, ...]
    part_of_element: NDArray[np.int32]
    surfaces: Mapping[str, NDArray[np.int64]]
    joints: Mapping[str, Joint]
    part_of_surface: Mapping[str, str]
    cad_area: Mapping[str, float]
    cad_volume: Mapping[str, float]
    rotating: Mapping[str, bool]
    min_quality: float
    digest: str = field(default="")
    notes: tuple[str, ...] = ()

    @property
    def n_elements(self) -> int:
        """Number of tetrahedra."""
        return len(self.tetrahedra)

    def require_surface(self, name: str, where: str) -> NDArray[np.int64]:
        """Facets of a named surface.

        Raises
        ------
        UnknownSurfaceError
            The mesh has no such surface.
        """
        if name not in self.surfaces:
            raise UnknownSurfaceError(
                where, f'names "{name}", not in this mesh.', did_you_mean(name, self.surfaces)
            )
        return self.surfaces[name]
