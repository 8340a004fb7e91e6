"""Charts of a planned measurement: effects it can distinguish, and gains from further sensors and tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.view.place_names import NEAR
from spindle_fem.report.diagnosis_drawing import places_on_machine
from spindle_fem.report.figure_style import (
    CYCLE,
    FILM_MAP,
    MUTED,
    ColourBar,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    plain_decades,
    set_title,
    styled,
)
from spindle_fem.report.meridian_axes import MM
from spindle_fem.report.table_rows import plain

# Effects drawn at most, and the side of a cell, px; so many places and tests.
MOST_DRAWN, CELL, MOST_OPTIONS = 90, 17.0, 14
NOT_COMPARED = "#dfe4e9"


def effect_label(item: Mapping[str, Any]) -> str:
    """An effect and its place on an axis."""
    return f"{plain(item['effect'])} · {plain(item['component'])}"


def drawn_effects(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Effects that are seen at their usual size, by id and place; all of them where none is."""
    seen = [item for item in content["detectable"] if item["at_usual_size"]] or content["detectable"]
    return [(item["effect"], item["component"]) for item in seen][:MOST_DRAWN]


@styled
def pair_matrix(content: Mapping[str, Any]) -> Figure:
    """Information in bits between every two effects; a cross where they cannot be distinguished."""
    keys = drawn_effects(content)
    place = {key: index for index, key in enumerate(keys)}
    values = np.full((len(keys), len(keys)), np.nan)
    crossed = []
    for pair in content["pairs"]:
        first, second = (
            place.get((pair[side]["effect"], pair[side]["component"])) for side in ("first", "second")
        )
        if first is not None and second is not None:
            values[first, second] = pair["information_bit"]
            if not pair["told_apart"]:
                crossed.append((second, first))
    labels = [effect_label({"effect": effect, "component": where}) for effect, where in keys]
    # Small matrices in large cells.
    cell = max(CELL, min(44.0, 700.0 / len(keys)))
    font = min(8.5, 0.42 * cell)
    side = cell * len(keys)
    beside = 40.0 + 1.2 * font * max(map(len, labels))
    width = max(1050.0, beside + side + 60.0)
    figure = new_figure(beside + side + 210.0, width)
    axes = pixel_axes(figure, beside, 90.0 + beside, side, side)
    axes.set_facecolor(NOT_COMPARED)
    axes.imshow(
        np.ma.masked_invalid(values),
        cmap=FILM_MAP,
        vmin=0.0,
        vmax=1.0,
        aspect="auto",
        interpolation="nearest",
    )
    if crossed:
        x, y = np.array(crossed).T
        axes.plot(
            x, y, linestyle="none", marker="x", color="white", markersize=0.3 * cell, markeredgewidth=1.1
        )
    axes.set_xticks(range(len(keys)), labels, rotation=90, fontsize=font)
    axes.set_yticks(range(len(keys)), labels, fontsize=font)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.grid(False)
    set_title(
        figure,
        "Told apart",
        "row: what is there, at its usual size; column: what it might be taken for; ×: not told apart",
    )
    bar = ColourBar(FILM_MAP, 0.0, 1.0, "information between the two / bit")
    draw_colour_bar(pixel_axes(figure, beside, 110.0 + beside + side, min(side, 500.0), 16.0), bar)
    return figure


@styled
def detectable_sizes(content: Mapping[str, Any]) -> Figure:
    """Size from which each effect is seen, as a multiple of its usual size, on a logarithmic scale."""
    items = [item for item in content["detectable"] if item["multiple"] is not None]
    items = sorted(items, key=lambda item: item["multiple"])[:MOST_DRAWN]
    labels = [effect_label(item) for item in items]
    left = 40.0 + 11.4 * max(map(len, labels), default=10)
    figure = new_figure(190.0 + 20.0 * max(len(items), 1))
    axes = pixel_axes(figure, left, 100.0, 1600.0 - left - 60.0, 20.0 * max(len(items), 1))
    values = [item["multiple"] for item in items]
    colours = [CYCLE[0] if value <= 1.0 else "#a9b7c4" for value in values]
    axes.barh(range(len(items)), values, color=colours, height=0.7, left=0.0)
    axes.set_xscale("log")
    plain_decades(axes.xaxis)
    axes.axvline(1.0, color=MUTED, linewidth=1.0)
    axes.set_yticks(range(len(items)), labels, fontsize=7.5)
    axes.set_ylim(len(items) - 0.5, -0.5)
    axes.set_xlabel("size from which it is seen, over its usual size")
    axes.grid(axis="y", visible=False)
    figure.legend(
        handles=[Patch(color=CYCLE[0], label="seen at its usual size"), Patch(color="#a9b7c4", label="not")],
        loc="upper right",
        ncols=2,
    )
    set_title(figure, "Seen from", "")
    return figure


@styled
def options_chart(options: Sequence[Mapping[str, Any]], now: float, title: str) -> Figure:
    """Information that each further sensor or other test would give, beside what is there."""
    shown = list(options)[:MOST_OPTIONS]
    labels = [item["words"] for item in shown]
    left = min(40.0 + 11.4 * max(map(len, labels)), 900.0)
    figure = new_figure(170.0 + 32.0 * len(shown))
    axes = pixel_axes(figure, left, 80.0, 1600.0 - left - 60.0, 32.0 * len(shown))
    values = [item["information_bit"] for item in shown]
    axes.plot(values, range(len(shown)), "o", color=CYCLE[0], markersize=7.0)
    axes.axvline(now, color=CYCLE[1], linewidth=1.4)
    axes.set_yticks(range(len(shown)), labels, fontsize=8.0)
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xlabel("mean over all pairs / bit; the line: the sensors and the test asked for")
    set_title(figure, title)
    return figure


@styled
def sensor_places(content: Mapping[str, Any], spec: MachineSpec) -> Figure:
    """Half section: the sensors, and what one more at each place would add to the information."""
    probes = {probe.name for probe in spec.probe}
    gains = {
        (NEAR if item["name"] in probes else "") + item["name"]: max(0.0, item["gain_bit"])
        for item in content["further_sensors"]
    }
    best = content["best_next_sensor"]["name"]
    bar = ColourBar(
        FILM_MAP.reversed(),
        0.0,
        max(*gains.values(), 1e-3),
        "gained by one more sensor, mean over pairs / bit",
    )
    figure = places_on_machine(gains, bar, spec, framed=best)
    read = {sensor["probe"] for sensor in content["sensors"]}
    at = [
        (probe.z * MM, probe.r * MM) for probe in spec.probe if probe.kind == "point" and probe.name in read
    ]
    if at:
        x, y = np.array(at).T
        figure.axes[0].plot(x, y, linestyle="none", marker="o", markersize=7.0, color=CYCLE[1], zorder=8)
    notes = "Orange dots: the sensors that are read. "
    if best in {sensor.name for sensor in spec.displacement_sensor}:
        notes += f"The best one to add, {plain(best)}, reads a displacement and is not drawn."
    else:
        notes += f"Framed: the best place for one more ({plain(best)})."
    set_title(figure, "Where one more sensor helps", notes)
    return figure
