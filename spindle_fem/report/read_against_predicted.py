"""Channels over time: readings, predictions, and the residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from spindle_fem.recordings.align import LONG_GAP_STEPS, Recording
from spindle_fem.report.clock_axis import label_times, time_scale
from spindle_fem.report.figure_style import (
    CYCLE,
    MUTED,
    new_figure,
    pixel_axes,
    save_png,
    set_title,
    styled,
)
from spindle_fem.units import MICROMETRES, ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

READ, HELD, BAND = "#8a8f94", "#eceff2", "#c9d3dc"
# Colour and line of each prediction, the last one the model that counts.
LINES = {
    "predicted": (CYCLE[0], "-"),
    "model before": (CYCLE[1], "--"),
    "model after": (CYCLE[0], "-"),
}
MOST_CHANNELS = 12
MOST_POINTS = 1500
BINS = 240
# Standard deviations of an interval that should hold nine readings in ten.
NINE_IN_TEN = 1.645


@dataclass(frozen=True, slots=True)
class Course:
    """One channel over time.

    Attributes
    ----------
    times : (N,) ndarray, [s]
    read : (N,) ndarray, [degC]
        NaN where the reading is of no use.
    predictions : mapping of str to (N,) ndarray, [degC]
        By a key of ``LINES``.
    band : float or (N,) ndarray, [K]
        Half width of the shaded band about no residual.
    held_out : (N,) ndarray of bool
        Stamps that no fit saw; shaded.
    units : (str, str)
        Of the readings, and of a residual.
    """

    name: str
    times: Array
    read: Array
    predictions: Mapping[str, Array]
    band: float | Array
    held_out: NDArray[np.bool_]
    units: tuple[str, str] = ("°C", "K")


def draw_course(upper: Axes, lower: Axes, course: Course, scale: float) -> None:
    """Readings and predictions above; beneath, means of read minus predicted over short times.

    ``scale`` divides the times, as :func:`time_scale` gives it.
    """
    times = course.times / scale
    usable = np.isfinite(course.read)
    for start, end in runs(course.held_out):
        for axes in (upper, lower):
            axes.axvspan(times[start], times[end], color=HELD, linewidth=0.0, zorder=0)
    chosen = np.flatnonzero(usable)
    chosen = chosen[:: max(1, len(chosen) // MOST_POINTS)]
    upper.plot(times[chosen], course.read[chosen], ".", color=READ, markersize=2.6, zorder=2)
    thin = slice(None, None, max(1, len(times) // (3 * MOST_POINTS)))
    band = np.broadcast_to(course.band, times.shape)[thin]
    lower.fill_between(times[thin], -band, band, color=BAND, alpha=0.8, linewidth=0.0, zorder=1)
    lower.axhline(0.0, color=MUTED, linewidth=0.8, zorder=1)
    for key, values in course.predictions.items():
        colour, style = LINES[key]
        drawn = _broken(times, values)[thin]
        upper.plot(times[thin], drawn, color=colour, linestyle=style, linewidth=1.5, zorder=3)
        at, mean = _bin_means(times[usable], (course.read - values)[usable])
        lower.plot(at, mean, color=colour, linewidth=1.3, linestyle=style, zorder=3)
    upper.tick_params(labelbottom=False)
    upper.margins(x=0.01)
    upper.set_ylabel(course.units[0])
    lower.set_ylabel(f"residual / {course.units[1]}")


def draw_legend(figure: Figure, predictions: Mapping[str, Array], band: str, *, held_out: bool) -> None:
    """Legend in one row under the title: readings, each prediction, the shaded band."""
    entries: dict[str, Line2D | Rectangle] = {
        "read": Line2D([], [], color=READ, linestyle="none", marker=".", markersize=6)
    }
    for key in predictions:
        colour, style = LINES[key]
        entries[key] = Line2D([], [], color=colour, linestyle=style)
    if held_out:
        entries["held out: not fitted"] = Rectangle((0, 0), 1, 1, color=HELD)
    entries[band] = Rectangle((0, 0), 1, 1, color=BAND)
    width, height = figure.get_size_inches() * figure.dpi
    figure.legend(
        list(entries.values()),
        list(entries),
        ncols=len(entries),
        loc="upper left",
        bbox_to_anchor=(15.0 / width, 1.0 - 82.0 / height),
    )


@styled
def courses_figure(courses: list[Course], title: str, notes: str, band: str, start: str | None) -> Figure:
    """Channels two in a row, each with its residual beneath; one alone in its row takes the whole width.

    Parameters
    ----------
    courses : list of Course
        With the same predictions and times.
    band : str
        What the shaded band is.
    start : str or None
        ISO stamp of time 0, where it is known.
    """
    first = courses[0]
    seconds = float(first.times[-1] - first.times[0])
    scale, _ = time_scale(seconds)
    columns = min(2, len(courses))
    rows = math.ceil(len(courses) / columns)
    top, cell, foot = (178.0 if columns == 2 else 145.0), 486.0, 50.0
    figure = new_figure(top + rows * cell + foot)
    for position, course in enumerate(courses):
        row, column = divmod(position, columns)
        left = 115.0 + 795.0 * column
        width = 1450.0 if column == 0 and position + 1 == len(courses) else 655.0
        upper = pixel_axes(figure, left, top + row * cell, width, 235.0)
        lower = pixel_axes(figure, left, top + row * cell + 260.0, width, 130.0, sharex=upper)
        draw_course(upper, lower, course, scale)
        upper.set_title(course.name if len(courses) > 1 else "")
        for axes in (upper, lower):
            # Clear of the widest tick label, the same in every row.
            axes.yaxis.set_label_coords(-84.0 / width, 0.5)
        label_times(lower, start, seconds)
        if row + 1 < rows:
            lower.set_xlabel("")
    draw_legend(figure, first.predictions, band, held_out=any(item.held_out.any() for item in courses))
    set_title(figure, title, notes)
    return figure


def draw_channels(folder: Path, recording: Recording, predicted: Array, half_width: Array) -> list[Path]:
    """``residual_<channel>.png`` of each temperature channel of a simulated recording.

    Parameters
    ----------
    folder : Path
        Made when missing.
    predicted : (N, c) ndarray, [K]
    half_width : (N, c) ndarray, [K]
        Of the interval that should hold nine readings in ten.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for course in simulated_courses(recording, predicted, half_width):
        figure = simulated_figure([course], f"{recording.name}: {course.name}", recording.start)
        written.append(save_png(figure, folder / f"residual_{_safe(course.name)}.png", colours=128))
    return written


