"""The deformed machine in its meridian plane, exaggerated, over its outline as assembled."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from spindle_fem.model.elastic.deformed_shape import BodyShape
from spindle_fem.report.figure_style import (
    FILM_MAP,
    INK,
    MUTED,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    scale_of,
    set_title,
    styled,
)
from spindle_fem.report.meridian_axes import MM, meridian_axes

# Largest shift as drawn, of the machine's length.
DRAWN_SHARE = 0.04


def exaggeration(largest: float, length: float) -> float:
    """A round number by which shifts are multiplied: 1, 2 or 5 times a power of ten.

    >>> exaggeration(40e-6, 0.6)
    500.0
    """
    wanted = DRAWN_SHARE * length / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= wanted)


@styled
def deformed_machine(shapes: Mapping[str, BodyShape]) -> Figure | None:
    """Upper half of every elastic body where its growth puts it; None where nothing moves."""
    if not shapes:
        return None
    largest = max(float(np.hypot(*shape.shift.T).max()) for shape in shapes.values())
    points = np.concatenate([shape.points for shape in shapes.values()])
    length = float(np.ptp(points[:, 0]))
    if not largest > 0.0:
        return None
    factor = exaggeration(largest, length)
    bar = scale_of(
        np.concatenate([1e6 * np.hypot(*shape.shift.T) for shape in shapes.values()]),
        FILM_MAP,
        "shift since assembly / µm",
    )
    moved = np.concatenate([shape.points + factor * shape.shift for shape in shapes.values()])
    shown = MM * np.concatenate([points, moved])
    width_px, left, right, top, foot = 1600.0, 96.0, 24.0, 100.0, 190.0
    pad = 0.015 * float(np.ptp(shown[:, 0]))
    low = max(float(shown[:, 1].min()) - pad, 0.0)
    scale = (width_px - left - right) / (float(np.ptp(shown[:, 0])) + 2.0 * pad)
    drawing = (float(shown[:, 1].max()) + pad - low) * scale
    figure = new_figure(top + drawing + foot, width_px)
    axes = meridian_axes(
        figure,
        (left, top, width_px - left - right, drawing),
        (float(shown[:, 0].min()) - pad, float(shown[:, 0].max()) + pad),
        (low, float(shown[:, 1].max()) + pad),
    )
    for shape in shapes.values():
        now = MM * (shape.points + factor * shape.shift)
        size = 1e6 * np.hypot(*shape.shift.T)
        colours = bar.colours(size[shape.cells].mean(axis=1))
        axes.add_collection(
            # Smoothed edges of neighbouring cells would leave hairlines.
            PolyCollection(now[shape.cells], facecolors=colours, edgecolors="face", antialiased=False)
        )
        axes.add_collection(LineCollection(now[shape.sides], colors=INK, linewidths=1.0))
        axes.add_collection(
            LineCollection(MM * shape.points[shape.sides], colors=MUTED, linewidths=0.6, linestyles="dotted")
        )
    draw_colour_bar(pixel_axes(figure, 0.5 * width_px - 380.0, top + drawing + foot - 92.0, 760.0, 20.0), bar)
    set_title(
        figure,
        f"Growth of the machine, {factor:g} times exaggerated",
        "Mean round the axis, against the back of the flange; dotted: as assembled. Bending is left out.",
    )
    return figure
