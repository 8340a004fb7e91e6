"""Several answers of one set: fits from every start of an effect, and draws of the belief over all of them.

Rings that meet the housing early and rings that hardly ever do explain friction each in a way of their own.
A search ranks such starts to first order and follows one. Sets that may be named are fitted
from the others as well; the most probable answer stands, the rest counts in what is stated with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.set_problems import SetProblems
from spindle_fem.inference.worker_processes import FitOrder, Workers

Array = NDArray[np.float64]


def other_starts(fit: Fit) -> list[Mapping[str, float]]:
    """Starts of a set's members but for those nearest to where its fit ended, in units of the priors."""
    where = {c.name: (c, u) for c, u in zip(fit.coordinates, fit.position, strict=True)}
    found: list[Mapping[str, float]] = []
    for candidate in fit.candidates:
        if effect_of(candidate.effect).starts_are_answers:
            apart = [
                sum((where[name][0].of(value) - where[name][1]) ** 2 for name, value in start.items())
                for start in candidate.starts
            ]
            nearest = int(np.argmin(apart))
            found += [start for index, start in enumerate(candidate.starts) if index != nearest]
    return found


def with_other_answers(
    problems: SetProblems, fitted: Sequence[Hypothesis], workers: Workers
) -> list[Hypothesis]:
    """Fitted sets at the most probable answer of each, with their other ones; sets far behind unchanged.

    A set that holds a likelier one begins again only where that one has moved to another answer.
    """
    far = max(h.score for h in fitted) - tuned.NEGLIGIBLE_SCORE
    starts = [other_starts(h.fit) if h.score > far else [] for h in fitted]
    parts = [
        [i for i, o in enumerate(fitted) if own and starts[i] and o.keys < h.keys and o.score > h.score]
        for h, own in zip(fitted, starts, strict=True)
    ]
    first = [[] if held else own for own, held in zip(starts, parts, strict=True)]
    found = _from_starts(problems, fitted, first, workers)
    moved = [any(f is h.fit for f in new.fit.others) for new, h in zip(found, fitted, strict=True)]
    again = [[found[i].fit.values for i in held if moved[i]][:1] for held in parts]
    return _from_starts(problems, found, again, workers)


def _from_starts(
    problems: SetProblems,
    fitted: Sequence[Hypothesis],
    starts: Sequence[Sequence[Mapping[str, float]]],
    workers: Workers,
) -> list[Hypothesis]:
    """Sets fitted from further starts, which say where to begin beside their fits, and taken as one."""
    tasks = [
        (
            index,
            FitOrder(
                h.fit.candidates,
                h.fit.values | dict(start),
                tuned.START_SHARES,
                h.fit.misfit_with_prior + 2.0 * tuned.NEGLIGIBLE_SCORE,
            ),
        )
        for index, (h, own) in enumerate(zip(fitted, starts, strict=True))
        for start in own
    ]
    answers = [[h.fit] for h in fitted]
    own = [problems.of(fitted[index].fit) for index, _ in tasks]
    for (index, _), fit in zip(tasks, workers.fits(own, [order for _, order in tasks]), strict=True):
        if fit is not None:
            answers[index].append(fit)
    return [
        h if len(own) == 1 else replace(h, fit=_as_one(own)) for h, own in zip(fitted, answers, strict=True)
    ]


def _as_one(fits: Sequence[Fit]) -> Fit:
    """The most probable of several fits of a set, which holds those that ended elsewhere."""
    best, *rest = sorted(fits, key=lambda fit: -fit.log_evidence)
    others: list[Fit] = []
    for fit in rest:
        if all(_is_another(fit, known) for known in (best, *others)):
            others.append(fit)
    return replace(best, others=tuple(others))


def _is_another(one: Fit, other: Fit) -> bool:
    """Whether two fits of a set ended farther apart than either is sure of, in what its starts set."""
    names = {name for start in other_starts(one) for name in start}
    rows = [index for index, c in enumerate(one.coordinates) if c.name in names]
    apart = np.abs(one.position - other.position)
    return any(apart[i] ** 2 > max(one.covariance[i, i], other.covariance[i, i]) for i in rows)


def draws_of(fit: Fit, generator: np.random.Generator, number: int) -> Array:
    """Draws (number, p) of the coordinates of a set, from all of its answers by what each of them holds.

    The belief that intervals are stated of counts misfits ``tuned.INTERVAL_WIDENING`` squared times less than
    fits do, and by what the best answer leaves beyond the noise.
    """
    answers = (fit, *fit.others)
    divisor = tuned.INTERVAL_WIDENING**2 * max(fit.reduced_misfit, 1.0)
    volume = [0.5 * float(np.linalg.slogdet(item.covariance)[1]) for item in answers]
    weight = np.array(volume) - 0.5 * np.array([item.misfit_with_prior for item in answers]) / divisor
    share = np.exp(weight - weight.max())
    counts = generator.multinomial(number, share / share.sum()) if fit.others else [number]
    return np.concatenate(
        [
            generator.multivariate_normal(a.position, divisor * a.covariance, count, method="eigh")
            for a, count in zip(answers, counts, strict=True)
        ]
    )
