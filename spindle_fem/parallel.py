"""Work in parallel: threads, worker processes, one background process. Nothing else starts any.

A job is a callable without arguments. :func:`in_threads` runs jobs that leave the
interpreter lock alone (compiled loops, compression); a :class:`WorkerPool` runs jobs in
other processes of this machine or behind a Dask scheduler; a :class:`BackgroundProcess`
keeps one object in a copy of this process and answers calls of its methods in their order.

``SPINDLE_FEM_THREADS`` limits all of them; with 1 everything happens in this process, one
thing after the other. Workers compute with one thread each.
"""

from __future__ import annotations

import atexit
import contextlib
import itertools
import os
import pickle
import queue
import sys
import threading
import types
import warnings
import weakref
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from functools import cache, lru_cache, partial
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic, TypeVar

from spindle_fem.errors import BadInputError, SpindleFemError, WorkerDiedError

# Worker processes end when idle for so long, s.
IDLE_S = 300
# A background process that has not answered for so long is taken for dead, s.
PATIENCE_S = 600.0
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
Value = TypeVar("Value")
_ONE: ContextVar[bool] = ContextVar("one_thread", default=False)


def _read_only(content: dict) -> types.MappingProxyType:
    return types.MappingProxyType(content)


# Stages are full of read-only mappings.
ForkingPickler.register(types.MappingProxyType, lambda item: (_read_only, (dict(item),)))


# ------------------------------------------------------------------ how many
@cache
def core_count() -> int:
    """Cores that this process may use; at most ``SPINDLE_FEM_THREADS``."""
    return _asked("SPINDLE_FEM_THREADS") or _given_cores()


@cache
def _thread_count() -> int:
    return _asked("SPINDLE_FEM_THREADS") or _asked("OMP_NUM_THREADS") or _given_cores()


def thread_count() -> int:
    """Threads of compiled loops: one within :func:`one_thread`, else as the environment or the cores say."""
    return 1 if _ONE.get() else _thread_count()


def worker_count(asked: int) -> int:
    """Worker processes: as many as asked for, or one a core below 1."""
    return asked if asked >= 1 else core_count()


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Compiled loops with one thread: the order of sums, and so the last digits, depend on their number."""
    token = _ONE.set(True)
    try:
        yield
    finally:
        _ONE.reset(token)


def _asked(name: str) -> int:
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


# ---------------------------------------------------------- worker processes
class Shared(Generic[Value]):
    """An object that many jobs use: pickled to a file when the first of them is sent, read once a worker.

    Later changes of the object do not reach the workers.

    Parameters
    ----------
    value : object

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
    """What was sent; what it works out on its way is kept for the next job."""
    return Shared(pickle.loads(Path(path).read_bytes()))


def _dumps(content: Any) -> bytes:
    from joblib.externals.loky.backend.reduction import dumps

    return bytes(dumps(content))


def _run_sent(job: bytes) -> Any:
    return pickle.loads(job)()


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
            Dask is not installed, or no scheduler answers.
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
        """Start a job in another process; the returned function waits for its answer.

        Without other processes the job runs when its answer is asked for. The job is sent as it
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
        waiting = deque((place, _dumps(job)) for place, job in enumerate(jobs))
        found: list[Any] = [None] * len(jobs)

        def work_off(do: Callable[[int, bytes], Any]) -> None:
            while waiting:
                try:
                    place, sent = waiting.popleft()
                except IndexError:
                    return  # another thread was quicker
                found[place] = do(place, sent)

        def there(place: int, sent: bytes) -> Any:
            return _answer_of(executor.submit(_run_sent, sent), names[place])

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
        """Number of each job and its answer, as they come; other processes do all of them, where there are.

        Parameters
        ----------
        jobs, names
            As of :meth:`map`.

        Raises
        ------
        BadInputError
            Dask is not installed, or no scheduler answers.
        WorkerDiedError
            A worker process ended before its time; names the jobs that were running.
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
    return executor.submit(_run_sent, _dumps(job))


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
    """Answers of worker processes; no more jobs are sent than can run, so that those running are known."""
    from concurrent.futures import FIRST_COMPLETED, wait

    executor, left = _executor(number), enumerate(jobs)
    running = {_submit(executor, job): place for place, job in itertools.islice(left, number)}
    while running:
        finished, _ = wait(running, return_when=FIRST_COMPLETED)
        involved = "; ".join(names[place] for place in running.values())
        answers = [(running.pop(future), _answer_of(future, involved)) for future in finished]
        running |= {_submit(executor, job): place for place, job in itertools.islice(left, len(answers))}
        yield from answers


