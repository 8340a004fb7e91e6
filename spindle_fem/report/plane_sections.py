"""Plane sections and clipping, of the quadratic field on curved elements.

Plain numpy on the few elements that the plane meets; nothing here runs a
filter over the whole volume.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.report.drawn_surfaces import TRIANGLE_SPLIT, SegmentSet, TriangleSet, all_facets, compact

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


def clip_triangles(shape: TriangleSet, level: NDArray[np.float64]) -> TriangleSet:
    """Keep what has a positive level, cutting the triangles that cross zero.

    Parameters
    ----------
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
    return compact(
        TriangleSet(
            separated[0],
            np.concatenate(pieces),
            separated[1],
            np.concatenate(labels),
            separated[2] if len(separated) > 2 else None,
        )
    )


def behind(shape: TriangleSet, distance: float) -> TriangleSet:
    """Triangles of a section in x = 0, each a distance [m] larger on every side and that far behind it.

    Between triangles of elements that share no edge a plane leaves cracks of rounding; these close them.
    """
    corners = shape.points[shape.triangles]
    outwards = corners - corners.mean(axis=1, keepdims=True)
    length = np.linalg.norm(outwards, axis=2, keepdims=True)
    corners = corners + distance * outwards / np.maximum(length, 1.0e-12)
    corners[..., 0] += distance
    number = len(shape.triangles)
    return TriangleSet(
        corners.reshape(-1, 3),
        np.arange(3 * number).reshape(number, 3),
        shape.values[shape.triangles.ravel()],
        shape.label,
    )


def section_of_volume(
    mesh: TaggedMesh, values: NDArray[np.float64], level: NDArray[np.float64], *, curved: bool = True
) -> TriangleSet:
    """Faces where a plane cuts the parts.

    Parameters
    ----------
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
    values : (n_nodes,) or (n_nodes, k) ndarray
    level : (n_nodes,) ndarray
        Signed distance from the plane.
    """
    facets, owner = all_facets(mesh)
    level = _off_plane(level)
    at_nodes = level[facets]
    crossed = np.flatnonzero((at_nodes.min(axis=1) < 0.0) & (at_nodes.max(axis=1) > 0.0))
    columns = np.column_stack([mesh.points, np.reshape(values, (len(mesh.points), -1)), level])
    nodes = np.einsum("pab,nbk->npak", _TRIANGLE_REFINEMENT, columns[facets[crossed]], optimize=True)
    columns = nodes.reshape(-1, columns.shape[1])
    triangles = np.arange(len(columns)).reshape(-1, 6)[:, TRIANGLE_SPLIT].reshape(-1, 3)
    shape = TriangleSet(columns[:, :3], triangles, columns[:, 3:-1], np.repeat(owner[crossed], 16))
    return section_of_triangles(shape, columns[:, -1])


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


def _off_plane(level: NDArray[np.float64]) -> NDArray[np.float64]:
    # Points exactly on the plane count as a nanometre in front, so that a face in it is found once.
    return np.where(np.abs(level) < 1.0e-9, 1.0e-9, level)


def _between(
    columns: NDArray[np.float64], level: NDArray[np.float64], start: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    fraction = (level[start] / (level[start] - level[end]))[:, None]
    return columns[start] + fraction * (columns[end] - columns[start])
