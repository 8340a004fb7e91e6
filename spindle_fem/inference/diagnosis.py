"""The diagnosis itself: from a machine and its recordings to a judgement with everything it rests on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.registry import candidates_for, catalogue, interval_effects
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Coordinate
from spindle_fem.inference.candidate_response import variants_of
from spindle_fem.inference.final_fits import fitted_sets, likelier_about, to_be_fitted
from spindle_fem.inference.followed_readings import Followed, FollowedReadings
from spindle_fem.inference.followed_states import InferredState, inferred_states, states_on_rows
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.missing_heat import Explanation, Pattern, explain, onset_answers
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import (
    Calibrated,
    calibrate,
    slow_error_of,
    with_inexact_laws,
    with_own_noise,
)
from spindle_fem.inference.recording_clocks import on_clock_of_inputs
from spindle_fem.inference.search_basis import acted_on, on_smaller_bases, smaller_predictors
from spindle_fem.inference.search_course import run_search
from spindle_fem.inference.set_odds import rank
from spindle_fem.inference.set_problems import SetProblems, combination_of
from spindle_fem.inference.uncertain_numbers import uncertain_numbers
from spindle_fem.inference.verdict import Judgement, judge
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.inference.wrong_definition import (
    WrongDirection,
    defined_number,
    is_beyond_prior,
    known_of,
    number_beyond_prior,
    suspected_direction,
    suspected_of_calibration,
    with_wrong_definition,
)
from spindle_fem.parallel import thread_count

Array = NDArray[np.float64]
Progress = Callable[[str], None]

# Processes that fit at most: the fits of one step of a search keep no more busy.
MOST_WORKERS = 4


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of a diagnosis, and what it is based on.

    Attributes
    ----------
    predictor : Predictor
        Machine on the diagnosed recordings, on the basis of final fits, with what its misdescriptions do
        beside the chosen set: that of ``final``.
    unchanged : Predictor
        The same with what they do with nothing missing: that of ``null``.
    hypotheses : tuple of Hypothesis
        The most probable first.
    null : Fit
        Nothing missing, the machine's own parameters fitted; where its definition is wrong, as it was given.
    final : Fit
        The chosen set.
    explanations : tuple of Explanation
        Missing heat over time at every spot, if it were the only one.
    heldout : str
        How the held-out readings were chosen.
    seconds : mapping of stage to float
    wrong : tuple of WrongDirection
        Where the definition is wrong.
    put_right : mapping of str to float
        How far the definition that was diagnosed is from the given one in each number that was followed,
        told wrong or not, in deviations of its prior, by coordinate.
    suspected : WrongDirection or None
        A number of it that is to be tried by making the machine anew.
    followed : Followed or None
        The chosen set with states and moments that all readings tell.
    notes : tuple of str
        What could not be done as usual.
    """

    predictor: Predictor
    unchanged: Predictor
    view: MachineView
    calibrated: Calibrated
    hypotheses: tuple[Hypothesis, ...]
    judgement: Judgement
    null: Fit
    final: Fit
    explanations: tuple[Explanation, ...]
    heldout: str
    candidates_tried: int
    seconds: Mapping[str, float]
    wrong: tuple[WrongDirection, ...] = ()
    put_right: Mapping[str, float] = field(default_factory=dict)
    suspected: WrongDirection | None = None
    followed: Followed | None = None
    notes: tuple[str, ...] = ()

    @property
    def without_prior(self) -> frozenset[str]:
        """Coordinates of the machine whose prior is given up."""
        return frozenset((*self.put_right, *(item.direction.coordinate for item in self.wrong)))

    @property
    def coarseness(self) -> float:
        """How many times less gains count than on a machine that is drawn."""
        return _coarseness(self.predictor.is_network)

    @property
    def stated_fit(self) -> Fit:
        """The chosen set as it is stated: with hidden states from all readings, else as it was fitted."""
        return self.followed.fit if self.followed and self.followed.states else self.final

    @property
    def states(self) -> Mapping[str, InferredState]:
        """Hidden states of the chosen set, by the name of their amplitude."""
        return self.followed.states if self.followed else {}

    @property
    def machine_coordinates(self) -> tuple[Coordinate, ...]:
        """The machine's own coordinates."""
        return self.calibrated.belief.coordinates

    def stamp(self, seconds: float, recording: int = 0) -> float | str:
        """A time as the recording has them: seconds from its start, or an ISO 8601 stamp."""
        start = self.predictor.recordings[recording].start
        if start is None:
            return float(seconds)
        moment = datetime.fromisoformat(start) + timedelta(seconds=float(seconds))
        return moment.isoformat()


