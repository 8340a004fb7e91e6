"""From data and candidates to hypotheses with probabilities.

A beam search: what the best fits so far leave is screened to first order
against all candidates; the most promising additions are fitted with their full
terms. Pairs and triples that only make sense together come from the same
screening.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Effect, IntervalEffect, in_intervals
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.inference.candidate_response import Variant, variants_of
from spindle_fem.inference.hypothesis_fit import EFFECT_PREFIX, Fit, Problem
from spindle_fem.inference.missing_heat import ONSETS, OnOff, Onsets, Pattern, find_intervals, onset_answers
from spindle_fem.inference.screening import Screened, amplitude_value, screen
from spindle_fem.inference.worker_processes import FitOrder, Workers

Array = NDArray[np.float64]
Progress = Callable[[str], None]
# A set, and values to begin from.
Task = tuple[tuple[Candidate, ...], Mapping[str, float]]

LARGEST_SET = 3
# Root mean square of whitened residuals below which there is nothing left for a further effect to explain.
EXPLAINED = 1.03
#: Prior probability of 0, 1, 2 and 3 effects.
NUMBER_PRIOR = (0.4, 0.35, 0.2, 0.05)
# Beyond this the parameters have taken what they cannot explain, and first order about them misleads.
DISTORTED = 1.2
# An interval that lies in gaps of the recording by more than this share explains what nobody saw.
HIDDEN = 0.5
# Sets that are tried without each of their members.
REDUCED = 3
# Best sets in which each member is exchanged for other effects at its place, and for how many; other spots at
# which a member that is on in intervals is tried.
EXCHANGED, OTHERS, OTHER_SPOTS = 1, 5, 3
# Times that members are left out and exchanged, as long as that finds a better set.
ROUNDS = 2
# Sets that are fitted from each start: single effects from one start and from each of two, pairs, triples.
SINGLES, PAIRS, TRIPLES = (8, 5), 6, 3
BEAM, ADDITIONS = 3, 6
# Shares of the amplitudes that a fit begins from, one after the other until it can be simulated: friction
# that feeds on its own heat has no state at amplitudes that are too large, and first order does not know
# where that begins.
MILDER = (1.0, 0.5, 0.2)
# Sets that are fitted abreast before the best of them says what is hopeless: of those that promise most, and
# of the others, of which fewer are the best and more keep all workers busy.
ABREAST, FURTHER = 2, 5
# A hypothesis this much less likely (natural logarithm) than the best is not extended, but for one effect
# that explains a fair share of what the best does: half of a strong pair leaves a lot.
HOPELESS, FAIR_SHARE = 100.0, 0.55
# An addition must promise to make the data this much likelier, its prior paid.
ENOUGH_GAIN = 4.0
# So many singles are fitted however little they promise.
ALWAYS = 4
# Of what the best addition promises; less is not worth a fit.
PROMISING = 0.35


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A fitted set of candidates.

    Attributes
    ----------
    fit : Fit
    log_prior : float
        Of the set, with the choice of its intervals.
    """

    fit: Fit
    log_prior: float

    @property
    def score(self) -> float:
        """Logarithm of evidence times prior."""
        return self.fit.log_evidence + self.log_prior

    @property
    def keys(self) -> frozenset[tuple[str, str]]:
        """Effects and places."""
        return self.fit.keys


