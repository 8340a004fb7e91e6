"""Recordings that a folder holds, by the names that their results get."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

from spindle_fem.definition.load import read_toml
from spindle_fem.errors import SpindleFemError
from spindle_fem.recordings.manifest import RECORDING_SCHEMA, find_manifest


def recordings_in(path: str | Path, without: Iterable[str | Path] = ()) -> dict[str, Path]:
    """Manifests within a folder and its sub-folders, in the order of their names.

    Manifests that cannot be read count; TOML files that say that they are something else (a machine, a
    study) do not, nor do sub-folders without a manifest.

    Parameters
    ----------
    path : str or Path
    without : iterable of str or Path
        Recordings that are left out, such as those that calibrate.

    Returns
    -------
    dict of name to manifest
        Named by file or sub-folder. Empty where the path is one recording itself, or no folder.
    """
    folder = Path(path)
    if not folder.is_dir() or (folder / "recording.toml").is_file():
        return {}
    left_out = set()
    for item in without:
        with contextlib.suppress(SpindleFemError):
            left_out.add(find_manifest(item).resolve())
    found = [(file.stem, file) for file in sorted(folder.glob("*.toml")) if _may_be_recording(file)]
    beside = len(found)
    for inner in sorted(item for item in folder.iterdir() if item.is_dir()):
        with contextlib.suppress(SpindleFemError):
            manifest = find_manifest(inner)
            if _may_be_recording(manifest):
                found.append((inner.name, manifest))
    if beside == 1 and len(found) == 1:
        return {}
    names: dict[str, Path] = {}
    for name, manifest in found:
        if manifest.resolve() not in left_out:
            names[name if name not in names else f"{name}_folder"] = manifest
    return names


def _may_be_recording(file: Path) -> bool:
    """Whether a TOML file is a manifest, or too broken to tell."""
    try:
        schema = read_toml(file).get("schema")
    except SpindleFemError:
        return True
    return schema == RECORDING_SCHEMA or schema is None
