"""``spindle_fem.solve``: a machine's steady temperatures, to read, plot, save and hand on."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.model.elastic.deformed_shape import still_place
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.report.growth_chart import deformed_machine
from spindle_fem.report.pyvista_grid import grid_of
from spindle_fem.report.run_outputs import draw_charts, write_outputs
from spindle_fem.results.dataset import build_dataset
from spindle_fem.results.output_folder import output_folder
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.prepared_machine import Progress
from spindle_fem.studies import solve_machine

if TYPE_CHECKING:
    import pyvista as pv
    import xarray as xr
    from matplotlib.figure import Figure


class SolvedMachine(ThermalResult):
    """A solved machine, as :class:`~spindle_fem.results.thermal_result.ThermalResult`, to plot and save."""

    def to_xarray(self) -> xr.Dataset:
        """Bearings, coolant, probes, surfaces, parts and joints with units, temperatures in °C."""
        return build_dataset(self)

    def to_pyvista(self) -> pv.UnstructuredGrid:
        """Curved elements with ``temperature_degC`` and ``heat_flux_W_m2`` at nodes, ``part`` in cells."""
        return grid_of(self.spec, self.mesh, self.temperature)

    def save(self, folder: str | Path) -> Path:
        """Write what ``spindle-fem run`` writes: summary, fields, data, figures and report.

        Raises
        ------
        BadInputError
            The folder holds something else, or cannot be written.
        """
        with output_folder(folder) as place:
            write_outputs(self, place)
        return place

    def plot_temperature(self) -> Figure:
        """Temperature in the vertical plane through the axis."""
        return draw_charts(self)["meridian_temperature"]()

    def plot_profiles(self) -> Figure:
        """Temperature along the machine, at some radii."""
        return draw_charts(self)["axial_profiles"]()

    def plot_heat_balance(self) -> Figure:
        """Heat sources and sinks."""
        return draw_charts(self)["heat_balance"]()

    def plot_bearings(self) -> Figure | None:
        """Heat of every bearing, term by term; None without bearings."""
        return draw_charts(self)["heat_by_bearing"]()

    def plot_coolant(self) -> Figure:
        """Coolant, wall and film along the channel.

        Raises
        ------
        SpecError
            There is no channel: a circuit has one film and one outlet, and nothing along it.
        """
        drawn = draw_charts(self)["coolant"]()
        if drawn is None:
            streams = f"; circuits has {', '.join(self.circuits)}" if self.circuits else ""
            what = f"has no [channel] along which to draw its coolant{streams}."
            raise SpecError(self.spec.name, what, "Use plot_heat_balance for what coolant carries off.")
        return drawn

    def plot_growth(self) -> Figure | None:
        """Shaft, rings and housing displaced by growth, exaggerated; None without bearings on bodies."""
        return deformed_machine(self.shapes, still_place(self.spec))


def solve(
    machine: MachineSpec | str | Path,
    point: OperatingPoint | None = None,
    *,
    progress: Progress = lambda stage: None,
) -> SolvedMachine:
    """Steady temperatures of a machine, with its self-checks.

    Parameters
    ----------
    machine : MachineSpec, str or Path
        Loaded, or its file, or the name of one that ships.
    point : OperatingPoint, optional
        The definition's own by default.
    progress : callable
        Called with the name of each stage as it begins.

    Raises
    ------
    SpecError
        The machine has no geometry.
    GeometryError, MeshQualityError, NoSteadyStateError, ConvergenceError, EnergyBalanceError
    """
    if isinstance(machine, NetworkMachineSpec):
        raise SpecError(
            machine.name, "is a machine without geometry.", "Only simulate and diagnose take one."
        )
    found = solve_machine.solve(machine, point, progress=progress)
    return SolvedMachine(**{item.name: getattr(found, item.name) for item in fields(ThermalResult)})
