"""Conclusions from the fitted hypotheses: probabilities, verdict, alternatives, p-value."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2, norm

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.coarse_sets import that_leave_least, with_needed_events
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Fit, amplitude_name
from spindle_fem.inference.like_sets import (
    are_alike,
    as_one,
    gain_over,
    holds,
    leaves_unnamed,
    likeliest_first,
    may_stand_for,
    with_needed_thirds,
    without_repeats,
)
from spindle_fem.inference.p_value import detection_p_value, heldout_p_value
from spindle_fem.inference.reliability import gain_of_more, reliable, share_of_last

Verdict = Literal["consistent", "parameter", "sensor", "missing_physics", "ambiguous", "unexplained"]

SEVERAL_REASON = "several sets explain the data"
NOTHING_REASON = (
    "few recordings without anything missing are like this one, and no set is much likelier than nothing"
)
NEAR_REASON = "several sets read the same within the noise; what tells them apart is how exact their laws are"
DOUBTED_REASON = "something else, or a law unlike those of the catalogue, is likelier than the best set"
CONTRADICTED_REASON = (
    "chance leaves recordings like this one less than once in a thousand, and no set of effects that makes "
    "them likelier predicts the readings that were held out"
)
# Shift of an uncertain parameter that its prior holds with at least 1 %.
PRIOR_SIGMAS = float(norm.ppf(0.995))


@dataclass(frozen=True, slots=True)
class Judgement:
    """Conclusion of a diagnosis.

    Attributes
    ----------
    p_value : float
        Probability of so large a mismatch if nothing were missing.
    alternatives : tuple of Ranked
        What the data cannot rule out, the chosen set apart.
    other : float
        Probability of something that is not in the catalogue, or of a law unlike those in it.
    evidence : float
        Probability of the chosen set by evidence alone.
    share_of_last : float
        Share of its gain that no set with fewer effects has.
    gain_of_more : float
        What the best set with more effects gains beyond it.
    left : float
        What the chosen set leaves of the readings over their noise; 0 where that was not asked.
    """

    verdict: Verdict
    p_value: float
    chosen: Ranked
    alternatives: tuple[Ranked, ...]
    other: float
    reason: str
    evidence: float = 1.0
    share_of_last: float = 1.0
    gain_of_more: float = 0.0
    left: float = 0.0


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
    in_a_size = tuned.GAIN_DIVISOR_IN_A_SIZE * float(np.sqrt(coarseness))
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


def within_prior(fit: Fit, calibrated: bool) -> bool:
    """Whether every candidate is a shift of a parameter that the definition's prior still holds."""
    if calibrated or not fit.candidates:
        return False
    values = fit.values
    for candidate in fit.candidates:
        if not candidate.shift_of_prior:
            return False
        for factor in candidate.factors:
            coordinate = next((c for c in fit.coordinates if c.name == factor.name), None)
            if coordinate is None:
                return False
            total = values[EFFECT_PREFIX + factor.name] * values[factor.name] / coordinate.value
            if abs(float(np.log(total))) > PRIOR_SIGMAS * coordinate.sigma:
                return False
    return True


def kind_of(candidates: Sequence[Candidate]) -> Verdict:
    """Verdict of a set: physics before parameters before sensors."""
    kinds = {candidate.kind for candidate in candidates}
    for kind in ("missing_physics", "parameter", "sensor"):
        if kind in kinds:
            return kind
    return "consistent"


