"""Output folders that are complete or say that they are not."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from spindle_fem.errors import BadInputError
from spindle_fem.results.run_log import logged_in

MARKER = "INCOMPLETE"
# What only commands of this program write: pages and figures may be anybody's, the rest is the user's.
_OWN = frozenset(
    {
        MARKER,
        "summary.json",
        "fields.vtu",
        "result.nc",
        "machine.toml",
        "crosscheck.json",
        "results.csv",
        "simulation.json",
        "simulated.csv",
        "calibrated_machine.toml",
        "diagnosis.json",
        "diagnoses.json",
        "diagnoses.csv",
        "plan.json",
        "improved_machine.toml",
        "states.csv",
        "heat.json",
        "heat.csv",
        "sweep.json",
        "results.parquet",
        "study.toml",
        "transient.json",
        "fields.vtkhdf",
        "reduced_network.toml",
        "state_space.npz",
        "state_space.json",
        "recording.toml",
        "simulation.nc",
    }
)


@contextmanager
def output_folder(folder: str | Path) -> Iterator[Path]:
    """Folder that carries a file ``INCOMPLETE`` until its block ends without error.

    Files of an earlier run are replaced one by one; whatever else is there is
    left alone. After an error the marker stays and names it. ``log.txt`` tells
    what was run and how it went.

    Parameters
    ----------
    folder : str or Path
        Made with its parents where it does not exist.

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
        if present and not present & _OWN:
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
        marker.write_text(f"The command did not finish: {type(error).__name__}: {error}\n", encoding="utf-8")
        raise
    marker.unlink()


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
        reason = (path / MARKER).read_text(encoding="utf-8").strip()
        raise BadInputError(str(path), f"is incomplete: {reason}", "Run the command again.")
    return path


def replace_text(path: Path, text: str) -> Path:
    """Write a text file by renaming, so that no reader sees half of it."""
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
    return path


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
