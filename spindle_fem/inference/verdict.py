"""Conclusions from the fitted hypotheses: probabilities, verdict, alternatives, p-value."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtrc, ndtri

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.coarse_sets import that_leave_least, with_needed_events
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.heldout import left_of_all
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.like_sets import (
    are_alike,
    as_one,
    holds,
    leaves_unnamed,
    likeliest_first,
    may_stand_for,
    told_by_readings,
    with_needed_effects,
    without_repeats,
)
from spindle_fem.inference.p_value import detection_p_value, heldout_p_value
from spindle_fem.inference.reliability import gain_of_more, reliable, share_of_last
from spindle_fem.inference.set_odds import rank

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
PRIOR_SIGMAS = float(ndtri(0.995))


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


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of fits and of the machine, as :func:`judge` takes it."""

    calibrated: bool
    overlapping: Mapping[str, frozenset[str]]
    apart: Callable[[Fit, Fit], float]
    left: Callable[[Fit], float]
    beyond: Callable[[Fit], float]
    coarseness: float


@dataclass(frozen=True, slots=True)
class _Weighed:
    """Fitted sets, and what decides between them.

    Attributes
    ----------
    every : sequence of Hypothesis
        All that were fitted, those given up among them.
    before : list of Ranked
        By all readings, before any was given up.
    by_fitted : mapping of keys to Ranked
        By fitted readings alone.
    by_all : mapping of keys to float
        Probability by all readings, before like sets count as one and further effects are doubted.
    ranked : list of Ranked
        The set that is named, or nothing missing, in front.
    empty : Ranked
        Nothing missing.
    p_value : float
    """

    every: Sequence[Hypothesis]
    before: list[Ranked]
    by_fitted: dict[frozenset, Ranked]
    by_all: dict[frozenset, float]
    ranked: list[Ranked]
    empty: Ranked
    p_value: float

    def predicts(self, item: Ranked, asked: _Asked) -> bool:
        """Whether held-out readings speak for a set."""
        nothing = self.by_fitted[self.empty.fit.named_keys]
        odds = _log_odds(self.by_fitted[item.fit.named_keys], nothing)
        return _predicts(item.best, self.empty.best, asked, odds, self.p_value < tuned.RULED_OUT)


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
    asked = _Asked(calibrated, overlapping or {}, apart, left, beyond, coarseness)
    sets = _weighed(hypotheses, trials, asked)
    chosen = sets.ranked[0]
    named = sets.p_value <= tuned.SIGNIFICANT and bool(chosen.fit.candidates)
    if named and sets.predicts(chosen, asked) and not within_prior(chosen.fit, calibrated):
        return _named(sets, asked)
    return _not_named(sets, asked)


def _weighed(hypotheses: Sequence[Hypothesis], trials: int, asked: _Asked) -> _Weighed:
    """Sets in the order in which they are told, and the p-value of nothing missing."""
    coarseness, is_coarse = asked.coarseness, asked.coarseness > 1.0
    before, every = rank(hypotheses, coarseness), hypotheses
    if is_coarse:
        hypotheses = with_needed_events(hypotheses, asked.left, asked.beyond)
        hypotheses = that_leave_least(hypotheses, asked.left, asked.beyond)
    ranked = rank(hypotheses, coarseness)
    empty = next(item for item in ranked if not item.fit.candidates)
    by_fitted = rank([replace(h, heldout=None) for h in hypotheses], coarseness)
    p_value = detection_p_value(hypotheses, trials, coarseness)
    likeliest = next((i.fit for i in by_fitted if i.fit.candidates), None)
    if likeliest is not None:
        first = next(h for h in hypotheses if h.fit is likeliest)
        p_value = min(p_value, heldout_p_value(first, empty.best, coarseness))
    # A coarse machine leaves errors of its own, which no p-value knows: what is likelier than all sets stays,
    # unless it leaves more than may be left.
    little = max(asked.left(empty.fit), asked.beyond(empty.fit)) <= tuned.MOST_LEFT
    stays = is_coarse and empty.probability > tuned.STILL_POSSIBLE and little
    if p_value <= tuned.SIGNIFICANT and not stays:
        ranked = _without(ranked, empty)
    by_all = {item.fit.named_keys: item.probability for item in ranked}
    told = ranked if is_coarse else with_needed_effects(ranked, asked.overlapping)
    told = without_repeats(told, asked.apart, asked.overlapping, coarseness)
    told = likeliest_first(told, asked.overlapping)
    return _Weighed(
        every, before, {item.fit.named_keys: item for item in by_fitted}, by_all, told, empty, p_value
    )


