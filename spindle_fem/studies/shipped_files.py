"""Studies and examples that ship: in the wheel, or beside the package in a checkout."""

from __future__ import annotations

import shutil
from pathlib import Path

from spindle_fem.errors import BadInputError, did_you_mean

EXAMPLES, STUDIES = "examples", "studies"


def shipped_folder(name: str) -> Path:
    """Folder of the studies or of the examples that ship."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "shipped" / name
    return installed if installed.is_dir() else package.parent / name


def find_study(study: str | Path) -> Path:
    """Path of a study given as a path or by the name of one that ships.

    A path that leads nowhere is given back: who reads it says so.

    Raises
    ------
    BadInputError
        A name that is neither.
    """
    path = Path(study)
    if path.exists() or path.suffix or len(path.parts) != 1:
        return path
    names = sorted(item.stem for item in shipped_folder(STUDIES).glob("*.toml"))
    if path.name not in names:
        raise BadInputError(
            str(study), "is neither a file nor a study that ships.", did_you_mean(path.name, names)
        )
    return shipped_folder(STUDIES) / f"{path.name}.toml"


def copy_shipped(folder: Path) -> list[Path]:
    """Copy the studies and examples that ship to a folder, each file unless one of its name is there.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    BadInputError
        The folder cannot be written.
    """
    written = []
    for name in (EXAMPLES, STUDIES):
        for source in sorted(item for item in shipped_folder(name).iterdir() if item.is_file()):
            target = folder / name / source.name
            if target.exists():
                continue
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, target)
            except OSError as error:
                what = f"cannot be written ({error.strerror})."
                raise BadInputError(str(target), what, "Give another folder.") from error
            written.append(target)
    return written