def draw_displacements(folder: Path, recording: Recording, predicted: Array) -> list[Path]:
    """``displacement_<channel>.png`` of each displacement channel of a simulated recording.

    Parameters
    ----------
    folder : Path
        That exists.
    predicted : (N, d) ndarray, [m]
        From the first reading of each.
    """
    nothing = np.zeros(recording.times.size, dtype=bool)
    notes = "Displacement since its first reading above, residual (read − predicted) beneath."
    written = []
    for column, name in enumerate(recording.displacement_names):
        course = Course(
            name,
            recording.times,
            MICROMETRES * recording.displacements[:, column],
            {"predicted": MICROMETRES * predicted[:, column]},
            NINE_IN_TEN * MICROMETRES * recording.displacement_sigma[column],
            nothing,
            ("µm", "µm"),
        )
        title, band = f"{recording.name}: {name}", "noise, 90 % of readings"
        figure = courses_figure([course], title, notes, band, recording.start)
        written.append(save_png(figure, folder / f"displacement_{_safe(name)}.png", colours=128))
    return written


def simulated_courses(recording: Recording, predicted: Array, half_width: Array) -> list[Course]:
    """Courses of all temperature channels of a recording; parameters as of :func:`draw_channels`."""
    nothing = np.zeros(recording.times.size, dtype=bool)
    readings = np.where(recording.usable, recording.temperature, np.nan) - ZERO_CELSIUS_K
    return [
        Course(
            name,
            recording.times,
            readings[:, column],
            {"predicted": predicted[:, column] - ZERO_CELSIUS_K},
            half_width[:, column],
            nothing,
        )
        for column, name in enumerate(recording.temperature_names)
    ]


def simulated_figure(courses: list[Course], title: str, start: str | None) -> Figure:
    """Channels of a simulated recording; ``start`` as of :func:`courses_figure`."""
    notes = "Temperature above, residual (read − predicted, means over short times) beneath."
    return courses_figure(courses, title, notes, "90 % interval of a reading", start)


