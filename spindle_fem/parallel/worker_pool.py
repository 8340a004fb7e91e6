"""Jobs in other processes of this machine or behind a Dask scheduler."""

from __future__ import annotations

import atexit
import contextlib
import pickle
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic, TypeVar

from spindle_fem.errors import BadInputError, WorkerDiedError
from spindle_fem.parallel.worker_threads import MORE_ROOM, ONE_THREAD, Job, worker_count
from spindle_fem.registry import ADDED

# Worker processes end when idle for so long, s.
IDLE_S = 300
Value = TypeVar("Value")


class Shared(Generic[Value]):
    """An object that many jobs use: pickled to a file when the first of them is sent, read once a worker.

    Later changes of the object do not reach the workers.

    Parameters
    ----------
    >>> Shared([1, 2]).value
    [1, 2]
    """

    def __init__(self, value: Value) -> None:
        self.value = value
        self._path: Path | None = None

    def __reduce__(self) -> tuple:
        if self._path is None:
            folder = TemporaryDirectory(prefix="spindle-fem-")
            weakref.finalize(self, folder.cleanup)
            self._path = Path(folder.name) / "shared.pickle"
            self._path.write_bytes(_dumps(self.value))
        return _shared_at, (str(self._path),)


@lru_cache(maxsize=1)
def _shared_at(path: str) -> Shared:
    """The shared objects; what they compute and cache is kept for the next job."""
    return Shared(pickle.loads(Path(path).read_bytes()))


def _dumps(content: Any) -> bytes:
    from joblib.externals.loky.backend.reduction import dumps

    return bytes(dumps(content))


def _sent(job: Job) -> partial:
    """A job for another process, as it is now, with what this program added to the registries."""
    return partial(_run_sent, _dumps(ADDED), _dumps(job))


def _run_sent(added: bytes, job: bytes) -> Any:
    _add(added)
    return pickle.loads(job)()


@lru_cache(maxsize=1)
def _add(added: bytes) -> None:
    for group, things in pickle.loads(added).items():
        ADDED.setdefault(group, {}).update(things)


def _nothing() -> None:
    """Done by a worker that only has to start and load this package."""


@lru_cache(maxsize=1)
def _executor(number: int) -> Any:
    """Worker processes, kept for the next pool."""
    from joblib.externals.loky import ProcessPoolExecutor

    return ProcessPoolExecutor(number, timeout=IDLE_S, env=ONE_THREAD)


# Before the interpreter takes away what ending a pool needs.
atexit.register(_executor.cache_clear)


class WorkerPool:
    """Processes that run jobs: this one alone, others of this machine with it, or those of a Dask cluster.

    Parameters
    ----------
    number : int
        Processes; below 1 for one a core. Workers end when idle for some minutes.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run everything, in place of ``number``.

    >>> WorkerPool(1).map([lambda: 3, lambda: 4])
    [3, 4]
    """

    def __init__(self, number: int = 1, scheduler: str | None = None) -> None:
        self._number = worker_count(number)
        self._scheduler = scheduler

    @property
    def is_alone(self) -> bool:
        """Whether all work is done by this process."""
        return self._number == 1 and self._scheduler is None

    def size(self) -> int:
        """Jobs that can run at once.

        Raises
        ------
        BadInputError
            Dask is not installed, or no scheduler responds.
        """
        if self._scheduler is None:
            return self._number
        with _client(self._scheduler) as client:
            return max(1, len(client.scheduler_info(n_workers=-1)["workers"]))

    def wake(self) -> None:
        """Start the other processes of :meth:`map`, which takes seconds, and do not wait for them."""
        for _ in range(0 if self._scheduler else self._number - 1):
            _executor(self._number - 1).submit(_nothing)

    def start(self, job: Job, name: str = "") -> Job:
        """Start a job in another process; the returned function waits for its result.

        Without other processes the job runs when its result is requested. The job is sent as it
        is now: what it holds may change afterwards.

        Raises
        ------
        WorkerDiedError
            From the returned function: the process ended before its time.
        """
        if self._number == 1:
            return job
        return partial(_answer_of, _submit(_executor(self._number - 1), job), name or _name_of(job))

    def map(self, jobs: Sequence[Job], names: Sequence[str] = ()) -> list[Any]:
        """Answers of jobs in their order; this process takes part.

        Parameters
        ----------
        jobs : sequence of callable
            That can be sent to another process: functions of modules, perhaps with arguments given.
        names : sequence of str
            Of the jobs, for error messages.

        Raises
        ------
        WorkerDiedError
            A worker process ended before its time; names its job.
        """
        if self._scheduler is not None:
            found = dict(self.stream(jobs, names))
            return [found[place] for place in range(len(jobs))]
        if self._number == 1 or len(jobs) <= 1:
            return [job() for job in jobs]
        from concurrent.futures import ThreadPoolExecutor

        from threadpoolctl import threadpool_limits

        names, executor = _names(jobs, names), _executor(self._number - 1)
        # Sent as they are now, by this thread: what they hold goes on changing while others wait.
        waiting = deque((place, _sent(job)) for place, job in enumerate(jobs))
        found: list[Any] = [None] * len(jobs)

        def work_off(do: Callable[[int, partial], Any]) -> None:
            while waiting:
                try:
                    place, sent = waiting.popleft()
                except IndexError:
                    return  # another thread was quicker
                found[place] = do(place, sent)

        def there(place: int, sent: partial) -> Any:
            return _answer_of(executor.submit(sent), names[place])

        # Each other thread only waits for one worker.
        with ThreadPoolExecutor(min(self._number, len(jobs)) - 1) as threads, threadpool_limits(1):
            others = [threads.submit(work_off, there) for _ in range(min(self._number, len(jobs)) - 1)]
            try:
                work_off(lambda place, _: jobs[place]())
            finally:
                waiting.clear()
        for other in others:
            other.result()
        return found

    def stream(self, jobs: Sequence[Job], names: Sequence[str] = ()) -> Iterator[tuple[int, Any]]:
        """Yield number and result of each job as it finishes; other processes do all of them, if any.

        Parameters
        ----------
        jobs, names
            As of :meth:`map`.

        Raises
        ------
        BadInputError
            Dask is not installed, or no scheduler responds.
        WorkerDiedError
            Two worker processes ended before their time on one job; names it.
        """
        names = _names(jobs, names)
        if self._scheduler is not None:
            yield from _on_cluster(jobs, names, self._scheduler)
        elif self._number == 1 or len(jobs) <= 1:
            for place, job in enumerate(jobs):
                yield place, job()
        else:
            yield from _as_they_come(jobs, names, self._number)


