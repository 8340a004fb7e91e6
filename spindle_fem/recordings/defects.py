"""The defects of a recording, counted, as text and as plain data."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from spindle_fem.recordings.channel_checks import ChannelNoise


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without rows, [s] from the earliest stamp."""

    start: float
    end: float


@dataclass(frozen=True, slots=True)
class ChannelDefects:
    """Defects of one column; counts are readings on the grid of distinct stamps.

    Attributes
    ----------
    readings : int
        Finite values.
    empty_cells, infinite : int
        Cells of the file.
    spikes, dropouts, stuck, implausible : int
        Flagged readings, kept but not used.
    bridged : int
        Grid points of an input that its neighbours' readings fill by ``hold``.
    noise : ChannelNoise
        Measured, SI.
    never_changes : bool
        All of many readings are one value.
    """

    column: str
    role: str
    readings: int
    empty_cells: int
    infinite: int
    longest_missing_s: float
    spikes: int
    dropouts: int
    stuck: int
    implausible: int
    bridged: int
    noise: ChannelNoise
    sigma_declared: float | None
    never_changes: bool = False

    def counts(self) -> dict[str, int]:
        """Defect counts that are not zero, by name."""
        names = ("empty_cells", "infinite", "spikes", "dropouts", "stuck", "implausible", "bridged")
        return {name: getattr(self, name) for name in names if getattr(self, name)}


@dataclass(frozen=True, slots=True)
class Thinning:
    """Summary of averaging over bins of time.

    Attributes
    ----------
    rows, bins : int
        Before and after.
    missing : int
        Means (bin and channel) with too few readings.
    readings_left_out : int
        Readings that carried a flag, or were missing, and entered no mean.
    """

    step_s: float
    rows: int
    bins: int
    missing: int
    readings_left_out: int


@dataclass(frozen=True, slots=True)
class DefectReport:
    """Everything that reading found, row by row and channel by channel.

    Attributes
    ----------
    rows, stamps : int
        Rows of the file, and distinct stamps.
    unordered_rows : int
        Rows with a stamp before one that came earlier in the file.
    repeated_rows : int
        Rows with a stamp that another row has.
    conflicting_stamps : int
        Repeated stamps whose rows disagree.
    non_uniform_steps : int
        Steps that differ from the median by more than 1 %, gaps included.
    gaps : tuple of Gap
        Steps above 1.5 medians.
    segments : int
        Stretches between gaps longer than ``long_gap_s``.
    thinned : Thinning or None
        Where the recording was averaged since; everything else is of the file.
    """

    name: str
    rows: int
    stamps: int
    duration_s: float
    rows_without_time: int
    blank_rows: int
    short_rows: int
    truncated_last_row: bool
    unordered_rows: int
    repeated_rows: int
    conflicting_stamps: int
    median_step_s: float
    non_uniform_steps: int
    gaps: tuple[Gap, ...]
    long_gap_s: float
    segments: int
    unused_columns: tuple[str, ...]
    channels: tuple[ChannelDefects, ...]
    thinned: Thinning | None = None

    def channel(self, column: str) -> ChannelDefects:
        """Defects of one column."""
        return next(item for item in self.channels if item.column == column)

    def silent(self) -> list[str]:
        """Temperature columns that never change while others do."""
        read = [item for item in self.channels if item.role == "temperature" and item.readings]
        same = [item.column for item in read if item.never_changes]
        return same if len(same) < len(read) else []

    def lines(self) -> list[str]:
        """The report as lines of text."""
        text = [
            f"{self.name}: {self.rows} rows, {self.stamps} distinct stamps over "
            f"{_duration(self.duration_s)}, median step {self.median_step_s:g} s"
        ]
        rows = {
            "without time": self.rows_without_time,
            "blank": self.blank_rows,
            "with too few cells": self.short_rows,
            "broken off at the end": int(self.truncated_last_row),
            "out of order": self.unordered_rows,
            "with a repeated stamp": self.repeated_rows,
        }
        found = [f"{number} {what}" for what, number in rows.items() if number]
        if self.conflicting_stamps:
            found.append(f"{self.conflicting_stamps} stamps with different values")
        text.append("rows: " + (", ".join(found) if found else "no defect"))
        longest = max((gap.end - gap.start for gap in self.gaps), default=0.0)
        text.append(
            f"steps: {self.non_uniform_steps} not uniform, {len(self.gaps)} gap{'s' * (len(self.gaps) != 1)}"
            + (f" (longest {_duration(longest)})" if self.gaps else "")
            + f", {self.segments} segment{'s' * (self.segments != 1)}"
        )
        if self.thinned is not None:
            text.append(
                f"averaged over {self.thinned.step_s:g} s: {self.thinned.bins} bins, "
                f"{self.thinned.missing} means missing, "
                f"{self.thinned.readings_left_out} readings left out"
            )
        if self.unused_columns:
            text.append("columns not in the manifest: " + ", ".join(self.unused_columns))
        silent = self.silent()
        for item in self.channels:
            found = [f"{number} {name.replace('_', ' ')}" for name, number in item.counts().items()]
            found += ["never changes while other sensors do"] if item.column in silent else []
            counts = ", ".join(found)
            noise = ""
            if item.role == "temperature":
                noise = f"; noise {item.noise.white:.3g} K"
                if item.noise.resolution:
                    noise += f", resolution {item.noise.resolution:g} K"
                if item.noise.coarse_step > 10.0 * item.noise.resolution:
                    noise += f" (half of the readings in steps of {item.noise.coarse_step:g} K)"
            text.append(f"{item.column}: {counts or 'no defect'}{noise}")
        return text

    def to_json(self) -> dict[str, Any]:
        """Plain data; what could not be measured is null."""
        content: dict[str, Any] = {name: getattr(self, name) for name in _PLAIN}
        silent = self.silent()
        content["gaps"] = [{"start_s": gap.start, "end_s": gap.end} for gap in self.gaps]
        content["unused_columns"] = list(self.unused_columns)
        content["thinned"] = None if self.thinned is None else asdict(self.thinned)
        content["channels"] = [
            {
                "channel": item.column,
                "role": item.role,
                "readings": item.readings,
                "longest_missing_s": item.longest_missing_s,
                **item.counts(),
                **({"never_changes": True} if item.column in silent else {}),
                "noise": _finite(item.noise.white),
                "slow_error": _finite(item.noise.slow),
                "resolution": item.noise.resolution,
                "coarse_step": item.noise.coarse_step,
                "sigma_declared": item.sigma_declared,
            }
            for item in self.channels
        ]
        return content


_PLAIN = (
    "name",
    "rows",
    "stamps",
    "duration_s",
    "rows_without_time",
    "blank_rows",
    "short_rows",
    "truncated_last_row",
    "unordered_rows",
    "repeated_rows",
    "conflicting_stamps",
    "median_step_s",
    "non_uniform_steps",
    "long_gap_s",
    "segments",
)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _duration(seconds: float) -> str:
    if seconds < 7200.0:
        return f"{seconds:g} s"
    return f"{seconds / 3600.0:.1f} h" if seconds < 172800.0 else f"{seconds / 86400.0:.1f} days"
