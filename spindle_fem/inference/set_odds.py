"""How probable fitted sets of effects are, beside each other and beside nothing missing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Fit, amplitude_name


def rank(hypotheses: Sequence[Hypothesis], coarseness: float = 1.0) -> list[Ranked]:
    """Probabilities of sets of effects at places, forms added up, the most probable first.

    ``coarseness`` as :func:`tempered` has it.
    """
    groups: dict[frozenset, list[tuple[float, Hypothesis]]] = {}
    for item, score in zip(hypotheses, tempered(hypotheses, coarseness), strict=True):
        groups.setdefault(item.fit.named_keys, []).append((score, item))
    highest = max(score for group in groups.values() for score, _ in group)
    weights = {
        key: float(sum(np.exp(score - highest) for score, _ in group)) for key, group in groups.items()
    }
    total = sum(weights.values())
    found = [
        Ranked(max(group, key=lambda pair: pair[0])[1], weights[key] / total) for key, group in groups.items()
    ]
    return sorted(found, key=lambda item: -item.probability)


def tempered(hypotheses: Sequence[Hypothesis], coarseness: float = 1.0) -> list[float]:
    """Logarithm of prior, complexity and likelihood over nothing missing, the last as far as it counts.

    Complexity (the determinants of Laplace's evidence) counts in full, with
    amplitudes that may have any order of magnitude (:func:`any_magnitude`). Held-out readings, where all sets
    have them, are readings like the fitted ones: what a set gains there counts as much.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
        The empty one among them.
    coarseness : float
        How many times less a gain counts between sizes than on a machine that is drawn; between sets of one
        size, which share some of what a coarse model leaves, its square root.
    """
    in_a_size = tuned.GAIN_DIVISOR * float(np.sqrt(coarseness))
    null = next(h for h in hypotheses if not h.fit.candidates)
    gains = [null.misfit - h.misfit for h in hypotheses]
    if all(h.heldout is not None for h in hypotheses):
        gains = [gain + null.heldout - h.heldout for gain, h in zip(gains, hypotheses, strict=True)]
    gains = [0.5 * h.course_kept(coarseness) * gain for gain, h in zip(gains, hypotheses, strict=True)]
    # Within a size; the best set of a size is then compared with other sizes.
    scores = [
        float(
            h.log_prior
            + h.fit.log_evidence
            + 0.5 * h.fit.misfit_with_prior
            + any_magnitude(h.fit)
            + gain / in_a_size
        )
        for h, gain in zip(hypotheses, gains, strict=True)
    ]
    best: dict[int, int] = {}
    for index, item in enumerate(hypotheses):
        size = len(item.fit.candidates)
        if size not in best or scores[index] > scores[best[size]]:
            best[size] = index
    less = {
        size: counted(gains[index]) / (coarseness * tuned.GAIN_DIVISOR) - gains[index] / in_a_size
        for size, index in best.items()
    }
    return [score + less[len(item.fit.candidates)] for item, score in zip(hypotheses, scores, strict=True)]


def log_odds(
    one: Sequence[Hypothesis], other: Sequence[Hypothesis], log_prior: float, coarseness: float = 1.0
) -> float:
    """Logarithm of the odds of one machine's hypotheses over another's of the same readings.

    Parameters
    ----------
    log_prior : float
        Of the one machine over the other.
    """
    scores = np.array(tempered([*other, *one], coarseness))
    ours, theirs = scores[len(other) :], scores[: len(other)]
    return float(logsumexp(ours) - logsumexp(theirs)) + log_prior


def any_magnitude(fit: Fit) -> float:
    """Logarithm of the prior density of a fit's amplitudes, even in their logarithm, over the normal one.

    Two effects that leave the same then have the same complexity, whatever widths
    their priors were given. What is less than ``SEEN_FROM`` of its own standard
    deviations counts as that large, so that a small fitted amplitude is no
    evidence for its effect.
    """
    width = np.sqrt(2.0 * np.pi) / (2.0 * np.log(1.0 / tuned.SMALLEST_SIZE))
    places = {c.name: index for index, c in enumerate(fit.coordinates)}
    found = 0.0
    for candidate in fit.candidates:
        place = places[amplitude_name(candidate)]
        least = tuned.SEEN_FROM * float(np.sqrt(fit.covariance[place, place]))
        size = max(abs(fit.position[place]), least)
        found += float(np.log(width / np.clip(size, tuned.SMALLEST_SIZE, 1.0)))
    return found


def counted(gain: float) -> float:
    """Gain of likelihood that counts: all of it while small, a quarter of the excess later."""
    ends = tuned.INEXACT_BEYOND * (tuned.LARGEST_INEXACT_DIVISOR - 1.0)
    inside = min(max(gain, 0.0), ends)
    beyond = max(gain - ends, 0.0) / tuned.LARGEST_INEXACT_DIVISOR
    return float(tuned.INEXACT_BEYOND * np.log1p(inside / tuned.INEXACT_BEYOND) + beyond + min(gain, 0.0))
