"""Group cells of the meridian plane into nodes of the network, and name the nodes.

Columns follow the bearings: one for each bearing, one for each spacer or span
between bearings that is at least half a bearing wide (narrower ones go half
and half to their neighbours), one before the first and one after the last
bearing. Spans are divided where a channel or a circuit begins and ends, and
finely about there and beside bearings; the paper's machine keeps the paper's columns.
In a column, nodes follow the parts from the shaft outwards; the thickest
bodies are divided until every column has as many nodes as the richest,
which for a bearing inside a cooled housing is eight.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import CircuitFilm, MachineSpec
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.model.lumped.cells import MeridianCells, channel_zone

NARROW_SPAN = 0.5
SNAP = 0.35
# Each piece of a span over the one before it, going away from a bearing or an end of cooling.
GROWTH = 2.0
SHAFT, INNER, OUTER, HOUSING = "shaft", "inner", "outer", "housing"


@dataclass(frozen=True, slots=True)
class Column:
    """An axial slice of the machine.

    Attributes
    ----------
    name : str
        Of its bearing, or ``front_end``, ``F2_F3``, ``rear_end``.
    z : (low, high), [m]
    """

    name: str
    z: tuple[float, float]
    bearing: str | None


@dataclass(frozen=True, slots=True)
class Partition:
    """Cells gathered into nodes.

    Attributes
    ----------
    node_names : tuple of str
        Of the solid nodes.
    node_of_cell : (n_cells,) int64 ndarray
    column_of_node : (n_nodes,) int64 ndarray
    z_bounds : (n_columns + 1,) ndarray, [m]
        Where coolant and gap air are divided.
    """

    node_names: tuple[str, ...]
    node_of_cell: NDArray[np.int64]
    column_of_node: NDArray[np.int64]
    columns: tuple[Column, ...]
    z_bounds: NDArray[np.float64]


def build_columns(spec: MachineSpec, assembly: AssemblyGeometry) -> tuple[Column, ...]:
    """Axial slices of a machine, front to rear."""
    z_values = [value for part in assembly.parts for s in part.segments for value in (s.z_start, s.z_end)]
    low, high = min(z_values), max(z_values)
    bearings = sorted((bearing for _, bearing in spec.bearings), key=lambda item: item.z[0])
    if not bearings:
        return (Column("machine", (low, high), None),)
    columns: list[Column] = []
    edge, before = low, ""
    for bearing in bearings:
        start, end = bearing.z
        gap, wide = start - edge, NARROW_SPAN * (end - start)
        if not before:
            if gap > 0.0:
                columns.append(Column("front_end", (low, start), None))
        elif gap >= wide:
            columns.append(Column(f"{before}_{bearing.name}", (edge, start), None))
        elif gap > 0.0:
            middle = 0.5 * (start + edge)
            columns[-1] = Column(columns[-1].name, (columns[-1].z[0], middle), columns[-1].bearing)
            start = middle
        columns.append(Column(bearing.name, (start, end), bearing.name))
        edge, before = end, bearing.name
    if high > edge:
        columns.append(Column("rear_end", (edge, high), None))
    if spec.is_the_papers:
        return tuple(columns)
    first = min(bearing.z[1] - bearing.z[0] for bearing in bearings)
    zones = _cooled_zones(spec)
    return tuple(piece for column in columns for piece in _divided(column, zones, first))


def _cooled_zones(spec: MachineSpec) -> list[tuple[float, float]]:
    """Lengths along z over which a channel or a circuit cools, m."""
    channel = [] if spec.channel is None else [channel_zone(spec.channel)]
    return [*channel, *(film.z for film in spec.circuits if isinstance(film, CircuitFilm))]


def _divided(column: Column, zones: Iterable[tuple[float, float]], first: float) -> Iterator[Column]:
    """A span cut where cooling begins and ends, and finely about there and at its own ends.

    Parameters
    ----------
    first : float, [m]
        Width of the pieces beside a cut.
    """
    if column.bearing is not None:
        yield column
        return
    edges = list(column.z)
    for end in (end for zone in zones for end in zone):
        if edges[0] < end < edges[-1] and min(abs(end - edge) for edge in edges) >= NARROW_SPAN * first:
            edges = sorted([*edges, end])
    borders = [edge for ends in pairwise(edges) for edge in _graded(*ends, first)[:-1]] + [edges[-1]]
    for number, ends in enumerate(pairwise(borders), 1):
        yield Column(f"{column.name}_{number}" if len(borders) > 2 else column.name, ends, None)


def _graded(low: float, high: float, first: float) -> list[float]:
    """Borders of pieces of about ``first`` at both ends, further ones up to twice as wide as those before.

    Heat of a bearing, and what a coolant takes, leaves within some wall thicknesses from there.

    >>> _graded(0.0, 12.0, 2.0)
    [0.0, 2.0, 6.0, 10.0, 12.0]
    """
    length, widths, step = high - low, [], first
    while 2.0 * (sum(widths) + step) <= length:
        widths.append(step)
        step *= GROWTH
    left = length - 2.0 * sum(widths)
    middle = [0.5 * left] * 2 if left > step else [left] if left > NARROW_SPAN * first else []
    every = np.array([*widths, *middle, *widths[::-1]] or [length])
    # A sliver in the middle goes to its neighbours.
    every *= length / every.sum()
    return [*(low + np.cumsum([0.0, *every])[:-1]).tolist(), high]


def part_roles(spec: MachineSpec, assembly: AssemblyGeometry) -> dict[str, str]:
    """Radial place of every part: shaft, inner (rings and their spacers), outer, housing."""
    roles = {}
    for _, bearing in spec.bearings:
        roles[f"{bearing.name}.inner_ring"] = INNER
        roles[f"{bearing.name}.outer_ring"] = OUTER
    joined = [set(pair) for name, pair in assembly.joint_parts.items() if name.endswith(":face")]
    extent = {
        part.name: (
            min(s.inner_radius for s in part.segments),
            max(s.outer_radius for s in part.segments),
        )
        for part in assembly.parts
    }
    rings = dict(roles)
    for part in assembly.parts:
        if part.name in roles:
            continue
        role = SHAFT if part.rotating else HOUSING
        for ring, place in rings.items():
            low, high = extent[ring]
            own = extent[part.name]
            beside = {part.name, ring} in joined and min(high, own[1]) - max(low, own[0]) > 0.5 * (
                own[1] - own[0]
            )
            if beside and part.rotating == (place == INNER):
                role = place
        roles[part.name] = role
    return roles


@dataclass(slots=True)
class _Body:
    """Cells of one column that make a node, or several once divided."""

    name: str
    cells: NDArray[np.int64]
    r: tuple[float, float]
    steps: tuple[float, ...] = ()
    pieces: int = 1

    @property
    def thickness(self) -> float:
        return float(np.log(self.r[1] / max(self.r[0], 1.0e-2 * self.r[1]))) / self.pieces

    def bounds(self) -> NDArray[np.float64]:
        """Radii between the pieces: even, or at a near step of the body, so that no sliver is left."""
        even = np.linspace(self.r[0], self.r[1], self.pieces + 1)
        reach = SNAP * (even[1] - even[0])
        for step in self.steps:
            nearest = int(np.abs(even - step).argmin())
            if 0 < nearest < self.pieces and abs(even[nearest] - step) < reach:
                even[nearest] = step
        return even


def _bodies(spec: MachineSpec, cells: MeridianCells, roles: Mapping[str, str], column: Column) -> list[_Body]:
    middle = cells.z.mean(axis=1)
    inside = np.flatnonzero((middle > column.z[0]) & (middle < column.z[1]))
    groups: dict[str, list[int]] = {}
    channel = spec.channel
    r_mid = cells.r.mean(axis=1)
    cooled = channel is not None and _overlaps(column.z, channel_zone(channel))
    for cell in inside:
        part = cells.part_names[cells.part[cell]]
        role = roles[part]
        if role in (INNER, OUTER):
            key = f"{role}_ring" if column.bearing else f"{role}_spacer"
        elif cooled and part == channel.part:
            outer = channel.inner_radius + channel.depth
            in_zone = channel_zone(channel)[0] < middle[cell] < channel_zone(channel)[1]
            if r_mid[cell] < channel.inner_radius:
                key = f"{part}.inside"
            elif r_mid[cell] < outer and in_zone:
                key = f"{part}.lands"
            else:
                key = f"{part}.outside"
        else:
            key = part
        groups.setdefault(key, []).append(int(cell))
    bodies = []
    for key, members in groups.items():
        rows = np.array(members)
        steps = tuple(np.unique(np.round(_outer_steps(cells, rows), 9)).tolist())
        bodies.append(_Body(key, rows, (float(cells.r[rows, 0].min()), float(cells.r[rows, 1].max())), steps))
    return sorted(
        bodies, key=lambda body: float(np.average(r_mid[body.cells], weights=cells.volume[body.cells]))
    )


def _outer_steps(cells: MeridianCells, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Inner and outer radius of a body in each interval along z."""
    interval = cells.grid_index[rows, 0]
    ends = [
        (cells.r[rows[interval == i], 0].min(), cells.r[rows[interval == i], 1].max())
        for i in np.unique(interval)
    ]
    return np.array(ends).ravel()


