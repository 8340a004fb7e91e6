"""Level by which chance makes a set as likely as it is, on hypotheses made up for the purpose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from spindle_fem.effects.framework.term import TermParameter
from spindle_fem.inference import tuned
from spindle_fem.inference.p_value import detection_p_value
from tests.support.made_hypotheses import CHURNING, PRELOAD, candidate, hypothesis, verdict


def test_the_p_value_corrects_for_the_number_of_trials():
    null, better = hypothesis(misfit=430.0), hypothesis(PRELOAD, misfit=400.0)
    alone = chi2.sf(30.0, 1) ** (1.0 / tuned.CHANCE_DIVISOR)
    assert detection_p_value([null, better], 0) == pytest.approx(alone)
    few = detection_p_value([null, better], 2 * tuned.CANDIDATES_A_TRIAL)
    assert few == pytest.approx(1.0 - (1.0 - alone) ** 3, rel=1e-9)


def test_the_p_value_is_that_of_the_most_significant_set_not_of_the_largest_gain():
    null, better = hypothesis(misfit=430.0), hypothesis(PRELOAD, misfit=400.0)
    pair = hypothesis(PRELOAD, CHURNING, misfit=399.0)
    assert chi2.sf(31.0, 2) > chi2.sf(30.0, 1)
    assert detection_p_value([null, better, pair], 50) == detection_p_value([null, better], 50)
    assert detection_p_value([null, pair], 50) > detection_p_value([null, better], 50)


def test_a_period_pays_for_those_that_chance_had_to_choose_from():
    null = hypothesis(misfit=430.0)
    period = TermParameter("period", 600.0, 0.9, "s", logarithmic=True)
    swing = replace(candidate("chiller_cycling"), factors=(period,))
    item = hypothesis(swing, misfit=390.0)
    known = replace(item.fit.coordinates[-1], name="period")

    def level(sigma, coordinate):
        spread = np.diag([1.0, 1.0, sigma**2])
        fit = replace(
            item.fit,
            coordinates=(*item.fit.coordinates, coordinate),
            position=np.zeros(3),
            covariance=spread,
        )
        return detection_p_value([null, replace(item, fit=fit)], 0)

    power = 1.0 / tuned.CHANCE_DIVISOR
    # Size and period: one freedom, as often as the period is closer than before.
    assert level(0.01, known) == pytest.approx((100.0 * chi2.sf(40.0, 1)) ** power, rel=1e-6)
    assert level(2.0, known) == pytest.approx(chi2.sf(40.0, 1) ** power, rel=1e-6)
    other = replace(known, name="exponent")
    assert level(0.01, other) == pytest.approx(chi2.sf(40.0, 2) ** power, rel=1e-6)


def test_what_nothing_could_do_by_chance_has_no_probability_left():
    assert detection_p_value([hypothesis(misfit=9e3), hypothesis(PRELOAD, misfit=400.0)], 50) == 0.0


def test_nothing_better_than_nothing_has_the_largest_p_value():
    assert detection_p_value([hypothesis(misfit=400.0), hypothesis(PRELOAD, misfit=400.0)], 50) == 1.0


def test_p_values_of_pure_chance_are_seldom_small():
    """Gains of a chi-square of one degree of freedom each: at most a few per cent below one per cent."""
    generator = np.random.default_rng(0)
    low = 0
    for _ in range(400):
        gains = generator.chisquare(1, 40)
        found = [hypothesis(misfit=400.0)]
        found += [hypothesis(PRELOAD, misfit=400.0 - gain) for gain in gains]
        low += detection_p_value(found, 40) < 0.01
    assert low <= 10


def test_what_held_out_readings_alone_make_likely_is_not_consistent():
    """A small effect of a long recording may tell little of fitted readings and much of all."""
    nothing, preload = replace(hypothesis(misfit=2000.0), heldout=700.0), hypothesis(PRELOAD, misfit=1990.0)
    worse = replace(hypothesis(CHURNING, misfit=1996.0), heldout=600.0)
    assert verdict(nothing, preload).p_value > tuned.SIGNIFICANT
    gain = 2.0 * tuned.GAIN_DIVISOR * np.log(1.0 / tuned.RULED_OUT)
    told = verdict(nothing, replace(preload, heldout=700.0 - 1.1 * gain))
    assert told.verdict == "missing_physics"
    assert told.p_value == pytest.approx(tuned.RULED_OUT**1.1)
    # the set is that of fitted readings: the best of many by held-out ones would be chance
    same = replace(preload, heldout=700.0)
    assert verdict(nothing, same, worse).p_value > tuned.SIGNIFICANT
    # on a coarse machine they count so many times less
    told = verdict(nothing, replace(preload, heldout=700.0 - 1.1 * gain), coarseness=2.0)
    assert told.p_value == pytest.approx(tuned.RULED_OUT**0.55)
