"""Probability that chance would leave readings that differ so much from a machine with nothing missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit

# Name of the parameter of what swings that means nothing without the swing.
PERIOD = "period"


def detection_p_value(hypotheses: Sequence[Hypothesis], trials: int, coarseness: float = 1.0) -> float:
    """Probability that some set of effects would improve a consistent recording as much.

    Wilks' theorem for each set with its free parameters, but for periods, which
    exist only with an effect: the gain is the largest of as many as a period is
    known more closely than before (:func:`closer_periods`). The lowest level is
    held against those of consistent recordings of concealed machines, with
    Šidák's correction for as many trials as the candidates amount to. So a
    small structural difference between model and machine, which the slow error
    does not take up, is part of what chance does.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
        The empty one among them.
    trials : int
        Candidates that were tried.
    coarseness : float
        As :func:`tempered` has it.
    """
    null = next(h for h in hypotheses if not h.fit.candidates)
    lowest = 0.0
    likely = max((h.log_prior for h in hypotheses if len(h.fit.candidates) == 1), default=0.0)
    for item in hypotheses:
        freedom = len(item.fit.coordinates) - len(null.fit.coordinates)
        gain = item.course_kept(coarseness) * (null.misfit - item.misfit)
        if freedom and gain > 0.0:
            # Pairs, and what is on in intervals, were chosen among so many more.
            chosen_among = max(0.0, likely - item.log_prior)
            periods, among = closer_periods(item.fit)
            # Of a large gain the level is too small for a number.
            with np.errstate(divide="ignore"):
                level = float(np.log(chdtrc(max(1, freedom - periods), gain))) + among
            lowest = min(lowest, level + chosen_among)
    if lowest == 0.0:
        return 1.0
    single = min(float(np.exp(lowest / (coarseness * tuned.CHANCE_DIVISOR))), 1.0 - 1e-16)
    return float(-np.expm1((1.0 + trials / tuned.CANDIDATES_A_TRIAL) * np.log1p(-single)))


def heldout_p_value(chosen: Hypothesis, null: Hypothesis, coarseness: float = 1.0) -> float:
    """Bound of that probability by held-out readings, for a set that fitted ones chose; 1 without any.

    Where nothing is missing, a likelihood of readings to come is x times that which they have once in x times
    at most, by Markov's inequality. Gains count as :func:`~spindle_fem.inference.set_odds.tempered` has them.
    Source: Robbins (1970), Ann. Math. Statist. 41, 1397-1409.
    """
    if chosen.heldout is None or null.heldout is None:
        return 1.0
    gain = 0.5 * chosen.course_kept(coarseness) * max(0.0, null.heldout - chosen.heldout)
    return float(np.exp(-gain / (coarseness * tuned.GAIN_DIVISOR)))


def closer_periods(fit: Fit) -> tuple[int, float]:
    """Number of fitted periods, and logarithm of how many times closer they are known than before.

    As many swings of other periods would have been taken for this one by chance.
    Source: Davies (1987), Biometrika 74, 33-43, for a size and a phase.
    """
    free = {name for c in fit.candidates for name, item in c.free.items() if item.name == PERIOD}
    at = [place for place, c in enumerate(fit.coordinates) if c.name in free]
    if not at:
        return 0, 0.0
    variances = np.diag(fit.covariance)[at]
    return len(at), float(-0.5 * np.log(np.minimum(variances, 1.0)).sum())
