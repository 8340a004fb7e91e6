"""The best designs of a study beside one another, cut open, on one temperature scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from spindle_fem.report.figure_style import (
    INK,
    TEMPERATURE_LABEL,
    TEMPERATURE_MAP,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    scale_of,
    styled,
)
from spindle_fem.report.profiles import meridian_section
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

_MM = 1.0e3
_WIDTH, _GAP, _HEAD, _FOOT = 1600.0, 40.0, 56.0, 110.0
ISOTHERMS = 12


@styled
def best_designs(results: Mapping[str, ThermalResult]) -> Figure:
    """Temperature in the vertical plane through the axis of several designs.

    Parameters
    ----------
    results : mapping of title to ThermalResult
        Shown two in a row.
    """
    sections = {title: meridian_section(item.mesh, item.temperature) for title, item in results.items()}
    celsius = {title: item.faces.values[:, 0] - ZERO_CELSIUS_K for title, item in sections.items()}
    bar = scale_of(np.concatenate(list(celsius.values())), TEMPERATURE_MAP, TEMPERATURE_LABEL)
    columns = min(2, len(results))
    width = (_WIDTH - _GAP * (columns + 1)) / columns
    shapes = [np.ptp(item.faces.points, axis=0) for item in sections.values()]
    height = width * max(shape[1] / shape[2] for shape in shapes)
    lines = -(-len(results) // columns)
    figure = new_figure(lines * (height + _HEAD) + _FOOT, _WIDTH)
    for number, (title, section) in enumerate(sections.items()):
        line, place = divmod(number, columns)
        left, top = _GAP + place * (width + _GAP), line * (height + _HEAD) + _HEAD
        axes = pixel_axes(figure, left, top, width, height, aspect="equal")
        faces = section.faces
        triangles = Triangulation(faces.points[:, 2] * _MM, faces.points[:, 1] * _MM, faces.triangles)
        axes.tripcolor(
            triangles, celsius[title], cmap=bar.colour_map, norm=bar.norm, shading="gouraud", rasterized=True
        )
        levels = np.linspace(bar.low, bar.high, ISOTHERMS + 2)[1:-1]
        axes.tricontour(triangles, celsius[title], levels=levels, colors="white", linewidths=0.5, alpha=0.8)
        outlines = section.outlines.points[..., [2, 1]] * _MM
        axes.add_collection(LineCollection(outlines, colors=INK, linewidths=0.6))
        axes.set_title(title, fontsize=9.5)
        axes.axis("off")
    total = lines * (height + _HEAD) + _FOOT
    draw_colour_bar(pixel_axes(figure, 0.5 * (_WIDTH - 700.0), total - 88.0, 700.0, 18.0), bar)
    return figure