def judge(
    hypotheses: Sequence[Hypothesis],
    *,
    trials: int,
    calibrated: bool,
    overlapping: Mapping[str, frozenset[str]] | None = None,
    apart: Callable[[Fit, Fit], float] = lambda one, other: np.inf,
    left: Callable[[Fit], float] = lambda fit: 1.0,
    beyond: Callable[[Fit], float] = lambda fit: 0.0,
    coarseness: float = 1.0,
) -> Judgement:
    """Conclude from fitted hypotheses.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
        The empty one among them.
    trials : int
        Candidates that were tried.
    calibrated : bool
        Whether a calibration recording fixed the parameters before.
    overlapping : mapping, optional
        Components that count as one for a decision (a bearing and its set), by component.
    apart : callable, optional
        How far the readings of two fits are apart, in units of the noise; far by default.
    left : callable, optional
        What a fit leaves of the readings over their noise; no more than the noise by default.
    beyond : callable, optional
        Likewise of readings that no fit has seen; 0 where there are none. A set that leaves more there
        than where it was fitted is not the whole truth.
    coarseness : float
        As :func:`tempered` has it.
    """
    before, every = rank(hypotheses, coarseness), hypotheses
    if coarseness > 1.0:
        hypotheses = that_leave_least(with_needed_events(hypotheses, left, beyond), left, beyond)
    ranked = rank(hypotheses, coarseness)
    p_value = detection_p_value(hypotheses, trials, coarseness)
    empty = next(item for item in ranked if not item.fit.candidates)
    by_fitted = rank([replace(h, heldout=None) for h in hypotheses], coarseness)
    fitted = {i.fit.named_keys: i for i in by_fitted}
    likeliest = next((i.fit for i in by_fitted if i.fit.candidates), None)
    if likeliest is not None:
        first = next(h for h in hypotheses if h.fit is likeliest)
        p_value = min(p_value, heldout_p_value(first, empty.best, coarseness))
    odds = {keys: _log_odds(item, fitted[empty.fit.named_keys]) for keys, item in fitted.items()}
    nothing = 0.0
    # A coarse machine leaves errors of its own, which no p-value knows: what is likelier than all sets stays,
    # unless it leaves more than may be left.
    little = max(left(empty.fit), beyond(empty.fit)) <= tuned.MOST_LEFT
    stays = coarseness > 1.0 and empty.probability > tuned.STILL_POSSIBLE and little
    if p_value <= tuned.SIGNIFICANT and not stays:
        ranked = _without(ranked, empty)
    by_all = {item.fit.named_keys: item.probability for item in ranked}
    if coarseness == 1.0:
        ranked = with_needed_thirds(ranked)
    ranked = likeliest_first(without_repeats(ranked, apart), overlapping or {})
    chosen = ranked[0]
    if tuned.RULED_OUT <= p_value <= tuned.SIGNIFICANT:
        nothing = min(empty.probability, tuned.STILL_POSSIBLE)

    def predicts(item: Ranked) -> bool:
        ruled_out = p_value < tuned.RULED_OUT
        return _predicts(
            item.best, empty.best, left, beyond, coarseness, odds[item.fit.named_keys], ruled_out
        )

    improved, kept = predicts(chosen), ranked
    if chosen.fit.candidates and not improved:
        # What does not tell held-out readings is given up: nothing missing has its probability.
        kept = [i for i in ranked if i.fit.candidates and predicts(i)]
        empty = replace(empty, probability=1.0 - sum(i.probability for i in kept))
    if (
        p_value > tuned.SIGNIFICANT
        or not (chosen.fit.candidates and improved)
        or within_prior(chosen.fit, calibrated)
    ):
        nothing_left, misfit_left = left(empty.fit), float(np.sqrt(empty.fit.reduced_misfit))
        much_left = misfit_left > tuned.UNEXPLAINED_MISFIT or nothing_left > tuned.MOST_LEFT
        in_prior = within_prior(chosen.fit, calibrated)
        # Where likelihoods hold, readings may contradict the model although no set tells held-out ones; not
        # those that leave no more than their noise.
        more_left = max(nothing_left, beyond(empty.fit)) > 1.0
        contradicted = coarseness == 1.0 and bool(chosen.fit.candidates) and p_value < tuned.RULED_OUT
        if not (much_left or (contradicted and more_left)) or (nothing_left <= tuned.MOST_LEFT and in_prior):
            _, others = as_one([empty, *(i for i in kept if i.fit.candidates)], overlapping or {})
            # What is less likely than nothing missing, but not ruled out.
            listed = tuple(i for i in others if tuned.LISTED <= i.probability < empty.probability)
            return Judgement("consistent", p_value, empty, listed, 0.0, "")
        # The residual is there, and no set of the catalogue makes it likelier.
        left_over, reason = p_value, CONTRADICTED_REASON
        if much_left:
            left_over = float(chi2.sf(empty.fit.misfit, len(empty.fit.residual)))
            much = f"{nothing_left:.1f} times" if nothing_left > tuned.MOST_LEFT else "more than"
            reason = f"the readings differ from the model by {much} the noise, and no effect explains it"
        nothing_found = replace(empty, probability=0.0)
        return Judgement("unexplained", left_over, nothing_found, (), 1.0, reason, left=nothing_left)
    misfit = float(np.sqrt(chosen.fit.reduced_misfit))
    inexact = float(np.clip((misfit - tuned.EXACT_MISFIT) / tuned.OTHER_RANGE, 0.0, tuned.LARGEST_OTHER))
    rest = left(chosen.fit)
    # Held-out readings count by what is left of them beyond what is left of those that were fitted.
    inexact = max(inexact, unexplained_share(rest), unexplained_share(beyond(chosen.fit) / max(1.0, rest)))
    known_as_one = overlapping or {}
    # Which bearing of a set it is does not matter for the decision; the best represents all.
    alike, rivals = as_one(ranked, known_as_one)
    # What held-out readings say of a rival is asked by itself.
    by_fits = as_one(list(fitted.values()), known_as_one)
    likely = [i.fit for i in (by_fits[0], *by_fits[1]) if i.probability >= tuned.NEAR_PROBABILITY]
    near = [
        item
        for item in rivals
        if any(are_alike(item.fit, fit, known_as_one) for fit in likely)
        and may_stand_for(item.fit, chosen.fit, known_as_one)
        and not leaves_unnamed(item.fit, chosen.fit, known_as_one)
        and _told_by_readings(chosen.best, item.best, coarseness) < tuned.LEAST_HELDOUT_GAIN
        and apart(chosen.fit, item.fit) < tuned.NEAR_READINGS
    ]
    evidence = alike.probability
    # How reliable a set is depends on all that were fitted, those given up among them.
    share = share_of_last(every, chosen.best)
    more = gain_of_more(every, chosen.best)
    exact = (1.0 - nothing) * (1.0 - inexact)
    known = exact * reliable(evidence, share, more) / evidence
    alternatives = tuple(
        Ranked(item.best, known * item.probability)
        for item in rivals
        # A third effect that held-out readings doubt is listed.
        if (known * max(item.probability, by_all[item.fit.named_keys]) >= tuned.LISTED or item in near)
        and item.fit.candidates
    )
    # What a coarse machine gives up although it is likely shares what is left.
    over = 1.0 - known * evidence - sum(item.probability for item in alternatives)
    given_up = (Ranked(i.best, over * i.probability) for i in before if i.fit.named_keys not in by_all)
    alternatives += tuple(
        item for item in given_up if item.probability >= tuned.LISTED and item.fit.candidates
    )
    # What every likely set holds is sure, whether there is more or not.
    common = sum(item.probability for item in ranked if holds(item.fit, chosen.fit, known_as_one))
    several = common * (1.0 - nothing) < tuned.DECIDED or bool(near)
    doubted = known * evidence < tuned.LIKELIER_RIGHT
    kind = kind_of(chosen.fit.candidates)
    # Where little is left, what is likelier than a doubted set is other physics, or a law unlike those known.
    is_physics = kind == "missing_physics" and exact >= tuned.LIKELIER_RIGHT
    decided = not several and (is_physics or not doubted)
    if decided:
        reason = DOUBTED_REASON if doubted else ""
    elif nothing > 1.0 - tuned.DECIDED:
        reason = NOTHING_REASON
    elif several:
        reason = NEAR_REASON if near else SEVERAL_REASON
    else:
        reason = DOUBTED_REASON
    verdict: Verdict = kind if decided else "ambiguous"
    if rest > tuned.MOST_LEFT:
        without = left(empty.fit)
        verdict = "unexplained"
        reason = (
            f"the best set leaves {rest:.1f} times what the errors expected of sensors allow (noise with its "
            f"slow part, robust root mean square of fitted readings), where {without:.1f} times was left "
            f"without it: it explains {100.0 * (1.0 - (rest / without) ** 2):.0f} % of the mismatch"
        )
    return Judgement(
        verdict,
        p_value,
        Ranked(chosen.best, known * evidence),
        alternatives,
        1.0 - known,
        reason,
        evidence,
        share,
        more,
        rest,
    )


