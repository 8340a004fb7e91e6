"""Compiled loops that threads go through together, pass after pass; imported only where numba is installed.

A pass is divided into chunks of rows, more than there are threads. Whoever is
free claims the next chunk, and a pass begins when every chunk of the one before
is done: no thread waits for another that has not come yet or that the system
has put aside, and what is computed does not depend on who computes it. Threads
are handed over to once for a whole cycle or step of conjugate gradients; while
they wait within it they look for some microseconds, then sleep.
"""

from __future__ import annotations

import os

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from spindle_fem.model.mesh.kernels import solver_loops as loops

_FAST = {
    "cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"contract", "reassoc", "nsz", "arcp"}
}  # fmt: skip
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
BEGIN, GO_ON, END_FROM_ZERO, RESTRICT, COARSEST, PROLONG, BEGIN_AGAIN, END = range(8)
# Columns of the layout of coarse levels, and the vectors of each level.
ROWS, ROW, START, ENTRY, TO_START, TO_ENTRY, WORK = range(7)
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
_ONE = np.float32(1.0)


def _place(context, builder, signature, args):
    kind = signature.args[0]
    array = context.make_array(kind)(context, builder, args[0])
    return cgutils.get_item_pointer(context, builder, kind, array, [args[1]], wraparound=False)


@intrinsic
def _count(typingctx, counters, place):
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


@njit(**_FAST)
def _wait(counters, wanted):
    looks = 0
    while _look(counters, DONE) < wanted:
        looks += 1
        if looks > LOOKS:
            _rest(REST)


# ----------------------------------------------------------------------- cycle
@njit(**_FAST)
def cycle(is_first, counters, passes, bounds, layout, fine, coarse, coarsest, work, residual, scale, answer):
    """A V-cycle: ``answer`` gets the approximate solution for a residual.

    ``passes`` tells kind, level and first chunk of each pass, ``bounds`` the rows of
    each level's chunks; ``coarse`` holds the arrays of all coarser levels one after
    the other, ``layout`` where each level's begin, and ``coarsest`` the inverse of
    the last one's matrix.
    """
    total = passes[passes.shape[0] - 1, 2]
    at = 0
    while True:
        chunk = _count(counters, CLAIMED)
        if chunk >= total:
            break
        while chunk >= passes[at + 1, 2]:
            at += 1
        kind, level, begin = passes[at, 0], passes[at, 1], passes[at, 2]
        _wait(counters, begin)
        low, high = bounds[level, chunk - begin], bounds[level, chunk - begin + 1]
        if level == 0:
            _do_fine(kind, low, high, layout, fine, work, residual, scale, answer)
        else:
            _do_coarse(kind, level, low, high, layout, fine[3], coarse, coarsest, work)
        _count(counters, DONE)
    if is_first:
        _wait(counters, total)


