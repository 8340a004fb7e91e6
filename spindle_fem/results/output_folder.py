"""Output folders that are complete or marked as incomplete."""

from __future__ import annotations

import errno
import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Set
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.results.run_log import logged_in

MARKER = "INCOMPLETE"
# Longest quoted part of a message about a damaged file, characters.
_MOST_QUOTED = 200
# Errors of the system that say nothing about what is read.
_WRITING = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM)
# Files that only commands of this program write; pages, tables and figures may be anyone's. Definitions and
# studies are left out: a user's own stands beside the data, and would be written over.
# A drafted recording is for its user to check and edit: no results are written beside it.
_OWN = frozenset(
    {
        "summary.json",
        "fields.vtu",
        "result.nc",
        "crosscheck.json",
        "simulation.json",
        "simulated.csv",
        "diagnosis.json",
        "diagnoses.json",
        "diagnoses.csv",
        "plan.json",
        "states.csv",
        "heat.json",
        "heat.csv",
        "sweep.json",
        "transient.json",
        "fields.vtkhdf",
        "state_space.npz",
        "state_space.json",
        "simulation.nc",
    }
)


@contextmanager
def output_folder(folder: str | Path, *, own: Set[str] = _OWN) -> Iterator[Path]:
    """Folder that carries a file ``INCOMPLETE`` until its block ends without error.

    Files of an earlier run are replaced one by one; whatever else is there is
    left alone. After an error the marker stays and names it. ``log.txt`` records
    the command and its outcome.

    Parameters
    ----------
    folder : str or Path
        Made with its parents where it does not exist.
    own : set of str
        Files by which a folder of an earlier run is known.

    Raises
    ------
    BadInputError
        The path is a file, cannot be written, or is a folder with other
        content in which this program has not written before.
    """
    path = Path(folder)
    if path.exists() and not path.is_dir():
        raise BadInputError(str(path), "is a file.", "Give a folder, new or of an earlier run.")
    if path.is_dir():
        present = {item.name for item in path.iterdir()}
        if present and not present & {MARKER, *own}:
            raise BadInputError(
                str(path),
                f"is a folder with other content ({', '.join(sorted(present)[:3])}).",
                "Give a new folder, or one of an earlier run.",
            )
    marker = path / MARKER
    try:
        path.mkdir(parents=True, exist_ok=True)
        marker.write_text("This folder is being written.\n", encoding="utf-8")
    except OSError as error:
        raise BadInputError(
            str(path), f"cannot be written ({error.strerror}).", "Give another folder."
        ) from error
    try:
        with logged_in(path):
            yield path
    except BaseException as error:
        # On a full disk the marker stays, without its text.
        with suppress(OSError):
            reason = f"{type(error).__name__}: {error}"
            said = "was interrupted." if isinstance(error, KeyboardInterrupt) else f"did not finish: {reason}"
            text = f"The command {said}\n"
            marker.write_text(text, encoding="utf-8", errors="replace")
        raise
    marker.unlink(missing_ok=True)


def is_complete(folder: str | Path) -> bool:
    """Whether a folder exists and no command left it unfinished."""
    path = Path(folder)
    return path.is_dir() and not (path / MARKER).exists()


def require_complete(folder: str | Path) -> Path:
    """Path of a finished output folder.

    Raises
    ------
    BadInputError
        There is no such folder, or it carries the marker.
    """
    path = Path(folder)
    if not path.is_dir():
        raise BadInputError(str(path), "there is no such folder.", "Give the folder of a finished run.")
    if not is_complete(path):
        reason = (path / MARKER).read_text(encoding="utf-8", errors="replace").strip()
        raise BadInputError(str(path), f"is incomplete: {reason}", "Run the command again.")
    return path


def replace_text(path: Path, text: str) -> Path:
    """Write a text file by renaming, so that no reader sees half of it."""
    return replace_bytes(path, text.encode("utf-8"))


def replace_bytes(path: Path, content: bytes) -> Path:
    """Write a file by renaming, so that no reader sees half of it and a full disk leaves nothing behind."""
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
    return path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path beside a file, with its ending, that takes the file's place when the block ends well."""
    partial = path.with_name(f"{path.stem}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def reading_results(folder: str | Path) -> Iterator[None]:
    """Tells files of a finished folder that somebody damaged or changed as what they are.

    Raises
    ------
    BadInputError
        Whatever the block raised that is no error of its own kind: the files
        are this program's, so they hold all that it looks for. That a disk is
        full or cannot be written is passed on.
    """
    try:
        yield
    except SpindleFemError:
        raise
    except (ArithmeticError, AttributeError, EOFError, LookupError, RuntimeError, TypeError) as error:
        raise _damaged(folder, error) from error
    except (OSError, ValueError, zlib.error, zipfile.BadZipFile, ElementTree.ParseError) as error:
        if isinstance(error, OSError) and error.errno in _WRITING:
            raise
        raise _damaged(folder, error) from error


def _damaged(folder: str | Path, error: Exception) -> BadInputError:
    cause = " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_QUOTED]
    return BadInputError(
        str(folder), f"holds a file that was damaged or changed ({cause}).", "Run the command again."
    )


def read_content(path: Path, schema: str, command: str) -> dict[str, Any]:
    """Content of the JSON file in which a command keeps what it found.

    Raises
    ------
    BadInputError
        No such file, no JSON, or another schema.
    """
    if not path.is_file():
        raise BadInputError(str(path), "there is no such file.", f"Run spindle-fem {command}.")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInputError(
            str(path), f"is not valid JSON: {error}.", f"Run spindle-fem {command} again."
        ) from error
    found = content.get("schema") if isinstance(content, dict) else None
    if found != schema:
        raise BadInputError(str(path), f"schema {found!r} is not known.", f"Allowed: {schema}.")
    return content
