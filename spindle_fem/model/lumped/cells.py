"""The meridian plane of a machine cut into rectangular cells with named faces.

Cells follow every line of the geometry, so each lies in one part; faces are
conduction inside a part, contacts of two parts, exposed surfaces, or walls of
the channel. The helix is either smeared over its pitch or drawn as closed
rings; both keep its wetted area and its volume.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition

Array = NDArray[np.float64]
Channelling = Literal["smeared", "rings"]

NANOMETRE = 1.0e-9
OUTSIDE = -1


@dataclass(frozen=True, slots=True)
class Faces:
    """Faces of one kind, each a piece of a cylinder or a plane.

    Attributes
    ----------
    first, second : (n,) int64 ndarray
        Cells on the side of lower and of higher coordinate; ``OUTSIDE`` where
        there is none.
    radial : (n,) bool ndarray
        Whether heat crosses it along r (a cylinder).
    position : (n,) ndarray, [m]
        r of a cylinder, z of a plane.
    span : (n, 2) ndarray, [m]
        Range of the other coordinate.
    area : (n,) ndarray, [m²]
        What of the full ring counts: less where the channel takes a share.
    share : (n,) ndarray, [-]
        ``area`` over that of the full ring.
    name : (n,) object ndarray of str
        Part, joint, surface or ``""``.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    radial: NDArray[np.bool_]
    position: Array
    span: Array
    area: Array
    share: Array
    name: NDArray[np.object_]

    def __len__(self) -> int:
        return len(self.first)

    def pick(self, rows: NDArray) -> Faces:
        """Some of the faces."""
        return Faces(*(getattr(self, field)[rows] for field in self.__slots__))

    @classmethod
    def joined(cls, kinds: list[Faces]) -> Faces:
        """Faces of several kinds together."""
        return cls(*(np.concatenate([getattr(faces, field) for faces in kinds]) for field in cls.__slots__))

    @property
    def inside(self) -> NDArray[np.int64]:
        """The one cell of an exposed face."""
        return np.where(self.first != OUTSIDE, self.first, self.second)

    @property
    def middle(self) -> Array:
        """Middle of each face, (n, 2) as (z, r) in m."""
        other = self.span.mean(axis=1)
        return np.where(
            self.radial[:, None],
            np.column_stack([other, self.position]),
            np.column_stack([self.position, other]),
        )


@dataclass(frozen=True, slots=True)
class MeridianCells:
    """Cells of the meridian plane with everything that conduction needs.

    Attributes
    ----------
    z, r : (n, 2) ndarray, [m]
        Bounds of each cell.
    part : (n,) int64 ndarray
        Index into ``part_names``.
    solid_radial, solid_axial : (n,) ndarray, [-]
        Share of the section that conducts each way.
    volume : (n,) ndarray, [m³]
        Of the solid.
    log_radius : (n,) ndarray, [-]
        Volume mean of ln(r / m): a cell centre there gives one-dimensional
        radial conduction its exact heat and mean temperature.
    conduction, contact, exposed, wall : Faces
        Inside parts, between parts, to the outside, to the coolant.
    blocked : Faces
        Inside a part, where the smeared channel lets nothing through.
    side_area : (n,) ndarray, [m²]
        Wetted walls that pass through the cell (smeared channel only).
    grid_index : (n, 2) int64 ndarray
        Interval of each cell between the lines.
    channelling : {"smeared", "rings"} or None
    """

    part_names: tuple[str, ...]
    z_lines: Array
    r_lines: Array
    z: Array
    r: Array
    part: NDArray[np.int64]
    solid_radial: Array
    solid_axial: Array
    volume: Array
    log_radius: Array
    conduction: Faces
    contact: Faces
    exposed: Faces
    wall: Faces
    blocked: Faces
    side_area: Array
    grid_index: NDArray[np.int64]
    channelling: Channelling | None

    @property
    def n_cells(self) -> int:
        """Number of solid cells."""
        return len(self.part)


