"""Map of space from the channel of one machine to that of another.

The machines differ only in the channel's depth, width and pitch. In
cylindrical coordinates about the axis, in this order:

- along z, the walls of all turns go to their new places: centre lines with
  the pitch, what lies between them by straight pieces; in full between floor
  and roof of the channel and over its length, less and less up to the next
  face of the machine on each side, and not at all from there on;
- radially, what lies between the channel's floor and the outside is stretched,
  so that its roof goes to its new place. Planes across the axis slide in
  themselves, so this may go on beyond the part, up to the next edge that it
  would move;
- around each port, both give way to a map that takes its cylinder to the new
  one, axis to axis, with its flat start inside the channel.

Cylinders about the axis, planes across it and half-planes through it stay
what they are; walls of the channel become walls of the new one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition, ChannelGeometry, PortGeometry
from spindle_fem.machine.geometry.faces import MeridianEdge

Array = NDArray[np.float64]

# Dimensions that may differ between the two channels.
MOVABLE = ("depth", "width", "pitch")
# The map around a port ends this many of its radii from its axis, or sooner.
_PORT_REACH = 3.5
_LEAST_REACH = 1.2
_NANOMETRE = 1.0e-9


@dataclass(frozen=True, slots=True)
class Room:
    """Metal around both channels that may give way, lengths in m.

    Attributes
    ----------
    inner, outer : float
        Radii of the faces next to the channel's floor and roof.
    front, rear : float
        Where what moves along the axis comes to rest.
    front_radial, rear_radial : float
        Where what moves radially comes to rest; infinite where it need not.
    """

    inner: float
    outer: float
    front: float
    rear: float
    front_radial: float
    rear_radial: float


@dataclass(frozen=True, slots=True)
class PortMap:
    """One drilling before and after.

    Attributes
    ----------
    reach : float, [m]
        Distance from the axis of the source at which its map ends.
    exit_radius : float, [m]
        Of the cylinder in which it opens.
    exit_name : str
        Surface of that cylinder.
    """

    source: PortGeometry
    target: PortGeometry
    reach: float
    exit_radius: float
    exit_name: str


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """Map from the space around one channel to that around another; see the module."""

    source: ChannelGeometry
    target: ChannelGeometry
    room: Room
    ports: tuple[PortMap, ...]

    def __call__(self, points: Array) -> Array:
        """New places of points.

        Parameters
        ----------
        points : (n, 3) ndarray, [m]

        Returns
        -------
        (n, 3) ndarray, [m]
            Points that do not move have the very same coordinates.
        """
        x, y, z = points.T
        radius, angle = np.hypot(x, y), np.arctan2(-x, y)
        clearance, new_z = self._along(radius, angle, z)
        new_radius = self._outwards(radius, new_z)
        new_angle = angle.copy()
        for port in self.ports:
            self._around(port, (radius, angle, z), clearance, (new_radius, new_angle, new_z))
        shift = np.hypot(np.hypot(new_radius - radius, radius * (new_angle - angle)), new_z - z)
        moved = shift > _NANOMETRE * 1.0e-3
        found = points.copy()
        found[moved, 0] = -new_radius[moved] * np.sin(new_angle[moved])
        found[moved, 1] = new_radius[moved] * np.cos(new_angle[moved])
        found[moved, 2] = new_z[moved]
        return found

    def _along(self, radius: Array, angle: Array, z: Array) -> tuple[Array, Array]:
        """Distance from the nearest centre line along z, and the mapped z."""
        before, after, room = self.source.definition, self.target.definition, self.room
        turn = np.sign(self.source.angle_span) * angle / (2.0 * np.pi) * before.starts
        advance, new_advance = (item.pitch / item.starts for item in (before, after))
        height = (z - before.z_start) / advance - turn
        number = np.round(height)
        clearance = (height - number) * advance
        knots, images = [0.0], [0.0]
        radii = {(port.source.radius, port.target.radius) for port in self.ports}
        if len(radii) == 1:  # the side of a port moves with it, so that both maps agree beside the wall
            ((radius_before, radius_after),) = radii
            knots.append(radius_before)
            images.append(radius_after)
        knots += [0.5 * before.width, 0.5 * advance]
        images += [0.5 * after.width, 0.5 * new_advance]
        side = np.sign(clearance) * np.interp(np.abs(clearance), knots, images)
        wanted = after.z_start + new_advance * (number + turn) + side
        low, high = self.source.z_bounds
        share = np.interp(
            radius, [room.inner, before.inner_radius, self.source.outer_radius, room.outer], [0, 1, 1, 0]
        )
        share *= np.interp(z, [room.front, low, high, room.rear], [0.0, 1.0, 1.0, 0.0])
        return clearance, z + share * (wanted - z)

    def _outwards(self, radius: Array, new_z: Array) -> Array:
        room = self.room
        roof, new_roof = self.source.outer_radius, self.target.outer_radius
        low, high = self.target.z_bounds
        share = np.interp(radius, [self.source.definition.inner_radius, roof, room.outer], [0.0, 1.0, 0.0])
        if np.isfinite(room.front_radial):
            share *= np.interp(new_z, [room.front_radial, low], [0.0, 1.0])
        if np.isfinite(room.rear_radial):
            share *= np.interp(new_z, [high, room.rear_radial], [1.0, 0.0])
        return radius + (new_roof - roof) * share

    def _around(
        self,
        port: PortMap,
        places: tuple[Array, Array, Array],
        clearance: Array,
        found: tuple[Array, Array, Array],
    ) -> None:
        """Blend the map of a port into ``found`` (radius, angle, z), in place."""
        source, target = port.source, port.target
        floor, roof = self.source.definition.inner_radius, self.source.outer_radius
        turned = np.mod(places[1] - source.angle + np.pi, 2.0 * np.pi) - np.pi
        across = places[0] * np.sin(turned)
        near = (np.abs(turned) < 0.5 * np.pi) & (places[0] > floor) & (np.abs(across) < port.reach)
        near &= (np.abs(places[2] - source.z) < port.reach) & (
            places[0] < port.exit_radius + _NANOMETRE * 1.0e3
        )
        near = np.flatnonzero(near)
        radius, turned, across = places[0][near], turned[near], across[near]
        axial = places[2][near] - source.z
        # In full inside the drilling, nothing at the side walls of the channel and at the reach.
        definition = self.source.definition
        wall = 0.5 * definition.width + np.maximum(radius - roof, 0.0)
        # Farthest from the centre line that the drilling comes: that line rises along its width.
        side = source.radius * np.hypot(1.0, definition.pitch / (2.0 * np.pi * floor))
        weight = np.minimum(
            (port.reach - np.hypot(across, axial)) / (port.reach - source.radius),
            (wall - np.abs(clearance[near])) / (wall - side),
        )
        weight = np.minimum(weight, (radius - floor) / (source.start_radius - floor)).clip(0.0, 1.0)
        scale = target.radius / source.radius
        new_across = scale * across
        new_floor, new_roof = self.target.definition.inner_radius, self.target.outer_radius
        along = _between(
            np.sqrt(radius**2 - across**2),
            (
                np.sqrt(floor**2 - across**2),
                np.broadcast_to(source.start_radius, across.shape),
                np.sqrt(roof**2 - across**2),
            ),
            (
                np.sqrt(new_floor**2 - new_across**2),
                np.broadcast_to(target.start_radius, across.shape),
                np.sqrt(new_roof**2 - new_across**2),
            ),
        )
        new_radius = np.where(radius < roof, np.hypot(along, new_across), found[0][near])
        new_turned = np.arcsin(new_across / new_radius)
        found[0][near] += weight * (new_radius - found[0][near])
        found[1][near] += weight * (new_turned - turned)
        found[2][near] += weight * (target.z + scale * axial - found[2][near])


def _between(values: Array, knots: tuple[Array, ...], images: tuple[Array, ...]) -> Array:
    """Piecewise linear maps with knots for each value, extrapolated linearly."""
    first = values < knots[1]
    low, high = np.where(first, knots[0], knots[1]), np.where(first, knots[1], knots[2])
    new_low, new_high = np.where(first, images[0], images[1]), np.where(first, images[1], images[2])
    return new_low + (values - low) * (new_high - new_low) / (high - low)


def build_map(source: AssemblyGeometry, target: AssemblyGeometry) -> ChannelMap:
    """Map between two machines that differ only in depth, width and pitch of the channel.

    Raises
    ------
    GeometryError
        Something else differs, there is no channel, or a port has no room to move.
    """
    if source.channel is None or target.channel is None:
        raise _refused("there is no channel")
    before, after = source.channel.definition, target.channel.definition
    if (
        _without_movable(before) != _without_movable(after)
        or source.parts != target.parts
        or source.edges != target.edges
        or len(source.channel.ports) != len(target.channel.ports)
    ):
        raise _refused(f"the machines differ in more than {', '.join(MOVABLE)}")
    edges = [edge for edge in source.edges if not edge.is_axis]
    room = _room(source.channel, target.channel, edges)
    ports = tuple(
        _port_map(first, second, source.channel, edges)
        for first, second in zip(source.channel.ports, target.channel.ports, strict=True)
    )
    return ChannelMap(source.channel, target.channel, room, ports)


def _refused(what: str) -> GeometryError:
    return GeometryError("moving the mesh", f"{what}.", "Mesh the design anew.")


def _without_movable(definition: ChannelDefinition) -> ChannelDefinition:
    return replace(definition, **dict.fromkeys(MOVABLE, 0.0))


def _room(source: ChannelGeometry, target: ChannelGeometry, edges: Iterable[MeridianEdge]) -> Room:
    edges = list(edges)
    floor = source.definition.inner_radius
    roof = max(source.outer_radius, target.outer_radius)
    low = min(source.z_bounds[0], target.z_bounds[0])
    high = max(source.z_bounds[1], target.z_bounds[1])
    beside = [edge for edge in edges if edge.z[0] <= high and edge.z[1] >= low]
    inner = max((edge.r[1] for edge in beside if edge.r[1] < floor), default=0.5 * floor)
    outer = min((edge.r[0] for edge in beside if edge.r[0] > roof), default=np.inf)
    if not np.isfinite(outer):
        raise _refused("nothing lies outside the channel")
    length = outer - inner  # of the fade, where nothing is nearer
    inside = [edge for edge in edges if edge.r[0] < outer and edge.r[1] > inner]
    front = max((edge.z[1] for edge in inside if edge.z[1] <= low), default=-np.inf)
    rear = min((edge.z[0] for edge in inside if edge.z[0] >= high), default=np.inf)
    # Circles that a radial stretch would move: ends of any edge between floor and outside.
    circles = [edge for edge in edges if any(floor < radius < outer for radius in edge.r)]
    front_radial = max((edge.z[1] for edge in circles if edge.z[1] <= low), default=-np.inf)
    rear_radial = min((edge.z[0] for edge in circles if edge.z[0] >= high), default=np.inf)
    return Room(
        inner,
        outer,
        max(front, low - length),
        min(rear, high + length),
        max(front_radial, low - length) if np.isfinite(front_radial) else -np.inf,
        min(rear_radial, high + length) if np.isfinite(rear_radial) else np.inf,
    )


def _port_map(
    source: PortGeometry, target: PortGeometry, channel: ChannelGeometry, edges: Iterable[MeridianEdge]
) -> PortMap:
    edges = list(edges)
    exits = [
        edge
        for edge in edges
        if edge.is_cylinder and edge.r[0] > channel.outer_radius and edge.z[0] < source.z < edge.z[1]
    ]
    if not exits:
        raise _refused(f"the port at z {source.z * 1e3:g} mm opens into no cylinder")
    exit_edge = min(exits, key=lambda edge: edge.r[0])
    reach = _PORT_REACH * source.radius
    for edge in edges:
        if edge.r[1] < channel.definition.inner_radius or edge.r[0] > exit_edge.r[0]:
            continue
        reach = min(reach, *(abs(port.z - end) for port in (source, target) for end in edge.z))
    if reach < _LEAST_REACH * max(source.radius, target.radius):
        raise _refused(f"the port at z {source.z * 1e3:g} mm is too near to an edge")
    return PortMap(source, target, reach, exit_edge.r[0], exit_edge.name)