def _predicts(
    chosen: Hypothesis,
    empty: Hypothesis,
    left: Callable[[Fit], float],
    beyond: Callable[[Fit], float],
    coarseness: float,
    odds: float,
    ruled_out: bool,
) -> bool:
    """Whether held-out readings speak for a set: by themselves, or with what the fitted ones say.

    They are a third of the fitted ones, and of a small effect seen by few sensors tell less than its odds by
    those. What they say against a set counts as well: the sum must be twenty to one. A set that leaves as
    much of all readings as nothing missing only makes the machine likelier, which is not enough unless
    chance hardly leaves such a machine (``ruled_out``).
    A coarse model leaves more than noise, so that likelihoods exaggerate: for a network the residual
    counts, that of fitted readings too, and sensors' white noise hides less of it. If the fit without effects
    leaves only noise, likelihoods must say so too, and a set leave clearly less.
    """
    if chosen.heldout is None or empty.heldout is None:
        return True
    gain = _heldout_gain(chosen, empty)
    if coarseness > 1.0:
        within = max(left(empty.fit), beyond(empty.fit)) <= 1.0
        least = tuned.LEAST_OF_A_MEMBER if within else tuned.LEAST_IMPROVEMENT
        most = 1.0 - least if within else 1.0 + least
        lower = beyond(chosen.fit) <= (1.0 - least) * beyond(empty.fit)
        enough = gain >= tuned.LEAST_HELDOUT_GAIN or not within
        return enough and lower and left(chosen.fit) <= most * left(empty.fit)
    # A quarter of the readings is held out by default.
    rest, before = (np.sqrt(3.0 * left(fit) ** 2 + beyond(fit) ** 2) for fit in (chosen.fit, empty.fit))
    lower = ruled_out or rest <= (1.0 - tuned.LEAST_IMPROVEMENT_DRAWN) * before
    return lower and max(gain, gain + odds) >= tuned.LEAST_HELDOUT_GAIN


