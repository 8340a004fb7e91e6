"""Picture of how load, angle and pressure lie around a bearing's balls or rollers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.report.figure_style import CYCLE, GRID, INK, MUTED, new_figure, save_png, set_title, styled

_HEIGHT = 620.0
_SHOWN = 4
_SIDES = {"inner": CYCLE[1], "outer": CYCLE[0]}


@styled
def write_bearing_chart(content: Mapping[str, Any], file: Path) -> Path:
    """Draw the load of every ball or roller around its row, at each ring, for up to four bearings.

    Parameters
    ----------
    content : mapping
        As ``bearing_report`` returns it.
    """
    bearings = (content.get("bearings") or [{"name": "bearing", **content}])[:_SHOWN]
    figure = new_figure(_HEIGHT)
    set_title(
        figure,
        "Load of each contact",
        "N over the place around the row; a radial load presses at 0°.",
    )
    most = max(
        element[f"load_{side}_N"] for bearing in bearings for element in _elements(bearing) for side in _SIDES
    )
    for number, bearing in enumerate(bearings):
        axes = figure.add_subplot(1, len(bearings), number + 1, projection="polar")
        axes.set_theta_zero_location("S")
        axes.set_title(str(bearing["name"]), pad=16.0)
        elements = _elements(bearing)
        angle = np.radians([element["azimuth_deg"] for element in elements])
        order = np.argsort(angle)
        around = np.append(order, order[0])
        for side, colour in _SIDES.items():
            load = np.array([element[f"load_{side}_N"] for element in elements])
            axes.plot(angle[around], load[around], color=colour, linewidth=1.4, label=f"{side} ring")
            axes.plot(angle, load, "o", color=colour, markersize=4.0)
        axes.set_ylim(0.0, 1.08 * most or 1.0)
        axes.tick_params(labelcolor=MUTED, labelsize=8.0)
        axes.set_rlabel_position(112.5)
        axes.grid(color=GRID)
        for label in axes.get_yticklabels():
            label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6})
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=2, frameon=False, labelcolor=INK)
    figure.subplots_adjust(left=0.05, right=0.95, top=0.72, bottom=0.13, wspace=0.32)
    return save_png(figure, file)


def _elements(bearing: Mapping[str, Any]) -> list[dict[str, Any]]:
    return bearing["balls"] if "balls" in bearing else bearing["rollers"]
