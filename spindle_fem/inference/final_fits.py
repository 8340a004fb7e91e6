"""Final fits: which sets of a search are fitted again on a larger basis, each about its own machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from spindle_fem.inference import tuned
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem
from spindle_fem.inference.like_sets import free_in_time, may_stand_for
from spindle_fem.inference.other_answers import with_other_answers
from spindle_fem.inference.set_odds import tempered
from spindle_fem.inference.set_problems import SetProblems, combination_of
from spindle_fem.inference.worker_processes import FitOrder, Workers, of_candidates


def few_of_each(ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Sets without more than a few places and forms of one combination of effects, which hide the others."""
    seen: Counter[tuple[str, ...]] = Counter()
    found = []
    for item in ranked:
        names = combination_of(item.fit)
        seen[names] += 1
        if seen[names] <= tuned.REFITTED_OF_EACH:
            found.append(item)
    return found


def to_be_fitted(
    problem: Problem,
    found: Sequence[Hypothesis],
    overlapping: Mapping[str, frozenset[str]],
    coarseness: float,
) -> list[Hypothesis]:
    """The most probable hypotheses, the first of them first, what reads nearly as it, and the empty one."""
    score = {id(h): value for h, value in zip(found, tempered(found, coarseness), strict=True)}
    everything = sorted(found, key=lambda h: -score[id(h)])
    # Whether anything is missing is a separate question (the p-value): here sets are compared.
    ranked = [h for h in everything if h.keys] or everything
    best = score[id(ranked[0])]
    # Links of a network differ by more than spots of a machine do.
    different = few_of_each(ranked) if coarseness == 1.0 else ranked
    chosen = [
        item
        for position, item in enumerate(different[: tuned.REFITTED])
        if position < tuned.ALWAYS_REFITTED or score[id(item)] > best - tuned.NEGLIGIBLE_SCORE
    ]
    # The slow error has changed since the search: test again whether the best set needs each member.
    members = ranked[0].keys
    smaller = [h for h in ranked if h.keys < members and len(h.keys) == len(members) - 1]
    chosen += [h for h in smaller if h not in chosen]
    for size in range(len(members)):
        chosen += [h for h in everything if len(h.fit.candidates) == size and h not in chosen][:1]
    first = ranked[0].fit
    if coarseness > 1.0 and free_in_time(first):
        # Laws that leave little of a coarse machine come before what may be on at any time.
        for size in range(1, len(members) + 1):
            laws = [h for h in ranked if len(h.keys) == size and not free_in_time(h.fit)]
            chosen += [h for h in laws[: tuned.LAWS_REFITTED] if h not in chosen]
    if coarseness > 1.0:
        # What leaves least of a coarse machine is told, though other sets are likelier.
        for size in range(1, 1 + max(len(h.keys) for h in ranked)):
            own = [h for h in ranked if len(h.keys) == size]
            chosen += [h for h in sorted(own, key=lambda h: h.fit.misfit_with_prior)[:1] if h not in chosen]
    rivals = [
        h
        for h in ranked
        if h not in chosen
        and may_stand_for(h.fit, first, overlapping)
        and h.fit.misfit_with_prior < first.misfit_with_prior + tuned.NEAREST_WITHIN * tuned.NEAR_MISFIT
    ]
    readings = FollowedReadings(SetProblems(problem, problem))
    nearest = sorted((readings.apart(first, h.fit), i, h) for i, h in enumerate(rivals))
    chosen += [
        h
        for distance, _, h in nearest[: tuned.NEAREST_REFITTED]
        if distance < tuned.NEAREST_WITHIN * tuned.NEAR_READINGS
    ]
    return chosen


def fitted_sets(problems: SetProblems, chosen: Sequence[Hypothesis], workers: Workers) -> list[Hypothesis]:
    """Hypotheses fitted on a larger basis, each to its own problem; the first one first."""
    first = chosen[0]
    # Sets far behind the first need not be fitted to their optimum, but for its parts: they are what is
    # named where the rest of it is not needed.
    begun = problems.of(first.fit).cost_at(first.fit.candidates, first.fit.values)
    behind = begun + 2.0 * tuned.HOPELESS_SCORE
    orders = [
        FitOrder(
            h.fit.candidates, h.fit.values, iterations=12, hopeless=np.inf if h.keys < first.keys else behind
        )
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
