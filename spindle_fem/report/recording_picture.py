"""A recording as it is, before any model: every channel over time with its gaps and flagged readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import Flag
from spindle_fem.report.clock_axis import label_times, time_scale
from spindle_fem.report.figure_style import CYCLE, new_figure, pixel_axes, save_png, set_title, styled
from spindle_fem.report.read_against_predicted import runs
from spindle_fem.units import ZERO_CELSIUS_K, registry

Array = NDArray[np.float64]

GAP_COLOUR, MOST_POINTS, MOST_CHANNELS = "#f3d9c9", 4000, 32
# Flags by what is drawn: colour and sign.
MARKS = {
    Flag.SPIKE: ("spike", "#c1121f", "^"),
    Flag.DROPOUT: ("drop-out", "#c1121f", "v"),
    Flag.STUCK: ("stuck", "#7b2cbf", "s"),
    Flag.IMPLAUSIBLE: ("implausible", "#c1121f", "x"),
}
_SHOWN_UNITS = {
    "kelvin": "°C",
    "radian / second": "1/min",
    "meter": "µm",
    "meter ** 3 / second": "l/min",
    "kilogram * meter ** 2 / second ** 3": "W",
    "kilogram * meter / second ** 2": "N",
}
_READ_AS = {"1/min": "rpm", "µm": "um", "l/min": "l/min"}
TOP, HEIGHT, PITCH, FOOT = 160.0, 118.0, 160.0, 60.0


def draw_recording(path: Path, recording: Recording) -> Path:
    """Write a picture of all channels, readings that are not used marked."""
    return save_png(recording_figure(recording), path, colours=256)


@styled
def recording_figure(recording: Recording) -> Figure:
    """A strip a channel on one time axis; shaded where rows or readings are missing."""
    rows = _rows(recording)
    shown = rows[:MOST_CHANNELS]
    seconds = float(recording.times[-1])
    scale, _ = time_scale(seconds)
    times = recording.times / scale
    figure = new_figure(TOP + PITCH * len(shown) + FOOT)
    marked: set[Flag] = set()
    first = None
    for number, (name, role, values, flags, si_unit) in enumerate(shown):
        axes = pixel_axes(figure, 150.0, TOP + number * PITCH, 1400.0, HEIGHT, sharex=first)
        first = first or axes
        values, label = _in_shown_unit(values, si_unit)
        missing = ~np.isfinite(values)
        for start, end in [(gap.start / scale, gap.end / scale) for gap in recording.defects.gaps]:
            axes.axvspan(start, end, color=GAP_COLOUR, linewidth=0.0)
        for start, end in runs(missing):
            begin, stop = times[max(start - 1, 0)], times[min(end + 1, len(times) - 1)]
            axes.axvspan(begin, stop, color=GAP_COLOUR, linewidth=0.0)
        usable = np.flatnonzero(~missing & (flags == 0))
        usable = usable[:: max(1, len(usable) // MOST_POINTS)]
        axes.plot(times[usable], values[usable], ".", color=CYCLE[_ROLES.index(role)], markersize=2.2)
        axes.margins(x=0.005, y=0.12)
        low, high = axes.get_ylim()
        for flag, (_, colour, sign) in MARKS.items():
            at = np.flatnonzero(~missing & ((flags & flag) > 0))
            if at.size:
                marked.add(flag)
                # outliers are drawn at the edge: on scale they would flatten all other readings
                shown_at = np.clip(values[at], low, high) if usable.size else values[at]
                axes.plot(
                    times[at], shown_at, sign, color=colour, markersize=4.5, fillstyle="none", clip_on=False
                )
        if usable.size:
            axes.set_ylim(low, high)
        axes.set_title(name, fontsize=9.5, pad=3.0)
        axes.set_ylabel(label)
        axes.yaxis.set_label_coords(-105.0 / 1400.0, 0.5)
        axes.locator_params(axis="y", nbins=4)
        axes.tick_params(labelbottom=number == len(shown) - 1)
    label_times(axes, recording.start, seconds)
    gaps = any(isinstance(patch, Rectangle) for strip in figure.axes for patch in strip.patches)
    _draw_key(figure, {row[1] for row in shown}, marked, gaps=gaps)
    left = f"; {len(rows) - len(shown)} further channels not drawn" if len(rows) > len(shown) else ""
    set_title(figure, recording.name, recording.defects.lines()[0].partition(": ")[2] + left)
    return figure


_ROLES = ("temperature", "input", "covariate", "displacement")


def _rows(recording: Recording) -> list[tuple[str, str, Array, NDArray[np.uint8], str]]:
    """Title, role, values in SI, flags and SI unit of every channel."""
    none = np.zeros(len(recording.times), dtype=np.uint8)
    rows: list[tuple[str, str, Array, NDArray[np.uint8], str]] = []
    for i, name in enumerate(recording.temperature_names):
        title = _title(name, f"probe {recording.probes[i]}")
        rows.append((title, "temperature", recording.temperature[:, i], recording.flags[:, i], "kelvin"))
    for i, name in enumerate(recording.displacement_names):
        title = _title(name, f"sensor {recording.displacement_sensors[i]}, from its first reading")
        rows.append((title, "displacement", recording.displacements[:, i], none, "meter"))
    for i, name in enumerate(recording.input_columns):
        title = _title(name, f"drives {recording.input_names[i]}")
        rows.append((title, "input", recording.inputs[:, i], none, recording.input_units[i]))
    for i, name in enumerate(recording.covariate_names):
        title = _title(name, "covariate")
        rows.append((title, "covariate", recording.covariates[:, i], none, recording.covariate_units[i]))
    return rows


def _title(column: str, means: str) -> str:
    return f"{column} ({means})"


def _in_shown_unit(values: Array, unit: str) -> tuple[Array, str]:
    label = _SHOWN_UNITS.get(unit, "")
    if unit == "kelvin":
        return values - ZERO_CELSIUS_K, label
    if not label:
        return values, f"{registry().Unit(unit):~P}" if unit else ""
    return registry().Quantity(values, unit).to(_READ_AS.get(label, label)).magnitude, label


def _draw_key(figure: Figure, roles: set[str], marked: set[Flag], *, gaps: bool) -> None:
    entries: dict[str, Line2D | Rectangle] = {
        role: Line2D([], [], color=CYCLE[number], linestyle="none", marker=".", markersize=6)
        for number, role in enumerate(_ROLES)
        if role in roles
    }
    if gaps:
        entries["gap or nothing read"] = Rectangle((0, 0), 1, 1, color=GAP_COLOUR)
    for flag, (label, colour, sign) in MARKS.items():
        if flag in marked:
            entries[f"{label} (not used)"] = Line2D(
                [], [], color=colour, linestyle="none", marker=sign, fillstyle="none"
            )
    width, height = figure.get_size_inches() * figure.dpi
    figure.legend(
        list(entries.values()),
        list(entries),
        ncols=len(entries),
        columnspacing=1.2,
        handletextpad=0.4,
        loc="upper left",
        bbox_to_anchor=(15.0 / width, 1.0 - 82.0 / height),
    )
