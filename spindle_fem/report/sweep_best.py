"""The best designs of a study beside one another, cut open, on one temperature scale."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from spindle_fem.report.figure_style import (
    TEMPERATURE_LABEL,
    TEMPERATURE_MAP,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    scale_of,
    styled,
)
from spindle_fem.report.profiles import draw_field, meridian_section
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
    celsius = [item.faces.values[:, 0] - ZERO_CELSIUS_K for item in sections.values()]
    bar = scale_of(np.concatenate(celsius), TEMPERATURE_MAP, TEMPERATURE_LABEL)
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
        draw_field(axes, section, bar, np.linspace(bar.low, bar.high, ISOTHERMS + 2)[1:-1])
        axes.set_title(title, fontsize=9.5)
        axes.axis("off")
    total = lines * (height + _HEAD) + _FOOT
    draw_colour_bar(pixel_axes(figure, 0.5 * (_WIDTH - 700.0), total - 88.0, 700.0, 18.0), bar)
    return figure
