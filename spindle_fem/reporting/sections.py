"""Triangles to draw: curved faces, plane sections and sharp edges of a tagged mesh.

Plain numpy on the mesh's own arrays; nothing here runs a filter over the
whole volume. Curved (six-node) triangles are drawn as four flat ones with the
normals of the curved surface, sections cut the quadratic field.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.meshing.tagged_mesh import TaggedMesh

# Corners 0-2, then the middles of edges 01, 12, 20.
TRIANGLE_SPLIT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
# Corners 0-3, then the middles of edges 01, 12, 02, 03, 13, 23.
_TETRAHEDRON_SPLIT = np.array(
    [
        [0, 4, 6, 7],
        [4, 1, 5, 8],
        [6, 5, 2, 9],
        [7, 8, 9, 3],
        [4, 9, 5, 6],
        [4, 9, 6, 7],
        [4, 9, 7, 8],
        [4, 9, 8, 5],
    ]
)
_EDGE_ENDS = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
VISIBLE_BEND = 3.0e-5  # m, a tenth of a pixel in the largest picture
_TETRAHEDRON_FACES = ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 3, 2, 7, 9, 6))
_TRIANGLE_NODES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])


def _quadratic_values(local: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quadratic shape functions (n, 6 or 10) at barycentric coordinates (n, 3 or 4)."""
    edges = (
        ((0, 1), (1, 2), (2, 0)) if local.shape[1] == 3 else ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    )
    between = [4.0 * local[:, a] * local[:, b] for a, b in edges]
    return np.column_stack([local * (2.0 * local - 1.0), *between])


def _refinement(split: NDArray[np.int64], corners: int) -> NDArray[np.float64]:
    """Quadratic nodes of each piece of ``split`` in terms of the nodes of the whole."""
    edges = ((0, 1), (1, 2), (2, 0)) if corners == 3 else ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
    whole = np.eye(corners)
    nodes = np.vstack([whole, *(0.5 * (whole[a] + whole[b]) for a, b in edges)])
    pieces = []
    for piece in split:
        local = nodes[piece]
        local = np.vstack([local, *(0.5 * (local[a] + local[b]) for a, b in edges)])
        pieces.append(_quadratic_values(local))
    return np.stack(pieces)


# Nodes of the pieces of one quadratic element, each a quadratic element again.
_TRIANGLE_REFINEMENT = _refinement(TRIANGLE_SPLIT, 3)
_TETRAHEDRON_REFINEMENT = _refinement(_TETRAHEDRON_SPLIT, 4)


