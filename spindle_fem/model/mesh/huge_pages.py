"""Allocate large arrays in large pages.

The first touch of each page of fresh memory costs about a microsecond, which for
pages of 4 kB is as much as filling it. Linux provides pages of 2 MB on request.
"""

from __future__ import annotations

import math
import mmap

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE_PAGE = 1 << 21
# Smaller arrays come from numpy.
LEAST_BYTES = 1 << 20


def room(shape: int | tuple[int, ...], kind: DTypeLike = np.float64) -> NDArray:
    """An array that is not filled.

    >>> room((2, 3)).shape
    (2, 3)
    """
    count = math.prod(shape) if isinstance(shape, tuple) else int(shape)
    size = count * np.dtype(kind).itemsize
    if size < LEAST_BYTES or not hasattr(mmap, "MADV_HUGEPAGE"):
        return np.empty(shape, dtype=kind)
    # what lies before the first and behind the last large page is never touched
    block = mmap.mmap(-1, size + LARGE_PAGE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    block.madvise(mmap.MADV_HUGEPAGE)
    start = -np.frombuffer(block, dtype=np.uint8).ctypes.data % LARGE_PAGE
    # no view of bytes: sparse arrays copy what they take for a small part of something larger
    return np.frombuffer(block, dtype=kind, count=count, offset=start).reshape(shape)