# Threads gain nothing on matrices of a hundred unknowns, and other processes need the cores.
@threadpool_limits.wrap(limits=1)
def diagnose_recordings(
    machine: DiagnosedMachine,
    *,
    heldout: str = "blocks",
    progress: Progress = lambda stage: None,
    workers: Workers | None = None,
    settled: Callable[[Predictor, Fit], None] = lambda predictor, fit: None,
    meanwhile: Callable[[], None] = lambda: None,
) -> Diagnosis:
    """Diagnose a machine's recordings.

    Parameters
    ----------
    heldout : str
        As :func:`heldout_stamps` takes it.
    workers : Workers, optional
        Processes that fit, by default as many as threads are given; the result does not depend on it.
    settled : callable
        Gets the fit of nothing missing, and that of what is told, with the predictor of each, once it is
        known.
    meanwhile : callable
        Called where this process would wait for its calibration.
    """
    clock = _Clock()
    fast, view = machine.fast, machine.view
    workers = Workers(min(thread_count(), MOST_WORKERS)) if workers is None else workers
    recordings, calibration = machine.recordings, machine.calibration
    chosen = [heldout_stamps(item, heldout) for item in recordings]
    seen, unseen = machine.unseen[: len(recordings)], machine.unseen[len(recordings) :]
    predictor = Predictor(fast, recordings, [~mask for mask, _ in chosen], machine.effects).with_unseen(seen)
    progress("diagnosis: calibration" if calibration else "diagnosis: what is known")
    earlier = None
    if calibration:
        earlier = Predictor(fast, calibration, effects=machine.effects).with_unseen(unseen)
    directions = misdescriptions_of(predictor)
    candidates = candidates_for(view, len(recordings))
    places = sorted(acted_on(predictor, view, candidates))
    calibrating = workers.ahead(partial(_calibrated, earlier, predictor, directions, places, machine))
    small, predictor, known = smaller_predictors(predictor, view, candidates)
    predictor = with_misdescriptions(predictor, directions)
    small = small.misdescribed_like(predictor)
    if calibration:
        meanwhile()
    calibrated = calibrating()
    if earlier is not None and machine.is_network:
        belief = calibrated.belief
        fitted = {c.name: c.at(u) for c, u in zip(belief.coordinates, belief.mean, strict=True)}
        small = predictor = with_misdescriptions(predictor, directions, fitted)
    clock.lap("calibration")
    effects = catalogue()
    weights = {name: effect.prior_weight for name, effect in effects.items()}
    problem = Problem(small, calibrated.known, calibrated.slow, small.observations)
    without = problem.fit()
    if directions:
        # Their columns, about the machine as its recordings show it.
        predictor, problem, without = on_clock_of_inputs(predictor, problem, without, directions)
        small = problem.predictor
    problem = with_inexact_laws(problem, without)
    clock.lap("reduction")
    search = Search(problem, view, effects, candidates, interval_effects(), weights, progress, workers)
    found = [replace(h, expected_misfit=h.fit.reduced_misfit) for h in run_search(search, without.values)]
    clock.lap("search")
    progress("diagnosis: final fits")
    coarseness = _coarseness(machine.is_network)
    best = rank(found, coarseness)[0].best
    slow = slow_error_of(problem, best.fit)
    trials = len({(c.effect, c.component) for c in candidates})
    empty = next(h for h in found if not h.fit.candidates)
    wrong, belief = calibrated.suspected, calibrated.known
    if wrong is None and machine.redefined is None:
        # A parameter that an effect shifts is told by that effect.
        shifted = {factor.name for c in candidates if c.shift_of_prior for factor in c.factors}
        numbers = () if machine.is_network else uncertain_numbers(machine.spec)
        unshifted = [item for item in numbers if item.name not in shifted]
        wrong = suspected_direction(
            problem, found, (*directions, *unshifted), trials, coarseness, machine.spec
        )
    # What is a number of the definition is tried by making the machine anew.
    freed = wrong is not None and defined_number(wrong.direction, machine.spec) is None
    if freed:
        belief = wrong.belief
        problem = Problem(small, belief, slow, small.observations)
        slow = slow_error_of(problem, problem.fit((), empty.fit.values))
    unchanged = predictor
    if machine.is_network:
        unchanged = with_misdescriptions(predictor, directions, empty.fit.values)
    # Nothing missing is the likelier of what directions do about its own run and about that of the set.
    plain = Problem(unchanged, belief, slow, predictor.observations)
    own_fit = workers.ahead(partial(plain.fit, (), empty.fit.values))
    notes: tuple[str, ...] = ()
    if directions:
        # A set changes what directions do; calibration knows them by what they did without it.
        try:
            predictor = with_misdescriptions(predictor, directions, best.fit.values, best.fit.candidates)
        except NOT_SIMULATED as error:
            notes = (f"What drawings leave open is taken about nothing missing, not about the set: {error}",)
    about_first = Problem(predictor, belief, slow, predictor.observations)
    overlapping = overlapping_components(view)
    sets = to_be_fitted(about_first, found, overlapping, coarseness)
    problems = SetProblems(about_first, about_first, {combination_of(best.fit): about_first})
    problems = problems.about([h.fit for h in sets], workers)
    refitted = fitted_sets(problems, sets, workers)
    own = own_fit()
    after = next(h.fit for h in refitted if not h.fit.candidates)
    if after.misfit_with_prior < own.misfit_with_prior:
        own = after
    elif likelier_about(plain, refitted[0].fit):
        # Columns that mislead nothing missing mislead a set too: those about nothing missing then serve all.
        problems = SetProblems(plain, plain)
        refitted = fitted_sets(problems, to_be_fitted(plain, found, overlapping, coarseness), workers)
    else:
        problems = replace(problems, plain=plain)
    settled(problems.plain.predictor, own)
    refitted = [h if h.fit.candidates else replace(h, fit=own) for h in refitted]
    readings = FollowedReadings(problems, lambda fit: inferred_states(search, problems.of(fit), fit))
    readings.work_out([h.fit for h in refitted], workers)
    # Where likelihoods hold, they weigh held-out readings too; on a coarse machine only their errors tell.
    kept = readings.kept(refitted) if machine.is_network else refitted
    refitted = with_own_noise(problems.plain, readings.residuals, kept)
    refitted = [replace(h, heldout=readings.heldout_misfit(h.fit)) for h in refitted]
    clock.lap("final fits")
    tried = len(variants_of(candidates)) + len(view.spots) * len(interval_effects())
    judgement = judge(
        refitted,
        trials=trials,
        calibrated=bool(calibration),
        overlapping=overlapping,
        apart=readings.apart,
        left=readings.left,
        beyond=readings.beyond,
        coarseness=coarseness,
    )
    null = next(h for h in refitted if not h.fit.candidates)
    before, told = null.fit, ()
    if freed and judgement.verdict == "consistent":
        as_known = Problem(problems.plain.predictor, calibrated.known, slow, predictor.observations)
        within = as_known.fit((), null.fit.values)
        if null.heldout is not None:
            gain = 0.5 * (readings.heldout_misfit(within) - null.heldout)
            wrong = replace(wrong, told=gain / (coarseness * tuned.GAIN_DIVISOR))
        if wrong.is_beyond_chance and is_beyond_prior(wrong, machine, null.fit):
            told = (wrong,)
            judgement = with_wrong_definition(judgement, told, machine)
            # Without it, and where heat is missing then.
            before, problem = within, replace(problem, belief=calibrated.known)
    progress("diagnosis: where and when")
    chosen_fit = judgement.chosen.fit
    about_chosen = problems.of(chosen_fit)
    suspected = None if freed else wrong
    fresh = machine.redefined is None and not machine.is_network and not calibration
    if fresh and suspected is None and judgement.verdict in ("consistent", "sensor"):
        # Nothing explains the recording, or a sensor does, beside a value that its prior hardly holds.
        suspected = number_beyond_prior(about_chosen, chosen_fit, tuple(uncertain_numbers(machine.spec)))
    followed = readings.followed(chosen_fit)
    if followed.states and machine.rows:
        finer = readings.with_states(
            chosen_fit, states_on_rows(search, about_chosen, followed.fit, machine.rows, directions)
        )
        # On rows what a coarse picture leaves may pass for a state that flickers.
        followed = min(followed, finer, key=readings.left_with)
    if chosen_fit.candidates:
        settled(about_chosen.predictor, followed.fit if followed.states else chosen_fit)
    explanations = []
    about = problem.fit((), before.values)
    patterns = [Pattern(spot, tuple(p for p in own if p in known)) for spot, own in view.spots.items()]
    for number in range(len(recordings)):
        explanations += [
            explain(item) for item in onset_answers(problem, about, patterns, number, workers=workers)
        ]
    clock.lap("location")
    return Diagnosis(
        about_chosen.predictor,
        problems.plain.predictor,
        view,
        calibrated,
        tuple(refitted),
        judgement,
        before,
        judgement.chosen.fit,
        tuple(explanations),
        chosen[0][1],
        tried,
        clock.laps,
        told,
        suspected=suspected,
        followed=followed,
        notes=notes,
    )


