"""The last rows of a recording that grows, as a recording of their own."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.align import Recording, align
from spindle_fem.recordings.manifest import Manifest, time_scale
from spindle_fem.recordings.read_data import RawTable, names_of_header, require_columns, required_columns

Array = NDArray[np.float64]

# Rows that are kept before those that are new: by them spikes, stuck sensors and noise of inputs are judged.
CONTEXT = 300
# New rows that are kept at most while they wait to be used.
MOST_WAITING = 100_000


class RecordingWindow:
    """Arriving rows of a recording's data, of which the last are kept.

    Parameters
    ----------
    manifest : Manifest
    data : Path
        Names the file in messages.
    tell : callable
        Called with messages on rows that are left out.
    warm_up : float, [s]
        While nothing was used, no row is dropped that is no older than this before the last one.

    Attributes
    ----------
    used : float, [s]
        Rows up to this time since the first row were used.
    late, unreadable : int
        Rows left out: stamped before what was used already; not of numbers.
    """

    def __init__(
        self, manifest: Manifest, data: Path, tell: Callable[[str], None], warm_up: float = 0.0
    ) -> None:
        self.manifest, self.data, self._tell, self._warm_up = manifest, data, tell, warm_up
        self.used, self.late, self.unreadable = -np.inf, 0, 0
        self._names: list[str] = []
        self._separator, self._header = ",", b""
        self._wanted = required_columns(manifest)
        self._scale = time_scale(manifest)
        # Clock of the file at zero seconds.
        self._origin: float | None = None
        self._rows = np.empty((0, len(self._wanted)))
        # Last reading of every column among the rows that are gone.
        self._last = np.full(len(self._wanted), np.nan)

    def add(self, lines: Sequence[bytes]) -> None:
        """Take whole lines, the header first; a header that comes again is passed over.

        Raises
        ------
        RecordingError
            The header lacks a column, or another one follows.
        """
        found = []
        for line in lines:
            if not line.strip() or line == self._header:
                continue
            if not self._header:
                self._begin(line)
                continue
            row = self._row(line)
            if row is None:
                self.unreadable += 1
                if self.unreadable == 1:
                    self._tell(f"{self.data}: a row is not of numbers and left out: {line[:80]!r}")
            elif row[0] <= self.used:
                self.late += 1
                if self.late == 1:
                    self._tell(f"{self.data}: a row is stamped before what was used already and left out")
            else:
                found.append(row)
        if found:
            # Older rows only, however many come at once: these have not been looked at yet.
            self._rows = np.vstack((self._rows[self._droppable() :], found))

    def _droppable(self) -> int:
        """How many of the first rows are too many while they wait to be used."""
        too_many = max(0, len(self._rows) - CONTEXT - MOST_WAITING)
        if too_many and not np.isfinite(self.used):
            times = self._rows[:, 0]
            return min(too_many, int(np.argmax(times >= times.max() - self._warm_up)))
        return too_many

    def _begin(self, line: bytes) -> None:
        try:
            header = line.removeprefix(b"\xef\xbb\xbf").decode("utf-8")
        except UnicodeDecodeError as error:
            raise RecordingError(f"{self.data}: line 1", "is not UTF-8 text.") from error
        self._names, self._separator = names_of_header(header)
        require_columns(self.data, self.manifest, self._names)
        self._header = line
        self._columns = [self._names.index(name) for name in self._wanted]

    def _row(self, line: bytes) -> list[float] | None:
        """Time and readings of a line; None where it cannot be read or has no time."""
        try:
            (cells,) = csv.reader([line.decode("utf-8")], delimiter=self._separator)
            if len(cells) > len(self._names):
                return None
            cells += [""] * (len(self._names) - len(cells))
            chosen = [cells[column].strip() for column in self._columns]
            time, *values = chosen
            clock = self._seconds(time)
            row = [self._number(text) for text in values]
        except (ValueError, csv.Error):
            return None
        if not np.isfinite(clock):
            return None
        if self._origin is None:
            self._origin = clock
        return [clock - self._origin, *row]

    def _seconds(self, text: str) -> float:
        if self._scale is not None:
            return self._number(text) * self._scale
        stamp = datetime.fromisoformat(text)
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()

    def _number(self, text: str) -> float:
        if not text:
            return np.nan
        value = float(text.replace(",", ".") if self._separator != "," else text)
        return value if np.isfinite(value) else np.nan

    # ----------------------------------------------------------------- rows out
    @property
    def waiting(self) -> Array:
        """Times of the rows that were not used, in order, [s]."""
        times = self._rows[:, 0]
        return np.unique(times[times > self.used])

    def use(self, until: float) -> None:
        """Count rows up to a time as used; all but the last of them are forgotten."""
        self.used = until
        rows = self._rows[np.argsort(self._rows[:, 0], kind="stable")]
        gone = max(0, int(np.searchsorted(rows[:, 0], until, side="right")) - CONTEXT)
        for row in rows[:gone]:
            self._last = np.where(np.isfinite(row), row, self._last)
        self._rows = rows[gone:]

    def recording(self) -> Recording | None:
        """The rows that are kept; None where fewer than two have a time, or no channel has a reading.

        Inputs begin with their last reading before these rows; displacements count from their sensor's zero.
        """
        rows = self._rows.copy()
        if np.unique(rows[:, 0]).size < 2:
            return None
        first = int(np.argmin(rows[:, 0]))
        inputs = [self._wanted.index(c.column) for c in self.manifest.channel if c.role == "input"]
        for column in inputs:
            if not np.isfinite(rows[first, column]):
                rows[first, column] = self._last[column]
        table = RawTable(
            seconds=rows[:, 0],
            start=self._start(),
            first_time=0.0,
            columns=dict(zip(self._wanted[1:], rows[:, 1:].T, strict=True)),
            infinite=dict.fromkeys(self._wanted[1:], 0),
            unused_columns=(),
            blank_rows=0,
            short_rows=0,
            truncated=False,
        )
        try:
            return align(self.manifest, table, source=str(self.data), long_gap=np.inf, from_first=False)
        except RecordingError:
            return None

    def stamp(self, seconds: float) -> float | str:
        """A time since the first row as the file has them: seconds, or an ISO 8601 stamp."""
        if self._scale is not None:
            return round(seconds, 3)
        return (
            datetime.fromtimestamp(self._origin + seconds, UTC)
            .isoformat(timespec="seconds")
            .replace("+00:00", "Z")
        )

    def _start(self) -> str | None:
        if self._scale is not None:
            return None
        return datetime.fromtimestamp(self._origin, UTC).isoformat().replace("+00:00", "Z")


def piece_of(recording: Recording, begin: int, stop: int) -> Recording:
    """The rows ``begin <= k < stop`` as one stretch without a long gap, inputs bridged as each is held."""
    rows = slice(begin, stop)
    times = recording.times[rows]
    inputs = [recording.input_at(name, times) for name in recording.input_names]
    return replace(
        recording,
        times=times,
        temperature=recording.temperature[rows],
        flags=recording.flags[rows],
        inputs=np.column_stack(inputs) if inputs else recording.inputs[rows],
        covariates=recording.covariates[rows],
        displacements=recording.displacements[rows],
        segments=np.array([[0, stop - begin]], dtype=np.int64),
        whole_spacing=recording.usual_spacing,
        unseen_changes=tuple(c for c in recording.unseen_changes if times[0] <= c[1] and c[2] <= times[-1]),
    )


def part_of(recording: Recording, begin: int, stop: int) -> Recording:
    """The rows ``begin <= k < stop``, with their long gaps."""
    within = np.clip(recording.segments, begin, stop) - begin
    return replace(piece_of(recording, begin, stop), segments=within[within[:, 1] > within[:, 0]])