def channel_zone(channel: ChannelDefinition) -> tuple[float, float]:
    """Range along z over which the helix is smeared: that of its centre line, m."""
    return channel.z_start, channel.z_start + channel.turns * channel.pitch


def side_wall_area(channel: ChannelDefinition, inner: float, outer: float, turns: float) -> float:
    """Area of both side walls of all starts between two radii, m².

    The walls are helicoids: ``dA = sqrt(r² + (p / 2π)²) dr dθ``.
    """
    lead = channel.pitch / (2.0 * np.pi)

    def primitive(r: float) -> float:
        root = np.hypot(r, lead)
        return 0.5 * (r * root + lead**2 * np.arcsinh(r / lead))

    return float(2.0 * channel.starts * turns * 2.0 * np.pi * (primitive(outer) - primitive(inner)))


def _ring_fractions(channel: ChannelDefinition) -> list[tuple[float, float, float]]:
    """Closed rings that represent the helix: z low, z high, share of the circumference."""
    rings = []
    for start in range(channel.starts):
        offset = (start / channel.starts - 0.5 * (channel.starts - 1) / channel.starts) * channel.pitch
        remaining, number = channel.turns, 0
        while remaining > 1.0e-9:
            share = min(1.0, remaining)
            centre = channel.z_start + channel.pitch * (number + 0.5 * share) + offset
            rings.append((centre - 0.5 * channel.width, centre + 0.5 * channel.width, share))
            remaining -= share
            number += 1
    return rings


def _refined(lines: NDArray[np.int64], spacing: float) -> Array:
    """Lines in m with intervals cut into even pieces not longer than ``spacing``."""
    exact = lines * NANOMETRE
    pieces = [exact[:1]]
    for low, high in itertools.pairwise(exact):
        number = max(1, int(np.ceil((high - low) / spacing - 1.0e-6)))
        pieces.append(np.linspace(low, high, number + 1)[1:])
    return np.concatenate(pieces)


def build_cells(
    assembly: AssemblyGeometry,
    *,
    spacing: float = np.inf,
    channelling: Channelling = "smeared",
    extra_z: tuple[float, ...] = (),
    extra_r: tuple[float, ...] = (),
) -> MeridianCells:
    """Cut a machine into cells.

    Parameters
    ----------
    spacing : float, [m]
        Longest side of a cell.
    channelling : {"smeared", "rings"}
        How the helix becomes axisymmetric.
    extra_z, extra_r : tuple of float, [m]
        More lines to cut along.

    Raises
    ------
    SpecError
        Another channelling.
    """
    if channelling not in ("smeared", "rings"):
        raise SpecError("channelling", f'"{channelling}".', 'Allowed: "smeared", "rings".')
    channel = None if assembly.channel is None else assembly.channel.definition
    z_values = [value for part in assembly.parts for s in part.segments for value in (s.z_start, s.z_end)]
    r_values = [
        value for part in assembly.parts for s in part.segments for value in (s.inner_radius, s.outer_radius)
    ]
    z_values += [value for edge in assembly.edges for value in edge.z] + list(extra_z)
    r_values += [value for edge in assembly.edges for value in edge.r if value > 0.0] + list(extra_r)
    rings: list[tuple[float, float, float]] = []
    if channel is not None:
        r_values += [channel.inner_radius, channel.inner_radius + channel.depth]
        rings = _ring_fractions(channel) if channelling == "rings" else []
        z_values += [value for ring in rings for value in ring[:2]] or list(channel_zone(channel))
    z_lines = _refined(np.unique(np.round(np.array(z_values) / NANOMETRE).astype(np.int64)), spacing)
    r_lines = _refined(np.unique(np.round(np.array(r_values) / NANOMETRE).astype(np.int64)), spacing)
    owner = _owners(assembly, z_lines, r_lines)
    void, smeared = np.zeros(owner.shape), np.zeros(owner.shape, dtype=bool)
    z_mid, r_mid = 0.5 * (z_lines[1:] + z_lines[:-1]), 0.5 * (r_lines[1:] + r_lines[:-1])
    if channel is not None:
        body = owner == assembly.part_names.index(channel.part)
        in_depth = (r_mid > channel.inner_radius) & (r_mid < channel.inner_radius + channel.depth)
        if channelling == "smeared":
            low, high = channel_zone(channel)
            smeared = body & np.outer((z_mid > low) & (z_mid < high), in_depth)
            void[smeared] = channel.starts * channel.width / channel.pitch
        for low, high, share in rings:
            void[body & np.outer((z_mid > low) & (z_mid < high), in_depth)] = share
    return _assemble(assembly, channel, z_lines, r_lines, owner, void, smeared, channelling)