@njit(**_FAST)
def _vector(which, level, layout, work):
    place = which * (work.size // N_VECTORS) + layout[level, WORK]
    return work[place : place + layout[level, ROWS]]


@njit(**_FAST)
def _do_fine(kind, low, high, layout, fine, work, residual, scale, answer):
    """One chunk of a pass on the finest level."""
    matrix, inverse, prolongation = fine[0], fine[1], fine[2]
    right, direction = _vector(0, 0, layout, work), _vector(1, 0, layout, work)
    if kind == BEGIN:
        loops.begin_scaled(low, high, 1.0 / scale, FIRST_STEP, inverse, residual, right, direction)
    elif kind == END:
        loops.end(
            low, high, matrix[0], matrix[1], matrix[2], inverse, _vector(2, 0, layout, work), direction,
            FIRST_WEIGHT, SECOND_WEIGHT, KEEP, SECOND_STEP, _vector(4, 0, layout, work), scale, answer,
        )  # fmt: skip
    else:
        _do_any(kind, low, high, 0, layout, matrix, inverse, prolongation, work)


@njit(**_FAST)
def _do_coarse(kind, level, low, high, layout, restriction, coarse, coarsest, work):
    """One chunk of a pass on a coarser level."""
    starts, columns, values, inverses, to, weights, to_starts, members, shares = coarse
    n, row = layout[level, ROWS], layout[level, ROW]
    right = _vector(0, level, layout, work)
    following = _vector(3, level, layout, work)
    if kind == COARSEST:
        multiply_dense(low, high, coarsest, right, following)
        return
    inverse = inverses[row : row + n]
    if kind == RESTRICT:
        left = _vector(2, level - 1, layout, work)
        if level == 1:
            loops.multiply(low, high, restriction[0], restriction[1], restriction[2], left, right)
        else:
            at, entry = layout[level - 1, TO_START], layout[level - 1, TO_ENTRY]
            loops.multiply(
                low, high, to_starts[at : at + n + 1], members[entry:], shares[entry:], left, right
            )
        if level < layout.shape[0] - 1:
            loops.begin(low, high, FIRST_STEP, inverse, right, _vector(1, level, layout, work))
        return
    start, entry = layout[level, START], layout[level, ENTRY]
    matrix = (starts[start : start + n + 1], columns[entry:], values[entry:])
    if kind == END:
        loops.end(
            low, high, matrix[0], matrix[1], matrix[2], inverse, _vector(2, level, layout, work),
            _vector(1, level, layout, work), FIRST_WEIGHT, SECOND_WEIGHT, KEEP, SECOND_STEP,
            _vector(4, level, layout, work), _ONE, following,
        )  # fmt: skip
    else:
        prolongation = (to[row : row + n], weights[row : row + n])
        _do_any(kind, low, high, level, layout, matrix, inverse, prolongation, work)


@njit(**_FAST)
def _do_any(kind, low, high, level, layout, matrix, inverse, prolongation, work):
    """One chunk of a pass that all levels have."""
    starts, columns, values = matrix
    right, direction = _vector(0, level, layout, work), _vector(1, level, layout, work)
    left, following = _vector(2, level, layout, work), _vector(3, level, layout, work)
    unknowns = _vector(4, level, layout, work)
    if kind == GO_ON:
        loops.go_on(
            low, high, starts, columns, values, inverse, right, direction, KEEP, SECOND_STEP, left, following
        )
    elif kind == END_FROM_ZERO:
        # the residual after both steps takes the place of the one between, row by row
        loops.end_from_zero(
            low, high, starts, columns, values, right, left, direction, following,
            FIRST_WEIGHT, SECOND_WEIGHT, unknowns, left,
        )  # fmt: skip
    elif kind == PROLONG:
        correction = _vector(3, level + 1, layout, work)
        loops.add_prolonged(low, high, prolongation[0], prolongation[1], correction, unknowns)
    else:
        loops.begin_again(
            low, high, starts, columns, values, inverse, right, unknowns, FIRST_STEP, left, direction
        )


@njit(**_FAST)
def multiply_dense(low, high, matrix, vector, out):
    """``out = A vector`` on a range of rows of a dense matrix."""
    for i in range(low, high):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * vector[j]
        out[i] = total


# --------------------------------------------------------- conjugate gradients
@njit(**_FAST)
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
        ticket = _count(counters, CLAIMED)
        if ticket >= 4 * count:
            break
        number, chunk = ticket // count, ticket % count
        _wait(counters, number * count)
        low, high = bounds[chunk], bounds[chunk + 1]
        if number == 0:
            shares[0, chunk], shares[1, chunk] = loops.two_dots(low, high, preconditioned, image, residual)
        elif number == 1:
            # Polak-Ribière: stays conjugate although single precision makes the cycle slightly nonlinear
            factor = -step * shares[0].sum() / energy if energy > 0.0 else 0.0
            loops.turn(low, high, factor, direction, preconditioned)
        elif number == 2:
            shares[2, chunk] = loops.multiply_and_dot(low, high, starts, columns, values, direction, image)
        else:
            length = shares[1].sum() / shares[2].sum()
            shares[3, chunk] = loops.advance(low, high, length, direction, image, unknowns, residual)
        _count(counters, DONE)
    if is_first:
        _wait(counters, 4 * count)


# ---------------------------------------------------------- spaces of solutions
@njit(**_FAST)
def project(is_first, counters, bounds, basis, count, vector, factor, parts, out):
    """``out += factor Σ (v · x) v`` over the first rows v of a basis (size, n), in single precision.

    ``parts``, (n_chunks, size), gets what each chunk adds to ``v · x``.
    """
    n_chunks = bounds.size - 1
    while True:
        ticket = _count(counters, CLAIMED)
        if ticket >= 2 * n_chunks:
            break
        number, chunk = ticket // n_chunks, ticket % n_chunks
        _wait(counters, number * n_chunks)
        low, high = bounds[chunk], bounds[chunk + 1]
        if number == 0:
            _dots_with_rows(low, high, basis, count, vector, parts[chunk])
        else:
            _add_rows(low, high, basis, count, factor, parts, out)
        _count(counters, DONE)
    if is_first:
        _wait(counters, 2 * n_chunks)


@njit(**_FAST)
def _dots_with_rows(low, high, basis, count, vector, parts):
    own = np.empty(high - low, dtype=basis.dtype)
    for i in range(low, high):
        own[i - low] = vector[i]
    for k in range(count):
        total = basis.dtype.type(0.0)
        row = basis[k, low:high]
        for i in range(own.size):
            total += row[i] * own[i]
        parts[k] = total


@njit(**_FAST)
def _add_rows(low, high, basis, count, factor, parts, out):
    own = np.zeros(high - low, dtype=basis.dtype)
    for k in range(count):
        share = basis.dtype.type(factor * parts[:, k].sum())
        row = basis[k, low:high]
        for i in range(own.size):
            own[i] += share * row[i]
    for i in range(low, high):
        out[i] += own[i - low]
