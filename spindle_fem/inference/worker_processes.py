"""Work on one problem at once, fits of several hypotheses above all, in processes of their own."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from uuid import uuid4

from joblib.externals.loky import BrokenProcessPool, ProcessPoolExecutor
from joblib.externals.loky.backend.reduction import dumps
from threadpoolctl import threadpool_limits

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.inference.hypothesis_fit import MOST_ITERATIONS, Fit, Problem, amplitude_name

# How long other processes wait for the next fit, s.
IDLE = 300
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


@dataclass(frozen=True, slots=True)
class FitOrder:
    """One fit that is wanted.

    Attributes
    ----------
    candidates : tuple of Candidate
    start : mapping of str to float
        Values to begin from, by name.
    shares : tuple of float
        Of the amplitudes at the start, tried one after the other until the set can be simulated.
    hopeless : float
        As :meth:`Problem.fit` takes it.
    iterations : int
    """

    candidates: tuple[Candidate, ...]
    start: Mapping[str, float]
    shares: tuple[float, ...] = (1.0,)
    hopeless: float = float("inf")
    iterations: int = MOST_ITERATIONS


def fit_order(problem: Problem, order: FitOrder) -> Fit | None:
    """Fit; None where the set cannot be simulated from any share of its amplitudes."""
    for share in order.shares:
        values = dict(order.start)
        for candidate in order.candidates:
            name = amplitude_name(candidate)
            if name in values:
                values[name] = candidate.null + share * (values[name] - candidate.null)
        try:
            return problem.fit(order.candidates, values, iterations=order.iterations, hopeless=order.hopeless)
        except (ConvergenceError, OutOfValidityError, SpecError):
            continue
    return None


@lru_cache(maxsize=1)
def _problem_at(path: str) -> Problem:
    """A problem that was sent; what it works out on its way is kept for the next fit."""
    return pickle.loads(Path(path).read_bytes())


@lru_cache(maxsize=1)
def _others(number: int) -> ProcessPoolExecutor:
    """Other processes, kept for the next diagnosis; joblib's own, which a sweep uses, are left alone."""
    return ProcessPoolExecutor(number, timeout=IDLE, env=ONE_THREAD)


def _done_there(path: str, job: bytes) -> Any:
    """Do a job on a problem, both as they were sent, in another process."""
    return pickle.loads(job)(_problem_at(path))


def _done_ahead(job: bytes) -> Any:
    """Do a job as it was sent, in another process."""
    return pickle.loads(job)()


def _ready() -> None:
    """Nothing; but whoever does it has read the modules that fits need."""


class Workers:
    """Who fit: this process alone, or several with it.

    Parameters
    ----------
    number : int
        Processes, this one among them. The others end when idle for some minutes.
    """

    def __init__(self, number: int = 1) -> None:
        self._number = number
        self._folder: TemporaryDirectory[str] | None = None
        self._sent: tuple[Problem, str] | None = None

    def wake(self) -> None:
        """Start the other processes, which takes them seconds, while this one has other things to do."""
        for _ in range(self._number - 1):
            _others(self._number - 1).submit(_ready)

    def fits(self, problem: Problem, orders: Sequence[FitOrder]) -> list[Fit | None]:
        """Fits in the order asked for, with the candidates that were given.

        Parameters
        ----------
        problem : Problem
        orders : sequence of FitOrder
        """
        fits = self.done(problem, [partial(fit_order, order=order) for order in orders])
        # Candidates are known by identity; those that come back are copies.
        return [
            None if fit is None else replace(fit, candidates=order.candidates)
            for fit, order in zip(fits, orders, strict=True)
        ]

    def done(self, problem: Problem, jobs: Sequence[Callable[[Problem], Any]]) -> list[Any]:
        """What each job makes of the problem, in their order.

        Parameters
        ----------
        problem : Problem
        jobs : sequence of callable
            That can be sent to another process: functions of modules, perhaps with some arguments given.
        """
        if self._number == 1 or len(jobs) <= 1:
            return [job(problem) for job in jobs]
        path, beside = self._send(problem), min(self._number, len(jobs)) - 1
        executor = _others(self._number - 1)
        # Sent as they are now, by this thread: what they hold goes on changing while others wait.
        waiting = deque((position, job, dumps(job)) for position, job in enumerate(jobs))
        found: list[Any] = [None] * len(jobs)

        def work_off(do: Callable[[Callable[[Problem], Any], bytes], Any]) -> None:
            while waiting:
                try:
                    position, job, sent = waiting.popleft()
                except IndexError:
                    # Another thread was quicker.
                    return
                found[position] = do(job, sent)

        def there(job: Callable[[Problem], Any], sent: bytes) -> Any:
            try:
                return executor.submit(_done_there, path, bytes(sent)).result()
            except BrokenProcessPool:
                # One of them was killed: the next diagnosis gets new ones.
                _others.cache_clear()
                raise

        with ThreadPoolExecutor(beside) as threads, threadpool_limits(1):
            others = [threads.submit(work_off, there) for _ in range(beside)]
            work_off(lambda job, sent: job(problem))
        for other in others:
            other.result()
        return found

    def ahead(self, job: Callable[[], Any]) -> Callable[[], Any]:
        """Start a job in another process; the returned function waits for what it makes.

        Where there is no other process the job is done when it is waited for.

        Parameters
        ----------
        job : callable
            That can be sent, as those of :meth:`done`.
        """
        if self._number == 1:
            return job
        return _others(self._number - 1).submit(_done_ahead, bytes(dumps(job))).result

    def _send(self, problem: Problem) -> str:
        """File from which other processes take a problem, written once."""
        if self._sent is None or self._sent[0] is not problem:
            if self._folder is None:
                self._folder = TemporaryDirectory(prefix="spindle-fem-")
            path = Path(self._folder.name) / f"problem-{uuid4().hex}"
            path.write_bytes(dumps(problem))
            self._sent = problem, str(path)
        return self._sent[1]
