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
def elements_of_nodes(elements, n_nodes, members):
    """Element times its nodes plus the node's place in it, of each node after the other; returns starts."""
    starts = np.zeros(n_nodes + 1, dtype=np.int32)
    for e in range(elements.shape[0]):
        for k in range(elements.shape[1]):
            starts[elements[e, k] + 1] += 1
    for i in range(n_nodes):
        starts[i + 1] += starts[i]
    place = starts[:-1].copy()
    for e in range(elements.shape[0]):
        for k in range(elements.shape[1]):
            node = elements[e, k]
            members[place[node]] = e * elements.shape[1] + k
            place[node] += 1
    return starts


@njit(**_OPTIONS)
def fill_upper(low, high, elements, starts, members, extra_starts, extra, counts, indices):
    """Columns of each row from the diagonal on; returns their number, -1 when the space is too small."""
    size = np.uint32(elements.shape[1])
    last = np.zeros(starts.size, dtype=np.uint32)
    seen = np.empty(256, dtype=np.uint32)
    end = 0
    for i in range(np.uint32(low), np.uint32(high)):
        most = (starts[i + 1] - starts[i]) * size + extra_starts[i + 1] - extra_starts[i]
        # one place more is written to
        if end + most + 2 > indices.size:
            return -1
        if most > seen.size:
            seen = np.empty(2 * most, dtype=np.uint32)
        count = np.uint32(0)
        for place in range(starts[i], starts[i + 1]):
            e = members[place] // size
            for k in range(elements.shape[1]):
                seen[count] = elements[e, k]
                last[elements[e, k]] = count
                count += np.uint32(1)
        count = _see_extra(extra_starts[i], extra_starts[i + 1], extra, seen, last, count)
        indices[end] = i
        kept = _keep_right(i, seen, last, count)
        _rank(seen, kept, indices, end + 1)
        counts[i + 1] = 1 + kept
        end += 1 + kept
    return end


@njit(**_OPTIONS)
def _see_extra(begin, end, extra, seen, last, count):
    for place in range(begin, end):
        seen[count] = extra[place]
        last[extra[place]] = count
        count += np.uint32(1)
    return count


# No branch of these depends on a column: mispredicted ones would take longer than all the rest.
@njit(**_OPTIONS)
def _keep_right(i, seen, last, count):
    """Distinct columns right of i to the front, ``last`` tells where each was seen last; their number."""
    kept = 0
    for k in range(count):
        j = seen[k]
        seen[kept] = j
        kept += (j > i) & (last[j] == k)
    return kept


@njit(**_OPTIONS)
def _rank(seen, kept, indices, begin):
    """Write distinct columns in rising order."""
    for k in range(kept):
        column = seen[k]
        rank = begin
        for other in range(kept):
            rank += seen[other] < column
        indices[rank] = column


@njit(**_OPTIONS)
def full_starts(indptr, indices):
    """Where each full row of an upper triangle begins."""
    n = indptr.size - 1
    starts = np.zeros(n + 1, dtype=np.int32)
    for i in range(n):
        starts[i + 1] += indptr[i + 1] - indptr[i]
        for place in range(indptr[i] + np.uint32(1), indptr[i + 1]):
            starts[indices[place] + np.uint32(1)] += 1
    for i in range(n):
        starts[i + 1] += starts[i]
    return starts


@njit(**_OPTIONS)
def expand_upper(low, high, indptr, indices, starts, columns, slots):
    """Columns of the full rows in a range, and the upper entry of each."""
    place_of = np.empty(high - low, dtype=np.uint32)
    for i in range(low, high):
        place_of[i - low] = starts[i]
    low, high = np.uint32(low), np.uint32(high)
    # rows in order: what lies left of the diagonal arrives in a row before its own entries
    for i in range(high):
        for place in range(indptr[i], indptr[i + np.uint32(1)]):
            j = indices[place]
            if j >= low and j < high:
                at = place_of[j - low]
                columns[at] = i
                slots[at] = place
                place_of[j - low] = at + np.uint32(1)
        if i >= low:
            at = place_of[i - low]
            for place in range(indptr[i] + np.uint32(1), indptr[i + np.uint32(1)]):
                columns[at] = indices[place]
                slots[at] = place
                at += np.uint32(1)


@njit(**_OPTIONS)
def scale_by_part(low, high, part_of_slot, factors, unit, out):
    """``out = factor of the part · unit``; zero where there is no part."""
    for place in range(low, high):
        part = part_of_slot[place]
        out[place] = factors[part] * unit[place] if part >= 0 else 0.0


