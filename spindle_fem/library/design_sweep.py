"""``spindle_fem.sweep``: every design of a study solved, as a table to plot and hand on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.commands.sweep_command import sweep_machine
from spindle_fem.library.folder_result import FolderResult, result_in
from spindle_fem.library.loaded_machine import Machine, definition_file
from spindle_fem.report.sweep_report import draw_figures, drawn_columns
from spindle_fem.studies.sweep.results_table import read_results

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure


class DesignSweep(FolderResult):
    """``sweep.json`` by key, with the table of all designs."""

    def to_pandas(self) -> pd.DataFrame:
        """The table, one row a design: parameters and outputs by path, ``status``, ``reason``."""
        import pandas as pd

        return pd.DataFrame(read_results(self.folder)).set_index("design")

    def to_xarray(self) -> xr.Dataset:
        """The table over ``design``, with units."""
        data = self.to_pandas().to_xarray()
        for item in (*self["parameters"], *self["outputs"]):
            data[item["path"]].attrs["units"] = item["unit"]
        return data

    def plot_responses(self) -> Figure | None:
        """Outputs over the parameters that move them most; None where no number varies."""
        return self._figure("responses")

    def plot_designs(self) -> Figure | None:
        """Each design as a line over parameters and outputs; None for fewer than two."""
        return self._figure("parallel_coordinates")

    def plot_front(self) -> Figure | None:
        """Designs that no other beats in every objective; None with fewer than two objectives."""
        return self._figure("pareto_front")

    def _figure(self, name: str) -> Figure | None:
        columns = drawn_columns(self, read_results(self.folder))
        return draw_figures(self, *columns, films=()).get(name)

    def _headline(self) -> str:
        return f"{self['study']}, {self['machine']}, {self['ok']} of {self['designs']} designs solved"

    def _rows(self) -> Mapping[str, str]:
        found = {name: str(self[name]) for name in ("designs", "ok", "failed", "impossible", "feasible")}
        best = (self["optimum"] or {}).get("best")
        return found | ({} if best is None else {"best design": str(best["design"])})


def sweep(
    machine: Machine,
    study: str | Path,
    folder: str | Path | None = None,
    overrides: Iterable[str] = (),
    jobs: int = 1,
    scheduler: str | None = None,
    progress: bool = False,
) -> DesignSweep:
    """Solve every design of a study; a stopped study resumes where its folder's table ends.

    Parameters
    ----------
    machine : MachineSpec, str or Path
        Loaded, or its file, or the name of one that ships.
    study : str or Path
        A study file, or the name of one that ships.
    folder : str or Path, optional
        Gets what ``spindle-fem sweep`` writes; without it :meth:`FolderResult.save` does.
    overrides : iterable of str
        ``path=value`` texts for the machine, under those of the designs.
    jobs : int
        Worker processes; 0 for one a core. The results do not depend on it.
    scheduler : str, optional
        Address of a Dask scheduler, in place of ``jobs``.
    progress : bool
        Show rows done and time left on the terminal.

    Raises
    ------
    SpindleFemError
        Bad input, before anything runs. A design that fails is a row.
    """

    def work(place: Path) -> dict[str, Any]:
        with definition_file(machine) as file:
            run = partial(sweep_machine, file, study, place, overrides)
            return run(jobs=jobs, scheduler=scheduler, progress=progress)

    return result_in(folder, work, DesignSweep)
