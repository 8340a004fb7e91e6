"""Further faults of a faulty manifest: names that its data or the machine do not have."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import read_toml
from spindle_fem.errors import FaultsError, RecordingError, SpindleFemError, did_you_mean
from spindle_fem.recordings.manifest import Manifest, find_manifest, load_manifest
from spindle_fem.recordings.read_data import columns_of
from spindle_fem.recordings.recordable_names import RecordableNames


def manifest_for(
    path: str | Path, names: Callable[[], RecordableNames] | None = None, *, growing: bool = False
) -> tuple[Manifest, Path]:
    """Load a manifest; if it is faulty, add :func:`faults_beside` to its faults.

    Raises
    ------
    FaultsError or RecordingError
    """
    try:
        return load_manifest(path, growing=growing)
    except FaultsError as error:
        raise FaultsError(error.where, [*error.faults, *faults_beside(path, names)]) from error


def faults_beside(
    recording: str | Path, names: Callable[[], RecordableNames] | None = None
) -> tuple[SpindleFemError, ...]:
    """Columns of a manifest that its data do not have, and names that a machine does not have.

    Parameters
    ----------
    names : callable, optional
        Names of the machine; called only here, where the recording is refused anyway.
    """
    manifest = find_manifest(recording)
    content = read_toml(manifest)
    found = list(_columns(content, manifest))
    if names is not None:
        # what is wrong with the machine itself has messages of its own
        with contextlib.suppress(SpindleFemError):
            found += _names(content, names())
    return tuple(type(f)(f"{manifest}: {f.where}", f.what, f.how_to_fix) for f in found)


def _columns(content: dict[str, Any], manifest: Path) -> Iterator[SpindleFemError]:
    data = content.get("data")
    present = columns_of(manifest.parent / data) if isinstance(data, str) else None
    if present is None:
        return
    time = content.get("time")
    named = [("time", time)] if isinstance(time, dict) else []
    for where, table in (*named, *_channels(content)):
        column = table.get("column")
        if isinstance(column, str) and column not in present:
            yield RecordingError(
                f"{where}.column", f'"{column}" is not in {data}.', did_you_mean(column, present)
            )


def _names(content: dict[str, Any], names: RecordableNames) -> Iterator[SpindleFemError]:
    driven = []
    for where, table in _channels(content):
        probe, drives = table.get("probe"), table.get("drives")
        if table.get("role") == "temperature" and isinstance(probe, str) and probe not in names.probes:
            yield RecordingError(
                f"{where}.probe", f'"{probe}" is no probe of the machine.', did_you_mean(probe, names.probes)
            )
        if not isinstance(drives, str):
            continue
        driven.append(drives)
        if not names.takes_others and drives not in (names.inputs or ()) and not drives.startswith("heat."):
            yield RecordingError(
                f"{where}.drives",
                f'"{drives}" drives nothing in this machine.',
                did_you_mean(drives, tuple(names.inputs or ())),
            )
    for name in names.needed:
        if name not in driven:
            yield RecordingError(
                "channel", f'none drives "{name}", which the machine needs.', how_to_drive(name, driven)
            )


def how_to_drive(name: str, driven: Sequence[str]) -> str:
    """What to do where no channel drives an input, and what is driven instead.

    >>> how_to_drive("speed", ["sped"])
    'Give its channel role = "input" and drives = "speed"; driven: sped.'
    """
    return f'Give its channel role = "input" and drives = "{name}"; driven: {", ".join(driven) or "nothing"}.'


def _channels(content: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    tables = content.get("channel")
    listed = tables if isinstance(tables, list) else []
    return [(f"channel[{n}]", table) for n, table in enumerate(listed, 1) if isinstance(table, dict)]
