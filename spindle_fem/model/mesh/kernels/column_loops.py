"""Kernels for several columns (n, m) at once: each entry of a matrix is read once for all of them."""

from __future__ import annotations

import numpy as np
from numba import njit

from spindle_fem.model.mesh.kernels import FAST
from spindle_fem.model.mesh.kernels.multigrid_loops import WIDTH
from spindle_fem.model.mesh.kernels.row_sums import room_for_sums, subtract_row


@njit(**FAST)
def multiply_columns(low, high, starts, columns, values, vectors, out):
    """``out = A vectors`` on a range of rows."""
    m = out.shape[1]
    sums = room_for_sums(out)
    for i in range(low, high):
        for c in range(m):
            sums[c] = 0.0
        subtract_row(sums, starts[i], starts[i + 1], columns, values, vectors)
        for c in range(m):
            out[i, c] = -sums[c]


@njit(**FAST)
def left_over(low, high, starts, columns, values, right, vectors, out):
    """``out = right − A vectors`` on a range of rows."""
    m = out.shape[1]
    sums = room_for_sums(out)
    for i in range(low, high):
        for c in range(m):
            sums[c] = right[i, c]
        subtract_row(sums, starts[i], starts[i + 1], columns, values, vectors)
        for c in range(m):
            out[i, c] = sums[c]


@njit(**FAST)
def smooth_columns(
    low, high, starts, columns, values, inverse, right, direction, keep, add, first, second, begun, unknowns
):
    """Both steps of the polynomial, ``direction`` d the first: ``x = begun x + first d + second d₂``.

    ``d₂ = keep d + add D⁻¹ (right − A d)`` is kept nowhere.
    """
    m = right.shape[1]
    sums = room_for_sums(right)
    for i in range(low, high):
        for c in range(m):
            sums[c] = right[i, c]
        subtract_row(sums, starts[i], starts[i + 1], columns, values, direction)
        of_direction, of_sum = first + second * keep, second * add * inverse[i]
        if begun:
            for c in range(m):
                unknowns[i, c] += of_direction * direction[i, c] + of_sum * sums[c]
        else:
            for c in range(m):
                unknowns[i, c] = of_direction * direction[i, c] + of_sum * sums[c]


@njit(**FAST)
def scale_rows(low, high, factor, inverse, right, out):
    """``out = factor D⁻¹ right``."""
    for i in range(low, high):
        scale = factor * inverse[i]
        for c in range(right.shape[1]):
            out[i, c] = scale * right[i, c]


@njit(**FAST)
def largest_columns(low, high, vectors):
    """Largest size in each column over a range of rows, (m,)."""
    found = np.zeros(vectors.shape[1], dtype=vectors.dtype)
    for i in range(low, high):
        for c in range(found.size):
            found[c] = max(found[c], abs(vectors[i, c]))
    return found


@njit(**FAST)
def scale_columns(low, high, factor, vectors, out):
    """``out = vectors`` times one factor a column, as far as these go, and zero in columns behind."""
    shared = min(factor.size, out.shape[1])
    for i in range(low, high):
        for c in range(shared):
            out[i, c] = factor[c] * vectors[i, c]
        for c in range(shared, out.shape[1]):
            out[i, c] = 0.0


@njit(**FAST)
def add_prolonged_columns(low, high, columns, values, vectors, out):
    """``out += P vectors`` with as many entries in every row, (n, WIDTH)."""
    for i in range(low, high):
        for k in range(WIDTH):
            j, value = columns[i, k], values[i, k]
            for c in range(out.shape[1]):
                out[i, c] += value * vectors[j, c]


# ------------------------------------------------------- conjugate gradients
@njit(**FAST)
def dot_columns(low, high, one, two):
    """Scalar product of each pair of columns over a range of rows, (m,), in double precision."""
    m = one.shape[1]
    sums = np.zeros(m)
    for i in range(low, high):
        for c in range(m):
            sums[c] += np.float64(one[i, c]) * np.float64(two[i, c])
    return sums


@njit(**FAST)
def advance_columns(low, high, step, direction, image, unknowns, residual):
    """Go one step along each direction."""
    for i in range(low, high):
        for c in range(direction.shape[1]):
            unknowns[i, c] += step[c] * direction[i, c]
            residual[i, c] -= step[c] * image[i, c]


@njit(**FAST)
def turn_columns(low, high, factor, preconditioned, direction):
    """``direction = factor direction + preconditioned``."""
    for i in range(low, high):
        for c in range(direction.shape[1]):
            direction[i, c] = factor[c] * direction[i, c] + preconditioned[i, c]
