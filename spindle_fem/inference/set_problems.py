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
        Of other sets, by the amplitudes of their members.
    """

    plain: Problem
    first: Problem
    own: Mapping[frozenset[str], Problem] = field(default_factory=dict)

    def of(self, fit: Fit) -> Problem:
        """The problem that a fit is of."""
        return self.own.get(members_of(fit), self.first) if fit.candidates else self.plain

    def about(self, fits: Sequence[Fit], workers: Workers) -> SetProblems:
        """With one of its own for every other set that can be simulated on the whole basis."""
        directions = self.first.predictor.misdescribed
        new = {members_of(fit): fit for fit in fits if fit.candidates and members_of(fit) not in self.own}
        if not new or not directions:
            return self
        jobs = [partial(_columns, values=fit.values, candidates=fit.candidates) for fit in new.values()]
        own = dict(self.own)
        for (members, fit), columns in zip(new.items(), workers.done(self.first, jobs), strict=True):
            if columns is not None:
                about = fit.values, fit.candidates
                predictor = self.first.predictor.misdescribed_by(directions, columns, about)
                own[members] = replace(self.first, predictor=predictor)
        return SetProblems(self.plain, self.first, own)


def members_of(fit: Fit) -> frozenset[str]:
    """What a set is known by here, whatever intervals its members have."""
    return frozenset(candidate.amplitude for candidate in fit.candidates)


def _columns(
    problem: Problem, values: Mapping[str, float], candidates: Sequence[Candidate]
) -> dict[tuple[int, str], Array] | None:
    """What directions do about a set; None where it cannot be simulated."""
    try:
        return columns_about(problem.predictor, problem.predictor.misdescribed, values, candidates)
    except NOT_SIMULATED:
        return None
