"""A recording on one time grid: temperatures, inputs, flags, noise, segments."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import FaultsError, MissingColumnError, RecordingError, did_you_mean
from spindle_fem.recordings.channel_checks import (
    ChannelNoise,
    Flag,
    channel_noise,
    longest_run,
    never_changes,
    resolution,
    stale_readings,
    temperature_flags,
)
from spindle_fem.recordings.defects import ChannelDefects, DefectReport, Gap
from spindle_fem.recordings.faults_beside import faults_beside, manifest_for
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.recordings.manifest import (
    Channel,
    ColumnUnit,
    Manifest,
    conversions,
    find_manifest,
)
from spindle_fem.recordings.read_data import RawTable, read_table
from spindle_fem.recordings.recordable_names import RecordableNames
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import PLAUSIBLE_KELVIN

Array = NDArray[np.float64]

# A distance of stamps above this many usual ones is a gap.
GAP_STEPS = 1.5
UNIFORM_TOLERANCE = 0.01
# A pause longer than both divides a recording.
LONG_GAP_SECONDS, LONG_GAP_STEPS = 1800.0, 60.0
# Four years, longer than machines are logged in one piece: at one step a minute two million steps are kept,
# and a wrong stamp would need more memory than any computer has.
LONGEST_SECONDS = 4.0 * 366.0 * 86400.0
# Least noise of a channel that declares none, K: no sensor on a machine is better than a millikelvin.
SMALLEST_SIGMA = 1.0e-3
# Smallest sigma of a displacement, m: resolution of the best capacitive probes.
SMALLEST_DISPLACEMENT_SIGMA = 1.0e-8


@dataclass(frozen=True, slots=True)
class Recording:
    """Measured data at every distinct stamp, in order.

    Attributes
    ----------
    source : str
        Manifest file.
    start : str or None
        ISO 8601 stamp of zero seconds.
    times : (N,) float64 ndarray, [s]
        From the earliest stamp, strictly increasing.
    temperature_names : tuple of str
        Columns, as ``simulated.csv`` names them.
    probes : tuple of str
        Probe or network node of each.
    temperature : (N, c) float64 ndarray, [K]
        As read; NaN where missing. Flagged readings are kept.
    flags : (N, c) uint8 ndarray
        :class:`~spindle_fem.recordings.channel_checks.Flag`; 0 is a reading to use.
    sigma : (c,) float64 ndarray, [K]
        Declared white noise, measured where none is declared.
    noise : tuple of ChannelNoise
        Measured, of each temperature channel.
    input_names, input_columns : tuple of str
        What each input drives, and its column.
    inputs : (N, m) float64 ndarray
        SI; NaN where missing or flagged.
    held : (m,) bool ndarray
        True: holds until the next reading; False: straight line.
    input_units : tuple of str
        SI base units.
    covariates : (N, k) float64 ndarray
        SI.
    covariate_units : tuple of str
        SI base units.
    segments : (S, 2) int64 ndarray
        Start and stop of the stretches between long gaps.
    unseen_changes : tuple of (input, float, float), [s]
        Readings between which a held input changed while others were read in between; set by
        a diagnosis.
    whole_spacing : float or None, [s]
        Usual distance of the rows of which these are a piece.
    displacement_names, displacement_sensors : tuple of str
        Columns, and the sensor of the machine of each.
    displacements : (N, d) float64 ndarray, [m]
        From each one's first reading; NaN where missing.
    displacement_sigma : (d,) float64 ndarray, [m]
        Declared white noise, measured where none is declared.
    displacement_noise : tuple of ChannelNoise
    """

    name: str
    source: str
    start: str | None
    times: Array
    temperature_names: tuple[str, ...]
    probes: tuple[str, ...]
    temperature: Array
    flags: NDArray[np.uint8]
    sigma: Array
    noise: tuple[ChannelNoise, ...]
    input_names: tuple[str, ...]
    input_columns: tuple[str, ...]
    inputs: Array
    held: NDArray[np.bool_]
    input_units: tuple[str, ...]
    covariate_names: tuple[str, ...]
    covariates: Array
    covariate_units: tuple[str, ...]
    segments: NDArray[np.int64]
    defects: DefectReport
    displacement_names: tuple[str, ...] = ()
    displacement_sensors: tuple[str, ...] = ()
    displacements: Array = field(default_factory=lambda: np.empty((0, 0)))
    displacement_sigma: Array = field(default_factory=lambda: np.empty(0))
    displacement_noise: tuple[ChannelNoise, ...] = ()
    unseen_changes: tuple[tuple[str, float, float], ...] = ()
    whole_spacing: float | None = None

    @property
    def usual_spacing(self) -> float:
        """Usual distance of two rows, s: of the whole where these are a piece of it."""
        return self.whole_spacing or float(np.median(np.diff(self.times)))

    @property
    def temperature_count(self) -> int:
        """Leading columns of the readings that are temperatures; any others are displacements, in µm."""
        return sum(name not in self.displacement_names for name in self.temperature_names)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Readings that carry no flag, ``(N, c)``."""
        return self.flags == 0

    def input_at(self, name: str, times: Array) -> Array:
        """An input at any times, held or on a straight line between its readings.

        Parameters
        ----------
        name : str
            What it drives.
        times : (n,) ndarray, [s]

        Returns
        -------
        (n,) ndarray
            SI. Before the first reading: the first; after the last: the last.

        Raises
        ------
        RecordingError
            No channel drives it.
        """
        if name not in self.input_names:
            raise RecordingError(
                self.source, f'no channel drives "{name}".', did_you_mean(name, self.input_names)
            )
        column = self.input_names.index(name)
        present = np.isfinite(self.inputs[:, column])
        at, values = self.times[present], self.inputs[present, column]
        if self.held[column]:
            return values[np.maximum(np.searchsorted(at, times, side="right") - 1, 0)]
        return np.interp(times, at, values)

    def input_history(self, names: tuple[str, ...] | None = None) -> InputHistory:
        """Inputs on the recording's own grid, gaps bridged according to each input's ``hold``."""
        chosen = self.input_names if names is None else names
        values = np.empty((self.times.size, len(chosen)))
        for position, name in enumerate(chosen):
            values[:, position] = self.input_at(name, self.times)
        held = np.array([self.held[self.input_names.index(name)] for name in chosen], dtype=bool)
        return InputHistory(self.times, tuple(chosen), values, held)

    def covariate_history(self) -> dict[str, Array]:
        """Covariates that have readings, (N,) each by column, on straight lines between these."""
        found = {}
        for name, values in zip(self.covariate_names, self.covariates.T, strict=True):
            present = np.isfinite(values)
            if present.any():
                found[name] = np.interp(self.times, self.times[present], values[present])
        return found

    def first_readings(self, segment: int = 0) -> dict[str, float]:
        """First usable reading, [K], of each probe in a segment."""
        begin, end = self.segments[segment]
        first: dict[str, float] = {}
        for column, probe in enumerate(self.probes):
            rows = np.flatnonzero(self.usable[begin:end, column])
            if rows.size:
                first.setdefault(probe, float(self.temperature[begin + rows[0], column]))
        return first

    def stamps(self, seconds: Array) -> list[str | float]:
        """ISO 8601 stamps of times where the recording has stamps, else the times."""
        if self.start is None:
            return [float(second) for second in np.atleast_1d(seconds)]
        origin = np.datetime64(self.start.removesuffix("Z"), "us")
        offsets = np.round(np.atleast_1d(seconds) * 1.0e6).astype("timedelta64[us]")
        return [str(np.datetime_as_string(origin + offset, unit="s")) + "Z" for offset in offsets]


