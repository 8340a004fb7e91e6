"""Triangles and edges to draw: curved faces of a tagged mesh as flat triangles, sharp edges.

Plain numpy on the mesh's own arrays. Curved (six-node) triangles are drawn as
four flat ones with the normals of the curved surface.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh

# Corners 0-2, then the middles of edges 01, 12, 20.
TRIANGLE_SPLIT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
_TETRAHEDRON_FACES = ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 3, 2, 7, 9, 6))
_TRIANGLE_NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])


@dataclass(frozen=True, slots=True)
class TriangleSet:
    """Flat triangles with values at their points.

    Attributes
    ----------
    points : (n, 3) float64 ndarray, [m]
    triangles : (m, 3) int64 ndarray
    values : (n, k) float64 ndarray
        Requested quantity, for example temperature in K.
    label : (m,) int32 ndarray
        Part or surface that each triangle belongs to.
    normals : (n, 3) float64 ndarray or None
        Unit normals of the curved surface, out of the part.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    values: NDArray[np.float64]
    label: NDArray[np.int32]
    normals: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True)
class SegmentSet:
    """Straight segments: ``points`` (m, 2, 3) in m, ``values`` (m, 2, k), ``label`` (m,)."""

    points: NDArray[np.float64]
    values: NDArray[np.float64]
    label: NDArray[np.int32]


