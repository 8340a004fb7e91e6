"""Things of one kind that a definition names (film models, coolants, ...), one file each in a folder.

The folder is the list: its file names are the names that a definition may
give and the first line of each file says what it is, both known without
importing anything, so that reading a definition loads no numerical library. A file is
imported when its thing is first asked for. Code outside the package adds its
own with :meth:`Registry.add` or :meth:`Registry.register`.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from spindle_fem.errors import OutOfValidityError, did_you_mean

Thing = TypeVar("Thing")


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
        self._things: dict[str, Any] = {}

    def __iter__(self) -> Iterator[str]:
        """Names: those of the folder's files in alphabetical order, then those added."""
        shipped = _files(self.package)
        return iter((*shipped, *(name for name in self._things if name not in shipped)))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in self._things or name in _files(self.package)

    def __getitem__(self, name: str) -> Any:
        """The thing of a name.

        Raises
        ------
        OutOfValidityError
            There is none; the message lists those there are.
        """
        if name not in self:
            raise OutOfValidityError(self.kind, f'"{name}" is not known.', did_you_mean(name, tuple(self)))
        if name not in self._things:
            import_module(f"{self.package}.{name}")
            if name not in self._things:
                raise LookupError(f"{self.package}.{name} registers nothing under its own name")
        return self._things[name]

    def add(self, name: str, thing: Thing) -> Thing:
        """Enter a thing under a name.

        Raises
        ------
        ValueError
            The name belongs to another thing already.
        """
        if self._things.setdefault(name, thing) is not thing:
            raise ValueError(f'there is a {self.kind} "{name}" already')
        return thing

    def register(self, thing: Callable[..., Any]) -> Any:
        """Enter a function or class under the name of its file, or its own name outside the package."""
        module = thing.__module__
        inside = module.startswith(f"{self.package}.")
        return self.add(module.rpartition(".")[2] if inside else thing.__name__, thing)

    def summary(self, name: str) -> str:
        """What a thing is, in one line."""
        files = _files(self.package)
        text = _docstring(files[name]) if name in files else (self._things[name].__doc__ or "")
        return text.strip().partition("\n")[0]


@cache
def registry(package: str) -> Registry:
    """The one registry of a package."""
    return Registry(package)


@cache
def _files(package: str) -> Mapping[str, Path]:
    """Files of a package by name, in alphabetical order, none imported."""
    found = find_spec(package)
    folder = Path(str(found.origin)).parent
    return {path.stem: path for path in sorted(folder.glob("*.py")) if path.stem != "__init__"}


@cache
def _docstring(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
