"""Named surface or joint of each CAD face, and its shape, from points on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshTagError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.channel_geometry import ChannelGeometry, PortGeometry

# Boolean operations leave points within a tenth of a micrometre of their face;
# sweeps follow the helix to a few micrometres.
EXACT = 1.0e-6
SWEPT = 5.0e-6

Shape = Literal["plane", "cylinder", "helicoid", "port"]


@dataclass(frozen=True, slots=True)
class FaceClass:
    """Name and shape of a face.

    Attributes
    ----------
    name : str
        Surface or joint.
    shape : {"plane", "cylinder", "helicoid", "port"}
        Cylinders and helicoids are about the machine's axis; a port is a
        cylinder about its ray.
    port : int
        Index of the port, -1 for other shapes.
    """

    name: str
    shape: Shape
    port: int = -1


def classify_face(
    assembly: AssemblyGeometry, points: NDArray[np.float64], parts: tuple[str, ...]
) -> FaceClass:
    """Class of the face on which all ``points`` lie.

    Parameters
    ----------
    points : (n, 3) ndarray, [m]
    parts : tuple of str
        The parts that it bounds.

    Raises
    ------
    MeshTagError
        It is no face of the assembly.
    """
    radius = np.hypot(points[:, 0], points[:, 1])
    z = points[:, 2]
    bounds_z = z.min(), z.max()
    bounds_r = radius.min(), radius.max()
    wanted = tuple(sorted(parts))
    if np.ptp(radius) < EXACT or np.ptp(z) < EXACT:
        for edge in assembly.edges:
            if (
                edge.parts == wanted
                and _within(bounds_z, edge.z)
                and _within(bounds_r, edge.r)
                and edge.is_cylinder == (np.ptp(radius) < EXACT)
            ):
                return FaceClass(edge.name, "cylinder" if edge.is_cylinder else "plane")
    channel = assembly.channel
    if channel is not None and wanted == (channel.definition.part,):
        found = _classify_channel(channel, points, radius)
        if found is not None:
            return found
    raise MeshTagError(
        "mesh",
        f"a face of {' and '.join(wanted) or 'no part'} at z {bounds_z[0]:.6g} to {bounds_z[1]:.6g} m, "
        f"r {bounds_r[0]:.6g} to {bounds_r[1]:.6g} m belongs to no surface.",
        "Every face must be a face of revolution, of the channel or of a port.",
    )


def _within(values: tuple[float, float], bounds: tuple[float, float]) -> bool:
    return bounds[0] - EXACT <= values[0] and values[1] <= bounds[1] + EXACT


def _classify_channel(
    channel: ChannelGeometry, points: NDArray[np.float64], radius: NDArray[np.float64]
) -> FaceClass | None:
    definition = channel.definition
    wall, rest = channel.surface_names
    for index, port in enumerate(channel.ports):
        u, v, w = port_coordinates(port, points)
        if np.ptp(u) < EXACT and abs(u[0] - port.start_radius) < EXACT:
            return FaceClass(rest, "plane")
        if u.min() > 0.0 and np.abs(np.hypot(v, w) - port.radius).max() < SWEPT:
            return FaceClass(rest, "port", index)
    angle = np.arctan2(-points[:, 0], points[:, 1])
    for start in channel.start_angles:
        for end_angle in (start, start + channel.angle_span):
            across = radius * np.sin(angle - end_angle)
            if np.abs(across).max() < EXACT and np.cos(angle - end_angle).min() > 0.0:
                return FaceClass(rest, "plane")
    for wall_radius in (definition.inner_radius, channel.outer_radius):
        if np.abs(radius - wall_radius).max() < SWEPT:
            return FaceClass(wall, "cylinder")
    sign = np.sign(channel.angle_span)
    advance = definition.pitch / definition.starts
    for side in (-0.5, 0.5):
        # Distance from the helicoid of the nearest start and turn.
        height = points[:, 2] - definition.z_start - side * definition.width
        height = height - sign * definition.pitch * angle / (2.0 * np.pi)
        if np.abs(height - advance * np.round(height / advance)).max() < SWEPT:
            return FaceClass(wall, "helicoid")
    return None


def port_coordinates(
    port: PortGeometry, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates along the drilling, tangential and axial from its axis, m."""
    x, y = port.direction
    along = points[..., 0] * x + points[..., 1] * y
    across = -points[..., 0] * y + points[..., 1] * x
    return along, across, points[..., 2] - port.z
