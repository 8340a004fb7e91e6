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

from spindle_fem.conduction.memory import room

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
    function: Callable,
    n_rows: int,
    given: tuple,
    entries_a_row: float,
    kinds: tuple[type, ...] = (np.int32, np.float64),
) -> tuple[NDArray, ...]:
    """Compressed rows whose lengths are not known before: starts, columns and what goes with them.

    ``function(low, high, *given, counts, columns, ...)`` fills a range of rows, writes
    row i's length to ``counts[i + 1]`` and returns how many entries it made, or -1 when
    these did not fit. ``kinds`` are the types of the columns and of the others.
    """
    counts = np.zeros(n_rows + 1, dtype=np.int32)
    blocks = row_blocks(n_rows)
    spaces = [int(entries_a_row * rows) + 1024 for rows in np.diff(blocks)]
    while True:
        begins = np.concatenate(([0], np.cumsum(spaces)))
        parts = [room(int(begins[-1]), kind) for kind in kinds]

        def fill(low: int, high: int, begins: NDArray = begins, parts: list[NDArray] = parts) -> int:
            k = int(np.searchsorted(blocks, low, side="right")) - 1
            return function(low, high, *given, counts, *(part[begins[k] : begins[k + 1]] for part in parts))

        made = run_blocks(fill, blocks)
        if min(made) >= 0:
            break
        spaces = [
            space + (space // 2 if entries < 0 else 0) for space, entries in zip(spaces, made, strict=True)
        ]
    # in 32 bits: numpy would sum in 64 and, in place, through a buffer
    starts = np.cumsum(counts, dtype=np.int32)
    for part in parts:
        end = made[0]
        for begin, entries in zip(begins[1:-1], made[1:], strict=True):
            _move(part, begin, end, entries)
            end += entries
    # the rest was never touched and takes no memory
    return starts, *(part[: starts[-1]] for part in parts)


def _move(array: NDArray, begin: int, to: int, count: int) -> None:
    """Move a slice towards the front, in pieces that do not overlap themselves."""
    gap = begin - to
    for done in range(0, count if gap else 0, max(gap, 1)):
        size = min(gap, count - done)
        array[to + done : to + done + size] = array[begin + done : begin + done + size]


def unsigned(*arrays: NDArray) -> tuple[NDArray[np.uint32], ...]:
    """Indices as unsigned 32-bit integers; no copy where they are 32 bits wide.

    Compiled loops test signed indices for "from the end" at every access.
    """
    return tuple(array.astype(np.int32, copy=False).view(np.uint32) for array in arrays)
