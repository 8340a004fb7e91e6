"""Compiled loops that make patterns and matrices; imported only where numba is installed.

Every function works on a range of rows ``[low, high)`` and writes to these rows
alone, so that ranges run in threads (``threads.run_blocks``) and the result
depends on the ranges, never on timing. Compiled code is kept on disk beside the
module or, where that is not writable, in the user's cache. Indices are passed
unsigned: signed ones are tested for "from the end" at every access.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


# ------------------------------------------------------------------- pattern
@njit(**_OPTIONS)
def elements_of_nodes(elements, n_nodes):
    """Elements at each node, compressed: (n_nodes + 1,) starts and element numbers."""
    starts = np.zeros(n_nodes + 1, dtype=np.int32)
    for e in range(elements.shape[0]):
        for k in range(elements.shape[1]):
            starts[elements[e, k] + 1] += 1
    for i in range(n_nodes):
        starts[i + 1] += starts[i]
    place = starts[:-1].copy()
    members = np.empty(elements.size, dtype=np.int32)
    for e in range(elements.shape[0]):
        for k in range(elements.shape[1]):
            node = elements[e, k]
            members[place[node]] = e
            place[node] += 1
    return starts, members


@njit(**_OPTIONS)
def fill_upper(low, high, elements, starts, members, extra_starts, extra, counts, indices):
    """Columns of each row from the diagonal on; returns their number, -1 when the space is too small."""
    mark = np.full(starts.size - 1, -1, dtype=np.int32)
    end = 0
    for i in range(low, high):
        begin = end
        # no row is longer than all nodes of its elements
        most = 1 + (starts[i + 1] - starts[i]) * elements.shape[1] + extra_starts[i + 1] - extra_starts[i]
        if begin + most > indices.size:
            return -1
        indices[begin] = i
        end = begin + 1
        for place in range(starts[i], starts[i + 1]):
            e = members[place]
            for k in range(elements.shape[1]):
                j = elements[e, k]
                if j > i and mark[j] != i:
                    mark[j] = i
                    end = _insert(indices, begin, end, j)
        for place in range(extra_starts[i], extra_starts[i + 1]):
            j = extra[place]
            if mark[j] != i:
                mark[j] = i
                end = _insert(indices, begin, end, j)
        counts[i + 1] = end - begin
    return end


@njit(**_OPTIONS)
def _insert(indices, begin, end, column):
    place = end
    while place > begin and indices[place - 1] > column:
        indices[place] = indices[place - 1]
        place -= 1
    indices[place] = column
    return end + 1


@njit(**_OPTIONS)
def expand_upper(indptr, indices):
    """Full compressed rows of an upper triangle: starts, columns, upper entry of each."""
    n = indptr.size - 1
    full_starts = np.zeros(n + 1, dtype=np.int32)
    for i in range(n):
        full_starts[i + 1] += indptr[i + 1] - indptr[i]
        for place in range(indptr[i] + 1, indptr[i + 1]):
            full_starts[indices[place] + 1] += 1
    for i in range(n):
        full_starts[i + 1] += full_starts[i]
    place_of = full_starts[:-1].copy()
    columns = np.empty(full_starts[n], dtype=np.int32)
    slots = np.empty(full_starts[n], dtype=np.int32)
    # rows in order: what lies left of the diagonal arrives in a row before its own entries
    for i in range(n):
        for place in range(indptr[i], indptr[i + 1]):
            j = indices[place]
            columns[place_of[i]] = j
            slots[place_of[i]] = place
            place_of[i] += 1
            if j != i:
                columns[place_of[j]] = i
                slots[place_of[j]] = place
                place_of[j] += 1
    return full_starts, columns, slots


@njit(**_OPTIONS)
def find_upper(rows, columns, indptr, indices, slots):
    """Upper entry of each pair of nodes, in either order; -1 where the pattern has none."""
    for index in range(rows.size):
        i, j = rows[index], columns[index]
        if j < i:
            i, j = j, i
        slots[index] = -1
        for place in range(indptr[i], indptr[i + 1]):
            if indices[place] == j:
                slots[index] = place
                break


@njit(**_OPTIONS)
def part_of_nodes(elements, part_of_element, n_nodes):
    """Part of each node, (n_nodes,), -1 where none; and whether two parts share a node."""
    part = np.full(n_nodes, -1, dtype=np.int32)
    shared = False
    for e in range(elements.shape[0]):
        for k in range(elements.shape[1]):
            node = elements[e, k]
            shared |= part[node] >= 0 and part[node] != part_of_element[e]
            part[node] = part_of_element[e]
    return part, shared


@njit(**_OPTIONS)
def add_element_values(low, high, elements, values, others, indptr, indices, out, other_out):
    """Add two upper element matrices (n_elements, k (k + 1) / 2) each to the entries of rows in a range."""
    size = elements.shape[1]
    for e in range(elements.shape[0]):
        pair = 0
        for a in range(size):
            for b in range(a, size):
                i, j = elements[e, a], elements[e, b]
                if j < i:
                    i, j = j, i
                if low <= i < high:
                    place = indptr[i]
                    while indices[place] != j:
                        place += 1
                    out[place] += values[e, pair]
                    other_out[place] += others[e, pair]
                pair += 1


@njit(**_OPTIONS)
def add_linear_elements(
    low, high, points, elements, part_of_element, n_parts, indptr, indices, conduction, storage, load
):
    """Unit conduction, storage and load of straight linear tetrahedra, for rows in a range.

    Returns the volume of each part, of elements whose first node is in the
    range, and how many of these are inverted.
    """
    volume = np.zeros(n_parts)
    inverted = 0
    for e in range(elements.shape[0]):
        p0, p1, p2, p3 = elements[e, 0], elements[e, 1], elements[e, 2], elements[e, 3]
        if not (low <= p0 < high or low <= p1 < high or low <= p2 < high or low <= p3 < high):
            continue
        ox, oy, oz = points[p0, 0], points[p0, 1], points[p0, 2]
        ax, ay, az = points[p1, 0] - ox, points[p1, 1] - oy, points[p1, 2] - oz
        bx, by, bz = points[p2, 0] - ox, points[p2, 1] - oy, points[p2, 2] - oz
        cx, cy, cz = points[p3, 0] - ox, points[p3, 1] - oy, points[p3, 2] - oz
        # gradients of the shape functions times the determinant: normals of the opposite faces
        g1x, g1y, g1z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        g2x, g2y, g2z = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        g3x, g3y, g3z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        g0x, g0y, g0z = -g1x - g2x - g3x, -g1y - g2y - g3y, -g1z - g2z - g3z
        determinant = ax * g1x + ay * g1y + az * g1z
        if low <= p0 < high:
            inverted += determinant <= 0.0
            volume[part_of_element[e]] += determinant / 6.0
            load[p0] += determinant / 24.0
        if low <= p1 < high:
            load[p1] += determinant / 24.0
        if low <= p2 < high:
            load[p2] += determinant / 24.0
        if low <= p3 < high:
            load[p3] += determinant / 24.0
        scale = 1.0 / (6.0 * determinant)
        own, other = determinant / 60.0, determinant / 120.0
        if low <= p0 < high:
            at = indptr[p0]
            conduction[at] += scale * (g0x * g0x + g0y * g0y + g0z * g0z)
            storage[at] += own
        if low <= p1 < high:
            at = indptr[p1]
            conduction[at] += scale * (g1x * g1x + g1y * g1y + g1z * g1z)
            storage[at] += own
        if low <= p2 < high:
            at = indptr[p2]
            conduction[at] += scale * (g2x * g2x + g2y * g2y + g2z * g2z)
            storage[at] += own
        if low <= p3 < high:
            at = indptr[p3]
            conduction[at] += scale * (g3x * g3x + g3y * g3y + g3z * g3z)
            storage[at] += own
        for row, column, value in (
            (p0, p1, g0x * g1x + g0y * g1y + g0z * g1z),
            (p0, p2, g0x * g2x + g0y * g2y + g0z * g2z),
            (p0, p3, g0x * g3x + g0y * g3y + g0z * g3z),
            (p1, p2, g1x * g2x + g1y * g2y + g1z * g2z),
            (p1, p3, g1x * g3x + g1y * g3y + g1z * g3z),
            (p2, p3, g2x * g3x + g2y * g3y + g2z * g3z),
        ):
            if column < row:
                row, column = column, row
            if low <= row < high:
                at = indptr[row] + 1
                while indices[at] != column:
                    at += 1
                conduction[at] += scale * value
                storage[at] += other
    return volume, inverted


@njit(**_OPTIONS)
def merge_rows(low, high, starts, members, label, indptr, indices, data, counts, columns, values):
    """Rows and columns with one label summed; returns the entries, -1 when the space is too small."""
    mark = np.full(starts.size - 1, -1, dtype=np.int32)
    end = 0
    for row in range(low, high):
        begin = end
        most = 0
        for member in range(starts[row], starts[row + 1]):
            most += indptr[members[member] + 1] - indptr[members[member]]
        if begin + most > columns.size:
            return -1
        for member in range(starts[row], starts[row + 1]):
            i = members[member]
            for place in range(indptr[i], indptr[i + 1]):
                j = label[indices[place]]
                if mark[j] >= begin:
                    values[mark[j]] += data[place]
                    continue
                at = end
                while at > begin and columns[at - 1] > j:
                    columns[at] = columns[at - 1]
                    values[at] = values[at - 1]
                    mark[columns[at]] = at
                    at -= 1
                columns[at] = j
                values[at] = data[place]
                mark[j] = at
                end += 1
        counts[row + 1] = end - begin
    return end
