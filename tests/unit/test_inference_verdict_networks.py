"""What hypotheses about a written network amount to, which is a coarse picture of its machine."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import TermParameter
from spindle_fem.effects.framework.unrecorded import STATES, InIntervals, UnrecordedHeatTerm
from spindle_fem.inference import tuned
from spindle_fem.inference.set_odds import rank
from tests.support.made_hypotheses import CHURNING, OFFSET, PRELOAD, candidate, hypothesis, verdict


def test_events_of_a_network_are_named_where_laws_without_them_leave_too_much():
    heat, size = "unrecorded_heat_source", TermParameter("heat", 1.0, 1.2)
    term = UnrecordedHeatTerm(heat, size, Spread(()), InIntervals([(0.0, 100.0)]))
    event = replace(candidate(heat, "oil"), terms=(term,), amplitude=f"{heat}.heat")
    null, law = hypothesis(misfit=2000.0), hypothesis(PRELOAD, misfit=900.0)
    alone, both = hypothesis(event, misfit=500.0), hypothesis(PRELOAD, event, misfit=400.0)
    little, much = 0.9 * tuned.MOST_LEFT, 1.1 * tuned.MOST_LEFT

    enough = 0.9 - tuned.LEAST_OF_EVENTS

    def found(of_nothing, of_law, *sets, coarseness=2.0, later=enough, of_event=1.5):
        rest = {id(null.fit): of_nothing, id(law.fit): of_law}
        left = {
            "left": lambda fit: rest.get(id(fit), of_event),
            "beyond": lambda fit: later if event in fit.candidates else 1.0,
        }
        return verdict(*sets, coarseness=coarseness, **left).chosen.fit.keys

    assert found(much, much, null, alone) == alone.keys
    # A state, which follows held-out readings, hardly tells them better where much is left without it.
    state = replace(
        event, terms=(UnrecordedHeatTerm(heat, size, Spread(()), InIntervals([(0.0, 9.0)], STATES)),)
    )
    hidden = hypothesis(state, misfit=500.0)
    for hardly, expected in ((1.1, null), (0.9, hidden)):
        left = {"left": lambda fit: much if fit is null.fit else 1.0}
        later = hardly - tuned.LEAST_OF_EVENTS
        said = verdict(
            null,
            hidden,
            coarseness=2.0,
            beyond=lambda fit, later=later: later if fit.candidates else 1.0,
            **left,
        )
        assert said.chosen.fit.keys == expected.keys
    assert found(much, much, null, alone, later=1.1 - tuned.LEAST_OF_EVENTS) == alone.keys
    assert found(little, much, null, alone) == null.keys
    # It tells held-out readings far better.
    assert found(little, much, null, alone, later=0.9 - tuned.IMPROVEMENT_OF_EVENTS) == alone.keys
    assert found(little, much, null, alone, later=1.1 - tuned.IMPROVEMENT_OF_EVENTS) == null.keys
    # It tells a few of them hardly better, but leaves far less of all.
    hardly = 0.9 * (1.0 - tuned.LEAST_IMPROVEMENT)
    assert found(little, much, null, alone, later=hardly, of_event=1.0) == alone.keys
    assert found(little, much, null, alone, later=1.0, of_event=1.0) == null.keys
    assert found(much, little, null, law, both) == law.keys
    assert found(much, much, null, law, both) == both.keys
    # A law elsewhere that leaves little does as well.
    assert found(much, little, null, law, alone) == law.keys
    assert found(much, much, null, law, alone) == alone.keys
    assert found(much, little, null, law, alone, later=0.9 - tuned.IMPROVEMENT_OF_EVENTS) == alone.keys
    assert found(little, much, null, alone, coarseness=1.0) == alone.keys
    assert found(little, much, replace(null, expected_misfit=3.0), alone) == alone.keys


def test_a_second_event_is_named_where_one_leaves_too_much():
    def event(place):
        term = UnrecordedHeatTerm(
            place, TermParameter("heat", 1.0, 1.2), Spread(()), InIntervals([(0.0, 9.0)])
        )
        return replace(candidate("unrecorded_heat_source", place), terms=(term,))

    oil, block = event("oil"), event("block")
    null, one = hypothesis(misfit=9000.0), hypothesis(oil, misfit=900.0)
    both = hypothesis(oil, block, misfit=400.0)
    for left_by_one, expected in ((0.9, one), (1.1, both)):
        rest = {id(null.fit): 9.0, id(one.fit): left_by_one * tuned.MOST_LEFT}
        found = verdict(
            null,
            one,
            both,
            coarseness=2.0,
            left=lambda fit, rest=rest: rest.get(id(fit), 1.0),
            beyond=lambda fit: {0: 9.0, 1: 1.25}.get(len(fit.keys), 1.0),
        )
        assert found.chosen.fit.keys == expected.keys


def test_a_part_that_leaves_too_much_gives_way_to_the_whole_that_leaves_little():
    null, part = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=400.0)
    whole = hypothesis(PRELOAD, OFFSET, misfit=399.0)
    other = hypothesis(candidate("windage", "shaft"), OFFSET, misfit=399.0)

    def found(of_part, later, *sets, coarseness=2.0):
        rest = {id(null.fit): 9.0, id(part.fit): of_part * tuned.MOST_LEFT}
        left = {
            "left": lambda fit: rest.get(id(fit), 1.0),
            "beyond": lambda fit: later if len(fit.keys) == 2 else 2.0,
        }
        return verdict(*sets, coarseness=coarseness, **left).chosen.fit.keys

    assert found(1.1, 1.0, null, part, whole) == whole.keys
    # It leaves little enough itself, the whole tells later readings no better, or does not hold it.
    assert found(0.9, 1.0, null, part, whole) == part.keys
    assert found(1.1, 2.5, null, part, whole) == part.keys
    assert found(1.1, 1.0, null, part, other) == part.keys


def test_a_set_gives_way_to_one_of_no_more_effects_that_leaves_less_of_all_readings():
    """Likelihoods of a coarse picture, which take what is left for error, may say the contrary."""
    null, likely = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=400.0)
    exact, more = hypothesis(OFFSET, misfit=480.0), hypothesis(PRELOAD, OFFSET, misfit=479.0)

    def found(fitted, heldout, other, coarseness=2.0, most=1.1):
        def share(of_other):
            return lambda fit: 9.0 if not fit.candidates else most * (of_other if fit is other.fit else 1.0)

        left = {"left": share(fitted), "beyond": share(heldout)}
        return verdict(null, likely, other, coarseness=coarseness, **left).chosen.fit.keys

    less, alike = 0.99 - tuned.LEAST_IMPROVEMENT, 1.01 - tuned.LEAST_IMPROVEMENT
    assert found(less, less, exact) == exact.keys
    assert found(less, alike, exact) == likely.keys
    assert found(alike, less, exact) == likely.keys
    assert found(less, less, more) == likely.keys
    assert found(less, less, exact, coarseness=1.0) == likely.keys
    # Less than the noise is no better than the noise.
    assert found(less, less, exact, most=0.9) == likely.keys


def test_one_effect_more_must_lower_what_a_network_leaves_of_fitted_and_of_held_out_readings():
    """What its nodes miss is explained a little by any effect beside the right one."""
    null, one = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=900.0)
    two = hypothesis(PRELOAD, CHURNING, misfit=400.0)

    def found(fitted, heldout, coarseness=2.0, of_one=1.5):
        def share(of_two):
            return lambda fit: {0: 9.0, 1: of_one, 2: of_two * of_one}[len(fit.keys)]

        left = {"left": share(fitted), "beyond": share(heldout)}
        return verdict(null, one, two, coarseness=coarseness, **left).chosen.fit.keys

    little, much = 1.01 - tuned.LEAST_OF_A_MEMBER, 0.99 - tuned.LEAST_OF_A_MEMBER
    assert found(much, much) == two.keys
    assert found(little, much) == found(much, little) == one.keys
    # Likelihoods of a drawn machine hold, and what leaves too much alone is no answer.
    assert found(little, little, coarseness=1.0) == two.keys
    assert found(little, little, of_one=2.2) == two.keys


def test_what_the_sets_given_up_gain_makes_the_named_one_less_reliable():
    null, one = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=900.0)
    two = hypothesis(PRELOAD, CHURNING, misfit=400.0)
    left = dict.fromkeys(("left", "beyond"), lambda fit: 1.2 if fit.candidates else 9.0)
    alone, beside = (verdict(*sets, coarseness=2.0, **left) for sets in ((null, one), (null, one, two)))
    assert alone.chosen.fit.keys == beside.chosen.fit.keys == one.keys
    assert (alone.gain_of_more, beside.gain_of_more) == (0.0, 250.0)
    assert beside.chosen.probability < alone.chosen.probability


def test_what_is_likely_but_leaves_more_is_listed_with_a_share_of_what_is_left():
    null, likely = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=400.0)
    exact = hypothesis(OFFSET, misfit=480.0)
    rest = {id(null.fit): 9.0, id(likely.fit): 1.2}
    left = dict.fromkeys(("left", "beyond"), lambda fit: rest.get(id(fit), 1.0))
    found = verdict(null, likely, exact, coarseness=2.0, **left)
    assert found.chosen.fit.keys == exact.keys
    (other,) = found.alternatives
    assert other.fit.keys == likely.keys
    assert tuned.LISTED < other.probability < 1.0 - found.chosen.probability
    assert found.chosen.probability + other.probability + found.other == pytest.approx(1.0)


def test_what_one_set_gains_over_another_of_its_size_counts_less_where_the_model_is_coarse():
    sets = [hypothesis(misfit=2000.0), hypothesis(PRELOAD, misfit=400.0), hypothesis(OFFSET, misfit=418.0)]
    odds = []
    for coarseness in (1.0, 4.0):
        likely = {item.fit.keys: item.probability for item in rank(sets, coarseness) if item.fit.keys}
        odds.append(np.log(likely[sets[1].keys] / likely[sets[2].keys]))
    assert odds[0] == pytest.approx(2.0 * odds[1])
    assert odds[0] == pytest.approx(9.0 / tuned.GAIN_DIVISOR)


def test_nothing_missing_of_a_coarse_machine_stays_where_it_is_likelier_than_all_sets():
    """A machine that a definition describes coarsely leaves more than chance does, whatever the p-value."""
    dear = candidate("grease_churning")
    for evidence, coarse, exact in (
        (-230.0, "consistent", "missing_physics"),
        (-200.0, "missing_physics", "missing_physics"),
    ):
        found = hypothesis(misfit=480.0, log_prior=-0.5), hypothesis(dear, misfit=400.0, evidence=evidence)
        for coarseness, expected in ((1.1, coarse), (1.0, exact)):
            said = verdict(*found, coarseness=coarseness)
            assert (said.verdict, coarseness) == (expected, coarseness)
            assert said.p_value < tuned.RULED_OUT
    # What leaves more than may be left is no answer, where a set leaves half of it.
    null, dear = hypothesis(misfit=480.0, log_prior=-0.5), hypothesis(dear, misfit=400.0, evidence=-230.0)
    for most, expected in ((0.99, null), (1.01, dear)):
        rest = {id(null.fit): most * tuned.MOST_LEFT}
        left = dict.fromkeys(("left", "beyond"), lambda fit, rest=rest: rest.get(id(fit), 1.0))
        said = verdict(*(replace(h, heldout=500.0) for h in (null, dear)), coarseness=1.1, **left)
        assert said.chosen.fit.keys == expected.keys