@dataclass(slots=True)
class Search:
    """Everything that a search needs and has found.

    Attributes
    ----------
    problem : Problem
    view : MachineView
    candidates : tuple of Candidate
    interval_effects : tuple of IntervalEffect
    weights : mapping of effect to float
        Prior weight of each.
    workers : Workers
        Who fit.
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
    _screenings: dict[frozenset, Screened] = field(default_factory=dict)
    _paid: dict[frozenset, float] = field(default_factory=dict)

    def run(self) -> list[Hypothesis]:
        """All fitted hypotheses, the most probable first."""
        self.found = {}
        null = self.problem.fit()
        self._keep(Hypothesis(null, float(np.log(NUMBER_PRIOR[0]))))
        self.progress("diagnosis: screening")
        starts = [(null, *self.screened(null))]
        if null.reduced_misfit > DISTORTED**2:
            # What is missing has pulled the parameters far off; as they are known they are nearer the truth.
            known = self.problem.fit(iterations=0)
            starts.append((known, *self.screened(known, null)))
        # The last start is the best one.
        for fit, screened, intervals in reversed(starts):
            self._extend(fit, screened, intervals, 1, SINGLES[len(starts) - 1], always=ALWAYS)
        if not self._explained(self.ranked()[0]):
            self.progress("diagnosis: 2 effects")
            for fit, screened, intervals in reversed(starts):
                self._extend(fit, screened, intervals, 2, PAIRS)
                self._extend(fit, screened, intervals, 3, TRIPLES)
        for size in range(1, LARGEST_SET):
            best = self.ranked()[0]
            worst = best.score - self._reach(size)
            ranked = [h for h in self.ranked() if len(h.keys) == size and h.score > worst]
            self.progress(f"diagnosis: {size + 1} effects")
            # A third effect is rare: it is looked for only where two leave something.
            beam = int(size == 1) if self._explained(best) else BEAM
            for hypothesis in self._to_extend(ranked, beam):
                screened, intervals = self.screened(hypothesis.fit)
                self._extend(hypothesis.fit, screened, intervals, 1, ADDITIONS)
        self._improve()
        return self.ranked()

    def _improve(self) -> None:
        """Take whole sets for their bearings, leave members out and exchange them, as long as that helps."""
        for _ in range(ROUNDS):
            best = self.ranked()[0]
            # Wider first: beside a whole set other members may be too many than beside one of its bearings.
            self._widen()
            self._reduce()
            self._exchange()
            if self.ranked()[0] is best:
                break
        else:
            self._widen()
            self._reduce()

    def _to_extend(self, ranked: Sequence[Hypothesis], number: int) -> list[Hypothesis]:
        """The best of so many combinations, and of laws alone where all of those hold a way out."""
        different = self._different(ranked)
        chosen = different[:number]
        if chosen and not any(self._only_laws(h) for h in chosen):
            chosen += [h for h in different if self._only_laws(h)][:1]
        return chosen

    def _only_laws(self, hypothesis: Hypothesis) -> bool:
        return not any(self._in_intervals(c) for c in hypothesis.fit.candidates)

    def _different(self, ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best hypothesis of each combination of effects.

        One effect at several places, and what is on in intervals as heat or as
        loss, are much the same start for a search.
        """
        found: dict[tuple[str, ...], Hypothesis] = {}
        for item in ranked:
            names = ("intervals" if self._in_intervals(c) else c.effect for c in item.fit.candidates)
            found.setdefault(tuple(sorted(names)), item)
        return list(found.values())

    def _exchange(self) -> None:
        """Try other effects in the place of each member of the best sets.

        What a large effect does is misjudged to first order, so that its
        neighbours may not have come through the screening. What is on in
        intervals is a way out: it is tried at other spots, and beside others
        any effect with a law may stand in its place.
        """
        tasks: list[Task] = []
        for hypothesis in [h for h in self.ranked() if h.fit.candidates][:EXCHANGED]:
            for member in hypothesis.fit.candidates:
                rest = tuple(c for c in hypothesis.fit.candidates if c is not member)
                if self._in_intervals(member):
                    tasks += self._at_other_spots(hypothesis.fit, member, rest)
                    own = {effect.name for effect in self.interval_effects}
                    tasks += self._with_laws(
                        rest, lambda c, own=own, rest=rest: bool(rest) or c.effect in own
                    )
                else:
                    places = {member.component, *self._groups_of(member.component)}
                    tasks += self._with_laws(
                        rest,
                        lambda c, places=places, member=member: (
                            c.component in places and c.effect != member.effect
                        ),
                    )
        self._fit_all(tasks)

    def _with_laws(self, rest: tuple[Candidate, ...], allowed: Callable[[Candidate], bool]) -> list[Task]:
        """Fits with the best of the candidates allowed, no intervals among them, beside a set."""
        base = self.found.get(_identity(rest))
        if base is None:
            return []
        if _identity(rest) not in self._screenings:
            self.screened(base.fit)
        screened = self._screenings[_identity(rest)]
        found = screened.best_of(lambda c: allowed(c) and not self._in_intervals(c), OTHERS)
        return [
            self._task(base.fit, [(screened.variants[index], amplitude)], {}) for index, amplitude in found
        ]

    def _at_other_spots(self, fit: Fit, member: Candidate, rest: tuple[Candidate, ...]) -> list[Task]:
        """Fits with intervals at other spots, sought in what a set without one member leaves as it is."""
        kept = {name: value for name, value in fit.values.items() if name not in member.parameters}
        left = self.problem.fit(rest, kept, iterations=0)
        tasks: list[Task] = []
        for found, candidate in self._interval_candidates(left, None):
            if len(tasks) == OTHER_SPOTS:
                break
            if _identity((*rest, candidate)) not in self.found:
                tasks.append(self._task(left, [(Variant(candidate, {}), 1.0)], {id(candidate): found}))
        return tasks

    def _widen(self) -> None:
        """Try the whole set where one of its bearings was found."""
        tasks: list[Task] = []
        for hypothesis in self.ranked()[:REDUCED]:
            for position, candidate in enumerate(hypothesis.fit.candidates):
                for wider in self._sets_of(candidate):
                    members = list(hypothesis.fit.candidates)
                    members[position] = wider
                    if len({(c.effect, c.component) for c in members}) < len(members):
                        continue
                    # What the bearing had is a start for the set; its own names differ.
                    values = hypothesis.fit.values
                    start = values | _renamed_values(candidate, wider, values)
                    tasks.append((tuple(members), start))
        self._fit_all(tasks)

    def _families(self) -> dict[str, str]:
        """Bearing set of every bearing: what all of a set has, one of its bearings has not once more."""
        named = {g: self.view.component(g) for g in self.view.groups}
        return {bearing: named[g] for g in self.view.groups for bearing in self.view.sets[g]}

    def _groups_of(self, component: str) -> list[str]:
        """Bearing sets that a bearing belongs to."""
        return [g for g in self.view.groups if component in self.view.sets[g]]

    def _sets_of(self, candidate: Candidate) -> list[Candidate]:
        """The same effect in the same form at the sets that a bearing belongs to."""
        groups = self._groups_of(candidate.component)
        return [
            item
            for item in self.candidates
            if item.effect == candidate.effect and item.component in groups and item.form == candidate.form
        ]

    def _reduce(self) -> None:
        """Leave out what came first: each of the best sets without each of its members."""
        self._fit_all(
            [
                (tuple(c for c in hypothesis.fit.candidates if c is not left_out), hypothesis.fit.values)
                for hypothesis in [h for h in self.ranked() if len(h.fit.candidates) > 1][:REDUCED]
                for left_out in hypothesis.fit.candidates
            ]
        )

    def ranked(self) -> list[Hypothesis]:
        """Hypotheses, the most probable first."""
        return sorted(self.found.values(), key=lambda h: -h.score)

    # ------------------------------------------------------------------ steps
    @staticmethod
    def _explained(hypothesis: Hypothesis) -> bool:
        return hypothesis.fit.reduced_misfit < EXPLAINED**2

    def _extend(
        self,
        fit: Fit,
        screened: Screened,
        intervals: Mapping[int, OnOff],
        number: int,
        count: int,
        always: int = 0,
    ) -> None:
        """Fit the most promising additions of so many effects to a hypothesis."""
        if len(fit.candidates) + number > LARGEST_SET:
            return
        tasks: list[Task] = []
        known = self.ranked()[0].score - self.found[_identity(())].score
        for tried, (members, gain) in enumerate(screened.best(number, count)):
            if tried == 0:
                promised = gain
            if tried >= always and (gain < ENOUGH_GAIN or gain < PROMISING * promised):
                break
            if number > 1 and gain < known:
                break
            amplitudes = screened.amplitudes(members)
            additions = [(screened.variants[i], amplitudes[i]) for i in members]
            tasks.append(self._task(fit, additions, intervals))
        self._fit_all(tasks)

    def screened(self, fit: Fit, trust: Fit | None = None) -> tuple[Screened, dict[int, OnOff]]:
        """Candidates, and intervals at every spot, against what a fit leaves.

        ``trust`` is the fit that gains count from where that is another one.
        """
        families = self._families()
        present = {(effect, families.get(component, component)) for effect, component in fit.keys}
        allowed = [
            c for c in self.candidates if (c.effect, families.get(c.component, c.component)) not in present
        ]
        times, residual = self._residual(fit)
        variants = variants_of(
            [replace(c, starts=self.effects[c.effect].starts_from(c, times, residual)) for c in allowed]
        )
        intervals = {}
        if not any(self._in_intervals(c) for c in fit.candidates):
            for found, candidate in self._interval_candidates(fit, trust):
                variant = Variant(candidate, {})
                intervals[id(candidate)] = found
                variants.append(variant)
        found = screen(self.problem, fit, variants, self.weights, families, trust, self.workers)
        if trust is None:
            self._screenings[_identity(fit.candidates)] = found
        return found, intervals

    def _residual(self, fit: Fit) -> tuple[Array, Array]:
        """What a fit leaves of the readings of the first recording that may be used, NaN elsewhere."""
        plant = self.problem.plant
        recording = plant.recordings[0]
        predicted = plant.predict(0, fit.values, fit.candidates).temperature
        grid = plant.drives[0].grid
        at_stamps = np.column_stack([np.interp(recording.times, grid, column) for column in predicted.T])
        known = recording.usable & plant.use[0][:, None]
        return recording.times, np.where(known, recording.temperature - at_stamps, np.nan)

    def _interval_candidates(self, fit: Fit, trust: Fit | None) -> Iterable[tuple[OnOff, Candidate]]:
        patterns = [
            (effect, Pattern(spot, self.view.spots[spot], effect.name == "unrecorded_cooling"))
            for effect in self.interval_effects
            for spot in effect.places(self.view)
            if not self.view.switched_on(effect.name, self.view.component(spot))
        ]
        found: list[tuple[IntervalEffect, OnOff]] = []
        for recording in range(len(self.problem.plant.recordings)):
            answers: list[Onsets] = onset_answers(
                self.problem,
                fit,
                [pattern for _, pattern in patterns],
                recording,
                trust=trust,
                workers=self.workers,
            )
            stop = float(self.problem.plant.drives[recording].grid[-1])
            for (effect, pattern), onsets in zip(patterns, answers, strict=True):
                probe = effect.over(self.view, pattern.spot, [(0.0, stop)])
                spread = probe.parameters[probe.amplitude].sigma
                options = find_intervals(onsets, spread, stop)
                options = [o for o in options if not self._within_gaps(o.intervals, recording)]
                if options:
                    found.append((effect, max(options, key=lambda item: item.gain)))
        found.sort(key=lambda item: -item[1].gain)
        for effect, item in found[:12]:
            if item.gain > 0.0:
                candidate = effect.over(self.view, item.pattern.spot, item.intervals)
                several = len(self.problem.plant.recordings) > 1
                yield (
                    item,
                    replace(
                        candidate,
                        reference=max(item.strength, 1e-3),
                        recording=item.recording if several else None,
                    ),
                )

    def _task(
        self, fit: Fit, additions: Sequence[tuple[Variant, float]], intervals: Mapping[int, OnOff]
    ) -> Task:
        """A fit with additions, and where it begins."""
        candidates = (*fit.candidates, *(variant.candidate for variant, _ in additions))
        start = fit.values
        for variant, scaled in additions:
            factors = {item.name for item in variant.candidate.factors}
            values = dict(variant.shape) | {variant.candidate.amplitude: amplitude_value(variant, scaled)}
            start |= {EFFECT_PREFIX + n if n in factors else n: v for n, v in values.items()}
            if id(variant.candidate) in intervals:
                cost = intervals_cost(intervals[id(variant.candidate)])
                self._paid[_identity((variant.candidate,))] = cost
        return candidates, start

    def _fit_all(self, tasks: Sequence[Task]) -> None:
        """Fit the sets that are not known yet, some abreast, and keep them.

        As many together whether or not there are workers for it, so that the result is the same.
        """
        waiting: dict[frozenset, Task] = {}
        for candidates, start in tasks:
            key = _identity(candidates)
            if key not in self.found:
                waiting.setdefault(key, (candidates, start))
        queue = list(waiting.values())
        rest = range(ABREAST, len(queue), FURTHER)
        for together in (queue[:ABREAST], *(queue[first : first + FURTHER] for first in rest)):
            orders = [
                FitOrder(candidates, start, MILDER, self._hopeless(len(candidates)))
                for candidates, start in together
            ]
            for (candidates, _), fitted in zip(
                together, self.workers.fits(self.problem, orders), strict=True
            ):
                # What cannot be simulated explains nothing; its neighbours are tried.
                if fitted is None or any(self._unseen(c, fitted.values) for c in candidates):
                    continue
                paid = sum(self._paid.get(_identity((c,)), 0.0) for c in candidates)
                self._keep(Hypothesis(fitted, self.log_prior(candidates) - paid))

    def _unseen(self, candidate: Candidate, values: Mapping[str, float]) -> bool:
        """Whether an effect is on only where nothing was recorded, neither readings nor inputs."""
        if not self._in_intervals(candidate):
            return False
        on = self.effects[candidate.effect].intervals(candidate, values)
        return self._within_gaps(on, candidate.recording or 0)

    def _in_intervals(self, candidate: Candidate) -> bool:
        return in_intervals(self.effects[candidate.effect], candidate)

    def _within_gaps(self, intervals: Sequence[tuple[float, float]], recording: int) -> bool:
        """Whether any interval lies in gaps by more than ``HIDDEN`` of it."""
        gaps = self.problem.plant.gap_intervals(recording)
        return any(
            sum(max(0.0, min(end, stop) - max(start, begin)) for begin, stop in gaps) > HIDDEN * (end - start)
            for start, end in intervals
        )

    def _hopeless(self, size: int) -> float:
        """Misfit beyond which a set of some size does not matter."""
        return self.ranked()[0].fit.misfit_with_prior + 2.0 * self._reach(size)

    def _reach(self, size: int) -> float:
        """How much less likely than the best a set may be and still matter."""
        if size > 1:
            return HOPELESS
        gain = self.ranked()[0].score - self.found[_identity(())].score
        return max(HOPELESS, (1.0 - FAIR_SHARE) * gain)

    def _keep(self, hypothesis: Hypothesis) -> None:
        self.found[_identity(hypothesis.fit.candidates)] = hypothesis

    def log_prior(self, candidates: Sequence[Candidate]) -> float:
        """Logarithm of the prior of a set."""
        total = sum(self.weights.values())
        found = float(np.log(NUMBER_PRIOR[len(candidates)]))
        for candidate in candidates:
            if self._in_intervals(candidate):
                places, share = len(self.effects[candidate.effect].places(self.view)), 1.0
            else:
                same = [c for c in self.candidates if c.effect == candidate.effect]
                places = len({c.component for c in same})
                here = sum(c.likelihood for c in same if c.component == candidate.component)
                share = candidate.likelihood / here if here else 1.0
            found += float(np.log(self.weights[candidate.effect] / total * share / places))
        # A set counts once, in whatever order it is drawn.
        return found + float(np.sum(np.log(np.arange(1, len(candidates) + 1))))


def _renamed_values(candidate: Candidate, other: Candidate, values: Mapping[str, float]) -> dict[str, float]:
    """Values of a candidate's parameters under the names of the same candidate elsewhere."""

    def outer(item: Candidate) -> list[str]:
        factors = {f.name for f in item.factors}
        return [EFFECT_PREFIX + name if name in factors else name for name in item.parameters]

    names = zip(outer(candidate), outer(other), strict=False)
    return {theirs: values[own] for own, theirs in names if own in values}


def intervals_cost(item: OnOff) -> float:
    """What choosing the intervals costs, as a logarithm."""
    options = ONSETS * (ONSETS + 1) / 2
    number = len(item.intervals)
    return number * float(np.log(options)) - float(np.sum(np.log(np.arange(1, number + 1))))


def _identity(candidates: Iterable[Candidate]) -> frozenset:
    return frozenset((c.effect, c.component, c.form, len(c.free)) for c in candidates)
