"""Geometry of a helical rectangular channel as the correlations see it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from spindle_fem.errors import OutOfValidityError
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range


@dataclass(frozen=True, slots=True)
class ChannelSection:
    """A rectangular channel wound on a cylinder, one or several starts in parallel.

    Attributes
    ----------
    inner_radius : float, [m]
        Of the wall nearest to the axis.
    depth : float, [m]
        Radial extent of the section (the paper's h_gap).
    width : float, [m]
        Axial extent of the section.
    pitch : float, [m]
        Advance in one turn of one start.
    turns : float
        Turns of each start.
    starts : int
        Channels in parallel; they share the flow equally.

    Raises
    ------
    OutOfValidityError
        A length that is not positive, fewer than one start.

    >>> channel = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    >>> round(channel.hydraulic_diameter * 1e3, 3), round(channel.length, 3)
    (10.909, 3.552)
    >>> round(channel.wetted_area, 4)
    0.1563
    """

    inner_radius: float
    depth: float
    width: float
    pitch: float
    turns: float
    starts: int = 1

    def __post_init__(self) -> None:
        require_range(
            "channel section",
            inner_radius=(self.inner_radius, *POSITIVE),
            depth=(self.depth, *POSITIVE),
            width=(self.width, *POSITIVE),
            pitch=(self.pitch, *NOT_NEGATIVE),
            turns=(self.turns, *POSITIVE),
            starts=(self.starts, 1, POSITIVE[1]),
            how_to_fix="Lengths are in metres.",
        )
        if self.starts != int(self.starts):
            raise OutOfValidityError(
                "channel section", f"starts is {self.starts:g}.", "Give a whole number of starts."
            )

    @property
    def coil_diameter(self) -> float:
        """Mean diameter of the helix, through the middle of the section, [m]."""
        return 2.0 * self.inner_radius + self.depth

    @property
    def length(self) -> float:
        """Developed length of the centre line of one start, [m]."""
        return self.turns * math.hypot(math.pi * self.coil_diameter, self.pitch)

    @property
    def area(self) -> float:
        """Cross-section of one start, [m²]."""
        return self.depth * self.width

    @property
    def perimeter(self) -> float:
        """Wetted perimeter of one start, [m]."""
        return 2.0 * (self.depth + self.width)

    @property
    def hydraulic_diameter(self) -> float:
        """Four times area over perimeter, [m]."""
        return 4.0 * self.area / self.perimeter

    @property
    def aspect_ratio(self) -> float:
        """Short over long side, 0–1, [-]."""
        return min(self.depth, self.width) / max(self.depth, self.width)

    @property
    def curvature_ratio(self) -> float:
        """Hydraulic over coil diameter, [-]."""
        return self.hydraulic_diameter / self.coil_diameter

    @property
    def wetted_area(self) -> float:
        """Perimeter times developed length of all starts, [m²]."""
        return self.starts * self.perimeter * self.length

    def velocity(self, volume_flow: float) -> float:
        """Mean velocity at a total volume flow [m³/s] through all starts, [m/s]."""
        return volume_flow / (self.starts * self.area)

    def volume_flow(self, velocity: float) -> float:
        """Total volume flow through all starts at a mean velocity [m/s], [m³/s]."""
        return velocity * self.starts * self.area
