"""Whether sets name the same effects, and which may stand for another."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.framework.effect import in_intervals
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference.hypothesis_fit import Fit


def may_stand_for(fit: Fit, other: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether a set is an alternative explanation with as many effects as another.

    Effects on in intervals fit much: they can only replace such effects.
    """
    return (
        len(fit.candidates) == len(other.candidates)
        and not are_alike(fit, other, overlapping)
        and free_in_time(fit) <= free_in_time(other)
    )


def free_in_time(fit: Fit) -> int:
    """Number of effects of a set that are on in intervals."""
    return sum(in_intervals(effect_of(c.effect), c) for c in fit.candidates)


def are_alike(fit: Fit, chosen: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether two sets name the same effects at the same or overlapping places."""
    return len(fit.candidates) == len(chosen.candidates) and holds(fit, chosen, overlapping)


def holds(fit: Fit, chosen: Fit, overlapping: Mapping[str, frozenset[str]]) -> bool:
    """Whether a set names every effect of another at the same or an overlapping place."""
    left = [(c.effect, c.component) for c in chosen.candidates]
    for candidate in fit.candidates:
        match = next(
            (
                key
                for key in left
                if key[0] == candidate.effect
                and (
                    key[1] == candidate.component
                    or candidate.component in overlapping.get(key[1], frozenset())
                )
            ),
            None,
        )
        if match is not None:
            left.remove(match)
    return not left
