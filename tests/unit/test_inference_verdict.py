"""What fitted hypotheses amount to, on hypotheses made up for the purpose."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.reliability import reliable
from spindle_fem.inference.set_odds import rank, tempered
from spindle_fem.inference.verdict import (
    CONTRADICTED_REASON,
    NEAR_REASON,
    NOTHING_REASON,
    PRIOR_SIGMAS,
    kind_of,
    within_prior,
)
from tests.support.made_hypotheses import (
    CHURNING,
    OFFSET,
    PRELOAD,
    SCALE,
    candidate,
    hypothesis,
    verdict,
)

PRELOAD_KEY = frozenset({("thermal_preload", "front_bearings", None)})
CHURNING_KEY = frozenset({("grease_churning", "front_bearings", None)})


# ---------------------------------------------------------------------- detection
def test_a_set_that_does_not_predict_what_was_held_out_is_stated_no_higher_than_that_permits():
    sets = hypothesis(PRELOAD, misfit=400.0), hypothesis(misfit=2000.0)
    well, badly = (
        verdict(*sets, beyond=lambda fit, rest=rest: rest if fit.candidates else 8.0) for rest in (1.1, 4.0)
    )
    assert well.chosen.probability > 0.9 > 0.11 > badly.chosen.probability
    assert badly.other == pytest.approx(1.0 - badly.chosen.probability)
    assert (well.verdict, badly.verdict) == ("missing_physics", "ambiguous")
    assert "likelier than the best set" in badly.reason
    # as much as in what was fitted: no more than that says
    evenly, fitted = (
        {"left": lambda fit: 1.9, "beyond": lambda fit, r=r: r if fit.candidates else 8.0} for r in (1.9, 1.0)
    )
    assert verdict(*sets, **evenly).chosen.probability == verdict(*sets, **fitted).chosen.probability


def test_what_is_less_likely_than_nothing_missing_is_listed_beside_it():
    nothing, weak = hypothesis(misfit=1000.0, evidence=-500.0), hypothesis(PRELOAD, misfit=998.0)
    ranked = {item.fit.keys: item.probability for item in rank([nothing, weak])}
    told = verdict(nothing, weak)
    assert told.verdict == "consistent"
    assert [(item.fit.keys, item.probability) for item in told.alternatives] == [
        (weak.keys, pytest.approx(ranked[weak.keys]))
    ]
    assert tuned.LISTED < ranked[weak.keys] < told.chosen.probability


def test_a_set_that_leaves_as_much_as_nothing_missing_is_not_named():
    null = replace(hypothesis(misfit=1000.0), heldout=700.0)
    seldom, never = (replace(hypothesis(PRELOAD, misfit=m), heldout=680.0) for m in (978.0, 950.0))
    for found, less, named in (
        (seldom, 0.992, "consistent"),
        (seldom, 0.988, "missing_physics"),
        (never, 0.992, "missing_physics"),
    ):
        told = verdict(null, found, trials=0, left=lambda fit, less=less: less if fit.candidates else 1.0)
        assert told.verdict == named
        # where chance hardly leaves such a machine it is something
        assert (told.p_value < tuned.RULED_OUT) == (found is never)


def test_a_set_is_named_where_fitted_and_held_out_readings_together_speak_for_it():
    nothing, preload = replace(hypothesis(misfit=2000.0), heldout=700.0), hypothesis(PRELOAD, misfit=1900.0)
    first, last = rank([nothing, preload])
    odds = float(np.log(first.probability / last.probability))
    assert first.fit.candidates
    assert odds > 2.0 * tuned.LEAST_HELDOUT_GAIN
    least = 2.0 * tuned.GAIN_DIVISOR * (tuned.LEAST_HELDOUT_GAIN - odds)
    better, same = ((replace(preload, heldout=700.0 - gain), nothing) for gain in (least + 0.1, least - 0.1))
    more = {"left": lambda fit: 1.2}
    assert verdict(*better).verdict == "missing_physics"
    assert verdict(*same, **more).verdict == "unexplained"
    assert not verdict(*same, **more).chosen.fit.candidates
    # held-out readings alone are enough, and in a network needed
    alone = (
        replace(preload, heldout=700.0 - 2.0 * tuned.GAIN_DIVISOR * tuned.LEAST_HELDOUT_GAIN - 0.1),
        nothing,
    )
    assert verdict(*alone).verdict == "missing_physics"
    # a network that leaves no more than may be left must be told clearly better by both
    for share, lower, higher in ((0.99, "missing_physics", "consistent"), (1.01, "consistent", "consistent")):
        for most in (1.0, 0.9 * tuned.MOST_LEFT):
            least = most * share * (1.0 - tuned.LEAST_OF_A_MEMBER)
            left = dict.fromkeys(
                ("left", "beyond"), lambda fit, least=least, most=most: least if fit.candidates else most
            )
            assert verdict(*alone, coarseness=1.1, **left).verdict == lower
            assert verdict(*better, coarseness=1.1, **left).verdict == higher
    # the picture that a network gives is coarser: what is left of single readings counts
    much = 1.1 * tuned.MOST_LEFT
    for share, told in ((0.5, "missing_physics"), (0.99, "consistent")):
        left = {"beyond": lambda fit, share=share: share * much if fit.candidates else much}
        assert verdict(*alone, coarseness=2.0, **left).verdict == told
    worse = {"left": lambda fit: 1.6 if fit.candidates else 1.5}
    better_later = {"beyond": lambda fit: 0.5 * much if fit.candidates else much}
    assert verdict(*alone, coarseness=2.0, **better_later, **worse).verdict == "consistent"
    # where readings leave far more than noise, nothing that is known explains it
    assert verdict(*same, left=lambda fit: 3.0).verdict == "unexplained"


def test_what_chance_does_not_leave_is_unexplained_where_no_set_tells_held_out_readings():
    nothing = replace(hypothesis(misfit=2000.0), heldout=700.0)
    clear, faint = (
        (nothing, replace(hypothesis(PRELOAD, misfit=2000.0 - gain), heldout=900.0)) for gain in (120.0, 24.0)
    )
    said = verdict(*clear, left=lambda fit: 1.1)
    assert said.p_value < tuned.RULED_OUT
    assert (said.verdict, said.reason) == ("unexplained", CONTRADICTED_REASON)
    assert not said.chosen.fit.candidates
    assert verdict(*clear, beyond=lambda fit: 1.1).verdict == "unexplained"
    # readings within their noise contradict nothing
    assert verdict(*clear).verdict == "consistent"
    assert verdict(*faint).p_value > tuned.RULED_OUT
    assert verdict(*faint).verdict == "consistent"
    # likelihoods of a network, a coarse picture, prove less
    assert verdict(*clear, coarseness=1.1).verdict == "consistent"


# ------------------------------------------------------------------------ verdicts
def test_nothing_missing_is_consistent():
    found = verdict(hypothesis(misfit=400.0), hypothesis(PRELOAD, misfit=396.0, log_prior=-3.0))
    assert found.verdict == "consistent"
    assert found.p_value > 0.2
    assert found.chosen.fit.candidates == ()
    assert found.other == 0.0


def test_what_chance_leaves_is_consistent_with_a_half_at_least_and_likelier_sets_beside_it():
    nothing, found = hypothesis(misfit=1000.0), hypothesis(PRELOAD, misfit=980.0)
    likelier, empty = rank([nothing, found])
    assert likelier.fit is found.fit
    assert empty.probability < 0.5
    told = verdict(nothing, found, trials=1000)
    assert told.p_value > tuned.SIGNIFICANT
    assert (told.verdict, told.chosen.probability) == ("consistent", tuned.STILL_POSSIBLE)
    (other,) = told.alternatives
    assert other.fit is found.fit
    assert other.probability == pytest.approx(1.0 - tuned.STILL_POSSIBLE)


def test_consistent_recording_that_chance_hardly_makes_is_no_surer_than_as_likely_as_not():
    nothing, dear = hypothesis(misfit=420.0), hypothesis(PRELOAD, misfit=400.0, evidence=-260.0)
    told = {trials: verdict(nothing, dear, trials=trials) for trials in (200, 2000)}
    assert tuned.SIGNIFICANT < told[200].p_value < tuned.DOUBTFUL < told[2000].p_value
    assert {item.verdict for item in told.values()} == {"consistent"}
    assert told[200].chosen.probability == tuned.STILL_POSSIBLE
    assert told[2000].chosen.probability > 0.99
    # What evidence prefers stands beside it though held-out readings do not tell it.
    likely = verdict(nothing, hypothesis(PRELOAD, misfit=400.0), trials=200, beyond=lambda fit: 1.0)
    assert (likely.verdict, likely.chosen.fit.candidates) == ("consistent", ())
    assert [item.fit.candidates for item in likely.alternatives] == [(PRELOAD,)]
    sums = [
        t.chosen.probability + t.other + sum(a.probability for a in t.alternatives) for t in told.values()
    ]
    assert sums == pytest.approx([1.0, 1.0])


def test_complexity_alone_does_not_make_an_impossible_recording_consistent():
    dear, none = candidate("grease_churning"), hypothesis(misfit=460.0, log_prior=-0.5)
    # The dear set pays more for its parameters than it gains, tempered: probably nothing, were it possible.
    found = [none, hypothesis(dear, misfit=400.0, evidence=-200.0 - 30.0)]
    assert rank(found)[0].fit is none.fit
    said = verdict(*found)
    assert said.p_value < 1e-3
    assert (said.verdict, said.evidence) == ("missing_physics", pytest.approx(1.0))
    # What chance makes in so many trials is nothing.
    less = [none, hypothesis(dear, misfit=440.0, evidence=-220.0 - 30.0)]
    assert verdict(*less).verdict == "consistent"


def test_what_few_consistent_recordings_show_is_ambiguous_where_evidence_prefers_nothing():
    dear, none = candidate("grease_churning"), hypothesis(misfit=430.0, log_prior=-0.5)
    found = [none, hypothesis(dear, misfit=400.0, evidence=-200.0 - 30.0)]
    assert rank(found)[0].fit is none.fit
    said = verdict(*found)
    assert tuned.RULED_OUT < said.p_value < tuned.SIGNIFICANT
    assert (said.verdict, said.reason) == ("ambiguous", NOTHING_REASON)
    assert said.chosen.fit.candidates == (dear,)
    assert said.chosen.probability <= tuned.STILL_POSSIBLE
    (nothing,) = said.alternatives
    assert (nothing.fit is none.fit, nothing.probability) == (True, tuned.STILL_POSSIBLE)
    assert said.chosen.probability + nothing.probability + said.other == pytest.approx(1.0)
    # Where evidence prefers something as well, it is said.
    clear = [none, hypothesis(dear, misfit=400.0, evidence=-200.0, log_prior=-0.5)]
    assert verdict(*clear).verdict == "missing_physics"
    # What fitted readings leave open held-out ones decide.
    odds = tempered(clear)[1] - tempered(clear)[0] - np.log(1.5)
    open_ = [replace(none, log_prior=none.log_prior + odds), clear[1]]
    assert rank(open_)[1].probability == pytest.approx(0.4)
    assert verdict(*open_).verdict == "ambiguous"
    held = [replace(h, heldout=misfit) for h, misfit in zip(open_, (700.0, 685.0), strict=True)]
    assert verdict(*held).verdict == "missing_physics"


def test_a_misfit_that_nothing_explains_is_unexplained():
    null, useless = hypothesis(misfit=4e3, reduced=10.0), hypothesis(PRELOAD, misfit=4e3, reduced=10.0)
    found = verdict(null, useless)
    assert found.verdict == "unexplained"
    assert found.p_value < 1e-10
    assert "no effect explains" in found.reason
    assert found.chosen.fit.candidates == ()
    # A little above the noise is still what a consistent recording may leave.
    assert verdict(hypothesis(misfit=600.0, reduced=1.5)).verdict == "consistent"


@pytest.mark.parametrize(
    ("member", "expected"), [(PRELOAD, "missing_physics"), (OFFSET, "sensor"), (SCALE, "parameter")]
)
def test_a_clear_single_effect_gets_the_verdict_of_its_kind(member, expected):
    found = verdict(
        hypothesis(misfit=1400.0), hypothesis(member, misfit=400.0, position=(0.0, 2.5)), calibrated=True
    )
    assert found.verdict == expected
    assert found.p_value < 1e-6
    assert found.evidence > 0.99
    assert 0.9 < found.chosen.probability < found.evidence
    assert found.alternatives == ()


LIKE = (
    hypothesis(misfit=1400.0),
    hypothesis(PRELOAD, misfit=400.0),
    hypothesis(CHURNING, misfit=404.0, log_prior=float(np.log(0.1))),
)


def test_sets_that_read_alike_are_named_together_however_probable_one_is():
    found = verdict(*LIKE, apart=lambda one, other: 0.9 * tuned.NEAR_READINGS)
    assert (found.verdict, found.reason) == ("ambiguous", NEAR_REASON)
    assert found.evidence > tuned.DECIDED
    assert found.chosen.fit is LIKE[1].fit
    (other,) = found.alternatives
    assert other.fit is LIKE[2].fit
    assert tuned.LISTED < other.probability < 0.05 < found.chosen.probability


def test_a_richer_law_that_repeats_a_simple_one_is_no_rival():
    dear = hypothesis(CHURNING, misfit=400.0, evidence=-200.0 - 2.0 - 6.0)
    found = verdict(*LIKE[:2], dear, apart=lambda one, other: 0.0)
    assert (found.verdict, found.alternatives) == ("missing_physics", ())


def test_sets_that_read_apart_or_fit_apart_are_decided_by_their_likelihood():
    asked = []

    def apart(one, other):
        asked.append((one, other))
        return 1.01 * tuned.NEAR_READINGS

    assert verdict(*LIKE, apart=apart).verdict == "missing_physics"
    assert asked == [(LIKE[1].fit, LIKE[2].fit)]
    twenty_to_one = 2.0 * tuned.GAIN_DIVISOR * tuned.LEAST_HELDOUT_GAIN
    worse = hypothesis(CHURNING, misfit=400.0 + 1.01 * twenty_to_one)
    found = verdict(*LIKE[:2], worse, apart=lambda one, other: 0.0)
    assert found.verdict == "missing_physics"


@pytest.mark.parametrize(
    ("heldout", "expected"), [(500.0, "ambiguous"), (510.0, "missing_physics"), (490.0, "ambiguous")]
)
def test_held_out_readings_tell_sets_apart_that_read_alike(heldout, expected):
    nothing, best, other = LIKE
    found = verdict(
        replace(nothing, heldout=900.0),
        replace(best, heldout=500.0),
        replace(other, heldout=heldout),
        apart=lambda one, other: 0.0,
    )
    assert found.verdict == expected
    assert found.chosen.fit is best.fit


def test_the_same_elsewhere_in_a_set_and_sets_of_another_size_are_no_rivals():
    elsewhere = hypothesis(candidate("thermal_preload", "F1"), misfit=410.0)
    pair = hypothesis(PRELOAD, CHURNING, misfit=410.0)
    one = {"front_bearings": frozenset({"front_bearings", "F1"})}
    found = verdict(*LIKE[:2], elsewhere, pair, overlapping=one, apart=lambda one, other: 0.0)
    assert found.verdict == "missing_physics"
    assert all(item.probability >= tuned.LISTED for item in found.alternatives)


def test_of_a_set_that_is_not_sure_the_likeliest_without_one_effect_is_listed():
    null, one = hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=900.0)
    other, two = hypothesis(CHURNING, misfit=950.0), hypothesis(PRELOAD, CHURNING, misfit=700.0)
    found = verdict(null, one, other, two)
    assert found.chosen.fit.keys == two.keys
    assert found.chosen.probability < tuned.DECIDED
    assert [item.fit.keys for item in found.alternatives] == [one.keys]
    assert found.alternatives[0].probability < tuned.LISTED
    sure = verdict(null, one, other, hypothesis(PRELOAD, CHURNING, misfit=-9000.0))
    assert sure.chosen.probability > tuned.DECIDED
    assert sure.alternatives == ()


def test_physics_comes_before_parameters_before_sensors():
    assert kind_of([OFFSET, SCALE, PRELOAD]) == "missing_physics"
    assert kind_of([OFFSET, SCALE]) == "parameter"
    assert kind_of([OFFSET]) == "sensor"
    assert kind_of([]) == "consistent"


def test_what_all_likely_sets_hold_is_named_whether_there_is_more_or_not():
    null, one = hypothesis(misfit=2000.0), hypothesis(PRELOAD, misfit=400.0)
    needed = 1.0 + float(np.log(tuned.FURTHER_EFFECT))
    more = [hypothesis(PRELOAD, OFFSET, misfit=400.0, evidence=one.fit.log_evidence + needed)]
    other = [hypothesis(CHURNING, misfit=400.0, evidence=one.fit.log_evidence)]
    assert verdict(null, one, *other, calibrated=True).verdict == "ambiguous"
    sure = verdict(null, one, *more, calibrated=True)
    assert sure.verdict == "missing_physics"
    assert sure.evidence < tuned.DECIDED
    assert [item.fit.keys for item in sure.alternatives] == [more[0].keys]


def test_two_sets_as_good_are_ambiguous_and_both_named():
    found = verdict(
        hypothesis(misfit=1400.0), hypothesis(PRELOAD, misfit=400.0), hypothesis(CHURNING, misfit=400.4)
    )
    assert found.verdict == "ambiguous"
    assert found.chosen.fit.keys == PRELOAD_KEY
    assert [item.fit.keys for item in found.alternatives] == [CHURNING_KEY]
    total = found.chosen.probability + sum(item.probability for item in found.alternatives) + found.other
    assert total <= 1.0 + 1e-12


def test_a_bearing_and_its_set_are_one_place_for_a_decision():
    group = {"front_bearings": frozenset({"F1", "front_bearings"}), "F1": frozenset({"F1", "front_bearings"})}
    found = [
        hypothesis(misfit=1400.0),
        hypothesis(CHURNING, misfit=400.0),
        hypothesis(replace(CHURNING, component="F1"), misfit=400.4),
    ]
    assert verdict(*found).verdict == "ambiguous"
    assert verdict(*found, overlapping=group).verdict == "missing_physics"
    other = hypothesis(replace(CHURNING, component="R1"), misfit=400.4)
    assert verdict(found[0], found[1], other, overlapping=group).verdict == "ambiguous"


def test_a_fit_that_stays_above_the_noise_leaves_room_for_something_else():
    found = verdict(hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=3000.0, reduced=4.0))
    assert found.other > 0.1
    assert found.chosen.probability <= 1.0 - found.other + 1e-12
    good = verdict(hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=400.0, reduced=1.0))
    assert good.other == pytest.approx(1.0 - reliable(good.evidence, 1.0))
    assert found.chosen.probability < good.chosen.probability
    nearly = verdict(hypothesis(misfit=9000.0), hypothesis(PRELOAD, misfit=440.0, reduced=1.1))
    assert good.other < nearly.other < found.other


def test_a_shift_that_the_prior_holds_is_consistent():
    """0.2 is one standard deviation: shifts are judged by their sum, machine and effect together."""
    own_sigma = 0.6
    held = hypothesis(SCALE, misfit=400.0, position=(1.0, 1.2 * 0.2 / own_sigma))
    assert within_prior(held.fit, calibrated=False)
    assert verdict(hypothesis(misfit=460.0), held).verdict == "consistent"
    # It stands beside nothing missing, and both share the whole, whatever a p-value rules out.
    for before in (410.0, 425.0, 430.0, 460.0):
        told = verdict(hypothesis(misfit=before), held, trials=0)
        assert told.verdict == "consistent"
        stated = [told.chosen.probability, *(i.probability for i in told.alternatives)]
        assert sum(stated) <= 1.0 + 1e-12
    beyond = hypothesis(SCALE, misfit=400.0, position=(1.0, 2.0 * 0.2 / own_sigma))
    assert not within_prior(beyond.fit, calibrated=False)
    assert verdict(hypothesis(misfit=460.0), beyond).verdict == "parameter"
    edge = 0.2 * (PRIOR_SIGMAS - 1.0) / own_sigma
    for factor, expected in ((0.99, True), (1.01, False)):
        fit = hypothesis(SCALE, misfit=400.0, position=(1.0, factor * edge)).fit
        assert within_prior(fit, calibrated=False) is expected


def test_after_a_calibration_a_shift_is_a_parameter():
    held = hypothesis(SCALE, misfit=400.0, position=(0.0, 0.3))
    assert not within_prior(held.fit, calibrated=True)
    assert verdict(hypothesis(misfit=460.0), held, calibrated=True).verdict == "parameter"


def test_physics_is_never_within_a_prior():
    assert not within_prior(hypothesis(PRELOAD, misfit=400.0).fit, calibrated=False)
    both = hypothesis(SCALE, PRELOAD, misfit=400.0)
    assert not within_prior(both.fit, calibrated=False)
    assert not within_prior(hypothesis(misfit=400.0).fit, calibrated=False)
