"""The thermal network of a machine definition, at any refinement.

Unrefined it is the paper's network, nodes named by part (nine columns by eight
nodes for the reference spindle); refined, every meridian cell is a node and the
network converges to the axisymmetric conduction problem.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import GeometryError, SpecError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, build_assembly
from spindle_fem.model.lumped.cells import Channelling, MeridianCells, build_cells, channel_zone
from spindle_fem.model.lumped.links import (
    NodeCentres,
    SolidLinks,
    SurfacePatch,
    exposed_surfaces,
    node_centres,
    side_wall_patch,
    solid_links,
    surface_patch,
)
from spindle_fem.model.lumped.network_growth import NetworkGrowth
from spindle_fem.model.lumped.partition import (
    Partition,
    build_columns,
    coarse_partition,
    fine_partition,
    plan_nodes,
    sliced_partition,
)
from spindle_fem.operation.bearing_heat import grows
from spindle_fem.operation.channel_cells import ChannelCells
from spindle_fem.operation.coefficients import ball_row_capacity, joint_conductances
from spindle_fem.operation.coolant_loop import CoolantLoop

Array = NDArray[np.float64]
AIR_VOLUMETRIC_CAPACITY = 1.2 * 1005.0


@dataclass(frozen=True, slots=True)
class AirBands:
    """A gap's mixed air, band by band along z.

    Attributes
    ----------
    edges : (n + 1,) ndarray, [m]
    rotating_band, standing_band : (k,) int64 ndarray
        Band of each face.
    area : (n,) ndarray, [m²]
        Of the turning side: conductance for each unit of film coefficient.
    radii : (inner, outer), [m]
        Mean radius of the turning side and of what faces it.
    """

    edges: Array
    rotating: SurfacePatch
    standing: SurfacePatch
    rotating_band: NDArray[np.int64]
    standing_band: NDArray[np.int64]
    area: Array
    radii: tuple[float, float]

    @property
    def n_bands(self) -> int:
        """Number of air nodes."""
        return len(self.area)


@dataclass(frozen=True, slots=True)
class CoolantCells:
    """The coolant cut into cells along the flow.

    Attributes
    ----------
    edges : (n + 1,) ndarray, [m]
        Along z of the helix centre line.
    patch : SurfacePatch
        All wetted faces.
    cell : (k,) int64 ndarray
    area : (n,) ndarray, [m²]
    volume : (n,) ndarray, [m³]
    """

    edges: Array
    patch: SurfacePatch
    cell: NDArray[np.int64]
    area: Array
    loop: CoolantLoop
    volume: Array


@dataclass(frozen=True, slots=True)
class MachineNetwork:
    """Everything about a machine's network that no operating point changes.

    Node order: solid nodes, balls, gap air, coolant along the flow.
    ``ball_nodes`` are the nodes of the ball rows; ``seats`` the nodes that each
    ring sits on, and the share of its seat at each; ``growth`` is there where
    preload follows the fits; ``narrow_raceways`` where balls and their heat
    meet a part of a raceway only.
    """

    spec: MachineSpec
    assembly: AssemblyGeometry
    cells: MeridianCells
    partition: Partition
    centres: NodeCentres
    conductivity: Array
    links: SolidLinks
    surfaces: Mapping[str, SurfacePatch]
    gaps: Mapping[str, AirBands]
    coolant: CoolantCells | None
    node_names: tuple[str, ...]
    capacity: Array
    refinement: int
    ball_nodes: Mapping[str, int]
    seats: Mapping[str, tuple[NDArray[np.int64], Array]]
    growth: NetworkGrowth | None = None
    narrow_raceways: Mapping[str, SurfacePatch] = field(default_factory=dict)

    @property
    def n_solid(self) -> int:
        """Number of solid nodes."""
        return len(self.partition.node_names)

    @property
    def n_nodes(self) -> int:
        """Number of all nodes."""
        return len(self.node_names)

    @property
    def air_start(self) -> int:
        """First node of the gap air."""
        return self.n_solid + len(self.spec.bearings)

    @property
    def coolant_start(self) -> int:
        """First node of the coolant."""
        return self.air_start + sum(gap.n_bands for gap in self.gaps.values())

    def raceway(self, bearing: str, side: str) -> SurfacePatch:
        """Where balls meet the inner or outer raceway of a bearing; the oil wets the whole surface."""
        name = f"{bearing}.{side}_raceway"
        return self.narrow_raceways.get(name) or self.surfaces[name]

    def spread(self, place: str) -> Array:
        """Share of the heat of a part, segment or surface that each node takes up, (n,).

        By volume and area; what enters a surface enters the nodes behind it.
        """
        found = np.zeros(self.n_nodes)
        if place in self.surfaces:
            patch = self.surfaces[place]
            np.add.at(found, patch.node, patch.area)
        else:
            cells = cells_of(self.spec, self.cells, place)
            np.add.at(found, self.partition.node_of_cell[cells], self.cells.volume[cells])
        return found / found.sum()


def build_machine_network(
    spec: MachineSpec,
    *,
    refinement: int = 1,
    channelling: Channelling = "smeared",
    lumped_along_r: bool = False,
    assembly: AssemblyGeometry | None = None,
    lines: tuple[tuple[float, ...], tuple[float, ...]] = ((), ()),
    bands: Mapping[str, tuple[float, float]] | None = None,
) -> MachineNetwork:
    """Network of a machine definition.

    Parameters
    ----------
    refinement : int
        1: the paper's lumps. n > 1: rectangular cells no longer than the
        narrowest bearing's width over n, each a node.
    channelling : {"smeared", "rings"}
        How the helix becomes axisymmetric: spread over its pitch, or as closed
        rings. Both keep wetted area and coolant volume.
    lumped_along_r : bool
        Refine along z only; radially the paper's lumps stay.
    assembly : AssemblyGeometry, optional
        Of the same machine, where it is at hand.
    lines : (along z, along r), [m]
        More lines that a refined network is cut along.
    bands : mapping of raceway to (from, to), [m]
        Raceways that balls meet on a part of their length only; lines must end it.

    Raises
    ------
    SpecError
        A refinement that is not a whole number from 1.
    GeometryError
        Parts or channel that do not fit; a gap whose sides do not face each other.

    Examples
    --------
    >>> from spindle_fem.definition.load import load_machine
    >>> build_machine_network(load_machine("recorded_spindle")).n_nodes
    72
    """
    if isinstance(refinement, bool) or int(refinement) != refinement or refinement < 1:
        raise SpecError("refinement", f"{refinement!r}.", "Allowed: a whole number from 1.")
    assembly = build_assembly(spec) if assembly is None else assembly
    spans = _gap_spans(spec, assembly)
    columns = _column_lines(spec, assembly)
    cuts = plan_nodes(spec, assembly, build_cells(assembly, extra_z=columns), spans)[2]
    if refinement == 1:
        if channelling != "smeared":
            raise SpecError(
                "channelling", f'"{channelling}" needs refinement above 1.', 'Allowed: "smeared".'
            )
        cells = build_cells(assembly, extra_z=columns, extra_r=cuts)
        partition = coarse_partition(spec, assembly, cells, spans)
    else:
        widths = [bearing.z[1] - bearing.z[0] for _, bearing in spec.bearings]
        base = min(widths) if widths else 0.02
        # the lumps' own borders stay lines, so that cells gather into lumps
        cells = build_cells(
            assembly, spacing=base / refinement, channelling=channelling,
            extra_z=(*columns, *lines[0]), extra_r=(*cuts, *lines[1]),
        )  # fmt: skip
        partition = (
            sliced_partition(spec, assembly, cells, spans)
            if lumped_along_r
            else fine_partition(spec, assembly, cells)
        )
    materials = [spec.part_material(name) for name in assembly.part_names]
    conductivity = np.array([material.thermal_conductivity for material in materials])
    volumetric = np.array([material.volumetric_heat_capacity for material in materials])
    centres = node_centres(cells, partition, spec.heat_capacity_factor.value * volumetric)
    joints = joint_conductances(spec, assembly.joint_names)
    links = solid_links(cells, partition, centres, conductivity, joints)
    surfaces = {
        name: surface_patch(faces, cells, partition, centres, conductivity)
        for name, faces in exposed_surfaces(cells).items()
    }
    ball_nodes = {bearing.name: len(partition.node_names) + i for i, (_, bearing) in enumerate(spec.bearings)}
    for row, film in spec.wetted_rows.items():
        node, z = ball_nodes[film.bearing], surfaces[f"{film.bearing}.outer_raceway"].z.mean()
        surfaces[row] = SurfacePatch(
            np.array([node]), np.zeros(1), np.array([film.element_surface]), np.array([z])
        )
    narrow = {name: surfaces[name].between(*span) for name, span in (bands or {}).items()}
    gaps = {gap.name: _air_bands(spec, gap, surfaces, cells, partition, spans[gap.name]) for gap in spec.gap}
    coolant = None
    if spec.channel is not None:
        walls = [surface_patch(cells.wall, cells, partition, centres, conductivity)]
        if cells.channelling == "smeared":
            walls.append(side_wall_patch(cells, partition, centres, conductivity))
        coolant = _coolant_cells(spec, cells, partition, SurfacePatch.joined(walls))
    names, capacity = _names_and_capacity(spec, partition, centres, gaps, coolant)
    return MachineNetwork(
        spec=spec,
        assembly=assembly,
        cells=cells,
        partition=partition,
        centres=centres,
        conductivity=conductivity,
        links=links,
        surfaces=surfaces,
        gaps=gaps,
        coolant=coolant,
        node_names=names,
        capacity=capacity,
        refinement=int(refinement),
        ball_nodes=ball_nodes,
        seats={
            ring: _seat(cells, partition, ring)
            for _, bearing in spec.bearings
            for ring in (f"{bearing.name}.inner_ring", f"{bearing.name}.outer_ring")
        },
        growth=NetworkGrowth.of(spec, cells, partition) if grows(spec) else None,
        narrow_raceways=narrow,
    )


def cells_of(spec: MachineSpec, cells: MeridianCells, place: str) -> NDArray[np.int64]:
    """Cells of a part, a ring or a segment ``part.segment``."""
    if place in cells.part_names:
        return np.flatnonzero(cells.part == cells.part_names.index(place))
    part, _, name = place.partition(".")
    ends = next(s.z for p in spec.part if p.name == part for s in p.segment if s.name == name)
    middle = cells.z.mean(axis=1)
    inside = (cells.part == cells.part_names.index(part)) & (middle > ends[0]) & (middle < ends[1])
    return np.flatnonzero(inside)


def _seat(cells: MeridianCells, partition: Partition, ring: str) -> tuple[NDArray[np.int64], Array]:
    """Nodes behind the joint that a ring sits on, and the share of each."""
    contact, own = cells.contact, cells.part_names.index(ring)
    on_first, on_second = cells.part[contact.first] == own, cells.part[contact.second] == own
    rows = np.flatnonzero((on_first | on_second) & contact.radial)
    other = np.where(on_first[rows], contact.second[rows], contact.first[rows])
    area = contact.area[rows]
    return partition.node_of_cell[other], area / area.sum() if rows.size else area


def _column_lines(spec: MachineSpec, assembly: AssemblyGeometry) -> tuple[float, ...]:
    return tuple(value for column in build_columns(spec, assembly) for value in column.z)


def _gap_spans(spec: MachineSpec, assembly: AssemblyGeometry) -> dict[str, tuple[float, float]]:
    """Range along z of each gap's turning surface."""
    spans = {}
    for gap in spec.gap:
        z = [value for edge in assembly.edges if edge.name == gap.rotating for value in edge.z]
        spans[gap.name] = (min(z), max(z))
    return spans


