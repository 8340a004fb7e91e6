"""The paper's Figure 22 by two sets of equations, at constant velocity and at constant flow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from spindle_fem.report.block_page import Text
from spindle_fem.report.figure_style import FILM_MAP, INK, new_figure, styled
from spindle_fem.report.table_rows import fixed, number, rounded, significant, table_of, whole, words
from spindle_fem.studies.sweep.film_study import MODELS, PAPER_DEPTH, PAPER_TEMPERATURE, FilmChart, PumpLimits
from spindle_fem.units import ZERO_CELSIUS_K


def held_text(chart: FilmChart) -> str:
    """The quantity held constant, with its value."""
    if chart.held == "velocity":
        return f"velocity {chart.amount:.1f} m/s"
    return f"flow {chart.amount * 6e4:.0f} L/min"


NO_LIMITS = PumpLimits()


@styled
def film_maps(charts: Sequence[FilmChart], limits: PumpLimits = NO_LIMITS) -> Figure:
    """Film coefficient over coolant temperature and depth, one scale a row.

    White line: laminar to turbulent. Dashed line: the pump's limit, hatched
    beyond it.
    """
    figure = new_figure(1240.0)
    panels = figure.subplots(2, 2)
    figure.subplots_adjust(left=0.06, right=0.96, top=0.95, bottom=0.07, wspace=0.14, hspace=0.3)
    for line, held in zip(panels, dict.fromkeys(item.held for item in charts), strict=True):
        row = [item for item in charts if item.held == held]
        values = np.stack([item.chart.value for item in row])
        levels = MaxNLocator(16).tick_values(values.min(), values.max())
        for axes, item in zip(line, row, strict=True):
            x, y = item.chart.temperature - ZERO_CELSIUS_K, item.chart.depth * 1e3
            filled = axes.contourf(x, y, item.chart.value, levels=levels, cmap=FILM_MAP)
            figure.colorbar(filled, ax=axes, pad=0.02).set_label("film coefficient / W/(m²·K)")
            _transition(axes, item, x, y)
            _limit(axes, limits.demand(item), x, y)
            _mark(axes, item)
            axes.set(
                xlabel="coolant temperature / °C",
                ylabel="channel depth / mm",
                title=f"{MODELS[item.model]}, {held_text(item)}",
            )
    handles, _ = panels[0, 0].get_legend_handles_labels()
    if limits.given:
        handles.append(Line2D([], [], color=INK, linestyle="--", linewidth=1.8, label="the pump's limit"))
    panels[0, 0].legend(handles=handles, loc="lower left", frameon=True, framealpha=0.9)
    return figure


def _transition(axes: object, item: FilmChart, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """The laminar-turbulent line, or in words that there is none."""
    share = item.laminar_share
    if share.min() < 1.0 < share.max():
        axes.contour(x, y, share, levels=[1.0], colors="white", linewidths=2.2)
        return
    words = (
        f"laminar everywhere: Re at most {share.max():.0%} of critical"
        if share.max() <= 1.0
        else f"nowhere laminar: Re at least {share.min():.1f} times critical"
    )
    _say(axes, words, 0.95)


def _say(axes: object, words: str, height: float) -> None:
    axes.text(
        0.97, height, words, transform=axes.transAxes, ha="right", va="top", fontsize=8.0,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _limit(axes: object, demand: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """The line beyond which the pump is too weak, or in words that it is so everywhere."""
    if demand.max() <= 1.0:
        return
    if demand.min() >= 1.0:
        _say(axes, f"beyond the pump everywhere: at least {demand.min():.1f} times its limit", 0.87)
        return
    axes.contourf(x, y, demand, levels=[1.0, np.inf], colors="none", hatches=["//"])
    axes.contour(x, y, demand, levels=[1.0], colors=INK, linewidths=1.8, linestyles="--")


@styled
def pump_maps(charts: Sequence[FilmChart], limits: PumpLimits = NO_LIMITS) -> Figure:
    """Pressure drop and pumping power over the same plane, once for what is held; dashed: their limits."""
    figure = new_figure(1240.0)
    panels = figure.subplots(2, 2)
    figure.subplots_adjust(left=0.06, right=0.96, top=0.95, bottom=0.07, wspace=0.14, hspace=0.3)
    once = [item for item in charts if item.model == charts[0].model]
    for line, item in zip(panels, once, strict=True):
        _logarithmic(figure, line[0], item, item.pressure_drop * 1e-5, "pressure drop / bar")
        _logarithmic(figure, line[1], item, item.pumping_power, "pumping power / W")
        x, y = item.chart.temperature - ZERO_CELSIUS_K, item.chart.depth * 1e3
        _limit(line[0], item.pressure_drop / limits.pressure_drop, x, y)
        _limit(line[1], item.pumping_power / limits.pumping_power, x, y)
    return figure


def _logarithmic(
    figure: Figure, axes: object, item: FilmChart, values: NDArray[np.float64], label: str
) -> None:
    low, high = np.log10(values.min()), np.log10(values.max())
    levels = np.logspace(low, high, 15)
    x, y = item.chart.temperature - ZERO_CELSIUS_K, item.chart.depth * 1e3
    filled = axes.contourf(x, y, values, levels=levels, cmap=FILM_MAP, norm="log")
    lines = axes.contour(x, y, values, levels=levels[::2], colors=INK, linewidths=0.5)
    axes.clabel(lines, fmt=_short, fontsize=7.5)
    bar = figure.colorbar(filled, ax=axes, pad=0.02)
    bar.set_ticks(levels[::4], labels=[_short(level) for level in levels[::4]])
    bar.minorticks_off()
    bar.set_label(label)
    _mark(axes, item, own=False)
    axes.set(
        xlabel="coolant temperature / °C",
        ylabel="channel depth / mm",
        title=f"{label.split(' /')[0]}, {held_text(item)}",
    )


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def _mark(axes: object, item: FilmChart, *, own: bool = True) -> None:
    style = {"s": 150, "edgecolor": INK, "facecolor": "white", "zorder": 5, "clip_on": False}
    axes.scatter(
        PAPER_TEMPERATURE - ZERO_CELSIUS_K,
        PAPER_DEPTH * 1e3,
        marker="o",
        label="the paper's optimum",
        **style,
    )
    if own:
        axes.scatter(
            item.best[1] - ZERO_CELSIUS_K,
            item.best[0] * 1e3,
            marker="*",
            label="largest on this map",
            **style,
        )
    axes.grid(visible=False)


def film_words(films: Sequence[FilmChart], limits: PumpLimits = NO_LIMITS) -> list[Any]:
    """Maximum of each film map, also within the pump's limits, and the film at the paper's choice."""
    fields = [
        words("equations", lambda item: MODELS[item.model]),
        words("held", held_text),
        fixed("largest at: depth / mm", lambda item: item.best[0] * 1e3),
        fixed("coolant / °C", lambda item: item.best[1] - ZERO_CELSIUS_K),
        rounded("W/(m²·K)", lambda item: item.best_value),
        rounded("at 19 mm, 31 °C", lambda item: item.paper_value),
        whole("share of the largest", lambda item: f"{item.paper_value / item.best_value:.0%}"),
    ]
    if limits.given:
        fields.append(words("largest that the pump allows", lambda item: _allowed(item, limits)))
    text = (
        "The paper chose 19 mm and 31 °C from its map of the film coefficient. The velocity held here is the "
        "one at which that point lies on the paper's laminar–turbulent line; the flow is the machine's own. "
        "A film map says nothing of the bearings: a hotter coolant also lifts the whole machine, which only "
        "the solved designs show."
    )
    return [Text(text), table_of(fields, films)]


def _allowed(chart: FilmChart, limits: PumpLimits) -> str:
    """The largest film coefficient within the pump's limits, and where."""
    best = limits.best(chart)
    if best is None:
        return "nothing on this map"
    depth, temperature, value = best
    place = f"{number(depth * 1e3, 1)} mm, {number(temperature - ZERO_CELSIUS_K, 1)} °C"
    return f"{significant(value)} W/(m²·K) at {place}"
