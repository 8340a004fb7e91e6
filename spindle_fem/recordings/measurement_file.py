"""Files of measuring devices (text, Excel, Parquet, HDF5, TDMS): cells by column, as the file has them."""

from __future__ import annotations

import csv
import gzip
import io
import itertools
import re
import zlib
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.column_units import is_time_form, unit_of_text, without_unit

if TYPE_CHECKING:
    from nptdms import TdmsChannel

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".asc", ".dat")
EXCEL_SUFFIXES = (".xlsx", ".xlsm")
HDF5_SUFFIXES = (".h5", ".hdf5")
MEASUREMENT_SUFFIXES = (*TEXT_SUFFIXES, ".csv.gz", *EXCEL_SUFFIXES, ".parquet", *HDF5_SUFFIXES, ".tdms")
BLANKS = " "
SEPARATORS = {";": "a semicolon", "\t": "a tab", ",": "a comma", "|": "a bar", BLANKS: "blanks"}
# Lines by which a file's form is judged: beyond any preamble, and still quick.
LINES_JUDGED = 400
# Blanks occur in stamps and names too: they must fit this much better than signs.
BLANKS_COUNT = 0.7
_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)*|[.,]\d+)(?:[eE][+-]?\d+)?"
_VALUE = re.compile(rf"{_NUMBER}|[+-]?(?:nan|inf)")
# Between cells that blanks part, a date and its clock stay one, and so do their names.
_DATE = r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}(?= \d{1,2}:\d)"
_DATE_OR_NAME = re.compile(rf"(?<!\S)({_DATE}|(?:date|datum)(?= (?:time|uhrzeit|zeit)\b)) ", re.IGNORECASE)
_STAMP = re.compile(r"(?=.*\d)\d{1,4}[-./:]\d{1,2}[-./:T ]?[\d:.,TZ +\-/APMapm]*")


@dataclass(frozen=True, slots=True)
class MeasurementTable:
    """One table from a measuring device.

    Attributes
    ----------
    cells : DataFrame
        By column, in file order: text where the file holds text, otherwise numbers or stamps.
    units : dict of str to str
        By column, those that the file states.
    first_line : int
        Line or row of the file in which the first row of ``cells`` stands.
    found : tuple of str
        How the file is built, for whoever reads the draft.
    unsure : tuple of str
        What about that could be otherwise.
    """

    path: Path
    cells: pd.DataFrame
    units: dict[str, str]
    first_line: int
    found: tuple[str, ...]
    unsure: tuple[str, ...]


def read_measurement(path: Path) -> MeasurementTable:
    """Read the cells of a file, its format inferred from its suffix.

    Raises
    ------
    RecordingError
        The file cannot be read, is of no known kind, or it holds no table.
    """
    name = path.name.lower()
    if not path.is_file():
        raise RecordingError(str(path), "does not exist.", "Give a file of measurements.")
    if not name.endswith(MEASUREMENT_SUFFIXES):
        raise RecordingError(
            str(path), "is of unknown kind.", f"Allowed endings: {', '.join(MEASUREMENT_SUFFIXES)}."
        )
    if name.endswith((*TEXT_SUFFIXES, ".gz")):
        return _read_text(path)
    if name.endswith(EXCEL_SUFFIXES):
        return _read_excel(path)
    try:
        frame = _read_binary(path, name)
    except (OSError, ValueError, KeyError) as error:
        raise RecordingError(str(path), f"cannot be read ({error}).") from error
    frame.columns = pd.Index([str(item) for item in frame.columns])
    return _named(path, frame, [""] * frame.shape[1], 1, [f"{path.suffix[1:].upper()} file"], [])


