"""Charts of what a diagnosis concludes: probabilities of sets, intervals of findings and of parameters."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from spindle_fem.effects.framework.effect import capital
from spindle_fem.report.diagnosis_charts import NORMAL_90
from spindle_fem.report.diagnosis_words import in_recording
from spindle_fem.report.figure_style import CYCLE, INK, MUTED, new_figure, pixel_axes, set_title, styled
from spindle_fem.report.parameter_words import parameter_words, worth_showing
from spindle_fem.report.read_against_predicted import HELD
from spindle_fem.report.table_rows import with_interval

if TYPE_CHECKING:
    import xarray as xr

WRAPPED = 46


@styled
def set_probabilities(data: xr.Dataset, content: Mapping[str, Any]) -> Figure:
    """Probability of every set of effects that was fitted to the end, and of something else.

    Of the set that is told, and of something else, as ``content`` states them after the full model's check.
    """
    names = [str(n) for n in data["set_name"].values]
    chosen = [bool(c) for c in data["set_chosen"].values]
    chance = [
        content["set_probability"] if told else float(p)
        for told, p in zip(chosen, data["set_probability"].values, strict=True)
    ]
    misfit = [f"misfit {value:.2f}" for value in data["set_misfit"].values]
    names, chance, misfit = (
        [*names[:9], "something else, or another law"],
        [*chance[:9], content["something_else_probability"]],
        [*misfit[:9], ""],
    )
    chosen = [*chosen[:9], False]
    rows = len(names)
    names = [textwrap.fill(name, WRAPPED) for name in names]
    lines = [line for name in names for line in name.split("\n")]
    height = 26.0 + 26.0 * max(name.count("\n") + 1 for name in names)
    figure = new_figure(150.0 + height * rows + 70.0)
    left = 50.0 + 11.0 * max(map(len, lines))
    axes = pixel_axes(figure, left, 110.0, 1600.0 - left - 240.0, height * rows)
    colours = [CYCLE[0] if item else "#a9b7c4" for item in chosen]
    axes.barh(range(rows), chance, color=colours, height=0.64)
    axes.set_yticks(range(rows), names)
    axes.set(ylim=(rows - 0.5, -0.5), xlim=(0.0, 1.0))
    axes.set_xlabel("probability")
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    for row, (value, extra) in enumerate(zip(chance, misfit, strict=True)):
        # None is stated of what is ruled out or little likely; it may be more than a thousandth.
        text = "–" if value == 0.0 else f"{value:.3f}" if value >= 5e-4 else "< 0.001"
        axes.annotate(
            f"{text}   {extra}",
            (value, row),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            annotation_clip=False,
        )
    set_title(
        figure,
        "Which explanations the data leave",
        "Fitted with the machine's own parameters. Misfit: of whitened residuals, 1 if only error is left.",
    )
    return figure


@styled
def finding_intervals(findings: Sequence[Mapping[str, Any]], what: str = "what was found") -> Figure | None:
    """Value and 90 % interval of every parameter that was found; None where there are none.

    What is fixed, as the lag of a state that switches within a step, was not found.
    """
    rows = [
        (item, name, value)
        for item in findings
        for name, value in item["parameters"].items()
        if value["low"] is not None and value["high"] is not None and value["low"] < value["high"]
    ]
    if not rows:
        return None
    height = 74.0
    figure = new_figure(110.0 + height * len(rows) + 20.0)
    for number, (item, name, value) in enumerate(rows):
        top = 104.0 + number * height
        axes = pixel_axes(figure, 660.0, top, 620.0, 22.0)
        low, high, middle = value["low"], value["high"], value["value"]
        width = high - low
        axes.plot([low, high], [0.0, 0.0], color=CYCLE[0], linewidth=5.0, solid_capstyle="butt")
        axes.plot(middle, 0.0, marker="o", color=INK, markersize=6)
        axes.set(xlim=(low - 0.35 * width, high + 0.35 * width), yticks=[])
        axes.locator_params(axis="x", nbins=5)
        axes.tick_params(axis="x", labelsize=8.0)
        axes.spines["left"].set_visible(False)
        total = figure.get_size_inches()[1] * figure.dpi
        y = 1.0 - (top + 12.0) / total
        place = item["component"].replace("_", " ") + in_recording(item)
        label = f"{item['effect'].replace('_', ' ')} ({place}): "
        figure.text(640.0 / 1600.0, y, label + name.replace("_", " "), ha="right", va="center", fontsize=9.0)
        unit = str(value["unit"]).replace("degC", "°C")
        value_text, low_text, high_text = with_interval(middle, low, high)
        text = f"{value_text} {unit}  [{low_text}, {high_text}]"
        figure.text(1300.0 / 1600.0, y, text, va="center", fontsize=9.0)
    set_title(figure, f"{capital(what)}, in numbers", "Dot: most probable value; bar: 90 % interval.")
    return figure


@styled
def machine_parameters(data: xr.Dataset) -> Figure | None:
    """The machine's own uncertain numbers before and after, in standard deviations of their priors."""
    names = [str(n) for n in data["parameter"].values] if "parameter" in data else []
    if not names:
        return None
    shown = worth_showing(data["parameter_fitted"].values, data["parameter_fitted_sigma"].values)
    left_out = len(names) - len(shown)
    data = data.isel(parameter=shown)
    names = [names[i] for i in shown]
    known, known_sigma = data["parameter_known"].values, data["parameter_known_sigma"].values
    fitted = data["parameter_fitted"].values
    recordings = [str(n) for n in data["recording"].values]
    labels = [textwrap.fill(parameter_words(name, recordings), WRAPPED) for name in names]
    row = 18.0 + 24.0 * max(label.count("\n") + 1 for label in labels)
    top, foot = 150.0, 80.0
    figure = new_figure(top + row * len(names) + foot)
    left = 60.0 + 12.2 * max(len(line) for label in labels for line in label.split("\n"))
    axes = pixel_axes(figure, left, top, 1600.0 - left - 330.0, row * len(names))
    axes.axvspan(-NORMAL_90, NORMAL_90, color=HELD, linewidth=0.0, zorder=0)
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    at = np.arange(len(names))
    calibrated = bool(np.any(np.abs(known) > 1e-9) or np.any(np.abs(known_sigma - 1.0) > 1e-6))
    handles = [Rectangle((0, 0), 1, 1, color=HELD)]
    texts = ["prior, 90 %"]
    if calibrated:
        bars = axes.errorbar(
            known, at - 0.17, xerr=NORMAL_90 * known_sigma, fmt="s", color=CYCLE[4], markersize=4, linewidth=2
        )
        handles.append(bars)
        texts.append("after the calibration recordings")
    bars = axes.errorbar(
        fitted,
        at + 0.17 * calibrated,
        xerr=np.abs(_ends(data) - fitted),
        fmt="o",
        color=CYCLE[0],
        markersize=4.5,
        linewidth=2,
    )
    handles.append(bars)
    texts.append("after the diagnosed recordings")
    axes.set_yticks(at, labels)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("shift from nominal in prior standard deviations")
    transform = axes.get_yaxis_transform()
    for number, name in enumerate(names):
        axes.text(
            1.02, number, _amount(data.sel(parameter=name)), transform=transform, va="center", fontsize=8.5
        )
    width, height = figure.get_size_inches() * figure.dpi
    figure.legend(
        handles, texts, ncols=3, loc="upper left", bbox_to_anchor=(15.0 / width, 1.0 - 82.0 / height)
    )
    notes = "Value and 90 % interval; the prior holds a shift beyond the grey band with less than 10 %."
    if left_out:
        notes += f" {left_out} more stayed as they were, or moved less."
    set_title(figure, "The machine's own parameters", notes)
    return figure


def _ends(data: xr.Dataset) -> np.ndarray:
    """Ends of the 90 % intervals of fitted parameters within their bounds, (2, n), in prior deviations."""
    fitted, width = data["parameter_fitted"].values, NORMAL_90 * data["parameter_fitted_sigma"].values
    ends = np.array([fitted - width, fitted + width])
    # Folders of before have no bounds.
    bounded = "parameter_low" in data
    return np.clip(ends, data["parameter_low"].values, data["parameter_high"].values) if bounded else ends


def _amount(item: xr.Dataset) -> str:
    nominal, sigma = float(item["parameter_nominal"].values), float(item["parameter_prior_sigma"].values)
    places = [float(item["parameter_fitted"].values), *_ends(item).tolist()]
    if int(item["parameter_logarithmic"].values):
        told = [nominal * math.exp(sigma * place) for place in places]
        return "× {} [{}, {}]".format(*with_interval(*told))
    told, unit = [nominal + sigma * place for place in places], str(item["parameter_unit"].values)
    if unit == "m":
        told, unit = [1e3 * value for value in told], "mm"
    middle, low, high = with_interval(*told)
    return f"{middle} {unit}".rstrip() + f" [{low}, {high}]"