@dataclass(frozen=True, slots=True)
class TriangleSet:
    """Flat triangles with values at their points.

    Attributes
    ----------
    points : (n, 3) float64 ndarray, [m]
    triangles : (m, 3) int64 ndarray
    values : (n, k) float64 ndarray
        What was asked for, for example temperature in K.
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
    mesh : TaggedMesh
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


def clip_triangles(shape: TriangleSet, level: NDArray[np.float64]) -> TriangleSet:
    """Keep what has a positive level, cutting the triangles that cross zero.

    Parameters
    ----------
    shape : TriangleSet
    level : (n,) ndarray
        Signed distance at the points, linear in each triangle.
    """
    inside = level >= 0.0
    count = inside[shape.triangles].sum(axis=1)
    whole = count == 3
    pieces = [shape.triangles[whole]]
    labels = [shape.label[whole]]
    fields = [shape.points, shape.values] + ([] if shape.normals is None else [shape.normals])
    columns = np.concatenate(fields, axis=1)
    added: list[NDArray[np.float64]] = []
    next_point = len(columns)
    for number_inside in (1, 2):
        chosen = np.flatnonzero(count == number_inside)
        if not chosen.size:
            continue
        triangles = shape.triangles[chosen]
        odd = np.argmax(inside[triangles] == (number_inside == 1), axis=1)
        rolled = np.take_along_axis(triangles, (odd[:, None] + np.arange(3)) % 3, axis=1)
        apex, second, third = rolled.T
        added.append(_between(columns, level, apex, second))
        added.append(_between(columns, level, apex, third))
        on_second = next_point + np.arange(chosen.size)
        on_third = on_second + chosen.size
        next_point += 2 * chosen.size
        if number_inside == 1:
            pieces.append(np.stack([apex, on_second, on_third], axis=1))
            labels.append(shape.label[chosen])
        else:
            pieces += [
                np.stack([on_second, second, third], axis=1),
                np.stack([on_second, third, on_third], axis=1),
            ]
            labels += [shape.label[chosen]] * 2
    columns = np.concatenate([columns, *added])
    split = np.cumsum([field.shape[1] for field in fields])[:-1]
    separated = np.split(columns, split, axis=1)
    return _compact(
        TriangleSet(
            separated[0],
            np.concatenate(pieces),
            separated[1],
            np.concatenate(labels),
            separated[2] if len(separated) > 2 else None,
        )
    )


def section_of_volume(
    mesh: TaggedMesh, values: NDArray[np.float64], level: NDArray[np.float64], *, curved: bool = True
) -> TriangleSet:
    """Faces where a plane cuts the parts.

    Parameters
    ----------
    mesh : TaggedMesh
    values : (n_nodes,) or (n_nodes, k) ndarray
    level : (n_nodes,) ndarray
        Signed distance from the plane at every mesh node.
    curved : bool
        Follow the quadratic elements in pieces; otherwise take their
        straight-edged corners alone.

    Returns
    -------
    TriangleSet
        ``label`` is the index of the part.
    """
    level = _off_plane(level)
    at_nodes = level[mesh.tetrahedra]
    crossed = np.flatnonzero((at_nodes.min(axis=1) < 0.0) & (at_nodes.max(axis=1) > 0.0))
    columns = np.column_stack([mesh.points, np.reshape(values, (len(mesh.points), -1)), level])
    if curved:
        columns, pieces, label = _flat_pieces(
            columns[mesh.tetrahedra[crossed]], mesh.part_of_element[crossed]
        )
    else:
        pieces = mesh.tetrahedra[crossed][:, :4]
        label = mesh.part_of_element[crossed]
    level, columns = _off_plane(columns[:, -1]), columns[:, :-1]
    inside = level[pieces] > 0.0
    count = inside.sum(axis=1)
    order = np.argsort(~inside, axis=1, kind="stable")  # points with a positive level first
    pieces = np.take_along_axis(pieces, order, axis=1)
    found: list[NDArray[np.float64]] = []
    labels: list[NDArray[np.int32]] = []
    for number, edges in ((1, ((0, 1), (0, 2), (0, 3))), (3, ((3, 0), (3, 1), (3, 2)))):
        chosen = pieces[count == number]
        found.append(
            np.stack([_between(columns, level, chosen[:, a], chosen[:, b]) for a, b in edges], axis=1)
        )
        labels.append(label[count == number])
    chosen = pieces[count == 2]
    quad = [_between(columns, level, chosen[:, a], chosen[:, b]) for a, b in ((0, 2), (0, 3), (1, 3), (1, 2))]
    for corners in ((0, 1, 2), (0, 2, 3)):
        found.append(np.stack([quad[corner] for corner in corners], axis=1))
        labels.append(label[count == 2])
    corners = np.concatenate(found).reshape(-1, columns.shape[1])
    return TriangleSet(
        corners[:, :3], np.arange(len(corners)).reshape(-1, 3), corners[:, 3:], np.concatenate(labels)
    )


def _flat_pieces(
    elements: NDArray[np.float64], part: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32]]:
    """Straight tetrahedra of quadratic ones (n, 10, k), whose last column is the level.

    Eight of each; 64 where the level is visibly curved, that is where the
    plane cuts a curved face at a slant.
    """
    level = elements[..., -1]
    bend = np.abs(level[:, 4:] - 0.5 * (level[:, _EDGE_ENDS[:, 0]] + level[:, _EDGE_ENDS[:, 1]])).max(axis=1)
    curved = bend > VISIBLE_BEND
    finer = np.einsum("pab,nbk->npak", _TETRAHEDRON_REFINEMENT, elements[curved], optimize=True)
    nodes = np.concatenate([elements[~curved], finer.reshape(-1, *elements.shape[1:])])
    label = np.concatenate([part[~curved], np.repeat(part[curved], 8)])
    whole = np.arange(10 * len(nodes)).reshape(-1, 10)
    return (
        nodes.reshape(-1, elements.shape[2]),
        whole[:, _TETRAHEDRON_SPLIT].reshape(-1, 4),
        np.repeat(label, 8),
    )


def section_of_triangles(shape: TriangleSet, level: NDArray[np.float64]) -> SegmentSet:
    """Lines where a plane cuts triangles (outlines of parts, profiles along a line)."""
    level = _off_plane(level)
    inside = level[shape.triangles] > 0.0
    count = inside.sum(axis=1)
    crossed = np.flatnonzero((count == 1) | (count == 2))
    triangles, inside = shape.triangles[crossed], inside[crossed]
    odd = np.argmax(inside == (count[crossed] == 1)[:, None], axis=1)
    rolled = np.take_along_axis(triangles, (odd[:, None] + np.arange(3)) % 3, axis=1)
    columns = np.concatenate([shape.points, shape.values], axis=1)
    ends = np.stack([_between(columns, level, rolled[:, 0], rolled[:, k]) for k in (1, 2)], axis=1)
    return SegmentSet(ends[..., :3], ends[..., 3:], shape.label[crossed])


def boundary_lines(mesh: TaggedMesh, values: NDArray[np.float64], level: NDArray[np.float64]) -> SegmentSet:
    """Lines where a plane cuts the faces of every part, joints included; ``label`` is the part.

    Parameters
    ----------
    mesh : TaggedMesh
    values : (n_nodes,) or (n_nodes, k) ndarray
    level : (n_nodes,) ndarray
        Signed distance from the plane.
    """
    facets, owner = _all_facets(mesh)
    level = _off_plane(level)
    at_nodes = level[facets]
    crossed = np.flatnonzero((at_nodes.min(axis=1) < 0.0) & (at_nodes.max(axis=1) > 0.0))
    columns = np.column_stack([mesh.points, np.reshape(values, (len(mesh.points), -1)), level])
    nodes = np.einsum("pab,nbk->npak", _TRIANGLE_REFINEMENT, columns[facets[crossed]], optimize=True)
    columns = nodes.reshape(-1, columns.shape[1])
    triangles = np.arange(len(columns)).reshape(-1, 6)[:, TRIANGLE_SPLIT].reshape(-1, 3)
    shape = TriangleSet(columns[:, :3], triangles, columns[:, 3:-1], np.repeat(owner[crossed], 16))
    return section_of_triangles(shape, columns[:, -1])


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
    return sharp_edges(mesh.points, *_all_facets(mesh), angle_deg)


def facet_edges(points: NDArray[np.float64], facets: NDArray[np.int64]) -> SegmentSet:
    """Every element edge of quadratic triangles once, as two segments."""
    ends = np.concatenate([facets[:, [0, 1, 3]], facets[:, [1, 2, 4]], facets[:, [2, 0, 5]]])
    _, first = np.unique(ends[:, 2], return_index=True)
    ends = ends[first]
    lines = np.concatenate([ends[:, [0, 2]], ends[:, [2, 1]]])
    return SegmentSet(points[lines], np.zeros((len(lines), 2, 0)), np.zeros(len(lines), dtype=np.int32))


def element_faces(mesh: TaggedMesh, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Outer faces (n, 6) of the chosen elements, and the part of each."""
    tetrahedra = mesh.tetrahedra[chosen]
    faces = np.concatenate([tetrahedra[:, face] for face in _TETRAHEDRON_FACES])
    part = np.tile(mesh.part_of_element[chosen], len(_TETRAHEDRON_FACES))
    # The three edge middles name a face as well as its corners do.
    key = np.sort(faces[:, 3:], axis=1) @ np.array([1, len(mesh.points), 0], dtype=np.int64)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    single = np.ones(len(key), dtype=bool)
    single[order[1:][same]] = False
    single[order[:-1][same]] = False
    return faces[single], part[single]


