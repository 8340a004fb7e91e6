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
def add_product(low, high, indptr, indices, data, vector, out):
    """``out += A vector`` on a range of rows."""
    for i in range(low, high):
        total = data.dtype.type(0.0)
        for place in range(indptr[i], indptr[i + 1]):
            total += data[place] * vector[indices[place]]
        out[i] += total


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


# ------------------------------------------------------ Gauss-Seidel smoothing
@njit(**_FAST)
def forward_from_zero(low, high, starts, columns, values, diagonal, inverse, right, unknowns):
    """Forward sweep over all rows from zero."""
    for i in range(low, high):
        total = right[i]
        for place in range(starts[i], diagonal[i]):
            total -= values[place] * unknowns[columns[place]]
        unknowns[i] = total * inverse[i]


@njit(**_FAST)
def residual_after_forward(low, high, starts, columns, values, diagonal, unknowns, out):
    """Residual after :func:`forward_from_zero`: what the sweep did not see."""
    for i in range(low, high):
        total = values.dtype.type(0.0)
        for place in range(diagonal[i] + 1, starts[i + 1]):
            total -= values[place] * unknowns[columns[place]]
        out[i] = total


@njit(**_FAST)
def backward(low, high, starts, columns, values, inverse, right, unknowns):
    """Backward sweep over all rows."""
    for i in range(high - 1, low - 1, -1):
        total = right[i]
        for place in range(starts[i], starts[i + 1]):
            total -= values[place] * unknowns[columns[place]]
        unknowns[i] += total * inverse[i]


# The same for several columns (n, m) at once: each entry of the matrix is read once for all.
@njit(**_FAST)
def forward_many(starts, columns, values, diagonal, inverse, right, unknowns):
    """:func:`forward_from_zero` for several columns."""
    m = right.shape[1]
    for i in range(right.shape[0]):
        for c in range(m):
            unknowns[i, c] = right[i, c]
        for place in range(starts[i], diagonal[i]):
            j, value = columns[place], values[place]
            for c in range(m):
                unknowns[i, c] -= value * unknowns[j, c]
        for c in range(m):
            unknowns[i, c] *= inverse[i]


@njit(**_FAST)
def residual_many(starts, columns, values, diagonal, unknowns, out):
    """:func:`residual_after_forward` for several columns."""
    m = out.shape[1]
    for i in range(out.shape[0]):
        for c in range(m):
            out[i, c] = 0.0
        for place in range(diagonal[i] + 1, starts[i + 1]):
            j, value = columns[place], values[place]
            for c in range(m):
                out[i, c] -= value * unknowns[j, c]


@njit(**_FAST)
def backward_many(starts, columns, values, inverse, right, unknowns):
    """:func:`backward` for several columns."""
    m = right.shape[1]
    total = np.empty(m, dtype=values.dtype)
    for i in range(right.shape[0] - 1, -1, -1):
        for c in range(m):
            total[c] = right[i, c]
        for place in range(starts[i], starts[i + 1]):
            j, value = columns[place], values[place]
            for c in range(m):
                total[c] -= value * unknowns[j, c]
        for c in range(m):
            unknowns[i, c] += total[c] * inverse[i]


@njit(**_FAST)
def add_product_many(starts, columns, values, vectors, out):
    """``out += A vectors`` for several columns."""
    m = out.shape[1]
    for i in range(out.shape[0]):
        for place in range(starts[i], starts[i + 1]):
            j, value = columns[place], values[place]
            for c in range(m):
                out[i, c] += value * vectors[j, c]


# The same by threads: each sweeps over its part of the rows, rows[low:high], and takes
# what other parts had before. Half of the couplings with other parts is added to the
# diagonal, which keeps the sweep convergent however strong they are.
@njit(**_OPTIONS)
def divide(starts, columns, values, n_parts):
    """Connected parts of about equal size: slices of a breadth-first order from one end."""
    n = starts.size - 1
    order = np.empty(n, dtype=np.uint32)
    first = 0
    for _ in range(2):
        seen = np.zeros(n, dtype=np.uint8)
        end = 0
        seed = first
        for candidate in range(-1, n):
            if candidate >= 0:
                if seen[candidate]:
                    continue
                seed = candidate
            seen[seed] = 1
            order[end] = seed
            at = end
            end += 1
            while at < end:
                i = order[at]
                at += 1
                for place in range(starts[i], starts[i + 1]):
                    j = columns[place]
                    if not seen[j] and values[place] != 0.0:
                        seen[j] = 1
                        order[end] = j
                        end += 1
        # the last one reached lies at an end
        first = order[n - 1]
    part = np.empty(n, dtype=np.uint8)
    for place in range(n):
        part[order[place]] = place * n_parts // n
    return part


