"""Rendered pictures on a sheet: title, labels on leaders, colour bars.

Three-dimensional views arrive as images with a projection, so that text, leaders and colour bars are set by
matplotlib in one type on all pictures.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spindle_fem.report.figure_style import (
    ColourBar,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    set_title,
    styled,
)
from spindle_fem.report.leader_labels import Label, draw_labels
from spindle_fem.report.scenes import Picture

_MARGIN = 24.0


@styled
def picture_figure(
    picture: Picture,
    title: str,
    *,
    bars: Sequence[ColourBar] = (),
    above: Sequence[Label] = (),
    below: Sequence[Label] = (),
    notes: str = "",
) -> Figure:
    """One picture with its title, labels on leaders above and below, and colour bars.

    Parameters
    ----------
    picture : Picture
        Shown pixel by pixel; the figure is a little wider.
    bars : sequence of ColourBar
        Drawn side by side under the picture.
    above, below : sequence of Label
        Set in a row, spread so that they do not overlap, each with a leader
        to its place in the picture.
    notes : str
        One line under the title.
    """
    width_px = picture.width + 2.0 * _MARGIN
    top = _head(notes) + _rail(above)
    foot = _rail(below) + (112.0 if bars else 8.0)
    figure, axes = _canvas(top + picture.height + foot, width_px, title, notes)
    _place(figure, picture, _MARGIN, top)
    offset, ends = np.array([_MARGIN, top]), (_MARGIN, width_px - _MARGIN)
    _leaders(axes, picture, above, offset, top - 12.0, -1.0, ends)
    _leaders(axes, picture, below, offset, top + picture.height + 12.0, 1.0, ends)
    for number, bar in enumerate(bars):
        share = picture.width / len(bars)
        length = min(760.0, share - 60.0)
        left = _MARGIN + share * (number + 0.5) - 0.5 * length
        draw_colour_bar(pixel_axes(figure, left, top + picture.height + foot - 92.0, length, 20.0), bar)
    return figure


@styled
def pictures_side_by_side(
    pictures: Sequence[Picture],
    title: str,
    bars: Sequence[ColourBar],
    labels: Sequence[Sequence[Label]],
    *,
    notes: str = "",
) -> Figure:
    """Pictures in a row, each with its own colour bar and labels above it."""
    top = _head(notes) + max(_rail(items) for items in labels)
    height = max(picture.height for picture in pictures)
    width_px = sum(picture.width for picture in pictures) + 40.0 * (len(pictures) - 1) + 2.0 * _MARGIN
    total = top + height + 124.0
    figure, axes = _canvas(total, width_px, title, notes)
    left = _MARGIN
    for picture, bar, items in zip(pictures, bars, labels, strict=True):
        _place(figure, picture, left, top)
        _leaders(axes, picture, items, np.array([left, top]), top - 12.0, -1.0, (left, left + picture.width))
        draw_colour_bar(
            pixel_axes(figure, left + 0.1 * picture.width, total - 92.0, 0.8 * picture.width, 20.0), bar
        )
        left += picture.width + 40.0
    return figure


def _head(notes: str) -> float:
    return 82.0 if notes else 52.0


def _rail(labels: Sequence[Label]) -> float:
    lines = max((label.text.count("\n") + 1 for label in labels), default=0)
    return 34.0 + 27.0 * lines if lines else 8.0


def _canvas(height_px: float, width_px: float, title: str, notes: str) -> tuple[Figure, Axes]:
    figure = new_figure(round(height_px), width_px)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width_px), ylim=(round(height_px), 0.0))
    axes.axis("off")
    set_title(figure, title, notes)
    return figure, axes


def _place(figure: Figure, picture: Picture, left: float, top: float) -> None:
    # Pasted pixel by pixel on saving: resampling would blur thin lines and cost more than all the rest.
    figure.patch.set_alpha(0.0)
    figure.backdrops = [*getattr(figure, "backdrops", []), (picture.image, round(left), round(top))]


def _leaders(
    axes: Axes,
    picture: Picture,
    labels: Sequence[Label],
    offset: np.ndarray,
    edge: float,
    sign: float,
    ends: tuple[float, float],
) -> None:
    if labels:
        places = picture.to_pixels(np.array([label.at for label in labels])) + offset
        draw_labels(axes, labels, places, edge, sign, ends)
