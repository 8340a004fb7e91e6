"""Sets that are one for a decision, and effects that have to be needed beside others."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.inference import like_sets, tuned
from spindle_fem.inference.final_fits import to_be_fitted
from spindle_fem.inference.hypothesis import Ranked
from spindle_fem.inference.like_sets import are_alike, odds_needed, with_needed_effects
from spindle_fem.inference.set_odds import rank
from spindle_fem.inference.verdict import NEAR_REASON
from tests.support.made_hypotheses import CHURNING, OFFSET, PRELOAD, candidate, hypothesis, verdict

IN_REAR = replace(CHURNING, component="rear_bearings")


def test_a_further_effect_is_less_probable_beside_the_likeliest_set_that_lacks_it():
    single, other = hypothesis(PRELOAD, misfit=400.0), hypothesis(IN_REAR, misfit=400.0)
    pair, twin = (hypothesis(PRELOAD, second, misfit=400.0) for second in (IN_REAR, OFFSET))
    triple = hypothesis(PRELOAD, IN_REAR, OFFSET, misfit=400.0)
    items, before = (single, other, pair, twin, triple), (0.06, 0.04, 0.3, 0.1, 0.5)
    ranked = with_needed_effects([Ranked(*own) for own in zip(items, before, strict=True)], {})
    told = [item.probability for item in ranked]
    assert told == sorted(told, reverse=True)
    assert sum(told) == pytest.approx(1.0)
    said = {id(item.best): item.probability for item in ranked}
    # Both pairs beside the single effect that they hold, the triple beside the likelier of them.
    first, rest = 0.06 + 0.3 + 0.1, 0.06 + (0.3 + 0.1) / tuned.FURTHER_EFFECT
    assert said[id(single)] == pytest.approx(0.06 * first / rest)
    assert said[id(twin)] / said[id(single)] == pytest.approx(0.1 / 0.06 / tuned.FURTHER_EFFECT)
    likelier = 0.3 / tuned.FURTHER_EFFECT * first / rest
    assert said[id(triple)] / said[id(pair)] == pytest.approx(0.5 / likelier / tuned.FURTHER_EFFECT)
    assert said[id(other)] == pytest.approx(0.04)


def test_nothing_missing_and_sets_without_a_smaller_one_are_not_doubted():
    nothing, pair = hypothesis(misfit=900.0), hypothesis(PRELOAD, CHURNING, misfit=400.0)
    ranked = with_needed_effects([Ranked(pair, 0.9), Ranked(nothing, 0.1)], {})
    assert [item.probability for item in ranked] == [0.9, 0.1]


@pytest.mark.parametrize(
    ("further", "odds"),
    [
        (CHURNING, tuned.FURTHER_AT_ITS_PLACE),
        (replace(CHURNING, component="F1"), tuned.FURTHER_AT_ITS_PLACE),
        (IN_REAR, tuned.FURTHER_EFFECT),
        (replace(OFFSET, component="F1"), tuned.FURTHER_EFFECT),
    ],
)
def test_a_further_law_beside_one_of_the_same_place_needs_more(further, odds):
    group = dict.fromkeys(("front_bearings", "F1"), frozenset({"F1", "front_bearings"}))
    fewer, more = hypothesis(PRELOAD, misfit=400.0).fit, hypothesis(PRELOAD, further, misfit=400.0).fit
    assert odds_needed(more, fewer, group) == odds
    # Twice at one place is one effect.
    twice = hypothesis(PRELOAD, further, replace(further, form="elsewhere in it"), misfit=400.0).fit
    assert odds_needed(twice, fewer, group) == odds


@pytest.mark.parametrize(("coarseness", "members"), [(1.0, 2), (1.1, 3)])
def test_a_verdict_doubts_further_effects_of_a_machine_that_is_drawn(coarseness, members):
    nothing = replace(hypothesis(misfit=2000.0), heldout=900.0)
    pair = replace(hypothesis(PRELOAD, CHURNING, misfit=400.0), heldout=500.0)
    triple = replace(hypothesis(PRELOAD, CHURNING, OFFSET, misfit=380.0), heldout=500.0)
    # Each effect lowers what is left.
    left = dict.fromkeys(("left", "beyond"), lambda fit: {0: 1.8, 2: 1.3, 3: 1.0}[len(fit.keys)])

    def found(odds):
        """With the triple so much more probable than the pair."""
        three, two = (
            next(i.probability for i in rank([nothing, pair, triple], coarseness) if len(i.fit.keys) == size)
            for size in (3, 2)
        )
        likelier = replace(triple, log_prior=float(np.log(odds * two / three)))
        return verdict(nothing, pair, likelier, calibrated=True, coarseness=coarseness, **left)

    assert len(found(0.5 * tuned.FURTHER_EFFECT).chosen.fit.keys) == members
    assert len(found(2.0 * tuned.FURTHER_EFFECT).chosen.fit.keys) == 3


@pytest.mark.parametrize(("odds", "listed"), [(0.4, [3]), (0.001, [])])
def test_a_doubted_effect_is_listed_where_it_is_likely_otherwise(odds, listed):
    nothing = hypothesis(misfit=2000.0)
    pair, triple = (
        hypothesis(PRELOAD, CHURNING, misfit=400.0),
        hypothesis(PRELOAD, CHURNING, OFFSET, misfit=380.0),
    )
    shares = {len(i.fit.keys): i.probability for i in rank([nothing, pair, triple], 1.0)}
    likely = replace(triple, log_prior=float(np.log(odds * shares[2] / shares[3])))
    found = verdict(nothing, pair, likely, calibrated=True)
    assert len(found.chosen.fit.keys) == 2
    assert [len(i.fit.keys) for i in found.alternatives] == listed
    assert all(i.probability < tuned.LISTED for i in found.alternatives)


def test_what_is_likelier_at_places_that_count_as_one_is_named_first():
    """Split between a bearing and its set it is behind another effect, together ahead of it."""
    group = dict.fromkeys(("front_bearings", "F1"), frozenset({"F1", "front_bearings"}))
    found = [
        hypothesis(misfit=1400.0),
        hypothesis(PRELOAD, misfit=400.0),
        hypothesis(replace(CHURNING, component="F1"), misfit=400.6),
        hypothesis(CHURNING, misfit=400.5),
    ]
    apart, together = verdict(*found), verdict(*found, overlapping=group)
    assert [c.effect for c in apart.chosen.fit.candidates] == [PRELOAD.effect]
    assert together.chosen.fit is found[3].fit
    assert [i.fit for i in together.alternatives] == [found[1].fit]
    assert together.chosen.probability > together.alternatives[0].probability


def test_a_rival_is_one_by_what_fitted_readings_say_of_it():
    nothing, best = replace(hypothesis(misfit=1400.0), heldout=900.0), hypothesis(PRELOAD, misfit=400.0)
    best = replace(best, heldout=500.0)

    def said(share):
        """Of a set that reads alike, so probable by fitted readings, three times as probable by all."""
        gain = 2.0 * tuned.GAIN_DIVISOR * float(np.log(3.0))
        rival = hypothesis(CHURNING, misfit=400.0, log_prior=float(np.log(share)))
        return verdict(nothing, best, replace(rival, heldout=500.0 - gain), apart=lambda one, other: 0.0)

    least = tuned.LISTED
    assert (said(1.2 * least).verdict, said(1.2 * least).reason) == ("ambiguous", NEAR_REASON)
    assert said(0.8 * least).verdict == "missing_physics"


def test_rivals_at_places_that_count_as_one_are_one_rival():
    places = ("front_bearings", "F1", "F2")
    group = dict.fromkeys(places, frozenset(places))
    found = [hypothesis(misfit=1400.0), hypothesis(PRELOAD, misfit=400.0)]
    each = 0.7 * tuned.LISTED
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

    def said(law, place, *beside, misfit=400.0, log_prior=-2.5):
        source = candidate("unrecorded_heat_source", place)
        heat = hypothesis(source, *beside, misfit=misfit, log_prior=log_prior)
        return verdict(hypothesis(misfit=1400.0), hypothesis(law, *beside, misfit=400.0), heat, **alike)

    assert [said(CHURNING, place).verdict for place in ("front_bearings", "F2")] == ["missing_physics"] * 2
    assert said(CHURNING, "F2", OFFSET).verdict == "missing_physics"
    # Though it is likelier the law is told, with the probability of both, unless the readings speak for it.
    named = said(CHURNING, "F2", log_prior=2.0)
    assert named.chosen.fit.candidates == (CHURNING,)
    assert named.evidence > 0.99
    assert not named.alternatives
    spoken = 2.0 * tuned.GAIN_DIVISOR * tuned.LEAST_HELDOUT_GAIN
    assert said(CHURNING, "F2", misfit=400.1 - spoken, log_prior=2.0).chosen.fit.candidates == (CHURNING,)
    heat = said(CHURNING, "F2", misfit=399.9 - spoken, log_prior=2.0)
    assert heat.chosen.fit.candidates[0].effect == "unrecorded_heat_source"
    assert (said(CHURNING, "nose").verdict, said(CHURNING, "nose").reason) == ("ambiguous", NEAR_REASON)
    assert said(candidate("sensor_gain", "F2", "sensor"), "F2").verdict == "ambiguous"
    assert said(candidate("unrecorded_cooling"), "front_bearings").verdict == "ambiguous"


def test_heat_of_one_law_at_two_spots_is_one_set_named_at_the_larger():
    def heat(place, size):
        form = f"{place} following thrust"
        made = candidate("unrecorded_heat_source", place)
        return replace(made, form=form, amplitude=f"{place}.size"), size

    def fitted(*members):
        fit = hypothesis(*(member for member, _ in members), misfit=400.0).fit
        at = {member.amplitude: size for member, size in members}
        moved = [at.get(c.name, u) for c, u in zip(fit.coordinates, fit.position, strict=True)]
        return replace(fit, position=np.array(moved))

    large, small = heat("housing", 2.0), heat("SP04", 0.1)
    one, two = fitted(large), fitted(small, large)
    assert two.named == (large[0],)
    assert two.named_keys == one.named_keys == {("unrecorded_heat_source", "housing", None)}
    assert are_alike(one, two, {})
    other = fitted(large, (replace(small[0], form="SP04 following load"), 0.1))
    assert len(other.named) == 2
    assert not are_alike(one, other, {})


@pytest.mark.parametrize(
    ("law", "constant_law"),
    [
        *((law, "joint_conductance") for law in ("gap_closure", "radiation", "natural_convection")),
        *((law, "heat_scale") for law in ("drive_heat", "seal_friction", "grease_churning", "starvation")),
        ("sensor_detached", "sensor_lag"),
    ],
)
def test_a_law_that_only_repeats_a_constant_one_at_its_place_is_no_rival(law, constant_law):
    plain = candidate(constant_law, "a|b", kind="parameter")
    nothing, constant = hypothesis(misfit=1400.0), hypothesis(plain, CHURNING, misfit=401.0)

    def found(place, distance, misfit=400.0):
        rich = hypothesis(candidate(law, place), CHURNING, misfit=misfit)
        near = distance * tuned.SAME_READINGS
        return rich, verdict(nothing, rich, constant, calibrated=True, apart=lambda *_: near)

    _, alike = found("a|b", 0.9)
    assert alike.chosen.fit is constant.fit
    assert alike.verdict == "missing_physics"
    assert alike.evidence > 0.99
    assert not alike.alternatives
    # Readings are no likelier with what it may do beyond, however it reads.
    _, no_likelier = found("a|b", 1.1, misfit=401.0)
    assert no_likelier.chosen.fit is constant.fit
    for place, distance in (("a|b", 1.1), ("b|c", 0.9)):
        rich, apart = found(place, distance)
        assert apart.verdict == "ambiguous"
        assert {id(i.fit) for i in (apart.chosen, *apart.alternatives)} == {id(rich.fit), id(constant.fit)}


@pytest.mark.parametrize(("size", "is_told"), [(0.0, False), (0.4, True)])
def test_a_gap_that_is_never_open_is_a_contact_that_conducts_less(size, is_told):
    """However much likelier its further values make the readings: they are not what its name says."""
    plain = candidate("joint_conductance", "a|b", kind="parameter")
    gap = hypothesis(candidate("gap_closure", "a|b"), misfit=350.0, position=(0.0, size))
    constant = hypothesis(plain, misfit=400.0)
    found = verdict(hypothesis(misfit=1400.0), gap, constant, calibrated=True)
    assert found.chosen.fit is (gap.fit if is_told else constant.fit)


@pytest.mark.parametrize(("coarseness", "fitted"), [(3.0, True), (1.0, False)])
def test_what_leaves_least_of_a_network_is_fitted_to_the_end_though_others_are_likelier(coarseness, fitted):
    # Far enough apart that none reads as the first does.
    others = [hypothesis(candidate("windage", f"part {i}"), misfit=430.0 + 30.0 * i) for i in range(9)]
    least = hypothesis(CHURNING, OFFSET, misfit=300.0, log_prior=-400.0)
    found = [hypothesis(misfit=1400.0), hypothesis(PRELOAD, misfit=400.0), *others, least]
    problem = SimpleNamespace(predictor=None, slow=None, belief=None)
    assert (least in to_be_fitted(problem, found, {}, coarseness)) is fitted


def test_the_parts_of_the_first_set_and_the_best_of_each_smaller_size_are_fitted_again():
    first = hypothesis(CHURNING, OFFSET, misfit=300.0)
    parts = [hypothesis(CHURNING, misfit=1200.0), hypothesis(OFFSET, misfit=1300.0)]
    single = hypothesis(PRELOAD, misfit=700.0)
    nothing, hopeless = hypothesis(misfit=1400.0), hypothesis(candidate("windage", "part"), misfit=1000.0)
    pair = hypothesis(PRELOAD, OFFSET, misfit=400.0)
    chosen = to_be_fitted(
        SimpleNamespace(predictor=None, slow=None, belief=None),
        [nothing, hopeless, pair, single, *parts, first],
        {},
        1.0,
    )
    assert chosen[0] is first
    # As many as are always fitted again, whatever they leave.
    assert {id(h) for h in chosen} == {id(h) for h in (first, pair, single, nothing, *parts)}
