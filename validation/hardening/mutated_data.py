"""Mutations of a recording's data: cells, columns, rows, times, and the file's form."""

from __future__ import annotations

import gzip
import io
import random
from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from .mutations import HOSTILE, spoilt_bytes

ODD_CELLS = ("", "NaN", "Fehler", "1,5", "1e400", "-inf", "0x1f", "9" * 400, "1.2.3", "12:30", "TRUE", "\x00")
ODD_CELLS = (
    *ODD_CELLS,
    "-",
    "1e308",
    "-1e308",
    "#REF!",
    "1.000,5",
    "\u0661\u0662",
    "\N{MINUS SIGN}5",
    *HOSTILE,
)
STAMPS = ("%Y-%m-%dT%H:%M:%SZ", "%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%Y-%m-%d %H:%M:%S+02:00")


@dataclass(slots=True)
class Sheet:
    """Cells as text, and the form in which they are written."""

    header: list[str]
    rows: list[list[str]]
    separator: str = ","
    encoding: str = "utf-8"
    preamble: str = ""
    end: str = "\n"

    @classmethod
    def of(cls, frame: pd.DataFrame) -> Sheet:
        """The cells of a table."""
        return cls(
            [str(name) for name in frame.columns], [[*map(str, row)] for row in frame.to_numpy().tolist()]
        )

    def content(self) -> bytes:
        """Bytes of the text file."""
        lines = [self.separator.join(line) for line in (self.header, *self.rows)]
        return (self.preamble + self.end.join(lines) + self.end).encode(self.encoding, "replace")


def _column(chance: random.Random, sheet: Sheet) -> int:
    return chance.randrange(len(sheet.header))


def odd_cells(chance: random.Random, sheet: Sheet) -> str:
    """Some cells hold what is no reading."""
    text = chance.choice(ODD_CELLS)
    for _ in range(chance.choice((1, 3, 40))):
        row = chance.choice(sheet.rows)
        row[chance.randrange(len(row))] = text
    return f"cells {text[:30]!r}"


def odd_column(chance: random.Random, sheet: Sheet) -> str:
    """A column that is empty, constant, out of scale, or gone."""
    number = _column(chance, sheet)
    kind = chance.choice(("nan", "constant", "huge", "cold", "dropped", "renamed", "twice", "decimal comma"))
    name = sheet.header[number]
    # an earlier change may have cut a row
    rows = [row for row in sheet.rows if number < len(row)]
    if kind == "dropped":
        for line in (sheet.header, *rows):
            del line[number]
    elif kind == "renamed":
        sheet.header[number] = chance.choice((*HOSTILE, name + " [degC]", "Unnamed: 0", sheet.header[0]))
    elif kind == "twice":
        for line in (sheet.header, *rows):
            line.append(line[number])
    else:
        change: dict[str, Callable[[str], str]] = {
            "nan": lambda text: "NaN",
            "constant": lambda text: "21.5",
            "huge": lambda text: text + "e12",
            "cold": lambda text: "-300",
            "decimal comma": lambda text: text.replace(".", ","),
        }
        for row in rows:
            row[number] = change[kind](row[number])
    return f"column {name} {kind}"


def odd_rows(chance: random.Random, sheet: Sheet) -> str:
    """Rows that are gone, repeated, in another order, or cut."""
    kind = chance.choice(("gap", "repeated", "reversed", "shuffled", "none", "one", "two", "short", "long"))
    place, rows = chance.randrange(len(sheet.rows)), sheet.rows
    if kind == "gap":
        del rows[place : place + chance.randint(1, len(rows))]
    elif kind == "repeated":
        rows[place:place] = [list(row) for row in rows[: chance.randint(1, len(rows))]]
    elif kind == "reversed":
        rows.reverse()
    elif kind == "shuffled":
        chance.shuffle(rows)
    elif kind in ("none", "one", "two"):
        del rows[("none", "one", "two").index(kind) :]
    elif kind == "short":
        del rows[place][1:]
    else:
        rows[place] += ["1"] * chance.choice((1, 1000))
    return f"rows {kind}"


def odd_times(chance: random.Random, sheet: Sheet) -> str:
    """Times as stamps, constant, backwards, far away, or too large for any clock."""
    kind = chance.choice((*STAMPS, "constant", "backwards", "far", "overflow", "jitter", "nan"))
    for i, row in enumerate(sheet.rows):
        if not row:
            continue
        if kind in STAMPS:
            row[0] = (pd.Timestamp("2024-03-31 01:30") + pd.Timedelta(minutes=i)).strftime(kind)
        else:
            number = {"constant": 5.0, "backwards": -60.0 * i, "far": 1e9 + 60.0 * i, "overflow": 1e19 * i}
            number |= {"jitter": chance.uniform(0.0, 7200.0), "nan": float("nan")}
            row[0] = str(number[kind])
    return f"times {kind}"


def odd_form(chance: random.Random, sheet: Sheet) -> str:
    """Another separator, encoding, end of line, or lines before the table."""
    sheet.separator = chance.choice((",", ";", "\t", "|", " ", ", "))
    sheet.encoding = chance.choice(("utf-8", "utf-16", "latin-1", "utf-8-sig", "utf-32"))
    sheet.end = chance.choice(("\n", "\r\n", "\r"))
    sheet.preamble = chance.choice(("", "Messung vom 3.4.2024\n\n", "# comment\n", "a;b;c\n1\n", "\n" * 50))
    return f"form {sheet.separator!r} {sheet.encoding} {sheet.end!r} {sheet.preamble[:12]!r}"


CHANGES = (odd_cells, odd_column, odd_rows, odd_times, odd_form)
SHARE_BYTES, SHARE_PACKED = 0.15, 0.1
MOST_CHANGES = 2


def mutated_data(chance: random.Random, frame: pd.DataFrame) -> tuple[bytes, str, list[str]]:
    """Bytes of a data file, its ending, and what was done to it."""
    if chance.random() < SHARE_PACKED:
        return _packed(chance, frame)
    sheet = Sheet.of(frame)
    done = []
    for _ in range(chance.randint(1, MOST_CHANGES)):
        if sheet.rows:
            done.append(chance.choice(CHANGES)(chance, sheet))
    content = sheet.content()
    if chance.random() < SHARE_BYTES:
        content, what = spoilt_bytes(chance, Sheet.of(frame).content())
        done = [what]
    return content, ".csv", done


def _packed(chance: random.Random, frame: pd.DataFrame) -> tuple[bytes, str, list[str]]:
    """A packed file, sound or with some bytes changed or cut off."""
    suffix = chance.choice((".csv.gz", ".parquet"))
    stream = io.BytesIO()
    if suffix == ".parquet":
        frame.to_parquet(stream, index=False)
    else:
        stream.write(gzip.compress(frame.to_csv(index=False).encode()))
    content, what = stream.getvalue(), "sound"
    kind = chance.choice(("sound", "cut", "changed", "other"))
    if kind == "cut":
        content, what = content[: chance.randrange(len(content))], "cut"
    elif kind == "changed":
        changed = bytearray(content)
        for _ in range(chance.choice((1, 20))):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        content, what = bytes(changed), "bytes changed"
    elif kind == "other":
        content, what = frame.to_csv(index=False).encode(), "of another kind than its name"
    return content, suffix, [f"{suffix} {what}"]
