"""Middles of edges on curved faces, moved onto the faces.

Everything curved is a cylinder or helicoid about the axis, or a radial port.
In cylindrical coordinates of its axis each of them contains the mean of two of
its points, so a middle is moved exactly, without asking the CAD kernel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.geometry.channel_geometry import PortGeometry
from spindle_fem.machine.meshing.classify_faces import port_coordinates
from spindle_fem.machine.meshing.generate import LinearMesh

TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))


def edge_key(first: NDArray[np.int64], second: NDArray[np.int64], n_nodes: int) -> NDArray[np.int64]:
    """Integer key of an edge, the same in both directions."""
    return np.minimum(first, second) * np.int64(n_nodes) + np.maximum(first, second)


def curved_middles(
    mesh: LinearMesh, ports: tuple[PortGeometry, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Middles of every edge that is not straight.

    Returns
    -------
    keys : (n,) int64 ndarray, ascending
        See :func:`edge_key`.
    middles : (n, 3) float64 ndarray, [m]
    """
    n_nodes = len(mesh.points)

    def keys_of(faces: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        if not faces:
            return np.empty(0, dtype=np.int64)
        triangles = np.concatenate(faces)
        return np.unique(
            np.concatenate([edge_key(triangles[:, a], triangles[:, b], n_nodes) for a, b in TRIANGLE_EDGES])
        )

    about_axis = keys_of([f.triangles for f in mesh.faces if f.kind.shape in ("cylinder", "helicoid")])
    on_cylinder = keys_of([f.triangles for f in mesh.faces if f.kind.shape == "cylinder"])
    circles = edge_key(mesh.circle_edges[:, 0], mesh.circle_edges[:, 1], n_nodes)
    keys = np.union1d(about_axis, circles)
    middles = _cylindrical_mean(mesh.points, keys // n_nodes, keys % n_nodes)
    for index, port in enumerate(ports):
        port_keys = keys_of([f.triangles for f in mesh.faces if f.kind.port == index])
        first, second = port_keys // n_nodes, port_keys % n_nodes
        port_middles = _port_mean(
            mesh.points, first, second, port, on_cylinder=np.isin(port_keys, on_cylinder)
        )
        keep = ~np.isin(keys, port_keys)
        keys = np.concatenate([keys[keep], port_keys])
        middles = np.concatenate([middles[keep], port_middles])
    order = np.argsort(keys)
    return keys[order], middles[order]


def _cylindrical_mean(
    points: NDArray[np.float64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    a, b = points[first], points[second]
    radius = 0.5 * (np.hypot(a[:, 0], a[:, 1]) + np.hypot(b[:, 0], b[:, 1]))
    # The bisector of both rays; edges span far less than half a turn.
    unit_a = a[:, :2] / np.hypot(a[:, 0], a[:, 1])[:, None]
    unit_b = b[:, :2] / np.hypot(b[:, 0], b[:, 1])[:, None]
    bisector = unit_a + unit_b
    bisector /= np.hypot(bisector[:, 0], bisector[:, 1])[:, None]
    return np.column_stack([radius[:, None] * bisector, 0.5 * (a[:, 2] + b[:, 2])])


def _port_mean(
    points: NDArray[np.float64],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    port: PortGeometry,
    *,
    on_cylinder: NDArray[np.bool_],
) -> NDArray[np.float64]:
    (along_a, across_a, axial_a), (along_b, across_b, axial_b) = (
        port_coordinates(port, points[nodes]) for nodes in (first, second)
    )
    across, axial = across_a + across_b, axial_a + axial_b
    scale = port.radius / np.hypot(across, axial)
    across, axial = scale * across, scale * axial
    along = 0.5 * (along_a + along_b)
    # Where the port meets a cylinder about the axis, its ray ends at that radius.
    radius = 0.5 * (np.hypot(along_a, across_a) + np.hypot(along_b, across_b))
    along = np.where(on_cylinder, np.sqrt(np.maximum(radius**2 - across**2, 0.0)), along)
    x, y = port.direction
    return np.column_stack([along * x - across * y, along * y + across * x, port.z + axial])