def _overlaps(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return min(one[1], other[1]) - max(one[0], other[0]) > 1.0e-9


def fluid_nodes(spec: MachineSpec, column: Column, gap_spans: Mapping[str, tuple[float, float]]) -> int:
    """Balls, coolant and gap air of a column."""
    count = int(column.bearing is not None)
    if spec.channel is not None:
        count += _overlaps(column.z, channel_zone(spec.channel))
    return count + sum(_overlaps(column.z, span) for span in gap_spans.values())


def plan_nodes(
    spec: MachineSpec,
    assembly: AssemblyGeometry,
    cells: MeridianCells,
    gap_spans: Mapping[str, tuple[float, float]],
) -> tuple[tuple[Column, ...], list[list[_Body]], tuple[float, ...]]:
    """Columns, their bodies, and the radii at which bodies are divided."""
    columns, roles = build_columns(spec, assembly), part_roles(spec, assembly)
    bodies = [_bodies(spec, cells, roles, column) for column in columns]
    wanted = max(len(own) + fluid_nodes(spec, c, gap_spans) for own, c in zip(bodies, columns, strict=True))
    cuts: set[float] = set()
    for own, column in zip(bodies, columns, strict=True):
        missing = wanted - len(own) - fluid_nodes(spec, column, gap_spans)
        for _ in range(missing):
            max(own, key=lambda body: body.thickness).pieces += 1
        cuts |= {round(float(r), 9) for body in own for r in body.bounds()[1:-1]}
    return columns, bodies, tuple(sorted(cuts))


def coarse_partition(
    spec: MachineSpec,
    assembly: AssemblyGeometry,
    cells: MeridianCells,
    gap_spans: Mapping[str, tuple[float, float]],
) -> Partition:
    """Partition with one node per body and column, as in the paper's network."""
    columns, bodies, _ = plan_nodes(spec, assembly, cells, gap_spans)
    node_of_cell = np.full(cells.n_cells, -1, dtype=np.int64)
    names: list[str] = []
    column_of: list[int] = []
    r_mid = cells.r.mean(axis=1)
    for position, (column, own) in enumerate(zip(columns, bodies, strict=True)):
        for body in own:
            bounds = body.bounds()
            piece = np.clip(np.searchsorted(bounds, r_mid[body.cells]) - 1, 0, body.pieces - 1)
            for number in range(body.pieces):
                members = body.cells[piece == number]
                if not members.size:
                    continue
                suffix = f".{number + 1}" if body.pieces > 1 else ""
                node_of_cell[members] = len(names)
                names.append(f"{column.name}.{body.name}{suffix}")
                column_of.append(position)
    edges = np.array([columns[0].z[0], *(column.z[1] for column in columns)])
    return Partition(tuple(names), node_of_cell, np.array(column_of, dtype=np.int64), columns, edges)


def fine_partition(spec: MachineSpec, assembly: AssemblyGeometry, cells: MeridianCells) -> Partition:
    """Partition with one node per cell, named by part and place."""
    columns = build_columns(spec, assembly)
    middle = cells.z.mean(axis=1)
    edges = np.array([column.z[1] for column in columns])
    column = np.minimum(np.searchsorted(edges, middle), len(columns) - 1)
    names = tuple(
        f"{cells.part_names[part]}[{i},{j}]"
        for part, (i, j) in zip(cells.part, cells.grid_index, strict=True)
    )
    return Partition(names, np.arange(cells.n_cells), column, columns, np.asarray(cells.z_lines))


def sliced_partition(
    spec: MachineSpec,
    assembly: AssemblyGeometry,
    cells: MeridianCells,
    gap_spans: Mapping[str, tuple[float, float]],
) -> Partition:
    """The lumps of :func:`coarse_partition`, cut along z at every line of the cells."""
    lumps = coarse_partition(spec, assembly, cells, gap_spans)
    intervals = len(cells.z_lines)
    key = lumps.node_of_cell * intervals + cells.grid_index[:, 0]
    unique, node = np.unique(key, return_inverse=True)
    names = tuple(f"{lumps.node_names[k // intervals]}[{k % intervals}]" for k in unique)
    return Partition(
        names,
        node.ravel(),
        lumps.column_of_node[unique // intervals],
        lumps.columns,
        np.asarray(cells.z_lines),
    )
