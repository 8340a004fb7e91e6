"""What is on in intervals of one of several recordings, beside the same kind in another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.registry import candidates_for, catalogue, effect_of, interval_effects
from spindle_fem.inference.candidate_response import Variant
from spindle_fem.inference.diagnosis import diagnose_recordings, overlapping_components
from spindle_fem.inference.findings import predictions_at_stamps
from spindle_fem.inference.followed_states import inferred_states
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.like_sets import are_alike, odds_needed
from spindle_fem.inference.opened_machine import DiagnosedMachine, open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.screening import screen
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.recordings.align import read_recording
from tests.support.diagnosed_spindle import Case, written
from tests.support.flawed_network import MACHINE, as_built, record
from tests.support.made_hypotheses import candidate, hypothesis

TIMES = np.arange(0.0, 6001.0, 60.0)
ON = ((1800.0, 3000.0), (3600.0, 4800.0))


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    """With two recordings in which the body is heated at different times."""
    folder = tmp_path_factory.mktemp("two")
    (folder / "drive.toml").write_text(MACHINE)
    runs = []
    for number, (start, end) in enumerate(ON):
        heat = lambda time, start=start, end=end: 40.0 if start <= time < end else 0.0  # noqa: E731
        run = record(folder / f"run{number}", number, built=as_built(7), times=TIMES, extra=heat)
        runs.append(read_recording(run))
    return open_machine(folder / "drive.toml", (), runs, [])


def search_of(machine, use=None):
    """A search that has not begun."""
    predictor = Predictor(machine.fast, machine.recordings, use)
    calibrated = calibrate(None, predictor)
    problem = Problem(predictor, calibrated.known, calibrated.slow, predictor.observations)
    effects = catalogue()
    weights = {name: effect.prior_weight for name, effect in effects.items()}
    return Search(problem, machine.view, effects, (), interval_effects(), weights, found={})


@pytest.fixture(scope="module")
def search(machine):
    return search_of(machine)


def heat_in(search, number, intervals=None):
    effect = search.effects["unrecorded_heat_source"]
    return search.of_recording(effect.over(search.view, "body", intervals or [ON[number]]), number, 40.0)


def test_two_of_a_kind_in_two_recordings_have_values_of_their_own(search):
    first, second = heat_in(search, 0), heat_in(search, 1)
    assert not first.parameters.keys() & second.parameters.keys()
    assert identity((first,)) != identity((second,))
    predictor = search.problem.predictor
    both = {first.amplitude: 40.0, second.amplitude: 20.0}
    for number, (own, size) in enumerate(((first, 40.0), (second, 20.0))):
        together = predictor.predict(number, both, (first, second)).temperature
        alone = predictor.predict(number, {own.amplitude: size}, (own,)).temperature
        np.testing.assert_array_equal(together, alone)
    # Neither recording is likelier than the other.
    alone = replace(search, problem=SimpleNamespace(predictor=SimpleNamespace(recordings=[None])))
    assert search.log_prior((first,)) == pytest.approx(alone.log_prior((first,)) - np.log(2.0))
    fit = search.problem.fit((first, second), both)
    assert len(fit.keys) == 2
    assert [fit.values[c.amplitude] for c in (first, second)] == pytest.approx([40.0, 40.0], rel=0.1)


def test_intervals_are_sought_in_recordings_that_have_none(search):
    first = heat_in(search, 0)
    fit = search.problem.fit((first,), {first.amplitude: 40.0})
    assert search.without_intervals(fit) == (1,)
    screened, intervals = search.screened(fit)
    assert {item.recording for item in intervals.values()} == {1}
    (best,), _ = screened.best(1, 1)[0]
    found = screened.variants[best].candidate
    assert found.key == ("unrecorded_heat_source", "body", 1)
    assert [search.holds(fit, "unrecorded_heat_source", "body", number) for number in (0, 1)] == [True, False]
    both = search.problem.fit((first, heat_in(search, 1)))
    assert search.without_intervals(both) == ()
    assert not search.screened(both)[1]


def test_one_kind_at_one_place_makes_a_pair_in_two_recordings_only(search):
    first, second = heat_in(search, 0), heat_in(search, 1)
    everywhere = search.effects["unrecorded_heat_source"].over(search.view, "body", [ON[0]])
    variants = [Variant(c, {}) for c in (first, second, heat_in(search, 0), everywhere)]
    screened = screen(search.problem, search.problem.fit(), variants, search.weights, {})
    assert {tuple(members) for members in screened._sets(2)} == {(0, 1), (1, 2)}


def test_laws_that_know_a_moment_stand_in_each_of_several_recordings(search):
    whole, each = candidates_for(search.view), candidates_for(search.view, 2)
    assert [c.amplitude for c in each[: len(whole)]] == [c.amplitude for c in whole]
    of_one = {(c.effect, c.form) for c in each[len(whole) :]}
    assert {("sensor_detached", ""), ("sensor_drift", "from a time on"), ("ambient_drift", "hump")} <= of_one
    assert not {"sensor_offset", "windage", "radiation"} & {effect for effect, _ in of_one}
    assert len({c.amplitude for c in each}) == len(each)
    off = [c for c in each if c.key[:2] == ("sensor_detached", "body") and c.form == ""]
    assert [c.recording for c in off] == [None, 0, 1]
    # It begins from abrupt departures in its own recording.
    screened, _ = replace(search, candidates=tuple(off[1:])).screened(
        search.problem.fit(iterations=0), only_laws=True
    )
    begun = [set(), set()]
    for variant in screened.variants:
        own = variant.candidate
        begun[own.recording].add(variant.shape[f"{own.reading.name}.time"])
    assert begun[0] - begun[1]
    assert len(begun[0] & begun[1]) >= 8


def test_sets_of_two_recordings_are_not_alike_and_need_no_odds_of_one_place():
    none, first, second = (replace(candidate("windage"), recording=number) for number in (None, 0, 1))
    alone, other, both, law = (
        hypothesis(*members, misfit=400.0).fit for members in ((first,), (second,), (first, second), (none,))
    )
    assert not are_alike(alone, other, {})
    assert not are_alike(alone, both, {})
    assert are_alike(alone, law, {})
    beside = hypothesis(first, candidate("radiation"), misfit=400.0).fit
    assert odds_needed(both, alone, {}) < odds_needed(beside, alone, {})


def test_pulses_of_two_recordings_may_be_one_each_by_all_readings(machine):
    """Each is followed in turn, although one pulse is no longer what switches."""
    held = (TIMES > 1500.0) & (TIMES < 5100.0)
    search = search_of(machine, [~held, ~held])
    halves = [[(start, start + 480.0), (end - 480.0, end)] for start, end in ON]
    both = [heat_in(search, number, pulses) for number, pulses in enumerate(halves)]
    fit = search.problem.fit(both, {c.amplitude: 40.0 for c in both}, iterations=0)
    states = inferred_states(search, search.problem, fit)
    effect = search.effects["unrecorded_heat_source"]
    for own, on in zip(both, ON, strict=True):
        (found,) = effect.intervals(states[own.amplitude].candidate, {})
        assert found == pytest.approx(on, abs=120.0)


@pytest.mark.slow
def test_heat_of_one_bearing_set_at_other_times_in_each_recording_of_a_spindle(tmp_path):
    """On a machine with geometry intervals are sought by screening alone."""
    case, recordings = Case(tmp_path), []
    for number, on in enumerate(((3000.0, 5000.0), (6000.0, 8000.0))):
        heat = effect_of("unrecorded_heat_source").over(case.view, "front_bearings", [on])
        predictor = Predictor(case.fast, [case.blank])
        read = predictions_at_stamps(
            predictor, SimpleNamespace(values={heat.amplitude: 200.0}, candidates=(heat,))
        )[0]
        noise = np.random.default_rng(number).normal(0.0, 0.1, read.shape)
        recordings.append(replace(written(tmp_path, read - 273.15 + noise), name=f"run{number}"))
    machine = DiagnosedMachine("lumped", case.spec, case.fast, NO_EFFECTS, case.view, tuple(recordings), ())
    found = diagnose_recordings(machine)
    assert found.judgement.verdict == "missing_physics"
    assert {(c.effect, c.recording) for c in found.final.candidates} == {
        ("unrecorded_heat_source", 0),
        ("unrecorded_heat_source", 1),
    }
    # One bearing of the set or all of it: sensors do not tell.
    front = overlapping_components(case.view)["front_bearings"]
    assert {c.component for c in found.final.candidates} <= front
