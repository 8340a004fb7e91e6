"""Readings held out of a diagnosis, to show afterwards how well it predicts them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.recordings.align import Recording

# A recording is cut into stretches of equal time, of which every fourth from the third on is held out: a
# quarter of the readings, neither the start nor the end among them.
BLOCKS = 20
EVERY = 4
FIRST = 2


def _words(seconds: float) -> str:
    """A length of time in the unit that suits it.

    >>> [_words(s) for s in (8.0, 960.0, 5400.0 * 3, 864000.0)]
    ['8 s', '16 min', '4.5 h', '10 days']
    """
    for unit, size, from_ in (("days", 86400.0, 2.0), ("h", 3600.0, 2.0), ("min", 60.0, 2.0)):
        if seconds >= from_ * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def heldout_stamps(recording: Recording, choice: str = "blocks") -> tuple[NDArray[np.bool_], str]:
    """Stamps that are held out, and how they were chosen, in words.

    Parameters
    ----------
    choice : str
        ``blocks``: every fourth of twenty equal stretches of time; ``last:0.4``:
        the last 40 % of the time (any share up to 0.8).

    Returns
    -------
    (N,) bool ndarray

    Raises
    ------
    SpecError
        Another choice.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> held, how = heldout_stamps(SimpleNamespace(times=np.arange(20.0)), "last:0.25")
    >>> int(held.sum()), how
    (5, 'the last 25 % of the time')
    """
    times = recording.times
    begin, duration = float(times[0]), float(times[-1] - times[0])
    share = np.clip((times - begin) / max(duration, 1e-9), 0.0, 1.0)
    if choice == "blocks":
        block = np.minimum((share * BLOCKS).astype(int), BLOCKS - 1)
        text = f"every {EVERY}th of {BLOCKS} stretches of {_words(duration / BLOCKS)}"
        return block % EVERY == FIRST, text
    kind, _, amount = choice.partition(":")
    try:
        part = float(amount)
    except ValueError:
        part = -1.0
    if kind != "last" or not 0.0 < part <= 0.8:
        raise SpecError("heldout", f'"{choice}".', 'Allowed: "blocks", or "last:0.4" (a share up to 0.8).')
    return share > 1.0 - part, f"the last {100.0 * part:.0f} % of the time"


def left_of_all(left: float, beyond: float) -> float:
    """Root mean square of what is left of all readings, fitted and held out by default.

    >>> left_of_all(2.0, 2.0), round(left_of_all(1.0, 2.0), 2)
    (2.0, 1.32)
    """
    return float(np.sqrt(((EVERY - 1) * left**2 + beyond**2) / EVERY))