def _names(jobs: Sequence[Job], names: Sequence[str]) -> Sequence[str]:
    return names or [f"{_name_of(job)} {place + 1} of {len(jobs)}" for place, job in enumerate(jobs)]


def _name_of(job: Job) -> str:
    while isinstance(job, partial):
        job = job.func
    return getattr(job, "__name__", type(job).__name__)


def _submit(executor: Any, job: Job) -> Any:
    return executor.submit(_sent(job))


def _answer_of(future: Any, name: str) -> Any:
    """Answer of a job that was sent; names it where its process died."""
    from joblib.externals.loky import BrokenProcessPool

    try:
        return future.result()
    except BrokenProcessPool as error:
        # The next pool gets new processes.
        _executor.cache_clear()
        raise WorkerDiedError(name, "its worker process ended before its time.", MORE_ROOM) from error


def _as_they_come(jobs: Sequence[Job], names: Sequence[str], number: int) -> Iterator[tuple[int, Any]]:
    """Answers of worker processes; no more jobs are sent than can run, so that those running are known.

    Those that run when a process dies are done again, each alone, so that the one it dies of is known.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    from joblib.externals.loky import BrokenProcessPool

    left, running, again, answers = deque(range(len(jobs))), {}, [], []
    while left or running or again or answers:
        if again and not running and not answers:
            place = again.pop(0)
            yield place, _answer_of(_submit(_executor(number), jobs[place]), names[place])
            continue
        try:
            while left and not again and len(running) < number:
                running[_submit(_executor(number), jobs[left[0]])] = left[0]
                left.popleft()
        except BrokenProcessPool:
            _executor.cache_clear()
        yield from answers
        answers = []
        finished, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in finished:
            place = running.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                # The next pool gets new processes.
                _executor.cache_clear()
                again.append(place)
            else:
                answers.append((place, future.result()))


def _on_cluster(jobs: Sequence[Job], names: Sequence[str], address: str) -> Iterator[tuple[int, Any]]:
    with _client(address) as client:
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        # A job that dies with its worker goes to another one; Dask gives up after some.
        places = {client.submit(_sent(job), pure=False): place for place, job in enumerate(jobs)}
        for future in as_completed(list(places)):
            place = places.pop(future)
            try:
                answer = future.result()
            except KilledWorker as error:
                raise WorkerDiedError(
                    f"scheduler {address}, {names[place]}",
                    f"several workers died on it ({error}).",
                    "Give the workers more memory and run the command again.",
                ) from error
            future.release()
            yield place, answer


@contextlib.contextmanager
def _client(address: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ImportError as error:
        raise BadInputError(
            "--scheduler", "needs the package distributed.", "Install spindle-fem[cluster]."
        ) from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise BadInputError(
            f"--scheduler {address}",
            f"no Dask scheduler answers ({error}).",
            "For example tcp://127.0.0.1:8786.",
        ) from error
    with client:
        yield client