def read_recording(
    path: str | Path,
    *,
    long_gap: float | None = None,
    names: Callable[[], RecordableNames] | None = None,
) -> Recording:
    """Read a recording and find its defects.

    Parameters
    ----------
    path : str or Path
        Folder or manifest file.
    long_gap : float, optional, [s]
        Gaps longer than this begin a new segment, in which a network starts
        again from its readings. Default: half an hour or 60 median steps,
        whichever is longer.
    names : callable, optional
        Names of the machine, to report unknown ones beside a manifest's other faults.

    Raises
    ------
    FaultsError
        The manifest, every fault at once, with the columns that its data do not have.
    RecordingError
        The data cannot be used: file, line and column.
    """
    manifest, data = manifest_for(path, names)
    try:
        table = read_table(data, manifest)
    except MissingColumnError as error:
        beside = faults_beside(path, names)
        if len(beside) > 1:
            raise FaultsError(str(find_manifest(path)), beside) from error
        raise
    return align(manifest, table, source=str(path), long_gap=long_gap)


def _require_length(times: Array, source: str) -> None:
    length = float(times[-1] - times[0]) if times.size else 0.0
    if not length <= LONGEST_SECONDS:
        raise RecordingError(
            source,
            f"lasts {length / 86400.0:.4g} days.",
            f"Allowed: {LONGEST_SECONDS / 86400.0:.0f} days; is one stamp wrong, or the unit of the time?",
        )