def _air_bands(spec, gap, surfaces, cells, partition, span) -> AirBands:
    rotating = surfaces[gap.rotating]
    standing = SurfacePatch.joined([surfaces[name] for name in gap.standing])
    inner = partition.z_bounds[(partition.z_bounds > span[0] + 1e-9) & (partition.z_bounds < span[1] - 1e-9)]
    edges = np.concatenate([[span[0]], inner, [span[1]]])
    while True:
        n = len(edges) - 1
        of_rotating = np.clip(np.searchsorted(edges, rotating.z) - 1, 0, n - 1)
        of_standing = np.clip(np.searchsorted(edges, standing.z) - 1, 0, n - 1)
        faced = (np.bincount(of_rotating, rotating.area, n) > 0.0) & (
            np.bincount(of_standing, standing.area, n) > 0.0
        )
        if faced.all():
            break
        if n == 1:
            raise GeometryError(
                f"gap {gap.name}", "one side has no surface.", "Allowed: surfaces that face along z."
            )
        # a band that only one side bounds joins its neighbour
        empty = int(np.argmin(faced))
        edges = np.delete(edges, empty if empty > 0 else 1)
    radii = tuple(
        float(np.average(np.concatenate([_face_radius(cells, name) for name in names]),
                         weights=np.concatenate([surfaces[name].area for name in names])))
        for names in ((gap.rotating,), gap.standing)
    )  # fmt: skip
    area = np.bincount(of_rotating, rotating.area, len(edges) - 1)
    return AirBands(edges, rotating, standing, of_rotating, of_standing, area, radii)


