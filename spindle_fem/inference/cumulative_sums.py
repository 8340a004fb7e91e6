"""Whether the mean of standard normal numbers has left zero: cumulative sums with a stated false alarm rate.

One sum a side and reference: ``S = max(0, S ± z − κ)``. A sum with reference κ finds a mean of 2 κ soonest,
so that a few references find small lasting departures as well as large ones. The level that a sum must pass
follows from the mean time between false alarms that it is allowed; all sums share the rate evenly
(Bonferroni), which holds however they depend on one another.

Sources: Page (1954), Biometrika 41, 100-115; Siegmund (1985), Sequential Analysis, chapter 2 (mean run
length); Montgomery (2013), Introduction to Statistical Quality Control, equation 9.6, for the form used here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

# References, in standard deviations of one number: half the means that are found soonest.
REFERENCES = (0.125, 0.35, 1.0)
# A number beyond this counts as this far out, so that no single reading raises an alarm.
OUTLIER = 4.0
# Spreads that are tried for the numbers of a sound machine.
LARGEST_SPREAD, SPREADS = 8.0, 32
# Sound numbers pass the levels of their own length by chance once in so many times.
CERTAIN = 10.0
# How far a discrete sum overshoots its level on average: ρ+ of the normal distribution, on both ends.
_OVERSHOOT = 1.166


def run_length(level: float, reference: float) -> float:
    """Mean number of standard normal numbers until a one-sided sum passes its level.

    Parameters
    ----------
    level, reference : float
        Positive.

    Source: Siegmund (1985); within 3 % of tables for run lengths from 100 on.

    >>> round(run_length(4.0, 0.5)), round(run_length(5.0, 0.5))
    (338, 938)
    """
    width = level + _OVERSHOOT
    return float((np.expm1(2.0 * reference * width) - 2.0 * reference * width) / (2.0 * reference**2))


def level_for(length: float, reference: float) -> float:
    """Level that a one-sided sum passes by chance once in so many numbers on average.

    >>> round(level_for(run_length(5.0, 0.5), 0.5), 6)
    5.0
    """
    highest = np.log(1.0 + 2.0 * reference**2 * length + 2.0) / reference + 10.0
    return float(brentq(lambda level: run_length(level, reference) - length, 0.0, highest))


def spread_of_sound(numbers: Array) -> float:
    """Spread that numbers of a sound machine must be given, no less than one.

    The least at which their sums stay below levels that are passed by chance once in ten times as many
    instants: what a noise model does not know (heavier tails, errors that last longer) is taken from where
    nothing is wrong.

    Parameters
    ----------
    numbers : (n, channels) ndarray
        NaN where a channel says nothing.

    >>> generator = np.random.default_rng(2)
    >>> spread_of_sound(generator.standard_normal((1000, 3)))
    1.0
    >>> 1.8 < spread_of_sound(2.5 * generator.standard_normal((1000, 3))) < 2.8
    True
    """
    spreads = np.geomspace(1.0, LARGEST_SPREAD, SPREADS)
    trial = CumulativeSums(numbers.shape[1] * SPREADS, max(1.0, CERTAIN * len(numbers) / SPREADS), 1.0)
    passed = np.zeros(SPREADS, dtype=bool)
    for row in numbers:
        trial.add((row / spreads[:, None]).ravel())
        passed |= trial.evidence.reshape(SPREADS, -1).max(axis=1) >= 1.0
    return float(spreads[np.argmin(passed)] if not passed.all() else LARGEST_SPREAD)


class CumulativeSums:
    """Two-sided sums over the channels of a machine.

    Parameters
    ----------
    channels : int
    between_alarms : float
        Mean number of instants between two false alarms of all sums together.
    sooner : float
        How many times as often the lower level may be passed by chance.

    Attributes
    ----------
    sums : (channels, 2, n_references) ndarray
        Above zero, then below.
    """

    def __init__(self, channels: int, between_alarms: float, sooner: float) -> None:
        own = between_alarms * channels * 2 * len(REFERENCES)
        self._references = np.array(REFERENCES)
        self._high = np.array([level_for(max(own, 10.0), reference) for reference in REFERENCES])
        self._low = np.array([level_for(max(own / sooner, 5.0), reference) for reference in REFERENCES])
        self.sums = np.zeros((channels, 2, len(REFERENCES)))

    def add(self, numbers: Array) -> None:
        """Add one number per channel, (channels,); NaN for channels without information."""
        known = np.nan_to_num(np.clip(numbers, -OUTLIER, OUTLIER))
        moved = self.sums + np.stack((known, -known), axis=1)[:, :, None] - self._references
        # Clipped at the level, so that an alarm ends as fast as it began.
        moved = np.clip(moved, 0.0, self._high)
        self.sums = np.where(np.isfinite(numbers)[:, None, None], moved, self.sums)

    @property
    def evidence(self) -> Array:
        """Largest sum of every channel as a share of its level, (channels,); 1 is an alarm."""
        return (self.sums / self._high).max(axis=(1, 2))

    @property
    def rising(self) -> NDArray[np.bool_]:
        """Channels with a sum at or beyond its lower level."""
        return (self.sums >= self._low).any(axis=(1, 2))
