"""The function behind ``spindle-fem export``: the fast model of a machine as a file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from spindle_fem.commands.checked_machine import recording_of
from spindle_fem.recordings.align import Recording
from spindle_fem.studies.export.export_machine import machine_state_space
from spindle_fem.studies.export.exported_files import file_writer


def export_machine(
    machine: str | Path,
    output: str | Path,
    overrides: Iterable[str] = (),
    recordings: Iterable[str | Path | Recording] = (),
    progress: Callable[[str], None] = lambda stage: None,
) -> dict[str, Any]:
    """Write the fast model of a machine to a file in the format of its suffix.

    Parameters
    ----------
    machine : str or Path
        A definition file or the name of a machine that ships.
    output : str or Path
        ``.npz``, ``.json``, ``.py``, ``.c`` (with a ``.h`` beside it) or ``.fmu``; its folder is made.
    recordings : iterable of str, Path or Recording
        Their speeds and thrusts are within the range of the model, beside the definition's.

    Returns
    -------
    dict
        ``files``, ``machine``, ``scheme``, ``states``, ``inputs``, ``outputs`` and ``notes``.

    Raises
    ------
    SpindleFemError
    """
    path = Path(output)
    write = file_writer(path)
    overrides = tuple(overrides)
    read = [recording_of(item, machine, overrides) for item in recordings]
    space = machine_state_space(machine, overrides, read, progress)
    progress("writing")
    path.parent.mkdir(parents=True, exist_ok=True)
    header = space.header
    # Nobody sees half a file.
    with tempfile.TemporaryDirectory(dir=path.parent) as place:
        files = [file.replace(path.parent / file.name) for file in write(space, Path(place) / path.name)]
    return {
        "files": [str(file) for file in files],
        "machine": header["machine"],
        "scheme": header["scheme"],
        "states": len(space.arrays["uniform"]),
        "inputs": header["inputs"],
        "outputs": header["outputs"],
        "notes": header["notes"],
    }