def clip_segments(lines: SegmentSet, level: NDArray[np.float64]) -> SegmentSet:
    """Keep the parts of segments with a positive level; ``level`` is (m, 2), at the ends."""
    positive = level >= 0.0
    touched = positive.any(axis=1)
    level, positive = level[touched], positive[touched]
    columns = np.concatenate([lines.points, lines.values], axis=2)[touched]
    span = level[:, :1] - level[:, 1:]
    fraction = np.where(span == 0.0, 0.0, level[:, :1] / np.where(span == 0.0, 1.0, span))
    crossing = columns[:, 0] + fraction * (columns[:, 1] - columns[:, 0])
    columns = np.where(positive[..., None], columns, crossing[:, None, :])
    return SegmentSet(columns[..., :3], columns[..., 3:], lines.label[touched])


def merge_triangles(shapes: Iterable[TriangleSet]) -> TriangleSet:
    """One set of several with the same number of values; normals kept when all have them."""
    shapes = list(shapes)
    offset = np.cumsum([0] + [len(shape.points) for shape in shapes])
    normals = None
    if all(shape.normals is not None for shape in shapes):
        normals = np.concatenate([shape.normals for shape in shapes])
    return TriangleSet(
        np.concatenate([shape.points for shape in shapes]),
        np.concatenate([shape.triangles + first for shape, first in zip(shapes, offset, strict=False)]),
        np.concatenate([shape.values for shape in shapes]),
        np.concatenate([shape.label for shape in shapes]),
        normals,
    )


def select_triangles(shape: TriangleSet, chosen: NDArray[np.bool_]) -> TriangleSet:
    """The triangles where ``chosen`` (m,) holds, without points that nothing uses."""
    return _compact(
        TriangleSet(shape.points, shape.triangles[chosen], shape.values, shape.label[chosen], shape.normals)
    )


def triangle_area(shape: TriangleSet) -> NDArray[np.float64]:
    """Area of each flat triangle, (m,) in m²."""
    a, b, c = (shape.points[shape.triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _all_facets(mesh: TaggedMesh) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
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


def _off_plane(level: NDArray[np.float64]) -> NDArray[np.float64]:
    # Points exactly on the plane count as a nanometre in front, so that a face in it is found once.
    return np.where(np.abs(level) < 1.0e-9, 1.0e-9, level)


def _between(
    columns: NDArray[np.float64], level: NDArray[np.float64], start: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    fraction = (level[start] / (level[start] - level[end]))[:, None]
    return columns[start] + fraction * (columns[end] - columns[start])


def _compact(shape: TriangleSet) -> TriangleSet:
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