def _coarseness(is_network: bool) -> float:
    """As :func:`tempered` takes it."""
    return tuned.NETWORK_COARSENESS if is_network else 1.0


def _calibrated(
    earlier: Predictor | None,
    predictor: Predictor,
    directions: Sequence[Misdescription],
    places: Sequence[str],
    machine: DiagnosedMachine,
) -> Calibrated:
    """What is known of a machine on the recordings to be diagnosed, from those of its calibration if any.

    ``places`` are those where something may act: what is not exact of the machine acts there too.
    """
    suspect = partial(suspected_of_calibration, directions=directions, machine=machine)
    if earlier is not None:
        found = misdescriptions_of(earlier)
        if not earlier.is_network:
            _, earlier = on_smaller_bases(earlier, [prior.name for prior in earlier.uncertain()], places)
        earlier = with_misdescriptions(earlier, found)
    known = partial(known_of, redefined=machine.redefined)
    return calibrate(earlier, predictor.misdescribed_by(directions, {}), suspect, known)


def overlapping_components(view: MachineView) -> dict[str, frozenset[str]]:
    """Components that a decision does not distinguish from each component.

    A set, its bearings, its other bearings; a probe and the part it sits in.
    """
    found: dict[str, set[str]] = {}
    for group in view.groups:
        members = set(view.sets[group])
        family = {name for name, own in view.sets.items() if set(own) <= members}
        for name in family:
            found.setdefault(name, set()).update(family)
    for probe, component in view.near.items():
        whole = found.setdefault(component, {component})
        found[probe] = {probe, *(whole - set(view.near))}
        for name in found[probe] - {probe}:
            found.setdefault(name, {name}).add(probe)
    return {name: frozenset(family) for name, family in found.items()}


class _Clock:
    def __init__(self) -> None:
        self._last = time.perf_counter()
        self.laps: dict[str, float] = {}

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
