"""The deformed machine in a plane through its axis, exaggerated, over its outline as assembled."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

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
from spindle_fem.report.profiles import MeridianSection

Array = NDArray[np.float64]

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


class _Grown(NamedTuple):
    """Pieces of a plane through the axis with their shifts; places and shifts along z and outwards, m.

    Attributes
    ----------
    pieces, moves : (n, k, 2) ndarray
    sizes : (n,) ndarray
        Of the shift of each piece, m.
    lines, line_moves : (m, 2, 2) ndarray
        Of outlines.
    """

    pieces: Array
    moves: Array
    sizes: Array
    lines: Array
    line_moves: Array


@styled
def deformed_machine(shapes: Mapping[str, BodyShape], still: str) -> Figure | None:
    """Upper half of every elastic body where its growth puts it; None where nothing moves.

    ``still``: what stays in its place, in words.
    """
    if not shapes:
        return None
    parts = [
        _Grown(
            shape.points[shape.cells],
            shape.shift[shape.cells],
            np.hypot(*shape.shift.T)[shape.cells].mean(axis=1),
            shape.points[shape.sides],
            shape.shift[shape.sides],
        )
        for shape in shapes.values()
    ]
    return _picture(
        _Grown(*(np.concatenate(each) for each in zip(*parts, strict=True))),
        "Growth of the machine",
        f"Mean round the axis, against {still}; dotted: as assembled. Bending is left out.",
    )


@styled
def deformed_section(section: MeridianSection | None, still: str) -> Figure | None:
    """The machine in the vertical plane through its axis where its growth puts it; None where nothing moves.

    Parameters
    ----------
    section : MeridianSection or None
        With displacements along x, y, z [m] as values.
    still : str
        What stays in its place.
    """
    if section is None:
        return None
    faces, outlines = section.faces, section.outlines
    along, sizes = [2, 1], np.linalg.norm(faces.values, axis=1)
    return _picture(
        _Grown(
            faces.points[faces.triangles][..., along],
            faces.values[faces.triangles][..., along],
            sizes[faces.triangles].mean(axis=1),
            outlines.points[..., along],
            outlines.values[..., along],
        ),
        "Growth of the machine in three dimensions",
        f"Vertical plane through the axis (θ = 0 up), against {still}, bending and what lies "
        "on one side included; dotted: as assembled.",
        "radius / mm (θ = 0 up)",
    )


def _picture(grown: _Grown, title: str, subtitle: str, label: str = "radius / mm") -> Figure | None:
    largest = float(grown.sizes.max())
    if not largest > 0.0:
        return None
    factor = exaggeration(largest, float(np.ptp(grown.pieces[..., 0])))
    bar = scale_of(1e6 * grown.sizes, FILM_MAP, "shift since assembly / µm")
    moved = MM * (grown.pieces + factor * grown.moves)
    along, across = np.concatenate([MM * grown.pieces, moved]).reshape(-1, 2).T
    width_px, left, right, top, foot = 1600.0, 96.0, 24.0, 100.0, 190.0
    pad = 0.015 * float(np.ptp(along))
    below = across.min() - pad
    low = float(below if across.min() < 0.0 else max(below, 0.0))
    scale = (width_px - left - right) / (float(np.ptp(along)) + 2.0 * pad)
    drawing = (float(across.max()) + pad - low) * scale
    figure = new_figure(top + drawing + foot, width_px)
    axes = meridian_axes(
        figure,
        (left, top, width_px - left - right, drawing),
        (float(along.min()) - pad, float(along.max()) + pad),
        (low, float(across.max()) + pad),
        label,
    )
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    # Smoothed edges of neighbouring cells would leave hairlines.
    colours = bar.colours(1e6 * grown.sizes)
    axes.add_collection(PolyCollection(moved, facecolors=colours, edgecolors="face", antialiased=False))
    now = MM * (grown.lines + factor * grown.line_moves)
    axes.add_collection(LineCollection(now, colors=INK, linewidths=1.0))
    axes.add_collection(LineCollection(MM * grown.lines, colors=MUTED, linewidths=0.6, linestyles="dotted"))
    draw_colour_bar(pixel_axes(figure, 0.5 * width_px - 380.0, top + drawing + foot - 92.0, 760.0, 20.0), bar)
    set_title(figure, f"{title}, {factor:g} times exaggerated", subtitle)
    return figure
