"""A recording drafted from files of measuring devices: data, manifest, and what is unsure about them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import tomli_w

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.column_roles import GuessedChannel, guess_channel
from spindle_fem.recordings.long_tables import column_a_channel
from spindle_fem.recordings.manifest import RECORDING_SCHEMA, Channel, column_unit
from spindle_fem.recordings.measurement_file import (
    TEXT_SUFFIXES,
    MeasurementTable,
    read_measurement,
    unused_name,
)
from spindle_fem.recordings.numbers_in_text import decimal_sign, numbers_of
from spindle_fem.recordings.recordable_names import RecordableNames
from spindle_fem.recordings.time_columns import FoundTime, find_time

DATA_NAME, MANIFEST_NAME = "recording.csv", "recording.toml"
MOST_CELLS_NAMED = 5


@dataclass(frozen=True, slots=True)
class DraftedRecording:
    """Result of drafting a recording.

    Attributes
    ----------
    data : DataFrame
        Time first, then a column a channel; NaN where a cell held no number.
    time_unit : str or None
        None of stamps.
    found, unsure : tuple of str
        How the files are built, and what could be otherwise.
    lost_cells : tuple of str
        Filled cells that hold no number, by file, line and column; empty in ``data``.
    """

    name: str
    sources: tuple[str, ...]
    data: pd.DataFrame
    time_unit: str | None
    channels: tuple[GuessedChannel, ...]
    found: tuple[str, ...]
    unsure: tuple[str, ...]
    lost_cells: tuple[str, ...]


def draft_recording(
    files: Iterable[Path], machine: RecordableNames | None = None, *, zone: str | None = None
) -> DraftedRecording:
    """Draft one recording from one or several files.

    Files with the same columns follow one another; others are laid beside one another by their stamps.

    Parameters
    ----------
    zone : str, optional
        Time zone of stamps that state none.

    Raises
    ------
    RecordingError
        A file cannot be read or holds no times, clocks do not fit together, or no column is a temperature.
    """
    pieces = [_piece(path, zone) for path in files]
    if not pieces:
        raise RecordingError("recording draft", "no file is given.")
    clocks = {piece.time_unit for piece in pieces}
    if len(clocks) > 1:
        raise RecordingError(
            ", ".join(str(piece.path) for piece in pieces),
            "count time in different ways.",
            "Give files whose times are all stamps, or all counted in one unit.",
        )
    joined = pd.concat([piece.data for piece in pieces], ignore_index=True)
    _require_times(joined["time"], pieces)
    unsure = [text for piece in pieces for text in piece.unsure]
    if any(list(piece.data.columns) != list(pieces[0].data.columns) for piece in pieces):
        joined = joined.sort_values("time", kind="stable", ignore_index=True)
        unsure.append("files with different columns are laid beside one another by their stamps, rows sorted")
    units: dict[str, str] = {}
    for piece in pieces:
        for column, unit in piece.units.items():
            if units.setdefault(column, unit) != unit:
                raise RecordingError(
                    str(piece.path), f'column "{column}" is in {unit}, in another file in {units[column]}.'
                )
    names, taken = machine or RecordableNames(), set[str]()
    channels = [
        guess_channel(column, units.get(column, ""), joined[column].to_numpy(float), names, taken)
        for column in joined.columns[1:]
    ]
    if not any(guess.channel.role == "temperature" for guess in channels):
        raise _no_temperature(", ".join(str(piece.path) for piece in pieces), channels, names)
    return DraftedRecording(
        name=pieces[0].path.name.split(".")[0],
        sources=tuple(piece.path.name for piece in pieces),
        data=joined,
        time_unit=pieces[0].time_unit,
        channels=tuple(channels),
        found=tuple(dict.fromkeys(f"{p.path.name}: {text}" for p in pieces for text in p.found)),
        unsure=tuple(dict.fromkeys(unsure)),
        lost_cells=tuple(text for piece in pieces for text in piece.lost_cells),
    )


def _no_temperature(where: str, channels: list[GuessedChannel], machine: RecordableNames) -> RecordingError:
    """Explain what is missing if no column of a recording is read by a probe."""
    columns = ", ".join(guess.channel.column for guess in channels)
    left = [guess.channel for guess in channels if guess.channel.role == "covariate"]
    warm = ", ".join(channel.column for channel in left if channel.unit in ("degC", "degF", "K"))
    if warm:
        return RecordingError(
            where,
            f"no column could be told to be read by a probe of the machine (temperatures: {warm}; "
            f"columns: {columns}).",
            f"Name columns after probes ({', '.join(machine.probes)}), or leave --machine out: each "
            "temperature is then its own probe.",
        )
    named = (
        f"after a probe ({', '.join(machine.probes)}) or as what it is" if machine.probes else "as what it is"
    )
    return RecordingError(
        where,
        f"no column could be told to be a temperature (columns: {columns}).",
        "A temperature needs a unit ([°C] behind its name, or in a row below the names) or to be named "
        f"{named}, such as Temp 1.",
    )


def _require_times(times: pd.Series, pieces: list[_Piece]) -> None:
    """Refuse times that do not distinguish rows, citing the files that were given."""
    if times.nunique() > 1:
        return
    where = ", ".join(str(piece.path) for piece in pieces)
    columns = pieces[0].time_columns
    taken = " and ".join(f'"{name}"' for name in columns)
    what = f"column{'s' * (len(columns) > 1)} {taken} {'were' if len(columns) > 1 else 'was'} taken for "
    what += "date and clock" if len(columns) > 1 else "the time"
    if len(times) < 2 or not times.notna().any():
        number = int(times.notna().sum())
        raise RecordingError(
            where, f"has {number} row{'s' * (number != 1)} with a time ({what}).", "At least two are needed."
        )
    raise RecordingError(
        where, f"has the same time in all {len(times)} rows ({what}).", "Times must grow from row to row."
    )


@dataclass(frozen=True, slots=True)
class _Piece:
    path: Path
    time_columns: tuple[str, ...]
    data: pd.DataFrame
    time_unit: str | None
    units: dict[str, str]
    found: tuple[str, ...]
    unsure: tuple[str, ...]
    lost_cells: tuple[str, ...]


def _piece(path: Path, zone: str | None) -> _Piece:
    table = read_measurement(path)
    decimal, doubt = decimal_sign(table.cells)
    time = find_time(table.cells, table.units, decimal, zone, str(path))
    long = column_a_channel(table.cells, time.columns, decimal)
    if long is not None:
        cells, units = long
        found = (*table.found, "a row a reading: turned to a column a channel, rows counted by their times")
        table = replace(table, cells=cells, units=table.units | units, found=found)
        time = find_time(cells, table.units, decimal, zone, str(path))
    lost = [_place(table, row, " ".join(time.columns), cell) for row, cell in time.wrong]
    columns: dict[str, np.ndarray] = {"time": time.values}
    units: dict[str, str] = {}
    found, unsure = [*table.found, *time.found], [*table.unsure, *time.unsure]
    for name in table.cells.columns:
        if name in time.columns:
            continue
        values, wrong = numbers_of(table.cells[name], decimal)
        if not np.isfinite(values).any():
            found.append(f'column "{name}" holds no number and is left out')
            continue
        lost += [_place(table, row, name, cell) for row, cell in wrong]
        # names may differ in signs only, or be called time as well
        plain = unused_name(_plain_name(name), columns)
        columns[plain] = values
        if name in table.units:
            units[plain] = table.units[name]
    unsure += [doubt] if doubt else []
    found += ["decimal comma"] if decimal == "," else []
    found.insert(0, f"time from {' and '.join(time.columns)}{_of_unit(time)}")
    data = pd.DataFrame(columns)
    empty = data.isna().all(axis=1)
    return _Piece(
        path, time.columns, data[~empty], time.unit, units, tuple(found), tuple(unsure), tuple(lost)
    )


def _plain_name(name: str) -> str:
    """Name without what parts cells or lines in the data file."""
    return " ".join(re.sub(r"[\",;\t|]", " ", _one_line(name)).split()) or "column"


def _of_unit(time: FoundTime) -> str:
    return "" if time.unit is None else f" in {time.unit}"


def _place(table: MeasurementTable, row: int, column: str, cell: str) -> str:
    word = "line" if table.path.name.lower().endswith((*TEXT_SUFFIXES, ".gz")) else "row"
    return f'{table.path.name} {word} {row + table.first_line}, column {column}: "{cell}"'


def data_text(draft: DraftedRecording) -> str:
    """The data as CSV: UTF-8, comma, decimal point, ISO 8601 stamps."""
    data = draft.data
    if draft.time_unit is None:
        stamps = pd.Series(data["time"]).dt.strftime("%Y-%m-%dT%H:%M:%S.%f").str.rstrip("0").str.rstrip(".")
        data = data.assign(time=stamps)
    return data.to_csv(index=False, lineterminator="\n")


def manifest_text(draft: DraftedRecording) -> str:
    """The manifest as TOML with comments: how files were read, why each column is what, what is unsure."""
    lines = [f"# Drafted from {_one_line(', '.join(draft.sources))}. Check what is marked UNSURE."]
    lines += [f"# - {_one_line(text)}" for text in draft.found]
    lines += [f"# UNSURE: {_one_line(text)}" for text in draft.unsure]
    if draft.lost_cells:
        shown = draft.lost_cells[:MOST_CELLS_NAMED]
        lines.append(f"# {len(draft.lost_cells)} filled cells hold no number and are empty in the data:")
        lines += [f"# - {_one_line(text)}" for text in shown]
    unit = "" if draft.time_unit is None else f", unit = {_quoted(_known_time_unit(draft.time_unit))}"
    lines += [
        f"schema = {_quoted(RECORDING_SCHEMA)}",
        f"name = {_quoted(draft.name)}",
        f"data = {_quoted(DATA_NAME)}",
        f'time = {{column = "time"{unit}}}',
    ]
    for guess in draft.channels:
        lines += ["", "[[channel]]", f"# {_one_line(guess.why)}"]
        lines += [f"# UNSURE: {_one_line(guess.unsure)}"] if guess.unsure else []
        lines += _keys(guess.channel)
    return "\n".join(lines) + "\n"


def _keys(channel: Channel) -> list[str]:
    content = channel.model_dump(exclude_none=True)
    return [f"{key} = {_quoted(value)}" for key, value in content.items()]


def _known_time_unit(text: str) -> str:
    column_unit(text, "time.unit")
    return text


def _one_line(text: str) -> str:
    """Text for a comment: no line breaks nor control characters, which would end it."""
    return "".join(sign if sign.isprintable() else " " for sign in text)


def _quoted(text: str) -> str:
    return tomli_w.dumps({"x": text}).partition(" = ")[2].strip()
