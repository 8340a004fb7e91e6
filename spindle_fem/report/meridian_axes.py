"""Axes in the meridian plane of a machine, in mm, and what every drawing there puts on them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.part_shapes import BallRowGeometry
from spindle_fem.report.figure_style import INK, pixel_axes

MM = 1.0e3
Span = tuple[float, float]


def meridian_axes(
    figure: Figure,
    place: tuple[float, float, float, float],
    z: Span,
    radius: Span,
    label: str = "radius / mm",
) -> Axes:
    """Axes without a grid, one scale along both directions.

    Parameters
    ----------
    place : tuple of float
        Left, top, width and height in pixels.
    z, radius : tuple of float, [mm]
        Shown.
    """
    axes = pixel_axes(figure, *place)
    axes.set(xlim=z, ylim=radius, aspect="equal", xlabel="z / mm", ylabel=label)
    axes.grid(False)
    return axes


def extent(assembly: AssemblyGeometry) -> tuple[float, float, float]:
    """First and last place along the axis and the largest radius [mm]."""
    segments = [segment for part in assembly.parts for segment in part.segments]
    z_low, z_high = min(s.z_start for s in segments), max(s.z_end for s in segments)
    return z_low * MM, z_high * MM, max(s.outer_radius for s in segments) * MM


def box(z: Span, radius: Span, sign: float = 1.0, **style: Any) -> Rectangle:
    """Rectangle between two places along the axis and two radii [m], mirrored by a negative ``sign``."""
    low = min(sign * radius[0], sign * radius[1]) * MM
    return Rectangle((z[0] * MM, low), (z[1] - z[0]) * MM, (radius[1] - radius[0]) * MM, **style)


def draw_elements(axes: Axes, row: BallRowGeometry, colour: Any, *, linewidth: float) -> None:
    """The balls or rollers of a row that the plane cuts, on both sides of the axis."""
    radius, half = row.pitch_radius, 0.5 * row.ball_diameter
    style = {"facecolor": colour, "edgecolor": INK, "linewidth": linewidth, "zorder": 4}
    for sign in (1.0, -1.0):
        if row.length:
            ends = (row.z - 0.5 * row.length, row.z + 0.5 * row.length)
            axes.add_patch(box(ends, (radius - half, radius + half), sign, **style))
        else:
            axes.add_patch(Circle((row.z * MM, sign * radius * MM), half * MM, **style))


def draw_edges(
    axes: Axes, assembly: AssemblyGeometry, signs: tuple[float, ...], widths: Span, **style: Any
) -> None:
    """Outlines of the parts, in ``widths`` for contacts and for free edges."""
    for edge in assembly.edges:
        if edge.is_axis:
            continue
        for sign in signs:
            axes.plot(
                np.array(edge.z) * MM,
                sign * np.array(edge.r) * MM,
                color=INK,
                linewidth=widths[0] if edge.is_contact else widths[1],
                **style,
            )
