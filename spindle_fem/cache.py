"""What takes long to make, kept on disk under a hash of everything that made it."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.registry import source_from_outside

CACHE_VARIABLE = "SPINDLE_FEM_CACHE"
_PACKAGE = Path(__file__).parent
# Imports at the start of a line or inside a function, on one line or in parentheses.
_IMPORT = re.compile(
    rf"^\s*(?:from|import) ({_PACKAGE.name}(?:\.\w+)*)(?: import (\([^)]*\)|[^\n]*))?", re.MULTILINE
)
_IS_REGISTRY = "registry(__name__)"


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


def source_digest(*modules: str) -> str:
    """Hash of the source of modules and of everything of this package that they import.

    Part of a cache key, so that what an older version of the code made is
    never taken for what this version would make; things of registries that
    come from outside the package count as it does.

    Parameters
    ----------
    *modules : str
        Full names, as ``__name__`` has them.

    Raises
    ------
    FileNotFoundError
        There is no such module.
    """
    digest, registries = _package_digest(modules)
    outside = "".join(map(source_from_outside, registries))
    return hashlib.sha256((digest + outside).encode()).hexdigest() if outside else digest


@cache
def _package_digest(modules: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """Hash of modules and what they import, and the packages among them that are registries."""
    found, registries = hashlib.sha256(), []
    for name, path in sorted(_with_imports(modules).items()):
        content = path.read_bytes()
        found.update(name.encode())
        found.update(content)
        if path.name == "__init__.py" and _IS_REGISTRY in content.decode():
            registries.append(name)
    return found.hexdigest(), tuple(registries)


def _with_imports(modules: Sequence[str]) -> dict[str, Path]:
    """Files of modules and of all that they import from this package, by module name."""
    found: dict[str, Path] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        path = _module_file(name)
        if path is None:
            raise FileNotFoundError(f"there is no module {name}")
        found[name] = path
        text = path.read_text(encoding="utf-8")
        if path.name == "__init__.py" and _IS_REGISTRY in text:
            # Its files are imported by name when they are asked for.
            waiting += [f"{name}.{file.stem}" for file in path.parent.glob("*.py") if file != path]
        for package, listed in _IMPORT.findall(text):
            # What is imported from a package may be a module of it or a name inside it.
            members = (f"{package}.{member}" for member in re.findall(r"\w+", listed))
            waiting += [item for item in (package, *members) if _module_file(item) is not None]
    return found


@cache
def _module_file(name: str) -> Path | None:
    package, *rest = name.split(".")
    if package != _PACKAGE.name:
        return None
    path = _PACKAGE.joinpath(*rest)
    candidates = (path / "__init__.py", path.with_suffix(".py"))
    return next((file for file in candidates if file.is_file()), None)


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
