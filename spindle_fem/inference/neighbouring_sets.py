"""Sets that differ from the best ones by one member: left out, exchanged, or of a whole bearing set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import Variant
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.hidden_states import without
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.hypothesis_search import Search, Task
from spindle_fem.inference.missing_heat import OnOff
from spindle_fem.inference.screening import is_far_off
from spindle_fem.inference.worker_processes import Workers, of_candidates

# Kind of a candidate that only changes what a channel shows.
SENSOR = "sensor"


def widened(search: Search) -> None:
    """Try the whole set where one of its bearings was found."""
    tasks: list[Task] = []
    for hypothesis in search.ranked()[: tuned.SETS_REDUCED]:
        for position, candidate in enumerate(hypothesis.fit.candidates):
            for wider in _sets_of(search, candidate):
                members = list(hypothesis.fit.candidates)
                members[position] = wider
                if len({c.key for c in members}) < len(members):
                    continue
                # The bearing's values are a start for the set, whose names differ.
                values = hypothesis.fit.values
                start = values | _renamed_values(candidate, wider, values)
                tasks.append((tuple(members), start))
    search.fit_all(tasks)


def reduced(search: Search) -> None:
    """Leave out what came first: each of the best sets without each of its members.

    Where a member does nothing, the rest begins better than its own fit may have ended.
    """
    search.fit_all(
        [
            (tuple(c for c in hypothesis.fit.candidates if c is not left_out), hypothesis.fit.values)
            for hypothesis in [h for h in search.ranked() if len(h.fit.candidates) > 1][: tuned.SETS_REDUCED]
            for left_out in hypothesis.fit.candidates
        ],
        again=True,
    )


def exchanged(search: Search) -> None:
    """Try other effects in the place of each member of the best sets.

    The linearised screening misjudges a large effect, so that the right one may not have passed it.
    A channel that is late is tried with the other law that makes it so.
    """
    explained = search.is_explained(search.ranked()[0])
    reach = tuned.EXCHANGED_REACH if explained else tuned.HOPELESS_SCORE
    is_network = search.problem.predictor.is_network
    tasks: list[Task] = []
    late: list[Task] = []
    for hypothesis in [h for h in search.ranked() if h.fit.candidates][: tuned.SETS_EXCHANGED]:
        for member in hypothesis.fit.candidates:
            rest = tuple(c for c in hypothesis.fit.candidates if c is not member)
            late += _as_late(search, hypothesis.fit, member, rest)
            if is_network:
                tasks += _of_neighbours(search, hypothesis.fit, member, rest)
            else:
                tasks += _in_place_of(search, hypothesis.fit, member, rest, reach)
    stuck = [] if is_network else [task for task in tasks if _has_pulled(search, task[0])]
    search.fit_all([*late, *stuck], anew=True, reach=reach)
    search.fit_all(tasks, reach=reach)


def _has_pulled(search: Search, candidates: tuple[Candidate, ...]) -> bool:
    """Whether a set's fit ended with the machine pulled far off: about the best set it may end elsewhere."""
    known = search.found.get(identity(candidates))
    return known is not None and known.fit.misfit_with_prior - known.fit.misfit > tuned.PULLED


