"""Hypotheses of states that switch at unrecorded times: found, fitted and followed again in turn.

The course of a state and the parameters of the machine are found in turn: the course that explains the
residual of a fit, the fit with heat or cooling on in just these intervals, the course about that fit, as long
as the likelihood grows. A set with a state has one more free number than without; the cost of choosing its
course is its likelihood over that of all courses under the fitted chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.interval_effect import IntervalEffect
from spindle_fem.effects.framework.unrecorded import STATES
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hidden_states import (
    answer_of,
    conditions_of_inputs,
    intervals_of,
    levels_of,
    readings_about,
    without,
)
from spindle_fem.inference.hypothesis import Hypothesis, identity
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem, amplitude_name
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.missing_heat import Pattern
from spindle_fem.inference.switching_model import (
    QUICK,
    THOROUGH,
    Chain,
    Course,
    ReadingFilter,
    find_course,
    with_another_level,
)

Array = NDArray[np.float64]

# Shares of the usual size from which courses are looked for.
START_SIZES = (0.3, 1.5)
# Fewer intervals than this are single events, whose edges are free.
FEWEST = 4


@dataclass(frozen=True, slots=True)
class StatePlace:
    """Place of a possible switching state: an effect, its spot, and the recording."""

    effect: IntervalEffect
    pattern: Pattern
    recording: int


def state_places(search: Search) -> list[StatePlace]:
    """Every spot of every effect in every recording."""
    return [
        StatePlace(effect, pattern, number)
        for number in range(len(search.problem.predictor.recordings))
        for effect, pattern in search.patterns()
    ]


def add_states(search: Search, fit: Fit, number: int = tuned.STATE_PLACES) -> None:
    """Fit the sets with a state beside what a fit holds, at the most promising places.

    Beside what switches or changes its level already another may, elsewhere or by another effect.
    """
    if sum(map(search.in_intervals, fit.candidates)) > 1:
        return
    problem = search.problem
    recordings = range(len(problem.predictor.recordings))
    readings = [ReadingFilter(readings_about(problem, fit, n)) for n in recordings]
    bases = [BaseRun(problem.predictor, n, fit.values, fit.candidates) for n in recordings]
    found: list[tuple[float, StatePlace, Course]] = []
    for place in state_places(search):
        if search.holds(fit, place.effect.name, place.pattern.spot, place.recording):
            continue
        courses = _courses(search, bases[place.recording], readings[place.recording], place)
        found += [(course.log_evidence, place, course) for course in courses]
    found.sort(key=lambda item: -item[0])
    settled: list[StatePlace] = []
    for evidence, place, course in found:
        if len(settled) == number or evidence < tuned.FAIR_SHARE * found[0][0]:
            break
        if place not in settled:
            settled.append(place)
            settle(search, fit, place, course)


def settle_best(search: Search) -> None:
    """Follow the state of the best set again, about a fit that holds its other effects too.

    Also without each of the others, and as another effect at the same spot: whether heat or cooling switches
    shows in how its power follows temperatures, which what else is missing hides while a state is first
    looked for. And at one level more. What the best set has in intervals may be a state that was hidden so
    far.
    """
    fit = search.ranked()[0].fit
    for candidate in fit.candidates:
        if search.is_hidden_state(candidate):
            if len(fit.candidates) > 1:
                _settle_again(search, fit, candidate)
            _settle_levels(search, fit, candidate)
        elif search.in_intervals(candidate) and search.problem.predictor.is_network:
            _settle_intervals(search, fit, candidate)


def _settle_again(search: Search, fit: Fit, candidate: Candidate) -> None:
    """The state of a set once more, beside all and beside all but one of its other effects, and as a twin."""
    place, course, _ = search.courses[candidate.amplitude]
    again = course_about(search, fit, place, candidate, course)
    if again is None:
        return
    settle(search, fit, place, again, candidate)
    for other in fit.candidates:
        if other is not candidate:
            begun = search.problem.simulated(*without(fit, other))
            if begun is not None:
                settle(search, begun, place, again, candidate)
    twin = _twin(search, fit, place, candidate, tuned.FAIR_SHARE * again.log_evidence)
    if twin is not None:
        settle(search, fit, *twin, candidate)


def _settle_levels(search: Search, fit: Fit, candidate: Candidate) -> None:
    """The state of a set at one level more, where that is likelier."""
    place, course, _ = search.courses[candidate.amplitude]
    about = _about(search.problem, fit, place.recording, candidate)
    if about is None:
        return
    spread = 2.0 * max(_usual(search, place), course.size)
    more = with_another_level(answer_of(about[0], place.pattern), about[1], course, spread, QUICK)
    if more is not None:
        settle(search, fit, place, more, candidate)


def _about(
    problem: Problem, fit: Fit, number: int, candidate: Candidate, *, everything: bool = False
) -> tuple[BaseRun, ReadingFilter] | None:
    """Run of a fit without a candidate, and what that leaves; None where nothing else can be simulated."""
    rest, values = without(fit, candidate)
    try:
        base = BaseRun(problem.predictor, number, values, rest)
        return base, ReadingFilter(readings_about(problem, fit, number, candidate, everything=everything))
    except NOT_SIMULATED:
        return None


def _settle_intervals(search: Search, fit: Fit, candidate: Candidate) -> None:
    """A state in the stead of an effect in intervals, where something may switch at its place."""
    number = candidate.recording or 0
    wanted = candidate.effect, candidate.component, number
    places = {(p.effect.name, p.pattern.spot, p.recording): p for p in state_places(search)}
    if wanted not in places:
        # A level may change at more places than those that may switch.
        return
    place = places[wanted]
    about = _about(search.problem, fit, number, candidate)
    if about is None:
        return
    best = max(_courses(search, *about, place), key=lambda course: course.log_evidence, default=None)
    if best is not None:
        settle(search, fit, place, best, candidate)
        # Laws may have compensated for parts of the state that the intervals miss.
        if len(fit.candidates) > 1:
            settle(search, search.problem.fit(), place, best)


def _twin(
    search: Search, fit: Fit, place: StatePlace, candidate: Candidate, least: float
) -> tuple[StatePlace, Course] | None:
    """Another effect at the spot of a state, with the course that is likeliest in that state's stead.

    ``least`` is the evidence from which it is worth a fit.
    """
    about = _about(search.problem, fit, place.recording, candidate)
    if about is None:
        return None
    found = [
        (course.log_evidence, other, course)
        for other in state_places(search)
        if other.effect != place.effect
        and other.recording == place.recording
        and set(other.pattern.places) & set(place.pattern.places)
        for course in _courses(search, *about, other)
    ]
    best = max(found, key=lambda item: item[0], default=None)
    return None if best is None or best[0] < least else best[1:]


def _courses(search: Search, base: BaseRun, readings: ReadingFilter, place: StatePlace) -> Iterator[Course]:
    """Courses of something that switches at a place, from each of the sizes that are tried."""
    answer = answer_of(base, place.pattern)
    chain = Chain.usual(np.zeros(len(answer.group), dtype=np.int64))
    usual = _usual(search, place)
    for share in START_SIZES:
        course = find_course(answer, readings, chain, share * usual, 2.0 * usual, QUICK)
        if course is not None and course.log_evidence > 0.0:
            yield course


def settle(
    search: Search, fit: Fit, place: StatePlace, course: Course, left_out: Candidate | None = None
) -> None:
    """Course and fit in turn; the best of them is kept unless such a set was likelier before."""
    rest, values = (fit.candidates, dict(fit.values)) if left_out is None else without(fit, left_out)
    known = dict(search.courses)
    best = _best_in_turn(search, rest, values, place, course)
    earlier = None if best is None else search.found.get(identity(best.fit.candidates))
    if best is not None and (earlier is None or earlier.score < best.score):
        search.keep(best)
    else:
        search.courses = known


def _best_in_turn(
    search: Search, rest: Sequence[Candidate], values: Mapping[str, float], place: StatePlace, course: Course
) -> Hypothesis | None:
    """Course and fit in turn, beside other effects; the best of them, its course being the search's."""
    problem = search.problem
    best: Hypothesis | None = None
    for _ in range(tuned.COURSE_ROUNDS):
        grid = problem.predictor.drives[place.recording].grid
        if len(intervals_of(course.on, grid)) < FEWEST:
            return None
        shares = course.shares_at(levels_of(course.level))
        candidate = state_candidate(search, place, intervals_of(course.level, grid), shares, course.size)
        size = course.size / values.get(candidate.sized_by, 1.0)
        fitted = problem.simulated((*rest, candidate), values | {amplitude_name(candidate): size})
        if fitted is None:
            return None
        numbers = len(course.chain.begin) + len(course.shares) - 1
        paid = course.log_choice + numbers * float(np.log(len(course.level)))
        known = search.courses.get(candidate.amplitude)
        search.courses[candidate.amplitude] = place, course, paid / (course.log_evidence + course.log_choice)
        hypothesis = search.hypothesis(fitted)
        gain = np.inf if best is None else hypothesis.score - best.score
        if gain > 0.0:
            best = hypothesis
        else:
            search.courses[candidate.amplitude] = known
        if gain < tuned.WORTH_ANOTHER:
            break
        values = fitted.values
        again = course_about(search, fitted, place, candidate, course)
        if again is None or np.array_equal(again.level, course.level):
            break
        course = again
    return best


