"""Time axis: clock time if stamps give it, otherwise time since the start."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

LONG_SECONDS = 3.0 * 86400.0
# Between two numbers of a clock: minutes, hours, days; s.
_STEPS = (60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800, 2592000)
_DAY = 86400
# Between two months that are named, where days would be too many; a month takes half as much room again as an
# hour.
_MONTHS, MONTH_WIDTH = (1, 2, 3, 6, 12, 24, 60, 120), 1.5


def time_scale(seconds: float) -> tuple[float, str]:
    """Divisor and unit in which a span of time reads well.

    >>> time_scale(5400.0), time_scale(1e7)[1]
    ((3600.0, 'h'), 'd')
    """
    if seconds >= LONG_SECONDS:
        return 86400.0, "d"
    return (3600.0, "h") if seconds >= 3600.0 else (60.0, "min")


def label_times(axes: Axes, start: str | None, seconds: float) -> None:
    """Number and name the lowest time axis of a figure, whose axes share it.

    Parameters
    ----------
    axes : Axes
        Times along it are in the unit of :func:`time_scale` from the start.
    start : str or None
        ISO stamp of time 0; None where recordings know no clock.
    seconds : float, [s]
        Span.
    """
    scale, unit = time_scale(seconds)
    if not start:
        axes.set_xlabel(f"time / {unit}")
        return
    places, texts, label = clock_numbers(start, seconds)
    axes.xaxis.set_major_locator(FixedLocator([place / scale for place in places]))
    axes.xaxis.set_major_formatter(FixedFormatter(texts))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(label)


def clock_numbers(start: str, seconds: float, most: int = 9) -> tuple[list[float], list[str], str]:
    r"""Round times of the clock within a span: seconds from the start, texts, and the label of the axis.

    A text has the day where it is another than that of the one before; of years, it is the month.

    >>> clock_numbers("2026-03-09T22:40:00Z", 7200.0, most=3)[:2]
    ([1200.0, 4800.0], ['23:00', '00:00\n03-10'])
    >>> clock_numbers("2026-11-30T00:00:00Z", 3e7)[1]
    ['2027-01', '2027-03', '2027-05', '2027-07', '2027-09', '2027-11']
    """
    begin = np.datetime64(start.removesuffix("Z"), "ms")
    midnight = begin.astype("datetime64[D]")
    if seconds / _STEPS[-1] >= most:
        places, texts = _month_numbers(begin, seconds, most / MONTH_WIDTH)
        return places, texts, f"month, from {midnight}"
    since_midnight = (begin - midnight) / np.timedelta64(1, "s")
    step = next((item for item in _STEPS if seconds / item < most), _STEPS[-1])
    first = np.ceil(since_midnight / step) * step
    clock = np.arange(first, since_midnight + seconds + 1e-6, step)
    texts, day_before = [], midnight
    for time in clock:
        day = midnight + int(time // _DAY)
        hour = f"{int(time % _DAY // 3600):02d}:{int(time % 3600 // 60):02d}"
        date = str(day)[5:]
        texts.append(date if step >= _DAY else hour + (f"\n{date}" if day != day_before else ""))
        day_before = day
    name = "day" if step >= _DAY else "clock time"
    return (clock - since_midnight).tolist(), texts, f"{name}, from {midnight}"


def _month_numbers(begin: np.datetime64, seconds: float, most: float) -> tuple[list[float], list[str]]:
    """Beginnings of months within a span, seconds from its start, and their names."""
    end = begin + np.timedelta64(round(1000.0 * seconds), "ms")
    months = np.arange(begin.astype("datetime64[M]") + 1, end.astype("datetime64[M]") + 1)
    step = next((item for item in _MONTHS if len(months) / item <= most), _MONTHS[-1])
    named = months[months.astype(int) % step == 0]
    places = (named.astype("datetime64[ms]") - begin) / np.timedelta64(1, "s")
    return places.tolist(), [str(month) for month in named]