def _read_binary(path: Path, name: str) -> pd.DataFrame:
    if name.endswith(".parquet"):
        frame = pd.read_parquet(path)
        return frame if isinstance(frame.index, pd.RangeIndex) else frame.reset_index()
    if name.endswith(HDF5_SUFFIXES):
        return _read_hdf5(path)
    from nptdms import TdmsFile

    columns = {}
    for group in TdmsFile.read(path).groups():
        for channel in group.channels():
            unit = channel.properties.get("unit_string", "")
            columns[f"{channel.name} [{unit}]" if unit else channel.name] = channel[:]
            if "wf_increment" in channel.properties and not columns.keys() & {"time", "time [s]"}:
                columns = {**_waveform_time(channel), **columns}
    return _of_most_common_length(path, columns)


def _waveform_time(channel: TdmsChannel) -> dict[str, np.ndarray]:
    """Times of a TDMS waveform: stamps in UTC, or seconds where it does not say when it began."""
    stated = channel.properties
    seconds = stated.get("wf_start_offset", 0.0) + stated["wf_increment"] * np.arange(len(channel))
    start = np.datetime64(stated.get("wf_start_time", 0), "us")
    if start < np.datetime64("1971-01-01"):
        return {"time [s]": seconds}
    return {"time": pd.DatetimeIndex(start + (seconds * 1e6).astype("timedelta64[us]")).tz_localize("UTC")}


def _read_hdf5(path: Path) -> pd.DataFrame:
    import h5py

    found: list[tuple[str, str, np.ndarray]] = []

    def add(name: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset) or item.ndim != 1:
            return
        values = item[:]
        if values.dtype.names:
            found.extend((field, "", values[field]) for field in values.dtype.names)
            return
        unit = item.attrs.get("units", item.attrs.get("unit", ""))
        found.append((name, unit.decode() if isinstance(unit, bytes) else str(unit), values))

    with h5py.File(path, "r") as file:
        file.visititems(add)
    # Without their groups where no two are alike then.
    names = [name.rpartition("/")[2] for name, _, _ in found]
    if len(set(names)) < len(names):
        names = [name for name, _, _ in found]
    columns = {
        f"{name} [{unit}]" if unit else name: values
        for name, (_, unit, values) in zip(names, found, strict=True)
    }
    columns = {
        name: np.array([cell.decode("utf-8", "replace") for cell in values])
        if values.dtype.kind in "SO" and len(values) and isinstance(values[0], bytes)
        else values
        for name, values in columns.items()
    }
    return _of_most_common_length(path, columns)


def _of_most_common_length(path: Path, columns: dict[str, np.ndarray]) -> pd.DataFrame:
    lengths = [len(values) for values in columns.values() if len(values) > 1]
    if not lengths:
        raise RecordingError(str(path), "holds no columns of numbers.")
    usual = max(set(lengths), key=lengths.count)
    other = [name for name, values in columns.items() if len(values) not in (usual, 0, 1)]
    if other:
        raise RecordingError(
            str(path),
            f"holds columns of different lengths ({', '.join(other[:3])} beside others of {usual}).",
            "Write columns of one clock into one file and draft from several files.",
        )
    return pd.DataFrame({name: values for name, values in columns.items() if len(values) == usual})


def _read_excel(path: Path) -> MeasurementTable:
    try:
        sheets = pd.read_excel(path, sheet_name=None, header=None, engine="openpyxl", dtype=object)
    except Exception as error:  # openpyxl lets through whatever zip, XML and its own checks raise
        raise RecordingError(str(path), f"is not a readable workbook ({error}).") from error
    name = max(sheets, key=lambda key: sheets[key].size)
    rows = [[_as_text(cell) for cell in row] for row in sheets[name].to_numpy()]
    unsure = []
    if sum(sheet.size > 0 for sheet in sheets.values()) > 1:
        others = ", ".join(key for key in sheets if key != name)
        unsure.append(f'sheet "{name}" is taken, the largest; others: {others}')
    return _table(path, rows, [f'Excel sheet "{name}"'], unsure, word="row")


def _as_text(cell: object) -> str:
    if cell is None or cell is pd.NaT or (isinstance(cell, float) and np.isnan(cell)):
        return ""
    if isinstance(cell, timedelta):
        return str(cell.total_seconds())
    return cell.isoformat(sep=" ") if hasattr(cell, "hour") and hasattr(cell, "year") else str(cell)


