"""Kernels of multigrid: sparse products, polynomial smoothing and smoothed aggregation."""

from __future__ import annotations

import numpy as np
from numba import njit

from spindle_fem.model.mesh.kernels import FAST, OPTIONS

# Entries in every row of a prolongation.
WIDTH = 4


# ----------------------------------------------------- products and smoothing
@njit(**FAST)
def multiply(low, high, starts, columns, values, vector, out):
    """``out = A vector`` on a range of rows."""
    for i in range(low, high):
        total = values.dtype.type(0.0)
        for place in range(starts[i], starts[i + 1]):
            total += values[place] * vector[columns[place]]
        out[i] = total


@njit(**FAST)
def smooth(low, high, starts, columns, values, inverse, right, vector, keep, add, left, following):
    """``r = b − A v``, and the next direction ``keep v + add D⁻¹ r``."""
    for i in range(low, high):
        total = right[i]
        for place in range(starts[i], starts[i + 1]):
            total -= values[place] * vector[columns[place]]
        left[i] = total
        following[i] = keep * vector[i] + add * inverse[i] * total


@njit(**FAST)
def add_prolonged(low, high, columns, values, vector, out):
    """``out += P vector`` with as many entries in every row, (n, WIDTH)."""
    for i in range(low, high):
        total = values[i, 0] * vector[columns[i, 0]]
        for k in range(1, WIDTH):
            total += values[i, k] * vector[columns[i, k]]
        out[i] += total


# -------------------------------------------------------- smoothed aggregation
@njit(**OPTIONS)
def aggregate(indptr, indices, data):
    """Aggregate of each row, and their number, which is also that of rows coupled with nothing.

    Roots take all their neighbours where none is taken yet; what is left joins
    the neighbour it is coupled with most strongly.
    """
    n = indptr.size - 1
    label = np.full(n, -1, dtype=np.int32)
    count = 0
    for i in range(n):
        if label[i] >= 0:
            continue
        free, coupled = True, False
        for place in range(indptr[i], indptr[i + 1]):
            j = indices[place]
            if j != i and data[place] != 0.0:
                coupled = True
                if label[j] >= 0:
                    free = False
                    break
        if free and coupled:
            label[i] = count
            for place in range(indptr[i], indptr[i + 1]):
                if data[place] != 0.0:
                    label[indices[place]] = count
            count += 1
    first = label.copy()
    for i in range(n):
        if first[i] >= 0:
            continue
        strongest, chosen = 0.0, -1
        for place in range(indptr[i], indptr[i + 1]):
            j = indices[place]
            if first[j] >= 0 and abs(data[place]) > strongest:
                strongest, chosen = abs(data[place]), first[j]
        label[i] = chosen
    for i in range(n):
        if label[i] >= 0:
            continue
        coupled = False
        for place in range(indptr[i], indptr[i + 1]):
            j = indices[place]
            if j != i and data[place] != 0.0 and label[j] < 0:
                label[j] = count
                coupled = True
        if coupled:
            label[i] = count
            count += 1
    for i in range(n):
        if label[i] < 0:
            label[i] = count
    return label, count


@njit(**OPTIONS)
def smoothed_prolongation(
    low, high, starts, columns, values, inverse, label, damping, size, new_columns, new_values
):
    """Rows of ``(I − damping D⁻¹ A) T`` with T constant on each aggregate, (n, WIDTH).

    A row keeps its largest entries, scaled so that their sum stays what it was;
    a row with fewer is filled with zeros.
    """
    # sums by aggregate, and the row that last had it: what a row has is found without a branch
    sums = np.zeros(size + 1)
    last = np.full(size + 1, -1, dtype=np.int64)
    found = np.empty(size + 2, dtype=np.uint32)
    for i in range(low, high):
        factor = -damping * inverse[i]
        count = np.uint32(0)
        for place in range(starts[i], starts[i + 1]):
            coarse = label[columns[place]]
            found[count] = coarse
            count += np.uint32(last[coarse] != i)
            last[coarse] = i
            sums[coarse] += factor * values[place]
        sums[label[i]] += 1.0
        # rows of no aggregate have nothing to interpolate from
        sums[size] = 0.0
        scale = 1.0
        if count > WIDTH:
            whole = kept = 0.0
            for k in range(count):
                whole += sums[found[k]]
            for k in range(WIDTH):
                largest = k
                for at in range(k + 1, count):
                    if abs(sums[found[at]]) > abs(sums[found[largest]]):
                        largest = at
                found[k], found[largest] = found[largest], found[k]
                kept += sums[found[k]]
            if kept != 0.0:
                scale = whole / kept
        for k in range(WIDTH):
            # fillers name what the row has anyway: products get no entries from them
            coarse = found[k] if k < count else found[0]
            new_columns[i, k] = coarse if coarse < size else np.uint32(0)
            new_values[i, k] = scale * sums[coarse] if k < count else 0.0
        for k in range(count):
            sums[found[k]] = 0.0


@njit(**OPTIONS)
def times_fixed(
    low, high, starts, columns, values, fixed_columns, fixed_values, size, counts, new_columns, new_values
):
    """Rows of ``A P`` with P of (n, WIDTH) rows; returns the entries, -1 when the space is too small."""
    sums = np.zeros(size)
    last = np.full(size, -1, dtype=np.int64)
    end = np.uint64(0)
    for i in range(low, high):
        begin = end
        if begin + np.uint64(WIDTH) * np.uint64(starts[i + 1] - starts[i]) >= np.uint64(new_columns.size):
            return -1
        for place in range(starts[i], starts[i + 1]):
            j, weight = columns[place], values[place]
            for k in range(WIDTH):
                coarse = fixed_columns[j, k]
                new_columns[end] = coarse
                end += np.uint64(last[coarse] != i)
                last[coarse] = i
                sums[coarse] += weight * fixed_values[j, k]
        for place in range(begin, end):
            new_values[place] = sums[new_columns[place]]
            sums[new_columns[place]] = 0.0
        counts[i + 1] = end - begin
    return np.int64(end)


@njit(**OPTIONS)
def product_rows(
    low, high, one_starts, one_columns, one_values, two_starts, two_columns, two_values, size,
    counts, columns, values,
):  # fmt: skip
    """Rows of a sparse product; returns the entries, -1 when the space is too small."""
    mark = np.full(size, -1, dtype=np.int32)
    end = 0
    for i in range(low, high):
        begin = end
        if begin + size > columns.size:
            most = 0
            for outer in range(one_starts[i], one_starts[i + 1]):
                j = one_columns[outer]
                most += two_starts[j + 1] - two_starts[j]
            if begin + most > columns.size:
                return -1
        for outer in range(one_starts[i], one_starts[i + 1]):
            j = one_columns[outer]
            weight = one_values[outer]
            for inner in range(two_starts[j], two_starts[j + 1]):
                column = two_columns[inner]
                if mark[column] >= begin:
                    values[mark[column]] += weight * two_values[inner]
                else:
                    mark[column] = end
                    columns[end] = column
                    values[end] = weight * two_values[inner]
                    end += 1
        counts[i + 1] = end - begin
    return end
