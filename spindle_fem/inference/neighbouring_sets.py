"""Sets that differ from the best ones by one member: left out, exchanged, or of a whole bearing set."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import Variant
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.hypothesis_search import Search, Task
from spindle_fem.inference.missing_heat import OnOff
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
                if len({(c.effect, c.component) for c in members}) < len(members):
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

    The linearised screening misjudges a large effect, so that the right one
    may not have passed it. Unrecorded heat in intervals fits almost anything:
    it is tried at other spots, and beside other effects any effect that
    follows a law is tried in its place. Where it follows a recorded quantity it
    is tried at other spots too. To first order the forms of one law hardly differ: the others are tried in
    its place. Of a machine with geometry a sensor that lies shows what physics near it may do as well: any is
    tried in its place; and in the place of a law beside others, such as a drifting room, heat in intervals.
    A channel that is late is tried with the other law that makes it so.
    """
    tasks: list[Task] = []
    late: list[Task] = []
    own = {effect.name for effect in search.interval_effects}
    is_spindle = search.view.kind != "network"
    for hypothesis in [h for h in search.ranked() if h.fit.candidates][: tuned.SETS_EXCHANGED]:
        for member in hypothesis.fit.candidates:
            rest = tuple(c for c in hypothesis.fit.candidates if c is not member)
            late += _as_late(search, hypothesis.fit, member, rest)
            if search.in_intervals(member):
                tasks += at_other_spots(search, hypothesis.fit, member, rest)
                tasks += _with_laws(search, rest, lambda c, rest=rest: bool(rest) or c.effect in own)
            else:
                if member.effect in own:
                    tasks += _with_laws(
                        search,
                        rest,
                        lambda c, member=member: c.effect in own and c.component != member.component,
                    )
                tasks += _with_laws(
                    search,
                    rest,
                    lambda c, member=member: (
                        (c.effect, c.component) == (member.effect, member.component) and c.form != member.form
                    ),
                )
                places = _beside(search, member.component)
                tasks += _with_laws(
                    search,
                    rest,
                    lambda c, places=places, member=member: (
                        (c.component in places and c.effect != member.effect)
                        or (is_spindle and member.kind == SENSOR != c.kind)
                    ),
                )
                if is_spindle and member.kind == SENSOR:
                    # Physics near it may crowd out what else its sensor may do wrong.
                    tasks += _with_laws(
                        search,
                        rest,
                        lambda c, member=member: (
                            (c.kind, c.component) == (SENSOR, member.component) and c.effect != member.effect
                        ),
                        len(search.candidates),
                    )
                if is_spindle and rest and not any(search.in_intervals(c) for c in rest):
                    tasks += at_other_spots(search, hypothesis.fit, member, rest, of_each=1)
    explained = search.is_explained(search.ranked()[0])
    reach = tuned.EXCHANGED_REACH if explained else tuned.HOPELESS_SCORE
    search.fit_all(late, anew=True, reach=reach)
    search.fit_all(tasks, reach=reach)


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
    number: int = tuned.EFFECTS_EXCHANGED,
) -> list[Task]:
    """Fits with the best of the candidates allowed, no intervals among them, beside a set."""
    base = search.found.get(identity(rest))
    if base is None:
        return []
    if identity(rest) not in search.screenings:
        search.screened(base.fit, only_laws=True)
    screened = search.screenings[identity(rest)]
    found = screened.best_of(lambda c: allowed(c) and not search.in_intervals(c), number)
    gains, least = screened.singles(), -np.inf
    if search.is_explained(base):
        # What is still to be found is small, and first order says how much it gains.
        least = tuned.LEAST_PROMISED_SHARE * float(gains.max(initial=0.0))
    return [
        search.task(base.fit, [(screened.variants[index], amplitude)], {})
        for index, amplitude in found
        if gains[index] >= least
    ]


def at_other_spots(
    search: Search,
    fit: Fit,
    member: Candidate,
    rest: tuple[Candidate, ...],
    of_each: int = tuned.OTHER_SPOTS,
) -> list[Task]:
    """Fits with intervals at other spots, sought in what a set without one member leaves as it is.

    At most ``of_each`` of heat and of loss, and ``tuned.OTHER_SPOTS`` in all.
    """
    kept = {name: value for name, value in fit.values.items() if name not in member.parameters}
    left = search.problem.simulated(rest, kept, iterations=0)
    tasks: list[Task] = []
    if left is None:  # without the member, its others run away
        return tasks
    for found, candidate in search.interval_candidates(left):
        if len(tasks) == tuned.OTHER_SPOTS:
            break
        alike = sum(members[-1].effect == candidate.effect for members, _ in tasks)
        if alike < of_each and identity((*rest, candidate)) not in search.found:
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
    """A component, the sets it belongs to, and in a network a node's links and a link's nodes."""
    found = {component, *_groups_of(search, component)}
    if search.view.kind == "network":
        nodes = set(component.split("|"))
        found |= {c.component for c in search.candidates if nodes & set(c.component.split("|"))}
    return found


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
