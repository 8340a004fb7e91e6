"""What takes long to make, kept on disk under a hash of everything that made it."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

CACHE_VARIABLE = "SPINDLE_FEM_CACHE"
_PACKAGE = Path(__file__).parent


def cache_directory() -> Path:
    """Where meshes and models are kept: $SPINDLE_FEM_CACHE, or the platform's cache folder."""
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return Path(chosen)
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "spindle-fem" / "meshes"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "spindle-fem" / "meshes"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "spindle-fem" / "meshes"


@cache
def source_digest(*names: str) -> str:
    """Hash of the source of some modules or subpackages of spindle_fem.

    Part of a cache key, so that what an older version of the code made is
    never taken for what this version would make.

    Parameters
    ----------
    *names : str
        Like ``"meshing"`` or ``"coupling"``.

    Raises
    ------
    FileNotFoundError
        There is no such module.
    """
    found = hashlib.sha256()
    for name in names:
        folder = _PACKAGE / name
        for path in sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]:
            found.update(path.relative_to(_PACKAGE).as_posix().encode())
            found.update(path.read_bytes())
    return found.hexdigest()


def save_record(record: Any, path: Path, schema: str) -> None:
    """Write the fields of a dataclass, arrays and what JSON holds; readers never see half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, NDArray[Any]] = {}
    header: dict[str, Any] = {"schema": schema}
    for item in fields(record):
        value = getattr(record, item.name)
        if isinstance(value, np.ndarray):
            arrays[item.name] = value
        else:
            header[item.name] = dict(value) if isinstance(value, Mapping) else value
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".partial")
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez(stream, header=json.dumps(header), **arrays)
        Path(temporary).replace(path)
    finally:
        Path(temporary).unlink(missing_ok=True)


def load_record(path: Path, schema: str) -> dict[str, Any] | None:
    """Fields that :func:`save_record` wrote, lists as tuples.

    None where there is no such file, or it is damaged or of another schema:
    what it held is made again.
    """
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as data:
            header = json.loads(str(data["header"]))
            arrays = {name: data[name] for name in data.files if name != "header"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if header.pop("schema", None) != schema:
        return None
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in header.items()
    } | arrays