def _read_text(path: Path) -> MeasurementTable:
    try:
        content = path.read_bytes()
        if path.name.endswith(".gz"):
            content = gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(str(path), f"cannot be read ({error}).") from error
    text, encoding, unsure = _decoded(content, path)
    lines = text.splitlines()
    separator = max(SEPARATORS, key=lambda sign: _fit(lines[:LINES_JUDGED], sign))
    try:
        rows = list(_cut(lines, separator) if separator == BLANKS else _cut(io.StringIO(text), separator))
    except csv.Error as error:
        raise RecordingError(str(path), f"is not a readable table ({error}).") from error
    if len(rows) != len(lines):
        unsure.append("quoted cells run over several lines: numbers of lines count rows of the table")
    found = [f"{encoding} text, cells apart by {SEPARATORS[separator]}"]
    return _table(path, rows, found, unsure, word="line", needs_all_names=separator == BLANKS)


def _cut(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Cells of every line, without the blanks around them.

    >>> list(_cut(["# Date  Time   T 1", " 2026-03-11 07:58:12   20.5"], " "))
    [['Date Time', 'T', '1'], ['2026-03-11 07:58:12', '20.5']]
    """
    blanks = separator == BLANKS
    if blanks:
        lines = (_DATE_OR_NAME.sub("\\1\u00a0", " ".join(line.lstrip("#% \t").split())) for line in lines)
    rows = csv.reader(lines, delimiter=separator)
    try:
        for row in rows:
            yield [cell.replace("\u00a0", " ") if blanks else cell.strip() for cell in row]
    except csv.Error as error:
        raise RecordingError(
            f"line {rows.line_num}", f"cannot be cut into cells: {error}.", "Is a quote left open?"
        ) from error


def _decoded(content: bytes, path: Path) -> tuple[str, str, list[str]]:
    """Text, its encoding, and what is unsure about that."""
    if not content.strip():
        raise RecordingError(str(path), "is empty.")
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return _decode(content, encoding, path), encoding.removesuffix("-sig").upper(), []
    zeros = np.frombuffer(content[:4000], dtype=np.uint8) == 0
    if zeros.mean() > 0.3:  # nearly every second byte of Western text in UTF-16
        encoding = "utf-16-le" if zeros[1::2].mean() > zeros[::2].mean() else "utf-16-be"
        return _decode(content, encoding, path), encoding.upper(), []
    if zeros.any():
        line = content.count(b"\n", 0, content.find(b"\0")) + 1
        raise RecordingError(f"{path}: line {line}", "holds a zero byte: no text file.")
    try:
        return content.decode("utf-8"), "UTF-8", []
    except UnicodeDecodeError:
        doubt = "the encoding is taken as Windows-1252 (Latin-1), as Western European devices write it"
        return content.decode("cp1252", "replace"), "Windows-1252", [doubt]


def _decode(content: bytes, encoding: str, path: Path) -> str:
    try:
        return content.decode(encoding).removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        raise RecordingError(str(path), f"is not {encoding} text to its end ({error.reason}).") from error


def _fit(lines: list[str], separator: str) -> float:
    """Share of cells that are numbers or stamps when lines are split at a separator."""
    rows = [row for row in _cut(lines, separator) if len(row) > 1]
    if not rows:
        return 0.0
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    cells = [cell for row in rows if len(row) == usual for cell in row]
    # of rows of one width, by the share of lines that have it
    fit = sum(map(_is_value, cells)) / len(cells) * widths.count(usual) / len(lines)
    return fit * BLANKS_COUNT if separator == BLANKS else fit


def _is_value(cell: str) -> bool:
    return bool(_VALUE.fullmatch(cell.lower()) or _STAMP.fullmatch(cell))


def _table(
    path: Path,
    rows: list[list[str]],
    found: list[str],
    unsure: list[str],
    *,
    word: str,
    needs_all_names: bool = False,
) -> MeasurementTable:
    """Preamble, names, units and cells of rows of text."""
    body = _first_of_body(rows)
    if body is None:
        raise RecordingError(
            str(path), "holds no table of numbers.", "Rows of numbers and stamps are needed."
        )
    widths = [len(row) for row in rows[body:] if any(row)]
    width = max(set(widths), key=widths.count)
    heading = [number for number in range(body) if sum(bool(cell) for cell in rows[number]) > width / 2]
    unit_rows = [n for n in heading if _holds_units(rows[n])]
    named = [number for number in heading if number not in unit_rows]
    if not named:  # letters such as t, n, T are units too, and names where nothing else is
        named, unit_rows = unit_rows[:1], unit_rows[1:]
    if needs_all_names and named and len(rows[named[-1]]) != width:
        raise RecordingError(
            f"{path}: {word} {named[-1] + 1}",
            f"names {len(rows[named[-1]])} columns, rows have {width} cells apart by blanks.",
            "Write names without blanks or in quotes, or part cells by tabs or semicolons.",
        )
    names = (rows[named[-1]] if named else []) + [""] * width
    units = (rows[unit_rows[-1]] if unit_rows else []) + [""] * width
    if not named:
        unsure.append("no row of names: columns are numbered")
    elif named[-1]:
        found.append(f"{word}s before the names, left out: {named[-1]}")
    if unit_rows:
        found.append(f"units in {word} {unit_rows[-1] + 1}")
    names = [names[i] or f"column_{i + 1}" for i in range(width)]
    whole = rows[body:]
    long = [number for number, row in enumerate(whole) if any(row[width:])]
    if long:
        raise RecordingError(
            f"{path}: {word} {long[0] + body + 1}", f"has {len(whole[long[0]])} cells, others have {width}."
        )
    short = sum(bool(row) and len(row) < width for row in whole)
    if short:
        unsure.append(f"{word}s with fewer cells than the others, the missing ones counted as empty: {short}")
    cells = pd.DataFrame([(row + [""] * width)[:width] for row in whole], columns=names, dtype=object)
    return _named(path, cells, units, body + 1, found, unsure)


def _holds_units(row: list[str]) -> bool:
    """Whether every filled cell is a unit or a format of dates or clocks."""
    filled = [cell for cell in row if cell.strip("-[]() ")]
    return all(is_time_form(cell) or unit_of_text(cell) for cell in filled)


def _first_of_body(rows: list[list[str]]) -> int | None:
    """First row from which on rows hold mostly numbers or stamps."""
    for number, row in enumerate(rows[:LINES_JUDGED]):
        filled = [cell for cell in row if cell]
        if len(filled) < 2 or sum(map(_is_value, filled)) < len(filled) / 2:
            continue
        following = [other for other in rows[number + 1 : number + 6] if any(other)]
        if sum(len(other) == len(row) for other in following) >= max(1, len(following) / 2):
            return number
    return None


def _named(
    path: Path, cells: pd.DataFrame, units: list[str], first_line: int, found: list[str], unsure: list[str]
) -> MeasurementTable:
    """Table with the units removed from its column names, which are numbered where they occur again."""
    stated, names = {}, []
    for name, cell in zip(cells.columns, units, strict=False):
        called, inside = without_unit(name)
        plain = unused_name(called, names)
        if plain != called:
            unsure.append(f'several columns are called "{called}": a later one is "{plain}"')
        names.append(plain)
        unit = unit_of_text(cell) or inside
        if unit:
            stated[plain] = unit
    cells = cells.set_axis(names, axis=1)
    return MeasurementTable(path, cells, stated, first_line, tuple(found), tuple(unsure))


def unused_name(name: str, taken: Container[str]) -> str:
    """A name, with a number behind it where it is taken.

    >>> unused_name("SP01", ("SP01", "SP01_2"))
    'SP01_3'
    """
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return name if name not in taken else next(item for item in numbered if item not in taken)
