"""Element sizes: presets by part thickness, the channel and its ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

from spindle_fem.errors import BadInputError, did_you_mean
from spindle_fem.geometry.assembly import AssemblyGeometry, PartGeometry

Preset = Literal["coarse", "normal", "fine"]

CHANNEL = "channel"
PORTS = "ports"


@dataclass(frozen=True, slots=True)
class MeshSizes:
    """Edge lengths in m by part, and at the channel.

    Attributes
    ----------
    part : mapping of str to float
    channel : float
        On the four walls.
    port_segments : int
        Edges around a port.
    smallest_strip_edges : float
        How many times longer than its width the edges of a narrow face may be.
    """

    part: Mapping[str, float]
    channel: float
    port_segments: int = 18
    smallest_strip_edges: float = 2.5

    def key(self) -> dict[str, object]:
        """Plain values for the hash of a mesh."""
        return {
            "part": {name: float(size) for name, size in sorted(self.part.items())},
            "channel": float(self.channel),
            "port_segments": self.port_segments,
            "smallest_strip_edges": self.smallest_strip_edges,
        }

    def scaled(self, factor: float) -> MeshSizes:
        """All lengths times ``factor``; half the length is eight times the elements."""
        return MeshSizes(
            MappingProxyType({name: factor * size for name, size in self.part.items()}),
            factor * self.channel,
            max(8, round(self.port_segments / min(factor, 1.0))),
            self.smallest_strip_edges,
        )


@dataclass(frozen=True, slots=True)
class _Preset:
    """Sizes of a preset: fractions of a part's wall and of the channel's section."""

    bulk: float
    wall_fraction: float
    channel_fraction: float
    smallest: float = field(default=1.0e-3)


# Edge length = wall_fraction * thickest wall of the part, at most bulk; at the
# channel channel_fraction * the shorter side of its section, at most half bulk.
_PRESETS: Mapping[str, _Preset] = MappingProxyType(
    {
        "coarse": _Preset(bulk=0.032, wall_fraction=1.5, channel_fraction=1.3),
        "normal": _Preset(bulk=0.022, wall_fraction=1.0, channel_fraction=0.8),
        "fine": _Preset(bulk=0.009, wall_fraction=0.42, channel_fraction=0.36),
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
    assembly : AssemblyGeometry
    preset : {"coarse", "normal", "fine"}
    size_factor : float
        Every length is multiplied by it; 0.5 gives about eight times the elements.
    overrides : mapping of str to float, optional, [m]
        By part, ``"channel"`` for its walls; not multiplied by ``size_factor``.

    Returns
    -------
    MeshSizes

    Raises
    ------
    BadInputError
        Unknown preset, unknown name or a size that is not positive.

    >>> from spindle_fem.geometry.assembly import AnnularSegment, PartGeometry, assemble
    >>> ring = PartGeometry("ring", (AnnularSegment(0.0, 0.02, 0.05, 0.06),))
    >>> build_sizes(assemble([ring]), "normal").part["ring"]
    0.0075
    """
    if preset not in _PRESETS:
        raise BadInputError("mesh.preset", f'"{preset}" does not exist.', did_you_mean(preset, _PRESETS))
    if not size_factor > 0.0:
        raise BadInputError("mesh.size_factor", f"is {size_factor:g}.", "Allowed: above 0.")
    settings = _PRESETS[preset]
    part = {
        geometry.name: size_factor
        * min(settings.bulk, max(settings.smallest, settings.wall_fraction * _wall(geometry)))
        for geometry in assembly.parts
    }
    channel = size_factor * settings.bulk
    if assembly.channel is not None:
        definition = assembly.channel.definition
        section = min(definition.depth, definition.width)
        channel = size_factor * min(0.5 * settings.bulk, settings.channel_fraction * section)
    allowed = [*part, CHANNEL]
    for name, size in (overrides or {}).items():
        where = f"mesh.size.{name}"
        if name not in allowed:
            raise BadInputError(where, "names no part.", did_you_mean(name, allowed))
        if not size > 0.0:
            raise BadInputError(where, f"is {size:g} m.", "Allowed: above 0.")
        if name == CHANNEL:
            channel = size
        else:
            part[name] = size
    segments = max(8, round(18 / min(size_factor, 1.0))) if preset != "fine" else 24
    return MeshSizes(MappingProxyType(part), channel, segments)


def _wall(part: PartGeometry) -> float:
    """Thickest wall of a part, radial or axial whichever is thinner in each segment."""
    return max(
        min(segment.outer_radius - segment.inner_radius, segment.z_end - segment.z_start)
        for segment in part.segments
    )