def _not_named(sets: _Weighed, asked: _Asked) -> Judgement:
    """No set is named: the recording is consistent, or what it contradicts is not explained."""
    chosen, kept, empty = sets.ranked[0], sets.ranked, sets.empty
    # Chance hardly leaves as much: nothing missing is no surer, though no set tells held-out readings.
    doubtful = asked.coarseness == 1.0 and sets.p_value < tuned.DOUBTFUL
    if chosen.fit.candidates and not doubtful and not sets.predicts(chosen, asked):
        # What does not tell held-out readings is given up: nothing missing has its probability.
        kept = [i for i in kept if i.fit.candidates and sets.predicts(i, asked)]
        empty = replace(empty, probability=1.0 - sum(i.probability for i in kept))
    left, misfit = asked.left(empty.fit), float(np.sqrt(empty.fit.reduced_misfit))
    much_left = misfit > tuned.UNEXPLAINED_MISFIT or left > tuned.MOST_LEFT
    in_prior = within_prior(chosen.fit, asked.calibrated)
    # Where likelihoods hold, readings may contradict the model although no set tells held-out ones; not
    # those that leave no more than their noise.
    more_left = max(left, asked.beyond(empty.fit)) > 1.0
    impossible = asked.coarseness == 1.0 and bool(chosen.fit.candidates) and sets.p_value < tuned.RULED_OUT
    if not (much_left or (impossible and more_left)) or (left <= tuned.MOST_LEFT and in_prior):
        _, others = as_one([empty, *(i for i in kept if i.fit.candidates)], asked.overlapping)
        # What chance or the prior holds is as likely as not, whatever evidence says; sets share the rest.
        nothing = tuned.STILL_POSSIBLE if doubtful else max(empty.probability, tuned.STILL_POSSIBLE)
        rest = sum(i.probability for i in others)
        share = min(1.0, (1.0 - nothing) / max(rest, np.finfo(float).tiny))
        rivals = (replace(i, probability=share * i.probability) for i in others)
        listed = tuple(i for i in rivals if i.probability >= tuned.LISTED)
        told = replace(empty, probability=nothing)
        other = max(0.0, 1.0 - nothing - share * rest) if doubtful else 0.0
        return Judgement("consistent", sets.p_value, told, listed, other, "")
    # The residual is there, and no set of the catalogue makes it likelier.
    p_value, reason = sets.p_value, CONTRADICTED_REASON
    if much_left:
        # The slow error was chosen by what is left, so that the misfit alone may speak for chance.
        p_value = min(p_value, float(chdtrc(len(empty.fit.residual), empty.fit.misfit)))
        much = f"{left:.1f} times" if left > tuned.MOST_LEFT else "more than"
        reason = f"the readings differ from the model by {much} the noise, and no effect explains it"
    return Judgement("unexplained", p_value, replace(empty, probability=0.0), (), 1.0, reason, left=left)


def _named(sets: _Weighed, asked: _Asked) -> Judgement:
    """A set is named: how sure that is, what else is not ruled out, and whether it is decided."""
    chosen, known_as_one = sets.ranked[0], asked.overlapping
    nothing = 0.0
    if tuned.RULED_OUT <= sets.p_value <= tuned.SIGNIFICANT:
        nothing = min(sets.empty.probability, tuned.STILL_POSSIBLE)
    misfit, rest = float(np.sqrt(chosen.fit.reduced_misfit)), asked.left(chosen.fit)
    inexact = float(np.clip((misfit - tuned.EXACT_MISFIT) / tuned.OTHER_RANGE, 0.0, tuned.LARGEST_OTHER))
    # Held-out readings count by what is left of them beyond what is left of those that were fitted.
    beyond = asked.beyond(chosen.fit) / max(1.0, rest)
    inexact = max(inexact, unexplained_share(rest), unexplained_share(beyond))
    # Which bearing of a set it is does not matter for the decision; the best represents all.
    alike, rivals = as_one(sets.ranked, known_as_one)
    near = _near(chosen, rivals, sets, asked)
    evidence = alike.probability
    # How reliable a set is depends on all that were fitted, those given up among them.
    share, more = share_of_last(sets.every, chosen.best), gain_of_more(sets.every, chosen.best)
    exact = (1.0 - nothing) * (1.0 - inexact)
    known = exact * reliable(evidence, share, more) / evidence
    probability = known * evidence
    # How sure a set is, is how sure its last effect is: without it is listed where that is not much.
    listed = [*near, *(_with_one_less(chosen, sets, asked) if probability < tuned.DECIDED else ())]
    alternatives = tuple(
        Ranked(item.best, known * item.probability)
        for item in rivals
        # A doubted further effect is listed.
        if (
            known * max(item.probability, sets.by_all[item.fit.named_keys]) >= tuned.LISTED
            or any(are_alike(item.fit, one.fit, known_as_one) for one in listed)
        )
        and item.fit.candidates
    )
    # What a coarse machine gives up although it is likely shares what the others are doubted by; what they
    # leave unexplained is something else.
    doubted_by = max(0.0, exact - known)
    given_up = [i for i in sets.before if i.fit.named_keys not in sets.by_all and i.fit.candidates]
    doubtful = tuple(
        Ranked(i.best, doubted_by * i.probability)
        for i in given_up
        if doubted_by * i.probability >= tuned.LISTED or any(i.best is one.best for one in listed)
    )
    other = max(0.0, 1.0 - known - nothing - sum(item.probability for item in doubtful))
    alternatives += doubtful
    if nothing >= tuned.LISTED:
        alternatives += (Ranked(sets.empty.best, nothing),)
    # What every likely set holds is sure, whether there is more or not.
    common = sum(item.probability for item in sets.ranked if holds(item.fit, chosen.fit, known_as_one))
    several = common * (1.0 - nothing) < tuned.DECIDED or bool(near)
    doubted = probability < tuned.LIKELIER_RIGHT
    verdict = kind_of(chosen.fit.candidates)
    # Where little is left, what is likelier than a doubted set is other physics, or a law unlike those known.
    is_physics = verdict == "missing_physics" and exact >= tuned.LIKELIER_RIGHT
    reason = DOUBTED_REASON if doubted else ""
    if several or not (is_physics or not doubted):
        verdict = "ambiguous"
        if nothing > 1.0 - tuned.DECIDED:
            reason = NOTHING_REASON
        elif several:
            reason = NEAR_REASON if near else SEVERAL_REASON
    if rest > tuned.MOST_LEFT:
        without = asked.left(sets.empty.fit)
        verdict = "unexplained"
        reason = (
            f"the best set leaves {rest:.1f} times what the errors expected of sensors allow (noise with its "
            f"slow part, robust root mean square of fitted readings), where {without:.1f} times was left "
            f"without it: it explains {100.0 * (1.0 - (rest / without) ** 2):.0f} % of the mismatch"
        )
    told = Ranked(chosen.best, probability)
    return Judgement(verdict, sets.p_value, told, alternatives, other, reason, evidence, share, more, rest)


