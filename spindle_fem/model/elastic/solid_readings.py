"""Readings of displacement sensors from growth in three dimensions.

What a sensor sees of a circle, and what its holder follows, is the shift along its direction: the mean round
the axis and the first harmonic at the sensor's angle, as in the meridian plane
(:mod:`spindle_fem.model.elastic.displacement_sensors`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from skfem import ElementTriP2

from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.elastic.displacement_sensors import SensorSight
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.model.elastic.solid_facets import Facets, on_face, outside_of
from spindle_fem.model.mesh.element_integrals import evaluate_shape

Array = NDArray[np.float64]
# Points of a circle on a surface, and facets beside each of which the nearest is taken.
AROUND, BESIDE = 48, 12
# Of Newton's method, to the nearest place on a curved facet.
STEPS = 5


def solid_readings(model: GrowthModel, mesh: TaggedMesh, displacement: Array) -> dict[str, float]:
    """Every displacement sensor of a machine since assembly, m.

    Parameters
    ----------
    displacement : (n_nodes, 3) ndarray, [m]
        The back of the flange stays in its place.
    """
    bodies = model.bodies
    found = {}
    if model.sights:
        sides = (outside_of(mesh, bodies.parts[name]) for name in (bodies.shaft, bodies.housing))
        shaft, housing = (Facets(mesh.points, nodes) for nodes in sides)
    for sight in model.sights:
        seen = _seen(sight, *on_circle(shaft, sight.z, sight.r, displacement))
        if sight.hangs_at is not None:
            seen -= _seen(sight, *on_circle(housing, *sight.hangs_at, displacement))
        elif sight.mount is not None:
            holder = on_face(mesh, bodies.parts[bodies.housing], sight.mount)
            seen -= _seen(sight, holder.points, holder.at(displacement), holder.weights)
        found[sight.name] = seen
    return found


def on_circle(facets: Facets, z: float, r: float, field: Array) -> tuple[Array, Array, Array]:
    """Points round the axis on the facets nearest to a circle, a field (n_nodes, k) there, even weights."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    wanted = np.column_stack([-r * np.sin(angle), r * np.cos(angle), np.full(AROUND, z)])
    corners = facets.mesh_points[facets.nodes[:, :3]]
    _, beside = cKDTree(corners.mean(axis=1)).query(wanted, min(BESIDE, len(corners)))
    nodes = facets.nodes[beside].reshape(-1, 6)
    asked = np.repeat(wanted, beside.shape[1], axis=0)
    place = np.full((len(nodes), 2), 1.0 / 3.0)
    for _ in range(STEPS):
        values, slopes = evaluate_shape(ElementTriP2(), place.T)
        sides = np.einsum("pik,pix->pxk", slopes, facets.mesh_points[nodes])
        left = asked - np.einsum("pi,pix->px", values, facets.mesh_points[nodes])
        place = np.clip(place + np.einsum("pkx,px->pk", np.linalg.pinv(sides), left), 0.0, 1.0)
        place /= np.maximum(place.sum(axis=1, keepdims=True), 1.0)
    values, _ = evaluate_shape(ElementTriP2(), place.T)
    there = np.einsum("pi,pix->px", values, facets.mesh_points[nodes])
    apart = np.linalg.norm(there - asked, axis=1).reshape(beside.shape)
    nearest = np.arange(AROUND) * beside.shape[1] + np.argmin(apart, axis=1)
    found = np.einsum("pi,pik->pk", values[nearest], field[nodes[nearest]])
    return there[nearest], found, np.ones(AROUND)


def _seen(sight: SensorSight, points: Array, shift: Array, weights: Array) -> float:
    """What a sensor sees of the shifts (n, 3) of points round the axis."""
    radius = np.hypot(*points[:, :2].T)
    cosine, sine = points[:, 1] / radius, -points[:, 0] / radius
    along = sight.axial * shift[:, 2] if sight.axial else shift[:, 1] * cosine - shift[:, 0] * sine
    root = np.sqrt(weights)
    shapes = np.column_stack([np.ones_like(cosine), cosine, sine])
    even, up, across = np.linalg.lstsq(shapes * root[:, None], along * root, rcond=None)[0].tolist()
    if sight.angle is None:
        return even
    return even + up * float(np.cos(sight.angle)) + across * float(np.sin(sight.angle))
