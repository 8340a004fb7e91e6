"""Result of a study together with the folder of its files, a temporary one if none was given."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from spindle_fem.results.output_folder import output_folder
from spindle_fem.results.presented import Presented


class FolderResult(Presented, dict[str, Any]):
    """Result of a study: the content of its JSON file by key, and the folder of its files.

    Attributes
    ----------
    folder : Path
        Report, figures and data. Where none was given a temporary one, which goes with this object:
        :meth:`save` keeps it.
    """

    def __init__(self, content: Mapping[str, Any], folder: Path) -> None:
        super().__init__(content)
        self.folder = folder

    @property
    def report(self) -> Path:
        """The page to open in a browser."""
        return self.folder / "report.html"

    def save(self, folder: str | Path) -> Path:
        """Copy report, figures and data to another folder.

        Raises
        ------
        BadInputError
            The folder holds something else, or cannot be written.
        """
        with output_folder(folder) as place:
            shutil.copytree(self.folder, place, dirs_exist_ok=True)
        return place


def result_in(
    folder: str | Path | None, work: Callable[[Path], Any], make: Callable[[Any, Path], FolderResult]
) -> Any:
    """Let a study write its files to a folder, a temporary one where none is given, and make its result.

    Parameters
    ----------
    work : callable
        Of the folder; gives the content.
    make : callable
        Of content and folder.
    """
    place = Path(tempfile.mkdtemp(prefix="spindle-fem-")) if folder is None else Path(folder)
    try:
        found = make(work(place), place)
    except BaseException:
        if folder is None:
            shutil.rmtree(place, ignore_errors=True)
        raise
    if folder is None:
        weakref.finalize(found, shutil.rmtree, place, ignore_errors=True)
    return found