@njit(**_OPTIONS)
def inverse_of_parts(starts, columns, values, diagonal, part, inverse):
    """Inverse of the diagonal and half of the couplings with other parts."""
    for i in range(diagonal.size):
        total = values[diagonal[i]]
        for place in range(starts[i], starts[i + 1]):
            if part[columns[place]] != part[i]:
                total += 0.5 * abs(values[place])
        inverse[i] = 1.0 / total


@njit(**_FAST)
def forward_part(low, high, rows, part, starts, columns, values, diagonal, inverse, right, unknowns):
    """Forward sweep over a part from zero; other parts count as zero."""
    own = part[rows[low]]
    for k in range(low, high):
        i = rows[k]
        total = right[i]
        for place in range(starts[i], diagonal[i]):
            j = columns[place]
            if part[j] == own:
                total -= values[place] * unknowns[j]
        unknowns[i] = total * inverse[i]


@njit(**_FAST)
def residual_of_part(low, high, rows, part, starts, columns, values, diagonal, unknowns, out):
    """Residual after :func:`forward_part` in every part."""
    own = part[rows[low]]
    for k in range(low, high):
        i = rows[k]
        total = shift = values.dtype.type(0.0)
        for place in range(starts[i], diagonal[i]):
            j = columns[place]
            if part[j] != own:
                total -= values[place] * unknowns[j]
                shift += abs(values[place])
        for place in range(diagonal[i] + 1, starts[i + 1]):
            j = columns[place]
            total -= values[place] * unknowns[j]
            if part[j] != own:
                shift += abs(values[place])
        out[i] = total + values.dtype.type(0.5) * shift * unknowns[i]


@njit(**_FAST)
def backward_part(low, high, rows, part, starts, columns, values, inverse, right, before, unknowns):
    """Backward sweep over a part; other parts keep what they had ``before``."""
    own = part[rows[low]]
    for k in range(high - 1, low - 1, -1):
        i = rows[k]
        total = right[i]
        for place in range(starts[i], starts[i + 1]):
            j = columns[place]
            total -= values[place] * (unknowns[j] if part[j] == own else before[j])
        unknowns[i] += total * inverse[i]


@njit(**_FAST)
def scaled_copy(low, high, factor, vector, out):
    """``out = factor vector`` on a range, in the precision of ``out``."""
    for i in range(low, high):
        out[i] = factor * vector[i]


@njit(**_OPTIONS)
def find_diagonal(starts, columns, values, diagonal, inverse):
    """Place of each row's diagonal and its inverse."""
    for i in range(diagonal.size):
        for place in range(starts[i], starts[i + 1]):
            if columns[place] == i:
                diagonal[i] = place
                inverse[i] = 1.0 / values[place]


# -------------------------------------------------------- smoothed aggregation
@njit(**_OPTIONS)
def aggregate(indptr, indices, data):
    """Aggregate of each row; -1 for rows coupled with nothing. Also returns their number.

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
    return label, count


@njit(**_OPTIONS)
def smoothed_prolongation(
    low, high, starts, columns, values, diagonal, label, damping, size, counts, new_columns, new_values
):
    """Rows of ``(I − damping D⁻¹ A) T`` with T constant on each aggregate; returns the entries.

    Returns -1 when the space is too small, as :func:`product_rows` does.
    """
    mark = np.full(size, -1, dtype=np.int32)
    end = 0
    for i in range(low, high):
        begin = end
        if begin + starts[i + 1] - starts[i] > new_columns.size:
            return -1
        factor = -damping / values[diagonal[i]]
        for place in range(starts[i], starts[i + 1]):
            j = columns[place]
            value = values[place]
            coarse = label[j]
            if value == 0.0 or coarse < 0:
                continue
            value = factor * value
            if j == i:
                value += 1.0
            if mark[coarse] >= begin:
                new_values[mark[coarse]] += value
            else:
                mark[coarse] = end
                new_columns[end] = coarse
                new_values[end] = value
                end += 1
        counts[i + 1] = end - begin
    return end


@njit(**_OPTIONS)
def transpose(indptr, indices, data, n_columns):
    """Compressed rows of the transpose."""
    starts = np.zeros(n_columns + 1, dtype=np.int32)
    for place in range(indices.size):
        starts[indices[place] + 1] += 1
    for i in range(n_columns):
        starts[i + 1] += starts[i]
    place_of = starts[:-1].copy()
    rows = np.empty(indices.size, dtype=np.int32)
    values = np.empty(data.size, dtype=data.dtype)
    for i in range(indptr.size - 1):
        for place in range(indptr[i], indptr[i + 1]):
            j = indices[place]
            rows[place_of[j]] = i
            values[place_of[j]] = data[place]
            place_of[j] += 1
    return starts, rows, values


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


@njit(**_OPTIONS)
def sort_rows(starts, columns, values):
    """Sort each compressed row by its columns."""
    for i in range(starts.size - 1):
        begin, end = starts[i], starts[i + 1]
        order = np.argsort(columns[begin:end])
        columns[begin:end] = columns[begin:end][order]
        values[begin:end] = values[begin:end][order]
