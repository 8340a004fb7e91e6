"""Charts of a study: maps and lines of its outputs, parallel coordinates, Pareto front, sensitivities."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from spindle_fem.report.figure_style import CYCLE, FILM_MAP, INK, MUTED, TEMPERATURE_MAP, new_figure, styled
from spindle_fem.report.sweep_scales import Scale

Rows = Sequence[Mapping[str, Any]]
FILM_LOW, FILM_HIGH = "@film_low", "@film_high"
COLUMNS = 2
PANEL_HEIGHT = 560.0


def _panels(number: int) -> tuple[Figure, list[Axes]]:
    lines = -(-number // COLUMNS)
    columns = min(COLUMNS, number)
    figure = new_figure(PANEL_HEIGHT * lines)
    axes = np.atleast_1d(figure.subplots(lines, columns)).ravel().tolist()
    for extra in axes[number:]:
        extra.axis("off")
    figure.subplots_adjust(
        left=0.07, right=0.97, top=1.0 - 0.1 / lines, bottom=0.14 / lines, wspace=0.26, hspace=0.42
    )
    return figure, axes


@styled
def response_lines(rows: Rows, across: Scale, outputs: Sequence[Scale]) -> Figure:
    """Each output over the one parameter that varies, with the band of the film where it was carried."""
    figure, panels = _panels(len(outputs))
    order = sorted(rows, key=lambda row: across.of([row])[0])
    place = across.of(order)
    for axes, output in zip(panels, outputs, strict=False):
        low, high = output.of(order, FILM_LOW), output.of(order, FILM_HIGH)
        if np.isfinite(low).all() and len(low):
            axes.fill_between(
                place, np.minimum(low, high), np.maximum(low, high), color=CYCLE[0], alpha=0.18, lw=0
            )
        axes.plot(place, output.of(order), color=CYCLE[0], marker="o", markersize=4.0)
        axes.set(xlabel=across.label, title=output.label)
        _name_words(axes.xaxis, across)
    return figure


@styled
def response_maps(
    rows: Rows, across: Scale, up: Scale, outputs: Sequence[Scale], marks: Mapping[str, Mapping[str, Any]]
) -> Figure:
    """Each output over two parameters: contours between the solved designs, which are dots.

    Infeasible designs are crosses; ``marks`` are designs to point out.
    """
    figure, panels = _panels(len(outputs))
    x, y = across.of(rows), up.of(rows)
    feasible = np.array([row["feasible"] == "yes" for row in rows])
    triangles = _triangulation(x, y)
    for axes, output in zip(panels, outputs, strict=False):
        values = output.of(rows)
        colours = TEMPERATURE_MAP if output.unit in ("°C", "K") else FILM_MAP
        if triangles is not None and np.ptp(values) > 1e-9 * max(1.0, np.abs(values).max()):
            filled = axes.tricontourf(triangles, values, levels=14, cmap=colours)
            lines = axes.tricontour(triangles, values, levels=filled.levels[::2], colors=INK, linewidths=0.6)
            axes.clabel(lines, fontsize=7.5)
            shown = filled
        else:
            shown = axes.scatter(x, y, c=values, cmap=colours, s=60, edgecolor=INK, linewidth=0.5)
        figure.colorbar(shown, ax=axes, pad=0.02)
        axes.scatter(x[feasible], y[feasible], s=9, color=INK, zorder=3, clip_on=False)
        axes.scatter(
            x[~feasible], y[~feasible], s=22, color=INK, marker="x", linewidth=0.9, zorder=3, clip_on=False
        )
        for number, (name, row) in enumerate(marks.items()):
            axes.scatter(
                across.of([row]), up.of([row]), s=150, marker="*os^"[number % 4],
                facecolor="white", edgecolor=INK,
                zorder=5, label=name, clip_on=False,
            )  # fmt: skip
        axes.set(xlabel=across.label, ylabel=up.label, title=output.label)
        axes.grid(visible=False)
        _name_words(axes.xaxis, across)
        _name_words(axes.yaxis, up)
    if marks:
        panels[0].legend(loc="upper right", fontsize=7.5, frameon=True, framealpha=0.9)
    return figure


def _triangulation(x: np.ndarray, y: np.ndarray) -> Triangulation | None:
    """Triangles between places, none where they lie on a line."""
    spans = np.ptp(x), np.ptp(y)
    if len(x) < 3 or min(spans) == 0.0:
        return None
    scaled = np.column_stack([(x - x.min()) / spans[0], (y - y.min()) / spans[1]])
    if (
        len(np.unique(scaled.round(9), axis=0)) < max(3, len(x))
        or np.linalg.matrix_rank(scaled - scaled[0]) < 2
    ):
        return None
    triangles = Triangulation(scaled[:, 0], scaled[:, 1]).triangles
    return Triangulation(x, y, triangles)


def _name_words(axis: Any, scale: Scale) -> None:
    if scale.words:
        axis.set_ticks(range(len(scale.words)), scale.words)


@styled
def parallel_coordinates(
    rows: Rows, columns: Sequence[Scale], colour_by: Scale, marked: Sequence[int]
) -> Figure:
    """Every design as a line across its parameters and outputs; ``marked`` designs are drawn thick."""
    figure = new_figure(760.0)
    axes = figure.add_axes((0.05, 0.2, 0.83, 0.66))
    table = np.column_stack([column.of(rows) for column in columns])
    low, high = np.nanmin(table, axis=0), np.nanmax(table, axis=0)
    span = np.where(high > low, high - low, 1.0)
    places = (table - low) / span
    places[:, high <= low] = 0.5
    shade = colour_by.of(rows)
    norm = mpl.colors.Normalize(np.nanmin(shade), np.nanmax(shade))
    for row, line, value in zip(rows, places, shade, strict=True):
        bold = row["design"] in marked
        infeasible = row["feasible"] != "yes"
        axes.plot(
            range(len(columns)), line, color=TEMPERATURE_MAP(norm(value)), linewidth=3.2 if bold else 1.0,
            alpha=0.25 if infeasible else 0.95 if bold else 0.7, linestyle=":" if infeasible else "-",
            zorder=4 if bold else 2,
        )  # fmt: skip
    for position, column in enumerate(columns):
        axes.axvline(position, color=MUTED, linewidth=0.9)
        ends = (
            (column.words[0], column.words[-1])
            if column.words
            else (f"{low[position]:.4g}", f"{high[position]:.4g}")
        )
        axes.text(position, -0.03, ends[0], ha="center", va="top", fontsize=8.5)
        axes.text(position, 1.03, ends[1], ha="center", va="bottom", fontsize=8.5)
        name, _, unit = column.label.partition(" / ")
        text = "\n".join([*textwrap.wrap(name, 15), unit])
        axes.text(position, -0.09, text, ha="center", va="top", fontsize=8.5)
    axes.set(xlim=(-0.2, len(columns) - 0.8), ylim=(-0.02, 1.02))
    axes.axis("off")
    bar = figure.colorbar(
        mpl.cm.ScalarMappable(norm, TEMPERATURE_MAP), cax=figure.add_axes((0.91, 0.2, 0.012, 0.66))
    )
    bar.set_label(colour_by.label)
    figure.text(
        0.05, 0.94, "Designs from their parameters to their outputs", fontweight="bold", fontsize=10.5
    )
    return figure


@styled
def pareto_front(rows: Rows, first: Scale, second: Scale, front: Sequence[int]) -> Figure:
    """Feasible designs by two objectives, those of the front joined, with the band of the film."""
    figure = new_figure(760.0)
    axes = figure.add_axes((0.08, 0.12, 0.88, 0.78))
    feasible = [row for row in rows if row["feasible"] == "yes"]
    other = [row for row in rows if row["feasible"] == "no"]
    axes.scatter(first.of(other), second.of(other), s=22, marker="x", color=MUTED, label="breaks a limit")
    axes.scatter(first.of(feasible), second.of(feasible), s=24, color=CYCLE[5], label="feasible")
    best = sorted((row for row in feasible if row["design"] in front), key=lambda row: first.of([row])[0])
    x, y = first.of(best), second.of(best)
    bands = []
    for scale, middle in ((first, x), (second, y)):
        ends = np.array([scale.of(best, FILM_LOW), scale.of(best, FILM_HIGH), middle])
        bands.append(
            np.abs(np.array([ends.min(axis=0), ends.max(axis=0)]) - middle)
            if np.isfinite(ends).all()
            else None
        )
    axes.errorbar(
        x,
        y,
        xerr=bands[0],
        yerr=bands[1],
        color=CYCLE[1],
        marker="o",
        capsize=2.5,
        linewidth=1.2,
        label="Pareto front",
    )
    for row, place in zip(best, zip(x, y, strict=True), strict=True):
        axes.annotate(str(row["design"]), place, textcoords="offset points", xytext=(6, 6), fontsize=8.0)
    axes.set(
        xlabel=first.label, ylabel=second.label, title="Trade-off; bars span the film coefficient's band"
    )
    axes.legend()
    return figure


@styled
def sensitivity_bars(sensitivities: Sequence[Mapping[str, Any]], names: Mapping[str, str]) -> Figure:
    """Share of each output's variance by parameter: alone, and with interactions."""
    figure, panels = _panels(len(sensitivities))
    for axes, item in zip(panels, sensitivities, strict=False):
        parameters = item["parameters"]
        place = np.arange(len(parameters))
        axes.barh(
            place + 0.18, [p["total"] for p in parameters], 0.34, color=CYCLE[5], label="with interactions"
        )
        axes.barh(place - 0.18, [p["first_order"] for p in parameters], 0.34, color=CYCLE[0], label="alone")
        axes.set_yticks(place, [p["path"].split(".", 1)[-1].replace("_", " ") for p in parameters])
        axes.set(
            xlabel="share of the variance", xlim=(0.0, 1.05), title=names.get(item["output"], item["output"])
        )
    panels[0].legend(loc="lower right")
    figure.subplots_adjust(left=0.13, wspace=0.42)
    return figure
