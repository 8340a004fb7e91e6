"""A search from single effects to triples: from the screening, then by a beam, then among neighbours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.hidden_states import without
from spindle_fem.inference.hypothesis import Hypothesis, identity
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.hypothesis_search import LARGEST_SET, Search, Task
from spindle_fem.inference.input_sampling import left_over_noise
from spindle_fem.inference.misdescription import EVERY_CHANNEL
from spindle_fem.inference.neighbouring_sets import exchanged, reduced, sought_again, widened
from spindle_fem.inference.state_search import add_states, settle_best
from spindle_fem.inference.step_search import add_steps


def run_search(search: Search, begin: Mapping[str, float]) -> list[Hypothesis]:
    """All hypotheses that were fitted, the most probable first.

    ``begin`` are values that the fit of nothing missing begins from.

    A beam search: the most promising additions to the best hypotheses of one
    size are fitted; then sets that differ from the best by one member.
    """
    search.found = {}
    null = search.problem.fit((), begin)
    search.keep(Hypothesis(null, float(np.log(tuned.NUMBER_PRIOR[0]))))
    search.progress("diagnosis: screening")
    starts = [(null, *search.screened(null))]
    is_network = search.problem.predictor.is_network
    if _pulled_far_off(null, is_network):
        # The prior values are nearer the truth.
        known = search.problem.fit(iterations=0)
        starts.append((known, *search.screened(known, null)))
    # The last start is the best one.
    for fit, screened, intervals in reversed(starts):
        search.extend(
            fit,
            screened,
            intervals,
            1,
            tuned.SINGLES_FITTED[len(starts) - 1],
            always=tuned.SINGLES_ALWAYS_FITTED,
        )
    search.fit_all(_far_off(search, null))
    if is_network:
        _what_changes(search, starts[-1][0])
        _second_event(search)
    if not search.is_explained(search.ranked()[0]):
        search.progress("diagnosis: 2 effects")
        for fit, screened, intervals in reversed(starts):
            search.extend(fit, screened, intervals, 2, tuned.PAIRS_FITTED)
            search.extend(fit, screened, intervals, 3, tuned.TRIPLES_FITTED)
    for size in range(1, LARGEST_SET):
        best = search.ranked()[0]
        worst = best.score - search.reach(size)
        ranked = [h for h in search.ranked() if len(h.keys) == size and h.score > worst]
        search.progress(f"diagnosis: {size + 1} effects")
        for hypothesis in to_extend(search, ranked, _beam(search, best, size)):
            screened, intervals = search.screened(hypothesis.fit)
            beside = not is_network and hypothesis is best
            search.extend(hypothesis.fit, screened, intervals, 1, tuned.ADDITIONS, beside=beside)
            search.fit_all(_far_off(search, hypothesis.fit))
    if not is_network:
        _intervals_again(search)
    improve(search)
    # With geometry laws come first: fits take long there, and something that switches fits most of them.
    if not is_network and search.ranked()[0].fit.reduced_misfit > tuned.UNEXPLAINED_MISFIT**2:
        _what_changes(search, null)
    settle_best(search)
    if is_network:
        _levels_beside(search)
        _beside(search)
        _levels_for_laws(search)
        # What was found beside a law may explain all that the law did.
        reduced(search)
    return search.ranked()


def _pulled_far_off(null: Fit, is_network: bool) -> bool:
    """Whether missing physics has pulled a machine's parameters far off what is known of them."""
    departs = null.misfit_with_prior - null.misfit > tuned.PULLED
    return null.reduced_misfit > tuned.DISTORTED**2 or (departs and not is_network)


