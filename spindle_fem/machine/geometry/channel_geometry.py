"""The helical rectangular channel and its radial ports, and whether they fit.

Angles follow the machine's convention: θ = 0 points up (+y) and grows towards
-x, right-handed about +z; a right-handed channel advances in +z as θ grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from spindle_fem.errors import GeometryError, did_you_mean
from spindle_fem.machine.geometry.faces import VOID, in_millimetres, to_nanometres
from spindle_fem.machine.geometry.meridian import MeridianMap

MINIMUM_WALL = 2.0e-3
MINIMUM_LAND = 3.0e-3
# A port leaves this much of the channel's width on either side, and an opening
# in a step of the outside is at least this much wider than the step's distance.
PORT_MARGIN = 1.0e-3


@dataclass(frozen=True, slots=True)
class ChannelDefinition:
    """Helical channel as the user defines it, lengths in m.

    Attributes
    ----------
    part : str
        The part that it is cut from.
    inner_radius, depth, width : float
        Section: radius of the inner wall, radial depth, axial width.
    pitch : float
        Advance of one start in one turn.
    starts : int
        Channels side by side, evenly spread around the axis.
    hand : {"right", "left"}
    z_start : float
        Centre line of every start at its beginning; the first begins at θ = 0.
    port_diameter : float or None
        Radial drillings at both ends of every start; None leaves solid metal.
    """

    part: str
    inner_radius: float
    depth: float
    width: float
    pitch: float
    turns: float
    starts: int = 1
    hand: Literal["right", "left"] = "right"
    z_start: float = 0.0
    port_diameter: float | None = None


@dataclass(frozen=True, slots=True)
class PortGeometry:
    """One radial drilling, a cylinder about the ray at ``angle`` and ``z``, in m.

    ``start_radius`` lies inside the channel, ``seam_radius`` in the metal around
    the whole drilling, ``end_radius`` outside the part.
    """

    angle: float
    z: float
    radius: float
    start_radius: float
    seam_radius: float
    end_radius: float

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, y) along the axis of the drilling, outwards."""
        return -math.sin(self.angle), math.cos(self.angle)


@dataclass(frozen=True, slots=True)
class ChannelGeometry:
    """A channel that fits its part."""

    # wall: the four long walls; ends: both end faces of a channel without
    # ports; ports: everything else that is wetted where there are ports.
    SUFFIXES: ClassVar[tuple[str, ...]] = ("channel_wall", "channel_ends", "channel_ports")

    definition: ChannelDefinition
    ports: tuple[PortGeometry, ...] = ()

    @property
    def surface_names(self) -> tuple[str, ...]:
        """Names of its surfaces, on the part that it is cut from."""
        part = self.definition.part
        return f"{part}.channel_wall", f"{part}.channel_{'ports' if self.ports else 'ends'}"

    @property
    def outer_radius(self) -> float:
        """Radius of the outer wall, m."""
        return self.definition.inner_radius + self.definition.depth

    @property
    def angle_span(self) -> float:
        """Signed angle from the beginning to the end of a start, rad."""
        return _angle_span(self.definition)

    @property
    def start_angles(self) -> tuple[float, ...]:
        """Angle at which each start begins, rad."""
        return _start_angles(self.definition)

    @property
    def z_bounds(self) -> tuple[float, float]:
        """Axial extent of the metal removed, ports aside, m."""
        definition = self.definition
        return (
            definition.z_start - 0.5 * definition.width,
            definition.z_start + definition.pitch * definition.turns + 0.5 * definition.width,
        )

    @property
    def wall_area(self) -> float:
        """Exact area of the four walls of all starts without ports, m².

        Cylinders: 2 width · R · span; helicoids: two faces, each the integral
        of sqrt(r² + (pitch/2π)²) over radius and angle.

        >>> wu_tan = ChannelDefinition("housing", 0.108, 0.010, 0.012, 0.024, 5.0)
        >>> round(ChannelGeometry(wu_tan).wall_area, 4)
        0.1562
        """
        definition = self.definition
        span = abs(self.angle_span)
        slope = definition.pitch / (2.0 * math.pi)
        cylinders = definition.width * span * (definition.inner_radius + self.outer_radius)

        def primitive(radius: float) -> float:
            root = math.hypot(radius, slope)
            return 0.5 * (radius * root + slope**2 * math.asinh(radius / slope))

        helicoid = span * (primitive(self.outer_radius) - primitive(definition.inner_radius))
        return definition.starts * (cylinders + 2.0 * helicoid)

    @property
    def volume(self) -> float:
        """Exact volume of all starts without ports, m³."""
        definition = self.definition
        ring = 0.5 * (self.outer_radius**2 - definition.inner_radius**2)
        return definition.starts * abs(self.angle_span) * ring * definition.width


