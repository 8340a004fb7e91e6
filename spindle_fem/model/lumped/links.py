"""Conductances between nodes, from the faces between their cells.

A face conducts through the bodies on both sides in series: from each node's
centre to the face, and through the joint in it. Faces between the same two
nodes act in parallel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.lumped.cells import Faces, MeridianCells
from spindle_fem.model.lumped.partition import Partition

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NodeCentres:
    """Position to which each node's temperature refers.

    Attributes
    ----------
    z : (n,) ndarray, [m]
        Volume mean.
    log_radius : (n,) ndarray, [-]
        Volume mean of ln(r / m).
    volume, capacity : (n,) ndarray, [m³], [J/K]
    """

    z: Array
    log_radius: Array
    volume: Array
    capacity: Array


@dataclass(frozen=True, slots=True)
class SurfacePatch:
    """Faces of one surface seen from the nodes behind them.

    Attributes
    ----------
    node : (n,) int64 ndarray
    resistance : (n,) ndarray, [K/W]
        From the node's centre to the face.
    area : (n,) ndarray, [m²]
    z : (n,) ndarray, [m]
        Middle of the face.
    """

    node: NDArray[np.int64]
    resistance: Array
    area: Array
    z: Array

    def between(self, low: float, high: float) -> SurfacePatch:
        """The faces whose middle lies between two places along z, m."""
        inside = (self.z > low) & (self.z < high)
        return SurfacePatch(*(getattr(self, name)[inside] for name in SurfacePatch.__slots__))

    @classmethod
    def joined(cls, patches: list[SurfacePatch]) -> SurfacePatch:
        """Several patches as one."""
        return cls(*(np.concatenate([getattr(p, name) for p in patches]) for name in cls.__slots__))


@dataclass(frozen=True, slots=True)
class SolidLinks:
    """Conduction between nodes.

    Attributes
    ----------
    first, second : (m,) int64 ndarray
        ``first < second``.
    conductance : (m,) ndarray, [W/K]
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    conductance: Array


def node_centres(cells: MeridianCells, partition: Partition, volumetric_capacity: Array) -> NodeCentres:
    """Centres of the nodes; ``volumetric_capacity`` in J/(m³·K) for each part."""
    node, n = partition.node_of_cell, len(partition.node_names)

    def total(values: Array) -> Array:
        return np.bincount(node, values, n)

    volume = total(cells.volume)
    return NodeCentres(
        z=total(cells.volume * cells.z.mean(axis=1)) / volume,
        log_radius=total(cells.volume * cells.log_radius) / volume,
        volume=volume,
        capacity=total(cells.volume * volumetric_capacity[cells.part]),
    )


def half_resistance(
    faces: Faces, side: NDArray[np.int64], cells: MeridianCells, partition: Partition, centres: NodeCentres,
    conductivity: Array,
) -> Array:  # fmt: skip
    """Resistance from node centre to face, K/W: logarithmic along r, linear along z (Table 1).

    Parameters
    ----------
    side : (n,) int64 ndarray
        The cell on the requested side.
    conductivity : (n_parts,) ndarray, [W/(m·K)]
    """
    node = partition.node_of_cell[side]
    with np.errstate(divide="ignore"):
        along_r = faces.position * np.abs(
            np.log(np.maximum(faces.position, 1.0e-12)) - centres.log_radius[node]
        )
    along_z = np.abs(faces.position - centres.z[node])
    return np.where(faces.radial, along_r, along_z) / (conductivity[cells.part[side]] * faces.area)


def solid_links(
    cells: MeridianCells,
    partition: Partition,
    centres: NodeCentres,
    conductivity: Array,
    joint_conductance: Mapping[str, float],
) -> SolidLinks:
    """Conduction inside parts and through their joints.

    Parameters
    ----------
    joint_conductance : mapping of joint to float, [W/(m²·K)]
        Infinite for a perfect contact, 0 for a clearance.
    """
    pieces = []
    for faces in (cells.conduction, cells.contact):
        resistance = half_resistance(faces, faces.first, cells, partition, centres, conductivity)
        resistance = resistance + half_resistance(
            faces, faces.second, cells, partition, centres, conductivity
        )
        if faces is cells.contact:
            joint = np.array([joint_conductance[name] for name in faces.name], dtype=float)
            with np.errstate(divide="ignore"):
                resistance = resistance + 1.0 / (joint * faces.area)
        ends = np.sort(
            np.column_stack([partition.node_of_cell[faces.first], partition.node_of_cell[faces.second]]),
            axis=1,
        )
        # inside a node a face may pass through the very centre; it joins nothing
        apart = (ends[:, 0] != ends[:, 1]) & np.isfinite(resistance)
        pieces.append((ends[apart], 1.0 / resistance[apart]))
    ends = np.concatenate([item[0] for item in pieces])
    conductance = np.concatenate([item[1] for item in pieces])
    pairs, inverse = np.unique(ends, axis=0, return_inverse=True)
    summed = np.bincount(inverse.ravel(), conductance, len(pairs))
    return SolidLinks(pairs[:, 0].copy(), pairs[:, 1].copy(), summed)


def surface_patch(
    faces: Faces, cells: MeridianCells, partition: Partition, centres: NodeCentres, conductivity: Array
) -> SurfacePatch:
    """Exposed or wetted faces as seen from their nodes."""
    side = faces.inside
    return SurfacePatch(
        node=partition.node_of_cell[side],
        resistance=half_resistance(faces, side, cells, partition, centres, conductivity),
        area=faces.area,
        z=faces.middle[:, 0],
    )


def side_wall_patch(
    cells: MeridianCells, partition: Partition, centres: NodeCentres, conductivity: Array
) -> SurfacePatch:
    """Walls that pass through smeared cells: heat reaches them along the lands."""
    rows = np.flatnonzero(cells.side_area > 0.0)
    node = partition.node_of_cell[rows]
    height = cells.z[rows, 1] - cells.z[rows, 0]
    section = 2.0 * np.pi * height * cells.solid_radial[rows]
    distance = np.abs(cells.log_radius[rows] - centres.log_radius[node])
    return SurfacePatch(
        node=node,
        resistance=distance / (conductivity[cells.part[rows]] * section),
        area=cells.side_area[rows],
        z=cells.z[rows].mean(axis=1),
    )


def exposed_surfaces(cells: MeridianCells) -> dict[str, Faces]:
    """Exposed faces by surface name."""
    names = cells.exposed.name
    return {str(name): cells.exposed.pick(names == name) for name in dict.fromkeys(names)}
