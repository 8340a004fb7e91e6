"""What a mesh model takes from elastic bodies: rows over all unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.elastic.machine_bodies import carries_rings
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.operation.named_places import growth_places
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.units import MICROMETRES

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class GrowthRows:
    """Linear outputs of growth.

    Attributes
    ----------
    places : mapping of str to (n,) ndarray
        Weights of the temperature that each seat grows with.
    sensors : (n_sensors, n) csr_array, [µm/K]
    spins : (n_sensors,) ndarray, [µm s²]
    shifts : (4 n_bearings, n) csr_array, [µm/K]
        As ``ThermalModel.ring_shifts``.
    """

    places: dict[str, Array]
    sensors: sparse.csr_array
    spins: Array
    shifts: sparse.csr_array


class GrowthWorker:
    """Works the rows out, in a process beside the one that integrates the mesh's operators."""

    def __init__(self, machine: PreparedMachine) -> None:
        self._machine = machine

    def rows(self, size: int) -> GrowthRows | None:
        """Rows over ``size`` unknowns; None for a machine whose growth nothing asks for."""
        spec, operators = self._machine.spec, self._machine.operators
        fitted = carries_rings(spec) and any(group.fit for group in spec.bearing_set)
        if not (spec.displacement_sensor or fitted):
            return None
        growth = self._machine.growth or GrowthModel(spec, operators.mesh, operators.order)
        seen, spins = growth.sensor_rows if spec.displacement_sensor else (np.zeros((0, 1)), np.zeros(0))
        own = [growth.bearings.index(bearing.name) for _, bearing in spec.bearings if growth.bearings]
        shifts = growth.thermal_rows[own].reshape(4 * len(own), -1) if own else np.zeros((0, 1))
        return GrowthRows(
            dict(growth_places(growth, size)),
            _micrometres(seen, size),
            MICROMETRES * spins,
            _micrometres(shifts, size),
        )


def _micrometres(rows: Array, size: int) -> sparse.csr_array:
    """Displacements [m/K] by temperatures of the mesh as µm/K over all unknowns."""
    return widened(sparse.csr_array(MICROMETRES * rows), size)


def widened(rows: sparse.csr_array, size: int) -> sparse.csr_array:
    """Rows over the mesh's unknowns extended over the lumped nodes."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], size))
