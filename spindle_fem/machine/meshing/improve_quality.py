"""Raise the quality of the worst curved elements by moving nodes inside a part.

Meshers judge straight elements; on a small hole the curved middles then cost
the flattest ones their quality. Corners and edge middles that lie on no face
are free to give way, so areas, names and joints stay as they are.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.meshing.quality import TETRAHEDRON_EDGES, sampled_quality

TARGET = 0.2
PASSES = 30
_ROUND = 10
# Steps as fractions of the mean edge around a node, along axes and diagonals.
_STEPS = (0.3, 0.1, 0.03)
_DIRECTIONS = np.array(
    [
        direction
        for direction in itertools.product((-1.0, 0.0, 1.0), repeat=3)
        if np.count_nonzero(direction) in (1, 3)
    ]
)
_DIRECTIONS /= np.linalg.norm(_DIRECTIONS, axis=1)[:, None]


def improve_elements(
    points: NDArray[np.float64],
    elements: NDArray[np.int64],
    n_corners: int,
    fixed: NDArray[np.bool_],
    quality: NDArray[np.float64],
    *,
    target: float = TARGET,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move free nodes of elements below ``target``, corners and middles by turns.

    Parameters
    ----------
    points : (n, 3) ndarray, [m]
    elements : (m, 10) int64 ndarray
    n_corners : int
        Leading points that are corners.
    fixed : (n,) bool ndarray
        Nodes on faces.
    quality : (m,) ndarray, [-]
        Sampled quality of every element.

    Returns
    -------
    points : (n, 3) ndarray, [m]
    quality : (m,) ndarray, [-]
        Nowhere lower around a moved node than its worst element was before.
    """
    points, quality = points.copy(), quality.copy()
    patches = _Patches(elements, fixed, n_corners)
    idle = 0
    for number in range(PASSES):
        bad = np.flatnonzero(quality < target)
        if len(bad) == 0 or idle == _ROUND:
            break
        # Each pass tries another node of an element: its corners, then its middles.
        moved = _relax(points, elements, quality, bad, patches, np.roll(np.arange(_ROUND), -number))
        idle = 0 if moved else idle + 1
    return points, quality


class _Patches:
    """Elements around each free node."""

    def __init__(self, elements: NDArray[np.int64], fixed: NDArray[np.bool_], n_corners: int) -> None:
        self.fixed = fixed
        self.n_corners = n_corners
        flat = elements.ravel()
        order = np.argsort(flat, kind="stable")
        self._elements = order // elements.shape[1]
        self._starts = np.searchsorted(flat[order], np.arange(len(fixed) + 1))

    def around(self, node: int) -> NDArray[np.int64]:
        """Elements that contain a node."""
        return self._elements[self._starts[node] : self._starts[node + 1]]


def _relax(
    points: NDArray[np.float64],
    elements: NDArray[np.int64],
    quality: NDArray[np.float64],
    bad: NDArray[np.int64],
    patches: _Patches,
    columns: NDArray[np.int64],
) -> int:
    """Sweep once over nodes whose patches share no element; return the number of nodes moved."""
    nodes, members = _independent_nodes(elements, quality, bad, patches, columns)
    if not nodes:
        return 0
    sizes = np.array([len(member) for member in members])
    group = np.repeat(np.arange(len(nodes)), sizes)
    first_of_group = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    patch = np.concatenate(members)
    node_array = np.array(nodes)
    weights = _displacement_weights(elements[patch], node_array[group])
    corners = points[elements[patch][:, :4]]
    span = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).mean(axis=1)
    scale = np.add.reduceat(span, first_of_group) / sizes
    best_quality = quality[patch]
    best_worst = np.minimum.reduceat(best_quality, first_of_group)
    best_move = np.zeros((len(nodes), 3))
    places = points[elements[patch]]
    for step in _STEPS:
        centre = best_move.copy()
        for direction in _DIRECTIONS:
            move = centre + step * scale[:, None] * direction
            trial = sampled_quality(places + weights[:, :, None] * move[group][:, None, :])
            worst = np.minimum.reduceat(trial, first_of_group)
            better = worst > best_worst + 1e-4
            best_worst = np.where(better, worst, best_worst)
            best_move[better] = move[better]
            best_quality = np.where(better[group], trial, best_quality)
    quality[patch] = best_quality
    moved_nodes = elements[patch]
    # Neighbours in a patch share nodes: assigning the new place is idempotent.
    points[moved_nodes] = places + weights[:, :, None] * best_move[group][:, None, :]
    return int(np.count_nonzero(np.any(best_move != 0.0, axis=1)))


def _independent_nodes(
    elements: NDArray[np.int64],
    quality: NDArray[np.float64],
    bad: NDArray[np.int64],
    patches: _Patches,
    columns: NDArray[np.int64],
) -> tuple[list[int], list[NDArray[np.int64]]]:
    """Free nodes of the worst elements first, no two with an element or node in common."""
    taken: set[int] = set()
    nodes, members = [], []
    # A few dozen elements at most: the mesher leaves hardly any below the target.
    for element in bad[np.argsort(quality[bad])]:
        for node in elements[element, columns].tolist():
            if patches.fixed[node]:
                continue
            around = patches.around(node)
            touched = set(elements[around].ravel().tolist())
            if touched & taken:
                continue
            taken |= touched
            nodes.append(node)
            members.append(around)
            break
    return nodes, members


def _displacement_weights(patch: NDArray[np.int64], node: NDArray[np.int64]) -> NDArray[np.float64]:
    """Share of the node's movement that each node of its elements follows.

    A middle follows the corner of its edge by half, so straight edges stay straight.
    """
    weights = (patch == node[:, None]).astype(np.float64)
    for middle, (a, b) in enumerate(TETRAHEDRON_EDGES, start=4):
        weights[:, middle] += 0.5 * (weights[:, a] + weights[:, b])
    return weights
