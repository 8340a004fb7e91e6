"""Memory of freed arrays, kept for the next ones."""

from __future__ import annotations

import ctypes
import sys

# Options of glibc's ``mallopt``: free memory [bytes] that stays before the end of it goes back to the system,
# the largest that fits the argument, and size from which on an array has pages of its own, which go at once.
KEPT = {-1: (1 << 31) - 1, -3: 1 << 30}


def keep_freed_memory() -> None:
    """Have this process and its copies keep freed arrays instead of giving them back to the system.

    The system clears every page that it gives out: a tenth of the time of a diagnosis, whose arrays of
    megabytes live for milliseconds. Nothing changes where the library of C is not glibc.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    for option, size in KEPT.items() if mallopt else ():
        mallopt(option, size)
