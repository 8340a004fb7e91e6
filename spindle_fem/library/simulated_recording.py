"""``spindle_fem.read_recording`` and ``simulate``: what was read, and what should have been."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.library.folder_result import FolderResult, result_in
from spindle_fem.library.loaded_machine import Machine, Progress, definition_file
from spindle_fem.recordings import align
from spindle_fem.recordings.align import Recording
from spindle_fem.report.read_against_predicted import simulated_courses, simulated_figure
from spindle_fem.report.recording_picture import draw_recording, recording_figure
from spindle_fem.results.dataset import write_dataset
from spindle_fem.results.output_folder import output_folder
from spindle_fem.results.presented import Presented
from spindle_fem.studies.simulate import Simulation
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

CELSIUS = {"units": "degC"}


class ReadRecording(Presented, Recording):
    """A recording as :class:`~spindle_fem.recordings.align.Recording`, to look at and to hand on."""

    def to_xarray(self) -> xr.Dataset:
        """Readings in °C with their flags and noise; inputs and covariates in SI, over time in s."""
        import xarray as xr

        return xr.Dataset(
            {
                "temperature": (("time", "channel"), self.temperature - ZERO_CELSIUS_K, CELSIUS),
                "flag": (("time", "channel"), self.flags),
                "noise": ("channel", self.sigma, {"units": "K", "long_name": "white noise, 1 sigma"}),
                "displacement": (("time", "sensor"), self.displacements, {"units": "m"}),
                "input": (("time", "driven"), self.inputs),
                "covariate": (("time", "covariate_name"), self.covariates),
            },
            {
                "time": ("time", self.times, {"units": "s"}),
                "channel": list(self.temperature_names),
                "probe": ("channel", list(self.probes)),
                "sensor": list(self.displacement_names),
                "driven": list(self.input_names),
                "input_unit": ("driven", list(self.input_units)),
                "covariate_name": list(self.covariate_names),
                "covariate_unit": ("covariate_name", list(self.covariate_units)),
            },
            {"name": self.name, "start": self.start or ""},
        )

    def save(self, folder: str | Path) -> Path:
        """Write :meth:`to_xarray` as ``recording.nc`` and :meth:`plot_channels` as ``recording.png``.

        Raises
        ------
        BadInputError
            The folder holds something else, or cannot be written.
        """
        data = "recording.nc"
        with output_folder(folder, own={data}) as place:
            write_dataset(self.to_xarray(), place / data)
            draw_recording(place / "recording.png", self)
        return place

    def plot_channels(self) -> Figure:
        """Every channel over time, with gaps and readings that are not used marked."""
        return recording_figure(self)

    def _headline(self) -> str:
        hours = float(np.ptp(self.times)) / 3600.0
        channels = f"{len(self.temperature_names)} temperature channels"
        return f"{self.name}, {self.times.size} stamps over {hours:.1f} h, {channels}"

    def _rows(self) -> Mapping[str, str]:
        found = {}
        for column, name in enumerate(self.temperature_names):
            read = self.temperature[self.usable[:, column], column] - ZERO_CELSIUS_K
            span = f"{read.min():.1f} to {read.max():.1f} °C" if read.size else "nothing to use"
            found[name] = f"{span}, {read.size} readings"
        return found | {"inputs": ", ".join(self.input_names), "defects": " ".join(self.defects.lines())}


def read_recording(path: str | Path) -> ReadRecording:
    """Read a recording.

    Parameters
    ----------
    path : str or Path
        Folder or manifest.

    Raises
    ------
    RecordingError
    """
    read = align.read_recording(path)
    return ReadRecording(**{item.name: getattr(read, item.name) for item in fields(Recording)})


class SimulatedRecording(FolderResult):
    """``simulation.json`` by key, with what every channel should have read in ``simulation``."""

    def __init__(self, content: Mapping[str, Any], folder: Path, simulation: Simulation) -> None:
        super().__init__(content, folder)
        self.simulation = simulation

    def to_xarray(self) -> xr.Dataset:
        """Readings, predictions and half widths of their 90 % intervals by time and channel."""
        import xarray as xr

        recording, grid = self.simulation.recording, ("time", "channel")
        half_width = {"units": "K", "long_name": "half of the 90 % interval of a reading"}
        return xr.Dataset(
            {
                "measured": (
                    grid,
                    np.where(recording.usable, recording.temperature - ZERO_CELSIUS_K, np.nan),
                    CELSIUS,
                ),
                "predicted": (grid, self.simulation.predicted - ZERO_CELSIUS_K, CELSIUS),
                "half_width": (grid, self.simulation.half_width, half_width),
            },
            {
                "time": ("time", recording.times, {"units": "s"}),
                "channel": list(recording.temperature_names),
            },
            {"machine": self["machine"], "recording": self["recording"]},
        )

    def plot_channels(self) -> Figure:
        """Every channel as read and as predicted, with what is left between them."""
        simulation = self.simulation
        courses = simulated_courses(simulation.recording, simulation.predicted, simulation.half_width)
        title = f"{simulation.machine}: {simulation.recording.name}"
        return simulated_figure(courses, title, simulation.recording.start)

    def _headline(self) -> str:
        return f"{self['machine']} on {self['recording']}"

    def _rows(self) -> Mapping[str, str]:
        return {
            item["channel"]: f"error {item['rmse_K']:.3f} K, noise {item['noise_K']:.3f} K"
            for item in self["channels"]
        }


def simulate(
    machine: Machine,
    recording: str | Path | Recording,
    folder: str | Path | None = None,
    calibrate: Iterable[str | Path | Recording] = (),
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
) -> SimulatedRecording:
    """Predict every temperature channel of a recording, the machine as defined or calibrated on others.

    Parameters
    ----------
    machine : MachineSpec, NetworkMachineSpec, str or Path
        Loaded, or its file, or the name of one that ships; with geometry or a ``[network]``.
    recording : str, Path or Recording
        Folder or manifest, or what was read from it.
    folder : str or Path, optional
        Gets what ``spindle-fem simulate`` writes; without it :meth:`FolderResult.save` does.
    calibrate : iterable of str, Path or Recording
        Recordings that may move the uncertain parameters first.
    overrides : iterable of str
        ``path=value`` texts.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Raises
    ------
    SpindleFemError
    """
    kept: list[Simulation] = []

    def work(place: Path) -> dict[str, Any]:
        with definition_file(machine) as file:
            return simulate_machine(file, recording, place, calibrate, overrides, progress, kept.append)

    return result_in(folder, work, lambda content, place: SimulatedRecording(content, place, kept[0]))
