"""Hypotheses of states that switch at unrecorded times: found, fitted and followed again in turn.

The course of a state and the parameters of the machine are found in turn: the course that explains the
residual of a fit, the fit with heat or cooling on in just these intervals, the course about that fit, as long
as the likelihood grows. A set with a state has one more free number than without; the cost of choosing its
course is its likelihood over that of all courses under the fitted chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

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
from spindle_fem.inference.hypothesis_search import BLUR, Search
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.missing_heat import Pattern, stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.switching_model import (
    QUICK,
    THOROUGH,
    Chain,
    Course,
    ReadingFilter,
    find_course,
    with_another_level,
)
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Shares of the usual size from which courses are looked for.
START_SIZES = (0.3, 1.5)
# Fewer intervals than this are single events, whose edges are free.
FEWEST = 4
# Intervals from which on they are followed in held-out stretches like a state, where their sizes differ by no
# more than this factor.
SEVERAL, ONE_SIZE = 2, 1.5
# Rounds in which several states are inferred in turn.
SEVERAL_ROUNDS = 2
# Courses side by side and rounds on the rows of a recording, ten times as many as the steps of a fit.
ON_ROWS = (32, 3)
# Share of the time on within which an input is zero that makes it its gate, that it exceeds chance by, and
# from which there is nothing else.
MOSTLY_INSIDE, TELLS, ONLY = 0.75, 0.1, 0.97


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


@dataclass(frozen=True, slots=True)
class InferredState:
    """A hidden state inferred from all readings, including those held out from fits.

    Attributes
    ----------
    candidate : Candidate
        With these intervals.
    probability : tuple of float
        Of being on, mean over each interval.
    gate : str
        Input that is zero while it is mostly on; empty where none is.
    inside : float
        Share of its time for which that input is zero.
    filled : float
        Share of the time for which the input is zero that it is on.
    fitted : Candidate or None
        With edges as wide as the steps of a fit need, where its intervals begin and end within those.
    """

    candidate: Candidate
    probability: tuple[float, ...]
    gate: str = ""
    inside: float = 0.0
    filled: float = 0.0
    fitted: Candidate | None = None

    @property
    def words(self) -> str:
        """Times when it is on, as a sentence; empty if no input indicates them."""
        if not self.gate:
            return ""
        often = "only" if self.inside > ONLY else "mostly"
        always = (
            "" if self.filled > ONLY else f", but not always then ({100.0 * self.filled:.0f} % of that time)"
        )
        return f" It is on {often} while {self.gate} is zero{always}."


def inferred_states(
    search: Search, problem: Problem, fit: Fit, effort: tuple[int, int] = THOROUGH
) -> dict[str, InferredState]:
    """Every hidden state of a fit inferred from all readings, by the name of its amplitude.

    On the steps of the problem, which may be others than those of the search. Likewise what is on in several
    intervals at one size: no fitted reading shows those that held-out stretches hide.
    """
    hidden = [
        c.amplitude
        for c in fit.candidates
        if search.is_hidden_state(c) or _as_state(search, problem, fit, c) is not None
    ]
    found: dict[str, InferredState] = {}
    # Of several each depends on what the others did where no fitted reading tells.
    for _ in range(min(len(hidden), SEVERAL_ROUNDS)):
        for name in hidden:
            state = _inferred(search, problem, fit, name, effort)
            if state is not None:
                found[name] = state
                candidates = tuple(state.candidate if c.amplitude == name else c for c in fit.candidates)
                fit = replace(fit, candidates=candidates)
    return found


def _inferred(
    search: Search, problem: Problem, fit: Fit, name: str, effort: tuple[int, int]
) -> InferredState | None:
    """One hidden state of a fit inferred from all readings; None where nothing switches."""
    candidate = next(c for c in fit.candidates if c.amplitude == name)
    own = replace(search, problem=problem)
    switched = search.is_hidden_state(candidate)
    place, course = search.courses[name][:2] if switched else _as_state(search, problem, fit, candidate)
    drive = problem.predictor.drives[place.recording]
    if switched:
        course = _on_steps(course, search.problem.predictor.drives[place.recording].grid, drive.grid)
    again = course_about(own, fit, place, candidate, course, everything=True, effort=effort)
    if again is None:
        return None
    if not switched:
        held = _held_out(problem.predictor, place.recording)
        again = replace(again, level=np.where(held, again.level, course.level))
        if not again.on.any() or np.array_equal(again.level, course.level):
            return None
    intervals = intervals_of(again.level, drive.grid)
    middle = 0.5 * (drive.grid[1:] + drive.grid[:-1])
    within = [(middle > start) & (middle < end) for start, end in intervals]
    probability = tuple(float(again.probability[rows].mean()) for rows in within)
    own = _candidate(search, place, intervals, again.shares_at(levels_of(again.level)), again.size)
    state = InferredState(own, probability)
    length = np.diff(drive.grid)
    on = np.where(again.on, length, 0.0)
    conditions = conditions_of_inputs(BaseRun(problem.predictor, place.recording, *_bare(fit, candidate)))
    inside = {key: float(on[zero == 1].sum() / on.sum()) for key, zero in conditions.items()}
    usual = {key: float(length[zero == 1].sum() / length.sum()) for key, zero in conditions.items()}
    # The input that says most of what is on: nearly all of it, in least of the time.
    best = max(inside, key=lambda key: inside[key] - usual[key], default="")
    if best and inside[best] > MOSTLY_INSIDE and inside[best] - usual[best] > TELLS:
        filled = float(on[conditions[best] == 1].sum() / length[conditions[best] == 1].sum())
        state = replace(state, gate=best, inside=inside[best], filled=filled)
    return state


def _as_state(
    search: Search, problem: Problem, fit: Fit, candidate: Candidate
) -> tuple[StatePlace, Course] | None:
    """Place and course of what a network has in several intervals at one size; None for anything else."""
    free = search.in_intervals(candidate) and not search.is_hidden_state(candidate)
    if not (problem.predictor.is_network and free) or candidate.form:
        return None
    effect, values = search.effects[candidate.effect], fit.values
    intervals, sizes = effect.intervals(candidate, values), effect.sizes(candidate, values)
    if len(intervals) < SEVERAL or max(sizes) > ONE_SIZE * min(sizes):
        return None
    wanted = candidate.effect, candidate.component, candidate.recording or 0
    place = next(
        (p for p in state_places(search) if (p.effect.name, p.pattern.spot, p.recording) == wanted), None
    )
    if place is None or not _held_out(problem.predictor, place.recording).any():
        return None
    grid = problem.predictor.drives[place.recording].grid
    middle = 0.5 * (grid[1:] + grid[:-1])
    on = np.any([(middle > start) & (middle < end) for start, end in intervals], axis=0)
    chain = Chain.usual(np.zeros(len(on), dtype=np.int64))
    return place, Course(on.astype(np.int64), on.astype(float), float(np.mean(sizes)), 0.0, 0.0, 0.0, chain)


def _held_out(predictor: Predictor, number: int) -> NDArray[np.bool_]:
    """Steps of a recording in which readings are held out, (T,)."""
    grid = predictor.drives[number].grid
    middle = 0.5 * (grid[1:] + grid[:-1])
    held = stretches(~predictor.use[number], predictor.stamps(number))
    return np.any([np.zeros(len(middle), bool), *((middle > a) & (middle < b) for a, b in held)], axis=0)


def _on_steps(course: Course, grid: Array, other: Array) -> Course:
    """A course on other steps, from the ends (T + 1,) of its own and (U + 1,) of those, s."""
    middle = 0.5 * (other[1:] + other[:-1])
    row = np.clip(np.searchsorted(grid, middle, side="right") - 1, 0, len(course.level) - 1)
    return replace(course, level=course.level[row], probability=course.probability[row])


def states_on_rows(
    search: Search, final: Problem, fit: Fit, rows: Sequence[Recording], directions: Sequence[Misdescription]
) -> dict[str, InferredState]:
    """Hidden states of a fit to averaged recordings, followed on the recordings' rows.

    What switches within minutes is a mean in bins of many rows. Parameters stay as they were fitted.
    """
    averaged = final.predictor
    plain = Predictor(averaged.fast, rows, effects=averaged.effects).with_unseen(averaged.unseen)
    fine = with_misdescriptions(plain, directions, fit.values, fit.candidates)
    problem = Problem(fine, final.belief, final.slow, fine.observations)
    found = {}
    for name, state in inferred_states(search, problem, fit, ON_ROWS).items():
        if name not in search.courses:
            found[name] = state
            continue
        place = search.courses[name][0]
        width = BLUR * float(np.median(np.diff(averaged.drives[place.recording].grid)))
        intervals = place.effect.intervals(state.candidate, {})
        shares = place.effect.sizes(state.candidate, {name: 1.0})
        size = state.candidate.reference
        found[name] = replace(state, fitted=_candidate(search, place, intervals, shares, size, width))
    return found


def _bare(fit: Fit, candidate: Candidate) -> tuple[dict[str, float], tuple[Candidate, ...]]:
    rest, values = without(fit, candidate)
    return values, rest


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
        candidate = _candidate(search, place, intervals_of(course.level, grid), shares, course.size)
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


def _candidate(
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