def _on_cluster(jobs: Sequence[Job], names: Sequence[str], address: str) -> Iterator[tuple[int, Any]]:
    with _client(address) as client:
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        # A job that dies with its worker goes to another one; Dask gives up after some.
        places = {client.submit(job, pure=False): place for place, job in enumerate(jobs)}
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


# ------------------------------------------------------- a background process
class BackgroundProcess:
    """One object in a copy of this process, made before there is work for it.

    What the object loads and prepares when it is made, and what it is asked for while this
    process computes, costs no waiting time later. Calls are answered in their order. On one
    core, or where processes cannot be copied, the object is made here and answers when an
    answer is waited for. Errors of the object are raised where the answer is waited for.

    Parameters
    ----------
    make : callable
        Makes the object; its methods are what can be asked for. Arguments and answers are pickled.
    beside : bool
        False to have it made here in any case.

    >>> with BackgroundProcess(list) as process:
    ...     _ = process.ask("append", 3)
    ...     count = process.ask("__len__")
    ...     count()
    1
    """

    def __init__(self, make: Callable[[], Any], *, beside: bool = True) -> None:
        self._make = make
        self._asked: list[tuple[str, tuple]] = []
        self._answers: list[tuple[bool, Any]] = []
        self._here: Any = None
        self._connection: Any = None
        if beside and core_count() > 1 and sys.platform.startswith("linux"):
            self._connection, self._process = _copy_of_this_process(make)

    def __enter__(self) -> BackgroundProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, method: str, *arguments: Any) -> Job:
        """Hand a call over; the returned function waits for its answer.

        Raises
        ------
        WorkerDiedError
            From the returned function: the process ended before its time, or does not answer.
        """
        number = len(self._asked)
        self._asked.append((method, arguments if self._connection is None else ()))
        if self._connection is not None:
            with contextlib.suppress(OSError):  # said when the answer is waited for
                self._connection.send((method, arguments))
        return lambda: self._answer_of(number)

    def close(self) -> None:
        """End the process; what was not waited for may be left undone."""
        if self._connection is not None:
            self._connection.close()
            self._process.kill()
            self._process.join()

    def _answer_of(self, number: int) -> Any:
        while len(self._answers) <= number:
            method, arguments = self._asked[len(self._answers)]
            if self._connection is not None:
                self._answers.append(self._receive(method))
            else:
                self._here = self._make() if self._here is None else self._here
                self._answers.append((True, getattr(self._here, method)(*arguments)))
        done, answer = self._answers[number]
        if not done:
            raise answer
        return answer

    def _receive(self, method: str) -> tuple[bool, Any]:
        name = f"{getattr(self._make, '__name__', 'background process')}, {method}"
        try:
            if self._connection.poll(PATIENCE_S):
                return self._connection.recv()
            what = f"no answer within {PATIENCE_S:.0f} s."
        except (EOFError, OSError):
            what = "its process ended before its time."
        return False, WorkerDiedError(name, what, MORE_ROOM)


def _copy_of_this_process(make: Callable[[], Any]) -> tuple[Any, Any]:
    """Connection and process of an object that is made in a fork."""
    import multiprocessing

    mine, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(
        target=_serve, args=(make, theirs, mine), daemon=True
    )
    with warnings.catch_warnings():
        # Later Pythons warn of threads; the copy uses none of them and never returns to the caller.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    theirs.close()
    return mine, process


def _serve(make: Callable[[], Any], connection: Any, other_end: Any) -> None:
    """Answer calls until the other end closes; never returns."""
    from threadpoolctl import threadpool_limits

    other_end.close()
    os.environ.update(ONE_THREAD)
    _thread_count.cache_clear()
    asked: queue.SimpleQueue = queue.SimpleQueue()

    def read() -> None:
        try:
            while True:
                asked.put(connection.recv())
        except (EOFError, OSError):
            asked.put(None)

    try:
        # read at once, so that nobody who only hands over waits for the object
        threading.Thread(target=read, daemon=True).start()
        made = None
        with threadpool_limits(1):
            while (call := asked.get()) is not None:
                method, arguments = call
                try:
                    made = make() if made is None else made
                    answer = True, getattr(made, method)(*arguments)
                except Exception as error:  # noqa: BLE001 - the other end raises it
                    answer = False, _that_can_be_sent(error, method)
                connection.send(answer)
    finally:
        # No clean-up of the copied interpreter: files and windows belong to the original.
        os._exit(0)


def _that_can_be_sent(error: Exception, method: str) -> Exception:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever its pickling raises
        return SpindleFemError(method, f"{type(error).__name__}: {error}")
    return error