def _owners(assembly: AssemblyGeometry, z_lines: Array, r_lines: Array) -> NDArray[np.int64]:
    z_mid, r_mid = 0.5 * (z_lines[1:] + z_lines[:-1]), 0.5 * (r_lines[1:] + r_lines[:-1])
    owner = np.full((len(z_mid), len(r_mid)), OUTSIDE, dtype=np.int64)
    for index, part in enumerate(assembly.parts):
        for s in part.segments:
            rows = (z_mid > s.z_start) & (z_mid < s.z_end)
            columns = (r_mid > s.inner_radius) & (r_mid < s.outer_radius)
            owner[np.ix_(rows, columns)] = index
    return owner


def _assemble(assembly, channel, z_lines, r_lines, owner, void, smeared, channelling) -> MeridianCells:
    """Number the solid cells and sort the faces by kind."""
    solid = (owner != OUTSIDE) & (void < 1.0)
    number = np.full(owner.shape, OUTSIDE, dtype=np.int64)
    number[solid] = np.arange(solid.sum())
    i, j = np.nonzero(solid)
    z = np.column_stack([z_lines[i], z_lines[i + 1]])
    r = np.column_stack([r_lines[j], r_lines[j + 1]])
    share = 1.0 - void[i, j]
    squared = r**2
    height = z[:, 1] - z[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        primitive = np.where(r > 0.0, 0.5 * squared * (np.log(r) - 0.5), 0.0)
    log_radius = (primitive[:, 1] - primitive[:, 0]) / (0.5 * (squared[:, 1] - squared[:, 0]))
    faces = _all_faces(z_lines, r_lines)
    sides = []
    for cells in (faces["below"], faces["above"]):
        inside = (cells >= 0).all(axis=1)
        rows, columns = np.where(inside[:, None], cells, 0).T
        sides.append(
            (
                np.where(inside, owner[rows, columns], OUTSIDE),
                np.where(inside, void[rows, columns], 0.0),
                np.where(inside, number[rows, columns], OUTSIDE),
                inside & smeared[rows, columns],
            )
        )
    (part_a, void_a, cell_a, smear_a), (part_b, void_b, cell_b, smear_b) = sides
    radial, area = faces["radial"], faces["area"]
    same = (part_a == part_b) & (part_a != OUTSIDE)
    free = 1.0 - np.maximum(void_a, void_b)
    # the lands of a smeared channel conduct along r; along z every one ends at the coolant, but the first and
    # the last conduct what the body beside them brings
    free = np.where(~radial & smear_a & smear_b, 0.0, free)

    def select(mask: NDArray, share: Array, first: NDArray, second: NDArray, names: NDArray) -> Faces:
        return Faces(
            first[mask], second[mask], radial[mask], faces["position"][mask], faces["span"][mask],
            (area * share)[mask], share[mask], names[mask],
        )  # fmt: skip

    touch = (part_a != part_b) & (part_a != OUTSIDE) & (part_b != OUTSIDE)
    outer = (part_a == OUTSIDE) != (part_b == OUTSIDE)
    one = np.ones(len(area))
    names = np.array([*assembly.part_names, ""], dtype=object)[part_a]
    conducts = same & (free > 0.0) & (cell_a != OUTSIDE) & (cell_b != OUTSIDE)
    conduction = select(conducts, free, cell_a, cell_b, names)
    wetted = np.abs(void_a - void_b) * (same & ~(~radial & (smear_a | smear_b)))
    dry_a = void_a < void_b
    wall = select(
        wetted > 0.0, wetted, np.where(dry_a, cell_a, OUTSIDE), np.where(dry_a, OUTSIDE, cell_b), names
    )
    labels = _edge_names(assembly, faces)
    side_area = np.zeros(len(i))
    if channel is not None and channelling == "smeared":
        for cell in np.flatnonzero(smeared[i, j]):
            side_area[cell] = side_wall_area(channel, *r[cell], height[cell] / channel.pitch)
    return MeridianCells(
        part_names=assembly.part_names,
        z_lines=z_lines,
        r_lines=r_lines,
        z=z,
        r=r,
        part=owner[i, j],
        solid_radial=share,
        solid_axial=np.where(smeared[i, j], 0.0, share),
        volume=np.pi * (squared[:, 1] - squared[:, 0]) * height * share,
        log_radius=log_radius,
        conduction=conduction,
        contact=select(touch, one, cell_a, cell_b, labels),
        exposed=select(outer & (labels != ""), one, cell_a, cell_b, labels),
        wall=wall,
        blocked=select(
            same & ~conducts & (cell_a != OUTSIDE) & (cell_b != OUTSIDE), one, cell_a, cell_b, names
        ),
        side_area=side_area,
        grid_index=np.column_stack([i, j]),
        channelling=None if channel is None else channelling,
    )


def _all_faces(z_lines: Array, r_lines: Array) -> Mapping[str, NDArray]:
    nz, nr = len(z_lines) - 1, len(r_lines) - 1
    i, j = (index.ravel() for index in np.meshgrid(np.arange(nz), np.arange(nr + 1), indexing="ij"))
    cylinders = {
        "below": np.column_stack([i, j - 1]),
        "above": np.column_stack([i, np.where(j < nr, j, -1)]),
        "radial": np.ones(len(i), dtype=bool),
        "position": r_lines[j],
        "span": np.column_stack([z_lines[i], z_lines[i + 1]]),
        "area": 2.0 * np.pi * r_lines[j] * (z_lines[i + 1] - z_lines[i]),
    }
    i, j = (index.ravel() for index in np.meshgrid(np.arange(nz + 1), np.arange(nr), indexing="ij"))
    planes = {
        "below": np.column_stack([i - 1, j]),
        "above": np.column_stack([np.where(i < nz, i, -1), j]),
        "radial": np.zeros(len(i), dtype=bool),
        "position": z_lines[i],
        "span": np.column_stack([r_lines[j], r_lines[j + 1]]),
        "area": np.pi * (r_lines[j + 1] ** 2 - r_lines[j] ** 2),
    }
    return {key: np.concatenate([cylinders[key], planes[key]]) for key in cylinders}


def _edge_names(assembly: AssemblyGeometry, faces: Mapping[str, NDArray]) -> NDArray[np.object_]:
    """Surface or joint of every face that lies on an edge of the geometry."""
    names = np.full(len(faces["area"]), "", dtype=object)
    other = faces["span"].mean(axis=1)
    for edge in assembly.edges:
        if edge.is_axis:
            continue
        own, across = (edge.r, edge.z) if edge.is_cylinder else (edge.z, edge.r)
        on_line = np.abs(faces["position"] - own[0]) < NANOMETRE
        names[(faces["radial"] == edge.is_cylinder) & on_line & (other > across[0]) & (other < across[1])] = (
            edge.name
        )
    return names
