"""A hypothesis: a set of candidates at their most probable values, with how probable the set is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis_fit import Fit


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A fitted set of candidates.

    Attributes
    ----------
    log_prior : float
        Logarithm of the prior of the set and of the choice of its intervals.
    deviance : float or None
        Minus twice the logarithm of likelihood and prior of the values, under the slow error that is most
        probable here; None while all hypotheses share one slow error.
    course_share : float
        Share of what hidden states gain that the choice of their courses costs: readings are less likely
        with states that may take any course than with those that were found.
    course_cost : float
        That cost where the set was found, as a logarithm.
    heldout : float or None
        Minus twice the logarithm of the likelihood of held-out readings; None where there are none.
    expected_misfit : float
        Misfit for each datum under the errors that were expected before these readings.
    """

    fit: Fit
    log_prior: float
    deviance: float | None = None
    course_share: float = 0.0
    course_cost: float = 0.0
    heldout: float | None = None
    expected_misfit: float = 1.0

    @property
    def misfit(self) -> float:
        """Quantity compared between hypotheses: half its difference is a logarithm of likelihoods."""
        return self.fit.misfit_with_prior if self.deviance is None else self.deviance

    @property
    def score(self) -> float:
        """Logarithm of evidence times prior."""
        return self.fit.log_evidence + self.log_prior - self.course_cost

    def course_kept(self, coarseness: float) -> float:
        """Share of a gain that is left when the choice of courses is paid.

        On a coarse machine twice: a course follows what its nodes leave as well, which is no noise.
        """
        return 1.0 - min(1.0, self.course_share * (tuned.COARSE_COURSES if coarseness > 1.0 else 1.0))

    @property
    def keys(self) -> frozenset[tuple[str, str, int | None]]:
        """Effects, places and recordings."""
        return self.fit.keys


@dataclass(frozen=True, slots=True)
class Ranked:
    """All forms of one set of effects at their places.

    Attributes
    ----------
    best : Hypothesis
        Most probable form.
    """

    best: Hypothesis
    probability: float

    @property
    def fit(self) -> Fit:
        """Fit of the most probable form."""
        return self.best.fit


def identity(candidates: Iterable[Candidate]) -> frozenset:
    """Identity of a set of candidates: effects, places, recordings, forms and numbers of free parameters."""
    return frozenset((*c.key, c.form, len(c.free)) for c in candidates)
