"""Fits of several hypotheses at once, in processes of their own where there are cores for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from joblib import Parallel, delayed, parallel_config

from spindle_fem.diagnosis.inference import MOST_ITERATIONS, Fit, Problem, amplitude_name
from spindle_fem.effects.base import Candidate
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError


@dataclass(frozen=True, slots=True)
class FitOrder:
    """One fit that is wanted.

    Attributes
    ----------
    candidates : tuple of Candidate
    start : mapping of str to float
        Values to begin from, by name.
    shares : tuple of float
        Of the amplitudes at the start, tried one after the other until the set can be simulated.
    hopeless : float
        As :meth:`Problem.fit` takes it.
    iterations : int
    """

    candidates: tuple[Candidate, ...]
    start: Mapping[str, float]
    shares: tuple[float, ...] = (1.0,)
    hopeless: float = float("inf")
    iterations: int = MOST_ITERATIONS


def fit_order(problem: Problem, order: FitOrder) -> Fit | None:
    """Fit; None where the set cannot be simulated from any share of its amplitudes."""
    for share in order.shares:
        values = dict(order.start)
        for candidate in order.candidates:
            name = amplitude_name(candidate)
            if name in values:
                values[name] = candidate.null + share * (values[name] - candidate.null)
        try:
            return problem.fit(order.candidates, values, iterations=order.iterations, hopeless=order.hopeless)
        except (ConvergenceError, OutOfValidityError, SpecError):
            continue
    return None


class Workers:
    """Who fit: this process alone, or several beside it.

    Parameters
    ----------
    number : int
        Processes; 1 is this one. They end when idle for some minutes.
    """

    def __init__(self, number: int = 1) -> None:
        self._number = number

    def fits(self, problem: Problem, orders: Sequence[FitOrder]) -> list[Fit | None]:
        """Fits in the order asked for, with the candidates that were given.

        Parameters
        ----------
        problem : Problem
        orders : sequence of FitOrder
        """
        if self._number == 1 or len(orders) == 1:
            return [fit_order(problem, order) for order in orders]
        with parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = Parallel(n_jobs=self._number)
            found = parallel(delayed(fit_order)(problem, order) for order in orders)
        # Candidates are known by identity; those that come back are copies.
        return [
            None if fit is None else replace(fit, candidates=order.candidates)
            for fit, order in zip(found, orders, strict=True)
        ]
