"""Data files of recordings: numbers by column, or a refusal with line and column."""

from __future__ import annotations

import csv
import gzip
import io
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from spindle_fem.errors import MissingColumnError, RecordingError, did_you_mean
from spindle_fem.recordings.manifest import DATA_SUFFIXES, Manifest, time_scale
from spindle_fem.recordings.numbers_in_text import decimal_sign, numbers_of

MAX_LISTED_CELLS = 5
# Bytes by which a text file's decimal sign is judged.
LENGTH_JUDGED = 20_000
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


@dataclass(frozen=True, slots=True)
class RawTable:
    """A file's columns in file order, still in their own units.

    Attributes
    ----------
    seconds : (n_rows,) float64 ndarray, [s]
        From the earliest stamp; NaN where a row has none.
    start : str or None
        ISO 8601 stamp of zero seconds, where the file has stamps.
    first_time : float, [s]
        Value of the time column at zero seconds (0 for stamps).
    columns : dict of str to (n_rows,) float64 ndarray
        NaN where a cell is empty.
    infinite : dict of str to int
        Cells that held an infinity; they are NaN in ``columns``.
    unused_columns : tuple of str
        In the file, not in the manifest.
    blank_rows, short_rows : int
        Lines without any cell, and lines with fewer cells than the header.
    truncated : bool
        The last line broke off in the middle; it is not among the rows.
    """

    seconds: NDArray[np.float64]
    start: str | None
    first_time: float
    columns: dict[str, NDArray[np.float64]]
    infinite: dict[str, int]
    unused_columns: tuple[str, ...]
    blank_rows: int
    short_rows: int
    truncated: bool


def read_table(data: Path, manifest: Manifest) -> RawTable:
    """Read a data file as its manifest describes it.

    Raises
    ------
    RecordingError
        The file cannot be opened or decoded, a column is missing, a cell
        holds text (each named by line and column), or no row has a time.
    """
    decimal = "."
    if data.name.endswith(".parquet"):
        frame, blank, short, truncated = _read_parquet(data, manifest), 0, 0, False
        present = [str(name) for name in frame.columns]
        first_line, word = 1, "row"
    else:
        frame, present, decimal, blank, short, truncated = _read_csv(data, manifest)
        first_line, word = 2, "line"
    seconds, start, first_time = _read_time(
        frame[manifest.time.column], manifest, data, decimal, (word, first_line)
    )
    faults: list[str] = []
    columns, infinite = {}, {}
    for channel in manifest.channel:
        values, wrong = _numbers(frame[channel.column], decimal)
        faults += [f'{word} {row + first_line} column {channel.column} holds "{cell}"' for row, cell in wrong]
        beyond = np.isinf(values)
        infinite[channel.column] = int(beyond.sum())
        columns[channel.column] = np.where(beyond, np.nan, values)
    if faults:
        listed = "; ".join(faults[:MAX_LISTED_CELLS])
        more = f"; and {len(faults) - MAX_LISTED_CELLS} more" if len(faults) > MAX_LISTED_CELLS else ""
        raise RecordingError(str(data), f"{listed}{more}.", "Allowed: a number, an empty cell or NaN.")
    described = {manifest.time.column, *columns}
    return RawTable(
        seconds=seconds,
        start=start,
        first_time=first_time,
        columns=columns,
        infinite=infinite,
        unused_columns=tuple(name for name in present if name not in described),
        blank_rows=blank,
        short_rows=short,
        truncated=truncated,
    )


def required_columns(manifest: Manifest) -> list[str]:
    """Columns that a manifest names."""
    return [manifest.time.column, *(channel.column for channel in manifest.channel)]


def require_columns(data: Path, manifest: Manifest, present: list[str]) -> None:
    """Refuse a header without a column that the manifest names, or with one of them twice."""
    missing = [name for name in required_columns(manifest) if name not in present]
    if missing:
        listing = ", ".join(f'"{name}"' for name in missing)
        raise MissingColumnError(
            f"{data}: line 1" if not data.name.endswith(".parquet") else str(data),
            f"has no column {listing}.",
            did_you_mean(missing[0], present),
        )
    twice = [name for name in required_columns(manifest) if present.count(name) > 1]
    if twice:
        raise RecordingError(f"{data}: line 1", f'names the column "{twice[0]}" twice.')