def course_about(
    search: Search,
    fit: Fit,
    place: StatePlace,
    candidate: Candidate,
    course: Course,
    *,
    everything: bool = False,
    effort: tuple[int, int] = THOROUGH,
) -> Course | None:
    """The course again, about a fit that holds one already: at one level where its second is never on."""
    about = _about(search.problem, fit, place.recording, candidate, everything=everything)
    if about is None:
        return None
    base, readings = about
    size = fit.values[amplitude_name(candidate)] * fit.values.get(candidate.sized_by, 1.0)
    chain = best_chain(base, course.chain, course)
    answer, spread = answer_of(base, place.pattern), 2.0 * max(_usual(search, place), size)
    found = find_course(answer, readings, chain, size, spread, effort, course.shares)
    if found is None and len(course.shares) > 1:
        found = find_course(answer, readings, chain, size, spread, effort)
    return found


def best_chain(base: BaseRun, chain: Chain, course: Course) -> Chain:
    """Rates of their own while an input is zero, where that makes the course more likely than it costs."""
    best, gain = chain, -np.inf
    for condition in (np.zeros(len(course.on), dtype=np.int64), *conditions_of_inputs(base).values()):
        trial = Chain.usual(condition).fitted(course.probability)
        own = trial.log_likelihood(course.on) - len(trial.begin) * float(np.log(len(course.on)))
        if own > gain:
            best, gain = trial, own
    return best


def _usual(search: Search, place: StatePlace) -> float:
    probe = place.effect.over(search.view, place.pattern.spot, [(0.0, 1.0)])
    return float(probe.parameters[probe.amplitude].sigma)


def state_candidate(
    search: Search,
    place: StatePlace,
    intervals: Sequence[tuple[float, float]],
    shares: Sequence[float],
    size: float,
    blurred: float = 0.0,
) -> Candidate:
    """Something on in intervals at these shares of a size, W or W/K."""
    shares = shares if any(share != 1.0 for share in shares) else ()
    found = place.effect.over(
        search.view, place.pattern.spot, intervals, course=STATES, sizes=shares, blurred=blurred
    )
    return search.of_recording(found, place.recording, size)
