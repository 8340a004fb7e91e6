"""Numbers as text, and tables of a page from the fields that each row has."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from spindle_fem.report.block_page import Table

MISSING = "–"
YES_OR_NO = {True: "yes", False: "no", None: MISSING}


def number(value: Any, digits: int = 1) -> str:
    """Fixed-point text, a dash where there is no value.

    >>> number(3.14159, 2), number(None), number(-0.04, 1)
    ('3.14', '–', '0.0')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return MISSING
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text.replace("-", "−")


def significant(value: Any, digits: int = 3) -> str:
    """Text with significant digits, a dash where there is no value.

    >>> significant(1213.6), significant(2.6e-13, 2), significant(0.0)
    ('1210', '2.6e−13', '0')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return MISSING
    if value == 0.0:
        return "0"
    if 1.0e-3 <= abs(value) < 1.0e6:
        decimals = digits - 1 - math.floor(math.log10(abs(value)))
        text = f"{round(value, decimals):.{max(decimals, 0)}f}"
        if "." in text:
            text = text.rstrip("0").rstrip(".")
    else:
        text = f"{value:.{max(digits - 1, 1)}e}".replace("e-0", "e-").replace("e+0", "e+")
    return text.replace("-", "−")


def with_interval(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A value and the ends of its interval with as many digits as tell them apart.

    >>> with_interval(1.0084, 1.0062, 1.0113), with_interval(91.9, 34.41, 216.2)
    (('1.0084', '1.0062', '1.0113'), ('91.9', '34.4', '216'))
    """
    largest, span = max(map(abs, (value, low, high))), high - low
    digits = 3 if not 0.0 < span < largest else min(8, max(3, 2 + math.ceil(math.log10(largest / span))))
    return significant(value, digits), significant(low, digits), significant(high, digits)


def plain(name: Any) -> str:
    """Name of an effect, a place or a parameter with spaces."""
    return str(name).replace("_", " ")


def column(title: str, **kind: bool) -> dict[str, Any]:
    """Column of the table macro; ``number``, ``mark`` or ``verdict``."""
    return {"title": title, **kind}


def rows_of(cells: Any) -> list[dict[str, Any]]:
    """Rows of the table macro."""
    return [{"cells": list(row)} for row in cells]


@dataclass(frozen=True, slots=True)
class Field:
    """One column of a table and how its cells are made.

    Attributes
    ----------
    read : str or callable
        Key of the row's mapping, or a function of the row.
    write : callable
        From the value to the cell.
    kind : str
        As :func:`column` has it; empty for words.
    """

    title: str
    read: str | Callable[[Any], Any]
    write: Callable[[Any], Any]
    kind: str = ""

    @property
    def column(self) -> dict[str, Any]:
        """Column of the table macro."""
        return column(self.title, **({self.kind: True} if self.kind else {}))

    def cell(self, row: Any) -> Any:
        """Content of this column for a row."""
        return self.write(self.read(row) if callable(self.read) else row[self.read])


def _as_it_is(value: Any) -> Any:
    return "" if value is None else value


def words(title: str, read: str | Callable[[Any], Any]) -> Field:
    """Column of words; empty where there are none."""
    return Field(title, read, _as_it_is)


def whole(title: str, read: str | Callable[[Any], Any]) -> Field:
    """Column of numbers or of their texts that are shown as they are."""
    return Field(title, read, _as_it_is, "number")


def fixed(title: str, read: str | Callable[[Any], Any], digits: int = 1) -> Field:
    """Column of numbers with so many decimals."""
    return Field(title, read, lambda value: number(value, digits), "number")


def rounded(title: str, read: str | Callable[[Any], Any], digits: int = 3) -> Field:
    """Column of numbers with so many significant digits."""
    return Field(title, read, lambda value: significant(value, digits), "number")


def table_of(fields: Iterable[Field], items: Iterable[Any], caption: str = "", folded: str = "") -> Table:
    """Table with a column for each field and a row for each item.

    >>> table_of([words("probe", "name"), fixed("T / °C", "T")], [{"name": "A", "T": 31.46}]).rows
    [{'cells': ['A', '31.5']}]
    """
    shown = tuple(fields)
    rows = rows_of([field.cell(item) for field in shown] for item in items)
    return Table(tuple(field.column for field in shown), rows, caption, folded)
