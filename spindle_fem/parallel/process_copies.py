"""Jobs in copies of this process, which have all that it has when they are made: nothing is sent to them."""

from __future__ import annotations

import multiprocessing
import pickle
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Generic

from spindle_fem.parallel.background_process import BackgroundProcess, can_be_copied
from spindle_fem.parallel.worker_pool import Value, _dumps
from spindle_fem.parallel.worker_threads import Job


class _Claims:
    """Places of jobs that several processes claim one after the other."""

    def __init__(self) -> None:
        self._next = multiprocessing.get_context("fork").Value("q", 0)

    def restart(self) -> None:
        """Begin with the first place again, while nobody claims any."""
        self._next.value = 0

    def work_off(self, jobs: Sequence[Job]) -> dict[int, Any]:
        """Answers of the jobs that this process claimed, by their places; as the others with one thread."""
        from threadpoolctl import threadpool_limits

        found = {}
        with threadpool_limits(1):
            while (place := self._claimed()) < len(jobs):
                found[place] = jobs[place]()
        return found

    def _claimed(self) -> int:
        with self._next.get_lock():
            self._next.value += 1
            return self._next.value - 1


@dataclass(frozen=True, slots=True)
class _Jobs:
    """Jobs that are there when a process is copied."""

    jobs: Sequence[Job]
    claims: _Claims = field(default_factory=_Claims)

    def sent(self) -> bytes:
        """The answers of those claimed as bytes: they may hold functions of functions."""
        return _dumps(self.claims.work_off(self.jobs))


@dataclass(frozen=True, slots=True)
class _Standing(Generic[Value]):
    """What jobs that are sent later work on."""

    value: Value
    claims: _Claims = field(default_factory=_Claims)

    def sent(self, jobs: bytes) -> bytes:
        """The answers of those claimed."""
        return _dumps(self.work_off(pickle.loads(jobs)))

    def work_off(self, jobs: Sequence[Callable[[Value], Any]]) -> dict[int, Any]:
        """Answers of the jobs that this process claimed, by their places."""
        return self.claims.work_off([partial(job, self.value) for job in jobs])


class StandingCopies(Generic[Value]):
    """Copies of this process that stay, for jobs on one object that come again and again.

    The object, with all that this process has, is copied once; what jobs keep in it stays for later ones.
    Of new copies every page that either process writes has to be copied again.

    Parameters
    ----------
    number : int
        Processes at most, this one among them. Alone where processes cannot be copied.

    >>> with StandingCopies([3, 4], 2) as copies:
    ...     copies.map([sum, max])
    [7, 4]
    """

    def __init__(self, value: Value, number: int) -> None:
        self.value, self._standing = value, _Standing(value)
        others = max(0, number - 1) if can_be_copied() else 0
        self._others = [BackgroundProcess(partial(_itself, self._standing)) for _ in range(others)]

    def __enter__(self) -> StandingCopies[Value]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def map(self, jobs: Sequence[Callable[[Value], Any]]) -> list[Any]:
        """Answers of jobs on the object, in their order; this process takes part.

        Parameters
        ----------
        jobs : sequence of callable
            That can be sent: functions of modules, perhaps with some arguments given.

        Raises
        ------
        WorkerDiedError
            A copy ended before its time.
        """
        if not self._others or len(jobs) <= 1:
            return [job(self.value) for job in jobs]
        self._standing.claims.restart()
        sent = _dumps(list(jobs))
        try:
            waiting = [other.ask("sent", sent) for other in self._others]
            found = self._standing.work_off(jobs)
            for answers in waiting:
                found |= pickle.loads(answers())
        except BaseException:
            # A copy may still be at these jobs, and would claim those of the next time.
            self.close()
            raise
        return [found[place] for place in range(len(jobs))]

    def close(self) -> None:
        """End the copies; this process works alone from then on."""
        while self._others:
            self._others.pop().close()


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
        found = shared.claims.work_off(jobs)
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


def _itself(jobs: Any) -> Any:
    return jobs
