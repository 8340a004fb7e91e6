"""Seats and rings of a machine at the temperatures of its network: the same elasticity as on the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.model.elastic.machine_bodies import machine_bodies
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.model.elastic.ring_seats import RingSeats
from spindle_fem.model.lumped.cells import MeridianCells
from spindle_fem.model.lumped.partition import Partition
from spindle_fem.physics.bearings.seat_contact import SeatBodies

Array = NDArray[np.float64]
# m; a corner of a section lies on the lines of the cells around it.
ON_LINE = 1.0e-7


@dataclass(frozen=True, slots=True, eq=False)
class NetworkGrowth:
    """Shifts and compliance of a machine's rings, from temperatures of nodes.

    Attributes
    ----------
    bearings : tuple of str
    seats : mapping of bearing set to SeatBodies
        Of the sets with fits.
    rows : (k, 4, n_nodes) ndarray, [m/K]
        Shifts of every bearing by a kelvin of each solid node.
    assembled_at : (k,) ndarray, [K]
    """

    bearings: tuple[str, ...]
    seats: Mapping[str, SeatBodies]
    rows: Array
    assembled_at: Array

    @classmethod
    def of(cls, spec: MachineSpec, cells: MeridianCells, partition: Partition) -> NetworkGrowth:
        """Build for a machine divided into cells; every cell has the temperature of its node."""
        bodies = machine_bodies(spec)
        seating = RingSeats(spec, bodies)
        number = len(partition.node_names)
        values = {
            name: _corner_values(body.section, cells, bodies.parts[name])
            @ sparse.csr_array(
                (np.ones(cells.n_cells), (np.arange(cells.n_cells), partition.node_of_cell)),
                shape=(cells.n_cells, number),
            )
            for name, body in bodies.bodies.items()
        }
        assembled = {bearing.name: group.assembly_temperature for group, bearing in spec.bearings}
        return cls(
            seating.bearings,
            seating.of_sets(spec),
            seating.thermal_rows(*seating.rows_over(values)),
            np.array([assembled[name] for name in seating.bearings]),
        )

    def shifts(self, temperature: Array) -> dict[str, Array]:
        """Shifts of each bearing, (4,) m, as ``SeatBodies.law`` takes them, at solid nodes (n,) [K]."""
        found = self.rows @ temperature - self.rows.sum(axis=2) * self.assembled_at[:, None]
        return dict(zip(self.bearings, found, strict=True))


def _corner_values(section: MeridianMesh, cells: MeridianCells, parts: tuple[str, ...]) -> sparse.csr_array:
    """Mean over the cells of some parts around every corner of a section, (n_corners, n_cells).

    A corner inside the channel, where no cell is, has the nearest one.
    """
    own = np.flatnonzero(np.isin(np.array(cells.part_names)[cells.part], parts))
    away = np.zeros((section.mesh.nvertices, len(own)))
    for places, ends in zip(section.mesh.p, (cells.z[own], cells.r[own]), strict=True):
        below, above = ends[:, 0] - places[:, None], places[:, None] - ends[:, 1]
        away = np.maximum(away, np.maximum(below, above))
    nearest = away.min(axis=1, keepdims=True)
    corner, cell = np.nonzero(away <= np.maximum(nearest, 0.0) + ON_LINE)
    share = 1.0 / np.bincount(corner)[corner]
    return sparse.csr_array((share, (corner, own[cell])), shape=(len(away), cells.n_cells))
