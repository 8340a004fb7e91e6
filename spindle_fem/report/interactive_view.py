"""Three-dimensional view inside the report: a small WebGL program and its data.

A page may be opened from disk years later, so the view needs no library and no
network: surface, section and balls travel as one deflated block. Compared with
an exported vtk.js scene (one megabyte of program in each report) it also reads
the temperature under the pointer, hides parts and opens the machine.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.report.drawn_surfaces import TRIANGLE_SPLIT, facet_normals
from spindle_fem.report.plane_sections import section_of_volume
from spindle_fem.report.viewed_scene import Layer, Scene, Sphere
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

SURFACE_GROUP = "display_surface"
TEMPERATURE = "temperature"
TRIANGLE_BUDGET = 60_000
BULGE = 4.0e-4  # m; more than this off its chord shows as a corner


def display_surface(result: ThermalResult, triangle_budget: int = TRIANGLE_BUDGET) -> xr.Dataset:
    """Exposed faces and the section x = 0 as straight triangles, for drawing only.

    Parameters
    ----------
    triangle_budget : int
        Above it neighbouring points of a surface are merged.

    Returns
    -------
    xarray.Dataset
        ``position`` (m), ``normal``, ``temperature`` (degC) on ``vertex``;
        ``triangle``, ``triangle_part``, ``triangle_is_section``; balls as
        ``ball_centre``, ``ball_radius``, ``ball_length`` (0; a roller's), ``ball_temperature``.
    """
    import xarray as xr

    mesh = result.mesh
    names = list(mesh.surfaces)
    part_index = {name: index for index, name in enumerate(mesh.part_names)}
    facets = np.concatenate([np.zeros((0, 6), np.int64), *(mesh.surfaces[name] for name in names)])
    counts = [len(mesh.surfaces[name]) for name in names]
    part = np.repeat([part_index[mesh.part_of_surface[name]] for name in names], counts).astype(np.int64)
    node, triangles, normals, part = welded(mesh.points, facets, part)
    points, values = mesh.points[node], result.temperature[node]
    if len(triangles) > triangle_budget:
        points, triangles, normals, values, part = _clustered(
            points, triangles, normals, values, part, triangle_budget
        )
    section = section_of_volume(mesh, result.temperature, mesh.points[:, 0], curved=False)
    cap_points, weld = np.unique(
        np.column_stack([np.round(section.points[:, 1:] * 1.0e6), _corner_labels(section.label)]),
        axis=0,
        return_inverse=True,
    )
    first = np.zeros(len(cap_points), dtype=np.int64)
    first[weld.ravel()] = np.arange(len(section.points))
    cap = section.points[first]
    towards = np.tile([-1.0, 0.0, 0.0], (len(cap), 1))
    centres, radii, lengths, ball_values = _balls(result)
    return xr.Dataset(
        {
            "position": (
                ("vertex", "axis"),
                np.concatenate([points, cap]).astype(np.float32),
                {"units": "m"},
            ),
            "normal": (
                ("vertex", "axis"),
                np.concatenate([normals, towards]).astype(np.float32),
                {"units": "1"},
            ),
            "temperature": (
                "vertex",
                (np.concatenate([values, section.values[first, 0]]) - ZERO_CELSIUS_K).astype(np.float32),
                {"units": "degC", "long_name": "temperature"},
            ),
            "triangle": (
                ("triangle_number", "corner"),
                np.concatenate([triangles, weld.reshape(-1, 3) + len(points)]).astype(np.int32),
            ),
            "triangle_part": ("triangle_number", np.concatenate([part, section.label]).astype(np.int32)),
            "triangle_is_section": (
                "triangle_number",
                np.repeat([0, 1], [len(triangles), len(section.triangles)]).astype(np.int8),
            ),
            "ball_centre": (("ball", "axis"), centres.astype(np.float32), {"units": "m"}),
            "ball_radius": ("ball", radii.astype(np.float32), {"units": "m"}),
            "ball_length": ("ball", lengths.astype(np.float32), {"units": "m"}),
            "ball_temperature": ("ball", ball_values.astype(np.float32), {"units": "degC"}),
        },
        {},
        {
            "description": "surface for drawing, not for evaluation",
            "part_names": json.dumps(list(mesh.part_names)),
        },
    )


def viewer_payload(surface: xr.Dataset) -> dict[str, Any]:
    """Data that the page's viewer needs, from a surface for drawing."""
    is_section = surface["triangle_is_section"].values == 1
    triangles, part = (surface[name].values.astype(np.int64) for name in ("triangle", "triangle_part"))
    columns = ("centre", "radius", "temperature", "length")
    balls = zip(*(surface[f"ball_{name}"].values.astype(np.float64) for name in columns), strict=True)
    return Scene(
        points=surface["position"].values.astype(np.float64),
        layers=(Layer(TEMPERATURE, "°C", surface["temperature"].values.astype(np.float64)[None]),),
        part_names=tuple(json.loads(surface.attrs["part_names"])),
        vertex_point=np.arange(surface.sizes["vertex"]),
        normals=surface["normal"].values,
        triangles=triangles[~is_section],
        triangle_part=part[~is_section],
        caps=triangles[is_section],
        cap_part=part[is_section],
        balls=tuple(
            Sphere(centre, round(radius, 5), {TEMPERATURE: np.array([value])}, length=round(length, 5))
            for centre, radius, value, length in balls
        ),
    ).payload()


def welded(
    points: NDArray[np.float64], facets: NDArray[np.int64], part: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Straight triangles of six-node facets; corners shared where it is smooth, doubled at sharp edges.

    Facets with an edge that bulges visibly become four. Both facets of an edge
    see the same bulge, so no gap opens.

    Parameters
    ----------
    points : (n_nodes, 3) ndarray, [m]
    facets : (n, 6) ndarray of int
    part : (n,) ndarray of int

    Returns
    -------
    node, triangles, normals, part
        Mesh node and normal of every corner, (v,) and (v, 3); triangles (m, 3) of corners, the part of each.
    """
    chord_middles = 0.5 * (points[facets[:, [0, 1, 2]]] + points[facets[:, [1, 2, 0]]])
    bulge = np.linalg.norm(points[facets[:, 3:]] - chord_middles, axis=2).max(axis=1)
    round_ones = bulge > BULGE
    nodes = np.concatenate([facets[~round_ones, :3], facets[round_ones][:, TRIANGLE_SPLIT].reshape(-1, 3)])
    normals = facet_normals(points, facets)
    at_nodes = np.concatenate(
        [normals[~round_ones, :3], normals[round_ones][:, TRIANGLE_SPLIT].reshape(-1, 3, 3)]
    ).reshape(-1, 3)
    owner = np.concatenate([part[~round_ones], np.repeat(part[round_ones], 4)])
    coarse = np.round(at_nodes * 2.0).astype(np.int64) + 2
    key = ((nodes.ravel() * 5 + coarse[:, 0]) * 5 + coarse[:, 1]) * 5 + coarse[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    kept = nodes.ravel()[first]
    return kept, inverse.reshape(-1, 3), at_nodes[first], owner


def _clustered(
    points: NDArray[np.float64],
    triangles: NDArray[np.int64],
    normals: NDArray[np.float64],
    values: NDArray[np.float64],
    part: NDArray[np.int64],
    budget: int,
) -> tuple[
    NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]
]:
    corners = points[triangles]
    area = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2.0
    )
    cell = np.sqrt(2.0 * area / budget)
    owner = np.zeros(len(points), dtype=np.int64)
    owner[triangles] = part[:, None]
    while True:
        grid = np.column_stack([np.floor(points / cell), np.round(normals * 1.5), owner]).astype(np.int64)
        _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        merged = inverse.ravel()[triangles]
        alive = (
            (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 0] != merged[:, 2])
        )
        if alive.sum() <= budget:
            return points[first], merged[alive], normals[first], values[first], part[alive]
        cell *= 1.25


def _corner_labels(label: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.repeat(label, 3)


def _balls(result: ThermalResult) -> tuple[NDArray[np.float64], ...]:
    """Centre, radius, length and temperature of every ball and roller."""
    centres, sizes = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for group, bearing in result.spec.bearings:
        warmth = result.bearings[bearing.name].temperature_ball - ZERO_CELSIUS_K
        for row in element_rows(bearing, result.spec.bearing_types[group.type_name(bearing)]):
            centres.append(np.array(row.centres))
            sizes.append(np.tile([0.5 * row.ball_diameter, row.length, warmth], (row.ball_count, 1)))
    return np.concatenate(centres), *np.concatenate(sizes).T
