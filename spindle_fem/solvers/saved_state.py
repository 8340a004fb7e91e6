"""A state to go on from, in one file with what the terms remember."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.mesh.thermal_state import STATE_SCHEMA, ThermalState

Array = NDArray[np.float64]


def save_state(path: str | Path, state: ThermalState, memory: Array | None = None) -> None:
    """Write a state that :func:`load_state`, and ``ThermalState.load``, read.

    Parameters
    ----------
    memory : (n,) ndarray, optional
        What terms remember then, such as ``MachineTransient.memory``.
    """
    content = {
        "schema": STATE_SCHEMA,
        "time": state.time,
        "temperature": state.temperature,
        "lumped_temperature": state.lumped_temperature,
        "step": state.step,
    }
    if memory is not None:
        content["memory"] = memory
    with Path(path).open("wb") as stream:
        np.savez_compressed(stream, **content)


def load_state(path: str | Path) -> tuple[ThermalState, Array | None]:
    """A saved state, and what terms remembered then; None where none did.

    Raises
    ------
    BadInputError
        Not a saved state, or of another version.
    """
    state = ThermalState.load(Path(path))
    with np.load(path, allow_pickle=False) as data:
        return state, (data["memory"] if "memory" in data.files else None)
