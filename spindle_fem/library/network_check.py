"""``spindle_fem.crosscheck``: a machine's lumped network beside its elements, to plot and hand on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.commands.crosscheck_command import crosscheck_machine
from spindle_fem.library.folder_result import FolderResult, result_in
from spindle_fem.library.loaded_machine import Machine, Progress, definition_file
from spindle_fem.report import crosscheck_charts
from spindle_fem.studies.crosscheck.causes import CAUSES
from spindle_fem.studies.crosscheck.crosscheck_study import Crosscheck

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


class NetworkCheck(FolderResult):
    """``crosscheck.json`` by key, with fields and causes in ``found``."""

    def __init__(self, content: Mapping[str, Any], folder: Path, found: Crosscheck) -> None:
        super().__init__(content, folder)
        self.found = found

    def to_xarray(self) -> xr.Dataset:
        """Temperatures of the nodes and heat of the links, by network and by elements."""
        import xarray as xr

        def column(rows: str, dimension: str, key: str, unit: str) -> tuple[str, list[Any], dict[str, str]]:
            return dimension, [item[key] for item in self[rows]], {"units": unit}

        return xr.Dataset(
            {
                "network_temperature": column("nodes", "node", "network_degC", "degC"),
                "fem_temperature": column("nodes", "node", "fem_degC", "degC"),
                "network_heat": column("links", "link", "network_W", "W"),
                "fem_heat": column("links", "link", "fem_W", "W"),
            },
            {
                "node": [item["node"] for item in self["nodes"]],
                "link": [item["link"] for item in self["links"]],
            },
            {"machine": self["machine"]},
        )

    def plot_difference(self) -> Figure:
        """Network less elements on the machine."""
        return crosscheck_charts.difference_map(self.found.comparison)

    def plot_temperatures(self) -> Figure:
        """Temperature fields of network and FEM on one scale."""
        return crosscheck_charts.temperature_map(self.found.comparison)

    def plot_causes(self) -> Figure:
        """Causes of the largest differences between nodes."""
        return crosscheck_charts.causes_chart(self.found.comparison, self.found.study, CAUSES)

    def _headline(self) -> str:
        largest = max(abs(item["difference_K"]) for item in self["nodes"])
        return f"{self['machine']}, {len(self['nodes'])} nodes, at most {largest:.2f} K apart"

    def _rows(self) -> Mapping[str, str]:
        order = sorted(self["nodes"], key=lambda item: -abs(item["difference_K"]))[:5]
        return {item["node"]: f"network − elements {item['difference_K']:+.2f} K" for item in order}


def crosscheck(
    machine: Machine,
    folder: str | Path | None = None,
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
) -> NetworkCheck:
    """Build the paper's network of a machine, solve it and the FEM, and explain their differences.

    Parameters
    ----------
    machine : MachineSpec, str or Path
        Loaded, or its file, or the name of one that ships; with geometry.
    folder : str or Path, optional
        Gets what ``spindle-fem crosscheck`` writes; without it :meth:`FolderResult.save` does.
    overrides : iterable of str
        ``path=value`` texts.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Raises
    ------
    SpindleFemError
        Bad input, or a model that has no solution.
    """
    kept: list[Crosscheck] = []

    def work(place: Path) -> dict[str, Any]:
        with definition_file(machine) as file:
            return crosscheck_machine(file, place, overrides, progress, kept.append)

    return result_in(folder, work, lambda content, place: NetworkCheck(content, place, kept[0]))
