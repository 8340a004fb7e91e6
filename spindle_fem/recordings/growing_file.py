"""Lines of a data file while it is written: only whole ones, through truncation and rotation."""

from __future__ import annotations

import gzip
import os
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.manifest import STANDARD_INPUT

# Bytes that are read at once; a line longer than this many is no line of a recording.
BLOCK, LONGEST_LINE = 1 << 20, 1 << 20

Tell = Callable[[str], None]


class LineSplitter:
    r"""Whole lines of a stream of bytes; what follows the last line end waits for its own.

    >>> lines = LineSplitter()
    >>> lines.take(b"1,2\r\n3,"), lines.take(b"4\n"), lines.rest()
    ([b'1,2'], [b'3,4'], b'')
    """

    def __init__(self) -> None:
        self._rest = b""

    def take(self, content: bytes) -> list[bytes]:
        """Lines that are whole with these further bytes, without their ends.

        Raises
        ------
        RecordingError
            A line does not end.
        """
        *whole, self._rest = (self._rest + content).split(b"\n")
        if len(self._rest) > LONGEST_LINE:
            raise RecordingError("data", f"a line is longer than {LONGEST_LINE} bytes.", "Give a CSV file.")
        return [line.removesuffix(b"\r") for line in whole]

    def rest(self) -> bytes:
        """Return and clear the text that has no line end yet."""
        found, self._rest = self._rest, b""
        return found


def follow_lines(data: Path, *, to_end: bool, poll: float, tell: Tell) -> Iterator[list[bytes]]:
    """Yield lines of a file, or of standard input for ``-``, as they arrive.

    An empty list says that nothing came for a while. A file that is replaced or cut short is read from its
    beginning again, whose first line is the header again.

    Parameters
    ----------
    data : Path
        It may be missing yet, unless ``to_end``.
    to_end : bool
        Stop at the end of what is there; a last line without its end counts.
    poll : float, [s]
        Time between two looks at a file that does not grow.
    tell : callable
        Called with messages on what happened to the file.

    Raises
    ------
    RecordingError
        The file is compressed and to be followed, or cannot be read.
    """
    if str(data) == STANDARD_INPUT:
        yield from _lines_of(os.fdopen(os.dup(0), "rb", buffering=0))
    elif to_end:
        try:
            with gzip.open(data) if data.suffix == ".gz" else data.open("rb") as stream:
                yield from _lines_of(stream)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(str(data), f"cannot be read ({error}).") from error
    elif data.suffix != ".csv":
        raise RecordingError(str(data), "cannot grow.", "Give a .csv file, or --until-end.")
    else:
        yield from _growing(data, poll, tell)


def _lines_of(stream: BinaryIO) -> Iterator[list[bytes]]:
    """Lines up to the end of a stream, the last one with or without its end."""
    lines = LineSplitter()
    with stream:
        while content := stream.read(BLOCK):
            yield lines.take(content)
    if last := lines.rest():
        yield [last]


def _growing(data: Path, poll: float, tell: Tell) -> Iterator[list[bytes]]:
    """Lines of a file that others write, without end."""
    waiting = False
    while True:
        try:
            stream = data.open("rb")
        except FileNotFoundError:
            if not waiting:
                tell(f"{data}: waiting for it")
            waiting = True
            yield []
            time.sleep(poll)
            continue
        lines = LineSplitter()
        with stream:
            own = os.fstat(stream.fileno())
            while True:
                while content := stream.read(BLOCK):
                    yield lines.take(content)
                happened = _lost(data, own.st_ino, stream.tell())
                if happened:
                    # Lines written between the last look and the replacement.
                    yield lines.take(stream.read())
                    tell(f"{data}: {happened}; read from its beginning again")
                    break
                yield []
                time.sleep(poll)


def _lost(data: Path, inode: int, position: int) -> str:
    """Reason why a file is no longer followed; empty if it is still the same file."""
    try:
        now = os.stat(data)
    except FileNotFoundError:
        return "moved away"
    if now.st_ino != inode:
        return "replaced"
    return "cut short" if now.st_size < position else ""