def _face_radius(cells: MeridianCells, surface: str) -> Array:
    return exposed_surfaces(cells)[surface].middle[:, 1]


def _coolant_cells(spec, cells, partition, patch) -> CoolantCells:
    channel = spec.channel
    low, high = channel_zone(channel)
    if cells.channelling == "rings":
        edges = np.linspace(low, high, max(1, int(np.ceil(channel.turns - 1e-9))) + 1)
    else:
        inner = partition.z_bounds[(partition.z_bounds > low + 1e-9) & (partition.z_bounds < high - 1e-9)]
        edges = np.concatenate([[low], inner, [high]])
    n = len(edges) - 1
    cell = np.clip(np.searchsorted(edges, patch.z) - 1, 0, n - 1)
    area = np.bincount(cell, patch.area, n)
    turns = (0.5 * (edges[1:] + edges[:-1]) - low) / channel.pitch
    mean_radius = channel.inner_radius + 0.5 * channel.depth
    turn_length = np.hypot(2.0 * np.pi * mean_radius, channel.pitch)
    loop = CoolantLoop(
        spec,
        ChannelCells(
            surfaces=(),
            facet_cell={},
            areas={},
            cell_area=np.tile(area / channel.starts, (channel.starts, 1)),
            angle=2.0 * np.pi * turns,
            position=turns * turn_length,
            is_port=np.zeros(n, dtype=bool),
        ),
    )
    section = channel.starts * channel.width * channel.depth * turn_length / channel.pitch
    return CoolantCells(edges, patch, cell, area, loop, section * np.diff(edges))


