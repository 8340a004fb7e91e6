"""Things of one kind that a definition names (film models, coolants, ...), one file each in a folder.

The folder is the list: its file names are the names that a definition may
give and the first line of each file says what it is, both known without
importing anything, so that reading a definition loads no numerical library. A file is
imported when its thing is first used. Code outside the package adds its
own with :meth:`Registry.add` or :meth:`Registry.register`, and an installed
package by an entry point of the group ``spindle_fem.heat_models`` (the folder's
name). What a program added goes with every job to other processes (``ADDED``).
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from spindle_fem.errors import BadInputError, OutOfValidityError, did_you_mean

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Thing = TypeVar("Thing")
# Things added by a program, by folder and name.
ADDED: dict[str, dict[str, Any]] = {}


class Registry(Mapping[str, Any]):
    """Things of one kind by name; get one with ``registry[name]``.

    Parameters
    ----------
    package : str
        Package that holds one file for each thing.
    """

    def __init__(self, package: str) -> None:
        self.package = package
        self.kind = package.rpartition(".")[2].removesuffix("s").replace("_", " ")
        self.group = package.rpartition(".")[2]
        self._things: dict[str, Any] = {}

    @property
    def _added(self) -> dict[str, Any]:
        return ADDED.setdefault(self.group, {})

    def __iter__(self) -> Iterator[str]:
        """Names: those of the folder's files in alphabetical order, then those added."""
        return iter(dict.fromkeys((*_files(self.package), *entry_points(self.group), *self._added)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in _files(self.package) or name in self._added or name in entry_points(self.group)

    def __getitem__(self, name: str) -> Any:
        """The thing of a name.

        Raises
        ------
        OutOfValidityError
            There is none; the message lists those there are.
        """
        if name not in self:
            raise OutOfValidityError(self.kind, f'"{name}" is not known.', did_you_mean(name, tuple(self)))
        if name in self._added:
            return self._added[name]
        if name not in self._things and name in _files(self.package):
            import_module(f"{self.package}.{name}")
            if name not in self._things:
                raise LookupError(f"{self.package}.{name} registers nothing under its own name")
        elif name not in self._things:
            self._things[name] = load_entry_point(entry_points(self.group)[name])
        return self._things[name]

    def add(self, name: str, thing: Thing) -> Thing:
        """Enter a thing under a name.

        Raises
        ------
        ValueError
            The name belongs to another thing already.
        """
        known = self._things if name in _files(self.package) else self._added
        if known.setdefault(name, thing) is not thing:
            raise ValueError(f'there is a {self.kind} "{name}" already')
        return thing

    def register(self, thing: Callable[..., Any]) -> Any:
        """Enter a function or class under the name of its file, or its own name outside the package."""
        module = thing.__module__
        inside = module.startswith(f"{self.package}.")
        return self.add(module.rpartition(".")[2] if inside else thing.__name__, thing)

    def summary(self, name: str) -> str:
        """Description of a thing in one line."""
        files = _files(self.package)
        text = _docstring(files[name]) if name in files else (self[name].__doc__ or "")
        return text.strip().partition("\n")[0]


@cache
def registry(package: str) -> Registry:
    """The one registry of a package."""
    return Registry(package)


@cache
def entry_points(group: str) -> Mapping[str, EntryPoint]:
    """Things of a kind that installed packages announce, by name, none loaded.

    Parameters
    ----------
    group : str
        Without the beginning ``spindle_fem.``.
    """
    from importlib import metadata

    return {item.name: item for item in metadata.entry_points(group=f"spindle_fem.{group}")}


def load_entry_point(entry: EntryPoint) -> Any:
    """Load the object that an installed package announces.

    Raises
    ------
    BadInputError
        It cannot be loaded; names the package.
    """
    try:
        return entry.load()
    except Exception as error:
        package = entry.dist.name if entry.dist else "an installed package"
        raise BadInputError(
            f"{package}: entry point {entry.group}: {entry.name}",
            f"cannot be loaded ({type(error).__name__}: {error}).",
            "Mend that package, or uninstall it.",
        ) from error


def source_from_outside(package: str) -> str:
    """Hash of the sources of a folder's things that lie outside it; empty if there are none.

    Hashes the files that define them; for instances of the package's own classes, their content.
    """
    group = package.rpartition(".")[2]
    files = [find_spec(entry.module) for entry in entry_points(group).values()]
    sources = [Path(str(found.origin)) for found in files if found is not None and found.origin]
    descriptions = []
    for thing in ADDED.get(group, {}).values():
        module = getattr(thing, "__module__", "")
        file = getattr(sys.modules.get(module), "__file__", None)
        if file is None or module.partition(".")[0] == __name__.partition(".")[0]:
            descriptions.append(repr(thing))
        else:
            sources.append(Path(file))
    if not sources and not descriptions:
        return ""
    content = [path.read_bytes() for path in sorted(sources)]
    content += [text.encode() for text in sorted(descriptions)]
    return hashlib.sha256(b"\0".join(content)).hexdigest()


@cache
def _files(package: str) -> Mapping[str, Path]:
    """Files of a package by name, in alphabetical order, none imported."""
    found = find_spec(package)
    folder = Path(str(found.origin)).parent
    return {path.stem: path for path in sorted(folder.glob("*.py")) if path.stem != "__init__"}


@cache
def _docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
