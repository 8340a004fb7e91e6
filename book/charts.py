"""Charts of a concealed study and of errors by speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure

from spindle_fem.report.figure_style import CYCLE, INK, MUTED, new_figure, set_title, styled
from validation.asked import wilson

GOOD, FAIR, SILENT, WRONG = "#1b6e3c", "#8fc3a1", "#c9d1d9", "#a3131c"
_COUNTS = LinearSegmentedColormap.from_list("counts", ["#eef4f9", "#0b5c94"])


@styled
def matrix(
    counts: Mapping[str, Mapping[str, int]], title: str, notes: str, rows: str, columns: str
) -> Figure:
    """Counts in a table of squares, truth by row, finding by column; zero is left white."""
    across = list(dict.fromkeys(name for row in counts.values() for name in row))
    down = list(counts)
    values = np.array([[counts[a].get(b, 0) for b in across] for a in down], dtype=float)
    height = 100 + 46 * len(down) + 190
    figure = new_figure(height)
    set_title(figure, title, notes)
    axes = figure.add_axes((0.2, 190 / height, 0.77, 46 * len(down) / height))
    shown = np.where(values > 0, values, np.nan)
    axes.imshow(shown, cmap=_COUNTS, norm=LogNorm(0.8, max(values.max(), 2.0)), aspect="auto")
    for i, j in zip(*np.nonzero(values), strict=True):
        dark = values[i, j] > 0.25 * values.max()
        axes.text(
            j,
            i,
            f"{values[i, j]:.0f}",
            ha="center",
            va="center",
            color="white" if dark else INK,
            fontsize=9.5,
            fontweight="bold" if down[i] == across[j] else "normal",
        )
    axes.set_yticks(range(len(down)), [name.replace("_", " ") for name in down])
    axes.set_xticks(
        range(len(across)), [name.replace("_", " ") for name in across], rotation=32, ha="right", fontsize=8.5
    )
    axes.set_ylabel(rows)
    axes.set_xlabel(columns)
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    return figure


@styled
def calibration_curve(bins: Sequence[Mapping[str, Any]]) -> Figure:
    """Stated probability of the first set against how often it was right, with 90 % intervals."""
    figure = new_figure(760)
    set_title(figure, "Stated probability against how often it was right")
    axes = figure.add_axes((0.07, 0.11, 0.9, 0.77))
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1.0, linestyle="--", label="perfectly calibrated")
    stated = np.array([row["stated"] for row in bins])
    right = np.array([row["right"] for row in bins])
    spans = np.array([wilson(row["right"], row["cases"]) for row in bins])
    axes.vlines(stated, spans[:, 0], spans[:, 1], color=CYCLE[0], linewidth=1.6)
    axes.plot(stated, right, "o-", color=CYCLE[0], label="this study, 90 % interval")
    for row in bins:
        axes.annotate(
            f"{row['cases']} cases",
            (row["stated"], row["right"]),
            xytext=(-6, 5),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=8.5,
            color=MUTED,
        )
    axes.set(xlim=(0, 1.02), ylim=(-0.03, 1.05))
    axes.set_xlabel("mean stated probability of the first set")
    axes.set_ylabel("share of cases in which it was an acceptable answer")
    axes.legend(loc="upper left")
    return figure


@styled
def outcome_by_strength(bins: Sequence[Mapping[str, Any]]) -> Figure:
    """Stacked shares of what became of concealed effects, by how strong they are after a re-fit."""
    figure = new_figure(620)
    set_title(
        figure,
        "What became of concealed effects",
        "by what they leave on the most affected channel after the machine's parameters were re-fitted, over "
        "noise",
    )
    axes = figure.add_axes((0.07, 0.15, 0.68, 0.66))
    parts = (
        ("named", "all of them named first", GOOD),
        ("among_the_sets", "among the alternatives", FAIR),
        ("consistent", "called consistent", SILENT),
        ("other", "something else named", WRONG),
    )
    foot = np.zeros(len(bins))
    for key, label, colour in parts:
        share = np.array([row[key] / row["cases"] for row in bins])
        axes.bar(range(len(bins)), share, 0.72, bottom=foot, color=colour, label=label)
        foot += share
    for at, row in enumerate(bins):
        axes.text(at, 1.02, f"{row['cases']}", ha="center", fontsize=9, color=MUTED)
    names = [f"{r['from']:g}–{r['to']:g}" if r["to"] < 1e6 else f"above {r['from']:g}" for r in bins]
    axes.set_xticks(range(len(bins)), names)
    axes.set_xlabel("strength of the concealed effects, noise = 1 (cases above the bars)")
    axes.set_ylabel("share of cases")
    axes.set_ylim(0, 1.08)
    axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    return figure


@styled
def coverage_chart(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Error of every estimated parameter in units of its own interval."""
    names = sorted({f"{row['effect']}.{row['parameter']}" for row in rows})
    height = 150 + 40 * len(names) + 90
    figure = new_figure(height)
    set_title(
        figure,
        "Where the truth lies in the stated 90 % intervals",
        "−1 and 1 are the ends of the interval, each half scaled by itself; beyond ±3 drawn at the edge",
    )
    axes = figure.add_axes((0.31, 90 / height, 0.66, 40 * len(names) / height))
    axes.axvspan(-1, 1, color="#e4f0e8", zorder=0)
    for at, name in enumerate(names):
        own = [row for row in rows if f"{row['effect']}.{row['parameter']}" == name]
        place = np.array([_within(row) for row in own])
        spread = at + (0.2 * np.linspace(-1, 1, place.size) if place.size > 1 else np.zeros(1))
        inside = np.array([row["inside"] for row in own])
        for mask, colour in ((inside, GOOD), (~inside, WRONG)):
            axes.plot(np.clip(place[mask], -3, 3), spread[mask], "o", color=colour, alpha=0.8, markersize=5)
    axes.axvline(0.0, color=MUTED, linewidth=0.9)
    axes.set_yticks(range(len(names)), [n.replace("_", " ").replace(".", ": ") for n in names], fontsize=8.5)
    axes.set(xlim=(-3.15, 3.15), ylim=(-0.7, len(names) - 0.3))
    axes.set_xlabel("(truth − estimate) / half width of the interval")
    return figure


