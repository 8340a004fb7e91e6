"""Run one object in a copy of this process, concurrently with it."""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import queue
import sys
import threading
import types
import warnings
from collections.abc import Callable
from multiprocessing.reduction import ForkingPickler
from typing import Any

from spindle_fem.errors import SpindleFemError, WorkerDiedError
from spindle_fem.parallel import worker_threads
from spindle_fem.parallel.worker_threads import MORE_ROOM, ONE_THREAD, Job, core_count

# A process that has not answered for this time is considered dead, s.
PATIENCE_S = 600.0


def _read_only(content: dict) -> types.MappingProxyType:
    return types.MappingProxyType(content)


# Stages are full of read-only mappings.
ForkingPickler.register(types.MappingProxyType, lambda item: (_read_only, (dict(item),)))


def can_be_copied() -> bool:
    """Whether there is a core for a copy of this process, on a system that can make one."""
    return core_count() > 1 and sys.platform.startswith("linux")


class BackgroundProcess:
    """One object in a copy of this process, created before there is work for it.

    Whatever the object loads, prepares or computes while this process works costs no waiting
    time later. Calls are processed in order. On one
    core, or where processes cannot be copied, the object is created here and works when a
    result is waited for. Errors of the object are raised where the result is waited for.

    Parameters
    ----------
    make : callable
        Makes the object, whose methods can be called. Arguments and results are pickled.
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
        self._calls: list[tuple[str, tuple]] = []
        self._answers: list[tuple[bool, Any]] = []
        self._here: Any = None
        self._connection: Any = None
        if beside and can_be_copied():
            self._connection, self._process = _copy_of_this_process(make)

    def __enter__(self) -> BackgroundProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, method: str, *arguments: Any) -> Job:
        """Submit a call; the returned function waits for its result.

        Raises
        ------
        WorkerDiedError
            From the returned function: the process ended before its time, or does not answer.
        """
        number = len(self._calls)
        self._calls.append((method, arguments if self._connection is None else ()))
        if self._connection is not None:
            with contextlib.suppress(OSError):  # reported when the result is waited for
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
            method, arguments = self._calls[len(self._answers)]
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
    # what the original holds is no garbage of this process, and looking at it would copy it
    gc.freeze()
    os.environ.update(ONE_THREAD)
    # xarray would load Dask, for half a second, to ask whether arrays are Dask's: here none is. Where the
    # original found out that there is a Dask without loading it, xarray does ask.
    if "dask" not in sys.modules:
        answers = types.ModuleType("dask.base")
        answers.is_dask_collection = lambda value: False
        sys.modules |= {"dask": None, "dask.base": answers}
    worker_threads._thread_count.cache_clear()
    # and makes no copies of its own
    worker_threads.core_count.cache_clear()
    asked: queue.SimpleQueue = queue.SimpleQueue()

    def read() -> None:
        try:
            while True:
                asked.put(connection.recv())
        except (EOFError, OSError):
            asked.put(None)

    try:
        # read at once, so that callers who only submit do not wait for the object
        threading.Thread(target=read, daemon=True).start()
        made = None
        with threadpool_limits(1):
            with contextlib.suppress(Exception):  # tried again by the first call, which raises it
                made = make()
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