def _heldout_gain(chosen: Hypothesis, empty: Hypothesis) -> float:
    """Logarithm of the odds of a set over nothing missing by held-out readings; 0 where there are none."""
    if chosen.heldout is None or empty.heldout is None:
        return 0.0
    return 0.5 * (empty.heldout - chosen.heldout) / tuned.GAIN_DIVISOR


def _told_by_readings(chosen: Hypothesis, other: Hypothesis, coarseness: float) -> float:
    """Logarithm of the odds of a set over another of its size by all readings, whatever was likely before.

    Held-out readings count as fitted ones do, which are three times as many; both less where the model is
    coarse, as :func:`tempered` has it.
    """
    return 0.5 * gain_over(chosen, other) / (tuned.GAIN_DIVISOR_IN_A_SIZE * float(np.sqrt(coarseness)))


def _log_odds(item: Ranked, empty: Ranked) -> float:
    """Logarithm of the odds of a set over nothing missing by fitted readings."""
    least = np.finfo(float).tiny
    return float(np.log(max(item.probability, least)) - np.log(max(empty.probability, least)))


def unexplained_share(rest: float) -> float:
    """Probability of something else where ``rest`` times the noise is left: odds are the excess squared.

    >>> [round(unexplained_share(rest), 2) for rest in (0.9, 1.3, 2.0, 4.0)]
    [0.0, 0.08, 0.5, 0.9]
    """
    odds = max(0.0, rest - 1.0) ** 2
    return odds / (1.0 + odds)


def _without(ranked: Sequence[Ranked], empty: Ranked) -> list[Ranked]:
    """Sets of something, their probabilities alone."""
    rest = [item for item in ranked if item is not empty]
    total = sum(item.probability for item in rest)
    if not total > 0.0:
        return list(ranked)
    return [Ranked(item.best, item.probability / total) for item in rest]
