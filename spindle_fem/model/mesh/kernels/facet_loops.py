"""Compiled loops over facets, joints and tied nodes; imported only where numba is installed.

Where a function works on a range of facets ``[low, high)`` it writes to these
alone, so that ranges run in threads. Indices are passed unsigned: signed ones
are tested for "from the end" at every access.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def _find(i, j, indptr, indices):
    if j < i:
        i, j = j, i
    for place in range(indptr[i], indptr[i + 1]):
        if indices[place] == j:
            return np.int64(place)
    return -1


@njit(**_OPTIONS)
def find_facets(low, high, nodes, indptr, indices, part_of_slot, slots):
    """Upper entry of each two nodes of facets, (n, k (k + 1) / 2); returns how many no element has."""
    missing = 0
    for facet in range(low, high):
        pair = 0
        for a in range(nodes.shape[1]):
            for b in range(a, nodes.shape[1]):
                slot = _find(nodes[facet, a], nodes[facet, b], indptr, indices)
                slots[facet, pair] = slot
                missing += slot < 0 or part_of_slot[slot] < 0
                pair += 1
    return missing


@njit(**_OPTIONS)
def find_crossings(low, high, one, other, indptr, indices, slots):
    """Upper entry of each node of one facet with each of the other, (n, k, k)."""
    for facet in range(low, high):
        for a in range(one.shape[1]):
            for b in range(other.shape[1]):
                slots[facet, a, b] = _find(one[facet, a], other[facet, b], indptr, indices)


@njit(**_OPTIONS)
def upper_crossings(one, other, n_nodes):
    """What facets couple across joints, by the lower node of each two: starts and higher nodes, repeated."""
    starts = np.zeros(n_nodes + 1, dtype=np.int32)
    for facet in range(one.shape[0]):
        for a in range(one.shape[1]):
            for b in range(other.shape[1]):
                starts[min(one[facet, a], other[facet, b]) + np.uint32(1)] += 1
    for i in range(n_nodes):
        starts[i + 1] += starts[i]
    place = starts[:-1].copy()
    columns = np.empty(starts[n_nodes], dtype=np.int32)
    for facet in range(one.shape[0]):
        for a in range(one.shape[1]):
            for b in range(other.shape[1]):
                i, j = one[facet, a], other[facet, b]
                columns[place[min(i, j)]] = max(i, j)
                place[min(i, j)] += 1
    return starts, columns


@njit(**_OPTIONS)
def label_tied(one, other, size):
    """Label of each node, one for all that pairs tie, in the order of their first; the number of labels."""
    first = np.arange(size)
    for pair in range(one.size):
        i, j = one[pair], other[pair]
        while first[i] != i:
            first[i] = first[first[i]]
            i = first[i]
        while first[j] != j:
            first[j] = first[first[j]]
            j = first[j]
        first[max(i, j)] = min(i, j)
    label = np.empty(size, dtype=np.int32)
    count = 0
    for i in range(size):
        if first[i] == i:
            label[i] = count
            count += 1
        else:
            # what comes first is labelled before
            label[i] = label[first[i]]
    return label, count


@njit(**_OPTIONS)
def distinct(values, size):
    """Distinct values below a size, rising, and the place of each value among them."""
    place = np.zeros(size, dtype=np.int32)
    for index in range(values.shape[0]):
        for k in range(values.shape[1]):
            place[values[index, k]] = 1
    count = 0
    for value in range(size):
        used = place[value]
        place[value] = count
        count += used
    found = np.empty(count, dtype=np.int64)
    answer = np.empty(values.shape, dtype=np.int32)
    for index in range(values.shape[0]):
        for k in range(values.shape[1]):
            answer[index, k] = place[values[index, k]]
            found[answer[index, k]] = values[index, k]
    return found, answer


@njit(**_OPTIONS)
def integrate_flat_facets(low, high, points, facets, film, load, area):
    """Straight triangles of a range: upper film matrices, loads and areas."""
    for facet in range(low, high):
        p0, p1, p2 = facets[facet, 0], facets[facet, 1], facets[facet, 2]
        ox, oy, oz = points[p0, 0], points[p0, 1], points[p0, 2]
        ax, ay, az = points[p1, 0] - ox, points[p1, 1] - oy, points[p1, 2] - oz
        bx, by, bz = points[p2, 0] - ox, points[p2, 1] - oy, points[p2, 2] - oz
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        size = 0.5 * np.sqrt(x * x + y * y + z * z)
        area[facet] = size
        load[facet, 0] = load[facet, 1] = load[facet, 2] = size / 3.0
        film[facet, 0] = film[facet, 3] = film[facet, 5] = size / 6.0
        film[facet, 1] = film[facet, 2] = film[facet, 4] = size / 12.0


@njit(**_OPTIONS)
def add_films(active, coefficient, film, slots, upper):
    """Add each active facet's film matrix times its coefficient to the upper entries."""
    for facet in active:
        for pair in range(film.shape[1]):
            upper[slots[facet, pair]] += coefficient[facet] * film[facet, pair]
