"""Straight-edged tetrahedra of an assembly by gmsh, classified face by face."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshQualityError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.cad_solids import SolidModel, build_solids, gmsh_session
from spindle_fem.machine.meshing.classify_faces import EXACT, FaceClass, classify_face
from spindle_fem.machine.meshing.size_fields import set_sizes
from spindle_fem.machine.meshing.sizes import CLEARANCE_SHARE, MeshSizes

LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class MeshedFace:
    """Triangles of one CAD face.

    Attributes
    ----------
    triangles : (n, 3) int64 ndarray
    parts : tuple of int
        The one or two parts that it bounds.
    kind : FaceClass
        Its name and its shape.
    area : float
        In the solid model, m².
    """

    triangles: NDArray[np.int64]
    parts: tuple[int, ...]
    kind: FaceClass
    area: float


@dataclass(frozen=True, slots=True)
class LinearMesh:
    """Straight-edged mesh in which neighbouring parts still share nodes.

    Attributes
    ----------
    points : (n, 3) float64 ndarray, [m]
    tetrahedra : (m, 4) int64 ndarray
    part_of_element : (m,) int32 ndarray
    circle_edges : (k, 2) int64 ndarray
        Edges on circles about the axis.
    volume : (n_parts,) float64 ndarray, [m³]
        In the solid model.
    notes : tuple of str
        Settings beyond the first that were needed.
    """

    points: NDArray[np.float64]
    tetrahedra: NDArray[np.int64]
    part_of_element: NDArray[np.int32]
    faces: tuple[MeshedFace, ...]
    circle_edges: NDArray[np.int64]
    volume: NDArray[np.float64]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt at meshing: gmsh algorithms, a factor on all sizes, chords in thin walls."""

    surface_algorithm: int
    volume_algorithm: int
    size_factor: float
    optimize_threshold: float = 0.2
    clearance_share: float = CLEARANCE_SHARE

    def describe(self) -> str:
        """Describe the attempt, for notes and logs."""
        surface = {5: "Delaunay", 6: "frontal Delaunay", 1: "MeshAdapt"}[self.surface_algorithm]
        volume = {10: "HXT", 1: "Delaunay"}[self.volume_algorithm]
        thin = "" if self.clearance_share == CLEARANCE_SHARE else ", short chords in thin walls"
        return f"{surface} surfaces, {volume} volumes, sizes x {self.size_factor:g}{thin}"


LADDER = (
    Attempt(6, 10, 1.0),
    Attempt(5, 10, 1.0),
    Attempt(6, 10, 1.0, clearance_share=0.15),
    Attempt(6, 10, 0.85, 0.35),
    Attempt(5, 10, 0.7, 0.35),
    Attempt(6, 1, 0.7, 0.35),
)


def mesh_once(assembly: AssemblyGeometry, sizes: MeshSizes, attempt: Attempt, threads: int) -> LinearMesh:
    """Mesh with one set of settings.

    Raises
    ------
    MeshQualityError
        gmsh could not mesh the model.
    MeshTagError
        A face cannot be classified.
    """
    import gmsh

    with gmsh_session(threads) as geometry:
        solids = build_solids(assembly, geometry)
        _set_options(attempt, threads)
        set_sizes(assembly, sizes.scaled(attempt.size_factor), attempt.clearance_share)
        try:
            gmsh.model.mesh.generate(3)
        except Exception as error:  # gmsh raises nothing more specific
            raise MeshQualityError(
                "mesh",
                f"gmsh failed with {attempt.describe()}: {error}.",
                "Change mesh.preset or mesh.size_factor.",
            ) from error
        return _read(assembly, solids)


def _set_options(attempt: Attempt, threads: int) -> None:
    import gmsh

    for name, value in (
        ("Mesh.Algorithm", attempt.surface_algorithm),
        ("Mesh.Algorithm3D", attempt.volume_algorithm),
        ("Mesh.MaxNumThreads1D", threads),
        ("Mesh.MaxNumThreads2D", threads),
        ("Mesh.MaxNumThreads3D", threads),
        ("Mesh.MeshSizeExtendFromBoundary", 1),
        ("Mesh.MeshSizeFromPoints", 1),
        ("Mesh.OptimizeThreshold", attempt.optimize_threshold),
        ("Mesh.RandomSeed", 1),
    ):
        gmsh.option.setNumber(name, value)


def _read(assembly: AssemblyGeometry, solids: SolidModel) -> LinearMesh:
    import gmsh

    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = np.asarray(coordinates).reshape(-1, 3)
    index_of = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    index_of[tags] = np.arange(len(tags))
    part_of_volume = {solids.volume_of_part[name]: index for index, name in enumerate(assembly.part_names)}
    tetrahedra, owners = [], []
    for name, volume in solids.volume_of_part.items():
        _, nodes = gmsh.model.mesh.getElementsByType(4, volume)
        if len(nodes) == 0:
            raise MeshQualityError("mesh", f'part "{name}" has no elements.', "Change mesh.preset.")
        tetrahedra.append(index_of[nodes].reshape(-1, 4))
        owners.append(np.full(len(nodes) // 4, part_of_volume[volume], dtype=np.int32))
    faces = []
    for _, tag in gmsh.model.getEntities(2):
        _, nodes = gmsh.model.mesh.getElementsByType(2, tag)
        triangles = index_of[nodes].reshape(-1, 3)
        above = gmsh.model.getAdjacencies(2, tag)[0]
        parts = tuple(sorted(part_of_volume[volume] for volume in above))
        used = points[np.unique(triangles)]
        kind = classify_face(assembly, used, tuple(assembly.part_names[part] for part in parts))
        faces.append(MeshedFace(triangles, parts, kind, gmsh.model.occ.getMass(2, tag)))
    circles = []
    for _, tag in gmsh.model.getEntities(1):
        _, nodes = gmsh.model.mesh.getElementsByType(1, tag)
        edges = index_of[nodes].reshape(-1, 2)
        radius = np.hypot(*points[edges.ravel(), :2].T)
        z = points[edges.ravel(), 2]
        if np.ptp(radius) < EXACT and np.ptp(z) < EXACT:
            circles.append(edges)
    tetrahedra_array = np.concatenate(tetrahedra)
    owners_array = np.concatenate(owners)
    used_nodes = np.unique(tetrahedra_array)
    compact = np.full(len(points), -1, dtype=np.int64)
    compact[used_nodes] = np.arange(len(used_nodes))
    return LinearMesh(
        points[used_nodes],
        compact[tetrahedra_array],
        owners_array,
        tuple(MeshedFace(compact[face.triangles], face.parts, face.kind, face.area) for face in faces),
        compact[np.concatenate(circles)] if circles else np.empty((0, 2), dtype=np.int64),
        np.array([solids.volume[name] for name in assembly.part_names]),
    )
