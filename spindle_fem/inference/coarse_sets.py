"""Which sets of a machine that is described coarsely count, by what they leave of the readings.

A network of a few nodes leaves more than noise, which likelihoods take for error and effects that may come
and go for their own. What a set leaves, of readings that were fitted and of those held out, tells more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from spindle_fem.inference import tuned
from spindle_fem.inference.heldout import left_of_all
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.like_sets import free_in_time, states_alone


def with_needed_events(
    hypotheses: Sequence[Hypothesis], left: Callable[[Fit], float], beyond: Callable[[Fit], float]
) -> list[Hypothesis]:
    """Sets without those with events that a part of them, or as many effects with fewer events, replaces.

    What may come and go at any time fits some of whatever a coarse picture leaves, and follows held-out
    readings itself: that they become a little likelier with it says nothing. Where what does without leaves
    no more than may be left, neither in units of the noise nor of the errors that were expected before these
    readings, it must leave clearly less of them; a hidden state less in any case.
    """
    events = {id(item): free_in_time(item.fit) for item in hypotheses}

    def needed_beside(item: Hypothesis, other: Hypothesis) -> bool:
        leaves_much = (
            np.sqrt(other.expected_misfit) > tuned.UNEXPLAINED_MISFIT
            or max(left(other.fit), beyond(other.fit)) > tuned.MOST_LEFT
        )
        told = beyond(other.fit) > 0.0 and item.keys > other.keys and states_alone(item.fit)
        if leaves_much and not told:
            return True
        share = tuned.LEAST_OF_EVENTS if leaves_much else tuned.IMPROVEMENT_OF_EVENTS
        if not 0.0 < beyond(item.fit) < (1.0 - tuned.LEAST_IMPROVEMENT) * beyond(other.fit):
            return False
        # A first step may show in few of the held-out readings.
        rest, before = (left_of_all(left(i.fit), beyond(i.fit)) for i in (item, other))
        of_all = rest < (1.0 - tuned.IMPROVEMENT_OF_ALL) * before
        first = of_all and not events[id(other)] and not states_alone(item.fit)
        return first or beyond(item.fit) < (1.0 - share) * beyond(other.fit)

    return [
        item
        for item in hypotheses
        if all(
            needed_beside(item, other)
            for other in hypotheses
            if events[id(other)] < events[id(item)]
            and (other.keys < item.keys or (other.keys and len(other.fit.named) <= len(item.fit.named)))
        )
    ]


def that_leave_least(
    hypotheses: Sequence[Hypothesis], left: Callable[[Fit], float], beyond: Callable[[Fit], float]
) -> list[Hypothesis]:
    """Sets without those that leave too much where one that holds them and more leaves little.

    What is too much for a part to be named counts for the whole, although the likelihood, which takes what
    a set leaves for error, may weigh both alike. For the same reason without those that leave more than the
    noise beside one of no more effects that leaves less, of fitted and of held-out readings. And without
    those of which one effect lowers little what the others leave, where that may be left: any effect beside
    the right one explains a little of what the nodes of a network miss.
    """
    most = {id(item): max(left(item.fit), beyond(item.fit)) for item in hypotheses}
    whole = [item for item in hypotheses if item.keys and most[id(item)] <= tuned.MOST_LEFT]

    def is_part(item: Hypothesis) -> bool:
        return most[id(item)] > tuned.MOST_LEFT and any(
            item.keys < other.keys and beyond(other.fit) < beyond(item.fit) for other in whole
        )

    def leaves_more(item: Hypothesis) -> bool:
        return most[id(item)] > 1.0 and any(
            left(other.fit) < (1.0 - tuned.LEAST_IMPROVEMENT) * left(item.fit)
            and beyond(other.fit) < (1.0 - tuned.LEAST_IMPROVEMENT) * beyond(item.fit)
            for other in hypotheses
            if other.keys and len(other.fit.named) <= len(item.fit.named)
        )

    def adds_little(item: Hypothesis) -> bool:
        parts = [o for o in hypotheses if o.keys < item.keys and len(o.keys) == len(item.keys) - 1 > 0]
        if not parts:
            return False
        likeliest = min(parts, key=lambda part: part.misfit)
        least = 1.0 - tuned.LEAST_OF_A_MEMBER
        return most[id(likeliest)] <= tuned.MOST_LEFT and (
            left(item.fit) > least * left(likeliest.fit) or beyond(item.fit) > least * beyond(likeliest.fit)
        )

    return [
        item
        for item in hypotheses
        if not item.keys or not (is_part(item) or leaves_more(item) or adds_little(item))
    ]