def _in_place_of(
    search: Search, fit: Fit, member: Candidate, rest: tuple[Candidate, ...], reach: float
) -> list[Task]:
    """Fits with what may do what one member of a set does, to first order about the set as it was fitted.

    There the machine is as it is known best: about what the others alone leave, it has taken up part of what
    the member does. Intervals, which fit almost anything, are sought beside others only, or in the place of
    such; the member's own are tried at every other spot too. What else a lying sensor may do is tried
    whatever it promises, and the other forms of a factor that is far off: to first order both say little.
    """
    left = search.problem.simulated(*without(fit, member), iterations=0)
    if left is None:  # without the member, its others run away
        return []
    only_laws = not rest and not search.in_intervals(member)
    moved = search.elsewhere(member, fit.values) if search.in_intervals(member) else ()
    screened, intervals = search.screened(left, fit, only_laws=only_laws, beside=moved)
    gains = screened.singles()
    least = -tuned.EXCHANGE_PROMISES * reach
    tried: Counter[str] = Counter()
    warmed = {_bearings_warmed(search, member)}
    far_off: set[tuple[str, str]] = set()
    tasks: list[Task] = []
    for index in screened.best_of(lambda c: True, len(gains)):
        variant = screened.variants[index]
        candidate = variant.candidate
        bearings = _bearings_warmed(search, candidate)
        if bearings and bearings in warmed:
            continue
        warmed.add(bearings)
        tried[candidate.effect] += 1
        good = gains[index] >= least and tried[candidate.effect] <= tuned.OTHER_SPOTS
        chosen = good and len(tasks) < tuned.EFFECTS_EXCHANGED
        if chosen or variant.key in far_off or _of_one_sensor(candidate, member):
            amplitude = screened.amplitudes([index])[index]
            # The member itself is among them: it has been fitted.
            if identity((candidate,)) != identity((member,)):
                tasks.append(search.task(left, [(variant, amplitude)], intervals))
            if chosen and is_far_off(variant, amplitude):
                far_off.add(variant.key)
    return tasks


def _bearings_warmed(search: Search, candidate: Candidate) -> tuple[str, str] | None:
    """Effect and bearing set of what warms or cools bearings in intervals, where one does as all do."""
    families = search.families()
    whole = families.get(candidate.component, candidate.component)
    if search.in_intervals(candidate) and whole in families.values():
        return candidate.effect, whole
    return None


def _of_one_sensor(candidate: Candidate, member: Candidate) -> bool:
    return candidate.kind == member.kind == SENSOR and candidate.component == member.component


def _of_neighbours(search: Search, fit: Fit, member: Candidate, rest: tuple[Candidate, ...]) -> list[Task]:
    """Fits of a network, which are quick, with what may act near one member of a set in its place.

    Screened about what the others alone leave, as a search has done before. Unrecorded heat in intervals fits
    almost anything: it is tried at other spots, and beside others any law is tried in its place; itself in
    that of a law of one of several recordings. Where it follows a recorded quantity it is tried at other
    spots too; and the other forms of one law, which hardly differ to first order.
    """
    own = {effect.name for effect in search.interval_effects}
    tasks: list[Task] = []
    if search.in_intervals(member) or member.recording is not None:
        tasks += at_other_spots(search, fit, member, rest)
    if search.in_intervals(member):
        tasks += _with_laws(search, rest, lambda c: bool(rest) or c.effect in own)
    else:
        if member.effect in own:
            tasks += _with_laws(search, rest, lambda c: c.effect in own and c.component != member.component)
        tasks += _with_laws(
            search,
            rest,
            lambda c: c.key[:2] == member.key[:2] and (c.key, c.form) != (member.key, member.form),
        )
        places = _beside(search, member.component)
        tasks += _with_laws(search, rest, lambda c: c.component in places and c.effect != member.effect)
    return tasks


def _as_late(search: Search, fit: Fit, member: Candidate, rest: tuple[Candidate, ...]) -> list[Task]:
    """The delay that a member is by another law, a clock or a slow sensor.

    To first order both are the same: a fit that begins from an estimate of that order may end far off.
    """
    if not search.effects[member.effect].delays:
        return []
    seconds = fit.values[member.amplitude]
    return [
        ((*rest, other), fit.values | {other.amplitude: seconds})
        for other in search.delaying(member.reading.channel, seconds)
        if other.effect != member.effect
    ]


