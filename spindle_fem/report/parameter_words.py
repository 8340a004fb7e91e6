"""Parameters of a fit in words, and which of them to show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.inference.coordinate_names import (
    GAP_PREFIX,
    JUMP_PREFIX,
    MISDESCRIBED_IN_PREFIX,
    MISDESCRIBED_PREFIX,
    PROBE_PREFIX,
    START_PREFIX,
)

ALONG = {"r": "along the radius", "z": "along the axis"}
MOST_SHOWN = 25
# A parameter has moved from this shift on, and is well determined up to this width, both in prior widths.
MOVED, WELL_DETERMINED = 0.5, 0.8


def parameter_words(name: str, recordings: Sequence[str] = ()) -> str:
    """A free number of a fit as a reader who does not know its key would call it.

    Parameters
    ----------
    recordings : sequence of str
        Names; one is named where there are several.

    >>> parameter_words("jump.0.3"), parameter_words("probe.FRONT.r")
    ('instant of change 4 of an input between rows', 'place of probe FRONT along the radius')
    >>> parameter_words("within_gap.1.0", ["monday", "friday"])
    'heat or inlet in stretch 1 between rows (friday)'
    >>> parameter_words("misdescribed_in.0.standing_coolant.RETURN.20s")
    'recording: standing coolant, RETURN, 20s'
    >>> parameter_words("joint.front_seats")
    'joint, front seats'
    """
    for prefix in (JUMP_PREFIX, GAP_PREFIX, MISDESCRIBED_IN_PREFIX, START_PREFIX):
        if name.startswith(prefix):
            number, _, rest = name.removeprefix(prefix).partition(".")
            text = {
                JUMP_PREFIX: lambda key: f"instant of change {int(key) + 1} of an input between rows",
                GAP_PREFIX: lambda key: f"heat or inlet in stretch {int(key) + 1} between rows",
                START_PREFIX: lambda key: f"{_plain(key.removeprefix('initial.'))} at the start",
                MISDESCRIBED_IN_PREFIX: lambda key: f"recording: {_plain(key)}",
            }[prefix](rest)
            return f"{text} ({recordings[int(number)]})" if len(recordings) > 1 else text
    if name.startswith(PROBE_PREFIX):
        probe, _, direction = name.removeprefix(PROBE_PREFIX).rpartition(".")
        return f"place of probe {probe} {ALONG.get(direction, direction)}"
    if name.startswith(MISDESCRIBED_PREFIX):
        return f"definition: {_plain(name.removeprefix(MISDESCRIBED_PREFIX))}"
    return _plain(name)


def _plain(key: str) -> str:
    return key.replace("_", " ").replace("|", " to ").replace(".", ", ")


def worth_showing(shifts: ArrayLike, widths: ArrayLike) -> NDArray[np.int64]:
    """Rows of the parameters that moved or are well determined, in order; all if they are few.

    Parameters
    ----------
    shifts, widths : (n,) array_like
        In standard deviations of the priors.

    >>> shifts = [0.0] * 30 + [2.0, 0.1]
    >>> worth_showing(shifts, [1.0] * 31 + [0.2]).tolist()
    [30, 31]
    """
    moved, width = np.abs(np.asarray(shifts, dtype=float)), np.asarray(widths, dtype=float)
    if moved.size <= MOST_SHOWN:
        return np.arange(moved.size)
    rank = np.maximum(moved / MOVED, WELL_DETERMINED / np.maximum(width, 1.0e-9))
    order = np.argsort(-rank, kind="stable")[:MOST_SHOWN]
    chosen = order[rank[order] >= 1.0]
    return np.sort(chosen if chosen.size else order[:1])
