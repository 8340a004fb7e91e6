"""Probability that a set with given evidence is the right one, by experience with concealed machines.

Evidence compares the laws of the catalogue with each other, as if one of them
were exact. Real laws differ from them, and what a strong effect's inexact law
leaves is often explained by a further effect that is not there. How often was
counted on concealed recordings (``python -m validation.reliability``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import expit, logit

from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis import Hypothesis


def share_of_last(hypotheses: Sequence[Hypothesis], chosen: Hypothesis) -> float:
    """Part of the likelihood's gain that the best set with fewer effects has not.

    1 for a single effect; small where one effect explains nearly all that the
    set does.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
        The empty one among them.
    """
    size = len(chosen.fit.named)
    smaller = [h.misfit for h in hypotheses if len(h.fit.named) < size]
    null = next(h.misfit for h in hypotheses if not h.fit.candidates)
    gain = null - chosen.misfit
    if not smaller or gain <= 0.0:
        return 1.0
    return float(np.clip((min(smaller) - chosen.misfit) / gain, 0.0, 1.0))


def gain_of_more(hypotheses: Sequence[Hypothesis], chosen: Hypothesis) -> float:
    """Largest gain in log likelihood (natural logarithm) by a set with more effects, at least 0."""
    size = len(chosen.fit.named)
    larger = [h.misfit for h in hypotheses if len(h.fit.named) > size]
    return max(0.0, 0.5 * (chosen.misfit - min(larger))) if larger else 0.0


def features(probability: float, share: float, more: float) -> list[float]:
    """Features that the coefficients of experience multiply to give a set's reliability, first a constant.

    Parameters as for :func:`reliable`.

    >>> features(0.5, 0.1, 9.0)
    [1.0, 0.0, -1.0, 1.0]
    """
    given = float(logit(np.clip(probability, 1.0 - tuned.LARGEST_EVIDENCE, tuned.LARGEST_EVIDENCE)))
    by_share = float(np.log10(max(share, tuned.SMALLEST_SHARE)))
    return [1.0, given, by_share, float(np.log10(1.0 + more))]


def reliable(probability: float, share: float, more: float = 0.0) -> float:
    """Probability of a set, no larger than experience has it.

    Parameters
    ----------
    probability : float
        That evidence gives.
    share : float
        :func:`share_of_last`.
    more : float
        :func:`gain_of_more`.

    >>> round(reliable(0.9999, 1.0), 2), round(reliable(0.9999, 0.03), 2), reliable(0.4, 1.0)
    (0.95, 0.58, 0.4)
    >>> round(reliable(0.9999, 1.0, more=40.0), 2)
    0.83
    """
    coefficients = (tuned.RELIABILITY_CONSTANT, tuned.BY_LOGIT, tuned.BY_SHARE, tuned.BY_MORE)
    return min(probability, float(expit(np.dot(coefficients, features(probability, share, more)))))
