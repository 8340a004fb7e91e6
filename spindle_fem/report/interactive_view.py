"""Three-dimensional view inside the report: a small WebGL program and its data.

A page may be opened from disk years later, so the view needs no library and no
network: surface, section and balls travel as one deflated block. Compared with
an exported vtk.js scene (one megabyte of program in each report) it also reads
the temperature under the pointer, hides parts and opens the machine.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.report.drawn_surfaces import TRIANGLE_SPLIT, facet_normals
from spindle_fem.report.figure_style import TEMPERATURE_MAP
from spindle_fem.report.plane_sections import section_of_volume
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

SURFACE_GROUP = "display_surface"
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
        ``ball_centre``, ``ball_radius``, ``ball_temperature``.
    """
    import xarray as xr

    mesh = result.mesh
    names = list(mesh.surfaces)
    part_index = {name: index for index, name in enumerate(mesh.part_names)}
    facets = np.concatenate([np.zeros((0, 6), np.int64), *(mesh.surfaces[name] for name in names)])
    counts = [len(mesh.surfaces[name]) for name in names]
    part = np.repeat([part_index[mesh.part_of_surface[name]] for name in names], counts).astype(np.int64)
    points, triangles, normals, values, part = _welded(mesh.points, facets, part, result.temperature)
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
    centres, radii, ball_values = _balls(result)
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
            "ball_temperature": ("ball", ball_values.astype(np.float32), {"units": "degC"}),
        },
        {},
        {
            "description": "surface for drawing, not for evaluation",
            "part_names": json.dumps(list(mesh.part_names)),
        },
    )


def viewer_payload(surface: xr.Dataset) -> dict[str, Any]:
    """What the page's viewer reads: a small header and one deflated block in base64."""
    position = surface["position"].values.astype(np.float64)
    low, high = position.min(axis=0), position.max(axis=0)
    span = float((high - low).max())
    temperature = surface["temperature"].values.astype(np.float64)
    every = np.concatenate([temperature, surface["ball_temperature"].values.astype(np.float64)])
    coldest, warmest = float(every.min()), float(every.max())
    width = max(warmest - coldest, 1.0e-6)
    part = surface["triangle_part"].values
    is_section = surface["triangle_is_section"].values
    order = np.lexsort((is_section, part))
    triangles = surface["triangle"].values[order]
    names = json.loads(surface.attrs["part_names"])
    ranges = []
    for index, name in enumerate(names):
        own = part[order] == index
        solid, cap = own & (is_section[order] == 0), own & (is_section[order] == 1)
        ranges.append(
            {
                "name": name,
                "first": int(np.argmax(solid)) if solid.any() else 0,
                "count": int(solid.sum()),
                "cap_first": int(np.argmax(cap)) if cap.any() else 0,
                "cap_count": int(cap.sum()),
            }
        )
    quantised = np.round((position - low) / span * 65535.0).astype("<u2")
    normals = np.round(surface["normal"].values * 127.0).astype(np.int8)
    values = np.round((temperature - coldest) / width * 65535.0).astype("<u2")
    # Column by column, and triangles as differences, so that deflating finds the pattern.
    block = b"".join(
        [
            np.ascontiguousarray(quantised.T).tobytes(),
            np.ascontiguousarray(normals.T).tobytes(),
            values.tobytes(),
            np.diff(triangles.ravel().astype("<i4"), prepend=np.int32(0)).astype("<i4").tobytes(),
        ]
    )
    colours = (TEMPERATURE_MAP(np.linspace(0.0, 1.0, 256))[:, :3] * 255.0).round().astype(np.uint8)
    balls = np.column_stack(
        [surface["ball_centre"].values, surface["ball_radius"].values, surface["ball_temperature"].values]
    )
    return {
        "vertices": len(position),
        "triangles": len(triangles),
        "low": low.tolist(),
        "span": span,
        "size": (high - low).tolist(),
        "coldest": coldest,
        "warmest": warmest,
        "parts": ranges,
        "balls": np.round(balls, 5).tolist(),
        "colours": base64.b64encode(colours.tobytes()).decode(),
        "block": base64.b64encode(zlib.compress(block, 6)).decode(),
    }


def _welded(
    points: NDArray[np.float64],
    facets: NDArray[np.int64],
    part: NDArray[np.int64],
    temperature: NDArray[np.float64],
) -> tuple[
    NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]
]:
    """Straight triangles; points shared where the surface is smooth, doubled at sharp edges.

    Facets with an edge that bulges visibly become four. Both facets of an edge
    see the same bulge, so no gap opens.
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
    return points[kept], inverse.reshape(-1, 3), at_nodes[first], temperature[kept], owner


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


def _balls(result: ThermalResult) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    centres, radii, values = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0)]
    for group, bearing in result.spec.bearings:
        kind = result.spec.bearing_types[group.bearing_type]
        angle = 2.0 * np.pi * np.arange(kind.ball_count) / kind.ball_count
        z = np.full(angle.size, 0.5 * sum(bearing.z))
        centres.append(
            np.column_stack([-0.5 * kind.pitch * np.sin(angle), 0.5 * kind.pitch * np.cos(angle), z])
        )
        radii.append(np.full(angle.size, 0.5 * kind.ball_diameter))
        values.append(np.full(angle.size, result.bearings[bearing.name].temperature_ball - ZERO_CELSIUS_K))
    return np.concatenate(centres), np.concatenate(radii), np.concatenate(values)