def facet_normals(points: NDArray[np.float64], facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals of quadratic triangles at their six nodes.

    Parameters
    ----------
    points : (n_nodes, 3) ndarray, [m]
    facets : (n, 6) ndarray of int

    Returns
    -------
    (n, 6, 3) ndarray, [-]
    """
    u, v = _TRIANGLE_NODES.T
    w = 1.0 - u - v
    zero = np.zeros_like(u)
    along_u = np.stack([1.0 - 4.0 * w, 4.0 * u - 1.0, zero, 4.0 * (w - u), 4.0 * v, -4.0 * v], axis=1)
    along_v = np.stack([1.0 - 4.0 * w, zero, 4.0 * v - 1.0, -4.0 * u, 4.0 * u, 4.0 * (w - v)], axis=1)
    corners = points[facets]
    normals = np.cross(
        np.einsum("ij,njk->nik", along_u, corners), np.einsum("ij,njk->nik", along_v, corners), axis=2
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1.0e-300)


def exposed_triangles(
    mesh: TaggedMesh, values: NDArray[np.float64], surfaces: Iterable[str] | None = None
) -> TriangleSet:
    """Exposed faces as flat triangles that shade like the curved ones.

    Parameters
    ----------
    values : (n_nodes,) or (n_nodes, k) ndarray
    surfaces : iterable of str, optional
        Names of the surfaces; all exposed ones when left out.

    Returns
    -------
    TriangleSet
        ``label`` is the index of the part in ``mesh.part_names``.
    """
    names = list(mesh.surfaces if surfaces is None else surfaces)
    part_index = {name: index for index, name in enumerate(mesh.part_names)}
    facets = _stack([mesh.surfaces[name] for name in names], 6)
    owner = _repeat(
        [part_index[mesh.part_of_surface[name]] for name in names], [len(mesh.surfaces[n]) for n in names]
    )
    return facet_triangles(mesh.points, facets, np.reshape(values, (len(mesh.points), -1))[facets], owner)


def facet_triangles(
    points: NDArray[np.float64],
    facets: NDArray[np.int64],
    facet_values: NDArray[np.float64],
    label: NDArray[np.int32],
) -> TriangleSet:
    """Four flat triangles for each quadratic one; facets share no points.

    ``facet_values`` is (n, 6, k), at the nodes of each facet.
    """
    number = len(facets)
    first = 6 * np.arange(number)[:, None, None]
    return TriangleSet(
        points=points[facets].reshape(-1, 3),
        triangles=(first + TRIANGLE_SPLIT).reshape(-1, 3),
        values=facet_values.reshape(6 * number, -1),
        label=np.repeat(np.asarray(label, dtype=np.int32), 4),
        normals=facet_normals(points, facets).reshape(-1, 3),
    )


def sharp_edges(
    points: NDArray[np.float64], facets: NDArray[np.int64], label: NDArray[np.int32], angle_deg: float = 25.0
) -> SegmentSet:
    """Edges where facets that share nodes meet at more than ``angle_deg``; curved edges as two segments."""
    normals = facet_normals(points, facets)
    ends = np.concatenate([facets[:, [0, 1, 3]], facets[:, [1, 2, 4]], facets[:, [2, 0, 5]]])
    at_middle = np.concatenate([normals[:, 3], normals[:, 4], normals[:, 5]])
    label = np.tile(label, 3)
    key = ends[:, :2].min(axis=1) * len(points) + ends[:, :2].max(axis=1)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    first, second = order[:-1][same], order[1:][same]
    sharp = np.einsum("ij,ij->i", at_middle[first], at_middle[second]) < np.cos(np.radians(angle_deg))
    chosen = first[sharp]
    lines = np.concatenate([ends[chosen][:, [0, 2]], ends[chosen][:, [2, 1]]])
    return SegmentSet(points[lines], np.zeros((len(lines), 2, 0)), np.tile(label[chosen], 2))


def part_edges(mesh: TaggedMesh, angle_deg: float = 25.0) -> SegmentSet:
    """Sharp edges of every part."""
    return sharp_edges(mesh.points, *all_facets(mesh), angle_deg)


def facet_edges(points: NDArray[np.float64], facets: NDArray[np.int64]) -> SegmentSet:
    """Every element edge of quadratic triangles once, as two segments."""
    ends = np.concatenate([facets[:, [0, 1, 3]], facets[:, [1, 2, 4]], facets[:, [2, 0, 5]]])
    _, first = np.unique(ends[:, 2], return_index=True)
    ends = ends[first]
    lines = np.concatenate([ends[:, [0, 2]], ends[:, [2, 1]]])
    return SegmentSet(points[lines], np.zeros((len(lines), 2, 0)), np.zeros(len(lines), dtype=np.int32))


def element_faces(mesh: TaggedMesh, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Outer faces (n, 6) of the chosen elements, and the part of each."""
    return outer_faces(mesh.tetrahedra[chosen], mesh.part_of_element[chosen])


def outer_faces(
    tetrahedra: NDArray[np.int64], part_of_element: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Faces (n, 6) of quadratic tetrahedra (e, 10) that belong to one of them alone, and the part of each."""
    faces = np.concatenate([tetrahedra[:, face] for face in _TETRAHEDRON_FACES])
    part = np.tile(part_of_element, len(_TETRAHEDRON_FACES))
    # The three edge middles name a face as well as its corners do.
    key = np.sort(faces[:, 3:], axis=1) @ np.array([1, int(tetrahedra.max()) + 1, 0], dtype=np.int64)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    single = np.ones(len(key), dtype=bool)
    single[order[1:][same]] = False
    single[order[:-1][same]] = False
    return faces[single], part[single]


def all_facets(mesh: TaggedMesh) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Every facet (n, 6) of every part, those in joints included, and its part."""
    part_index = {name: index for index, name in enumerate(mesh.part_names)}
    facets = [*mesh.surfaces.values()]
    owner = [part_index[mesh.part_of_surface[name]] for name in mesh.surfaces]
    part_of_node = np.zeros(len(mesh.points), dtype=np.int32)
    part_of_node[mesh.tetrahedra] = mesh.part_of_element[:, None]
    labels = [np.full(len(item), index, dtype=np.int32) for item, index in zip(facets, owner, strict=True)]
    for joint in mesh.joints.values():
        for side in (joint.facets_a, joint.facets_b):
            facets.append(side)
            labels.append(part_of_node[side[:, 0]])
    return _stack(facets, 6), np.concatenate([np.zeros(0, np.int32), *labels])


def compact(shape: TriangleSet) -> TriangleSet:
    """Without the points that no triangle uses."""
    used = np.zeros(len(shape.points), dtype=bool)
    used[shape.triangles] = True
    renumber = np.cumsum(used) - 1
    return TriangleSet(
        shape.points[used],
        renumber[shape.triangles],
        shape.values[used],
        shape.label,
        None if shape.normals is None else shape.normals[used],
    )


def _stack(arrays: list[NDArray[np.int64]], width: int) -> NDArray[np.int64]:
    return np.concatenate([np.zeros((0, width), dtype=np.int64), *arrays])


def _repeat(labels: list[int], counts: list[int]) -> NDArray[np.int32]:
    return np.repeat(np.asarray(labels, dtype=np.int32), counts)