def _far_off(search: Search, fit: Fit) -> list[Task]:
    """A set with effects that make a channel late, where its fit takes a large one for a small error.

    To first order what it has of the error is as good as the effect, so that a screening does not show it.
    Where that makes channels early, all others are tried as the only one that is late.
    An effect that lowered nothing beside nothing missing is not tried again beside others.
    """
    values, nothing = fit.values, search.found[identity(())].fit.misfit_with_prior

    def lowers(candidate: Candidate) -> bool:
        alone = search.found.get(identity((candidate,)))
        return alone is None or alone.fit.misfit_with_prior < nothing

    delayed = [(i, values.get(i.coordinate, 0.0)) for i in search.problem.predictor.misdescribed if i.delays]
    off = [(item, seconds) for item, seconds in delayed if abs(seconds) > tuned.FAR_OFF * item.sigma]
    early = [seconds for item, seconds in off if seconds < 0.0 and item.delays != EVERY_CHANNEL]
    begun = [(item, seconds, {item.coordinate: 0.0}) for item, seconds in off]
    if early:
        # No sensor shows what is to come: where channels seem early it may be another one that is late.
        on_time = {item.coordinate: 0.0 for item, _ in delayed}
        rest = [(item, seconds) for item, seconds in delayed if (item, seconds) not in off]
        begun += [(item, seconds - float(np.median(early)), on_time) for item, seconds in rest]
    return [
        ((*fit.candidates, candidate), values | on_time | {candidate.amplitude: seconds})
        for item, seconds, on_time in begun
        for candidate in search.delaying(item.delays, seconds)
        if candidate not in fit.candidates and lowers(candidate)
    ]


def _beam(search: Search, best: Hypothesis, size: int) -> int:
    """How many combinations of a size are extended.

    A third effect beside two that fit within the errors is rare. On a machine with geometry its odds say
    whether it is needed (:func:`with_needed_effects`); in a network, a coarse picture, they do not.
    """
    if not search.is_explained(best):
        return tuned.BEAM
    return int(size == 1 or (len(best.keys) == size and not search.problem.predictor.is_network))


def _intervals_again(search: Search) -> None:
    """Seek intervals again beside the laws that were found since: those hid when they begin."""
    best = search.ranked()[0]
    near = [h for h in search.ranked() if len(h.keys) > 1 and h.score > best.score - tuned.EXCHANGED_REACH]
    sets = []
    for hypothesis in _different(search, near, signed=True)[: tuned.SETS_SOUGHT_AGAIN]:
        events = [c for c in hypothesis.fit.candidates if search.in_intervals(c)]
        if len(events) == 1:
            sets.append((hypothesis.fit, events[0]))
    search.fit_all(sought_again(search, sets), anew=True)


def _levels_beside(search: Search) -> None:
    """Levels in the stead of what the best set has in intervals: its other effects hid them at first.

    Sought in what the others leave as they are: fitted without it they take up half of what it does.
    """
    fit = search.ranked()[0].fit
    levels = [c for c in fit.candidates if search.in_intervals(c) and not search.is_hidden_state(c)]
    if len(fit.candidates) > 1 and len(levels) == 1:
        about = search.problem.simulated(*without(fit, levels[0]), iterations=0)
        if about is not None:
            add_steps(search, about)


def _beside(search: Search) -> None:
    """Look for further effects beside the best set, as long as a residual is left and they improve it.

    Strong laws hide what switches beside them, and vice versa: either is searched again
    once the other is known.
    """
    best = search.ranked()[0]
    for _ in range(LARGEST_SET):
        if not 0 < len(best.keys) < LARGEST_SET or _leaves_little(search, best):
            return
        search.progress("diagnosis: beside the best set")
        if any(map(search.in_intervals, best.fit.candidates)):
            add_states(search, best.fit, 1)
            # Levels fit much of what laws do: beside a state they come after those.
            add_steps(search, best.fit)
        if not any(map(search.is_hidden_state, best.fit.candidates)):
            _what_changes(search, laws_with_room(search))
        screened, intervals = search.screened(best.fit)
        search.extend(best.fit, screened, intervals, 1, tuned.ADDITIONS)
        settle_best(search)
        again = search.ranked()[0]
        if again.score <= best.score + tuned.WORTH_ANOTHER:
            # A state that is followed again gains a little every time.
            return
        best = again


def _levels_for_laws(search: Search) -> None:
    """Levels in the stead of the laws beside a state: sought after those, they may find their place taken."""
    best = search.ranked()[0]
    states = tuple(c for c in best.fit.candidates if search.is_hidden_state(c))
    alone = search.found.get(identity(states))
    if not states or len(states) == len(best.fit.candidates) or _leaves_little(search, best) or alone is None:
        return
    add_steps(search, alone.fit)


