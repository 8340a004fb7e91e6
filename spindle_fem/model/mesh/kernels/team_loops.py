"""Kernels that threads go through together: a multigrid cycle, a step of conjugate gradients.

A pass is divided into chunks of rows, more than there are threads. Whoever is
free claims the next chunk, and a pass begins when every chunk of the one before
is done: no thread waits for another that has not come yet or that the system
has put aside, and what is computed does not depend on who computes it. While
threads wait within a call they look for some microseconds, then sleep.
"""

from __future__ import annotations

import os

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from spindle_fem.model.mesh.kernels import FAST
from spindle_fem.model.mesh.kernels.multigrid_loops import add_prolonged, multiply, smooth

# Places of the two counters, on cache lines of their own.
CLAIMED, DONE = 0, 16
# Looks before a waiting thread sleeps: its core is then free for the thread that it waits for.
LOOKS = 2000
if os.name == "nt":
    _rest = types.ExternalFunction("Sleep", types.void(types.uint32))
    REST = 0
else:
    _rest = types.ExternalFunction("usleep", types.intc(types.uint32))
    REST = 20

# Kinds of passes of a cycle.
BEGIN, SMOOTH, RESIDUAL, RESTRICT, COARSEST, PROLONG, AGAIN, END = range(8)
# Columns of the layout: rows of a level, where its vectors begin, where each of its nine arrays begins.
ROWS, WORK, ARRAYS = range(3)
# Right-hand side, direction, what is left, next direction (at last the level's answer), unknowns.
N_VECTORS = 5
# Weights of the two steps: Lottes (2023), table of optimal fourth-kind weights.
FIRST_WEIGHT = np.float32(1.02387287570313)
SECOND_WEIGHT = np.float32(1.26408905371085)
# Largest eigenvalue of the scaled matrix: that of rows that sum to zero with no positive coupling.
LARGEST = 2.0
FIRST_STEP = np.float32(4.0 / (3.0 * LARGEST))
KEEP = np.float32(1.0 / 5.0)
SECOND_STEP = np.float32(12.0 / (5.0 * LARGEST))
NOTHING = np.float32(0.0)


# ------------------------------------------------------------------- counters
def _place(context, builder, signature, args):
    kind = signature.args[0]
    array = context.make_array(kind)(context, builder, args[0])
    return cgutils.get_item_pointer(context, builder, kind, array, [args[1]], wraparound=False)


@intrinsic
def count_up(typingctx, counters, place):
    """Add one to a counter, and return what it was: one thread at a time."""

    def generate(context, builder, signature, args):
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", _place(context, builder, signature, args), one, "seq_cst")

    return types.int64(counters, types.intp), generate


@intrinsic
def _look(typingctx, counters, place):
    """Read a counter; what was written before it was counted is seen after."""

    def generate(context, builder, signature, args):
        return builder.load_atomic(_place(context, builder, signature, args), "acquire", 8)

    return types.int64(counters, types.intp), generate


@njit(**FAST)
def wait(counters, wanted):
    """Return when so many chunks are done."""
    looks = 0
    while _look(counters, DONE) < wanted:
        looks += 1
        if looks > LOOKS:
            _rest(REST)


# ---------------------------------------------------------------------- cycle
@njit(**FAST)
def cycle(is_first, counters, passes, bounds, layout, fine, coarse, coarsest, work, residual, scale, answer):
    """A V-cycle: ``answer`` gets the approximate solution for a residual.

    ``passes`` has kind, level and first chunk of each pass, ``bounds`` the rows of
    each level's chunks; ``fine`` has the arrays of the finest level, ``coarse`` those of
    all coarser levels one after the other, ``layout`` where each level's begin, and
    ``coarsest`` the inverse of the last one's matrix.
    """
    total = passes[passes.shape[0] - 1, 2]
    at = 0
    while True:
        chunk = count_up(counters, CLAIMED)
        if chunk >= total:
            break
        while chunk >= passes[at + 1, 2]:
            at += 1
        kind, level, begin = passes[at, 0], passes[at, 1], passes[at, 2]
        wait(counters, begin)
        low, high = bounds[level, chunk - begin], bounds[level, chunk - begin + 1]
        vectors = _vectors(level, layout, work)
        if kind == BEGIN:
            for i in range(low, high):
                vectors[0][i] = residual[i] / scale
        elif kind == COARSEST:
            _multiply_dense(low, high, coarsest, vectors[0], vectors[3])
        elif kind == RESTRICT:
            above = _arrays(level - 1, layout, fine, coarse)
            left = _vectors(level - 1, layout, work)[2]
            multiply(low, high, above[6], above[7], above[8], left, vectors[0])
        elif kind == PROLONG:
            own = _arrays(level, layout, fine, coarse)
            correction = _vectors(level + 1, layout, work)[3]
            add_prolonged(low, high, own[4], own[5], correction, vectors[4])
        if kind != COARSEST and level < layout.shape[0] - 1:
            _smooth_level(kind, low, high, _arrays(level, layout, fine, coarse), vectors)
        if kind == END and level == 0:
            for i in range(low, high):
                answer[i] = scale * vectors[3][i]
        count_up(counters, DONE)
    if is_first:
        wait(counters, total)


