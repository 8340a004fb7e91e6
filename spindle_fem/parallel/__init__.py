"""Work in parallel: threads, worker processes, one background process. Nothing else starts any.

A job is a callable without arguments. :func:`in_threads` runs jobs that leave the
interpreter lock alone (compiled loops, compression); a :class:`WorkerPool` runs jobs in
other processes of this machine or behind a Dask scheduler; a :class:`BackgroundProcess`
keeps one object in a copy of this process and answers calls of its methods in their order;
:func:`in_copies` runs jobs in copies of this process, to which nothing need be sent, and
:class:`StandingCopies` are such copies that stay.

``SPINDLE_FEM_THREADS`` limits all of them; with 1 everything happens in this process, one
thing after the other. Workers compute with one thread each.
"""

from __future__ import annotations

from spindle_fem.parallel.background_process import BackgroundProcess, can_be_copied
from spindle_fem.parallel.kept_memory import keep_freed_memory
from spindle_fem.parallel.process_copies import StandingCopies, in_copies, start_copy
from spindle_fem.parallel.worker_pool import Shared, WorkerPool
from spindle_fem.parallel.worker_threads import (
    beside,
    core_count,
    hand_over,
    in_threads,
    one_thread,
    thread_count,
    worker_count,
)

__all__ = [
    "BackgroundProcess",
    "Shared",
    "StandingCopies",
    "WorkerPool",
    "beside",
    "can_be_copied",
    "core_count",
    "hand_over",
    "in_copies",
    "in_threads",
    "keep_freed_memory",
    "one_thread",
    "start_copy",
    "thread_count",
    "worker_count",
]
