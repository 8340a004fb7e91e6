"""A temperature field as a PyVista grid, for pictures and filters of one's own."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.results.field_file import heat_flux
from spindle_fem.units import ZERO_CELSIUS_K

with warnings.catch_warnings():
    # of a progress bar that one of its libraries would like in notebooks
    warnings.filterwarnings("ignore", message="IProgress not found")
    import pyvista as pv


def grid_of(spec: MachineSpec, mesh: TaggedMesh, temperature: NDArray[np.float64]) -> pv.UnstructuredGrid:
    """Quadratic tetrahedra in metres with temperature, heat flux and part.

    Parameters
    ----------
    temperature : (n_nodes,) ndarray, [K]

    Returns
    -------
    UnstructuredGrid
        Points: ``temperature_degC``, ``heat_flux_W_m2``. Cells: ``part``, a number; the field data ``parts``
        has their names.
    """
    grid = pv.UnstructuredGrid({pv.CellType.QUADRATIC_TETRA: mesh.tetrahedra}, mesh.points)
    conductivity = {name: spec.part_material(name).thermal_conductivity for name in mesh.part_names}
    grid.cell_data["part"] = mesh.part_of_element
    grid.field_data["parts"] = list(mesh.part_names)
    grid.point_data["heat_flux_W_m2"] = heat_flux(mesh, temperature, conductivity)
    grid.point_data["temperature_degC"] = temperature - ZERO_CELSIUS_K
    grid.set_active_scalars("temperature_degC")
    return grid