def _within(row: Mapping[str, Any]) -> float:
    difference = row["true"] - row["value"]
    half = row["high"] - row["value"] if difference > 0 else row["value"] - row["low"]
    if half <= 0:
        return 0.0 if difference == 0 else float(np.copysign(9.0, difference))
    return float(difference / half)


@styled
def errors_against_noise(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Held-out error before and after over noise, one line a case, sorted by the error before."""
    shown = [r for r in rows if r["before_over_noise"] and r["after_over_noise"]]
    shown.sort(key=lambda row: row["before_over_noise"])
    figure = new_figure(640)
    set_title(
        figure,
        "Held-out error before and after",
        "every case, sorted by the error before; readings never fitted",
    )
    axes = figure.add_axes((0.07, 0.13, 0.9, 0.69))
    at = np.arange(len(shown))
    before = np.array([row["before_over_noise"] for row in shown])
    after = np.array([row["after_over_noise"] for row in shown])
    wrong = np.array([bool(row["truth"]) and not row["exact"] for row in shown])
    axes.vlines(at, np.minimum(before, after), np.maximum(before, after), color="#c9d1d9", linewidth=1.2)
    axes.plot(at, before, "o", color=MUTED, markersize=4, label="before")
    axes.plot(
        at[~wrong], after[~wrong], "o", color=GOOD, markersize=4.5, label="after, named rightly or nothing"
    )
    axes.plot(at[wrong], after[wrong], "D", color=WRONG, markersize=4.5, label="after, truth not named first")
    axes.axhline(1.0, color=INK, linewidth=0.9, linestyle="--", label="noise")
    axes.set_yscale("log")
    ticks = [
        tick for tick in (0.5, 1, 2, 3, 5, 10, 20, 50, 100) if tick <= 1.2 * max(before.max(), after.max())
    ]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_ylim(0.85 * min(1.0, after.min()), 1.6 * max(before.max(), after.max()))
    axes.set_xlim(-1, len(shown))
    axes.set_xlabel("cases")
    axes.set_ylabel("held-out error / noise")
    axes.legend(loc="upper left", ncols=2)
    return figure


@styled
def times_chart(walls: Sequence[float], limit: float) -> Figure:
    """Distribution of the wall times."""
    figure = new_figure(460)
    set_title(figure, "Wall time of a diagnosis")
    axes = figure.add_axes((0.06, 0.17, 0.91, 0.66))
    axes.hist(walls, bins=np.linspace(0, max(*walls, limit) * 1.05, 32), color=CYCLE[0])
    axes.axvline(limit, color=CYCLE[1], linewidth=1.4, label=f"{limit:g} s asked for")
    axes.set_xlabel("wall time / s")
    axes.set_ylabel("cases")
    axes.legend()
    return figure


@styled
def errors_by_speed(series: Mapping[str, Sequence[Mapping[str, float]]], noise: float, title: str) -> Figure:
    """Root mean square error at every speed for several models."""
    figure = new_figure(620)
    set_title(figure, title, "root mean square over all channels, last 20 minutes of every step")
    axes = figure.add_axes((0.07, 0.14, 0.9, 0.68))
    width = 0.8 / len(series)
    colours = ("#c9d1d9", CYCLE[1], CYCLE[2], CYCLE[0])
    for number, (name, rows) in enumerate(series.items()):
        speed = np.array([row["speed_rpm"] for row in rows])
        place = speed / 500.0 + (number - 0.5 * (len(series) - 1)) * width
        axes.bar(place, [row["rms_K"] for row in rows], width * 0.92, color=colours[number], label=name)
    axes.axhline(noise, color=INK, linestyle="--", linewidth=0.9, label="noise of a reading")
    first = next(iter(series.values()))
    axes.set_xticks([row["speed_rpm"] / 500.0 for row in first], [f"{row['speed_rpm']:.0f}" for row in first])
    axes.set_xlabel("speed / rpm")
    axes.set_ylabel("error / K")
    axes.legend(loc="upper left")
    return figure