def align(
    manifest: Manifest,
    table: RawTable,
    *,
    source: str,
    long_gap: float | None = None,
    from_first: bool = True,
) -> Recording:
    """Put a raw table on its grid of distinct stamps and flag its defects.

    Repeated stamps are merged: means of what they read, the last value of an
    input that is held. Displacements count from their first reading, or else from the sensor's own zero,
    which is the same in rows of one file that are read apart.
    """
    grid = _Grid(table.seconds)
    units = conversions(manifest)
    by_role: dict[str, list[Channel]] = defaultdict(list)
    for channel in manifest.channel:
        by_role[channel.role].append(channel)
    times = grid.times
    _require_length(times, source)
    merged = {
        channel.column: grid.merge(
            table.columns[channel.column], last=channel.role == "input" and channel.hold == "previous"
        )
        for channel in manifest.channel
    }
    silent = [np.isnan(merged[channel.column]) for channel in by_role["input"]]
    inputs_missing = np.logical_and.reduce(silent) if silent else np.zeros(times.size, dtype=bool)
    aligned: dict[str, Array] = {}
    defects: list[ChannelDefects] = []
    noises: dict[str, ChannelNoise] = {}
    flags: dict[str, NDArray[np.uint8]] = {}
    for channel in manifest.channel:
        column, unit = channel.column, units[channel.column]
        values = merged[column] * unit.scale + unit.offset
        marked, noise = _checked(channel, unit, merged[column], values, times, inputs_missing)
        aligned[column], flags[column], noises[column] = values, marked, noise
        defects.append(_channel_defects(channel, values, marked, noise, times, table))
        if channel.role == "input" and np.all(marked):
            implausible = _count(marked, Flag.IMPLAUSIBLE)
            raise RecordingError(
                source,
                f'the input column "{column}" has no reading that can be used.',
                f"{implausible} readings are outside what a sensor reads: {_plausible_text()}."
                if implausible
                else "",
            )
    temperatures = by_role["temperature"]
    if not any((flags[c.column] == 0).any() for c in temperatures):
        raise RecordingError(source, "no temperature channel has a reading that can be used.")
    inputs = by_role["input"]
    input_values = _stack([np.where(flags[c.column] == 0, aligned[c.column], np.nan) for c in inputs], times)
    report, segments = _report(manifest, table, grid, tuple(defects), long_gap)
    sigma = [c.sigma or max(noises[c.column].white, SMALLEST_SIGMA) for c in temperatures]
    displaced = by_role["displacement"]
    recording = Recording(
        name=manifest.name,
        source=source,
        start=table.start,
        times=times,
        temperature_names=tuple(c.column for c in temperatures),
        probes=tuple(str(c.probe) for c in temperatures),
        temperature=_stack([aligned[c.column] for c in temperatures], times),
        flags=np.stack([flags[c.column] for c in temperatures], axis=1),
        sigma=np.array(sigma),
        noise=tuple(noises[c.column] for c in temperatures),
        input_names=tuple(str(c.drives) for c in inputs),
        input_columns=tuple(c.column for c in inputs),
        inputs=input_values,
        held=np.array([c.hold == "previous" for c in inputs], dtype=bool),
        input_units=tuple(units[c.column].unit for c in inputs),
        covariate_names=tuple(c.column for c in by_role["covariate"]),
        covariates=_stack([aligned[c.column] for c in by_role["covariate"]], times),
        covariate_units=tuple(units[c.column].unit for c in by_role["covariate"]),
        segments=segments,
        defects=report,
        displacement_names=tuple(c.column for c in displaced),
        displacement_sensors=tuple(str(c.probe) for c in displaced),
        displacements=_stack(
            [_from_first(aligned[c.column]) if from_first else aligned[c.column] for c in displaced], times
        ),
        displacement_sigma=np.array(
            [
                c.sigma * units[c.column].scale
                if c.sigma
                else max(noises[c.column].white, SMALLEST_DISPLACEMENT_SIGMA)
                for c in displaced
            ]
        ),
        displacement_noise=tuple(noises[c.column] for c in displaced),
    )
    for array in (recording.times, recording.temperature, recording.flags, recording.inputs, recording.sigma):
        array.setflags(write=False)
    return recording


def _checked(
    channel: Channel,
    unit: ColumnUnit,
    merged: Array,
    values: Array,
    times: Array,
    inputs_missing: NDArray[np.bool_],
) -> tuple[NDArray[np.uint8], ChannelNoise]:
    """Flags and noise of one channel."""
    fine = resolution(merged) * unit.scale
    coarse = resolution(merged, share=0.5) * unit.scale
    if unit.is_temperature:
        measured = channel.role == "temperature"
        marked = temperature_flags(values, channel.sigma, fine, judge_stuck=measured)
        if measured:
            stale = stale_readings(times, values, inputs_missing, coarse)
            marked[stale] |= np.uint8(Flag.STUCK)
    else:
        marked = np.where(np.isfinite(values), 0, int(Flag.MISSING)).astype(np.uint8)
    good = marked == 0
    return marked, channel_noise(times[good], values[good], fine, coarse)


