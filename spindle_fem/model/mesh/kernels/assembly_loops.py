"""Kernels of assembly: element integrals, the sparsity pattern, and sums into compressed rows."""

from __future__ import annotations

import numpy as np
from numba import njit

from spindle_fem.model.mesh.kernels import FAST, OPTIONS


# ---------------------------------------------------------------- integrals
@njit(**FAST)
def integrate_tetrahedra(
    low, high, points, elements, map_gradients, gradients, values, weights, conduction, storage, load, volume
):
    """Element integrals ``∫ ∇N_i·∇N_j``, ``∫ N_i N_j``, ``∫ N_i`` and ``∫ 1``; returns the inverted elements.

    The tables at the quadrature points are those of the reference element: ``map_gradients`` of the
    shape functions that map it to space, ``gradients`` and ``values`` of those of the temperature.
    Matrices are written as upper triangles, row by row, (n_elements, n (n + 1) / 2).
    """
    n = values.shape[1]
    jacobian, cofactor, slope = np.empty((3, 3)), np.empty((3, 3)), np.empty((n, 3))
    inverted = 0
    for e in range(low, high):
        conduction[e] = 0.0
        storage[e] = 0.0
        load[e] = 0.0
        volume[e] = 0.0
        turned = False
        for q in range(weights.size):
            jacobian[:] = 0.0
            for node in range(map_gradients.shape[1]):
                for x in range(3):
                    place = points[elements[e, node], x]
                    for k in range(3):
                        jacobian[x, k] += place * map_gradients[q, node, k]
            for x in range(3):
                y, z = (x + 1) % 3, (x + 2) % 3
                for k in range(3):
                    i, j = (k + 1) % 3, (k + 2) % 3
                    cofactor[x, k] = jacobian[y, i] * jacobian[z, j] - jacobian[y, j] * jacobian[z, i]
            determinant = 0.0
            for k in range(3):
                determinant += jacobian[0, k] * cofactor[0, k]
            turned |= determinant <= 0.0
            # gradients in space are cofactor · gradient / determinant
            for i in range(n):
                for x in range(3):
                    slope[i, x] = 0.0
                    for k in range(3):
                        slope[i, x] += cofactor[x, k] * gradients[q, i, k]
            scale, weight = weights[q] / determinant, weights[q] * determinant
            pair = 0
            for i in range(n):
                for j in range(i, n):
                    product = (
                        slope[i, 0] * slope[j, 0] + slope[i, 1] * slope[j, 1] + slope[i, 2] * slope[j, 2]
                    )
                    conduction[e, pair] += scale * product
                    storage[e, pair] += weight * values[q, i] * values[q, j]
                    pair += 1
                load[e, i] += weight * values[q, i]
            volume[e] += weight
        inverted += turned
    return inverted


# ------------------------------------------------------------------ pattern
@njit(**OPTIONS)
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


@njit(**OPTIONS)
def fill_upper(low, high, elements, starts, members, extra_starts, extra, counts, indices):
    """Columns of each row from the diagonal on; returns their number, -1 when the space is too small.

    ``members`` of a node are the places in ``elements`` (counted row by row) where it stands, ``extra``
    the higher nodes that joints couple it with.
    """
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
        kept = write_row(
            np.uint32(i), extra_starts, extra, seen, last, np.uint32(count), indices, np.uint32(end)
        )
        counts[i + 1] = kept
        end += kept
    return end


@njit(**OPTIONS)
def write_row(i, extra_starts, extra, seen, last, count, indices, end):
    """Write row i of the pattern at ``end``: itself, then distinct higher columns, rising; their number.

    ``seen`` holds ``count`` columns of elements, ``last`` where each was seen last. No branch depends
    on a column: a mispredicted one would take longer than all the rest.
    """
    for place in range(extra_starts[i], extra_starts[i + 1]):
        seen[count] = extra[place]
        last[extra[place]] = count
        count += np.uint32(1)
    kept = 0
    for k in range(count):
        j = seen[k]
        seen[kept] = j
        kept += (j > i) & (last[j] == k)
    indices[end] = i
    for k in range(kept):
        column = seen[k]
        rank = end + 1
        for other in range(kept):
            rank += seen[other] < column
        indices[rank] = column
    return kept + 1


@njit(**OPTIONS)
def find_pairs(low, high, one, other, indptr, indices, slots):
    """Upper entry that couples two nodes, for each pair of a range; -1 where there is none."""
    for pair in range(low, high):
        i, j = one[pair], other[pair]
        if j < i:
            i, j = j, i
        slots[pair] = -1
        for place in range(indptr[i], indptr[i + np.uint32(1)]):
            if indices[place] == j:
                slots[pair] = place


# --------------------------------------------------------------------- sums
@njit(**OPTIONS)
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


@njit(**OPTIONS)
def join_rows(
    low, high, starts, columns, values, more_starts, more_columns, more_values, skipped, shift,
    new_starts, new_columns, new_values,
):  # fmt: skip
    """Rows of one matrix, each followed by those of another without its first ``skipped`` entries.

    ``shift`` is added to the columns of the other.
    """
    for i in range(low, high):
        at = new_starts[i]
        for place in range(starts[i], starts[i + 1]):
            new_columns[at] = columns[place]
            new_values[at] = values[place]
            at += np.uint32(1)
        for place in range(more_starts[i] + np.uint32(skipped), more_starts[i + 1]):
            new_columns[at] = more_columns[place] + np.uint32(shift)
            new_values[at] = more_values[place]
            at += np.uint32(1)


@njit(**OPTIONS)
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
