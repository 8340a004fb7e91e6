"""Jobs in copies of this process, which have all that it has when they are made: nothing is sent to them."""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from spindle_fem.parallel.background_process import BackgroundProcess, can_be_copied
from spindle_fem.parallel.worker_pool import _dumps
from spindle_fem.parallel.worker_threads import Job


class _Jobs:
    """Jobs that several processes claim one after the other."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        self._jobs = jobs
        self._next = multiprocessing.get_context("fork").Value("q", 0)

    def work_off(self) -> dict[int, Any]:
        """Answers of the jobs that this process claimed, by their places."""
        found = {}
        while (place := self._claimed()) < len(self._jobs):
            found[place] = self._jobs[place]()
        return found

    def sent(self) -> bytes:
        """The answers as bytes: they may hold functions of functions."""
        return _dumps(self.work_off())

    def _claimed(self) -> int:
        with self._next.get_lock():
            self._next.value += 1
            return self._next.value - 1


def in_copies(jobs: Sequence[Job], number: int) -> list[Any]:
    """Answers of jobs in their order; this process takes part.

    Copies take tens of milliseconds to make and end with the last job. What jobs change stays with the copy
    that ran them: all that counts is what they return.

    Parameters
    ----------
    number : int
        Processes at most, this one among them. Alone where processes cannot be copied.

    Raises
    ------
    WorkerDiedError
        A copy ended before its time.

    >>> in_copies([lambda: 3, lambda: 4], 2)
    [3, 4]
    """
    if number <= 1 or len(jobs) <= 1 or not can_be_copied():
        return [job() for job in jobs]
    shared = _Jobs(jobs)
    with ExitStack() as copies:
        others = [
            copies.enter_context(BackgroundProcess(partial(_itself, shared))).ask("sent")
            for _ in range(min(number, len(jobs)) - 1)
        ]
        found = shared.work_off()
        for other in others:
            found |= pickle.loads(other())
    return [found[place] for place in range(len(jobs))]


def start_copy(job: Job) -> Callable[[], Any]:
    """Start a job in a copy of this process; the returned function waits for its answer.

    Where processes cannot be copied the job runs when its answer is asked for.
    """
    process = BackgroundProcess(partial(_itself, _Jobs([job])))
    sent = process.ask("sent")

    def wait() -> Any:
        with process:
            return pickle.loads(sent())[0]

    return wait


def _itself(jobs: _Jobs) -> _Jobs:
    return jobs