def _names_and_capacity(spec, partition, centres, gaps, coolant) -> tuple[tuple[str, ...], Array]:
    names, capacity = list(partition.node_names), [centres.capacity]
    for group, bearing in spec.bearings:
        names.append(f"{bearing.name}.balls")
        capacity.append(np.array([ball_row_capacity(spec, group, bearing)]))

    def band_names(label: str, edges: Array) -> list[str]:
        middle = 0.5 * (edges[1:] + edges[:-1])
        found = []
        for position, z in enumerate(middle):
            column = next((c for c in partition.columns if c.z[0] <= z <= c.z[1]), partition.columns[-1])
            unique = len(middle) <= len(partition.columns)
            found.append(f"{column.name}.{label}" if unique else f"{label}[{position}]")
        return found

    for name, gap in gaps.items():
        names += band_names(f"{name}_air", gap.edges)
        clearance = max(gap.radii[1] - gap.radii[0], 1.0e-5)
        capacity.append(AIR_VOLUMETRIC_CAPACITY * gap.area * clearance)
    if coolant is not None:
        names += band_names("coolant", coolant.edges)
        properties = coolant.loop.coolant.properties(spec.coolant.inlet_temperature)
        capacity.append(float(properties.density * properties.specific_heat_capacity) * coolant.volume)
    return tuple(names), np.concatenate(capacity)
