"""Final fits: which sets of a search are fitted again on a larger basis, each about its own machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from spindle_fem.inference import tuned
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem
from spindle_fem.inference.like_sets import are_alike, free_in_time, may_stand_for
from spindle_fem.inference.other_answers import with_other_answers
from spindle_fem.inference.set_odds import tempered
from spindle_fem.inference.set_problems import SetProblems, combination_of
from spindle_fem.inference.worker_processes import FitOrder, Workers, of_candidates


def few_of_each(ranked: Sequence[Hypothesis], overlapping: Mapping[str, frozenset[str]]) -> list[Hypothesis]:
    """Sets without more than a few places and forms of one combination of effects, which hide the others.

    Of those fewer still that name the same: bearings of one set hide other places.
    """
    of_each: dict[tuple[str, ...], list[Hypothesis]] = {}
    found = []
    for item in ranked:
        own = of_each.setdefault(combination_of(item.fit), [])
        alike = sum(are_alike(item.fit, other.fit, overlapping) for other in own)
        if len(own) < tuned.REFITTED_OF_EACH and alike < tuned.REFITTED_ALIKE:
            own.append(item)
            found.append(item)
    return found


def to_be_fitted(
    problem: Problem,
    found: Sequence[Hypothesis],
    overlapping: Mapping[str, frozenset[str]],
    coarseness: float,
) -> list[Hypothesis]:
    """The most probable hypotheses, the first of them first, and what may turn out to be more so.

    The slow error has changed since the search: whether the first set needs each of its members is tested
    again, and so is the best set of each smaller size, none at all among them.
    """
    score = dict(zip(map(id, found), tempered(found, coarseness), strict=True))
    everything = sorted(found, key=lambda h: -score[id(h)])
    # Whether anything is missing is a separate question (the p-value): here sets are compared.
    ranked = [h for h in everything if h.keys] or everything
    first = ranked[0]
    least = score[id(first)] - tuned.NEGLIGIBLE_SCORE
    # Links of a network differ by more than spots of a machine do.
    different = few_of_each(ranked, overlapping) if coarseness == 1.0 else ranked
    chosen = different[: tuned.ALWAYS_REFITTED]
    chosen += [h for h in different[: tuned.REFITTED] if score[id(h)] > least]
    chosen += [h for h in ranked if h.keys < first.keys and len(h.keys) == len(first.keys) - 1]
    chosen += _first_of_each(everything, range(len(first.keys)))
    if coarseness > 1.0:
        chosen += _of_a_coarse_machine(ranked)
    chosen = list({id(h): h for h in chosen}.values())
    rivals = [h for h in ranked if h not in chosen and may_stand_for(h.fit, first.fit, overlapping)]
    return [*chosen, *_nearest(problem, first.fit, rivals)]


def _first_of_each(ordered: Sequence[Hypothesis], sizes: Iterable[int], number: int = 1) -> list[Hypothesis]:
    """The first sets of each size in an order."""
    return [h for size in sizes for h in [h for h in ordered if len(h.keys) == size][:number]]


def _of_a_coarse_machine(ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """What leaves least, which is told though other sets are likelier; and laws that leave little.

    Those come before what may be on at any time.
    """
    chosen = []
    if free_in_time(ranked[0].fit):
        laws = [h for h in ranked if not free_in_time(h.fit)]
        chosen += _first_of_each(laws, range(1, len(ranked[0].keys) + 1), tuned.LAWS_REFITTED)
    leaving_least = sorted(ranked, key=lambda h: h.fit.misfit_with_prior)
    return chosen + _first_of_each(leaving_least, range(1, 1 + max(len(h.keys) for h in ranked)))


def _nearest(problem: Problem, first: Fit, rivals: Sequence[Hypothesis]) -> list[Hypothesis]:
    """What reads nearly as the first set does, nearest first."""
    most = first.misfit_with_prior + tuned.NEAREST_WITHIN * tuned.NEAR_MISFIT
    close = [h for h in rivals if h.fit.misfit_with_prior < most]
    readings = FollowedReadings(SetProblems(problem, problem))
    nearest = sorted((readings.apart(first, h.fit), i, h) for i, h in enumerate(close))[
        : tuned.NEAREST_REFITTED
    ]
    return [h for distance, _, h in nearest if distance < tuned.NEAREST_WITHIN * tuned.NEAR_READINGS]


def fitted_sets(problems: SetProblems, chosen: Sequence[Hypothesis], workers: Workers) -> list[Hypothesis]:
    """Hypotheses fitted on a larger basis, each to its own problem; the first one first."""
    first = chosen[0]
    # Sets far behind the first need not be fitted to their optimum, but for nothing, from which gains count.
    begun = problems.of(first.fit).cost_at(first.fit.candidates, first.fit.values)
    behind = begun + 2.0 * tuned.HOPELESS_SCORE
    orders = [
        FitOrder(h.fit.candidates, h.fit.values, iterations=12, hopeless=behind if h.keys else np.inf)
        for h in chosen
    ]
    # A set that could be simulated on the search's basis may run away on the whole one, and is dropped then.
    fitted = [
        replace(item, fit=fit)
        for fit, item in zip(workers.fits([problems.of(h.fit) for h in chosen], orders), chosen, strict=True)
        if fit is not None
    ]
    ends = [[more.fit.values for more in fitted if h.keys < more.keys] for h in fitted]
    begun = workers.done(
        [problems.of(h.fit) for h in fitted],
        [partial(_begun_with_more, fit=h.fit, ends=own) for h, own in zip(fitted, ends, strict=True)],
    )
    fitted = [
        replace(h, fit=of_candidates(fit, h.fit.candidates)) for h, fit in zip(fitted, begun, strict=True)
    ]
    return sorted(with_other_answers(problems, fitted, workers), key=lambda h: -h.score)


def _begun_with_more(problem: Problem, fit: Fit, ends: Sequence[Mapping[str, float]]) -> Fit:
    """A set fitted again from where those that hold more ended, if it begins better there.

    Where a further member does nothing, the fit of the rest has ended elsewhere.
    """
    for values in ends:
        if problem.begins_better(fit, values):
            fit = problem.fit(fit.candidates, values)
    return fit


def likelier_about(problem: Problem, fit: Fit) -> bool:
    """Whether a set is likelier by what directions do in another problem than in that of its own fit.

    By more than what a fit that begins at the end of another gains anyway: all sets are fitted again then.
    """
    try:
        again = problem.fit(fit.candidates, fit.values)
    except NOT_SIMULATED:
        return False
    return again.misfit_with_prior < fit.misfit_with_prior - 2.0 * tuned.WORTH_ANOTHER
