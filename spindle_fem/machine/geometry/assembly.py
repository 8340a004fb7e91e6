"""The machine as geometry: parts of revolution, their faces and contacts, the channel.

Everything of a spindle but the channel and its ports is a solid of revolution,
so parts are unions of rectangles in the meridian plane (z, r), and contacts,
named surfaces and faults are found there, in whole nanometres, before any CAD
kernel runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from spindle_fem.definition.drawn_tables import (
    element_rows,
    part_geometry,
    ring_geometries,
    surface_definitions,
)
from spindle_fem.errors import FaultsError, GeometryError
from spindle_fem.machine.geometry.channel_geometry import (
    ChannelDefinition,
    ChannelGeometry,
    build_channel,
)
from spindle_fem.machine.geometry.faces import MeridianEdge
from spindle_fem.machine.geometry.meridian import MeridianMap
from spindle_fem.machine.geometry.part_shapes import BallRowGeometry, PartGeometry, SurfaceDefinition

if TYPE_CHECKING:
    from spindle_fem.definition.load import Readable
    from spindle_fem.definition.machine_spec import MachineSpec

REMAINING = "adiabatic"


@dataclass(frozen=True, slots=True)
class AssemblyGeometry:
    """A checked machine, ready for solids and meshes.

    Attributes
    ----------
    edges : tuple of MeridianEdge
        Every face of revolution as its line in the meridian plane, with the
        name of its surface or joint.
    notes : tuple of str
        What was decided for the user, for example a port drilled narrower.
    """

    parts: tuple[PartGeometry, ...]
    edges: tuple[MeridianEdge, ...]
    channel: ChannelGeometry | None = None
    balls: tuple[BallRowGeometry, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names in definition order."""
        return tuple(part.name for part in self.parts)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """``part_a|part_b`` of cylindrical and ``part_a|part_b:face`` of plane contacts, sorted."""
        return tuple(sorted({edge.name for edge in self.edges if edge.is_contact}))

    @property
    def joint_parts(self) -> Mapping[str, tuple[str, str]]:
        """The two parts of each joint, in the order of its name."""
        return MappingProxyType({edge.name: edge.parts for edge in self.edges if edge.is_contact})

    @property
    def surface_names(self) -> tuple[str, ...]:
        """Every exposed surface, sorted; the walls of the channel included."""
        names = {edge.name for edge in self.edges if not edge.is_contact and not edge.is_axis}
        if self.channel is not None:
            names.update(self.channel.surface_names)
        return tuple(sorted(names))

    @property
    def rotating(self) -> Mapping[str, bool]:
        """Whether each part turns with the shaft."""
        return MappingProxyType({part.name: part.rotating for part in self.parts})


def build_assembly(spec: MachineSpec, *, where: str | None = None) -> AssemblyGeometry:
    """Geometry of a machine definition: its parts, the rings of its bearings, its channel.

    Parameters
    ----------
    where : str, optional
        The file, for messages; the machine's name where none is given.

    Raises
    ------
    FaultsError
        Every geometric fault at once.
    """
    parts = [part_geometry(part) for part in spec.part]
    balls = []
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        parts += ring_geometries(bearing, kind)
        balls += element_rows(bearing, kind)
    surfaces = surface_definitions(spec)
    channel = _channel(spec)
    return assemble(
        parts,
        surfaces,
        channel,
        balls,
        seats=_seats(spec),
        remaining=spec.remaining_surfaces,
        where=where or spec.name,
    )


def _seats(spec: MachineSpec) -> dict[str, float]:
    """Radius at which each ring sits, m."""
    found = {}
    for group, bearing in spec.bearings:
        kind = spec.bearing_types.get(group.type_name(bearing))
        if kind is not None:
            found[f"{bearing.name}.inner_ring"] = 0.5 * kind.bore_diameter
            found[f"{bearing.name}.outer_ring"] = 0.5 * kind.outer_diameter
    return found


def _channel(spec: MachineSpec) -> ChannelDefinition | None:
    if spec.channel is None:
        return None
    keys = ("part", "inner_radius", "depth", "width", "pitch", "turns", "starts", "hand", "z_start")
    values = {name: getattr(spec.channel, name) for name in keys}
    ports = spec.channel.ports
    return ChannelDefinition(**values, port_diameter=None if ports is None else ports.diameter)


