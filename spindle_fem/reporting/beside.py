"""Run one task in a second process while this one goes on."""

from __future__ import annotations

import json
import os
import select
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

PATIENCE_S = 120.0


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
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    if cores < 2 or not sys.platform.startswith("linux"):
        return task
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # Later Pythons warn of threads; the copy uses none of them and never returns to the caller.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _answer(task, reading, writing)
    os.close(writing)

    def wait() -> Any:
        answer = _read_all(reading)
        os.close(reading)
        _, status = os.waitpid(child, 0)
        return task() if status != 0 or answer is None else json.loads(answer)

    def _read_all(descriptor: int) -> bytes | None:
        received = b""
        end = time.monotonic() + PATIENCE_S
        while True:
            ready, _, _ = select.select([descriptor], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                os.kill(child, 9)
                return None
            piece = os.read(descriptor, 65536)
            if not piece:
                return received
            received += piece

    return wait


def _answer(task: Callable[[], Any], reading: int, writing: int) -> None:
    status = 1
    try:
        os.close(reading)
        answer = json.dumps(task()).encode()
        while answer:
            answer = answer[os.write(writing, answer) :]
        status = 0
    finally:
        # No clean-up of the copied interpreter: files and windows belong to the original.
        os._exit(status)