def _with_laws(
    search: Search,
    rest: tuple[Candidate, ...],
    allowed: Callable[[Candidate], bool],
) -> list[Task]:
    """Fits with the best of the candidates allowed, no intervals among them, beside a set."""
    base = search.found.get(identity(rest))
    if base is None:
        return []
    fit, screened = search.screenings.get(identity(rest), (None, None))
    if fit is not base.fit:
        screened, _ = search.screened(base.fit, only_laws=True)
    found = screened.best_of(lambda c: allowed(c) and not search.in_intervals(c), tuned.EFFECTS_EXCHANGED)
    gains, least = screened.singles(), -np.inf
    if search.is_explained(base):
        # What is still to be found is small, and first order says how much it gains.
        least = tuned.LEAST_PROMISED_SHARE * float(gains.max(initial=0.0))
    return [
        search.task(base.fit, [(screened.variants[index], screened.amplitudes([index])[index])], {})
        for index in found
        if gains[index] >= least
    ]


def at_other_spots(
    search: Search,
    fit: Fit,
    member: Candidate,
    rest: tuple[Candidate, ...],
) -> list[Task]:
    """Fits with intervals at other spots, sought in what a set without one member leaves as it is."""
    left = search.problem.simulated(*without(fit, member), iterations=0)
    tasks: list[Task] = []
    if left is None:  # without the member, its others run away
        return tasks
    for found, candidate in search.interval_candidates(left):
        if len(tasks) == tuned.OTHER_SPOTS:
            break
        if candidate.key not in {c.key for c in rest} and identity((*rest, candidate)) not in search.found:
            tasks.append(search.task(left, [(Variant(candidate, {}), 1.0)], {id(candidate): found}))
    return tasks


def sought_again(search: Search, sets: Sequence[tuple[Fit, Candidate]]) -> list[Task]:
    """Fits from other intervals of one member of each set, in what its others leave."""
    found = search.workers.beside([partial(_other_intervals, search, fit, event) for fit, event in sets])
    tasks: list[Task] = []
    for (fit, event), answer in zip(sets, found, strict=True):
        if answer is not None:
            left, intervals, candidate = answer
            left = of_candidates(left, [c for c in fit.candidates if c is not event])
            tasks.append(search.task(left, [(Variant(candidate, {}), 1.0)], {id(candidate): intervals}))
    return tasks


def _other_intervals(search: Search, fit: Fit, event: Candidate) -> tuple[Fit, OnOff, Candidate] | None:
    """A set without an event, and where that is on instead; None where it is on then already."""
    alone = replace(search, workers=Workers())
    rest = tuple(c for c in fit.candidates if c is not event)
    known = search.found.get(identity(rest))
    left = search.problem.simulated(rest, fit.values) if known is None else known.fit
    if left is None:
        return None
    own = search.effects[event.effect].intervals(event, fit.values)
    for found, candidate in alone.interval_candidates(left, like=event):
        if candidate.form == event.form:
            instants = search.problem.predictor.drives[found.recording].grid[-1] / found.options
            same = len(own) == len(found.intervals)
            same = same and np.allclose(own, found.intervals, rtol=0.0, atol=instants)
            return None if same else (left, found, candidate)
    return None


def _beside(search: Search, component: str) -> set[str]:
    """A component of a network, a node's links and a link's nodes."""
    nodes = set(component.split("|"))
    return {component, *(c.component for c in search.candidates if nodes & set(c.component.split("|")))}


def _groups_of(search: Search, component: str) -> list[str]:
    """Bearing sets that a bearing belongs to."""
    return [g for g in search.view.groups if component in search.view.sets[g]]


def _sets_of(search: Search, candidate: Candidate) -> list[Candidate]:
    """The effect in the same form at the sets that a bearing belongs to."""
    groups = _groups_of(search, candidate.component)
    return [
        item
        for item in search.candidates
        if item.effect == candidate.effect and item.component in groups and item.form == candidate.form
    ]


def _renamed_values(candidate: Candidate, other: Candidate, values: Mapping[str, float]) -> dict[str, float]:
    """Values of a candidate's parameters under the names of the same candidate elsewhere."""

    def outer(item: Candidate) -> list[str]:
        factors = {f.name for f in item.factors}
        return [EFFECT_PREFIX + name if name in factors else name for name in item.parameters]

    names = zip(outer(candidate), outer(other), strict=False)
    return {theirs: values[own] for own, theirs in names if own in values}
