"""How probable sets of effects are beside each other."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.p_value import detection_p_value, heldout_p_value
from spindle_fem.inference.set_odds import any_magnitude, counted, log_odds, rank, tempered
from tests.support.made_hypotheses import (
    AS_NORMAL,
    CHURNING,
    OFFSET,
    PRELOAD,
    hypothesis,
)


def test_probabilities_of_sets_add_up_over_their_forms():
    first = hypothesis(replace(PRELOAD, form="one"), misfit=400.0)
    second = hypothesis(replace(PRELOAD, form="two"), misfit=400.0)
    rival = hypothesis(CHURNING, misfit=400.0)
    empty = hypothesis(misfit=400.0, evidence=-300.0)
    ranked = rank([first, rival, second, empty])
    assert ranked[0].probability == pytest.approx(2.0 / 3.0, rel=1e-6)
    assert ranked[0].fit.keys == {("thermal_preload", "front_bearings", None)}
    assert sum(item.probability for item in ranked) == pytest.approx(1.0)
    assert [item.probability for item in ranked] == sorted((i.probability for i in ranked), reverse=True)


def test_odds_of_one_machine_over_another_are_those_of_all_their_sets():
    given = [hypothesis(misfit=420.0, evidence=-1e4), hypothesis(PRELOAD, misfit=400.0)]
    other = [hypothesis(misfit=420.0, evidence=-1e4), hypothesis(PRELOAD, misfit=394.0)]
    assert log_odds(given, given, 0.0) == pytest.approx(0.0)
    assert log_odds(other, given, -2.0) == pytest.approx(3.0 / tuned.GAIN_DIVISOR - 2.0)
    assert log_odds(given, other, 2.0) == pytest.approx(-log_odds(other, given, -2.0))


def test_the_better_form_speaks_for_its_set():
    worse = hypothesis(replace(PRELOAD, form="worse"), misfit=420.0)
    better = hypothesis(replace(PRELOAD, form="better"), misfit=400.0)
    ranked = rank([worse, better, hypothesis(misfit=900.0)])
    assert ranked[0].fit.candidates[0].form == "better"


def test_differences_of_likelihood_count_by_the_temperature():
    better = hypothesis(PRELOAD, misfit=400.0)
    worse = hypothesis(CHURNING, misfit=408.0)
    ranked = rank([worse, better, hypothesis(misfit=420.0, evidence=-1e4)])
    odds = ranked[0].probability / ranked[1].probability
    assert odds == pytest.approx(np.exp(4.0 / tuned.GAIN_DIVISOR))


def test_held_out_readings_count_among_sets_as_fitted_ones_do():
    nothing = replace(hypothesis(misfit=500.0, evidence=-1e4), heldout=900.0)
    better = replace(hypothesis(PRELOAD, misfit=400.0), heldout=708.0)
    told = replace(hypothesis(CHURNING, misfit=408.0), heldout=694.0)
    ranked = rank([nothing, better, told])
    assert ranked[0].fit is told.fit
    odds = ranked[0].probability / ranked[1].probability
    assert odds == pytest.approx(np.exp((7.0 - 4.0) / tuned.GAIN_DIVISOR))
    # on a coarse machine likewise; a set without them has none to compare
    ranked = rank([nothing, better, told], 4.0)
    odds = ranked[0].probability / ranked[1].probability
    assert odds == pytest.approx(np.exp((7.0 - 4.0) / (2.0 * tuned.GAIN_DIVISOR)))
    assert rank([nothing, better, replace(told, heldout=None)])[0].fit is better.fit


def test_a_gain_counts_less_beside_a_large_one_but_never_nothing():
    small, large = counted(1.0) - counted(0.0), counted(20_001.0) - counted(20_000.0)
    assert small == pytest.approx(1.0, rel=2e-3)
    assert large == pytest.approx(1.0 / tuned.LARGEST_INEXACT_DIVISOR, rel=1e-6)
    gains = np.linspace(-5.0, 6000.0, 400)
    values = np.array([counted(gain) for gain in gains])
    assert np.all(np.diff(values) > 0.0)
    assert counted(-5.0) == -5.0


def test_the_choice_of_a_course_costs_a_share_of_what_it_gains():
    state = replace(hypothesis(PRELOAD, misfit=400.0), course_share=0.25)
    plain = hypothesis(CHURNING, misfit=600.0)
    empty = hypothesis(misfit=1200.0)
    assert tempered([state, plain, empty])[0] == pytest.approx(tempered([plain, state, empty])[0])
    probability = {
        next(iter(i.fit.keys))[0]: i.probability for i in rank([state, plain, empty]) if i.fit.keys
    }
    assert probability["thermal_preload"] == pytest.approx(probability["grease_churning"])


@pytest.mark.parametrize(
    ("share", "coarseness", "kept"), [(0.25, 1.0, 0.75), (0.25, 3.0, 0.5), (0.44, 3.0, 0.12), (0.6, 3.0, 0.0)]
)
def test_a_course_pays_twice_on_a_coarse_machine_whose_nodes_it_follows(share, coarseness, kept):
    empty = replace(hypothesis(misfit=1200.0), heldout=700.0)
    state = replace(hypothesis(PRELOAD, misfit=756.0), course_share=share, heldout=600.0)
    plain = replace(state, course_share=0.0, deviance=1200.0 - 444.0 * kept, heldout=700.0 - 100.0 * kept)
    paid, same = (tempered([item, empty], coarseness)[0] for item in (state, plain))
    assert paid == pytest.approx(same)
    by_chance = [detection_p_value([item, empty], 64, coarseness) for item in (state, plain)]
    assert by_chance[0] == pytest.approx(by_chance[1])
    by_heldout = [heldout_p_value(item, empty, coarseness) for item in (state, plain)]
    assert by_heldout[0] == pytest.approx(by_heldout[1])


def test_complexity_and_prior_count_in_full():
    plain = hypothesis(PRELOAD, misfit=400.0, evidence=-200.0 - 1.0)
    complex_ = hypothesis(CHURNING, misfit=400.0, evidence=-200.0 - 4.0, log_prior=-1.0)
    ranked = rank([plain, complex_, hypothesis(misfit=400.0, evidence=-1e4)])
    assert ranked[0].probability / ranked[1].probability == pytest.approx(np.exp(4.0))


def test_amplitudes_of_any_magnitude_are_as_likely():
    def known(found, sigma=1e-6):
        return replace(found, fit=replace(found.fit, covariance=sigma**2 * np.eye(2)))

    def weight(size, sigma=1e-6):
        return any_magnitude(known(hypothesis(PRELOAD, misfit=400.0, position=(0.0, size)), sigma).fit)

    assert weight(AS_NORMAL) == pytest.approx(0.0, abs=1e-12)
    assert weight(0.1 * AS_NORMAL) == weight(-0.1 * AS_NORMAL) == pytest.approx(np.log(10.0))
    # Beyond its usual size the normal prior has it.
    assert weight(3.0) == weight(30.0) == pytest.approx(np.log(AS_NORMAL))
    # Nothing, to within so much, is not likelier than so much is.
    assert weight(1e-3, sigma=0.1) == weight(0.0, sigma=0.1) == pytest.approx(weight(tuned.SEEN_FROM * 0.1))
    # Known to a fifth and a fiftieth of priors that differ by ten, both to a tenth of themselves: the same.
    wide = known(hypothesis(CHURNING, misfit=400.0, evidence=-200.0 - np.log(10.0), position=(0.0, 0.05)))
    narrow = known(hypothesis(PRELOAD, misfit=400.0, evidence=-200.0, position=(0.0, 0.5)))
    ranked = rank([wide, narrow, hypothesis(misfit=900.0)])
    assert ranked[0].probability == pytest.approx(ranked[1].probability)


def test_what_a_strong_effect_leaves_counts_less_for_one_more():
    """An effect more gains less beside a strong one; which of two of one size it is does not."""

    def odds(first, one, other):
        ranked = rank([hypothesis(misfit=first), one, other])
        share = {item.fit.keys: item.probability for item in ranked}
        return share[one.keys] / share[other.keys]

    single = hypothesis(PRELOAD, misfit=420.0)
    pair, rival = hypothesis(PRELOAD, CHURNING, misfit=400.0), hypothesis(CHURNING, misfit=400.0)
    weak, strong = (counted(x + 10.0) - counted(x) for x in (90.0, 24790.0))
    assert strong == pytest.approx(10.0 / tuned.LARGEST_INEXACT_DIVISOR)
    assert weak > 1.5 * strong
    ratio = odds(600.0, pair, single) / odds(50000.0, pair, single)
    assert ratio == pytest.approx(np.exp((weak - strong) / tuned.GAIN_DIVISOR))
    assert odds(50000.0, rival, single) == pytest.approx(np.exp(10.0 / tuned.GAIN_DIVISOR))


def test_the_most_probable_set_of_a_size_stands_for_it():
    """A set that gains more but pays for it does not make the others of its size less likely."""
    empty, single = hypothesis(misfit=20000.0), hypothesis(PRELOAD, misfit=500.0)
    pair = hypothesis(PRELOAD, CHURNING, misfit=400.0)
    # Its determinants cost what 100 more of misfit cannot pay.
    greedy = hypothesis(PRELOAD, OFFSET, misfit=300.0, evidence=-150.0 - 200.0)
    alone = {r.fit.keys: r.probability for r in rank([empty, single, pair])}
    beside = {r.fit.keys: r.probability for r in rank([empty, single, pair, greedy])}
    assert beside[pair.keys] == pytest.approx(alone[pair.keys], rel=1e-6)
