"""Compiled loops of multigrid and conjugate gradients; imported only where numba is installed.

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
# Entries in every row of a prolongation.
WIDTH = 4
_FAST = {**_OPTIONS, "fastmath": {"contract", "reassoc", "nsz", "arcp"}}


# ------------------------------------------------------------------ products
@njit(**_FAST)
def multiply(low, high, indptr, indices, data, vector, out):
    """``out = A vector`` on a range of rows."""
    for i in range(low, high):
        total = data.dtype.type(0.0)
        for place in range(indptr[i], indptr[i + 1]):
            total += data[place] * vector[indices[place]]
        out[i] = total


@njit(**_FAST)
def multiply_and_dot(low, high, indptr, indices, data, vector, out):
    """``out = A vector`` on a range of rows; returns the range's share of ``vector · out``."""
    dot = 0.0
    for i in range(low, high):
        total = 0.0
        for place in range(indptr[i], indptr[i + 1]):
            total += data[place] * vector[indices[place]]
        out[i] = total
        dot += total * vector[i]
    return dot


@njit(**_FAST)
def advance(low, high, step, direction, image, unknowns, residual):
    """``x += step p``, ``r -= step q`` on a range; returns its share of ``r · r``."""
    square = 0.0
    for i in range(low, high):
        unknowns[i] += step * direction[i]
        left = residual[i] - step * image[i]
        residual[i] = left
        square += left * left
    return square


@njit(**_FAST)
def two_dots(low, high, vector, one, other):
    """``vector · one`` and ``vector · other`` of a range."""
    first = second = 0.0
    for i in range(low, high):
        first += vector[i] * one[i]
        second += vector[i] * other[i]
    return first, second


@njit(**_FAST)
def turn(low, high, factor, direction, preconditioned):
    """``p = z + factor p`` on a range."""
    for i in range(low, high):
        direction[i] = preconditioned[i] + factor * direction[i]


# ------------------------------------------------------ polynomial smoothing
# Every pass is one product with what belongs to it: d is a direction, r a residual, x the unknowns.
@njit(**_FAST)
def begin_scaled(low, high, scale, factor, inverse, residual, right, direction):
    """``b = scale r`` in the precision of b, and ``d = factor D⁻¹ b``."""
    for i in range(low, high):
        value = right.dtype.type(scale * residual[i])
        right[i] = value
        direction[i] = factor * inverse[i] * value


@njit(**_FAST)
def begin(low, high, factor, inverse, right, direction):
    """``d = factor D⁻¹ b``."""
    for i in range(low, high):
        direction[i] = factor * inverse[i] * right[i]


@njit(**_FAST)
def go_on(low, high, starts, columns, values, inverse, right, direction, keep, add, left, following):
    """``r = b − A d`` and the next direction ``keep d + add D⁻¹ r``."""
    for i in range(low, high):
        total = right[i]
        for place in range(starts[i], starts[i + 1]):
            total -= values[place] * direction[columns[place]]
        left[i] = total
        following[i] = keep * direction[i] + add * inverse[i] * total


@njit(**_FAST)
def end_from_zero(
    low, high, starts, columns, values, right, left, first, second, weight, other, unknowns, rest
):
    """``x = weight d₁ + other d₂`` and ``b − A x`` where ``r = b − A d₁`` is known."""
    for i in range(low, high):
        total = values.dtype.type(0.0)
        for place in range(starts[i], starts[i + 1]):
            total += values[place] * second[columns[place]]
        rest[i] = right[i] - weight * (right[i] - left[i]) - other * total
        unknowns[i] = weight * first[i] + other * second[i]


@njit(**_FAST)
def begin_again(low, high, starts, columns, values, inverse, right, unknowns, factor, left, direction):
    """``r = b − A x`` and ``d = factor D⁻¹ r``."""
    for i in range(low, high):
        total = right[i]
        for place in range(starts[i], starts[i + 1]):
            total -= values[place] * unknowns[columns[place]]
        left[i] = total
        direction[i] = factor * inverse[i] * total


