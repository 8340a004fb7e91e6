"""Tables with a row a reading (time, channel, value), as databases write them, with a column a channel."""

from __future__ import annotations

import numpy as np
import pandas as pd

from spindle_fem.recordings.column_units import unit_of_text, without_unit
from spindle_fem.recordings.measurement_file import unused_name
from spindle_fem.recordings.numbers_in_text import numbers_of

# What databases and loggers call the column of channels; elsewhere stamps have to repeat.
_CALLED = ("channel", "kanal", "sensor", "signal", "tag", "field", "variable", "metric", "entity", "topic")
_CALLED += ("messstelle", "messpunkt", "point", "name", "item", "series")
_REPEATED = 1.5
# A name with fewer readings is a remark, and so are names beyond this number.
_LEAST_READINGS, _MOST_CHANNELS = 3, 500


def column_a_channel(
    cells: pd.DataFrame, clock: tuple[str, ...], decimal: str
) -> tuple[pd.DataFrame, dict[str, str]] | None:
    """A long table with a column a channel, and the units that names or a column beside them state.

    Parameters
    ----------
    cells : DataFrame
        As :class:`~spindle_fem.recordings.measurement_file.MeasurementTable` holds them.
    clock : tuple of str
        Columns of times.
    decimal : str
        Sign in numbers written as text.

    Returns
    -------
    tuple of DataFrame and dict of str to str, or None
        None of a table that is not long: it has several columns of numbers, or none of names that repeat.

    >>> long = pd.DataFrame({"t": np.repeat([0, 1, 2], 2), "of": ["T1", "n [rpm]"] * 3, "is": list("234567")})
    >>> wide, units = column_a_channel(long, ("t",), ".")
    >>> wide.to_numpy(float)[1].tolist(), units
    ([1.0, 4.0, 5.0], {'n': 'rpm'})
    """
    beside = [name for name in cells.columns if name not in clock]
    values = [name for name in beside if np.isfinite(numbers_of(cells[name], decimal)[0]).mean() > 0.5]
    texts = {name: cells[name].astype(str).str.strip() for name in beside if name not in values}
    stamps = pd.factorize(pd.MultiIndex.from_frame(cells[list(clock)].astype(str)))[0]
    repeated = len(cells) > _REPEATED * len(np.unique(stamps))
    channel = next((name for name, text in texts.items() if _names_channels(name, text, repeated)), None)
    if channel is None or len(values) != 1:
        return None
    rows = pd.DataFrame({"stamp": stamps, "channel": texts[channel], "value": cells[values[0]]})
    wide = rows.drop_duplicates(["stamp", "channel"]).pivot(index="stamp", columns="channel", values="value")
    table = cells.loc[~pd.Series(stamps, index=cells.index).duplicated(), list(clock)].reset_index(drop=True)
    units = {}
    for name in dict.fromkeys(rows["channel"]):
        plain, unit = without_unit(name)
        plain = unused_name(plain, table)
        table[plain] = wide[name].to_numpy()
        units[plain] = unit or _unit_beside(name, channel, texts)
    return table, {name: unit for name, unit in units.items() if unit}


def _names_channels(name: str, text: pd.Series, repeated: bool) -> bool:
    """Whether a column of texts says which channel each row is of."""
    counts = text.value_counts()
    several = 2 <= len(counts) <= _MOST_CHANNELS and counts.min() >= _LEAST_READINGS
    units_only = all(unit_of_text(item) for item in counts.index)
    return several and not units_only and (repeated or any(word in name.lower() for word in _CALLED))


def _unit_beside(name: str, channel: str, texts: dict[str, pd.Series]) -> str:
    """Unit of a channel where a further column holds one and the same for all its rows."""
    for other, text in texts.items():
        written = text[texts[channel] == name].unique()
        if other != channel and len(written) == 1 and unit_of_text(written[0]):
            return unit_of_text(written[0])
    return ""