def require_readable_geometry(spec: MachineSpec, readable: Readable) -> None:
    """Refuse what cannot be built of a machine whose tables have faults, whatever those would be.

    Raises
    ------
    FaultsError
        Parts that overlap, sound ones that come apart, surfaces and a channel that do not lie on sound ones.
    """
    parts = [part_geometry(part) for part in spec.part if part.segment]
    for group, bearing in spec.bearings:
        kind = spec.bearing_types.get(group.type_name(bearing))
        if kind is not None:
            parts += ring_geometries(bearing, kind)
    names = [part.name for part in parts]
    if len(set(names)) < len(names):
        return
    surfaces = [item for item in surface_definitions(spec) if item.name in readable.surfaces]
    faults: list[GeometryError] = []
    meridian = MeridianMap.of_parts(parts, surfaces, faults)
    meridian.faults_of_sound_parts(surfaces, readable.parts, faults)
    if readable.every_part:
        seats = {name: radius for name, radius in _seats(spec).items() if name in readable.parts}
        meridian.check_seats(seats, faults)
    channel = _channel(spec) if readable.channel else None
    if channel is not None and channel.part in readable.parts:
        build_channel(channel, meridian, faults)
    if faults:
        raise FaultsError(spec.name, faults)


def assemble(
    parts: Iterable[PartGeometry],
    surfaces: Iterable[SurfaceDefinition] = (),
    channel: ChannelDefinition | None = None,
    balls: Iterable[BallRowGeometry] = (),
    *,
    seats: Mapping[str, float] = MappingProxyType({}),
    remaining: Literal["adiabatic", "error"] = REMAINING,
    where: str = "machine",
) -> AssemblyGeometry:
    """Check parts, surfaces and channel against one another and name every face.

    Parameters
    ----------
    seats : mapping of part to float, [m]
        Radius at which it must sit on another.
    remaining : {"adiabatic", "error"}
        Exposed faces without a name go to ``<part>.adiabatic``, or are faults.
    where : str
        The file, for messages.

    Raises
    ------
    FaultsError
        Every fault at once, each a GeometryError.

    >>> from spindle_fem.machine.geometry.part_shapes import AnnularSegment
    >>> ring = PartGeometry("ring", (AnnularSegment(0.0, 0.02, 0.05, 0.06),))
    >>> assemble([ring]).surface_names
    ('ring.adiabatic',)
    """
    parts, surfaces = tuple(parts), tuple(surfaces)
    faults: list[GeometryError] = []
    _check_names(parts, surfaces, faults)
    if faults:
        raise FaultsError(where, faults)
    meridian = MeridianMap.of_parts(parts, surfaces, faults)
    edges = meridian.named_edges(surfaces, remaining, faults)
    meridian.check_seats(seats, faults)
    channel_geometry, notes = None, ()
    if channel is not None:
        channel_geometry, notes = build_channel(channel, meridian, faults)
    if faults:
        raise FaultsError(where, faults)
    return AssemblyGeometry(parts, edges, channel_geometry, tuple(balls), notes)


def _check_names(
    parts: tuple[PartGeometry, ...],
    surfaces: tuple[SurfaceDefinition, ...],
    faults: list[GeometryError],
) -> None:
    if not parts:
        faults.append(GeometryError("part", "no part is defined.", "Allowed: at least one part."))
    for kind, names in (("part", [p.name for p in parts]), ("surface", [s.name for s in surfaces])):
        for name in sorted({name for name in names if names.count(name) > 1}):
            faults.append(GeometryError(f'{kind} "{name}"', "is defined twice.", "Allowed: names used once."))
    part_names = {part.name for part in parts}
    for surface in surfaces:
        reserved = {f"{surface.part}.{suffix}" for suffix in (REMAINING, *ChannelGeometry.SUFFIXES)}
        if surface.name in reserved:
            faults.append(
                GeometryError(
                    f'surface "{surface.name}"',
                    "takes a name that the geometry gives itself.",
                    f"Allowed: any other than {', '.join(sorted(reserved))}.",
                )
            )
    for name in sorted(part_names):
        if "|" in name or ":" in name:
            faults.append(
                GeometryError(
                    f'part "{name}"', 'contains "|" or ":".', "Allowed: letters, digits, dot, underscore."
                )
            )
