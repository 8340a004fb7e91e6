"""Work in a second process while this one goes on."""

from __future__ import annotations

import io
import json
import os
import pickle
import queue
import select
import sys
import threading
import time
import types
import warnings
from collections.abc import Callable, Mapping
from typing import Any

PATIENCE_S = 120.0
_LENGTH_BYTES = 8


def start_beside(task: Callable[[], Any]) -> Callable[[], Any]:
    """Start ``task`` in a copy of this process; the returned function waits for its answer.

    Where no second process can help (one core, no fork) or it fails, the task
    runs here when its answer is asked for, so that errors are this process's
    own.

    Parameters
    ----------
    task : callable
        Without arguments; writes files, and answers with what JSON can carry.

    >>> start_beside(lambda: {"steps": 3})()
    {'steps': 3}
    """
    if not _can_help():
        return task
    reading, writing = os.pipe()
    child = _fork()
    if child == 0:
        _answer(task, reading, writing)
    os.close(writing)

    def wait() -> Any:
        answer = _read_all(reading)
        os.close(reading)
        if answer is None:
            os.kill(child, 9)
        _, status = os.waitpid(child, 0)
        return task() if status != 0 or answer is None else json.loads(answer)

    return wait


class Helper:
    """A worker in a copy of this process, made before there is work for it.

    What the worker loads and prepares when it is made, and what it is asked
    for while this process computes, costs no waiting time later. Requests are
    answered in their order. Where no second process can help, or it fails,
    the worker is made here when an answer is waited for and does everything
    again that was asked, so that errors are this process's own.

    Parameters
    ----------
    make : callable
        Makes the worker; its methods are what can be asked for. Arguments and
        answers are pickled.
    beside : bool
        False to have it made here in any case.

    >>> with Helper(list) as helper:
    ...     _ = helper.ask("append", 3)
    ...     count = helper.ask("__len__")
    ...     count()
    1
    """

    def __init__(self, make: Callable[[], Any], *, beside: bool = True) -> None:
        self._make = make
        self._asked: list[tuple[str, tuple]] = []
        self._answers: list[Any] = []
        self._here: Any = None
        self._child = 0
        if not (beside and _can_help()):
            return
        to_child, self._writing = os.pipe()
        self._reading, from_child = os.pipe()
        self._child = _fork()
        if self._child == 0:
            os.close(self._writing)
            os.close(self._reading)
            _serve(make, to_child, from_child)
        os.close(to_child)
        os.close(from_child)

    def __enter__(self) -> Helper:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def ask(self, method: str, *arguments: Any) -> Callable[[], Any]:
        """Hand a call over; the returned function waits for its answer."""
        number = len(self._asked)
        self._asked.append((method, arguments))
        if self._child:
            try:
                _send(self._writing, (method, arguments))
            except OSError:
                self._give_up()
        return lambda: self._answer_of(number)

    def close(self) -> None:
        """End the process; what was not waited for may be left undone."""
        if self._child:
            self._give_up()

    def _answer_of(self, number: int) -> Any:
        while self._child and len(self._answers) <= number:
            done, answer = _receive(self._reading)
            if done:
                self._answers.append(answer)
            else:
                self._give_up()
        if len(self._answers) <= number:
            if self._here is None:
                # answers of a process that failed are made anew: its worker is gone with what it knew
                self._here, self._answers = self._make(), []
            for method, arguments in self._asked[len(self._answers) : number + 1]:
                self._answers.append(getattr(self._here, method)(*arguments))
        return self._answers[number]

    def _give_up(self) -> None:
        os.close(self._writing)
        os.close(self._reading)
        os.kill(self._child, 9)
        os.waitpid(self._child, 0)
        self._child = 0


def _can_help() -> bool:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    return cores > 1 and sys.platform.startswith("linux")


def _fork() -> int:
    with warnings.catch_warnings():
        # Later Pythons warn of threads; the copy uses none of them and never returns to the caller.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _answer(task: Callable[[], Any], reading: int, writing: int) -> None:
    status = 1
    try:
        os.close(reading)
        _write_all(writing, json.dumps(task()).encode())
        status = 0
    finally:
        # No clean-up of the copied interpreter: files and windows belong to the original.
        os._exit(status)


def _serve(make: Callable[[], Any], reading: int, writing: int) -> None:
    """Answer requests until there are none or one fails; never returns."""
    try:
        asked: queue.SimpleQueue = queue.SimpleQueue()
        # read at once, so that nobody waits for the worker who only hands over
        threading.Thread(target=_read_requests, args=(reading, asked), daemon=True).start()
        worker = make()
        while (request := asked.get()) is not None:
            method, arguments = request
            _send(writing, getattr(worker, method)(*arguments))
    finally:
        # No clean-up of the copied interpreter: files and windows belong to the original.
        os._exit(0)


def _read_requests(reading: int, asked: queue.SimpleQueue) -> None:
    done = True
    while done:
        done, request = _receive(reading, patience=None)
        asked.put(request)


class _Pickler(pickle.Pickler):
    """Read-only mappings, which a stage is full of, are pickled too."""

    def reducer_override(self, item: Any) -> Any:
        return (_read_only, (dict(item),)) if isinstance(item, types.MappingProxyType) else NotImplemented


def _read_only(content: dict) -> Mapping:
    return types.MappingProxyType(content)


def _send(descriptor: int, content: Any) -> None:
    buffer = io.BytesIO()
    _Pickler(buffer, protocol=pickle.HIGHEST_PROTOCOL).dump(content)
    size = buffer.tell()
    _write_all(descriptor, size.to_bytes(_LENGTH_BYTES, "little"))
    _write_all(descriptor, buffer.getbuffer())


def _receive(descriptor: int, patience: float | None = PATIENCE_S) -> tuple[bool, Any]:
    """Whether something came, and what."""
    end = None if patience is None else time.monotonic() + patience
    head = _read(descriptor, _LENGTH_BYTES, end)
    if head is None:
        return False, None
    content = _read(descriptor, int.from_bytes(head, "little"), end)
    return (False, None) if content is None else (True, pickle.loads(content))


def _read(descriptor: int, size: int, end: float | None) -> bytearray | None:
    """So many bytes; None when the other end closes or time is over."""
    received = bytearray()
    while len(received) < size:
        piece = _read_piece(descriptor, min(size - len(received), 1 << 20), end)
        if not piece:
            return None
        received += piece
    return received


def _read_all(descriptor: int) -> bytes | None:
    received = b""
    end = time.monotonic() + PATIENCE_S
    while (piece := _read_piece(descriptor, 65536, end)) is not None:
        if not piece:
            return received
        received += piece
    return None


def _read_piece(descriptor: int, size: int, end: float | None) -> bytes | None:
    if end is not None:
        ready, _, _ = select.select([descriptor], [], [], max(0.0, end - time.monotonic()))
        if not ready:
            return None
    return os.read(descriptor, size)


def _write_all(descriptor: int, content: bytes | memoryview) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(descriptor, view) :]