def _safe(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


def before_after(data: xr.Dataset, number: int) -> Figure:
    """Every temperature of a diagnosed recording with the predictions before and after.

    Parameters
    ----------
    data : Dataset
        As ``diagnosis.nc`` has it.
    number : int
        Recording.
    """
    own = of_recording(data, number)
    order = channel_order(own)
    names = [str(name) for name in own["channel"].values if name in order or not order]
    if len(names) > MOST_CHANNELS:
        names = order[:MOST_CHANNELS]
    courses = []
    for name in names:
        item = own.sel(channel=name)
        courses.append(
            Course(
                name,
                item["time"].values,
                np.where(item["usable"].values == 1, item["measured"].values, np.nan),
                _predictions(item["before"].values, item["after"].values),
                2.0 * float(item["noise"].values[number]),
                item["held_out"].values == 1,
            )
        )
    return _before_after_figure(courses, "Temperature", data, number)


def displaced_before_after(data: xr.Dataset, number: int) -> Figure | None:
    """Every displacement of a diagnosed recording, in µm, with the predictions before and after.

    None where none was read; parameters as of :func:`before_after`.
    """
    if "displacement" not in data:
        return None
    own = of_recording(data, number)
    courses = []
    for name in own["displacement_name"].values:
        item = own.sel(displacement_name=name)
        if not np.isfinite(item["displacement"].values).any():
            continue
        before, after = (item[f"displacement_{when}"].values for when in ("before", "after"))
        courses.append(
            Course(
                str(name),
                item["time"].values,
                MICROMETRES * item["displacement"].values,
                _predictions(MICROMETRES * before, MICROMETRES * after),
                2.0 * MICROMETRES * float(item["displacement_noise"].values[number]),
                item["held_out"].values == 1,
                ("µm", "µm"),
            )
        )
    if not courses:
        return None
    return _before_after_figure(courses[:MOST_CHANNELS], "Displacement since its first reading", data, number)


def _before_after_figure(courses: list[Course], read: str, data: xr.Dataset, number: int) -> Figure:
    named = f", {courses[0].name}" if len(courses) == 1 else ""
    what = "before and after" if len(courses[0].predictions) > 1 else "read and predicted"
    title = f"{data['recording'].values[number]}{named}: {what}"
    notes = f"{read} above, residual (read − model, means over short times) beneath."
    start = str(data["start_stamp"].values[number]) or None
    return courses_figure(courses, title, notes, "noise, ± 2 σ of a reading", start)


def _predictions(before: Array, after: Array) -> dict[str, Array]:
    """Predictions by a key of ``LINES``: one where nothing was found."""
    if np.array_equal(before, after, equal_nan=True):
        return {"predicted": after}
    return {"model before": before, "model after": after}


def of_recording(data: xr.Dataset, number: int) -> xr.Dataset:
    """Stamps of one recording."""
    return data.isel(stamp=np.flatnonzero(data["recording_index"].values == number))


def channel_order(data: xr.Dataset) -> list[str]:
    """Channels that were read, those with the largest error before first."""
    error = (data["before"] - data["measured"]).where(data["usable"] == 1)
    size = np.sqrt((error**2).mean("stamp", skipna=True)).values
    names = [str(name) for name in data["channel"].values]
    return [names[i] for i in np.argsort(-np.nan_to_num(size, nan=-1.0)) if np.isfinite(size[i])]


def _broken(times: Array, values: Array) -> Array:
    """Values with NaN where a long gap follows, so that no line crosses it."""
    gaps = np.diff(times, append=times[-1])
    return np.where(gaps > max(LONG_GAP_STEPS * float(np.median(gaps)), 1e-9), np.nan, values)


def _bin_means(times: Array, values: Array) -> tuple[Array, Array]:
    """Means over equal stretches of time; NaN between two where nothing was read for long."""
    if times.size <= BINS:
        return times, values
    owner = np.minimum((BINS * (times - times[0]) / (times[-1] - times[0])).astype(int), BINS - 1)
    count = np.bincount(owner, minlength=BINS)
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            times[0] + (np.arange(BINS) + 0.5) * (times[-1] - times[0]) / BINS,
            np.bincount(owner, weights=values, minlength=BINS) / count,
        )


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of every run of true entries.

    >>> runs(np.array([True, False, True, True]))
    [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
