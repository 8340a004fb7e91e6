"""Lock a folder, so that only one study at a time writes to it."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from spindle_fem.errors import BadInputError


def lock_path(folder: str | Path) -> Path:
    """The lock of a folder: a hidden file beside it, there while a study runs."""
    path = Path(folder).resolve()
    return path.with_name(f".{path.name}.sweep-lock")


@contextlib.contextmanager
def folder_lock(folder: str | Path) -> Iterator[None]:
    """Hold a folder for one study; the system lets go of it when the process ends, however it ends.

    Raises
    ------
    BadInputError
        Another study runs in the folder, or no lock can be written beside it.
    """
    path = lock_path(folder)
    stream = _open_locked(path, str(folder))
    try:
        stream.seek(0)
        stream.truncate()
        stream.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        stream.flush()
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()
        stream.close()


def _open_locked(path: Path, folder: str) -> IO[str]:
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            stream = path.open("a+", encoding="utf-8")
        except OSError as error:
            raise BadInputError(
                folder, f"cannot be locked ({error.strerror}).", "Give another folder."
            ) from error
        if not _try_lock(stream):
            stream.seek(0)
            owner = stream.read().strip() or "another process"
            stream.close()
            raise BadInputError(
                folder,
                f"is in use: {owner} runs a study in it.",
                "Wait for it, or give another folder; what it solves is kept and reused.",
            )
        # The owner before may have removed the file between our opening and our lock.
        with contextlib.suppress(OSError):
            if os.stat(path).st_ino == os.fstat(stream.fileno()).st_ino:
                return stream
        stream.close()


def _try_lock(stream: IO[str]) -> bool:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        try:
            stream.seek(0)
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
