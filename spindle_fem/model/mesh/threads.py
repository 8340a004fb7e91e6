"""Ranges of rows and chunks of work that threads share in compiled loops."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.parallel import hand_over, in_threads, thread_count

# A block of fewer rows costs more to hand over than it saves.
LEAST_ROWS = 15_000
# A chunk of work for a team: few hand-overs against some 20 µs of work, and all threads end together.
ENTRIES_A_CHUNK = 30_000
MOST_CHUNKS = 32
# Room for the two counters of a team, on cache lines of their own.
N_COUNTERS = 32


def row_blocks(n_rows: int) -> NDArray[np.int64]:
    """Bounds of the ranges that threads work on, (n_blocks + 1,)."""
    count = max(1, min(thread_count(), n_rows // LEAST_ROWS))
    return np.linspace(0, n_rows, count + 1).astype(np.int64)


def chunk_bounds(starts: NDArray) -> NDArray[np.int64]:
    """Bounds of ranges of compressed rows with about as many entries each, (n_chunks + 1,).

    They do not depend on the number of threads, so that neither do sums over them.
    """
    total = int(starts[-1])
    count = max(1, min(total // ENTRIES_A_CHUNK, MOST_CHUNKS, len(starts) - 1))
    bounds = np.searchsorted(starts, np.linspace(0, total, count + 1)).astype(np.int64)
    bounds[0], bounds[-1] = 0, len(starts) - 1
    return bounds


def run_team(function: Callable, n_chunks: int, *arguments: object) -> None:
    """Call ``function(is_first, counters, *arguments)`` in as many threads as are worth it.

    For loops whose members claim chunks from the counters
    (:mod:`spindle_fem.model.mesh.kernels.team_loops`): the calling thread is the first and
    returns when all is done, whoever did it. Others join when they come; one that finds
    nothing left to claim leaves again.
    """
    counters = np.zeros(N_COUNTERS, dtype=np.int64)
    count = min(thread_count(), n_chunks)
    if count > 1:
        hand_over(count - 1, partial(function, False, counters, *arguments))
    function(True, counters, *arguments)


def run_blocks(function: Callable, bounds: NDArray[np.int64], *arguments: object) -> list:
    """Call ``function(low, high, *arguments)`` for every range, and return what the calls return."""
    return in_threads([partial(function, low, high, *arguments) for low, high in itertools.pairwise(bounds)])


def dots(rows: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scalar products of each row (k, n) with a vector (n,), whose digits no number of threads changes."""
    return sum(run_blocks(lambda low, high: rows[:, low:high] @ vector[low:high], _pieces(len(vector))))


def combined(weights: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum of rows (k, n) times weights (k,), (n,)."""
    answer = np.empty(rows.shape[1])

    def fill(low: int, high: int) -> None:
        np.dot(weights, rows[:, low:high], out=answer[low:high])

    run_blocks(fill, _pieces(len(answer)))
    return answer


def product(rows: NDArray, columns: NDArray) -> NDArray:
    """``A C`` of tall rows (n, k) and a small matrix (k, m) of one precision."""
    answer = room((len(rows), columns.shape[1]), rows.dtype)

    def fill(low: int, high: int) -> None:
        np.matmul(rows[low:high], columns, out=answer[low:high])

    run_blocks(fill, _pieces(len(rows)))
    return answer


def inner_product(rows: NDArray, others: NDArray) -> NDArray[np.float64]:
    """``Aᵀ B`` of two tall matrices (n, k) and (n, m), pieces of them added in double precision."""
    bounds = _pieces(len(rows))
    return sum(run_blocks(lambda low, high: (rows[low:high].T @ others[low:high]).astype(float), bounds))


def _pieces(size: int) -> NDArray[np.int64]:
    """Bounds of pieces of a vector that do not depend on the number of threads."""
    return np.linspace(0, size, max(1, size // LEAST_ROWS) + 1).astype(np.int64)


def fill_rows(
    function: Callable,
    n_rows: int,
    given: tuple,
    entries_a_row: float,
    kinds: tuple[type, ...] = (np.int32, np.float64),
) -> tuple[NDArray, ...]:
    """Fill compressed rows of unknown length: starts, columns and their entries.

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
