"""The table of a study: one row a design, safe to append to, safe to be stopped."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.errors import BadInputError

RESULTS = "results.csv"
PARQUET = "results.parquet"
EARLIER_PREFIX = "earlier_"
EARLIER = EARLIER_PREFIX + RESULTS

OK, FAILED, IMPOSSIBLE = "ok", "failed", "impossible"
STATUSES = (OK, FAILED, IMPOSSIBLE)

# Backend of a design: a solve of the whole field, or the projected model of its group.
FULL, REDUCED = "full", "reduced"
# Its mesh: made for it, or moved from that of a machine whose channel is near.
NEW, MOVED = "new", "moved"

Row = dict[str, Any]


class ResultTable:
    """Rows by key, in memory and in a CSV file, ``results.csv`` of a sweep.

    A row is written with one call and synchronised before it counts, so that a
    process may end at any moment: what is in the file is whole, but for a last
    line without its end, which is cut off on opening.

    Parameters
    ----------
    columns : sequence of str
        Of the table; ``key`` must be one of them.

    Raises
    ------
    BadInputError
        The folder holds a table with other columns, or one that is damaged.
    """

    def __init__(self, folder: Path, columns: Sequence[str], name: str = RESULTS) -> None:
        self.path = Path(folder) / name
        self.columns = tuple(columns)
        self.rows: dict[str, Row] = {}
        if self.path.exists() and self.path.stat().st_size > 0:
            self._open_again()
        else:
            self._write_line(dict(zip(self.columns, self.columns, strict=True)))

    def _open_again(self) -> None:
        whole = self._cut_unfinished_line()
        reader = csv.DictReader(io.StringIO(whole, newline=""))
        if tuple(reader.fieldnames or ()) != self.columns:
            other = sorted(set(reader.fieldnames or ()) ^ set(self.columns))
            raise BadInputError(
                str(self.path),
                f"is the table of another study: {', '.join(other) or 'the order of its columns'} differs.",
                "Give a new folder, or the study that the folder belongs to.",
            )
        for line, raw in enumerate(reader, start=2):
            if None in raw or None in raw.values() or raw["status"] not in STATUSES:
                raise BadInputError(str(self.path), f"line {line} is damaged.", "Remove that line.")
            self.rows[raw["key"]] = {name: parse_cell(text) for name, text in raw.items()}

    def _cut_unfinished_line(self) -> str:
        content = self.path.read_bytes()
        end = content.rfind(b"\n") + 1
        if end < len(content):
            with self.path.open("r+b") as stream:
                stream.truncate(end)
        return content[:end].decode("utf-8")

    def __contains__(self, key: str) -> bool:
        return key in self.rows

    def append(self, row: Row) -> None:
        """Add a row; a second one of the same key is a fault of the caller.

        Raises
        ------
        BadInputError
            The key is there already, or the row lacks columns.
        """
        if row["key"] in self.rows or set(row) != set(self.columns):
            raise BadInputError(str(self.path), f"cannot take the row {row['key']} (again).")
        self._write_line(row)
        self.rows[row["key"]] = {name: parse_cell(format_cell(row[name])) for name in self.columns}

    def _write_line(self, row: Mapping[str, Any]) -> None:
        with self.path.open("ab") as stream:
            stream.write(self._line(row))
            stream.flush()
            os.fsync(stream.fileno())

    def _line(self, row: Mapping[str, Any]) -> bytes:
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerow([format_cell(row[name]) for name in self.columns])
        return text.getvalue().encode("utf-8")

    def finish(self, order: Iterable[Row]) -> list[Row]:
        """Put the rows into their order, as CSV and parquet.

        Parameters
        ----------
        order : iterable of dict
            ``key`` of each row with the parameter columns and the number of
            its design; two designs that are the same machine share results.

        Returns
        -------
        list of dict
            Rows of the study; those of an earlier one in this folder are kept
            in ``earlier_results.csv`` (``earlier_`` and the name of the table).
        """
        final = [self.rows[head["key"]] | head for head in order]
        wanted = {row["key"] for row in final}
        dropped = [row for key, row in self.rows.items() if key not in wanted]
        heading = self._line(dict(zip(self.columns, self.columns, strict=True)))
        if dropped:
            earlier = self.path.with_name(EARLIER_PREFIX + self.path.name)
            with earlier.open("ab") as stream:
                stream.write(b"".join([heading, *map(self._line, dropped)]))
        partial = self.path.with_name(self.path.name + ".partial")
        with partial.open("wb") as stream:
            stream.write(b"".join([heading, *map(self._line, final)]))
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(partial, self.path)
        write_parquet(self.path.with_suffix(".parquet"), self.columns, final)
        return final


def read_results(folder: Path) -> list[Row]:
    """Rows of a finished study in their order.

    Raises
    ------
    BadInputError
        There is no table.
    """
    path = Path(folder) / RESULTS
    if not path.is_file():
        raise BadInputError(str(path), "there is no such file.", "Give the folder of a sweep.")
    with path.open(encoding="utf-8", newline="") as stream:
        return [{name: parse_cell(text) for name, text in raw.items()} for raw in csv.DictReader(stream)]


def format_cell(value: Any) -> str:
    """Text of a value that reads back as the same value; nothing for no value."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return " ".join(value.split())
    return repr(value)


def parse_cell(text: str) -> Any:
    """Value of a cell: nothing, a number, or text.

    >>> parse_cell("5"), parse_cell("31.25"), parse_cell(""), parse_cell("laminar")
    (5, 31.25, None, 'laminar')
    """
    if text == "":
        return None
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        return number if math.isfinite(number) and "_" not in text else text
    return text


def write_parquet(path: Path, columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Write the table with types, atomically."""
    import pandas

    frame = pandas.DataFrame([[row[name] for name in columns] for row in rows], columns=list(columns))
    for name in columns:
        if any(isinstance(value, str) for value in frame[name]):
            frame[name] = frame[name].map(lambda value: value if isinstance(value, str) else None)
    partial = path.with_name(path.name + ".partial")
    frame.to_parquet(partial, index=False)
    os.replace(partial, path)
