"""``spindle_fem.diagnose``: where recordings and a machine differ and why, to plot and hand on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.commands.diagnose_command import diagnose as diagnose_into
from spindle_fem.errors import BadInputError
from spindle_fem.inference.full_model_check import AUTO
from spindle_fem.library.folder_result import FolderResult, result_in
from spindle_fem.library.loaded_machine import Machine, Progress, definition_file
from spindle_fem.recordings.align import Recording
from spindle_fem.report.diagnosis_charts import residual_map
from spindle_fem.report.diagnosis_odds import set_probabilities
from spindle_fem.report.diagnosis_words import heldout_errors, in_recording
from spindle_fem.report.read_against_predicted import before_after, displaced_before_after

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

DATA_FILE = "diagnosis.nc"


class MachineDiagnosis(FolderResult):
    """``diagnosis.json`` by key."""

    def to_xarray(self) -> xr.Dataset:
        """Readings, predictions before and after, inputs, heat tracks, sets and parameters.

        Raises
        ------
        BadInputError
            The recording said too little: nothing was fitted.
        """
        import xarray as xr

        file = self.folder / DATA_FILE
        if not file.is_file():
            raise BadInputError(str(self.folder), "nothing was fitted.", str(self.get("reason", "")))
        return xr.load_dataset(file)

    def plot_before_after(self, number: int = 0) -> Figure:
        """Every temperature of a recording, counted from 0, with the predictions before and after."""
        return before_after(self.to_xarray(), number)

    def plot_displacements(self, number: int = 0) -> Figure:
        """Every displacement of a recording, counted from 0, with the predictions before and after.

        Raises
        ------
        BadInputError
            None was read.
        """
        figure = displaced_before_after(self.to_xarray(), number)
        if figure is None:
            raise BadInputError(
                str(self.folder),
                f"recording {number} has no displacement that was read.",
                'A channel with role = "displacement" and the probe of a [[displacement_sensor]] is one.',
            )
        return figure

    def plot_residuals(self) -> Figure:
        """Mean residual of each channel in each condition, before and after."""
        return residual_map(self.to_xarray())

    def plot_probabilities(self) -> Figure:
        """Probability of every set of effects that was fitted to the end, and of something else."""
        return set_probabilities(self.to_xarray(), self)

    @property
    def improved_machine(self) -> Path:
        """The machine with what was found added; every command takes it."""
        return self.folder / str(self["improved_model"])

    def _headline(self) -> str:
        named = [f"{item['effect']} ({item['component']}{in_recording(item)})" for item in self["findings"]]
        return ": ".join(filter(None, (self["verdict"], ", ".join(named))))

    def _rows(self) -> Mapping[str, str]:
        found = {f"finding {n}": item["statement"] for n, item in enumerate(self["findings"], 1)}
        found |= {
            f"probability {n}": f"{item['probability']:.2f}" for n, item in enumerate(self["findings"], 1)
        }
        before, after, told = heldout_errors(self["fit"])
        if before is not None and after is not None:
            then = f"{after:.3f} K" + (f", {told}" if told else "")
            found["error on held-out readings"] = f"{before:.3f} K, then {then}"
        return found


def diagnose(
    machine: Machine,
    recordings: str | Path | Recording | Iterable[str | Path | Recording],
    folder: str | Path | None = None,
    calibrate: Iterable[str | Path | Recording] = (),
    overrides: Iterable[str] = (),
    *,
    heldout: str = "blocks",
    full_model: str = AUTO,
    progress: Progress | None = None,
) -> MachineDiagnosis:
    """Say where recordings and a machine differ, what was left out, and how well it fits with it.

    Parameters
    ----------
    machine : MachineSpec, NetworkMachineSpec, str or Path
        Loaded, or its file, or the name of one that ships; with geometry or a ``[network]``.
    recordings : one or more of str, Path, Recording
        To be explained; what is found acts in all of them.
    folder : str or Path, optional
        Gets what ``spindle-fem diagnose`` writes; without it :meth:`FolderResult.save` does.
    calibrate : iterable of str, Path or Recording
        Recordings of the same machine with nothing missing.
    overrides : iterable of str
        ``path=value`` texts.
    heldout : str
        ``blocks`` or ``last:0.4``: readings that the fit does not see.
    full_model : {"auto", "off", "coarse", "own"}
        Mesh on which both fits are run again by the full model; ``auto`` is the coarse one unless that
        would take very many time steps.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Raises
    ------
    SpindleFemError
    """
    given = [recordings] if isinstance(recordings, (str, Path, Recording)) else recordings

    def work(place: Path) -> dict[str, Any]:
        with definition_file(machine) as file:
            return diagnose_into(
                file,
                given,
                place,
                calibrate,
                overrides,
                heldout=heldout,
                full_model=full_model,
                progress=progress,
            )

    return result_in(folder, work, MachineDiagnosis)