def _second_event(search: Search) -> None:
    """Look for what switches beside a state, or changes of level, before laws take up what it does.

    Also for a state beside laws: the course of one that was found alone has taken up what a law at its place
    does.
    """
    best = search.ranked()[0]
    events = [c for c in best.fit.candidates if search.in_intervals(c)]
    if not events or _leaves_little(search, best):
        return
    laws = [h.fit for h in _different(search, search.ranked()) if h.keys and _only_laws(search, h)]
    places = {c.component for c in events if search.is_hidden_state(c)}
    there = [fit for fit in laws if places & {c.component for c in fit.candidates}]
    add_states(search, best.fit, 1)
    for fit in there[: tuned.LAWS_BESIDE_A_STATE]:
        add_states(search, fit, 1)


def _leaves_little(search: Search, best: Hypothesis) -> bool:
    """Whether a set leaves no more than errors that were expected, nor than single readings may leave."""
    if not search.is_explained(best):
        return False
    problem, fit = search.problem, best.fit
    predicted = problem.predict(fit.candidates, fit.coordinates, fit.position, by=())
    readings = [i.at(predicted[i.recording].temperature[:, i.channel]) for i in problem.observations]
    left = left_over_noise(problem.predictor, problem.observations, readings, fit.values)
    return left <= tuned.MOST_LEFT


def _what_changes(search: Search, fit: Fit) -> None:
    """Add what changed its level at unknown moments, and what switches, to what a fit holds.

    What fits well, a sensor that came loose or heat in intervals, may fit better with a cooling that changed
    at the same moments.
    """
    best = search.ranked()[0]
    if not best.keys and search.is_explained(best):
        return
    search.progress("diagnosis: changes and states that switch")
    add_steps(search, fit)
    if not search.is_explained(best) or any(search.in_intervals(c) for c in best.fit.candidates):
        add_states(search, fit)


def improve(search: Search) -> None:
    """Take whole sets for their bearings, leave members out and exchange them, as long as that helps."""
    for _ in range(tuned.IMPROVEMENT_ROUNDS):
        best = search.ranked()[0]
        # Wider first: beside a whole set other members may be too many than beside one of its bearings.
        widened(search)
        reduced(search)
        exchanged(search)
        if search.ranked()[0] is best:
            break
    else:
        widened(search)
        reduced(search)


def to_extend(search: Search, ranked: Sequence[Hypothesis], number: int) -> list[Hypothesis]:
    """The best hypothesis of each of the ``number`` best combinations of effects.

    Where all of them hold unrecorded heat, which fits almost anything, also the best that follows laws alone.
    Heat in an interval and a loss in the rest of the time read alike until the other effects are known: where
    one of them is chosen, so is the other.
    """
    different = _different(search, ranked)
    chosen = different[:number]
    alike = {_combination(search, h) for h in chosen if not _only_laws(search, h)}
    signed = _different(search, ranked, signed=True)
    chosen += [h for h in signed if h not in chosen and _combination(search, h) in alike][:1]
    if chosen and not any(_only_laws(search, h) for h in chosen):
        chosen += [h for h in different if _only_laws(search, h)][:1]
    return chosen


def _different(search: Search, ranked: Sequence[Hypothesis], signed: bool = False) -> list[Hypothesis]:
    """The best hypothesis of each combination of effects, as :func:`_combination` has it."""
    found: dict[tuple[str, ...], Hypothesis] = {}
    for item in ranked:
        found.setdefault(_combination(search, item, signed), item)
    return list(found.values())


def _combination(search: Search, hypothesis: Hypothesis, signed: bool = False) -> tuple[str, ...]:
    """Names of a set's effects in order.

    One effect at several places, and what is on in intervals as heat or as
    loss unless ``signed``, are much the same start for a search.
    """
    return tuple(
        sorted(
            "intervals" if not signed and search.in_intervals(c) else c.effect
            for c in hypothesis.fit.candidates
        )
    )


def laws_with_room(search: Search) -> Fit:
    """The best set that follows laws alone and may hold one effect more."""
    ranked = search.ranked()
    return next(h.fit for h in ranked if _only_laws(search, h) and len(h.fit.candidates) < LARGEST_SET)


def _only_laws(search: Search, hypothesis: Hypothesis) -> bool:
    return not any(search.in_intervals(c) for c in hypothesis.fit.candidates)
