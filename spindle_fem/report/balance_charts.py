"""Charts of heat and coolant: heat sources, where heat enters and leaves, coolant along the channel."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path
from numpy.typing import NDArray

from spindle_fem.report.figure_style import (
    BODY_COLOURS,
    BODY_NAMES,
    CYCLE,
    INK,
    MUTED,
    TEMPERATURE_LABEL,
    new_figure,
    pixel_axes,
    set_title,
    styled,
)
from spindle_fem.report.leader_labels import spread
from spindle_fem.report.run_tables import heat_by_sink, heat_by_source, readable
from spindle_fem.results.thermal_result import CoolantResult, EnergyBalance, ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K


@styled
def heat_balance(energy: EnergyBalance, bearings: Iterable[str] = (), circuits: Iterable[str] = ()) -> Figure:
    """Heat sources and sinks, widths in proportion to W; each bearing and each circuit as a whole."""
    heat_out = heat_by_sink(energy.heat_out, circuits)
    sources = {
        name: value for name, value in heat_by_source(energy.heat_in_by, bearings).items() if value > 0.0
    }
    gains = {f"{name} (gains)": -value for name, value in heat_out.items() if value < 0.0}
    sinks = {name: value for name, value in heat_out.items() if value > 0.0}
    sources = dict(sorted((sources | gains).items(), key=lambda item: -item[1]))
    body = 410.0
    total = max(sum(sources.values()), sum(sinks.values()))
    # As high as the longer side needs, so that no band is pressed onto its neighbours.
    height = max(520.0, *(float(_room(side, body, total).sum()) for side in (sources, sinks)))
    figure = new_figure(height + 112.0)
    axes = pixel_axes(figure, 24.0, 100.0, 1552.0, height)
    axes.axis("off")
    axes.set(xlim=(0.0, 1552.0), ylim=(height, 0.0))
    taken_up = f", {sum(gains.values()):.1f} W taken up from surroundings" if gains else ""
    set_title(
        figure,
        "Where the heat comes from and where it goes",
        f"{energy.heat_in:.1f} W put in{taken_up}; imbalance {energy.imbalance_relative:.1e} of it.",
    )
    if total <= 0.0:
        axes.text(776.0, 0.5 * height, "No heat flows.", ha="center", va="center")
        return figure
    _bands(axes, sources, body, total, left=True)
    _bands(axes, sinks, body, total, left=False)
    top = 0.5 * (height - body)
    axes.add_patch(
        Rectangle(
            (710.0, top), 132.0, body * sum(sources.values()) / total, facecolor="#c9d2da", linewidth=0.0
        )
    )
    axes.text(
        776.0,
        top + 0.5 * body,
        f"machine\n{sum(sources.values()):.0f} W",
        ha="center",
        va="center",
        fontweight="bold",
    )
    return figure


def _room(flows: Mapping[str, float], body: float, total: float) -> NDArray[np.float64]:
    """Height that each band takes at its outer end with its text, px."""
    if total <= 0.0:
        return np.zeros(len(flows))
    return np.maximum(np.array(list(flows.values())) / total * body + 8.0, 32.0)


def _bands(axes: Axes, flows: Mapping[str, float], body: float, total: float, *, left: bool) -> None:
    if not flows:
        return
    heights = np.array(list(flows.values())) / total * body
    height = max(axes.get_ylim())
    top = 0.5 * (height - body)
    at_body = top + np.cumsum(heights) - 0.5 * heights
    at_end = spread(at_body, _room(flows, body, total), 0.0, height)
    near, far = (710.0, 480.0) if left else (842.0, 1072.0)
    middle = 0.5 * (near + far)
    palette = (CYCLE[1], CYCLE[4]) if left else (CYCLE[0], CYCLE[5])
    for number, (name, value) in enumerate(flows.items()):
        half = 0.5 * heights[number]
        start, end = at_body[number], at_end[number]
        vertices = [
            (near, start - half),
            (middle, start - half),
            (middle, end - half),
            (far, end - half),
            (far, end + half),
            (middle, end + half),
            (middle, start + half),
            (near, start + half),
            (near, start - half),
        ]
        codes = [
            Path.MOVETO,
            Path.CURVE4,
            Path.CURVE4,
            Path.CURVE4,
            Path.LINETO,
            Path.CURVE4,
            Path.CURVE4,
            Path.CURVE4,
            Path.CLOSEPOLY,
        ]
        axes.add_patch(
            PathPatch(Path(vertices, codes), facecolor=palette[number % 2], alpha=0.72, linewidth=0.0)
        )
        share = 100.0 * value / total
        text = f"{readable(name)}   {value:.1f} W ({f'{share:.1f}' if share >= 0.05 else '< 0.1'} %)"
        axes.text(
            far + (-14.0 if left else 14.0),
            end,
            text,
            ha="right" if left else "left",
            va="center",
            fontsize=9.2,
        )


@styled
def heat_by_bearing(result: ThermalResult) -> Figure | None:
    """Heat term by term, and where it enters, for each bearing; None without bearings."""
    if not result.bearings:
        return None
    names = list(result.bearings)
    bodies = BODY_NAMES | {"balls": result.spec.rolling_elements}
    panels = (
        ("Friction heat term by term", _large_terms([result.bearings[name].terms for name in names]), None),
        ("Where it enters", [dict(result.bearings[name].heat_to) for name in names], BODY_COLOURS),
    )
    limit = 1.2 * max(max(sum(item.values()) for item in panel[1]) for panel in panels)
    legend_rows = max(math.ceil(len({key for row in panel[1] for key in row}) / 4) for panel in panels)
    top = 128.0 + 28.0 * legend_rows
    height = top + 60.0 * len(names) + 80.0
    figure = new_figure(height)
    for number, (title, rows, colours) in enumerate(panels):
        axes = pixel_axes(figure, 70.0 + 784.0 * number, top, 730.0, 60.0 * len(names))
        keys = list(dict.fromkeys(key for row in rows for key in row))
        left = np.zeros(len(names))
        for index, key in enumerate(keys):
            values = np.array([row.get(key, 0.0) for row in rows])
            colour = CYCLE[index % len(CYCLE)] if colours is None else colours[key]
            axes.barh(
                names,
                values,
                left=left,
                color=colour,
                height=0.62,
                label=bodies.get(key, key.replace("_", " ")),
            )
            for row, value in enumerate(values):
                if value > 0.07 * limit:
                    axes.text(
                        left[row] + 0.5 * value,
                        row,
                        f"{value:.0f}",
                        ha="center",
                        va="center",
                        color="white",
                        fontsize=8.5,
                    )
            left += values
        for row, value in enumerate(left):
            axes.text(value + 0.012 * limit, row, f"{value:.1f} W", va="center", fontsize=8.8)
        axes.invert_yaxis()
        axes.set(xlim=(0.0, max(limit, 1.0e-9)), xlabel="heat / W")
        axes.grid(axis="y", visible=False)
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(-0.01, 1.0),
            ncols=4,
            handlelength=1.0,
            columnspacing=1.2,
            borderaxespad=0.1,
        )
        place = 1.0 - (top - 28.0 * legend_rows - 26.0) / height
        figure.text(
            (70.0 + 784.0 * number) / 1600.0, place, title, fontsize=10.5, fontweight="bold", va="center"
        )
    set_title(figure, "Heat of the bearings")
    return figure


def _large_terms(rows: list[Mapping[str, float]], share: float = 0.03) -> list[dict[str, float]]:
    """Terms above a share of the largest heat; the small ones together as "other"."""
    total = max((sum(row.values()) for row in rows), default=0.0)
    keys = list(dict.fromkeys(key for row in rows for key in row))
    large = [key for key in keys if max(row.get(key, 0.0) for row in rows) > share * total]
    merged = []
    for row in rows:
        kept = {key: row.get(key, 0.0) for key in large}
        rest = sum(row.values()) - sum(kept.values())
        if len(large) < len(keys):
            kept["other"] = rest
        merged.append(kept)
    if merged and all(row.get("other", 1.0) == 0.0 for row in merged):
        merged = [{key: value for key, value in row.items() if key != "other"} for row in merged]
    return merged


@styled
def coolant_along_channel(coolant: CoolantResult, *, ports: bool = False) -> Figure:
    """Coolant and wall temperature, and the film coefficient with its range, along the channel.

    Parameters
    ----------
    ports : bool
        Whether the first and the last cell are the drilled ports: another
        section with another film, so they are described in words.
    """
    figure = new_figure(620.0)
    order = np.argsort(coolant.position, kind="stable")
    place = coolant.position[order]
    turns = coolant.angle[order] / (2.0 * math.pi)
    left = pixel_axes(figure, 120.0, 130.0, 630.0, 400.0)
    left.plot(place, coolant.wall_temperature[order] - ZERO_CELSIUS_K, color=CYCLE[1], label="wall")
    left.plot(place, coolant.bulk_temperature[order] - ZERO_CELSIUS_K, color=CYCLE[0], label="coolant (bulk)")
    left.set(xlabel="length along the channel / m", ylabel=TEMPERATURE_LABEL, title="Coolant and wall")
    left.legend(loc="best")
    right = pixel_axes(figure, 915.0, 130.0, 655.0, 400.0)
    inside = np.ones(place.size, dtype=bool)
    if ports and place.size > 2:
        inside = (place > place.min()) & (place < place.max())
    along = place[inside]
    film, low, high = (
        item[order][inside] for item in (coolant.film_coefficient, coolant.film_low, coolant.film_high)
    )
    right.fill_between(along, low, high, color=CYCLE[2], alpha=0.2, linewidth=0.0, label="low to high")
    right.plot(along, film, color=CYCLE[2], label="value")
    right.axhline(
        coolant.mean_film_coefficient,
        color=INK,
        linewidth=0.9,
        linestyle=(0, (4, 3)),
        label="mean",
    )
    right.set(
        xlabel="length along the channel / m", ylabel="film coefficient / W/(m²·K)", title="Film coefficient"
    )
    right.set_ylim(0.0, 1.3 * high.max())
    right.legend(loc="upper right", ncols=3, columnspacing=1.2)
    notes = "Dotted lines: full turns."
    if ports and place.size > 2:
        ends = coolant.film_coefficient[order][~inside]
        notes += f" Ports: {ends.min():.0f} to {ends.max():.0f} W/(m²·K)."
    for axes in (left, right):
        axes.margins(x=0.01)
        for turn in range(1, math.floor(turns.max()) + 1):
            # below the legends
            axes.axvline(
                np.interp(turn, turns, place),
                ymax=0.86,
                color=MUTED,
                linewidth=0.9,
                linestyle=":",
                zorder=1.5,
            )
    set_title(figure, "Coolant along the helical channel", notes)
    return figure
