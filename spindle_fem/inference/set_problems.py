"""The problem of every set: what drawings leave open, worked out about the machine with that set.

A channel moved by two millimetres does one thing where oil flows and another where it is fouled: to first
order what a direction does holds near the state it was worked out about. A set judged by what directions do
beside another one would be judged by a machine that it denies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem
from spindle_fem.inference.misdescription_columns import columns_about
from spindle_fem.inference.worker_processes import Workers

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SetProblems:
    """Problems with the same recordings, belief and noise.

    Attributes
    ----------
    plain : Problem
        With nothing missing.
    first : Problem
        Of every set that has none of its own.
    own : mapping
        Of other sets, by their effects.
    """

    plain: Problem
    first: Problem
    own: Mapping[tuple[str, ...], Problem] = field(default_factory=dict)

    def of(self, fit: Fit) -> Problem:
        """The problem that a fit is of."""
        return self.own.get(combination_of(fit), self.first) if fit.candidates else self.plain

    def about(self, fits: Sequence[Fit], workers: Workers) -> SetProblems:
        """With one of its own for every other combination of effects, about the first set of each.

        Combinations that cannot be simulated have that of the first set.
        """
        directions = self.first.predictor.misdescribed
        new: dict[tuple[str, ...], Fit] = {}
        for fit in fits:
            if fit.candidates and combination_of(fit) not in self.own:
                new.setdefault(combination_of(fit), fit)
        if not new or not directions:
            return self
        jobs = [partial(_columns, values=fit.values, candidates=fit.candidates) for fit in new.values()]
        own = dict(self.own)
        for (names, fit), columns in zip(new.items(), workers.done(self.first, jobs), strict=True):
            if columns is not None:
                about = fit.values, fit.candidates
                predictor = self.first.predictor.misdescribed_by(directions, columns, about)
                own[names] = replace(self.first, predictor=predictor)
        return SetProblems(self.plain, self.first, own)


def combination_of(fit: Fit) -> tuple[str, ...]:
    """Effects of a set, wherever they are and whatever their forms: directions do much the same then.

    With the channel of those that make one late, as its own delay does nothing beside them.
    """
    return tuple(
        sorted(
            f"{c.effect}@{c.component}" if effect_of(c.effect).delays else c.effect for c in fit.candidates
        )
    )


def _columns(
    problem: Problem, values: Mapping[str, float], candidates: Sequence[Candidate]
) -> dict[tuple[int, str], Array] | None:
    """What directions do about a set; None where it cannot be simulated."""
    try:
        return columns_about(problem.predictor, problem.predictor.misdescribed, values, candidates)
    except NOT_SIMULATED:
        return None