def _angle_span(definition: ChannelDefinition) -> float:
    sign = 1.0 if definition.hand == "right" else -1.0
    return sign * 2.0 * math.pi * definition.turns


def _start_angles(definition: ChannelDefinition) -> tuple[float, ...]:
    return tuple(2.0 * math.pi * index / definition.starts for index in range(definition.starts))


def build_channel(
    definition: ChannelDefinition, meridian: MeridianMap, faults: list[GeometryError]
) -> tuple[ChannelGeometry, tuple[str, ...]]:
    """Check the channel against its part and place its ports.

    Parameters
    ----------
    faults : list of GeometryError
        Faults are added here.

    Returns
    -------
    notes : tuple of str
        One for each port drilled narrower than requested.
    """
    number_of_faults = len(faults)
    _check_numbers(definition, faults)
    if definition.part not in meridian.part_names:
        faults.append(
            GeometryError(
                "channel.part",
                f'part "{definition.part}" does not exist.',
                did_you_mean(definition.part, meridian.part_names),
            )
        )
    if len(faults) > number_of_faults:
        return ChannelGeometry(definition), ()
    _check_walls(definition, meridian, faults)
    if definition.port_diameter is None or len(faults) > number_of_faults:
        return ChannelGeometry(definition), ()
    ports, notes = [], []
    for start in _start_angles(definition):
        for key, angle, z in (
            ("inlet", start, definition.z_start),
            (
                "outlet",
                start + _angle_span(definition),
                definition.z_start + definition.pitch * definition.turns,
            ),
        ):
            port = _place_port(definition, key, angle, z, meridian, faults)
            if port is None:
                continue
            ports.append(port)
            if 2.0 * port.radius < definition.port_diameter - 1.0e-9:
                note = (
                    f"{key} port at z {z * 1e3:g} mm drilled Ø{2e3 * port.radius:.3g} mm instead of "
                    f"Ø{definition.port_diameter * 1e3:g} mm: the channel is {definition.width * 1e3:g} mm "
                    "wide and walls of 2 mm are kept."
                )
                if note not in notes:
                    notes.append(note)
    return ChannelGeometry(definition, tuple(ports)), tuple(notes)


def _check_numbers(definition: ChannelDefinition, faults: list[GeometryError]) -> None:
    for key in ("inner_radius", "depth", "width", "pitch", "turns", "starts", "port_diameter"):
        value = getattr(definition, key)
        if value is not None and not value > 0.0:
            faults.append(GeometryError(f"channel.{key}", f"is {value:g}.", "Allowed: above 0."))
    if definition.hand not in ("right", "left"):
        faults.append(GeometryError("channel.hand", f'is "{definition.hand}".', "Allowed: right, left."))
    if definition.starts < 1:
        return
    advance = definition.pitch / definition.starts
    if definition.width + MINIMUM_LAND > advance + 1.0e-9:
        faults.append(
            GeometryError(
                "channel.width",
                f"{definition.width * 1e3:g} mm + 3 mm exceeds pitch / starts = {advance * 1e3:g} mm, "
                "neighbouring turns leave less than 3 mm of metal.",
                f"Allowed: a width up to {max(0.0, advance - MINIMUM_LAND) * 1e3:g} mm.",
            )
        )


def _check_walls(definition: ChannelDefinition, meridian: MeridianMap, faults: list[GeometryError]) -> None:
    """Every cell that is not the channel's part keeps at least the minimum wall."""
    part = meridian.part_names.index(definition.part)
    channel = ChannelGeometry(definition)
    z_low, z_high = (to_nanometres(value) for value in channel.z_bounds)
    r_low, r_high = to_nanometres(definition.inner_radius), to_nanometres(channel.outer_radius)
    boxes, owner = meridian.cell_boxes()
    outside = boxes[owner != part]
    names = np.array([*meridian.part_names, "the outside"], dtype=object)[owner[owner != part]]
    # Signed clearances of each foreign cell beyond the channel's four sides.
    gaps = {
        "front": z_low - outside[:, 1],
        "rear": outside[:, 0] - z_high,
        "inner": r_low - outside[:, 3],
        "outer": outside[:, 2] - r_high,
    }
    axial = np.maximum(np.maximum(gaps["front"], gaps["rear"]), 0)
    radial = np.maximum(np.maximum(gaps["inner"], gaps["outer"]), 0)
    distance = np.hypot(axial, radial)
    minimum = to_nanometres(MINIMUM_WALL)
    thin = distance < minimum - 0.5
    sides = {
        "inner": ("inner_radius", f"inner radius {in_millimetres(r_low)}"),
        "outer": ("depth", f"outer radius {in_millimetres(r_high)} (inner_radius + depth)"),
        "front": ("z_start", f"front edge z {in_millimetres(z_low)} (z_start - width/2)"),
        "rear": ("turns", f"rear edge z {in_millimetres(z_high)} (z_start + pitch * turns + width/2)"),
    }
    for side, (key, place) in sides.items():
        # A foreign cell is charged to the side that it is deepest beyond.
        others = np.max([gaps[name] for name in sides if name != side], axis=0)
        hit = thin & (gaps[side] >= others)
        if not hit.any():
            continue
        nearest = int(np.argmin(np.where(hit, gaps[side], np.iinfo(np.int64).max)))
        gap = int(gaps[side][nearest])
        state = (
            f"breaks through the {side} wall"
            if gap <= 0
            else f"leaves a wall of only {in_millimetres(round(distance[nearest]))}"
        )
        faults.append(
            GeometryError(
                f"channel.{key}",
                f'channel in part "{definition.part}", {place}, {state} towards {names[nearest]} '
                f"(z {_range(outside[nearest, :2])}, r {_range(outside[nearest, 2:])}).",
                "Allowed: at least 2 mm of metal on every side.",
            )
        )


