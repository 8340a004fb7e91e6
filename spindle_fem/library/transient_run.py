"""``spindle_fem.transient``: heat-up, step test or cool-down by the full model, to plot and hand on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.commands.transient_command import run_transient_study
from spindle_fem.library.folder_result import FolderResult, result_in
from spindle_fem.library.loaded_machine import Machine, Progress, definition_file
from spindle_fem.model.mesh.evaluate import temperature_at_nodes
from spindle_fem.report import transient_charts
from spindle_fem.report.pyvista_grid import grid_of
from spindle_fem.results.run_log import LOGGER
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.studies.transient_study import StudyResult
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import pyvista as pv
    import xarray as xr
    from matplotlib.figure import Figure


class TransientRun(FolderResult):
    """``transient.json`` by key, with the course of every phase in ``study``."""

    def __init__(
        self, content: Mapping[str, Any], folder: Path, machine: PreparedMachine, study: StudyResult
    ) -> None:
        super().__init__(content, folder)
        self.machine, self.study = machine, study

    def to_xarray(self) -> xr.Dataset:
        """Probes, rings and balls over the times of readings; heat, preload and extremes over the steps."""
        import xarray as xr

        study, first = self.study, self.study.phases[0].transient
        celsius, by_bearing = {"units": "degC"}, ("time", "bearing")
        variables: dict[str, Any] = {
            "probe_temperature": (("time", "probe"), study.joined("readings") - ZERO_CELSIUS_K, celsius)
        }
        for name in ("inner", "outer", "balls"):
            variables[name] = (by_bearing, study.joined(name) - ZERO_CELSIUS_K, celsius)
        coordinates = {}
        if first.motions:
            motions = {"units": "m", "long_name": "since assembly; tilts in rad"}
            variables["motion"] = (("time", "motion_name"), study.joined("motion"), motions)
            coordinates = {"motion_name": list(first.motions)}
        for name in ("hottest", "coldest"):
            variables[name] = ("step", study.step_record(name) - ZERO_CELSIUS_K, celsius)
        for name, unit in (("bearing_heat", "W"), ("preload", "N")):
            variables[name] = (("step", "bearing"), study.step_record(name), {"units": unit})
        variables["coolant_heat"] = ("step", study.step_record("coolant_heat"), {"units": "W"})
        return xr.Dataset(
            variables,
            {
                "time": ("time", study.joined("times"), {"units": "s"}),
                "step": ("step", study.step_record("times"), {"units": "s", "long_name": "end of the step"}),
                "probe": list(first.probes),
                "bearing": list(first.bearings),
                **coordinates,
            },
            {"machine": self["machine"], "study": self["study"]},
        )

    def to_pyvista(self) -> pv.UnstructuredGrid:
        """The field at the end, as :meth:`SolvedMachine.to_pyvista` gives it."""
        nodes = temperature_at_nodes(self.machine.operators, self.study.state.temperature)
        return grid_of(self.machine.spec, self.machine.mesh, nodes)

    def plot_probes(self) -> Figure:
        """Every probe over time, the speed below, and where the last phase tends to."""
        return transient_charts.probe_history(self.study, self["equilibrium"].get("steady_degC"))

    def plot_bearings(self) -> Figure | None:
        """Raceways of every bearing and the difference between the rings; None without bearings."""
        return transient_charts.bearing_history(self.study)

    def plot_heat(self) -> Figure:
        """Friction heat, what the coolant takes, and preload where it changes."""
        return transient_charts.heat_history(self.study)

    def plot_growth(self) -> Figure | None:
        """Shift of the nose and readings of displacement sensors; None where no elastic bodies are known."""
        return transient_charts.growth_history(self.study)

    def _headline(self) -> str:
        hours = self["phases"][-1]["end_s"] / 3600.0
        return f"{self['study']}, {self['machine']}, {hours:.2f} h in {len(self['phases'])} phases"

    def _rows(self) -> Mapping[str, str]:
        return {
            phase["name"]: f"to {phase['end_s'] / 3600.0:.2f} h, warmest {phase['hottest_degC']:.1f} °C"
            for phase in self["phases"]
        }


def transient(
    study: str | Path,
    folder: str | Path | None = None,
    *,
    machine: Machine | None = None,
    overrides: Iterable[str] = (),
    restart: str | Path | None = None,
    progress: Progress = LOGGER.info,
) -> TransientRun:
    """Run a transient study by the full model.

    Parameters
    ----------
    study : str or Path
        File with ``schema = "spindle-fem/transient/1"``, or the name of one that ships.
    folder : str or Path, optional
        Gets what ``spindle-fem transient`` writes; without it :meth:`FolderResult.save` does.
    machine : MachineSpec, str or Path, optional
        In place of the study's own.
    overrides : iterable of str
        ``path=value`` texts for the machine.
    restart : str or Path, optional
        ``state.npz`` of an earlier run on the same mesh, to go on from.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Raises
    ------
    SpindleFemError
    """
    kept: list[Any] = []

    def work(place: Path) -> dict[str, Any]:
        with definition_file(machine or "") as file:
            return run_transient_study(
                study,
                place,
                machine=file or None,
                overrides=overrides,
                restart=restart,
                progress=progress,
                keep=lambda *found: kept.extend(found),
            )

    return result_in(folder, work, lambda content, place: TransientRun(content, place, *kept))