def columns_of(data: Path) -> list[str] | None:
    """Columns that a data file names, None where it cannot be read or is of another kind."""
    if not data.is_file() or not data.name.endswith(DATA_SUFFIXES):
        return None
    try:
        if data.name.endswith(".parquet"):
            return [str(name) for name in pd.read_parquet(data).reset_index().columns]
        return names_of_header(_bytes(data).partition(b"\n")[0].decode("utf-8"))[0]
    except (RecordingError, OSError, ValueError, ImportError):
        return None


def _read_parquet(data: Path, manifest: Manifest) -> pd.DataFrame:
    try:
        frame = pd.read_parquet(data)
    except (OSError, ValueError, ImportError) as error:  # pyarrow's errors derive from ValueError and OSError
        raise RecordingError(str(data), f"is not a readable parquet file ({error}).") from error
    if manifest.time.column not in frame.columns and frame.index.name == manifest.time.column:
        frame = frame.reset_index()
    require_columns(data, manifest, [str(name) for name in frame.columns])
    return frame


def _read_csv(data: Path, manifest: Manifest) -> tuple[pd.DataFrame, list[str], str, int, int, bool]:
    content = _bytes(data)
    names, separator = names_of_header(content.partition(b"\n")[0].decode("utf-8"))
    require_columns(data, manifest, names)
    content, blank, short, truncated = _check_lines(data, content, separator, len(names))
    decimal = _decimal(content, separator, names, manifest)
    used = set(required_columns(manifest))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                io.BytesIO(content),
                sep=separator,
                decimal=decimal,
                header=0,
                names=names,
                usecols=lambda name: name in used,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, pd.errors.EmptyDataError, ValueError) as error:
        raise RecordingError(str(data), f"is not a readable table ({error}).") from error
    return frame, names, decimal, blank, short, truncated


def names_of_header(header: str) -> tuple[list[str], str]:
    """Columns that a first line names, and what separates its cells.

    >>> names_of_header('time;"SP01"')
    (['time', 'SP01'], ';')
    """
    separator = max(SEPARATORS, key=header.count)
    return [name.strip().strip('"') for name in header.split(separator)], separator


def _bytes(data: Path) -> bytes:
    """The decoded bytes of a text file, without byte-order mark, its lines ended as on Unix."""
    try:
        content = data.read_bytes()
        if data.name.endswith(".gz"):
            content = gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(str(data), f"cannot be read ({error}).") from error
    content = content.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not content.strip():
        raise RecordingError(str(data), "is empty.")
    zero = content.find(b"\0")
    if zero >= 0:
        line = content.count(b"\n", 0, zero) + 1
        raise RecordingError(f"{data}: line {line}", "holds a zero byte.")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            f"{data}: line {line}", "is not UTF-8 text.", "Save the file as UTF-8."
        ) from error
    return content


def _check_lines(data: Path, content: bytes, separator: str, expected: int) -> tuple[bytes, int, int, bool]:
    """Count cells of each line; pandas would shift or fill uneven lines in silence."""
    ended = content.endswith(b"\n")
    content = content.rstrip(b"\n") + b"\n"
    codes = np.frombuffer(content, dtype=np.uint8)
    ends = np.flatnonzero(codes == ord("\n"))
    starts = np.concatenate([[0], ends[:-1] + 1])
    blank = ends == starts
    if b'"' in content:
        cells = _quoted_cells(data, content, separator, ends.size)
    else:
        separators = np.flatnonzero(codes == ord(separator))
        cells = np.searchsorted(separators, ends) - np.searchsorted(separators, starts) + 1
    long = np.flatnonzero(cells > expected)
    if long.size:
        raise RecordingError(
            f"{data}: line {long[0] + 1}", f"has {cells[long[0]]} cells, the header names {expected}."
        )
    short = (cells < expected) & ~blank
    truncated = bool(not ended and short[-1])
    if truncated:  # the last number of a line that broke off cannot be trusted
        content = content[: starts[-1]]
        short[-1] = False
    return content, int(blank.sum()), int(short.sum()), truncated


def _quoted_cells(data: Path, content: bytes, separator: str, lines: int) -> NDArray[np.int64]:
    """Cells of each line where quotes may hide separators."""
    try:
        cells = [len(row) for row in csv.reader(io.StringIO(content.decode("utf-8")), delimiter=separator)]
    except csv.Error as error:
        raise RecordingError(str(data), f"is not a readable table ({error}).") from error
    if len(cells) != lines:
        raise RecordingError(str(data), "has a quoted cell that runs over several lines.")
    return np.maximum(np.array(cells, dtype=np.int64), 1)