def _with_one_less(chosen: Ranked, sets: _Weighed, asked: _Asked) -> list[Ranked]:
    """The most probable set of all effects of another but one, by all readings; none of a single one."""
    size = len(chosen.fit.named_keys) - 1
    return [
        i
        for i in sets.before
        if len(i.fit.named_keys) == size > 0 and holds(chosen.fit, i.fit, asked.overlapping)
    ][:1]


def _near(chosen: Ranked, rivals: Sequence[Ranked], sets: _Weighed, asked: _Asked) -> list[Ranked]:
    """Rivals whose readings are those of the chosen set within the noise."""
    # What held-out readings say of a rival is asked by itself.
    first, others = as_one(list(sets.by_fitted.values()), asked.overlapping)
    likely = [item.fit for item in (first, *others) if item.probability >= tuned.LISTED]
    return [
        item
        for item in rivals
        if any(are_alike(item.fit, fit, asked.overlapping) for fit in likely)
        and may_stand_for(item.fit, chosen.fit, asked.overlapping)
        and not leaves_unnamed(item.fit, chosen.fit, asked.overlapping)
        and told_by_readings(chosen.best, item.best, asked.coarseness) < tuned.LEAST_HELDOUT_GAIN
        and asked.apart(chosen.fit, item.fit) < tuned.NEAR_READINGS
    ]


def _predicts(chosen: Hypothesis, empty: Hypothesis, asked: _Asked, odds: float, ruled_out: bool) -> bool:
    """Whether held-out readings speak for a set: by themselves, or with what the fitted ones say.

    They are a third of the fitted ones, and of a small effect seen by few sensors tell less than its odds by
    those. What they say against a set counts as well: the sum must be twenty to one. A set that leaves as
    much of all readings as nothing missing only makes the machine likelier, which is not enough unless
    chance hardly leaves such a machine (``ruled_out``).
    A coarse model leaves more than noise, so that likelihoods exaggerate: for a network the residual
    counts, that of fitted readings too, and sensors' white noise hides less of it. If the fit without effects
    leaves no more than may be left, likelihoods must say so too, and a set leave clearly less of all.
    """
    if chosen.heldout is None or empty.heldout is None:
        return True
    left, beyond, gain = asked.left, asked.beyond, _heldout_gain(chosen, empty)
    rest, before = (left_of_all(left(fit), beyond(fit)) for fit in (chosen.fit, empty.fit))
    if asked.coarseness > 1.0:
        within = max(left(empty.fit), beyond(empty.fit)) <= tuned.MOST_LEFT
        enough = gain >= tuned.LEAST_HELDOUT_GAIN and rest <= (1.0 - tuned.LEAST_OF_A_MEMBER) * before
        lower = beyond(chosen.fit) <= (1.0 - tuned.LEAST_IMPROVEMENT) * beyond(empty.fit)
        kept = left(chosen.fit) <= (1.0 + tuned.LEAST_IMPROVEMENT) * left(empty.fit)
        return lower and kept and (enough or not within)
    lower = ruled_out or rest <= (1.0 - tuned.LEAST_IMPROVEMENT_DRAWN) * before
    return lower and max(gain, gain + odds) >= tuned.LEAST_HELDOUT_GAIN


def _heldout_gain(chosen: Hypothesis, empty: Hypothesis) -> float:
    """Logarithm of the odds of a set over nothing missing by held-out readings; 0 where there are none."""
    if chosen.heldout is None or empty.heldout is None:
        return 0.0
    return 0.5 * (empty.heldout - chosen.heldout) / tuned.GAIN_DIVISOR


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
