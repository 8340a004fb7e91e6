"""Numbers in cells of text: decimal comma or point, digits in groups, words for nothing."""

from __future__ import annotations

import numpy as np
import pandas as pd

# Words that devices and spreadsheets write where they have no reading.
EMPTY_WORDS = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "--", "---", "nat"})
_SIGNS = {",": ".", ".": ","}


def decimal_sign(cells: pd.DataFrame) -> tuple[str, str]:
    """Decimal sign of a table's texts, and what is unsure about it (empty where nothing is).

    A sign before three digits may part groups of a thousand; one before any other number of digits cannot.

    >>> decimal_sign(pd.DataFrame({"speed": ["3,000"], "SP01": ["21.5"]}))
    ('.', '')
    """
    texts = [_text(cells[name]) for name in cells.columns if _is_text(cells[name])]
    if not texts:
        return ".", ""
    text = pd.concat(texts)
    certain = {sign: int(text.str.match(rf"^[+-]?\d*[{sign}](?:\d{{1,2}}|\d{{4,}})$").sum()) for sign in ",."}
    three = {sign: int(text.str.match(rf"^[+-]?\d{{1,3}}[{sign}]\d{{3}}$").sum()) for sign in ",."}
    if certain[","] or certain["."]:
        return (",", "") if certain[","] > certain["."] else (".", "")
    if three[","] and not three["."]:
        return ",", "numbers such as 1,234 are read with a decimal comma: no other number tells"
    return ".", ""


def numbers_of(
    column: pd.Series, decimal: str = ".", *, groups: bool = True
) -> tuple[np.ndarray, tuple[tuple[int, str], ...]]:
    """Numbers of a column, and the rows whose cell is filled and no number, with the cell.

    Parameters
    ----------
    decimal : str
        Sign before the decimals.
    groups : bool
        Whether the other sign may part groups of three digits; a cell in which it could is no number
        otherwise.

    >>> numbers_of(pd.Series(["21,5", "Fehler", ""]), ",")
    (array([21.5,  nan,  nan]), ((1, 'Fehler'),))
    >>> numbers_of(pd.Series(["3,000", "12.5"]))[0]
    array([3000. ,   12.5])
    >>> numbers_of(pd.Series(["3,000", "12.5"]), groups=False)[1]
    ((0, '3,000'),)
    """
    if pd.api.types.is_bool_dtype(column.dtype):
        return column.to_numpy(dtype=float), ()
    if pd.api.types.is_numeric_dtype(column.dtype):
        return column.to_numpy(dtype=float, na_value=np.nan), ()
    text = _text(column)
    empty = text.str.lower().isin(EMPTY_WORDS)
    group = _SIGNS[decimal]
    grouped = text.str.match(rf"^[+-]?\d{{1,3}}(?:[{group}]\d{{3}})+(?:[{decimal}]\d*)?$")
    plain = text.where(~grouped, text.str.replace(group, "") if groups else "")
    # the other sign where it cannot part groups is a decimal sign as well: devices mix them
    values = pd.to_numeric(plain.str.replace(",", "."), errors="coerce").where(~empty).to_numpy(float)
    wrong = np.flatnonzero(np.isnan(values) & ~empty.to_numpy())
    return values, tuple((int(row), str(column.iloc[row])) for row in wrong)


def _is_text(column: pd.Series) -> bool:
    return not (
        pd.api.types.is_numeric_dtype(column.dtype) or pd.api.types.is_datetime64_any_dtype(column.dtype)
    )


def _text(column: pd.Series) -> pd.Series:
    """Cells as text without blanks, no-break blanks, or typographic minus signs."""
    text = column.astype(str).str.strip().str.replace("\u00a0", "").str.replace("\u2212", "-")
    return text.where(column.notna(), "")
