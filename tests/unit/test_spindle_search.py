"""Steps of a search on a lumped spindle that was made to differ in a known way."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.catalogue.joint_conductance import LOOSE as LOOSE_SEATS
from spindle_fem.effects.catalogue.unrecorded_cooling import CLOSED
from spindle_fem.effects.framework.unrecorded import followed_name
from spindle_fem.effects.registry import candidates_for, catalogue, effect_of, interval_effects
from spindle_fem.inference import neighbouring_sets, search_course, tuned
from spindle_fem.inference.candidate_response import BaseRun, Variant, variants_of
from spindle_fem.inference.final_fits import few_of_each
from spindle_fem.inference.findings import findings_of
from spindle_fem.inference.hypothesis import Hypothesis, Ranked, identity
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.neighbouring_sets import at_other_spots, exchanged, sought_again
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW
from spindle_fem.inference.worker_processes import Workers
from tests.support.diagnosed_spindle import (
    DRY_BEARING,
    DRY_SET,
    EVIDENCE,
    FROM,
    HEAT,
    LOOSE,
    SEAT,
    UNTIL,
)


def search_over(case, diagnosis, kind=Search):
    problem = Problem(
        diagnosis.predictor, diagnosis.calibrated.belief, EXPECTED_SLOW, diagnosis.predictor.observations
    )
    effects = catalogue()
    weights = dict.fromkeys(effects, 1.0)
    candidates = candidates_for(case.view)
    return kind(problem, case.view, effects, candidates, interval_effects(), weights, workers=Workers(1))


def test_a_contact_that_is_lost_answers_as_the_machine_without_it_does(case, heated):
    """Not as many times what a slightly worse one does: heat that finds other ways changes little more."""
    seats = next(c for c in effect_of("joint_conductance").candidates(case.view) if not c.factors)
    present = [effect_of("windage").candidates(case.view)[0]]
    first_order, lost = variants_of([seats])
    assert lost.reference == LOOSE_SEATS
    predictor = heated.predictor
    values = Variant(present[0], {}).values(present[0].reference)
    answers = BaseRun(predictor, 0, values, present).responses([first_order, lost])
    told = predictor.predict(0, values | lost.values(LOOSE_SEATS), (*present, seats)).temperature
    difference = told - predictor.predict(0, values, present).temperature
    assert answers[:, :, 1] == pytest.approx(difference, abs=1e-9)
    extended = answers[:, :, 0] * (1.0 / LOOSE_SEATS - 1.0) / -np.log(first_order.reference)
    assert np.abs(extended - difference).max() > 0.2 * np.abs(difference).max()


def test_heat_found_at_a_wrong_spot_is_tried_at_the_right_one(case, heated):
    search = search_over(case, heated)
    problem = search.problem
    search.found = {}
    wrong = effect_of("unrecorded_heat_source").over(case.view, "rear_bearings", [(FROM, UNTIL)])
    for candidates in ((), (wrong,)):
        search.keep(Hypothesis(problem.fit(candidates), -1.0))
    found = max(search.ranked(), key=lambda h: len(h.fit.candidates))
    (first, start), *others = at_other_spots(search, found.fit, wrong, ())
    assert [c.component for c in first] == ["front_bearings"]
    assert start[first[0].amplitude] == pytest.approx(HEAT, rel=0.3)
    assert wrong.component not in {c.component for members, _ in others for c in members}
    assert len(others) < tuned.OTHER_SPOTS
    exchanged(search)
    assert search.ranked()[0].keys == {("unrecorded_heat_source", "front_bearings", None)}


def test_what_is_on_in_intervals_is_tried_in_the_same_ones_at_every_other_spot(case, heated):
    search = search_over(case, heated)
    effect = effect_of("unrecorded_heat_source")
    wrong = effect.over(case.view, "rear_bearings", [(FROM, UNTIL)])
    (lag,) = (name for name in wrong.free if name.endswith(".lag"))
    search.remember_cost(wrong, 7.0)
    moved = search.elsewhere(wrong, {lag: 345.0})
    spots = {effect.over(case.view, spot, [(FROM, UNTIL)]).form for spot in effect.places(case.view)}
    assert {v.candidate.form for v in moved} <= spots
    assert len(moved) == len(effect.places(case.view)) - 1
    for variant in moved:
        here = variant.candidate
        assert effect.intervals(here, {}) == [(FROM, UNTIL)]
        assert [v for name, v in variant.shape.items() if name.endswith(".lag")] == [345.0]
        assert search.cost_of(here) == 7.0


def test_a_loss_from_within_greased_bearings_is_less_likely_than_one_from_a_housing(case, heated):
    search = search_over(case, heated)
    prior = {
        spot: search.log_prior((effect_of("unrecorded_cooling").over(case.view, spot, [(FROM, UNTIL)]),))
        for spot in ("front_bearings", "F2", "housing")
    }
    assert prior["F2"] == prior["front_bearings"] == pytest.approx(prior["housing"] + np.log(CLOSED))


def test_heat_in_intervals_is_tried_in_the_place_of_a_law_beside_others(case, heated):
    search = search_over(case, heated)
    seat, preload = (case.candidates[key] for key in (SEAT, ("thermal_preload", "front_bearings")))
    search.found = {}
    for candidates in ((), (seat,), (preload,), (seat, preload)):
        score = 0.0 if len(candidates) == 2 else -1e4
        search.keep(Hypothesis(search.problem.fit(candidates), score))
    exchanged(search)
    heat = ("unrecorded_heat_source", "front_bearings", None)
    found = next(h for h in search.found.values() if h.keys == {(*SEAT, None), heat})
    both = next(h for h in search.found.values() if h.fit.candidates == (seat, preload))
    assert found.fit.misfit_with_prior < both.fit.misfit_with_prior


def test_what_reads_like_a_member_is_tried_in_its_place(case):
    """Radiation reads like air that carries more away; about nothing missing others promise as much."""
    sun, air = ("radiation", "housing"), ("natural_convection", "housing")
    search = search_over(case, case.diagnosis(sun, 0.9, "missing_physics", ()))
    search.found = {}
    for candidates, score in (((), -1e4), ((case.candidates[sun],), 0.0)):
        search.keep(Hypothesis(search.problem.fit(candidates), score))
    best = search.ranked()[0]
    tasks = neighbouring_sets._in_place_of(search, best.fit, case.candidates[sun], (), tuned.EXCHANGED_REACH)
    assert len(tasks) == tuned.EFFECTS_EXCHANGED
    assert identity(best.fit.candidates) not in {identity(members) for members, _ in tasks}
    exchanged(search)
    tried = {h.keys: h.fit.misfit_with_prior for h in search.found.values()}
    assert tried[frozenset({(*air, None)})] < best.fit.misfit_with_prior + tuned.NEAR_MISFIT
    # Nothing that promises far less, nor the member once more.
    assert len(tried) <= 2 + tuned.EFFECTS_EXCHANGED
    assert frozenset({("heat_split", "rear_bearings", None)}) not in tried


def test_all_that_a_lying_sensor_may_do_is_tried_in_the_place_of_what_was_found(case, heated):
    """Heat in front makes physics near the sensor promise more than what else the sensor may do."""
    search = search_over(case, heated)
    search.found = {}
    late = next(c for c in search.candidates if (c.effect, c.component) == ("clock_shift", "SP02"))
    for candidates in ((), (late,)):
        search.keep(Hypothesis(search.problem.fit(candidates), -1e3 * (not candidates)))
    exchanged(search)
    tried = {identity(h.fit.candidates) for h in search.found.values()}
    lies = [c for c in search.candidates if c.component == "SP02" and c.kind == "sensor"]
    own = {identity((c,)) for c in lies if c is not late}
    assert len(own) > tuned.EFFECTS_EXCHANGED
    assert own <= tried


@pytest.mark.parametrize(("law", "other"), [("clock_shift", "sensor_lag"), ("sensor_lag", "clock_shift")])
def test_a_late_channel_is_tried_as_late_by_the_other_law_from_the_same_delay(case, heated, law, other):
    """Known from a fit that ended far off, it is fitted again."""

    class Noting(Search):
        def fit_all(self, tasks, **how):
            begun.append((tasks, how))

    begun = []
    search = search_over(case, heated, Noting)
    late = {
        name: next(c for c in search.candidates if (c.effect, c.component) == (name, "SP02"))
        for name in (law, other)
    }
    search.found = {}
    search.keep(Hypothesis(search.problem.fit(), -1e3))
    chosen = search.problem.fit((late[law],), {late[law].amplitude: 90.0}, iterations=0)
    search.keep(Hypothesis(chosen, 0.0))
    search.keep(
        Hypothesis(search.problem.fit((late[other],), {late[other].amplitude: 9.0}, iterations=0), -1e3)
    )
    exchanged(search)
    ((members, start),), how = begun[0]
    assert members == (late[other],)
    assert start[late[other].amplitude] == 90.0
    assert how["anew"]


def test_a_channel_that_is_early_is_not_tried_as_a_slow_sensor(case, heated):
    search = search_over(case, heated)
    clock = next(c for c in search.candidates if (c.effect, c.component) == ("clock_shift", "SP02"))
    early = search.problem.fit((clock,), {clock.amplitude: -90.0}, iterations=0)
    assert neighbouring_sets._as_late(search, early, clock, ()) == []


def test_places_of_one_combination_hide_no_other_nor_bearings_of_a_set_another_place():
    def at(effect, place):
        own = SimpleNamespace(effect=effect, component=place, meets=lambda other: True)
        return SimpleNamespace(fit=SimpleNamespace(candidates=(own,), named=(own,)))

    few, alike = tuned.REFITTED_OF_EACH, tuned.REFITTED_ALIKE
    assert alike < few
    places = [f"place {number}" for number in range(few + 2)]
    ranked = [at("seal_friction", place) for place in places] + [at("windage", "shaft")]
    assert few_of_each(ranked, {}) == [*ranked[:few], ranked[-1]]
    # Of the first ones, which count as one place, one too many gives way to the next place.
    one = frozenset(places[: alike + 1])
    kept = few_of_each(ranked, dict.fromkeys(one, one))
    assert kept == [*ranked[:alike], *ranked[alike + 1 : few + 1], ranked[-1]]


def test_intervals_are_sought_again_where_they_are_others(case, heated):
    search = search_over(case, heated)
    problem = search.problem
    search.found = {}
    search.keep(Hypothesis(problem.fit(), -1.0))
    late, right = (
        effect_of("unrecorded_heat_source").over(case.view, "front_bearings", [span])
        for span in ((0.5 * (FROM + UNTIL), UNTIL), (FROM, UNTIL))
    )
    fit = problem.fit((late,), iterations=0)
    ((members, start),) = sought_again(search, [(fit, late)])
    ((began, ended),) = effect_of("unrecorded_heat_source").intervals(members[0], start)
    assert (began, ended) == (pytest.approx(FROM, abs=900.0), pytest.approx(UNTIL, abs=900.0))
    # Fitted from there although it is known, and kept because it ends better.
    search.keep(Hypothesis(fit, -1.0))
    search.fit_all([(members, start)], anew=True)
    assert search.ranked()[0].fit.misfit_with_prior < fit.misfit_with_prior
    assert sought_again(search, [(problem.fit((right,)), right)]) == []


def test_a_loss_is_extended_beside_the_heat_that_it_reads_like(case, heated):
    search = search_over(case, heated)
    heat, law = heated.hypotheses[:2]
    loss = effect_of("unrecorded_cooling").over(case.view, "housing", [(0.0, FROM)])
    loss = Hypothesis(search.problem.fit((loss,), iterations=0), -1.0)
    assert search_course.to_extend(search, [heat, law, loss], 1) == [heat, loss, law]
    assert search_course.to_extend(search, [law, heat, loss], 1) == [law]


def test_laws_are_extended_beside_a_way_out(case, heated):
    search = search_over(case, heated)
    out, law = heated.hypotheses[:2]
    assert search_course.to_extend(search, [out, law], 1) == [out, law]
    assert search_course.to_extend(search, [law, out], 1) == [law]


class Tabled(Search):
    """A search whose fits have the evidence of a table."""

    def fit_all(self, tasks, again=False):
        for candidates, values in tasks:
            keys = frozenset((c.effect, c.component) for c in candidates)
            fit = SimpleNamespace(
                candidates=candidates, values=values, keys=keys, log_evidence=EVIDENCE.get(keys, -1e3)
            )
            self.keep(Hypothesis(fit, 0.0))


def test_what_a_single_bearing_needed_beside_it_is_left_out_beside_its_set(case, heated, monkeypatch):
    monkeypatch.setattr(search_course, "exchanged", lambda search: None)
    search = search_over(case, heated, Tabled)
    search.found = {}
    for keys in ((DRY_BEARING, LOOSE), (DRY_BEARING, LOOSE, SEAT)):
        search.fit_all([(tuple(case.candidates[key] for key in keys), {})])
    search_course.improve(search)
    assert search.ranked()[0].keys == {DRY_SET, LOOSE}


def test_one_heat_at_two_spots_is_one_finding_that_names_both(case, heated):
    search = search_over(case, heated)
    following = {c.component: c for c in search.candidates if followed_name(c)}
    nose, shaft = following["nose"], following["shaft"]
    start = {nose.amplitude: 20.0, shaft.amplitude: 60.0}
    fit = search.problem.fit((nose, shaft), start, iterations=0)
    (told,) = findings_of(heated, Ranked(Hypothesis(fit, -1.0), 0.8), split=True)
    assert (told["component"], told["probability"]) == ("shaft", 0.8)
    assert told["statement"].endswith("It enters at the nose as well.")


def test_a_clock_far_off_is_fitted_from_about_as_far_off(case):
    """Twenty minutes early about a start: to first order readings seem half a minute late, if anything."""
    early = ("clock_shift", "SP03")
    search = search_over(case, case.diagnosis(early, -1200.0, "sensor", ()))
    search.found = {}
    search.keep(Hypothesis(search.problem.fit(), -1.0))
    null = search.found[identity(())].fit
    screened, intervals = search.screened(null, only_laws=True)
    ((members, _),) = screened.best(1, 1)
    assert screened.variants[members[0]].key == early
    search.extend(null, screened, intervals, 1, 1, always=1)
    found = search.ranked()[0].fit
    (candidate,) = found.candidates
    assert found.values[candidate.amplitude] == pytest.approx(-1200.0, abs=20.0)
    assert found.reduced_misfit < 1.1
