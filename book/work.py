"""Store the data of chapters, so that an interrupted book resumes where it stopped."""

from __future__ import annotations

import functools
import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import replace_text

ROOT = Path(__file__).parents[1]
STAMP = "step.json"
# Sources of the data: they are made anew when any of these changes.
_SOURCES = {
    "tool": (("spindle_fem", "**/*.py"), ("geometry", "*.toml")),
    "generator": (("validation", "*.py"),),
    "tests": (("tests", "**/*.py"),),
}


@functools.cache
def fingerprint(kind: str) -> str:
    """Short hash of the source files that data are made with.

    >>> len(fingerprint("generator"))
    12
    """
    digest = hashlib.sha256()
    for folder, pattern in _SOURCES[kind]:
        for path in sorted((ROOT / folder).glob(pattern)):
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@dataclass(frozen=True, slots=True)
class Step:
    """Data of one run: their folder, what made them, how long it took."""

    folder: Path
    made_with: Mapping[str, str]
    wall_s: float
    outdated: bool


@dataclass(slots=True)
class Desk:
    """Paths and settings of a chapter's work.

    Attributes
    ----------
    work : Path
        Folder of the data that chapters make.
    study, results : Path
        Concealed study: ``inputs`` and ``answers``, and the output of ``validation.run_study``.
    recordings : Path
        Folder of the real recordings; chapters that need it are left out by name without it.
    keep : bool
        Use data made with an earlier version of the source, and say so.
    tell : callable
        Called with each step as it begins.
    earlier : tuple of Path
        Folders of earlier concealed studies, each with its ``results``.
    """

    work: Path
    study: Path
    results: Path
    recordings: Path
    keep: bool = False
    tell: Callable[[str], None] = print
    earlier: tuple[Path, ...] = ()
    outdated: list[str] = field(default_factory=list)

    def real(self, name: str) -> Path | None:
        """Folder of a real recording; None where it is not there."""
        folder = self.recordings / name
        return folder if folder.is_dir() else None

    def step(
        self,
        name: str,
        make: Callable[[Path], None],
        *,
        sources: tuple[str, ...] = ("tool",),
        inputs: Mapping[str, Any] | None = None,
    ) -> Step:
        """Run ``make`` in its folder unless its data are there already.

        Parameters
        ----------
        name : str
            Of the folder, unique within the book.
        make : callable
            Gets the folder; what it writes there is the data. A folder that was left unfinished is
            given to it again as it stands.
        sources : tuple of str
            Keys of the source files whose change makes the data outdated.
        inputs : mapping, optional
            Anything else that they depend on, as JSON knows it.
        """
        folder = self.work / name
        stamp = folder / STAMP
        wanted = {
            "sources": {key: fingerprint(key) for key in sources},
            "inputs": json.loads(json.dumps(dict(inputs or {}))),
        }
        if stamp.is_file():
            found = json.loads(stamp.read_text(encoding="utf-8"))
            same = found["inputs"] == wanted["inputs"]
            if same and (self.keep or found["sources"] == wanted["sources"]):
                outdated = found["sources"] != wanted["sources"]
                if outdated:
                    self.outdated.append(name)
                return Step(folder, found["sources"], found["wall_s"], outdated)
            stamp.unlink()
        self.tell(f"  {name}")
        folder.mkdir(parents=True, exist_ok=True)
        began = time.perf_counter()
        make(folder)
        wall = time.perf_counter() - began
        replace_text(stamp, json.dumps(wanted | {"wall_s": round(wall, 1)}, indent=1))
        return Step(folder, wanted["sources"], wall, outdated=False)


def read_json(path: Path) -> Any:
    """Content of a JSON file.

    Raises
    ------
    BadInputError
    """
    if not path.is_file():
        raise BadInputError(str(path), "there is no such file.", "Build the book again without --keep.")
    return json.loads(path.read_text(encoding="utf-8"))