def _decimal(content: bytes, separator: str, names: list[str], manifest: Manifest) -> str:
    """Decimal sign of the channels, judged by the first rows; stamps may have a sign of their own."""
    end = content.find(b"\n", LENGTH_JUDGED)
    rows = csv.reader(
        io.StringIO(content[: None if end < 0 else end].decode("utf-8")), delimiter=separator, strict=False
    )
    columns = [names.index(channel.column) for channel in manifest.channel]
    try:
        cells = [[row[at].strip() for at in columns] for row in rows if len(row) == len(names)]
    except csv.Error as error:  # a cell beyond the reader's limit
        raise RecordingError(
            f"{manifest.data}: line {rows.line_num}", f"cannot be read ({error})."
        ) from error
    sign, doubt = decimal_sign(pd.DataFrame(cells[1:], columns=columns, dtype=object))
    # where commas part cells, "1,234" is as well a thousand: such cells are refused, not guessed at
    return "." if doubt and separator == "," else sign


def _numbers(column: pd.Series, decimal: str) -> tuple[NDArray[np.float64], tuple[tuple[int, str], ...]]:
    """Numbers of a column, and the rows whose cell is filled and no number, with the cell."""
    if pd.api.types.is_bool_dtype(column.dtype) or column.dtype.kind in "mM":
        return np.full(len(column), np.nan), ((0, str(column.iloc[0])),)
    return numbers_of(column, decimal, groups=False)


def _read_time(
    column: pd.Series, manifest: Manifest, data: Path, decimal: str, rows_from: tuple[str, int]
) -> tuple[NDArray[np.float64], str | None, float]:
    scale = time_scale(manifest)
    name = manifest.time.column
    word, first_line = rows_from
    if column.dtype.kind == "m":  # durations carry their own unit
        column, scale = column.dt.total_seconds(), 1.0
    if scale is not None:
        values, wrong = _numbers(column, decimal)
        if wrong:
            row, cell = wrong[0]
            raise RecordingError(
                f"{data}: {word} {row + first_line} column {name}",
                f'holds "{cell}", not a number of {manifest.time.unit}.',
                "Leave time.unit out where the column holds ISO 8601 stamps.",
            )
        values = np.where(np.isfinite(values), values, np.nan) * scale
        earliest = _earliest(values, data, name)
        return values - earliest, None, earliest
    if pd.api.types.is_numeric_dtype(column.dtype) and not column.isna().all():
        raise RecordingError(
            f"{data}: {word} {first_line} column {name}",
            f"holds the number {column.iloc[0]}.",
            'Give time.unit, such as "s", or ISO 8601 stamps.',
        )
    stamps = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
    blank = column.isna().to_numpy()
    if not pd.api.types.is_datetime64_any_dtype(column.dtype):
        blank = blank | (column.astype(str).str.strip() == "").to_numpy()
    wrong = np.flatnonzero(stamps.isna().to_numpy() & ~blank)
    if wrong.size:
        raise RecordingError(
            f"{data}: {word} {wrong[0] + first_line} column {name}",
            f'holds "{column.iloc[wrong[0]]}".',
            "Allowed: ISO 8601 stamps such as 2016-05-02T12:41:30Z.",
        )
    present = stamps.notna().to_numpy()
    # microseconds are exact in a float over decades when counted from the start
    counts = stamps.dt.as_unit("us").astype("int64").to_numpy()
    values = np.full(len(counts), np.nan)
    if present.any():
        values[present] = (counts[present] - counts[present].min()) * 1.0e-6
    _earliest(values, data, name)
    start = stamps.min().isoformat().replace("+00:00", "Z")
    return values, start, 0.0


def _earliest(values: NDArray[np.float64], data: Path, name: str) -> float:
    present = values[np.isfinite(values)]
    if present.size > 1 and np.ptp(present) == 0.0:
        raise RecordingError(
            str(data),
            f'has the same time in all {present.size} rows of column "{name}".',
            "Name the column whose times grow.",
        )
    if present.size < 2:
        raise RecordingError(
            str(data),
            f'has {present.size} row{"s" * (present.size != 1)} with a time in column "{name}".',
            "At least two times are needed.",
        )
    return float(present.min())
