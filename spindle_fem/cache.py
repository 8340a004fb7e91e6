"""Expensive results kept on disk under a hash of everything they were made from."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import re
import secrets
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from spindle_fem.registry import source_from_outside

LOGGER = logging.getLogger(__name__)
CACHE_VARIABLE = "SPINDLE_FEM_CACHE"
# Exceptions on reading an .npz file that is truncated, changed, or of another type.
DAMAGED = (OSError, ValueError, KeyError, EOFError, TypeError, MemoryError, OverflowError, RuntimeError)
DAMAGED = (*DAMAGED, zipfile.BadZipFile, zlib.error)
_PACKAGE = Path(__file__).parent
# Imports at the start of a line or inside a function, on one line or in parentheses.
_IMPORT = re.compile(
    rf"^\s*(?:from|import) ({_PACKAGE.name}(?:\.\w+)*)(?: import (\([^)]*\)|[^\n]*))?", re.MULTILINE
)
_IS_REGISTRY = "registry(__name__)"


def cache_directory() -> Path:
    """Folder for meshes and models: $SPINDLE_FEM_CACHE, or the platform's cache folder."""
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
            # Its files are imported by name on first use.
            waiting += [f"{name}.{file.stem}" for file in path.parent.glob("*.py") if file != path]
        for package, listed in _IMPORT.findall(text):
            # A name imported from a package may be a module of it or a name inside it.
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


def keep_entry(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Keep what ``write`` writes; readers never see half a file, all users may read it.

    A cache that is full or cannot be written costs the next run its time, this
    one nothing: that is logged, not raised.
    """
    partial = path.with_name(f"{path.name}.{secrets.token_hex(4)}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with partial.open("xb") as stream:
                write(stream)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        LOGGER.warning("%s is not kept in the cache: %s", path.name, error)


@contextlib.contextmanager
def one_at_a_time(digest: str) -> Iterator[None]:
    """Keeps two processes from making the same entry; the second finds it in the cache.

    Where no lock can be had, on Windows or in a cache that cannot be written,
    it is only made twice.
    """
    stream = _lock_file(cache_directory() / f"{digest}.lock")
    if stream is None:
        yield
        return
    import fcntl

    with stream:
        fcntl.flock(stream, fcntl.LOCK_EX)  # released by the system when a process dies
        yield


def _lock_file(path: Path) -> IO[bytes] | None:
    if sys.platform == "win32":
        return None
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("ab")
    with contextlib.suppress(OSError):
        return path.open("rb")  # of another user
    return None


def save_record(record: Any, path: Path, schema: str) -> None:
    """Keep the fields of a dataclass in the cache, arrays and what JSON holds; see :func:`keep_entry`."""
    save_fields({item.name: getattr(record, item.name) for item in fields(record)}, path, schema)


def save_fields(content: Mapping[str, Any], path: Path, schema: str) -> None:
    """Keep named arrays and what JSON holds in the cache; see :func:`keep_entry`."""
    arrays = {name: value for name, value in content.items() if isinstance(value, np.ndarray)}
    header: dict[str, Any] = {"schema": schema}
    for name in content.keys() - arrays.keys():
        value = content[name]
        header[name] = dict(value) if isinstance(value, Mapping) else value
    keep_entry(path, lambda stream: np.savez(stream, header=json.dumps(header, sort_keys=True), **arrays))


def load_record(path: Path, schema: str, kind: type) -> dict[str, Any] | None:
    """Fields of a dataclass that :func:`save_record` wrote, lists as tuples.

    None where there is no such file, or it is damaged, of another schema or
    another kind: what it held is made again.
    """
    found = load_fields(path, schema)
    return None if found is None or found.keys() != {item.name for item in fields(kind)} else found


def load_fields(path: Path, schema: str) -> dict[str, Any] | None:
    """What :func:`save_fields` wrote, lists as tuples; None as :func:`load_record`."""
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as data:
            header = json.loads(str(data["header"]))
            arrays = {name: data[name] for name in data.files if name != "header"}
        known = header.pop("schema", None) == schema
    except (*DAMAGED, AttributeError):
        return None
    if not known or header.keys() & arrays.keys():
        return None
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in header.items()
    } | arrays
