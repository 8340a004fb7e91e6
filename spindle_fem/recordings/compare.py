"""Compare predictions with readings: errors by channel and condition, result files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.conditions import Conditions, operating_conditions
from spindle_fem.units import ZERO_CELSIUS_K

ALL = "all"


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """Errors of one channel in one operating condition, read minus predicted.

    Attributes
    ----------
    readings : int
        Readings in use.
    rmse, mean, largest : float, [K]
        ``largest`` keeps its sign.
    noise : float, [K]
        White noise of the channel.
    """

    channel: str
    condition: str
    readings: int
    rmse: float
    mean: float
    largest: float
    noise: float

    def to_json(self) -> dict[str, Any]:
        """Plain data with units in the keys; null where nothing was read."""
        errors = {"rmse_K": self.rmse, "mean_K": self.mean, "max_K": self.largest}
        return {
            "channel": self.channel,
            "condition": self.condition,
            "readings": self.readings,
            **{key: value if np.isfinite(value) else None for key, value in errors.items()},
            "noise_K": self.noise,
        }


@dataclass(frozen=True, slots=True)
class Comparison:
    """Residuals of a prediction on a recording's grid.

    Attributes
    ----------
    residual : (N, c) float64 ndarray, [K]
        Read minus predicted; NaN where the reading is missing or flagged.
    rows : tuple of ErrorRow
        Condition "all" first for each channel, with NaN where nothing was read;
        other conditions without readings are left out.
    """

    residual: NDArray[np.float64]
    rows: tuple[ErrorRow, ...]
    conditions: Conditions

    def row(self, channel: str, condition: str = ALL) -> ErrorRow:
        """Row of the table for a channel and condition."""
        return next(row for row in self.rows if (row.channel, row.condition) == (channel, condition))


def compare(recording: Recording, predicted: NDArray[np.float64]) -> Comparison:
    """Errors of a prediction by channel and operating condition.

    Parameters
    ----------
    predicted : (N, c) ndarray, [K]
        At every stamp, for every temperature channel.

    Raises
    ------
    RecordingError
        The prediction has another shape, or is not finite.
    """
    if predicted.shape != recording.temperature.shape:
        raise RecordingError(
            recording.name,
            f"prediction of shape {predicted.shape} for readings {recording.temperature.shape}.",
        )
    if not np.all(np.isfinite(predicted)):
        raise RecordingError(recording.name, "the prediction is not finite.")
    residual = np.where(recording.usable, recording.temperature - predicted, np.nan)
    conditions = operating_conditions(recording)
    rows: list[ErrorRow] = []
    for column, channel in enumerate(recording.temperature_names):
        everywhere = np.ones(recording.times.size, dtype=bool)
        kinds = [(ALL, everywhere), *((name, conditions.of(name)) for name in conditions.names)]
        for name, marks in kinds:
            values = residual[marks, column]
            values = values[np.isfinite(values)]
            if values.size or name == ALL:
                rows.append(_error_row(channel, name, values, float(recording.sigma[column])))
    return Comparison(residual, tuple(rows), conditions)


def _error_row(channel: str, condition: str, values: NDArray[np.float64], noise: float) -> ErrorRow:
    if values.size == 0:
        return ErrorRow(channel, condition, 0, np.nan, np.nan, np.nan, noise)
    return ErrorRow(
        channel=channel,
        condition=condition,
        readings=int(values.size),
        rmse=float(np.sqrt(np.mean(values**2))),
        mean=float(values.mean()),
        largest=float(values[np.abs(values).argmax()]),
        noise=noise,
    )


def displacement_errors(recording: Recording, predicted: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Errors of displacements (N, d) [m] by channel, as ``simulation.json`` has them."""
    residual = 1e6 * (predicted - recording.displacements)
    return [
        {
            "channel": name,
            "rmse_um": float(np.sqrt(np.nanmean(column**2))),
            "max_um": float(np.nanmax(np.abs(column))),
        }
        for name, column in zip(recording.displacement_names, residual.T, strict=True)
        if np.isfinite(column).any()
    ]


def simulation_summary(comparison: Comparison) -> dict[str, Any]:
    """Content of ``simulation.json``: errors by channel, and by channel and condition."""
    overall = [row.to_json() for row in comparison.rows if row.condition == ALL]
    return {
        "schema": "spindle-fem/simulation/1",
        "channels": [{key: value for key, value in row.items() if key != "condition"} for row in overall],
        "conditions": [row.to_json() for row in comparison.rows if row.condition != ALL],
    }


def write_simulated(
    path: Path,
    recording: Recording,
    predicted: NDArray[np.float64],
    displacements: NDArray[np.float64] | None = None,
) -> None:
    """Write ``simulated.csv``: ``time_s``, temperatures in °C, displacements in µm, one column per channel.

    Parameters
    ----------
    predicted : (N, c) ndarray
        Temperatures [K], then any displacements that are among the recording's readings [µm].
    displacements : (N, d) ndarray, optional, [m]
    """
    zero = np.where(np.arange(predicted.shape[1]) < recording.temperature_count, ZERO_CELSIUS_K, 0.0)
    frame = pd.DataFrame(predicted - zero, columns=list(recording.temperature_names[: predicted.shape[1]]))
    if displacements is not None and displacements.size:
        frame[list(recording.displacement_names)] = 1e6 * displacements
    times = recording.times
    if np.all(times == np.round(times)):
        frame.insert(0, "time_s", times.astype(np.int64))
    else:
        frame.insert(0, "time_s", [f"{time:.6f}".rstrip("0").rstrip(".") for time in times])
    frame.to_csv(path, index=False, float_format="%.4f", lineterminator="\n")
