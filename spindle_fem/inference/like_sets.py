"""Which sets name the same effects, which may stand for another, and how needed a further effect is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.interval_effect import IntervalEffect, in_intervals
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Fit

# Share of its usual size below which an effect is nothing.
NOTHING = 1.0e-2


def may_stand_for(fit: Fit, other: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether a set is an alternative explanation with as many effects as another.

    Effects on in intervals fit much: they can only replace such effects.
    """
    return (
        len(fit.named) == len(other.named)
        and not are_alike(fit, other, overlapping)
        and free_in_time(fit) <= free_in_time(other)
    )


def free_in_time(fit: Fit) -> int:
    """Number of effects of a set that are on in intervals."""
    return sum(in_intervals(effect_of(c.effect), c) for c in fit.candidates)


def only_size_free(candidate: Candidate) -> bool:
    """Whether nothing of a candidate is free but its size: of what is on in intervals, a hidden state."""
    return candidate.free.keys() == {candidate.amplitude}


def states_alone(fit: Fit) -> bool:
    """Whether all that is on in intervals is a hidden state."""
    return all(only_size_free(c) for c in fit.candidates if in_intervals(effect_of(c.effect), c))


def leaves_unnamed(fit: Fit, chosen: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether a set says of one effect of another, which names its law, only that heat is missing there.

    What no law is known for is the answer where no law of the catalogue reads the same: beside one that
    does, it is the same heat or loss at the same place without its name.
    """
    others = [c for c in fit.named if c.key not in chosen.named_keys]
    named = [c for c in chosen.named if c.key not in fit.named_keys]
    if not len(others) == len(named) == 1:
        return False
    (other,), (law,) = others, named
    return (
        isinstance(effect_of(other.effect), IntervalEffect)
        and not isinstance(effect_of(law.effect), IntervalEffect)
        and other.kind == law.kind
        and other.component in {law.component, *overlapping.get(law.component, ())}
    )


def are_alike(fit: Fit, chosen: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether two sets name the same effects at the same or overlapping places."""
    return len(fit.named) == len(chosen.named) and holds(fit, chosen, overlapping)


def holds(fit: Fit, chosen: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether a set names every effect of another at the same or an overlapping place."""
    left = list(chosen.named)
    for candidate in fit.named:
        match = next(
            (
                own
                for own in left
                if own.effect == candidate.effect
                and candidate.component in {own.component, *overlapping.get(own.component, ())}
                and own.meets(candidate)
            ),
            None,
        )
        left = [own for own in left if own is not match]
    return not left


def odds_needed(fit: Fit, fewer: Fit, overlapping: Mapping[str, frozenset[str]]) -> float:
    """Odds over a set without it that a further effect needs.

    Laws are not exact, and what one leaves another fits, most of all one of the same place: of the same
    bearings, or of the same face.
    """
    further = next(c for c in fit.named if c.key not in fewer.named_keys)
    places = {further.component, *overlapping.get(further.component, ())}
    laws = [c for c in fewer.named if "sensor" not in (c.kind, further.kind)]
    beside_itself = any(law.component in places and law.meets(further) for law in laws)
    return tuned.FURTHER_AT_ITS_PLACE if beside_itself else tuned.FURTHER_EFFECT


def with_needed_effects(ranked: Sequence[Ranked], overlapping: Mapping[str, frozenset[str]]) -> list[Ranked]:
    """Sets, each with an effect more than another less probable beside it, by :func:`odds_needed`.

    A set and all that add one effect to it keep their probability together. A set that adds to several is
    weighed beside the most probable of them.
    """
    fits = {item.fit.named_keys: item.fit for item in ranked}
    shares = {item.fit.named_keys: item.probability for item in ranked}
    for size in range(2, 1 + max(len(keys) for keys in shares)):
        beside: dict[frozenset, list[frozenset]] = {}
        for keys in [keys for keys in shares if len(keys) == size]:
            smaller = [other for other in shares if other < keys and len(other) == size - 1 > 0]
            if smaller:
                beside.setdefault(max(smaller, key=shares.__getitem__), []).append(keys)
        for base, richer in beside.items():
            group = {base: shares[base]} | {
                keys: shares[keys] / odds_needed(fits[keys], fits[base], overlapping) for keys in richer
            }
            whole = sum(shares[keys] for keys in group)
            scale = whole / max(sum(group.values()), np.finfo(float).tiny)
            shares |= {keys: weight * scale for keys, weight in group.items()}
    found = [replace(item, probability=shares[item.fit.named_keys]) for item in ranked]
    return sorted(found, key=lambda item: -item.probability)


def likeliest_first(ranked: Sequence[Ranked], overlapping: Mapping[str, frozenset[str]]) -> list[Ranked]:
    """Sets, the first of those in front that together, as :func:`as_one` has it, are the most probable."""
    first, others = as_one(ranked, overlapping)
    best = max([first, *others], key=lambda item: item.probability)
    # The first of a group stands for it, with its own fit.
    front = next(item for item in ranked if item.fit is best.fit)
    return [front, *(item for item in ranked if item is not front)]


def without_repeats(
    ranked: Sequence[Ranked],
    apart: Callable[[Fit, Fit], float],
    overlapping: Mapping[str, frozenset[str]],
    coarseness: float,
) -> list[Ranked]:
    """Sets without those that say the same as another, which gets their probability.

    A gap that closes with temperature is, at some of its values, a contact that conducts less. Where both
    read the same within a fifth of the noise, or the gap makes the readings no likelier, or it is never open,
    they say the same, one of them with fewer values. Likewise heat without a name where a law of its place
    reads the same within half the noise, and the readings say little between them.
    """
    left = {id(item): item.probability for item in ranked}

    def says_the_same(item: Ranked, other: Ranked) -> bool:
        told = told_by_readings(item.best, other.best, coarseness)
        if _repeats(item.fit, other.fit):
            is_plainer = told <= 0.0 or _is_null(item.fit, other.fit)
            return is_plainer or apart(item.fit, other.fit) < tuned.SAME_READINGS
        return (
            leaves_unnamed(item.fit, other.fit, overlapping)
            and told < tuned.LEAST_HELDOUT_GAIN
            and apart(item.fit, other.fit) < tuned.NEAR_READINGS
        )

    for item in ranked:
        plainer = [other for other in ranked if id(other) in left and says_the_same(item, other)]
        if plainer:
            left[id(plainer[0])] += left.pop(id(item))
    found = [replace(item, probability=left[id(item)]) for item in ranked if id(item) in left]
    return sorted(found, key=lambda item: -item.probability)


def told_by_readings(chosen: Hypothesis, other: Hypothesis, coarseness: float) -> float:
    """Logarithm of the odds of a set over another of its size by all readings, whatever was likely before.

    Held-out readings, where both have them, count as fitted ones do, which are three times as many; both less
    where the model is coarse, as :func:`spindle_fem.inference.set_odds.tempered` has it.
    """
    gain = other.misfit - chosen.misfit
    if chosen.heldout is not None and other.heldout is not None:
        gain += other.heldout - chosen.heldout
    return 0.5 * gain / (tuned.GAIN_DIVISOR * float(np.sqrt(coarseness)))


def _repeats(fit: Fit, other: Fit) -> bool:
    """Whether a set is another but for one effect, whose law can be that of the other at its place."""
    own, theirs = fit.named_keys - other.named_keys, other.named_keys - fit.named_keys
    repeated = {(effect_of(effect).repeats, place) for effect, place, _ in own}
    return len(own) == len(theirs) == 1 and {(effect, place) for effect, place, _ in theirs} == repeated


def _is_null(fit: Fit, other: Fit) -> bool:
    """Whether the only effect that another set lacks has a size of nothing, whatever else its law changes."""
    (law,) = (c for c in fit.named if c.key not in other.named_keys)
    size = abs(fit.values[law.amplitude] - law.null) if law.amplitude in fit.values else np.inf
    return size < NOTHING * abs(law.reference - law.null)


def as_one(
    ranked: Sequence[Ranked], overlapping: Mapping[str, frozenset[str]]
) -> tuple[Ranked, list[Ranked]]:
    """The first set, and the others, each with the probability of all that name its effects where it does."""
    found: list[Ranked] = []
    for item in ranked:
        like = next((i for i, one in enumerate(found) if are_alike(item.fit, one.fit, overlapping)), None)
        if like is None:
            found.append(item)
        else:
            found[like] = replace(found[like], probability=found[like].probability + item.probability)
    return found[0], sorted(found[1:], key=lambda item: -item.probability)
