"""Cells along the helical channel and the wall facets that belong to each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import Channel
from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.operation.gap_bands import angle_of


@dataclass(frozen=True, slots=True)
class ChannelCells:
    """Wetted facets of one start, cell by cell from inlet to outlet.

    Attributes
    ----------
    surfaces : tuple of str
        Wetted surfaces of the mesh, in the order of ``facet_cell``.
    facet_cell : mapping of surface to (n_facets,) int ndarray
        Global cell of each facet: start · cells_per_start + index along it.
    areas : mapping of surface to (n_facets,) ndarray, [m²]
    cell_area : (n_starts, cells_per_start) ndarray, [m²]
    angle : (cells_per_start,) ndarray, [rad]
        Helix angle of each cell's centre from the inlet.
    position : (cells_per_start,) ndarray, [m]
        Developed length from the inlet.
    is_port : (cells_per_start,) bool ndarray
    """

    surfaces: tuple[str, ...]
    facet_cell: dict[str, NDArray[np.int64]]
    areas: dict[str, NDArray[np.float64]]
    cell_area: NDArray[np.float64]
    angle: NDArray[np.float64]
    position: NDArray[np.float64]
    is_port: NDArray[np.bool_]

    @property
    def n_starts(self) -> int:
        """Number of parallel channels."""
        return self.cell_area.shape[0]


def cells_of_model(model: ThermalModel) -> ChannelCells:
    """The coolant's cells of a thermal model, without the mesh's facets."""
    return ChannelCells(
        (), {}, {}, model.cell_area, model.cell_angle, model.cell_position, model.cell_is_port
    )


def helix_coordinates(
    points: NDArray[np.float64], channel: Channel
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Start number and helix angle from its inlet, for points in the channel.

    The centre line of start ``k`` is ``z = z_start + pitch φ / 2π`` with the
    angle ``θ = ± φ + 2π k / starts`` (+ for a right-handed channel).
    """
    sign = 1.0 if channel.hand == "right" else -1.0
    theta = angle_of(points)
    ideal = (points[:, 2] - channel.z_start) / channel.pitch * 2.0 * np.pi
    candidates = []
    for start in range(channel.starts):
        phase = np.mod(sign * (theta - sign * 2.0 * np.pi * start / channel.starts), 2.0 * np.pi)
        turns = np.round((ideal - phase) / (2.0 * np.pi))
        candidates.append(phase + 2.0 * np.pi * turns)
    angles = np.stack(candidates)
    start = np.abs(angles - ideal).argmin(axis=0)
    return start, angles[start, np.arange(len(points))]


def build_channel_cells(
    mesh: TaggedMesh,
    facet_area: Mapping[str, NDArray[np.float64]],
    channel: Channel,
    cells_per_turn: int = 12,
) -> ChannelCells:
    """Sort the wetted facets into cells along the helix.

    Ports, where the channel has wetted ones, make a first and a last cell.

    Parameters
    ----------
    facet_area : mapping of surface to (n_facets,) ndarray, [m²]

    Raises
    ------
    GeometryError
        A cell without wall, or a facet beyond the ends of the channel.
    """
    wall = f"{channel.part}.channel_wall"
    ports = f"{channel.part}.channel_ports"
    where = "channel"
    centres = facet_centres(mesh.points, mesh.require_surface(wall, where))
    start, angle = helix_coordinates(centres, channel)
    total = 2.0 * np.pi * channel.turns
    tolerance = 2.0 * np.pi / cells_per_turn
    if angle.min() < -tolerance or angle.max() > total + tolerance:
        raise GeometryError(
            where, f"wall facets lie {np.degrees(angle.max() - total):.1f} degrees beyond the end."
        )
    n_cells = max(4, round(channel.turns * cells_per_turn))
    cell = np.clip((angle / total * n_cells).astype(np.int64), 0, n_cells - 1)
    with_ports = channel.ports is not None and channel.ports.wetted
    n_along = n_cells + 2 * with_ports
    facet_cell = {wall: start * n_along + cell + with_ports}
    facet_areas = {wall: facet_area[wall]}
    if with_ports:
        port_centres = facet_centres(mesh.points, mesh.require_surface(ports, where))
        port_start, port_cell = _port_cells(port_centres, channel, n_along)
        facet_cell[ports] = port_start * n_along + port_cell
        facet_areas[ports] = facet_area[ports]
    cell_area = np.zeros(channel.starts * n_along)
    for name, cells in facet_cell.items():
        cell_area += np.bincount(cells, facet_areas[name], channel.starts * n_along)
    if (cell_area <= 0.0).any():
        raise GeometryError(
            where, f"{int((cell_area <= 0.0).sum())} of its cells have no wall facet; refine the mesh."
        )
    radius = channel.inner_radius + 0.5 * channel.depth
    slope = float(np.hypot(radius, channel.pitch / (2.0 * np.pi)))
    centre_angle = (np.arange(n_cells) + 0.5) * total / n_cells
    is_port = np.zeros(n_along, dtype=bool)
    if with_ports:
        centre_angle = np.concatenate([[0.0], centre_angle, [total]])
        is_port[[0, -1]] = True
    return ChannelCells(
        surfaces=tuple(facet_cell),
        facet_cell=facet_cell,
        areas=facet_areas,
        cell_area=cell_area.reshape(channel.starts, n_along),
        angle=centre_angle,
        position=centre_angle * slope,
        is_port=is_port,
    )


def _port_cells(
    centres: NDArray[np.float64], channel: Channel, n_along: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    sign = 1.0 if channel.hand == "right" else -1.0
    places = []
    for start in range(channel.starts):
        for at_outlet in (False, True):
            helix_angle = 2.0 * np.pi * channel.turns * at_outlet
            theta = sign * (helix_angle + 2.0 * np.pi * start / channel.starts)
            z = channel.z_start + channel.pitch * channel.turns * at_outlet
            radius = np.hypot(centres[:, 0], centres[:, 1])
            across = (angle_of(centres) - theta + np.pi) % (2.0 * np.pi) - np.pi
            places.append(np.hypot(radius * across, centres[:, 2] - z))
    nearest = np.argmin(places, axis=0)
    return nearest // 2, np.where(nearest % 2 == 1, n_along - 1, 0)
