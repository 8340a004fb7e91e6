"""Limits on threads and workers, and jobs in threads of this process."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from functools import cache
from typing import Any

# Environment of a worker: it computes with one thread.
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "SPINDLE_FEM_THREADS",
    ),
    "1",
)
MORE_ROOM = "Free memory, or set SPINDLE_FEM_THREADS=1 to work in one process."

Job = Callable[[], Any]
_ONE: ContextVar[bool] = ContextVar("one_thread", default=False)


# ------------------------------------------------------------------ how many
@cache
def core_count() -> int:
    """Cores that this process may use; at most ``SPINDLE_FEM_THREADS``."""
    return _from_environment("SPINDLE_FEM_THREADS") or _given_cores()


@cache
def _thread_count() -> int:
    return _from_environment("SPINDLE_FEM_THREADS") or _from_environment("OMP_NUM_THREADS") or _given_cores()


def thread_count() -> int:
    """Threads of compiled loops: one within :func:`one_thread`, else set by environment or cores."""
    return 1 if _ONE.get() else _thread_count()


def worker_count(asked: int) -> int:
    """Number of worker processes: the given number, or one per core if below 1."""
    return asked if asked >= 1 else core_count()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Compiled loops with one thread: the order of sums, and so the last digits, depend on their number."""
    token = _ONE.set(True)
    try:
        yield
    finally:
        _ONE.reset(token)


def _from_environment(name: str) -> int:
    given = os.environ.get(name, "")
    return int(given) if given.isdigit() else 0


def _given_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


# ------------------------------------------------------------------- threads
@cache
def _waiting_threads(count: int, process: int) -> queue.SimpleQueue:
    """Queue that ``count`` threads of a process wait at; handing over to a pool takes five times as long."""
    jobs: queue.SimpleQueue = queue.SimpleQueue()

    def serve() -> None:
        while True:
            jobs.get()()

    for index in range(count):
        threading.Thread(target=serve, name=f"spindle-fem-{index}", daemon=True).start()
    return jobs


def hand_over(count: int, job: Job) -> None:
    """Have a job called by ``count`` other threads, once each, without waiting for them."""
    jobs = _waiting_threads(count, os.getpid())
    for _ in range(count):
        jobs.put(job)


def in_threads(jobs: Sequence[Job]) -> list:
    """Answers of jobs in their order, each run by whatever thread is free; the calling one takes part."""
    answers: list = [None] * len(jobs)
    places, done = iter(range(len(jobs))), queue.SimpleQueue()

    def work() -> None:
        # taking the next of a range is one step of the interpreter
        for place in places:
            try:
                answers[place] = jobs[place]()
                done.put(None)
            except Exception as error:  # noqa: BLE001 - the caller raises it
                done.put(error)

    count = min(thread_count(), len(jobs))
    if count > 1:
        hand_over(count - 1, work)
    work()
    errors = [done.get() for _ in jobs]
    for error in errors:
        if error is not None:
            raise error
    return answers


def beside(job: Job) -> Job:
    """Start a job in another thread; the returned function waits for its result.

    With one core the job starts when it is waited for.
    """
    if core_count() == 1:
        return job
    answer: queue.SimpleQueue = queue.SimpleQueue()

    def work() -> None:
        try:
            answer.put((job(), None))
        except Exception as error:  # noqa: BLE001 - who waits raises it
            answer.put((None, error))

    def wait() -> Any:
        value, error = answer.get()
        if error is not None:
            raise error
        return value

    hand_over(1, work)
    return wait
