"""Work on one problem at once, fits of several hypotheses above all, in processes of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference.hypothesis_fit import MOST_ITERATIONS, NOT_SIMULATED, Fit, Problem, amplitude_name
from spindle_fem.parallel import Shared, StandingCopies, WorkerPool, can_be_copied, in_copies, start_copy


@dataclass(frozen=True, slots=True)
class FitOrder:
    """One fit to compute.

    Attributes
    ----------
    start : mapping of str to float
        Values to begin from, by name.
    shares : tuple of float
        Factors on the amplitudes at the start, tried one after the other until the set can be simulated.
    hopeless : float
        As :meth:`Problem.fit` takes it.
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
        except NOT_SIMULATED:
            continue
    return None


def of_candidates(fit: Fit, candidates: Sequence[Candidate]) -> Fit:
    """A fit that came back from another process: candidates are identified by object, those are copies."""
    return replace(fit, candidates=tuple(candidates))


def _on_problem(problem: Shared[Problem], job: Callable[[Problem], Any]) -> Any:
    return job(problem.value)


class Workers:
    """Processes that fit: this one alone, or several with it.

    Parameters
    ----------
    number : int
        Processes, this one among them. The others end when idle for some minutes.
    """

    def __init__(self, number: int = 1) -> None:
        self._number, self._pool = number, WorkerPool(number)
        self._shared: dict[int, Shared[Problem]] = {}
        self._copies: StandingCopies[Problem] | None = None

    def wake(self) -> None:
        """Start the other processes, where that takes them seconds, while this one has other things to do."""
        if not can_be_copied():
            self._pool.wake()

    def fits(self, problem: Problem | Sequence[Problem], orders: Sequence[FitOrder]) -> list[Fit | None]:
        """Fits in the order given, with the candidates that were given; to one problem or each to its own."""
        fits = self.done(problem, [partial(fit_order, order=order) for order in orders])
        return [
            None if fit is None else of_candidates(fit, order.candidates)
            for fit, order in zip(fits, orders, strict=True)
        ]

    def done(
        self, problem: Problem | Sequence[Problem], jobs: Sequence[Callable[[Problem], Any]]
    ) -> list[Any]:
        """Result of each job on the problem, in order.

        Parameters
        ----------
        problem : Problem or sequence of Problem
            One for all jobs, or one for each.
        jobs : sequence of callable
            That can be sent to another process: functions of modules, perhaps with some arguments given.
        """
        if isinstance(problem, Problem) and can_be_copied():
            return self._copies_with(problem).map(jobs)
        problems = [problem] * len(jobs) if isinstance(problem, Problem) else problem
        if can_be_copied():
            return in_copies(
                [partial(job, own) for job, own in zip(jobs, problems, strict=True)], self._number
            )
        known = {
            key: item for key, item in self._shared.items() if any(item.value is own for own in problems)
        }
        self._shared = known | {id(own): Shared(own) for own in problems if id(own) not in known}
        orders = [
            partial(_on_problem, self._shared[id(own)], job) for job, own in zip(jobs, problems, strict=True)
        ]
        return self._pool.map(orders)

    def _copies_with(self, problem: Problem) -> StandingCopies[Problem]:
        """Copies that have a problem: those that are there, for the problem of a search; else new ones."""
        if self._copies is None or self._copies.value is not problem:
            if self._copies is not None:
                self._copies.close()
            self._copies = StandingCopies(problem, self._number)
        return self._copies

    def beside(self, jobs: Sequence[Callable[[], Any]]) -> list[Any]:
        """Result of each job, in order; in this process alone where it cannot be copied.

        Parameters
        ----------
        jobs : sequence of callable
            That need not be sent: methods of what only this process has.
        """
        return in_copies(jobs, self._number)

    def ahead(self, job: Callable[[], Any]) -> Callable[[], Any]:
        """Start a job in another process; the returned function waits for what it makes.

        Where there is no other process the job is done when it is waited for.

        Parameters
        ----------
        job : callable
            That can be sent, as those of :meth:`done`.
        """
        return start_copy(job) if self._number > 1 and can_be_copied() else self._pool.start(job)
