"""State of a search for hypotheses and its single steps: screen, fit, extend.

The residuals of the best fits so far are screened to first order against all
candidates; the most promising additions are fitted with their full terms.
Pairs and triples that only make sense together come from the same screening.
The order of these steps is in :mod:`spindle_fem.inference.search_course`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Effect
from spindle_fem.effects.framework.interval_effect import IntervalEffect, in_intervals
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.unrecorded import EDGE_WIDTH
from spindle_fem.effects.registry import in_recording
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import Variant, variants_of
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.hypothesis import Hypothesis, identity
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.like_sets import only_size_free
from spindle_fem.inference.linearised_fit import LinearProblem
from spindle_fem.inference.missing_heat import (
    OnOff,
    Onsets,
    Pattern,
    find_intervals,
    onset_answers,
)
from spindle_fem.inference.screening import Screened, amplitude_to_begin_from, screen
from spindle_fem.inference.worker_processes import FitOrder, Workers

Array = NDArray[np.float64]
Progress = Callable[[str], None]
# A set, and values to begin from.
Task = tuple[tuple[Candidate, ...], Mapping[str, float]]

# No recording can distinguish larger sets.
LARGEST_SET = 3
# Sets that are fitted together before the best of them says what is hopeless: first those that promise most,
# then more at a time to keep all workers busy.
FITTED_FIRST, FITTED_TOGETHER = 2, 5
# Width of edges over the steps of a fit, from which means over steps are right to 0.3 %: the error of sums
# over a logistic function falls with exp(-2 pi² width/step).
BLUR = 0.3
# Spots whose intervals are screened.
SPOTS_SCREENED = 12


@dataclass(slots=True)
class Search:
    """Everything that a search needs and has found.

    Attributes
    ----------
    weights : mapping of effect to float
        Prior weight of each.
    workers : Workers
        Processes that fit.
    found : dict
        Hypotheses by their keys and forms.
    """

    problem: Problem
    view: MachineView
    effects: Mapping[str, Effect]
    candidates: tuple[Candidate, ...]
    interval_effects: tuple[IntervalEffect, ...]
    weights: Mapping[str, float]
    progress: Progress = lambda stage: None
    workers: Workers = field(default_factory=Workers)
    found: dict[frozenset, Hypothesis] | None = None
    # The last fit of each set that was screened, and its screening.
    screenings: dict[frozenset, tuple[Fit, Screened]] = field(default_factory=dict)
    # Place and course of what switches, and what share of its gain that costs, by the name of its amplitude.
    courses: dict[str, tuple[Any, Any, float]] = field(default_factory=dict)
    _paid: dict[frozenset, float] = field(default_factory=dict)

    def families(self) -> dict[str, str]:
        """Bearing set of every bearing: what all of a set has, one of its bearings has not once more."""
        named = {g: self.view.component(g) for g in self.view.groups}
        return {bearing: named[g] for g in self.view.groups for bearing in self.view.sets[g]}

    def ranked(self) -> list[Hypothesis]:
        """Hypotheses, the most probable first."""
        return sorted(self.found.values(), key=lambda h: -h.score)

    # ------------------------------------------------------------------ steps
    @staticmethod
    def is_explained(hypothesis: Hypothesis) -> bool:
        """Whether a hypothesis leaves nothing to explain."""
        return hypothesis.fit.reduced_misfit < tuned.EXPLAINED**2

    def extend(
        self,
        fit: Fit,
        screened: Screened,
        intervals: Mapping[int, OnOff],
        number: int,
        count: int,
        always: int = 0,
        beside: bool = False,
    ) -> None:
        """Fit the ``count`` most promising additions of ``number`` effects to a hypothesis.

        ``always`` of them are fitted whatever they promise. ``beside`` the best set also those
        that promise a little less than nothing: to first order a small effect gains less than it does.
        """
        if len(fit.candidates) + number > LARGEST_SET:
            return
        tasks: list[Task] = []
        known = self.ranked()[0].score - self.found[identity(())].score
        for tried, (members, gain) in enumerate(screened.best(number, count)):
            if tried == 0:
                promised = gain
            short = tuned.PROMISED_SHORT if beside else 0.0
            least = max(tuned.LEAST_PROMISED_GAIN, tuned.LEAST_PROMISED_SHARE * promised)
            if tried >= always and gain < least - short:
                break
            if number > 1 and gain < known:
                break
            amplitudes = screened.amplitudes(members)
            additions = [(screened.variants[i], amplitudes[i]) for i in members]
            tasks.append(self.task(fit, additions, intervals))
        self.fit_all(tasks)

    def screened(
        self,
        fit: Fit,
        trust: Fit | None = None,
        *,
        only_laws: bool = False,
        beside: Sequence[Variant] = (),
    ) -> tuple[Screened, dict[int, OnOff]]:
        """Candidates, and intervals at every spot, against what a fit leaves.

        Parameters
        ----------
        trust : Fit or None
            The fit that gains count from where that is another one.
        only_laws : bool
            Whether to leave intervals out, which take most of the time. They are looked for in recordings
            in which nothing else is on in intervals.
        beside : sequence of Variant
            Screened as well.
        """
        families = self.families()

        def is_present(candidate: Candidate) -> bool:
            whole = families.get(candidate.component, candidate.component)
            alike = (c for c in fit.candidates if c.effect == candidate.effect and c.meets(candidate))
            return any(families.get(c.component, c.component) == whole for c in alike)

        left = [self._residual(fit, number) for number in range(len(self.problem.predictor.recordings))]
        variants = variants_of(
            [
                replace(c, starts=self.effects[c.effect].starts_from(c, *left[c.recording or 0]))
                for c in self.candidates
                if not is_present(c)
            ]
        )
        intervals, linear = {}, None
        recordings = () if only_laws else self.without_intervals(fit)
        if recordings:
            linear = LinearProblem.about(self.problem, fit, trust)
            for found, candidate in self.interval_candidates(fit, linear, recordings=recordings):
                variant = Variant(candidate, {})
                intervals[id(candidate)] = found
                variants.append(variant)
        variants.extend(beside)
        found = screen(
            self.problem, fit, variants, self.weights, families, trust, self.workers, linear=linear
        )
        if trust is None:
            self.screenings[identity(fit.candidates)] = fit, found
        return found, intervals

    def _residual(self, fit: Fit, number: int) -> tuple[Array, Array]:
        """Stamps of a recording and residuals of a fit for its usable readings, NaN elsewhere."""
        predictor = self.problem.predictor
        recording = predictor.recordings[number]
        predicted = predictor.predict(number, fit.values, fit.candidates).temperature
        grid = predictor.drives[number].grid
        times = predictor.stamps(number)
        at_stamps = np.column_stack([np.interp(times, grid, column) for column in predicted.T])
        known = recording.usable & predictor.use[number][:, None]
        return times, np.where(known, recording.temperature - at_stamps, np.nan)

    def without_intervals(self, fit: Fit) -> tuple[int, ...]:
        """Recordings in which a fit has nothing on in intervals."""
        taken = {c.recording or 0 for c in fit.candidates if self.in_intervals(c)}
        return tuple(n for n in range(len(self.problem.predictor.recordings)) if n not in taken)

    def interval_candidates(
        self,
        fit: Fit,
        linear: LinearProblem | None = None,
        like: Candidate | None = None,
        recordings: Iterable[int] | None = None,
    ) -> Iterable[tuple[OnOff, Candidate]]:
        """Unrecorded heat or loss in intervals that explains what a fit leaves, the best spots first.

        ``linear`` is the problem about the fit, where that is known; with ``like`` only that effect at that
        component, in its recording; in some ``recordings``, all where absent.
        """
        if recordings is None:
            several = range(len(self.problem.predictor.recordings))
            recordings = [n for n in several if like is None or like.recording in (None, n)]
        patterns = [
            (effect, pattern)
            for effect, pattern in self.patterns()
            if like is None
            or (effect.name, self.view.component(pattern.spot)) == (like.effect, like.component)
        ]
        found: list[tuple[IntervalEffect, OnOff]] = []
        for recording in recordings:
            answers: list[Onsets] = onset_answers(
                self.problem,
                fit,
                [pattern for _, pattern in patterns],
                recording,
                number=self.instants,
                linear=linear,
                workers=self.workers,
            )
            stop = float(self.problem.predictor.drives[recording].grid[-1])
            for (effect, pattern), onsets in zip(patterns, answers, strict=True):
                probe = effect.over(self.view, pattern.spot, [(0.0, stop)])
                spread = probe.parameters[probe.amplitude].sigma
                options = find_intervals(onsets, spread, stop)
                options = [o for o in options if not self._within_gaps(o.intervals, recording)]
                if options:
                    found.append((effect, max(options, key=lambda item: item.gain)))
        found.sort(key=lambda item: -item[1].gain)
        for effect, item in found[:SPOTS_SCREENED]:
            if item.gain > 0.0:
                edges = self.edges(item.recording)
                candidate = effect.over(self.view, item.pattern.spot, item.intervals, **edges)
                yield item, self.of_recording(candidate, item.recording, item.strength)

    def of_recording(self, candidate: Candidate, recording: int, size: float) -> Candidate:
        """A candidate of about a size in one recording, which is the only one where there are several."""
        sized = replace(candidate, reference=max(size, 1e-3))
        return sized if len(self.problem.predictor.recordings) == 1 else in_recording(sized, recording)

    def holds(self, fit: Fit, effect: str, spot: str, recording: int) -> bool:
        """Whether a fit has an effect at a spot in a recording already."""
        there = effect, self.view.component(spot)
        return any(c.recording in (None, recording) for c in fit.candidates if c.key[:2] == there)

    @property
    def instants(self) -> int:
        """Number of the instants at which edges of intervals and changes of level are looked for."""
        return tuned.ONSETS_OF_NETWORK if self.problem.predictor.is_network else tuned.ONSETS

    def edges(self, recording: int) -> dict[str, float]:
        """Width of edges in a recording and distance of these instants, s, as effects take them.

        Edges far sharper than a step are somewhere within it, and no fit moves them.
        """
        grid = self.problem.predictor.drives[recording].grid
        width = BLUR * float(np.median(np.diff(grid)))
        return {
            "blurred": width if width > EDGE_WIDTH else 0.0,
            "apart": float(grid[-1] - grid[0]) / self.instants,
        }

    def patterns(self, levels: bool = False) -> list[tuple[IntervalEffect, Pattern]]:
        """Every effect of intervals at every spot that it may act at, or at which its level may change."""
        recorded = self.problem.predictor.drives[0].names
        # A link between two nodes warms one by what it takes from the other.
        joints = self.view.joint_coefficients if self.view.kind == "network" else {}
        ends = {link: str(self.view.fluids[own[0]]) for link, own in joints.items()}
        return [
            (
                effect,
                Pattern(
                    spot,
                    effect.acts_on(self.view, spot),
                    effect.takes_heat_away,
                    "ambient" if "ambient" in recorded else self.view.reference_temperature,
                    effect.link(self.view, spot),
                    ends.get(spot, "") if effect.link(self.view, spot) else "",
                    effect.source(self.view, spot),
                ),
            )
            for effect in self.interval_effects
            for spot in (effect.level_places if levels else effect.places)(self.view)
            if not self.view.switched_on(effect.name, self.view.component(spot))
        ]

    def delaying(self, channel: str, seconds: float) -> list[Candidate]:
        """Effects that may make a channel so late, s."""
        return [
            c
            for c in self.candidates
            if self.effects[c.effect].delays
            and c.reading.channel == channel
            and c.parameters[c.amplitude].low < seconds
        ]

    def remember_cost(self, candidate: Candidate, paid: float) -> None:
        """Keep what the choice of a candidate's intervals costs, as a logarithm."""
        self._paid[identity((candidate,))] = paid

    def cost_of(self, candidate: Candidate) -> float:
        """What the choice of a candidate's intervals costs, as a logarithm; 0 of what has none."""
        return self._paid.get(identity((candidate,)), 0.0)

    def elsewhere(self, member: Candidate, values: Mapping[str, float]) -> list[Variant]:
        """What is on in intervals at every other spot, in the same ones at their cost, with the same lag."""
        effect = self.effects[member.effect]
        spans, cost = effect.intervals(member, values), self.cost_of(member)
        known = {
            p.name: values[n] for n, p in member.parameters.items() if n != member.amplitude and n in values
        }
        found = []
        for spot in [pattern.spot for other, pattern in self.patterns() if other.name == member.effect]:
            here = effect.over(self.view, spot, spans, **self.edges(member.recording or 0))
            here = self.of_recording(here, member.recording or 0, member.reference)
            if identity((here,)) != identity((member,)):
                self.remember_cost(here, cost)
                found.append(
                    Variant(here, {n: known[p.name] for n, p in here.free.items() if p.name in known})
                )
        return found

    def hypothesis(self, fit: Fit, paid: float = 0.0) -> Hypothesis:
        """A fitted set with its prior, and the cost of the courses of its hidden states.

        A course is chosen by single readings, which determine it better than the means that are fitted: its
        cost counts as a share of its gain.

        Parameters
        ----------
        paid : float
            What the choice of other intervals costs, as a logarithm.
        """
        prior = self.log_prior(fit.candidates) - paid
        states = [c for c in fit.candidates if self.is_hidden_state(c)]
        share = min(1.0, sum(self.courses[c.amplitude][2] for c in states))
        if not share:
            return Hypothesis(fit, prior)
        rest = self.found.get(identity(c for c in fit.candidates if c not in states))
        before = (self.found[identity(())] if rest is None else rest).misfit
        gain = max(0.0, 0.5 * (before - fit.misfit_with_prior))
        return Hypothesis(fit, prior, course_share=share, course_cost=share * gain)

    def is_hidden_state(self, candidate: Candidate) -> bool:
        """Whether a candidate is on along a course that was found, of which only the size is free."""
        return candidate.amplitude in self.courses and only_size_free(candidate)

    def task(
        self, fit: Fit, additions: Sequence[tuple[Variant, float]], intervals: Mapping[int, OnOff]
    ) -> Task:
        """A fit with additions, and where it begins."""
        candidates = (*fit.candidates, *(variant.candidate for variant, _ in additions))
        start = fit.values
        for variant, scaled in additions:
            factors = {item.name for item in variant.candidate.factors}
            amplitude = amplitude_to_begin_from(variant, scaled)
            values = dict(variant.shape) | {variant.candidate.amplitude: amplitude}
            start |= {EFFECT_PREFIX + n if n in factors else n: v for n, v in values.items()}
            if id(variant.candidate) in intervals:
                self.remember_cost(variant.candidate, intervals_cost(intervals[id(variant.candidate)]))
        return candidates, start

    def fit_all(
        self,
        tasks: Sequence[Task],
        again: bool = False,
        reach: float = tuned.HOPELESS_SCORE,
        anew: bool = False,
    ) -> None:
        """Fit the sets that are not known yet, some at a time side by side, and keep them.

        The same number at a time whatever the number of workers, so that the result is the same.

        Parameters
        ----------
        again : bool
            Whether to fit known sets again that begin with less misfit than they ended with.
        reach : float
            Deficit in log probability from which a set does not matter.
        anew : bool
            Whether to fit known sets again wherever they begin; what ends better is kept.
        """
        waiting: dict[frozenset, Task] = {}
        for candidates, start in tasks:
            key = identity(candidates)
            known = self.found.get(key)
            if known is None or anew or (again and self.problem.begins_better(known.fit, start)):
                waiting.setdefault(key, (candidates, start))
        queue = list(waiting.values())
        rest = range(FITTED_FIRST, len(queue), FITTED_TOGETHER)
        for together in (queue[:FITTED_FIRST], *(queue[first : first + FITTED_TOGETHER] for first in rest)):
            orders = [
                FitOrder(candidates, start, tuned.START_SHARES, self._hopeless(len(candidates), reach))
                for candidates, start in together
            ]
            for (candidates, _), fitted in zip(
                together, self.workers.fits(self.problem, orders), strict=True
            ):
                # Sets that cannot be simulated explain nothing; their neighbours are tried.
                if fitted is None or any(self._unseen(c, fitted.values) for c in candidates):
                    continue
                known = self.found.get(identity(candidates))
                if known is not None and known.fit.misfit_with_prior <= fitted.misfit_with_prior:
                    continue
                paid = sum(self.cost_of(c) for c in candidates)
                self.keep(self.hypothesis(fitted, paid))

    def _unseen(self, candidate: Candidate, values: Mapping[str, float]) -> bool:
        """Whether an event lies where nothing was recorded, neither readings nor inputs."""
        if not self.in_intervals(candidate) or self.is_hidden_state(candidate):
            return False
        on = self.effects[candidate.effect].intervals(candidate, values)
        return self._within_gaps(on, candidate.recording or 0)

    def in_intervals(self, candidate: Candidate) -> bool:
        """Whether a candidate is on in intervals of time instead of following a law."""
        return in_intervals(self.effects[candidate.effect], candidate)

    def _within_gaps(self, intervals: Sequence[tuple[float, float]], recording: int) -> bool:
        """Whether any interval lies in gaps by more than ``tuned.MOST_IN_GAPS`` of it."""
        return any(
            self._hidden_time((start, end), recording) > tuned.MOST_IN_GAPS * (end - start)
            for start, end in intervals
        )

    def _hidden_time(self, span: tuple[float, float], recording: int) -> float:
        """Part of an interval that lies in gaps, s."""
        gaps = self.problem.predictor.gap_intervals(recording)
        return sum(max(0.0, min(span[1], stop) - max(span[0], begin)) for begin, stop in gaps)

    def _hopeless(self, size: int, reach: float) -> float:
        """Misfit beyond which a set of some size does not matter."""
        return self.ranked()[0].fit.misfit_with_prior + 2.0 * self.reach(size, reach)

    def reach(self, size: int, least: float = tuned.HOPELESS_SCORE) -> float:
        """Largest deficit in log probability at which a set may still matter."""
        if size > 1:
            return least
        gain = self.ranked()[0].score - self.found[identity(())].score
        return max(least, (1.0 - tuned.FAIR_SHARE) * gain)

    def keep(self, hypothesis: Hypothesis) -> None:
        """Add a fitted hypothesis to those found, unless it is on only where nothing was recorded."""
        values = hypothesis.fit.values
        for candidate in filter(self.in_intervals, hypothesis.fit.candidates):
            on = self.effects[candidate.effect].intervals(candidate, values)
            hidden = sum(self._hidden_time(span, candidate.recording or 0) for span in on)
            if hidden > tuned.MOST_IN_GAPS * sum(end - start for start, end in on):
                return
        self.found[identity(hypothesis.fit.candidates)] = hypothesis

    def log_prior(self, candidates: Sequence[Candidate]) -> float:
        """Logarithm of the prior of a set."""
        total = sum(self.weights.values())
        found = float(np.log(tuned.NUMBER_PRIOR[len(candidates)]))
        for candidate in candidates:
            if self.in_intervals(candidate):
                recordings = len(self.problem.predictor.recordings)
                places = recordings * len(self.effects[candidate.effect].level_places(self.view))
                share = candidate.likelihood
            else:
                same = [c for c in self.candidates if c.effect == candidate.effect]
                places = len({c.component for c in same})
                here = sum(c.likelihood for c in same if c.component == candidate.component)
                share = candidate.likelihood / here if here else 1.0
            found += float(np.log(self.weights[candidate.effect] / total * share / places))
        # A set counts once, in whatever order it is drawn.
        return found + float(np.sum(np.log(np.arange(1, len(candidates) + 1))))


def intervals_cost(item: OnOff) -> float:
    """Cost of choosing the intervals, as a logarithm."""
    options = item.options * (item.options + 1) / 2
    number = len(item.intervals)
    return number * float(np.log(options)) - float(np.sum(np.log(np.arange(1, number + 1))))
