"""Hypotheses of levels that changed at unknown moments: segmented, fitted and segmented again about the fit.

A conductance acts by its product with temperatures that it moves itself: the instants that are best to first
order about a constant level are not those of large steps. So the readings are segmented again about each
fit, the course of levels that it holds given back, as long as the evidence grows.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.interval_effect import IntervalEffect
from spindle_fem.effects.framework.unrecorded import LESS, PULSES, STEPS
from spindle_fem.effects.registry import fixed
from spindle_fem.inference import tuned
from spindle_fem.inference.change_points import (
    NOTHING,
    SHORTEST,
    Changes,
    choice,
    find_changes,
    levels_over_lowest,
)
from spindle_fem.inference.hypothesis import Hypothesis, identity
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem, amplitude_name
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.missing_heat import Onsets, Pattern, onset_answers
from spindle_fem.inference.prepared_problem import slow_error_of

Array = NDArray[np.float64]

# Changes of a course that are tried without, the least ones: each takes a fit.
CHANGES_TRIED = 3


@dataclass(frozen=True, slots=True)
class StepPlace:
    """Place where levels may change, and the number of instants.

    Levels count from the lowest up, or from the highest down if they are ``less`` than at other times.
    """

    effect: IntervalEffect
    pattern: Pattern
    recording: int
    instants: int
    less: bool = False

    @property
    def form(self) -> str | None:
        """Form of the effect."""
        return LESS if self.less else None

    @property
    def sign(self) -> float:
        """Sign of what a level adds: -1 where the effect takes something away."""
        return -1.0 if self.less else 1.0


def add_steps(search: Search, fit: Fit) -> None:
    """Fit the sets with changes of level beside what a fit holds, at the most promising places.

    Beside what switches or changes its level already another may, elsewhere or by another effect.
    """
    if sum(map(search.in_intervals, fit.candidates)) > 1:
        return
    predictor = search.problem.predictor
    found = []
    for recording in range(len(predictor.recordings)):
        patterns = [
            (effect, pattern)
            for effect, pattern in search.patterns(levels=True)
            if not search.holds(fit, effect.name, pattern.spot, recording)
        ]
        answers = onset_answers(
            search.problem,
            fit,
            [pattern for _, pattern in patterns],
            recording,
            number=search.instants,
            workers=search.workers,
        )
        for (effect, pattern), onsets in zip(patterns, answers, strict=True):
            changes = find_changes(onsets.gram, onsets.data, _spread(search, effect, pattern))
            if changes is not None:
                found.append((changes.gain, effect, onsets))
    found.sort(key=lambda item: -item[0])
    fair = [item for item in found if item[0] > tuned.FAIR_SHARE * found[0][0]]
    # Heat, heat in proportion to that of a source, and cooling are similar to first order: first one of each.
    kinds: dict[tuple[str, bool], tuple[float, IntervalEffect, Onsets]] = {}
    for item in fair:
        kinds.setdefault((item[1].name, bool(item[2].pattern.source)), item)
    first = list(kinds.values())
    others = [item for item in fair if all(item is not chosen for chosen in first)]
    for _, effect, onsets in [*first, *others][: tuned.STEP_PLACES]:
        _settle(search, fit, effect, onsets)


def _settle(search: Search, fit: Fit, effect: IntervalEffect, onsets: Onsets) -> None:
    """Segmentation and fit in turn, changes left out that do not pay, the best of them kept.

    What a fit with changes leaves says how large the slow error is; with that of a fit without them, or with
    a guess, drift of the machine would be cut into steps.
    """
    problem = search.problem
    place = StepPlace(effect, onsets.pattern, onsets.recording, len(onsets.times))
    stop = float(problem.predictor.drives[onsets.recording].grid[-1])
    spread = _spread(search, effect, onsets.pattern)
    values, best = dict(fit.values), None
    for _ in range(tuned.COURSE_ROUNDS):
        changes = find_changes(onsets.gram, onsets.data, spread)
        if changes is None:
            break
        if best is None:
            place = replace(place, less=_below_known(search, place, changes))
        changes = replace(changes, steps=place.sign * changes.steps)
        spans = levels_over_lowest(changes, onsets.times, stop)
        found = _fitted(search, problem, fit, place, *spans, values)
        if found is None:
            break
        try:
            again = replace(problem, slow=slow_error_of(problem, found.fit))
        except NOT_SIMULATED:
            # It was reached from states that were near, and runs away from the start.
            break
        found = _simplest(search, again, fit, place, found)
        if best is not None:
            known = _fitted(search, again, fit, place, *_spans(effect, best.fit), best.fit.values)
            if known is not None and found.score <= known.score + tuned.WORTH_ANOTHER:
                best = known if known.score > found.score else found
                break
        best, problem, values = found, again, found.fit.values
        onsets = _again(place, problem, best.fit, onsets)
    if best is None:
        return
    # Compared with all other sets under the noise that they were fitted with.
    last = _fitted(search, search.problem, fit, place, *_spans(effect, best.fit), best.fit.values)
    if last is not None:
        known = search.found.get(identity(last.fit.candidates))
        if known is None or known.score < last.score:
            search.remember_cost(
                last.fit.candidates[-1], _paid(search.problem, place, _spans(effect, last.fit)[0])
            )
            search.keep(last)


def _below_known(search: Search, place: StepPlace, changes: Changes) -> bool:
    """Whether levels lie mostly below what earlier readings say of a link or a source."""
    if search.problem.belief.earlier is None:
        return False
    levels = np.concatenate(([0.0], np.cumsum(changes.steps)))
    lower = -levels.min() > levels.max()
    return bool(lower) and LESS in place.effect.forms_at(search.view, place.pattern.spot)


def _simplest(search: Search, problem: Problem, fit: Fit, place: StepPlace, found: Hypothesis) -> Hypothesis:
    """Leave out changes one after the other as long as the rest explain nearly as much.

    A model that is not exact leaves a residual in proportion to the effect of the levels, which a further
    change may always fit a little.
    """
    nothing = problem.fit(fit.candidates, fit.values).log_evidence
    least = tuned.LEAST_SHARE_OF_A_CHANGE * max(0.0, found.fit.log_evidence - nothing)
    spans = _over_lowest(*_course(*_spans(place.effect, found.fit), problem, place))
    if spans is None:
        return found
    values = _raised(place, search, found.fit.values, spans[2])
    best = _fitted(search, problem, fit, place, *spans[:2], values) or found
    while True:
        trials = [
            _fitted(
                search,
                problem,
                fit,
                place,
                *spans,
                _raised(place, search, best.fit.values, lowest),
                best.fit.misfit_with_prior + tuned.HOPELESS,
            )
            for *spans, lowest in _with_one_less(*_spans(place.effect, best.fit), problem, place)
        ]
        better = max((t for t in trials if t is not None), key=lambda t: t.score, default=None)
        if better is None or better.score <= best.score - least:
            return best
        stretches = [
            len(_course(*_spans(place.effect, item.fit), problem, place)[1]) for item in (better, best)
        ]
        if stretches[0] >= stretches[1]:
            # levels that a fit parts again: leaving one out never ends
            return best
        best = better


def _course(
    intervals: Sequence[tuple[float, float]], levels: Sequence[float], problem: Problem, place: StepPlace
) -> tuple[list[float], list[float]]:
    """Edges and sizes of all stretches; one in which nothing was read has the size of that before it."""
    predictor = problem.predictor
    grid, recording = predictor.drives[place.recording].grid, predictor.recordings[place.recording]
    edges, sizes = [float(grid[0])], []
    for (start, end), level in zip(intervals, levels, strict=True):
        if start > edges[-1] + 1.0:
            sizes.append(0.0)
            edges.append(start)
        sizes.append(level)
        edges.append(end)
    if edges[-1] < grid[-1] - 1.0:
        sizes.append(0.0)
        edges.append(float(grid[-1]))
    read = predictor.stamps(place.recording)[recording.usable.any(axis=1) & predictor.use[place.recording]]
    spacing = float(np.median(np.diff(recording.times)))
    seen = np.histogram(read, edges)[0] * spacing > (1.0 - tuned.MOST_IN_GAPS) * np.diff(edges)
    position = 1
    while position < len(sizes):
        if not seen[position]:
            edges = [*edges[:position], *edges[position + 1 :]]
            sizes, seen = [*sizes[:position], *sizes[position + 1 :]], np.delete(seen, position)
        else:
            position += 1
    return edges, sizes


def _over_lowest(
    edges: Sequence[float], sizes: Sequence[float]
) -> tuple[list[tuple[float, float]], list[float], float] | None:
    """Intervals above the lowest size, by how much, and that size; None where there is one size only."""
    lowest = min(sizes)
    top = max(sizes) - lowest
    spans = [
        (pair, size - lowest)
        for pair, size in zip(itertools.pairwise(edges), sizes, strict=True)
        if size - lowest > NOTHING * top and pair[1] > pair[0] + 1.0
    ]
    return ([pair for pair, _ in spans], [size for _, size in spans], lowest) if spans else None


def _with_one_less(
    intervals: list[tuple[float, float]], levels: list[float], problem: Problem, place: StepPlace
) -> list[tuple[list[tuple[float, float]], list[float], float]]:
    """Courses without one of their least changes, and their lowest level: its neighbours have their mean."""
    edges, sizes = _course(intervals, levels, problem, place)
    lasts = np.maximum(np.diff(edges), 1e-3)
    # energy of a change: what levelling it takes away
    shorter = np.minimum(lasts[1:], lasts[:-1])
    least = np.argsort(np.diff(sizes) ** 2 * shorter)[:CHANGES_TRIED]
    found = []
    for inner in sorted(int(index) + 1 for index in least):
        lengths = lasts[inner - 1 : inner + 1]
        merged = float(np.average(sizes[inner - 1 : inner + 1], weights=lengths))
        found.append(
            _over_lowest(
                [*edges[:inner], *edges[inner + 1 :]], [*sizes[: inner - 1], merged, *sizes[inner + 1 :]]
            )
        )
    return [item for item in found if item is not None]


def _raised(place: StepPlace, search: Search, values: Mapping[str, float], lowest: float) -> dict[str, float]:
    """Values with what every level has in common given to the link itself."""
    probe = place.effect.over(search.view, place.pattern.spot, [(0.0, 1.0)])
    if not probe.sized_by:
        return dict(values)
    now = values.get(probe.sized_by, 1.0)
    return dict(values) | {probe.sized_by: now + place.sign * lowest / probe.constants["nominal"]}


def _fitted(
    search: Search,
    problem: Problem,
    fit: Fit,
    place: StepPlace,
    intervals: Sequence[tuple[float, float]],
    levels: Sequence[float],
    values: Mapping[str, float],
    hopeless: float = np.inf,
) -> Hypothesis | None:
    """A set with levels in intervals; None where nothing is left of them, or it cannot be simulated."""
    if not levels or min(levels) < 0.0 or max(levels) <= 0.0:
        return None
    candidate = _candidate(search, place, intervals, levels)
    lengths = [end - start for start, end in intervals]
    name = candidate.terms[0].name
    start = {key: value for key, value in values.items() if not key.startswith(f"{name}.")}
    size = float(np.average(levels, weights=lengths)) / values.get(candidate.sized_by, 1.0)
    candidates = (*fit.candidates, candidate)
    try:
        fitted = problem.fit(candidates, start | {amplitude_name(candidate): size}, hopeless=hopeless)
    except NOT_SIMULATED:
        return None
    if not _changes(problem, place, _spans(place.effect, fitted)[0]):
        # One level from start to end is another value, which its own effect names.
        return None
    return Hypothesis(fitted, search.log_prior(candidates) - _paid(problem, place, intervals))


def _changes(problem: Problem, place: StepPlace, intervals: Sequence[tuple[float, float]]) -> set[float]:
    """Edges amid the recording, [s]."""
    begin, *_, end = problem.predictor.drives[place.recording].grid
    near = SHORTEST * (end - begin)
    return {edge for pair in intervals for edge in pair if begin + near < edge < end - near}


def _paid(problem: Problem, place: StepPlace, intervals: Sequence[tuple[float, float]]) -> float:
    """Cost of choosing the changes, as a logarithm; levels from the start or to the end cost nothing."""
    return choice(place.instants, len(_changes(problem, place, intervals)))


def _spans(effect: IntervalEffect, fit: Fit) -> tuple[list[tuple[float, float]], list[float]]:
    """Intervals and levels that a fit holds, W or W/K."""
    candidate = fit.candidates[-1]
    factor = fit.values.get(candidate.sized_by, 1.0)
    pairs = [(float(a), float(b)) for a, b in effect.intervals(candidate, fit.values)]
    return pairs, [float(factor * size) for size in effect.sizes(candidate, fit.values)]


def _again(place: StepPlace, problem: Problem, fit: Fit, onsets: Onsets) -> Onsets:
    """Inner products about a fit, the course of levels that it holds given back."""
    candidate = fit.candidates[-1]
    term = candidate.terms[0]
    inner = term.values(fit.values)
    held = fixed(candidate, inner)
    machine = [i for i, c in enumerate(fit.coordinates) if not c.name.startswith(f"{term.name}.")]
    frozen = replace(
        fit,
        candidates=tuple(held if c is candidate else c for c in fit.candidates),
        coordinates=tuple(fit.coordinates[i] for i in machine),
        position=fit.position[machine],
    )
    (found,) = onset_answers(problem, frozen, [onsets.pattern], onsets.recording, number=len(onsets.times))
    steps = np.zeros(len(found.times))
    for (start, end), size in zip(*_spans(place.effect, fit), strict=True):
        steps += place.sign * size * (_at(found.times, start) - _at(found.times, end))
    return replace(found, data=found.data + found.gram @ steps)


def _at(times: Array, edge: float) -> Array:
    """Weights of the instants that represent a step at or between two of them; none at the end of all."""
    place = float(np.interp(edge, [*times, 2.0 * times[-1] - times[-2]], np.arange(len(times) + 1)))
    return np.maximum(0.0, 1.0 - np.abs(np.arange(len(times)) - place))


def _candidate(
    search: Search, place: StepPlace, intervals: Sequence[tuple[float, float]], levels: Sequence[float]
) -> Candidate:
    mean = float(np.average(levels, weights=[end - start for start, end in intervals]))
    alike = len(intervals) == 1
    found = place.effect.over(
        search.view,
        place.pattern.spot,
        intervals,
        place.form,
        course=PULSES if alike else STEPS,
        sizes=() if alike else [level / mean for level in levels],
        **search.edges(place.recording),
    )
    return search.of_recording(found, place.recording, mean)


def _spread(search: Search, effect: IntervalEffect, pattern: Pattern) -> float:
    probe = effect.over(search.view, pattern.spot, [(0.0, 1.0)])
    return float(probe.parameters[probe.amplitude].sigma)
