"""Sets that are one for a decision, and effects that have to be needed beside others."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import like_sets, tuned
from spindle_fem.inference.hypothesis import Ranked
from spindle_fem.inference.like_sets import with_needed_thirds
from spindle_fem.inference.verdict import NEAR_REASON, rank
from tests.support.made_hypotheses import CHURNING, OFFSET, PRELOAD, candidate, hypothesis, verdict


def test_a_third_beside_two_that_fit_within_the_errors_is_less_probable_where_held_out_readings_doubt_it():
    pair = replace(hypothesis(PRELOAD, CHURNING, misfit=400.0), heldout=500.0)
    worse = replace(hypothesis(PRELOAD, OFFSET, misfit=420.0), heldout=700.0)

    def odds(gain, two=pair):
        """Of a third that was twice as probable, where held-out readings gain so much, as it counts."""
        heldout = 500.0 - 2.0 * tuned.GAIN_DIVISOR * gain
        triple = replace(hypothesis(PRELOAD, CHURNING, OFFSET, misfit=300.0), heldout=heldout)
        ranked = with_needed_thirds([Ranked(triple, 0.6), Ranked(two, 0.3), Ranked(worse, 0.1)])
        said = {id(item.best): item.probability for item in ranked}
        assert list(said.values()) == sorted(said.values(), reverse=True)
        assert said[id(triple)] + said[id(two)] == pytest.approx(0.9)
        return said[id(triple)] / said[id(two)]

    enough = tuned.LEAST_HELDOUT_GAIN
    for gain in (enough - 4.0, enough - 1.0, enough, enough + 2.0):
        assert odds(gain) == pytest.approx(2.0 * np.exp(min(0.0, gain - enough)))
    # Two that leave more than errors need a third.
    more = replace(pair, fit=replace(pair.fit, misfit=1.1 * tuned.EXPLAINED**2 * len(pair.fit.residual)))
    assert odds(0.0, more) == pytest.approx(2.0)


def test_rivals_at_places_that_count_as_one_are_one_rival():
    places = ("front_bearings", "F1", "F2")
    group = dict.fromkeys(places, frozenset(places))
    found = [hypothesis(misfit=1400.0), hypothesis(PRELOAD, misfit=400.0)]
    each = 0.7 * tuned.NEAR_PROBABILITY
    found += [
        hypothesis(replace(CHURNING, component=place), misfit=400.0, log_prior=float(np.log(each)))
        for place in places[:2]
    ]
    like = {"apart": lambda one, other: 0.0, "overlapping": group}
    assert rank(found)[1].probability == pytest.approx(each, rel=0.05)
    together = verdict(*found, **like)
    assert (together.verdict, together.reason) == ("ambiguous", NEAR_REASON)
    (rival,) = together.alternatives
    assert rival.probability == pytest.approx(2.0 * each * together.chosen.probability, rel=0.05)
    assert verdict(*found[:3], **like).verdict == "missing_physics"


def test_heat_without_a_name_is_no_rival_for_a_law_at_its_place(monkeypatch):
    """It says the same of the machine; elsewhere, beside a sensor, or named itself it remains one."""
    # as heat is that follows a recorded quantity
    monkeypatch.setattr(like_sets, "in_intervals", lambda effect, candidate: False)
    places = ("front_bearings", "F1", "F2")
    alike = {"apart": lambda one, other: 0.0, "overlapping": dict.fromkeys(places, frozenset(places))}

    def said(law, place, *beside):
        heat = hypothesis(candidate("unrecorded_heat_source", place), *beside, misfit=400.0, log_prior=-2.5)
        return verdict(hypothesis(misfit=1400.0), hypothesis(law, *beside, misfit=400.0), heat, **alike)

    assert [said(CHURNING, place).verdict for place in ("front_bearings", "F2")] == ["missing_physics"] * 2
    assert said(CHURNING, "F2", OFFSET).verdict == "missing_physics"
    (listed,) = said(CHURNING, "F2").alternatives
    assert listed.fit.candidates[0].effect == "unrecorded_heat_source"
    assert (said(CHURNING, "nose").verdict, said(CHURNING, "nose").reason) == ("ambiguous", NEAR_REASON)
    assert said(candidate("sensor_gain", "F2", "sensor"), "F2").verdict == "ambiguous"
    assert said(candidate("unrecorded_cooling"), "front_bearings").verdict == "ambiguous"
