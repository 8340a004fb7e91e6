"""Hidden states of a fit, and what is on in several intervals, followed by all readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hidden_states import conditions_of_inputs, intervals_of, levels_of, without
from spindle_fem.inference.hypothesis_fit import Fit, Problem, amplitude_name, candidate_coordinates
from spindle_fem.inference.hypothesis_search import BLUR, Search
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.state_search import StatePlace, course_about, state_candidate, state_places
from spindle_fem.inference.switching_model import THOROUGH, Chain, Course
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

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
                fit = _with_state(fit, name, state.candidate)
    return found


def _with_state(fit: Fit, name: str, state: Candidate) -> Fit:
    """A fit with a followed state in the stead of what has an amplitude, of which only the size is free."""
    (before,) = (c for c in fit.candidates if c.amplitude == name)
    left = {c.name for c in candidate_coordinates(before)} - {amplitude_name(before)}
    rows = [index for index, c in enumerate(fit.coordinates) if c.name not in left]
    return replace(
        fit,
        candidates=tuple(state if c is before else c for c in fit.candidates),
        coordinates=tuple(fit.coordinates[i] for i in rows),
        position=fit.position[rows],
        covariance=fit.covariance[np.ix_(rows, rows)],
    )


def _inferred(
    search: Search, problem: Problem, fit: Fit, name: str, effort: tuple[int, int]
) -> InferredState | None:
    """One hidden state of a fit inferred from all readings; None where nothing switches."""
    candidate = next(c for c in fit.candidates if c.amplitude == name)
    own = replace(search, problem=problem)
    switched = search.is_hidden_state(candidate)
    known = search.courses[name][:2] if switched else _as_state(search, problem, fit, candidate)
    if known is None:
        # Followed once, it is on in one interval only.
        return None
    place, course = known
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
    own = state_candidate(search, place, intervals, again.shares_at(levels_of(again.level)), again.size)
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
        found[name] = replace(state, fitted=state_candidate(search, place, intervals, shares, size, width))
    return found


def _bare(fit: Fit, candidate: Candidate) -> tuple[dict[str, float], tuple[Candidate, ...]]:
    rest, values = without(fit, candidate)
    return values, rest
