"""Find the time columns of a measuring file, their format, and convert them to seconds or stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.numbers_in_text import numbers_of

_DATE = r"(?P<a>\d{1,4})(?P<sign>[-./])(?P<b>\d{1,2})[-./](?P<c>\d{1,4})"
_CLOCK = r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,:](?P<part>\d{1,9}))?)?"
_HALF = r"\s*(?P<half>[AaPp][Mm])?"
# Zones by the letters that stand behind stamps. Those of two continents are taken for American, and said.
_ZONES = {"Z": "+0000", "UTC": "+0000", "GMT": "+0000", "CET": "+0100", "MEZ": "+0100", "CEST": "+0200"}
_ZONES |= {"MESZ": "+0200", "EET": "+0200", "EEST": "+0300", "EST": "-0500", "EDT": "-0400"}
_DOUBTFUL = {"EST": "UTC+10", "EDT": "UTC+11"}
_ZONE = rf"\s*(?P<zone>{'|'.join(_ZONES)}|[+-]\d{{2}}(?::?\d{{2}})?)?"
_FORM = rf"^\s*(?:{_DATE})?[T ,;]*(?:{_CLOCK})?{_HALF}{_ZONE}\s*$"
# Dates that leave no doubt which number is the month: English months, or ISO 8601 without signs between.
_IN_WORDS = r"(?i)(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec).*:|^\d{8}T\d{4}"
_MIDNIGHT = r"[T ]+00:00(?::00(?:[.,]0+)?)?\s*$"
_NAMES = ("time", "zeit", "date", "datum", "stamp", "stempel", "uhr", "temps", "tiempo", "elapsed")
# Seconds from 1970 of 2001 and 2100, between which counts of clocks are taken as stamps.
_EPOCH = (978_307_200.0, 4_102_444_800.0)
# Days from 1899-12-30 of the same years, as spreadsheets count.
_SERIAL = (36_892.0, 73_051.0)
_UNIX_DAY = 25_569.0
# Share of the filled cells that a form must explain before it is believed.
_SHARE = 0.9


@dataclass(frozen=True, slots=True)
class FoundTime:
    """Time of every row.

    Attributes
    ----------
    columns : tuple of str
        Columns of the file it was taken from.
    values : (n,) ndarray of datetime64[us], or of float64
        Stamps (UTC, or a clock without zone), or counts in ``unit``; NaT or NaN where a row has none.
    unit : str or None
        None of stamps.
    wrong : tuple of (int, str)
        Rows whose cell is filled and no time, with the cell.
    """

    columns: tuple[str, ...]
    values: np.ndarray
    unit: str | None
    found: tuple[str, ...]
    unsure: tuple[str, ...]
    wrong: tuple[tuple[int, str], ...]


def find_time(
    cells: pd.DataFrame, units: dict[str, str], decimal: str, zone: str | None, where: str
) -> FoundTime:
    """Time of a table: a column of stamps, a date beside a clock, a clock, days, or a column that counts.

    Parameters
    ----------
    cells : DataFrame
        As :class:`~spindle_fem.recordings.measurement_file.MeasurementTable` holds them.
    units : dict of str to str
        Stated units by column.
    decimal : str
        Sign in numbers written as text.
    zone : str or None
        Name of the zone in which stamps without one are, such as ``Europe/Berlin``.
    where : str
        The file, for messages.

    Raises
    ------
    RecordingError
        No column holds times, or the zone is unknown.
    """
    forms = {name: _form_of(cells[name]) for name in cells.columns}
    whole = [name for name, form in forms.items() if form == "stamp"]
    dates = [name for name, form in forms.items() if form == "date"]
    clocks = [name for name, form in forms.items() if form == "clock"]
    if whole:
        return _stamps((whole[0],), cells[whole[0]], zone, where)
    if dates and clocks:
        chosen = (dates[0], clocks[0])
        joined = _text(cells[dates[0]]).str.replace(_MIDNIGHT, "", regex=True) + " " + _text(cells[clocks[0]])
        return _stamps(chosen, joined, zone, where)
    if clocks:
        return _clock_alone(clocks[0], cells[clocks[0]])
    if dates and cells[dates[0]].nunique() > 1:
        return _stamps((dates[0],), cells[dates[0]], zone, where)
    worded = [name for name in cells.columns if _in_words(cells[name]).notna().mean() > _SHARE]
    if worded:
        return _stamps((worded[0],), _in_words(cells[worded[0]]), zone, where)
    counted = [name for name in cells.columns if _counts(cells[name], name, units.get(name, ""), decimal)]
    if not counted:
        still = [
            n for n in cells.columns if _is_called_time(n) and cells[n].nunique() == 1 and len(cells) > 1
        ]
        if still:
            raise RecordingError(
                where,
                f'has the same time in all {len(cells)} rows of column "{still[0]}".',
                "Times must grow.",
            )
        raise RecordingError(
            where,
            f"has no column of times (columns: {', '.join(map(str, cells.columns))}).",
            "Stamps, a date beside a clock, or a growing count named time are needed.",
        )
    return _counted(counted[0], cells[counted[0]], units.get(counted[0], ""), decimal)


def _text(column: pd.Series) -> pd.Series:
    return column.astype(str).str.strip().where(column.notna(), "")


def _form_of(column: pd.Series) -> str:
    """``stamp``, ``date``, ``clock``, or nothing; stamps that are all of midnight are dates, as in Excel."""
    if pd.api.types.is_numeric_dtype(column.dtype):
        return ""
    if pd.api.types.is_datetime64_any_dtype(column.dtype):
        return "date" if (column.dropna() == column.dropna().dt.normalize()).all() else "stamp"
    text = _text(column)
    text = text[text != ""]
    parts = text.str.extract(_FORM)
    if parts.empty:
        return ""
    date, clock = parts["a"].notna().mean() > _SHARE, parts["hour"].notna().mean() > _SHARE
    if date and clock:
        return "date" if text[parts["a"].notna()].str.contains(_MIDNIGHT).all() else "stamp"
    return "date" if date else "clock" if clock else ""


def _in_words(column: pd.Series) -> pd.Series:
    """Stamps with months as words, or ISO 8601 without signs between; NaT where a cell is none."""
    if pd.api.types.is_numeric_dtype(column.dtype):
        return pd.Series(pd.NaT, index=column.index, dtype="datetime64[us]")
    text = _text(column)
    possible = text.str.contains(_IN_WORDS)
    stamps = pd.to_datetime(text.where(possible), format="mixed", errors="coerce", utc=True)
    return stamps.dt.tz_localize(None).astype("datetime64[us]")


def _stamps(names: tuple[str, ...], column: pd.Series, zone: str | None, where: str) -> FoundTime:
    found, unsure = [], []
    if pd.api.types.is_datetime64_any_dtype(column.dtype):
        known = column.dt.tz is not None
        series, wrong = (column.dt.tz_convert("UTC").dt.tz_localize(None) if known else column), ()
    else:
        text = _text(column)
        parts = text.str.extract(_FORM)
        year, month, day, order, doubt = _year_month_day(parts)
        unsure += doubt
        found.append(f"dates are {order}")
        hour = pd.to_numeric(parts["hour"]).fillna(0)
        half = parts["half"].str.lower()
        hour = hour.where(half.isna(), hour % 12 + 12 * (half == "pm"))
        fraction = pd.to_numeric(parts["part"].fillna("0").str.ljust(9, "0").str[:6])
        fields = pd.DataFrame({"year": year, "month": month, "day": day, "hour": hour})
        fields["minute"] = pd.to_numeric(parts["minute"]).fillna(0)
        fields["second"] = pd.to_numeric(parts["second"]).fillna(0)
        dated = parts["a"].notna() & (parts["hour"].notna() | parts["hour"].isna().all())
        possible = dated & (hour < 24)
        series = pd.to_datetime(fields.where(possible), errors="coerce").astype("datetime64[us]")
        series = series + pd.to_timedelta(fraction.where(possible, 0), unit="us")
        doubtful = [letters for letters in _DOUBTFUL if (parts["zone"] == letters).any()]
        if doubtful and zone is not None:
            parts["zone"] = parts["zone"].where(~parts["zone"].isin(doubtful))
        elif doubtful:
            unsure += [
                f"{name} is read as North American, UTC{int(_ZONES[name][:3])}; in Australia it is "
                f"{_DOUBTFUL[name]} (--zone Australia/Sydney says so)"
                for name in doubtful
            ]
        shift = _shift_of_zone(parts["zone"])
        known = bool(parts["zone"].notna().any())
        series = series - shift
        wrong = tuple((int(row), text.iloc[row]) for row in np.flatnonzero(series.isna() & (text != "")))
    if known:
        found.append("stamps state their zone and are written as UTC")
    elif zone is not None:
        series, doubt = _localised(series, zone, where)
        unsure += doubt
        found.append(f"stamps are of {zone} and are written as UTC")
    else:
        unsure.append("stamps state no zone: they are kept as they stand (--zone Europe/Berlin says which)")
    values = series.astype("datetime64[us]").to_numpy()
    steps = np.diff(values[~np.isnat(values)]).astype("timedelta64[s]").astype(float)
    # a usual step, less the hour
    usual = float(np.median(steps)) if steps.size else 0.0
    back = np.abs(steps - (usual - 3600.0)) < 0.5 * usual + 60.0
    if not known and zone is None and (back & (steps < 0.0)).any():
        unsure.append("stamps jump back by an hour: the end of summer time? --zone resolves it")
    return FoundTime(names, values, None, tuple(found), tuple(unsure), wrong)


def _year_month_day(
    parts: pd.DataFrame,
) -> tuple[pd.Series, pd.Series, pd.Series, str, list[str]]:
    """Year, month and day of cut dates, the order in words, and doubts about it."""
    first, second, third = (pd.to_numeric(parts[key]) for key in "abc")
    signs = set(parts["sign"].dropna())
    if (parts["a"].str.len() == 4).any():
        return first, second, third, "year, month, day", []
    year = third.where(third >= 100, third + 2000)
    american = (second > 12).any() or (signs == {"/"} and parts["half"].notna().any())
    if american and not (first > 12).any():
        return year, first, second, "month, day, year", []
    doubt = []
    if signs == {"/"} and not (first > 12).any():
        # a file seldom runs over more than a month: the part that changes more is the day
        if second.nunique() > first.nunique():
            doubt.append("dates such as 5/2/2016 are read as month, day, year: the second part changes more")
            return year, first, second, "month, day, year", doubt
        doubt.append("dates such as 5/2/2016 are read as day, month, year; they could be month, day, year")
    return year, second, first, "day, month, year", doubt


def _shift_of_zone(zones: pd.Series) -> pd.Series:
    text = zones.fillna("Z").replace(_ZONES).str.replace(":", "").str.ljust(5, "0")
    minutes = text.str[1:3].astype(int) * 60 + text.str[3:5].astype(int)
    return pd.to_timedelta(minutes.where(text.str[0] == "+", -minutes), unit="min")


def _localised(series: pd.Series, zone: str, where: str) -> tuple[pd.Series, list[str]]:
    doubt: list[str] = []
    try:
        try:
            local = series.dt.tz_localize(zone, ambiguous="infer", nonexistent="NaT")
        except ValueError as error:
            if "infer" not in str(error) and "mbiguous" not in str(error):
                raise
            local = series.dt.tz_localize(zone, ambiguous=False, nonexistent="NaT")
            doubt.append(
                "stamps in the hour that comes twice at the end of summer time are read as winter time"
            )
    except (KeyError, ValueError, OSError) as error:  # zoneinfo: no such key, or a name that is no path
        raise RecordingError(
            where, f'"{zone}" is no known time zone.', "Such as Europe/Berlin, UTC."
        ) from error
    lost = int((local.isna() & series.notna()).sum())
    if lost:
        doubt.append(f"{lost} stamps do not exist in {zone} (start of summer time): left empty")
    return local.dt.tz_convert("UTC").dt.tz_localize(None), doubt


def _clock_alone(name: str, column: pd.Series) -> FoundTime:
    """Seconds of a clock without dates; going back by more than half a day is midnight."""
    text = _text(column)
    parts = text.str.extract(_FORM)
    seconds = (
        pd.to_numeric(parts["hour"]) * 3600.0
        + pd.to_numeric(parts["minute"]) * 60.0
        + pd.to_numeric(parts["second"]).fillna(0.0)
        + pd.to_numeric("0." + parts["part"].fillna("0"))
    )
    half = parts["half"].str.lower()
    seconds = np.array(seconds.where(half.isna(), seconds % 43200.0 + 43200.0 * (half == "pm")), dtype=float)
    present = np.flatnonzero(np.isfinite(seconds))
    days = np.cumsum(np.diff(seconds[present], prepend=seconds[present[:1]]) < -43200.0)
    seconds[present] += 86400.0 * days
    wrong = tuple((int(row), text.iloc[row]) for row in np.flatnonzero(~np.isfinite(seconds) & (text != "")))
    unsure = ("there is a clock and no date: seconds from midnight, a day more at every midnight passed",)
    return FoundTime((name,), seconds, "s", (), unsure, wrong)


def _counts(column: pd.Series, name: str, unit: str, decimal: str) -> bool:
    """Whether a column is a growing count that is named or measured like time."""
    values, wrong = numbers_of(column, decimal)
    present = values[np.isfinite(values)]
    if present.size < 2 or len(wrong) > 0.1 * len(column):
        return False
    called = _is_called_time(name)
    measured = unit in ("s", "ms", "min", "hour")
    # rows out of order are a defect that recordings may have: two hints outweigh many of them
    needed = 0.5 if called and measured else _SHARE
    grows = float(np.mean(np.diff(present) >= 0.0)) > needed and np.ptp(present) > 0.0
    return (called or measured) and bool(grows)


def _is_called_time(name: str) -> bool:
    plain = str(name).lower()
    return any(word in plain for word in _NAMES) or plain in ("t", "index")


def _counted(name: str, column: pd.Series, unit: str, decimal: str) -> FoundTime:
    values, wrong = numbers_of(column, decimal)
    middle = float(np.nanmedian(values))
    for scale, short, what in (
        (1.0, "s", "seconds"),
        (1e-3, "ms", "milliseconds"),
        (1e-6, "us", "microseconds"),
        (1e-9, "ns", "nanoseconds"),
    ):
        if unit in ("", short) and _EPOCH[0] < middle * scale < _EPOCH[1]:
            return _as_stamps(name, values * scale, f"{what} from 1970 in UTC", wrong)
    if not unit and _SERIAL[0] < middle < _SERIAL[1] and np.nanmax(values % 1.0) > 0.0:
        return _as_stamps(name, (values - _UNIX_DAY) * 86400.0, "days as spreadsheets count them", wrong)
    unsure = () if unit else (f'column "{name}" states no unit: it is taken to count seconds',)
    return FoundTime((name,), values, unit or "s", (), unsure, wrong)


def _as_stamps(name: str, seconds: np.ndarray, what: str, wrong: tuple[tuple[int, str], ...]) -> FoundTime:
    values = np.full(len(seconds), np.datetime64("NaT"), dtype="datetime64[us]")
    present = np.isfinite(seconds)
    values[present] = np.round(seconds[present] * 1e6).astype("int64").astype("datetime64[us]")
    return FoundTime((name,), values, None, (), (f'column "{name}" is taken as {what}',), wrong)