@njit(**FAST)
def _arrays(level, layout, fine, coarse):
    """Matrix, scale of smoothing, prolongation and restriction of a level."""
    if level == 0:
        return fine
    at = layout[level, ARRAYS:]
    return (
        coarse[0][at[0] :], coarse[1][at[1] :], coarse[2][at[2] :], coarse[3][at[3] :], coarse[4][at[4] :],
        coarse[5][at[5] :], coarse[6][at[6] :], coarse[7][at[7] :], coarse[8][at[8] :],
    )  # fmt: skip


@njit(**FAST)
def _vectors(level, layout, work):
    """Right-hand side, direction, what is left, next direction and unknowns of a level."""
    size, at = work.size // N_VECTORS, layout[level, WORK]
    return (
        work[at:],
        work[size + at :],
        work[2 * size + at :],
        work[3 * size + at :],
        work[4 * size + at :],
    )


@njit(**FAST)
def _smooth_level(kind, low, high, arrays, vectors):
    """Compute one pass on the rows of a chunk, from vectors left by earlier passes."""
    starts, columns, values, inverse = arrays[0], arrays[1], arrays[2], arrays[3]
    right, direction, left, following, unknowns = vectors
    if kind in (BEGIN, RESTRICT):
        for i in range(low, high):
            direction[i] = FIRST_STEP * inverse[i] * right[i]
        return
    if kind == PROLONG:
        return
    keep, add = KEEP, SECOND_STEP
    if kind in (RESIDUAL, AGAIN):
        known, vector, rest, out = right, unknowns, left, direction
        keep, add = NOTHING, FIRST_STEP
    elif kind == SMOOTH:
        known, vector, rest, out = right, direction, left, following
    else:
        known, vector, rest, out = left, direction, right, following
    smooth(low, high, starts, columns, values, inverse, known, vector, keep, add, rest, out)
    if kind == SMOOTH:
        for i in range(low, high):
            unknowns[i] = FIRST_WEIGHT * direction[i] + SECOND_WEIGHT * following[i]
    elif kind == END:
        for i in range(low, high):
            following[i] = unknowns[i] + FIRST_WEIGHT * direction[i] + SECOND_WEIGHT * following[i]


@njit(**FAST)
def _multiply_dense(low, high, matrix, vector, out):
    """``out = A vector`` on a range of rows of a dense matrix."""
    for i in range(low, high):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] = total


# --------------------------------------------------------- conjugate gradients
@njit(**FAST)
def conjugate_step(
    is_first, counters, bounds, starts, columns, values, preconditioned, residual, image, direction, unknowns,
    step, energy, shares,
):  # fmt: skip
    """Next direction and the way along it; ``step`` and ``energy`` are the last ones, energy 0 at first.

    ``shares``, (4, n_chunks), gets each chunk's part of ``z · q`` and ``z · r`` before,
    of ``p · A p`` and of ``r · r`` after.
    """
    count = bounds.size - 1
    while True:
        ticket = count_up(counters, CLAIMED)
        if ticket >= 4 * count:
            break
        number, chunk = ticket // count, ticket % count
        wait(counters, number * count)
        low, high = bounds[chunk], bounds[chunk + 1]
        one = other = 0.0
        if number == 0:
            for i in range(low, high):
                one += preconditioned[i] * image[i]
                other += preconditioned[i] * residual[i]
            shares[0, chunk], shares[1, chunk] = one, other
        elif number == 1:
            # Polak-Ribière: stays conjugate although single precision makes the cycle slightly nonlinear
            factor = -step * _total(shares[0]) / energy if energy > 0.0 else 0.0
            for i in range(low, high):
                direction[i] = preconditioned[i] + factor * direction[i]
        elif number == 2:
            multiply(low, high, starts, columns, values, direction, image)
            for i in range(low, high):
                one += direction[i] * image[i]
            shares[2, chunk] = one
        else:
            length = _total(shares[1]) / _total(shares[2])
            for i in range(low, high):
                unknowns[i] += length * direction[i]
                left = residual[i] - length * image[i]
                residual[i] = left
                one += left * left
            shares[3, chunk] = one
        count_up(counters, DONE)
    if is_first:
        wait(counters, 4 * count)


@njit(**FAST)
def _total(values):
    total = 0.0
    for value in values:
        total += value
    return total
