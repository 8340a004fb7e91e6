"""Charts of a diagnosis: residuals by channel and condition, missing heat over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spindle_fem.report.clock_axis import label_times, time_scale
from spindle_fem.report.figure_style import (
    CYCLE,
    FILM_MAP,
    INK,
    MUTED,
    ColourBar,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    set_title,
    styled,
)
from spindle_fem.report.read_against_predicted import MOST_CHANNELS, channel_order, of_recording

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

NORMAL_90 = 1.645


def residual_table(data: xr.Dataset, key: str) -> tuple[list[str], list[str], Array]:
    """Root mean square residual by channel and condition, (channels, conditions) K."""
    names = [str(n) for n in data["channel"].values if n in channel_order(data)][: 2 * MOST_CHANNELS]
    conditions = [str(n) for n in data["condition"].values]
    error = (data[key] - data["measured"]).where(data["usable"] == 1).sel(channel=names).values.T
    found = np.full((len(names), len(conditions) + 2), np.nan)
    held = data["held_out"].values == 1
    masks = [*(data["condition_holds"].values.T == 1), held, np.ones(len(held), dtype=bool)]
    for column, mask in enumerate(masks):
        for row in range(len(names)):
            values = error[row, mask]
            values = values[np.isfinite(values)]
            if values.size:
                found[row, column] = float(np.sqrt(np.mean(values**2)))
    return names, [*conditions, "held out", "all"], found


@styled
def residual_map(data: xr.Dataset) -> Figure:
    """Root mean square residual, channel by condition, before beside after on one scale, or of one fit."""
    names, conditions, before = residual_table(data, "before")
    panels = [(before, "before"), (residual_table(data, "after")[2], "after")]
    if data["before"].equals(data["after"]):
        panels = [(before, "")]
    noise = float(np.sqrt(np.nanmean(data["noise"].values ** 2)))
    bar = ColourBar(
        FILM_MAP.reversed(), 0.0, max(float(np.nanmax(before)), 2.0 * noise), "root mean square residual / K"
    )
    row_height, top, foot = 46.0, 150.0, 285.0
    figure = new_figure(top + row_height * len(names) + foot)
    longest = max(len(name) for name in names)
    left = 60.0 + 13.2 * longest
    width = (1600.0 - left) / len(panels) - 30.0
    for number, (values, title) in enumerate(panels):
        axes = pixel_axes(figure, left + number * (width + 30.0), top, width, row_height * len(names))
        axes.imshow(values, cmap=bar.colour_map, norm=bar.norm, aspect="auto")
        axes.set_title(title)
        axes.grid(False)
        axes.set_xticks(range(len(conditions)), conditions, rotation=40, ha="right")
        axes.set_yticks(range(len(names)), names if number == 0 else [""] * len(names))
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.axvline(len(conditions) - 2.5, color="white", linewidth=3.0)
        for (row, column), value in np.ndenumerate(values):
            if np.isfinite(value):
                dark = sum(bar.colours(value)[:3]) < 1.6
                axes.text(
                    column,
                    row,
                    f"{value:.2f}",
                    ha="center",
                    va="center",
                    fontsize=8.0,
                    color="white" if dark else INK,
                )
    total = top + row_height * len(names) + foot
    draw_colour_bar(pixel_axes(figure, 420.0, total - 84.0, 760.0, 20.0), bar)
    set_title(
        figure,
        "What is left, by channel and condition",
        f"A reading's noise is {noise:.2f} K; conditions overlap (speed band and heating or cooling).",
    )
    return figure


@styled
def missing_heat(data: xr.Dataset, components: Sequence[str], number: int) -> Figure | None:
    """Heat over time which, at each credible place alone, would explain what the model leaves.

    Parameters
    ----------
    components : sequence of str
        The most credible first; four are drawn.
    number : int
        Recording.
    """
    if "heat" not in data:
        return None
    tracks = best_tracks(data, components, number)
    if not tracks:
        return None
    own = of_recording(data, number)
    stop = float(own["time"].values[-1])
    scale, _ = time_scale(stop)
    figure = new_figure(140.0 + 290.0 * len(tracks) + 190.0)
    shown = None
    for position, (component, track) in enumerate(tracks.items()):
        axes = pixel_axes(figure, 140.0, 130.0 + 290.0 * position, 1410.0, 210.0, sharex=shown)
        shown = shown or axes
        item = data.isel(track=track)
        times = item["heat_time"].values
        edges = np.append(times, max(stop, times[-1])) / scale
        heat, sigma = item["heat"].values, item["heat_sigma"].values
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        axes.fill_between(
            edges,
            _to_the_end(heat - NORMAL_90 * sigma),
            _to_the_end(heat + NORMAL_90 * sigma),
            step="post",
            color=CYCLE[5],
            alpha=0.35,
            linewidth=0.0,
        )
        axes.stairs(heat, edges, color=CYCLE[0], linewidth=1.8, baseline=None)
        axes.set_ylabel("heat / W")
        spot = str(item["track_spot"].values)
        own_place = spot in (component, f"near.{component}")
        detail = "" if own_place else f" (at {spot.replace('_', ' ')})"
        axes.set_title(component.replace("_", " ") + detail)
        axes.tick_params(labelbottom=False)
        axes.margins(x=0.01)
    strip = pixel_axes(figure, 140.0, 130.0 + 290.0 * len(tracks), 1410.0, 100.0, sharex=shown)
    _draw_drive(strip, own, scale)
    label_times(strip, str(data["start_stamp"].values[number]) or None, stop)
    set_title(
        figure,
        f"{data['recording'].values[number]}: missing heat over time",
        "If heat were missing at this place only; below zero heat is drawn away. Band: 90 % interval.",
    )
    return figure


def _to_the_end(values: Array) -> Array:
    return np.append(values, values[-1])


def best_tracks(data: xr.Dataset, components: Sequence[str], number: int) -> dict[str, int]:
    """Track of the best spot of each component in a recording, the four first components."""
    evidence = dict(zip(data["spot"].values.tolist(), data["spot_log_evidence"].values, strict=True))
    owner = dict(zip(data["spot"].values.tolist(), data["spot_component"].values.tolist(), strict=True))
    found: dict[str, int] = {}
    for component in components:
        own = [
            (evidence[str(spot)], index)
            for index, spot in enumerate(data["track_spot"].values)
            if int(data["track_recording"].values[index]) == number and owner[str(spot)] == component
        ]
        if own and len(found) < 4:
            found[component] = max(own)[1]
    return found


def _draw_drive(axes: Axes, own: xr.Dataset, scale: float) -> None:
    """The speed; without one, the input that changes most and is no temperature."""
    names = [str(n) for n in own["input_name"].values]
    units = [str(u) for u in own["input_unit"].values]
    if not names:
        return
    values = own["input"].values

    def changes(column: int) -> tuple[bool, bool, float]:
        track = values[:, column]
        size = float(np.nanmax(np.abs(track))) or 1.0
        return names[column] == "speed", units[column] != "kelvin", float(np.nanstd(track)) / size

    chosen = max(range(len(names)), key=changes)
    track, label = values[:, chosen], f"{names[chosen].replace('_', ' ')} / {_symbol(units[chosen])}"
    if "radian" in units[chosen]:
        track, label = track * 30.0 / math.pi, f"{names[chosen].replace('_', ' ')} / rpm"
    axes.step(own["time"].values / scale, track, where="post", color=INK, linewidth=1.3)
    axes.set_title(label, fontsize=9.0, fontweight="normal", pad=3.0)
    axes.set_ylim(bottom=min(0.0, float(np.nanmin(track))))


def _symbol(unit: str) -> str:
    """Symbol of an SI unit as recordings spell it.

    >>> _symbol("kelvin"), _symbol("kilogram * meter ** 2 / second ** 3")
    ('K', 'W')
    """
    known = {
        "kelvin": "K",
        "newton": "N",
        "watt": "W",
        "kilogram * meter ** 2 / second ** 3": "W",
        "kilogram * meter / second ** 2": "N",
        "meter ** 3 / second": "m³/s",
        "dimensionless": "1",
    }
    return known.get(unit, unit)
