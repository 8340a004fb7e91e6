"""Sections and profiles of the temperature field that charts and datasets show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patheffects import withStroke
from matplotlib.tri import Triangulation
from numpy.typing import ArrayLike, NDArray

from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.report.drawn_surfaces import SegmentSet, TriangleSet
from spindle_fem.report.figure_style import INK, TEMPERATURE_LABEL, TEMPERATURE_MAP, ColourBar, scale_of
from spindle_fem.report.plane_sections import boundary_lines, section_of_triangles, section_of_volume
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

_MM = 1.0e3


@dataclass(frozen=True, slots=True)
class MeridianSection:
    """The plane x = 0: θ = 0 where y > 0, θ = 180° where y < 0.

    Attributes
    ----------
    faces : TriangleSet
        One value, temperature in K, or displacements along x, y, z in m; labelled by part.
    outlines : SegmentSet
        Outlines of the parts with the same.
    """

    faces: TriangleSet
    outlines: SegmentSet
    part_names: tuple[str, ...]


def meridian_section(mesh: TaggedMesh, values: NDArray[np.float64]) -> MeridianSection:
    """Cut the machine along the vertical plane through its axis, with values (n_nodes,) or (n_nodes, k)."""
    level = mesh.points[:, 0]
    return MeridianSection(
        section_of_volume(mesh, values, level), boundary_lines(mesh, values, level), mesh.part_names
    )


def displacement_section(result: ThermalResult) -> MeridianSection | None:
    """The same with displacements [m]; None where growth was not worked out in three dimensions."""
    moved = result.solid_growth
    return None if moved is None else meridian_section(result.mesh, moved.displacement)


def temperature_scale(result: ThermalResult) -> ColourBar:
    """The one temperature scale of all pictures of a run, in °C, balls included."""
    values = [result.temperature.min(), result.temperature.max()]
    values += [bearing.temperature_ball for bearing in result.bearings.values()]
    return scale_of(np.array(values) - ZERO_CELSIUS_K, TEMPERATURE_MAP, TEMPERATURE_LABEL)


def radial_profile(
    section: MeridianSection, z: float
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Temperature along a radius at θ = 0, part by part.

    Parameters
    ----------
    z : float, [m]

    Returns
    -------
    dict of str to (radius (n,) in m, temperature (n,) in K)
        In order of radius; a part cut twice (channel) keeps both stretches
        with ``nan`` between them.
    """
    lines = section_of_triangles(section.faces, section.faces.points[:, 2] - z)
    profile = {}
    for label in np.unique(lines.label):
        chosen = (lines.label == label) & (lines.points[..., 1] > 0.0).all(axis=1)
        if not chosen.any():
            continue
        ends = np.sort(lines.points[chosen][..., 1], axis=1)
        order = np.argsort(lines.points[chosen][..., 1], axis=1)
        values = np.take_along_axis(lines.values[chosen][..., 0], order, axis=1)
        along = np.argsort(ends[:, 0])
        ends, values = ends[along], values[along]
        radius, temperature = [ends[0, 0]], [values[0, 0]]
        reached = ends[0, 0]
        for (start, end), (at_start, at_end) in zip(ends, values, strict=True):
            if start > reached + 1.0e-6:
                radius += [np.nan, start]
                temperature += [np.nan, at_start]
            radius.append(end)
            temperature.append(at_end)
            reached = max(reached, end)
        profile[section.part_names[label]] = (np.array(radius), np.array(temperature))
    return dict(sorted(profile.items(), key=lambda item: item[1][0][0]))


def axial_profile(
    section: MeridianSection, part: str, side: str, number: int = 400
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Temperature along the innermost or outermost face of a part at θ = 180°.

    The lower half is used because ports drilled at θ = 0 would break the line.

    Parameters
    ----------
    side : {"inner", "outer"}
    number : int
        Places along z.

    Returns
    -------
    z : (number,) ndarray, [m]
    temperature : (number,) ndarray, [K]
    """
    lines = section.outlines
    below = (lines.points[..., 1] < 0.0).all(axis=1) & (lines.label == section.part_names.index(part))
    points, values = lines.points[below], lines.values[below][..., 0]
    z_ends = points[..., 2]
    low, high = z_ends.min(), z_ends.max()
    z = np.linspace(low + 1.0e-5, high - 1.0e-5, number)
    span = z_ends[:, 1] - z_ends[:, 0]
    usable = np.abs(span) > 1.0e-9
    z_ends, points, values, span = z_ends[usable], points[usable], values[usable], span[usable]
    fraction = (z[:, None] - z_ends[:, 0]) / span
    hit = (fraction >= 0.0) & (fraction <= 1.0)
    radius = -(points[:, 0, 1] + fraction * (points[:, 1, 1] - points[:, 0, 1]))
    radius = np.where(hit, radius, -np.inf if side == "outer" else np.inf)
    chosen = radius.argmax(axis=1) if side == "outer" else radius.argmin(axis=1)
    rows = np.arange(number)
    temperature = values[chosen, 0] + fraction[rows, chosen] * (values[chosen, 1] - values[chosen, 0])
    return z, np.where(hit.any(axis=1), temperature, np.nan)


def largest_part(volumes: Mapping[str, float], rotating: Mapping[str, bool], *, turning: bool) -> str | None:
    """Name of the biggest turning or standing part, None without any.

    >>> largest_part({"shaft": 2.0, "nut": 1.0}, {"shaft": True, "nut": True}, turning=True)
    'shaft'
    """
    candidates = {name: volume for name, volume in volumes.items() if rotating[name] == turning}
    return max(candidates, key=candidates.__getitem__) if candidates else None


def draw_field(
    axes: Axes, section: MeridianSection, bar: ColourBar, isotherms: ArrayLike, *, numbered: bool = False
) -> None:
    """Temperature of a meridian section with isotherms (degC) and outlines, in mm, z across."""
    faces = section.faces
    triangles = Triangulation(faces.points[:, 2] * _MM, faces.points[:, 1] * _MM, faces.triangles)
    celsius = faces.values[:, 0] - ZERO_CELSIUS_K
    axes.tripcolor(triangles, celsius, cmap=bar.colour_map, norm=bar.norm, shading="gouraud", rasterized=True)
    if np.size(isotherms):
        style = {"colors": "white", "linewidths": 0.55, "alpha": 0.8}
        if not numbered:
            axes.tricontour(triangles, celsius, levels=isotherms, **style)
        else:
            # Lines that end at every element would all be numbered.
            places = np.column_stack([triangles.x, triangles.y, celsius]).round(3)
            points, joined = np.unique(places, axis=0, return_inverse=True)
            corners = joined.ravel()[faces.triangles]
            whole = np.all(corners != np.roll(corners, 1, axis=1), axis=1)
            shape = Triangulation(*points[:, :2].T, corners[whole])
            drawn = axes.tricontour(shape, points[:, 2], levels=isotherms, **style)
            for number in axes.clabel(drawn, fontsize=6.5, fmt="%g", inline_spacing=2):
                number.set(color="white", alpha=1.0, rotation=0.0)
                number.set_path_effects([withStroke(linewidth=1.4, foreground=INK)])
    lines = section.outlines.points[..., [2, 1]] * _MM
    axes.add_collection(LineCollection(lines, colors=INK, linewidths=0.8))