def _channel_defects(
    channel: Channel,
    values: Array,
    marked: NDArray[np.uint8],
    noise: ChannelNoise,
    times: Array,
    table: RawTable,
) -> ChannelDefects:
    infinite = table.infinite[channel.column]
    return ChannelDefects(
        column=channel.column,
        role=channel.role,
        readings=int(np.isfinite(values).sum()),
        empty_cells=int(np.isnan(table.columns[channel.column]).sum()) - infinite,
        infinite=infinite,
        longest_missing_s=longest_run(~np.isfinite(values), times),
        spikes=_count(marked, Flag.SPIKE),
        dropouts=_count(marked, Flag.DROPOUT),
        stuck=_count(marked, Flag.STUCK),
        implausible=_count(marked, Flag.IMPLAUSIBLE),
        bridged=int(np.count_nonzero(marked)) if channel.role == "input" else 0,
        noise=noise,
        sigma_declared=channel.sigma,
        never_changes=never_changes(values),
    )


def _plausible_text() -> str:
    low, high = (limit - ZERO_CELSIUS_K for limit in PLAUSIBLE_KELVIN)
    return f"{low:g} to {high:g} degC"


def _from_first(values: Array) -> Array:
    """Values less the first of them that is there."""
    known = np.flatnonzero(np.isfinite(values))
    return values - values[known[0]] if len(known) else values


def _stack(columns: list[Array], times: Array) -> Array:
    return np.stack(columns, axis=1) if columns else np.empty((times.size, 0))


def _count(marked: NDArray[np.uint8], flag: Flag) -> int:
    return int(np.count_nonzero(marked & np.uint8(flag)))


class _Grid:
    """Distinct stamps in order, and where each row of the file belongs."""

    def __init__(self, seconds: Array) -> None:
        self.timed = np.isfinite(seconds)
        stamps = seconds[self.timed]
        self.unordered = int(np.count_nonzero(stamps[1:] < np.maximum.accumulate(stamps)[:-1]))
        self.times, self.place = np.unique(stamps, return_inverse=True)
        self.repeated = stamps.size - self.times.size
        self._sorted = self.unordered == 0 and self.repeated == 0
        self.conflicting: set[int] = set()

    def merge(self, raw: Array, *, last: bool) -> Array:
        """Values on the grid from values by row."""
        values = raw[self.timed]
        if self._sorted:
            return values
        present = np.isfinite(values)
        place, values = self.place[present], values[present]
        merged = np.full(self.times.size, np.nan)
        merged[place] = values
        if self.repeated:
            self.conflicting.update(place[merged[place] != values].tolist())
            if not last:
                number = np.bincount(place, minlength=merged.size)
                several = number > 1
                total = np.bincount(place, values, merged.size)
                merged[several] = total[several] / number[several]
        return merged


def _report(
    manifest: Manifest,
    table: RawTable,
    grid: _Grid,
    channels: tuple[ChannelDefects, ...],
    long_gap: float | None,
) -> tuple[DefectReport, NDArray[np.int64]]:
    times = grid.times
    steps = np.diff(times)
    median = float(np.median(steps))
    if long_gap is None:
        long_gap = max(LONG_GAP_SECONDS, LONG_GAP_STEPS * median)
    wide = np.flatnonzero(steps > GAP_STEPS * median)
    breaks = np.flatnonzero(steps > long_gap) + 1
    edges = np.concatenate([[0], breaks, [times.size]])
    segments = np.stack([edges[:-1], edges[1:]], axis=1).astype(np.int64)
    report = DefectReport(
        name=manifest.name,
        rows=table.seconds.size,
        stamps=times.size,
        duration_s=float(times[-1]),
        rows_without_time=int((~grid.timed).sum()),
        blank_rows=table.blank_rows,
        short_rows=table.short_rows,
        truncated_last_row=table.truncated,
        unordered_rows=grid.unordered,
        repeated_rows=grid.repeated,
        conflicting_stamps=len(grid.conflicting),
        median_step_s=median,
        non_uniform_steps=int(np.count_nonzero(np.abs(steps - median) > UNIFORM_TOLERANCE * median)),
        gaps=tuple(Gap(float(times[k]), float(times[k + 1])) for k in wide),
        long_gap_s=float(long_gap),
        segments=len(segments),
        unused_columns=table.unused_columns,
        channels=channels,
    )
    return report, segments