@njit(**_OPTIONS)
def gather(low, high, values, places, out):
    """``out = values[places]`` on a range."""
    for index in range(low, high):
        out[index] = values[places[index]]


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
def integrate_linear(low, high, points, elements, chosen, part_of_element, n_parts, values):
    """Chosen tetrahedra of a range, linear and straight: off-diagonal conduction and volume, (n_elements, 7).

    Pairs of nodes come as 01, 23, 02, 13, 03, 12. Returns the volume of each part
    and how many elements are inverted.
    """
    volume = np.zeros(n_parts)
    inverted = 0
    for index in range(low, high):
        e = chosen[index]
        p0, p1, p2, p3 = elements[e, 0], elements[e, 1], elements[e, 2], elements[e, 3]
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
        inverted += determinant <= 0.0
        volume[part_of_element[e]] += determinant / 6.0
        scale = 1.0 / (6.0 * determinant)
        values[e, 0] = scale * (g0x * g1x + g0y * g1y + g0z * g1z)
        values[e, 1] = scale * (g2x * g3x + g2y * g3y + g2z * g3z)
        values[e, 2] = scale * (g0x * g2x + g0y * g2y + g0z * g2z)
        values[e, 3] = scale * (g1x * g3x + g1y * g3y + g1z * g3z)
        values[e, 4] = scale * (g0x * g3x + g0y * g3y + g0z * g3z)
        values[e, 5] = scale * (g1x * g2x + g1y * g2y + g1z * g2z)
        values[e, 6] = determinant / 6.0
    return volume, inverted


@njit(**_OPTIONS)
def fill_linear_rows(
    low, high, elements, starts, members, values, part, extra_starts, extra, load,
    counts, indices, part_of_slot, conduction, storage,
):  # fmt: skip
    """Upper rows of straight linear elements: columns from the diagonal on and all that goes with them.

    ``members`` and ``values`` are those of :func:`elements_of_nodes` and
    :func:`integrate_linear`. Columns of joints get nothing but their place. Returns
    the entries, -1 when the space is too small.
    """
    one, two, three = np.uint32(1), np.uint32(2), np.uint32(3)
    # conduction and storage by column; those left of the diagonal are summed too and never looked at
    sums = np.zeros((starts.size, 2))
    last = np.zeros(starts.size, dtype=np.uint32)
    seen = np.empty(256, dtype=np.uint32)
    end = 0
    for i in range(np.uint32(low), np.uint32(high)):
        most = 3 * (starts[i + 1] - starts[i]) + extra_starts[i + 1] - extra_starts[i]
        # one place more is written to
        if end + most + 2 > indices.size:
            return -1
        if most > seen.size:
            seen = np.empty(2 * most, dtype=np.uint32)
        around = volume = 0.0
        count = np.uint32(0)
        for place in range(starts[i], starts[i + 1]):
            e, own = members[place] >> two, members[place] & three
            volume += values[e, 6]
            share = values[e, 6] / 20.0
            # own and another node of an element give the place of their pair without a branch
            j = elements[e, own ^ one]
            value = values[e, own >> one]
            around -= value
            sums[j, 0] += value
            sums[j, 1] += share
            seen[count] = j
            last[j] = count
            j = elements[e, own ^ two]
            value = values[e, two + (own & one)]
            around -= value
            sums[j, 0] += value
            sums[j, 1] += share
            seen[count + one] = j
            last[j] = count + one
            j = elements[e, own ^ three]
            value = values[e, two + two + ((own ^ (own >> one)) & one)]
            around -= value
            sums[j, 0] += value
            sums[j, 1] += share
            seen[count + two] = j
            last[j] = count + two
            count += three
        count = _see_extra(extra_starts[i], extra_starts[i + 1], extra, seen, last, count)
        begin = end
        indices[begin] = i
        kept = _keep_right(i, seen, last, count)
        _rank(seen, kept, indices, begin + 1)
        end += 1 + kept
        conduction[begin], storage[begin] = around, volume / 10.0
        load[i] = 0.25 * volume
        part_of_slot[begin] = part[i]
        for place in range(begin + 1, end):
            j = indices[place]
            conduction[place], storage[place] = sums[j, 0], sums[j, 1]
            part_of_slot[place] = part[i] if part[j] == part[i] else -1
            sums[j, 0] = sums[j, 1] = 0.0
        counts[i + 1] = end - begin
    return end


@njit(**_OPTIONS)
def group(label, size):
    """Which members each label has: (size + 1,) starts and members, rising."""
    starts = np.zeros(size + 1, dtype=np.int32)
    for i in range(label.size):
        starts[label[i] + np.uint32(1)] += 1
    for k in range(size):
        starts[k + 1] += starts[k]
    place = starts[:-1].copy()
    members = np.empty(label.size, dtype=np.int32)
    for i in range(label.size):
        members[place[label[i]]] = i
        place[label[i]] += 1
    return starts, members


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


@njit(**_OPTIONS)
def border_rows(
    low, high, indptr, indices, data, border_indptr, border_indices, border_data, ends, columns, values
):
    """A range of rows with those of a border, whose columns come after, at their ends."""
    after = np.uint32(indptr.size - 1)
    for i in range(low, high):
        at = ends[i]
        for place in range(indptr[i], indptr[i + 1]):
            columns[at] = indices[place]
            values[at] = data[place]
            at += np.uint32(1)
        for place in range(border_indptr[i], border_indptr[i + 1]):
            columns[at] = border_indices[place] + after
            values[at] = border_data[place]
            at += np.uint32(1)
