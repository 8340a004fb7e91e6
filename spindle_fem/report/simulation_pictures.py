"""Pictures of a simulated recording: readings, prediction, residuals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spindle_fem.recordings.align import Recording
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

READ, PREDICTED, BAND = "#6b6b6b", "#D55E00", "#0072B2"
MOST_POINTS = 4000
DPI = 130


def draw_channels(
    folder: Path, recording: Recording, predicted: Array, half_width: Array | None = None
) -> list[Path]:
    """One picture for each temperature channel: temperature above, residual below.

    Parameters
    ----------
    folder : Path
        Made when missing.
    recording : Recording
    predicted : (N, c) ndarray, [K]
    half_width : (N, c) ndarray, optional, [K]
        Of the interval that should hold nine readings in ten.

    Returns
    -------
    list of Path
    """
    folder.mkdir(parents=True, exist_ok=True)
    thin = max(1, recording.times.size // MOST_POINTS)
    hours = recording.times[::thin] / 3600.0
    written = []
    for column, name in enumerate(recording.temperature_names):
        usable = recording.usable[::thin, column]
        read = np.where(usable, recording.temperature[::thin, column], np.nan)
        model = predicted[::thin, column]
        figure = Figure(figsize=(9.0, 5.4), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        upper.plot(hours, read - ZERO_CELSIUS_K, ".", ms=2, color=READ, label="read")
        upper.plot(hours, model - ZERO_CELSIUS_K, lw=1.2, color=PREDICTED, label="predicted")
        upper.set_ylabel("temperature / °C")
        upper.set_title(f"{recording.name}: {name}")
        upper.legend(frameon=False)
        lower.plot(hours, model - read, ".", ms=2, color=READ)
        lower.axhline(0.0, lw=0.8, color=PREDICTED)
        if half_width is not None:
            for sign in (-1.0, 1.0):
                lower.plot(hours, sign * half_width[::thin, column], lw=0.8, color=BAND)
            lower.plot([], [], lw=0.8, color=BAND, label="90 % interval")
            lower.legend(frameon=False, loc="upper right")
        lower.set_ylabel("predicted − read / K")
        lower.set_xlabel("time / h")
        for axes in (upper, lower):
            axes.grid(True, color="#dfe4e9", lw=0.6)
        path = folder / f"residual_{_safe(name)}.png"
        figure.savefig(path)
        written.append(path)
    return written


def _safe(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
