"""Scenes of recordings: what was read and predicted at the probes, on the machine or its network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import BadInputError
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.report.machine_scene import table_times
from spindle_fem.report.viewed_scene import Curve
from spindle_fem.results.dataset import load_netcdf
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

MOST_FRAMES, MOST_POINTS = 40, 400
READ = "read"
# Variables with predictions, and what the page calls them.
PREDICTIONS = {"predicted": "model", "before": "before", "after": "after"}


class Course:
    """One recording of a dataset: times, inputs, readings and predictions.

    Parameters
    ----------
    data : Dataset
        Of ``simulation.nc`` or ``diagnosis.nc``; of several recordings the first is taken.
    """

    def __init__(self, data: xr.Dataset) -> None:
        self.several = "recording_index" in data and int(data["recording_index"].max()) > 0
        if "recording_index" in data:
            data = data.isel(stamp=np.flatnonzero(data["recording_index"].values == 0))
        self._data = data
        self.times = data["time"].values.astype(np.float64)
        self.channels = [str(name) for name in data["channel"].values]
        named = "channel_probe" in data
        self.probes = [str(name) for name in data["channel_probe"].values] if named else self.channels
        self.frames = table_times(len(self.times), MOST_FRAMES)

    @property
    def inputs(self) -> InputHistory:
        """Inputs to the machine over time, SI."""
        names = tuple(str(name) for name in self._data["input_name"].values)
        held = (
            self._data["input_held"].values == 1 if "input_held" in self._data else np.zeros(len(names), bool)
        )
        values = self._data["input"].values.astype(np.float64)
        there = np.isfinite(values).all(axis=0)
        return InputHistory(
            self.times,
            tuple(name for name, one in zip(names, there, strict=True) if one),
            values[:, there],
            held[there],
        )

    @property
    def first_reading(self) -> float:
        """Mean of every channel's first reading, K."""
        read = self.columns("measured")
        found = [column[np.isfinite(column)][:1] for column in read.T]
        return float(np.mean(np.concatenate(found))) + ZERO_CELSIUS_K

    @property
    def predictions(self) -> dict[str, str]:
        """Variables with predictions, and their names."""
        return {key: name for key, name in PREDICTIONS.items() if key in self._data}

    def columns(self, name: str) -> Array:
        """A table of temperatures, (stamps, channels) °C; readings that are not to be used are NaN."""
        found = self._data[name].values.astype(np.float64)
        return np.where(self._data["usable"].values == 1, found, np.nan) if name == "measured" else found

    def at_frames(self, times: Array, offset: Mapping[str, str] | None = None) -> dict[str, dict[str, Array]]:
        """Value of every probe in every layer at some times: by probe, then by layer.

        Parameters
        ----------
        offset : mapping of str to str, optional
            Variables by the layer that shows what they leave of the readings.
        """
        rows = np.clip(np.searchsorted(self.times, times), 0, len(self.times) - 1)
        read = self.columns("measured")[rows]
        shown = {READ: read} | {name: self.columns(key)[rows] for key, name in self.predictions.items()}
        shown |= {layer: read - self.columns(key)[rows] for layer, key in (offset or {}).items()}
        return {
            probe: {layer: values[:, number] for layer, values in shown.items()}
            for number, probe in enumerate(self.probes)
        }

    def histories(self) -> dict[str, tuple[Curve, ...]]:
        """Readings and predictions of every probe, thinned for a page."""
        rows = table_times(len(self.times), MOST_POINTS)
        shown = {READ: self.columns("measured")} | {
            name: self.columns(key) for key, name in self.predictions.items()
        }
        return {
            probe: tuple(Curve(name, self.times[rows], table[rows, number]) for name, table in shown.items())
            for number, probe in enumerate(self.probes)
        }


def read_course(path: Path, command: str) -> Course:
    """Recording of a folder's dataset.

    Raises
    ------
    BadInputError
        There is no such file, or it is none of the command's.
    """
    if not path.is_file():
        raise BadInputError(
            str(path),
            "there is no such file: the folder is of an earlier version, or nothing was fitted.",
            f"Run spindle-fem {command} again.",
        )
    try:
        return Course(load_netcdf(path))
    except (OSError, ValueError, KeyError) as error:
        raise BadInputError(
            str(path), f"cannot be read ({error}).", f"Run spindle-fem {command} again."
        ) from error
