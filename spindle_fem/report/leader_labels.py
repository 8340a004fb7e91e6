"""Labels in a row above or below a drawing, each with a leader to its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import ArrayLike, NDArray

from spindle_fem.report.figure_style import INK


@dataclass(frozen=True, slots=True)
class Label:
    """Text with a leader to a place, which is (3,) in m for pictures, (2,) in data units for charts."""

    text: str
    at: NDArray[np.float64]


def spread(positions: ArrayLike, widths: ArrayLike, low: float, high: float) -> NDArray[np.float64]:
    """Places on a line nearest to ``positions`` at which items of ``widths`` do not overlap.

    Parameters
    ----------
    positions, widths : (n,) array_like
    low, high : float
        Ends of the line; when all items together are longer they are packed
        evenly and overlap.

    Returns
    -------
    (n,) ndarray
        Centres, in the order given.

    >>> spread([0.0, 0.1, 5.0], [1.0, 1.0, 1.0], -10.0, 10.0).round(2).tolist()
    [-0.45, 0.55, 5.0]
    """
    wanted = np.asarray(positions, dtype=np.float64)
    size = np.asarray(widths, dtype=np.float64)
    order = np.argsort(wanted, kind="stable")
    squeeze = min(1.0, (high - low) / size.sum()) if size.sum() > 0.0 else 1.0
    groups: list[list[Any]] = []  # [items, total width, centre]
    for item in order:
        groups.append([[item], size[item] * squeeze, wanted[item]])
        while True:
            last = groups[-1]
            last[2] = min(max(last[2], low + 0.5 * last[1]), high - 0.5 * last[1])
            if len(groups) < 2 or groups[-2][2] + 0.5 * groups[-2][1] <= last[2] - 0.5 * last[1] + 1e-12:
                break
            right, left = groups.pop(), groups.pop()
            items = left[0] + right[0]
            inner = np.cumsum([0.0] + [size[i] * squeeze for i in items])
            centres = 0.5 * (inner[1:] + inner[:-1])
            total = float(inner[-1])
            middle = float(np.mean(wanted[items] - centres)) + 0.5 * total
            groups.append([items, total, middle])
    places = np.empty(len(wanted))
    for items, total, middle in groups:
        edge = middle - 0.5 * total
        for item in items:
            places[item] = edge + 0.5 * size[item] * squeeze
            edge += size[item] * squeeze
    return places


def draw_labels(
    axes: Axes,
    labels: Sequence[Label],
    places: ArrayLike,
    edge: float,
    sign: float,
    ends: tuple[float, float],
) -> None:
    """Set labels side by side at a height, with a leader and a dot at each place.

    Parameters
    ----------
    axes : Axes
        In pixels, downwards.
    places : (n, 2) array_like, [px]
        Of the labels, in ``axes``.
    edge : float, [px]
        Height at which the leaders end and the texts begin.
    sign : float
        -1 for labels above the drawing, 1 for labels below.
    ends : tuple of float, [px]
        Ends of the row.
    """
    if not labels:
        return
    places = np.asarray(places, dtype=np.float64)
    longest = [max(len(line) for line in label.text.split("\n")) for label in labels]
    centres = spread(places[:, 0], [12.6 * characters + 22.0 for characters in longest], *ends)
    for label, place, centre in zip(labels, places, centres, strict=True):
        axes.annotate(
            label.text,
            xy=place,
            xytext=(centre, edge),
            ha="center",
            va="bottom" if sign < 0.0 else "top",
            fontsize=9.0,
            linespacing=1.25,
            arrowprops={
                "arrowstyle": "-",
                "color": INK,
                "linewidth": 0.8,
                "shrinkA": 1.0,
                "shrinkB": 0.0,
                "relpos": (0.5, 0.0 if sign < 0.0 else 1.0),
                "path_effects": [Stroke(linewidth=2.6, foreground="white", alpha=0.85), Normal()],
            },
        )
        axes.plot(*place, marker="o", markersize=4.5, markerfacecolor="white", markeredgecolor=INK, zorder=5)