def _range(bounds: np.ndarray) -> str:
    far = 5_000_000_000
    low, high = (int(value) for value in bounds)
    if abs(low) > far:
        return f"below {in_millimetres(high)}"
    if abs(high) > far:
        return f"above {in_millimetres(low)}"
    return f"{low * 1e-6:g} to {in_millimetres(high)}"


def _place_port(
    definition: ChannelDefinition,
    key: str,
    angle: float,
    z: float,
    meridian: MeridianMap,
    faults: list[GeometryError],
) -> PortGeometry | None:
    part = meridian.part_names.index(definition.part)
    boxes, owner = meridian.cell_boxes()
    outer = to_nanometres(definition.inner_radius + definition.depth)
    centre = to_nanometres(z)
    asked = min(definition.port_diameter, definition.width - 2.0 * PORT_MARGIN) / 2.0
    # Steps of the outside: axial distance of every foreign cell beyond the channel.
    beyond = (owner != part) & (boxes[:, 3] > outer)
    crossed = beyond & (boxes[:, 0] < centre) & (boxes[:, 1] > centre)
    exit_radius = int(boxes[crossed, 2].min())
    own_above = (
        (owner == part) & (boxes[:, 2] >= exit_radius) & (boxes[:, 0] < centre) & (boxes[:, 1] > centre)
    )
    foreign = crossed & (owner != VOID)
    if own_above.any() or foreign.any():
        what = (
            f'part "{meridian.part_names[owner[foreign][0]]}"'
            if foreign.any()
            else f'part "{definition.part}" again beyond a cavity'
        )
        faults.append(
            GeometryError(
                "channel.ports",
                f"{key} port at z {z * 1e3:g} mm hits {what} outside r {in_millimetres(exit_radius)}.",
                "Allowed: a free way to the outside.",
            )
        )
        return None
    aside = boxes[beyond & ~crossed & (boxes[:, 2] < exit_radius)]
    metal_beside = boxes[(owner == part) & (boxes[:, 2] >= exit_radius)]
    distances = np.concatenate(
        [
            np.maximum(aside[:, 0] - centre, centre - aside[:, 1]),
            np.maximum(metal_beside[:, 0] - centre, centre - metal_beside[:, 1]),
        ]
    )
    radius = asked
    for step in sorted({round(distance) * 1.0e-9 for distance in distances}):
        if radius > step - MINIMUM_WALL and radius < step + PORT_MARGIN:
            radius = max(step - MINIMUM_WALL, min(step - PORT_MARGIN, 1.5e-3))
    low, high = centre - to_nanometres(radius), centre + to_nanometres(radius)
    beside = (boxes[:, 0] < high) & (boxes[:, 1] > low)
    blocking = beside & beyond & (owner != VOID)
    if blocking.any() or radius < 0.5e-3:
        what = (
            f'hits part "{meridian.part_names[owner[blocking][0]]}"'
            if blocking.any()
            else "finds no room beside a step of the outside"
        )
        faults.append(
            GeometryError(
                "channel.ports",
                f"{key} port at z {z * 1e3:g} mm, Ø{2e3 * radius:.3g} mm, {what}.",
                "Allowed: a free way to the outside; move z_start, pitch or turns, or leave ports out.",
            )
        )
        return None
    nearest_exit = boxes[beside & beyond, 2].min() * 1.0e-9
    wall_radius = definition.inner_radius + definition.depth
    return PortGeometry(
        angle=angle,
        z=z,
        radius=radius,
        start_radius=definition.inner_radius + 0.5 * definition.depth,
        seam_radius=float(wall_radius + 0.4 * (nearest_exit - wall_radius)),
        end_radius=float(boxes[beside & (owner == part), 3].max()) * 1.0e-9 + 5.0e-3,
    )
