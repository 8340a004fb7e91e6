"""Sum over one row of a sparse matrix for several columns, kept in vector registers.

A loop over columns inside one over a row's entries stores and loads every sum again at each entry. Here the
sums of 24, 16 or 8 columns stay in registers until the row ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from spindle_fem.model.mesh.kernels import FAST

# Columns of one vector of LLVM's: one register of single precision where these have 256 bits.
LANES = 8
# A product and the sum that it joins may become one instruction.
FUSED = ("contract",)


def _sums_of(count: int) -> Callable:
    """Intrinsic that subtracts a row's products from ``count`` vectors of sums."""

    @intrinsic
    def subtract(typing, sums, first, begin, end, columns, values, vectors):
        """``sums[first + c] −= Σ values[p] vectors[columns[p], first + c]``, p from begin to end."""
        arrays = (sums, columns, values, vectors)
        if any(not isinstance(item, types.Array) or item.layout != "C" for item in arrays):
            return None
        if values.dtype != sums.dtype or vectors.dtype != sums.dtype:
            return None
        signature = types.void(sums, types.uintp, types.uintp, types.uintp, columns, values, vectors)

        def generate(context, builder, _, arguments):
            pointers = [
                context.make_array(kind)(context, builder, arguments[place])
                for kind, place in ((sums, 0), (columns, 4), (values, 5), (vectors, 6))
            ]
            total, column, value, vector = (item.data for item in pointers)
            first, begin, end = arguments[1:4]
            width = cgutils.unpack_tuple(builder, pointers[3].shape)[1]
            kind = context.get_value_type(sums.dtype)
            lanes = ir.VectorType(kind, LANES)
            unit = context.get_abi_sizeof(kind)

            def at(base, index, number):
                place = builder.gep(base, [builder.add(index, index.type(number * LANES))])
                return builder.bitcast(place, lanes.as_pointer())

            held = [cgutils.alloca_once(builder, lanes) for _ in range(count)]
            for number, own in enumerate(held):
                builder.store(builder.load(at(total, first, number), align=unit), own)
            with cgutils.for_range_slice(builder, begin, end, begin.type(1)) as (place, _):
                entry = builder.load(builder.gep(value, [place]))
                row = builder.zext(builder.load(builder.gep(column, [place])), place.type)
                index = builder.add(builder.mul(row, width), first)
                one = builder.insert_element(ir.Constant(lanes, ir.Undefined), entry, ir.IntType(32)(0))
                mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
                spread = builder.shuffle_vector(one, ir.Constant(lanes, ir.Undefined), mask)
                for number, own in enumerate(held):
                    term = builder.fmul(
                        spread, builder.load(at(vector, index, number), align=unit), flags=FUSED
                    )
                    builder.store(builder.fsub(builder.load(own), term, flags=FUSED), own)
            for number, own in enumerate(held):
                builder.store(builder.load(own), at(total, first, number), align=unit)
            return context.get_dummy_value()

        return signature, generate

    return subtract


_three, _two, _one = (_sums_of(count) for count in (3, 2, 1))


@njit(**FAST)
def room_for_sums(like):
    """Sums of as many columns as an array (n, m) has, and room for :func:`subtract_row`, (m + LANES,)."""
    return np.empty(like.shape[1] + LANES, dtype=like.dtype)


@njit(**FAST)
def subtract_row(sums, begin, end, columns, values, vectors):
    """``sums[c] −= Σ values[p] vectors[columns[p], c]`` for entries p from begin to before end."""
    m = sums.size - LANES
    first = 0
    while m - first >= 3 * LANES:
        _three(sums, first, begin, end, columns, values, vectors)
        first += 3 * LANES
    if m - first >= 2 * LANES:
        _two(sums, first, begin, end, columns, values, vectors)
        first += 2 * LANES
    elif m - first >= LANES:
        _one(sums, first, begin, end, columns, values, vectors)
        first += LANES
    if first == m:
        return
    if first:
        # the last lanes, of which some are done: these are put aside
        last = m - LANES
        for c in range(last, first):
            sums[c + LANES] = sums[c]
        _one(sums, last, begin, end, columns, values, vectors)
        for c in range(last, first):
            sums[c] = sums[c + LANES]
    else:
        for place in range(begin, end):
            j, value = columns[place], values[place]
            for c in range(m):
                sums[c] -= value * vectors[j, c]
