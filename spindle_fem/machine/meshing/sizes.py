"""Element sizes: presets by part thickness, the channel and its ports."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Literal

from spindle_fem.errors import BadInputError, did_you_mean
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.faces import MeridianEdge
from spindle_fem.machine.geometry.part_shapes import PartGeometry

Preset = Literal["coarse", "normal", "fine"]

CHANNEL = "channel"


@dataclass(frozen=True, slots=True)
class MeshSizes:
    """Edge lengths in m by part, and at the channel.

    Attributes
    ----------
    part : mapping of str to float
    channel : float
        On the four walls.
    port_segments, circle_segments : int
        Least number of edges around a port and around any circle about the axis.
    strip_edges : float
        Longest edges over the width of a narrow face that they lie on.
    wall_edges : float
        Longest edges over the thickness of metal between the channel and the
        outside or its next turn.
    growth : float
        Increase of size per distance from ports and thin walls.
    """

    part: Mapping[str, float]
    channel: float
    port_segments: int = 18
    circle_segments: int = 16
    strip_edges: float = 3.0
    wall_edges: float = 1.5
    growth: float = 0.4

    def key(self) -> dict[str, object]:
        """Plain values for the hash of a mesh."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return values | {"part": dict(sorted(self.part.items()))}

    def scaled(self, factor: float) -> MeshSizes:
        """All lengths times ``factor``; half the length is eight times the elements."""
        return replace(
            self,
            part=MappingProxyType({name: factor * size for name, size in self.part.items()}),
            channel=factor * self.channel,
            port_segments=max(self.port_segments, round(self.port_segments / factor)),
            circle_segments=max(self.circle_segments, round(self.circle_segments / factor)),
            strip_edges=min(self.strip_edges, factor * self.strip_edges),
            wall_edges=min(self.wall_edges, factor * self.wall_edges),
        )


@dataclass(frozen=True, slots=True)
class _Preset:
    """Sizes of a preset; the first three make lengths, the others are MeshSizes'."""

    bulk: float
    wall_fraction: float
    channel_fraction: float
    port_segments: int
    circle_segments: int
    strip_edges: float
    wall_edges: float
    growth: float
    smallest: float = 1.0e-3


# Edge length = wall_fraction * thickest wall of the part, at most bulk; at the
# channel channel_fraction * the shorter side of its section, at most half bulk.
_PRESETS: Mapping[str, _Preset] = MappingProxyType(
    {
        "coarse": _Preset(0.040, 2.0, 1.8, 14, 14, 5.0, 2.5, 0.8),
        "normal": _Preset(0.020, 1.0, 0.75, 18, 16, 3.0, 1.6, 0.4),
        "fine": _Preset(0.010, 0.5, 0.38, 24, 24, 2.0, 1.0, 0.4),
    }
)


def build_sizes(
    assembly: AssemblyGeometry,
    preset: Preset = "normal",
    *,
    size_factor: float = 1.0,
    overrides: Mapping[str, float] | None = None,
) -> MeshSizes:
    """Sizes of a preset for one assembly.

    Parameters
    ----------
    preset : {"coarse", "normal", "fine"}
    size_factor : float
        Every length is multiplied by it; 0.5 gives about eight times the elements.
    overrides : mapping of str to float, optional, [m]
        By part, ``"channel"`` for its walls; not multiplied by ``size_factor``.

    Raises
    ------
    BadInputError
        Unknown preset, unknown name or a size that is not positive.

    >>> from spindle_fem.machine.geometry.assembly import assemble
    >>> from spindle_fem.machine.geometry.part_shapes import AnnularSegment, PartGeometry
    >>> ring = PartGeometry("ring", (AnnularSegment(0.0, 0.02, 0.05, 0.06),))
    >>> round(build_sizes(assemble([ring]), "normal").part["ring"], 6)
    0.01
    """
    if preset not in _PRESETS:
        raise BadInputError("mesh.preset", f'"{preset}" does not exist.', did_you_mean(preset, _PRESETS))
    if not size_factor > 0.0:
        raise BadInputError("mesh.size_factor", f"is {size_factor:g}.", "Allowed: above 0.")
    settings = _PRESETS[preset]
    part = {
        geometry.name: min(settings.bulk, max(settings.smallest, settings.wall_fraction * _wall(geometry)))
        for geometry in assembly.parts
    }
    channel = settings.bulk
    if assembly.channel is not None:
        definition = assembly.channel.definition
        land = definition.pitch / definition.starts - definition.width
        channel = min(
            0.5 * settings.bulk,
            settings.channel_fraction * min(definition.depth, definition.width),
            settings.wall_edges * land,
        )
    sizes = MeshSizes(
        MappingProxyType(part),
        channel,
        **{
            name: getattr(settings, name)
            for name in ("port_segments", "circle_segments", "strip_edges", "wall_edges", "growth")
        },
    ).scaled(size_factor)
    allowed = [*part, CHANNEL]
    for name, size in (overrides or {}).items():
        where = f"mesh.size.{name}"
        if name not in allowed:
            raise BadInputError(where, "names no part.", did_you_mean(name, allowed))
        if not size > 0.0:
            raise BadInputError(where, f"is {size:g} m.", "Allowed: above 0.")
        if name == CHANNEL:
            sizes = replace(sizes, channel=size)
        else:
            sizes = replace(sizes, part=MappingProxyType({**sizes.part, name: size}))
    return sizes


# Largest sagitta h² / 8 r of a chord over the clearance to the next cylinder, and
# over the width of a plane face beside it, where curving must not flatten elements.
CLEARANCE_SHARE = 1.0 / 3.0
_STRIP_SHARE = 0.10


def edge_sizes(
    assembly: AssemblyGeometry, sizes: MeshSizes, clearance_share: float = CLEARANCE_SHARE
) -> list[float]:
    """Element size at each meridian edge, m.

    That of its parts, less where a face is narrow, where its circle would have
    too few segments, or where chords would cut into a face close by.

    Parameters
    ----------
    clearance_share : float
        Largest sagitta of a chord over the clearance to the next cylinder.
    """
    chosen = []
    for edge in assembly.edges:
        size = min(sizes.part[part] for part in edge.parts)
        length = (edge.z[1] - edge.z[0]) + (edge.r[1] - edge.r[0])
        size = min(size, sizes.strip_edges * length)
        if not edge.is_axis:
            # a face that reaches the axis has no inner circle
            size = min(size, 2.0 * math.pi * (edge.r[0] or edge.r[1]) / sizes.circle_segments)
        if edge.is_cylinder and not edge.is_axis:
            clearance = _radial_clearance(edge, assembly)
            size = min(size, math.sqrt(8.0 * edge.r[0] * clearance_share * clearance))
        elif not edge.is_axis and edge.r[0] > 0.0:
            size = min(size, math.sqrt(8.0 * edge.r[0] * _STRIP_SHARE * length))
        chosen.append(size)
    return chosen


def _radial_clearance(edge: MeridianEdge, assembly: AssemblyGeometry) -> float:
    """Distance to the nearest other cylinder at the same z, at most the radius."""
    distances = [
        abs(other.r[0] - edge.r[0])
        for other in assembly.edges
        if other.is_cylinder
        and other.r[0] != edge.r[0]
        and not other.is_axis
        and other.z[0] < edge.z[1]
        and edge.z[0] < other.z[1]
    ]
    return min([*distances, edge.r[0]])


def _wall(part: PartGeometry) -> float:
    """Thickest wall of a part, radial or axial whichever is thinner in each segment."""
    return max(
        min(segment.outer_radius - segment.inner_radius, segment.z_end - segment.z_start)
        for segment in part.segments
    )
