"""Whether compiled loops are there, and the threads that share their rows."""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar
from functools import cache
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

# Loading compiled code takes as long as it saves on so many unknowns.
COMPILED_ABOVE = 40_000
# A block of fewer rows costs more to hand over than it saves.
LEAST_ROWS = 15_000
_ONE: ContextVar[bool] = ContextVar("one_thread", default=False)


@cache
def has_compiled() -> bool:
    """Whether numba is installed and ``SPINDLE_FEM_COMPILED`` does not forbid it (``0``)."""
    return os.environ.get("SPINDLE_FEM_COMPILED", "1") != "0" and find_spec("numba") is not None


def use_compiled(n_unknowns: int) -> bool:
    """Whether a problem of this size is worth compiled loops, and they are there."""
    return n_unknowns >= COMPILED_ABOVE and has_compiled()


def thread_count() -> int:
    """Threads of compiled loops: one within :func:`one_thread`, else what the machine gives."""
    return 1 if _ONE.get() else _given_threads()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Compiled loops with one thread: the order of sums, and so the last digits, depend on their number."""
    token = _ONE.set(True)
    try:
        yield
    finally:
        _ONE.reset(token)


@cache
def _given_threads() -> int:
    """``SPINDLE_FEM_THREADS``, else ``OMP_NUM_THREADS``, else the cores given."""
    for name in ("SPINDLE_FEM_THREADS", "OMP_NUM_THREADS"):
        given = os.environ.get(name, "")
        if given.isdigit() and int(given) > 0:
            return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="spindle-fem")


def row_blocks(n_rows: int) -> NDArray[np.int64]:
    """Bounds of the ranges that threads work on, (n_blocks + 1,)."""
    count = max(1, min(thread_count(), n_rows // LEAST_ROWS))
    return np.linspace(0, n_rows, count + 1).astype(np.int64)


def run_blocks(function: Callable, bounds: NDArray[np.int64], *arguments: object) -> list:
    """Call ``function(low, high, *arguments)`` for every range, and return what the calls return.

    The calling thread takes the first range; idle threads sleep.
    """
    if len(bounds) == 2:
        return [function(bounds[0], bounds[1], *arguments)]
    pool = _pool(len(bounds) - 2)
    others = [pool.submit(function, low, high, *arguments) for low, high in itertools.pairwise(bounds[1:])]
    first = function(bounds[0], bounds[1], *arguments)
    return [first, *(other.result() for other in others)]


def fill_rows(
    function: Callable, n_rows: int, given: tuple, entries_a_row: float, *, with_values: bool = True
) -> tuple[NDArray[np.int32], ...]:
    """Compressed rows whose lengths are not known before: starts, columns and, unless told not to, values.

    ``function(low, high, *given, counts, columns[, values])`` fills a range of rows,
    writes row i's length to ``counts[i + 1]`` and returns how many entries it made, or
    -1 when these did not fit.
    """
    counts = np.zeros(n_rows + 1, dtype=np.int32)

    def fill(low: int, high: int) -> list[NDArray]:
        space = int(entries_a_row * (high - low)) + 1024
        while True:
            parts = [np.empty(space, dtype=np.int32)]
            if with_values:
                parts.append(np.empty(space))
            made = function(low, high, *given, counts, *parts)
            if made >= 0:
                for part in parts:
                    part.resize(made, refcheck=False)
                return parts
            space += space // 2

    blocks = run_blocks(fill, row_blocks(n_rows))
    # in 32 bits: numpy would sum in 64 and, in place, through a buffer
    starts = np.cumsum(counts, dtype=np.int32)
    if len(blocks) == 1:
        return starts, *blocks[0]
    # one kind after the other, so that only that one is there twice
    joined = []
    while blocks[0]:
        joined.append(np.concatenate([parts.pop(0) for parts in blocks]))
    return starts, *joined


def unsigned(*arrays: NDArray) -> tuple[NDArray[np.uint32], ...]:
    """Indices as unsigned 32-bit integers; no copy where they are 32 bits wide.

    Compiled loops test signed indices for "from the end" at every access.
    """
    return tuple(array.astype(np.int32, copy=False).view(np.uint32) for array in arrays)
