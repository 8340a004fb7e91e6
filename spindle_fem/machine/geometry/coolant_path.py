"""The coolant's way through a machine as its flow sees it: section, drillings, pressure, delivered flow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.definition.machine_spec import Channel, MachineSpec
from spindle_fem.machine.geometry.channel_geometry import PORT_MARGIN
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.duct_friction import PressureDrop, channel_pressure_drop
from spindle_fem.physics.coolant.properties import Coolant, coolant_by_name
from spindle_fem.physics.coolant.pump import Pump
from spindle_fem.physics.coolant.transition import critical_reynolds_schmidt

# K between the inlet temperatures at which a flow that follows them is worked out; it is smooth between.
INLET_STEP = 0.5


def section_of(channel: Channel) -> ChannelSection:
    """A channel as correlations see it."""
    return ChannelSection(
        channel.inner_radius, channel.depth, channel.width, channel.pitch, channel.turns, channel.starts
    )


@dataclass(frozen=True, slots=True)
class CoolantPath:
    """Channel and drillings of one machine, and the pump that feeds them.

    Attributes
    ----------
    port_diameter : float or None, [m]
        As drilled; None without drillings.
    port_length : float, [m]
        From the channel to the outside, mean of both ends.
    """

    section: ChannelSection
    coolant: Coolant
    pump: Pump
    port_diameter: float | None = None
    port_length: float = 0.0

    @classmethod
    def of(cls, spec: MachineSpec) -> CoolantPath:
        """The coolant's way through a machine with a channel."""
        channel, settings, section = spec.channel, spec.coolant, section_of(spec.channel)
        curve = settings.pump_curve
        pump = Pump(
            settings.flow,
            np.inf if settings.pressure_limit is None else settings.pressure_limit,
            () if curve is None else curve.flow,
            () if curve is None else curve.pressure,
        )
        path = cls(section, coolant_by_name(settings.fluid), pump)
        if channel.ports is None:
            return path
        drilled = min(channel.ports.diameter, channel.width - 2.0 * PORT_MARGIN)
        return replace(path, port_diameter=drilled, port_length=_port_length(spec))

    def pressure_drop(self, flow: float, inlet: float) -> PressureDrop:
        """Pressure drop from port to port at a flow (m³/s), properties at the inlet temperature (K)."""
        return channel_pressure_drop(
            self.section,
            flow,
            self.coolant.properties(inlet),
            float(critical_reynolds_schmidt(self.section.curvature_ratio)),
            port_diameter=self.port_diameter,
            port_length=self.port_length,
        )

    def delivered(self, inlet: ArrayLike) -> NDArray[np.float64]:
        """Flow that the pump drives at inlet temperatures [K], of their shape, m³/s."""
        inlet = np.asarray(inlet, dtype=np.float64)
        if not self.pump.is_limited or not inlet.size:
            return np.full(inlet.shape, self.pump.flow)
        low, high = float(inlet.min()), float(inlet.max())
        at = np.linspace(low, high, 1 + int(np.ceil((high - low) / INLET_STEP)))
        flows = [
            self.pump.delivered(lambda flow, one=one: self.pressure_drop(flow, one).total)
            for one in at.tolist()
        ]
        return np.interp(inlet, at, flows)


def delivered_flow(spec: MachineSpec, inlet: ArrayLike, asked: float | None = None) -> NDArray[np.float64]:
    """Flow that the pump of a machine drives through its channel, m³/s; none without a channel.

    Parameters
    ----------
    inlet : array_like, [K]
    asked : float, optional, [m³/s]
        In place of the definition's flow.
    """
    if spec.channel is None or spec.coolant is None:
        return np.zeros(np.shape(inlet))
    path = CoolantPath.of(spec)
    return (path if asked is None else replace(path, pump=replace(path.pump, flow=asked))).delivered(inlet)


def _port_length(spec: MachineSpec) -> float:
    """Distance from the channel's outer wall to the outside of its part, mean of both ends, m."""
    channel = spec.channel
    wall = channel.inner_radius + channel.depth
    segments = next((part.segment for part in spec.part if part.name == channel.part), ())
    lengths = []
    for z in (channel.z_start, channel.z_start + channel.pitch * channel.turns):
        outside = [item.outer_diameter / 2.0 for item in segments if item.z[0] <= z <= item.z[1]]
        lengths.append(max([wall, *outside]) - wall)
    return float(np.mean(lengths))
