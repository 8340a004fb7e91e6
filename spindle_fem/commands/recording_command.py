"""The functions behind ``spindle-fem recording``: measurement files drafted, recordings drawn."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from spindle_fem.errors import BadInputError, RecordingError, SpindleFemError
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.draft_recording import (
    DATA_NAME,
    MANIFEST_NAME,
    data_text,
    draft_recording,
    manifest_text,
)
from spindle_fem.recordings.draft_seal import require_as_drafted, sealed
from spindle_fem.recordings.recordable_names import recordable_names
from spindle_fem.report.recording_picture import draw_recording
from spindle_fem.results.output_folder import output_folder, replace_text

PICTURE_NAME = "recording.png"


def draft(
    files: Iterable[str | Path],
    folder: str | Path,
    *,
    machine: str | Path | None = None,
    zone: str | None = None,
) -> dict[str, Any]:
    """Draft a recording: ``recording.csv``, ``recording.toml`` to be checked, ``recording.png``.

    Parameters
    ----------
    files : iterable of path
        Of measuring devices; the files themselves are left as they are.
    machine : str or Path, optional
        Gives the names of probes and inputs.
    zone : str, optional
        Time zone of stamps that state none.

    Returns
    -------
    dict
        ``channels``, ``found``, ``unsure``, ``lost_cells``, ``defects``, ``defects_text``.

    Raises
    ------
    SpindleFemError
        The files make no recording, or the folder holds one that somebody has changed: nothing is written.
    """
    given = [Path(file) for file in files]
    _require_apart(given, Path(folder))
    require_as_drafted(Path(folder) / MANIFEST_NAME, Path(folder) / DATA_NAME)
    names = None if machine is None else recordable_names(machine)
    drafted = draft_recording(given, names, zone=zone)
    data = data_text(drafted)
    texts = {DATA_NAME: data, MANIFEST_NAME: sealed(manifest_text(drafted), data)}
    recording = _read_back(texts, given)
    with output_folder(folder, own=frozenset({MANIFEST_NAME, PICTURE_NAME})) as place:
        for name, text in texts.items():
            replace_text(place / name, text)
        draw_recording(place / PICTURE_NAME, recording)
    unsure = [f"{g.channel.column}: {g.unsure}" for g in drafted.channels if g.unsure]
    return {
        "channels": [guess.channel.model_dump() for guess in drafted.channels],
        "found": list(drafted.found),
        "unsure": [*drafted.unsure, *unsure],
        "lost_cells": list(drafted.lost_cells),
        "defects": recording.defects.to_json(),
        "defects_text": recording.defects.lines(),
    }


def _require_apart(files: list[Path], folder: Path) -> None:
    """Refuse to write over what is drafted from."""
    written = {(folder / name).resolve() for name in (DATA_NAME, MANIFEST_NAME, PICTURE_NAME)}
    for file in files:
        if file.resolve() in written:
            raise BadInputError(str(file), "would be written over.", "Give another folder with -o.")


def _read_back(texts: dict[str, str], files: list[Path]) -> Recording:
    """Recording made from texts, read from a temporary folder before any of them is written to its place."""
    with TemporaryDirectory() as stage:
        for name, text in texts.items():
            (Path(stage) / name).write_text(text, encoding="utf-8", newline="")
        try:
            return read_recording(Path(stage) / MANIFEST_NAME)
        except SpindleFemError as error:
            what = str(error).replace(f"{Path(stage) / MANIFEST_NAME}: ", "").replace(stage + os.sep, "")
            raise RecordingError(
                ", ".join(map(str, files)), f"makes no recording that can be used: {what}"
            ) from error


def show(recording: str | Path, file: str | Path) -> list[str]:
    """Draw a recording as a picture.

    Returns
    -------
    list of str
        Its defects as lines of text.

    Raises
    ------
    SpindleFemError
        The recording cannot be used, or the picture has another suffix or no folder.
    """
    file = Path(file)
    if file.suffix.lower() != ".png":
        raise BadInputError(str(file), f'"{file.suffix}" is no format of the picture.', "Allowed: .png.")
    if not file.absolute().parent.is_dir():
        raise BadInputError(str(file), "there is no such folder.", "Make the folder, or name another one.")
    read = read_recording(recording)
    draw_recording(file, read)
    return read.defects.lines()