@njit(**_FAST)
def end(
    low,
    high,
    starts,
    columns,
    values,
    inverse,
    left,
    direction,
    weight,
    other,
    keep,
    add,
    unknowns,
    scale,
    out,
):
    """``out = scale (x + weight d + other (keep d + add D⁻¹ (r − A d)))``."""
    for i in range(low, high):
        total = left[i]
        for place in range(starts[i], starts[i + 1]):
            total -= values[place] * direction[columns[place]]
        following = keep * direction[i] + add * inverse[i] * total
        out[i] = scale * (unknowns[i] + weight * direction[i] + other * following)


@njit(**_FAST)
def add_prolonged(low, high, columns, values, vector, out):
    """``out += P vector`` with as many entries in every row, (n, WIDTH)."""
    for i in range(low, high):
        total = values[i, 0] * vector[columns[i, 0]]
        for k in range(1, WIDTH):
            total += values[i, k] * vector[columns[i, k]]
        out[i] += total


# The same for several columns (n, m) at once: each entry of the matrix is read once for all.
@njit(**_FAST)
def multiply_many(low, high, starts, columns, values, vectors, out):
    """``out = A vectors`` on a range of rows."""
    m = out.shape[1]
    for i in range(low, high):
        for c in range(m):
            out[i, c] = 0.0
        for place in range(starts[i], starts[i + 1]):
            j, value = columns[place], values[place]
            for c in range(m):
                out[i, c] += value * vectors[j, c]


@njit(**_FAST)
def step_many(low, high, starts, columns, values, inverse, right, vectors, keep, add, left, following):
    """``r = b − A d`` and ``keep d + add D⁻¹ r`` on a range of rows."""
    m = right.shape[1]
    for i in range(low, high):
        for c in range(m):
            left[i, c] = right[i, c]
        for place in range(starts[i], starts[i + 1]):
            j, value = columns[place], values[place]
            for c in range(m):
                left[i, c] -= value * vectors[j, c]
        factor = add * inverse[i]
        for c in range(m):
            following[i, c] = keep * vectors[i, c] + factor * left[i, c]


@njit(**_FAST)
def add_prolonged_many(low, high, columns, values, vectors, out):
    """``out += P vectors`` on a range of rows, P as in :func:`add_prolonged`."""
    for i in range(low, high):
        for k in range(WIDTH):
            j, value = columns[i, k], values[i, k]
            for c in range(out.shape[1]):
                out[i, c] += value * vectors[j, c]


@njit(**_OPTIONS)
def invert_diagonal(low, high, starts, columns, values, largest, inverse, smoothing):
    """Inverse of each row's diagonal, and the one that smoothing scales by.

    That is smaller where the row's sizes add up to more than ``largest`` times the
    diagonal: no eigenvalue of the scaled matrix is then above it (Gershgorin).
    """
    for i in range(low, high):
        diagonal = size = 0.0
        for place in range(starts[i], starts[i + 1]):
            value = values[place]
            size += abs(value)
            diagonal = value if columns[place] == i else diagonal
        inverse[i] = 1.0 / diagonal
        smoothing[i] = min(1.0 / diagonal, largest / size)


# -------------------------------------------------------- smoothed aggregation
@njit(**_OPTIONS)
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


@njit(**_OPTIONS)
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


@njit(**_OPTIONS)
def transpose_fixed(columns, values, n_columns):
    """Compressed rows of the transpose of (n, WIDTH) rows, without their zeros."""
    starts = np.zeros(n_columns + 1, dtype=np.int32)
    for i in range(columns.shape[0]):
        for k in range(WIDTH):
            starts[columns[i, k] + np.uint32(1)] += values[i, k] != 0.0
    for i in range(n_columns):
        starts[i + 1] += starts[i]
    place_of = starts[:-1].copy()
    rows = np.empty(starts[n_columns], dtype=np.int32)
    weights = np.empty(starts[n_columns], dtype=values.dtype)
    for i in range(columns.shape[0]):
        for k in range(WIDTH):
            if values[i, k] != 0.0:
                place = place_of[columns[i, k]]
                rows[place] = i
                weights[place] = values[i, k]
                place_of[columns[i, k]] += 1
    return starts, rows, weights


@njit(**_OPTIONS)
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


@njit(**_OPTIONS)
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
