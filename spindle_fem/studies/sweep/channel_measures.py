"""Exact areas and volume of a channel with its ports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spindle_fem.machine.geometry.channel_geometry import ChannelGeometry, PortGeometry

# Gauss-Legendre points over a quarter circle: the integrands are smooth, 24 give all digits.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_ANGLE = 0.25 * np.pi * (_NODES + 1.0)
_SHARE = 0.25 * np.pi * _WEIGHTS


@dataclass(frozen=True, slots=True)
class ChannelMeasures:
    """Dimensions of a channel and the volumes it removes.

    Attributes
    ----------
    wall : float, [m²]
        Of ``channel_wall``.
    rest : float, [m²]
        Of ``channel_ends`` or ``channel_ports``.
    openings : tuple of float, [m²]
        What each port takes from the cylinder in which it opens.
    volume : float, [m³]
        Of the metal removed.
    """

    wall: float
    rest: float
    openings: tuple[float, ...]
    volume: float


def channel_measures(channel: ChannelGeometry, exit_radii: Sequence[float] = ()) -> ChannelMeasures:
    """Measures of a channel whose ports open into cylinders about the axis.

    The axis of a port lies in the end face of the channel: one half of it
    begins at the channel's roof, the other at a flat start inside the metal.

    Parameters
    ----------
    exit_radii : sequence of float, [m]
        For each port.

    Returns
    -------
    >>> from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition
    >>> plain = ChannelGeometry(ChannelDefinition("housing", 0.108, 0.010, 0.012, 0.024, 5.0))
    >>> round(channel_measures(plain).rest * 1e6, 6)  # two ends of 10 mm by 12 mm
    240.0
    """
    definition = channel.definition
    wall, volume = channel.wall_area, channel.volume
    rest = 2.0 * definition.starts * definition.depth * definition.width
    openings = []
    for port, exit_radius in zip(channel.ports, exit_radii, strict=True):
        roof = channel.outer_radius
        across, chord = port.radius * np.sin(_ANGLE), 2.0 * (port.radius * np.cos(_ANGLE)) ** 2
        to_roof, to_exit = (np.sqrt(radius**2 - across**2) for radius in (roof, exit_radius))
        wall -= float((roof / to_roof * chord) @ _SHARE)
        half_lengths = to_exit - to_roof, to_exit - port.start_radius
        volume += sum(float((length * chord) @ _SHARE) for length in half_lengths)
        rest += sum(float(2.0 * port.radius * length @ _SHARE) for length in half_lengths)
        rest += _flat(port) - 2.0 * port.radius * (roof - port.start_radius)
        openings.append(2.0 * float((exit_radius / to_exit * chord) @ _SHARE))
    return ChannelMeasures(wall, rest, tuple(openings), volume)


def _flat(port: PortGeometry) -> float:
    """The flat start of the half outside the channel, m²."""
    return 0.5 * np.pi * port.radius**2
