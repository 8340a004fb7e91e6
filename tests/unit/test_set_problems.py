"""What drawings leave open, about the machine with each set: on the lumped spindle."""

import copy
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.catalogue.coolant_bypass import MIXED
from spindle_fem.effects.registry import candidates_for, catalogue
from spindle_fem.errors import ConvergenceError
from spindle_fem.inference import search_course, structural_misdescriptions, tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coolant_misdescriptions import StandingCoolant
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX, GAP_PREFIX, JUMP_PREFIX
from spindle_fem.inference.heat_misdescriptions import SpeedShape
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, calibrate
from spindle_fem.inference.set_problems import SetProblems, combination_of
from spindle_fem.inference.structural_misdescriptions import StructuralChange
from spindle_fem.inference.worker_processes import Workers
from tests.support.diagnosed_spindle import Case

FRONT = ("F1", "F2", "F3")
MORE_HEAT = Misdescription("heat", "", "", 0.1, "", SpeedShape(FRONT, (0.0, 1000.0), (0.0, 1.0)))


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return Case(tmp_path_factory.mktemp("sets"))


@pytest.fixture(scope="module")
def problem(case):
    predictor = with_misdescriptions(Predictor(case.fast, [case.blank]), [MORE_HEAT])
    return Problem(predictor, calibrate(None, predictor).known, EXPECTED_SLOW, predictor.observations)


def column(problem):
    return problem.predictor.column_of(0, MORE_HEAT.coordinate)


@pytest.fixture(scope="module")
def dry(case, problem):
    """A fit of little heat in front, of which a table that is off has less as well."""
    starved = case.candidates["heat_scale", "front_bearings"]
    values = {EFFECT_PREFIX + f.name: 0.3 for f in starved.factors}
    return problem.fit([starved], values, iterations=0)


def test_a_set_has_what_directions_do_to_its_own_machine(problem, dry):
    problems = SetProblems(problem, problem).about([problem.fit(iterations=0), dry], Workers())
    own = with_misdescriptions(problem.predictor, [MORE_HEAT], dry.values, dry.candidates)
    np.testing.assert_array_equal(
        column(problems.of(dry)), column(Problem(own, problem.belief, problem.slow, own.observations))
    )
    # Three tenths of the heat: as much less of what a table does.
    assert np.abs(column(problems.of(dry))).max() < 0.5 * np.abs(column(problem)).max()
    assert problems.of(problem.fit(iterations=0)) is problem
    assert problems.about([dry], Workers()).own == problems.own


def test_a_set_that_cannot_be_simulated_has_what_the_first_has(monkeypatch, problem, dry):
    def fails(*ignored):
        raise ConvergenceError("the set", "no steady state")

    monkeypatch.setattr("spindle_fem.inference.set_problems.columns_about", fails)
    problems = SetProblems(problem, problem).about([dry], Workers())
    assert problems.of(dry) is problem
    assert combination_of(dry) not in problems.own


def test_coolant_that_stood_before_the_sensor_is_read_whole_behind_a_bypass(case):
    """What the channel does later is mixed with what passed it by."""
    bypass = next(c for c in candidates_for(case.view) if c.effect == "coolant_bypass" and c.form == MIXED)
    values = {bypass.amplitude: 0.9}
    stood = Misdescription("stood", "", "K", 3.0, "", StandingCoolant("COOLANT_OUT", 100.0), of_sensor=True)
    predictor = with_misdescriptions(Predictor(case.fast, [case.blank]), [stood, MORE_HEAT], values, [bypass])
    names = [stood.coordinate, MORE_HEAT.coordinate]
    told = predictor.predict(0, values, [bypass], names).sensitivity[:, -1]
    np.testing.assert_allclose(told[:, 0], predictor.column_of(0, names[0])[:, -1])
    np.testing.assert_allclose(told[:, 1], 0.1 * predictor.column_of(0, names[1])[:, -1], atol=1e-12)
    moved = predictor.predict(0, values | {names[0]: 2.0}, [bypass]).temperature[:, -1]
    plain = predictor.predict(0, values, [bypass]).temperature[:, -1]
    np.testing.assert_allclose(moved - plain, 2.0 * told[:, 0], atol=1e-9)


def test_a_channel_has_one_delay_only(case, problem):
    """Beside a clock that is off its sensor's own delay does nothing; those of other sensors do."""
    responses = [d for d in misdescriptions_of(problem.predictor) if d.delays in ("SP01", "SP02")]
    late = {place: case.candidates["clock_shift", place] for place in ("SP01", "SP02")}
    assert len(responses) == 2
    plain = with_misdescriptions(problem.predictor, responses)
    assert all(plain.column_of(0, d.coordinate) is not None for d in responses)
    values = {late["SP02"].amplitude: 60.0}
    about = with_misdescriptions(problem.predictor, responses, values, [late["SP02"]])
    assert {d.delays for d in responses if about.column_of(0, d.coordinate) is None} == {"SP02"}
    # So it is where a search uses what delays do of a machine without any.
    delays = {d.coordinate: 20.0 for d in responses}
    late_too, alone = (plain.predict(0, values | more, [late["SP02"]]).temperature for more in (delays, {}))
    changed = np.abs(late_too - alone).max(axis=0)
    changed = dict(zip(case.blank.temperature_names, changed, strict=False))
    assert changed["SP02"] == 0.0 < changed["SP01"]
    fits = [problem.fit([one], {one.amplitude: 60.0}, iterations=0) for one in late.values()]
    assert combination_of(fits[0]) != combination_of(fits[1])


def test_a_bypass_mixes_in_the_inlet_as_a_chiller_leaves_it(case):
    """What the outlet reads behind a bypass of 0.6 has 0.6 of the swing, which no recorded input has."""
    found = {(c.effect, c.form): c for c in candidates_for(case.view)}
    bypass, chiller = found["coolant_bypass", MIXED], found["chiller_cycling", ""]
    before_joint = found["coolant_bypass", ""]
    own, names = Predictor(case.fast, [case.blank]), [bypass.amplitude, chiller.amplitude]
    swing = {chiller.amplitude: 1.5}
    recorded, inlet = (own.at_places(0, v, [chiller]).inlet for v in ({chiller.amplitude: 0.0}, swing))
    assert np.abs(inlet - recorded).max() == pytest.approx(1.5, rel=0.05)
    values, alone = swing | {bypass.amplitude: 0.6}, swing | {before_joint.amplitude: 0.6}
    told = own.predict(0, values, [bypass, chiller], names)
    past = own.predict(0, alone, [before_joint, chiller]).temperature[:, -1]
    np.testing.assert_allclose(told.temperature[:, -1], 0.4 * past + 0.6 * inlet, atol=1e-9)
    for column, name in enumerate(names):
        ends = [
            own.predict(0, values | {name: values[name] + step}, [bypass, chiller]).temperature[:, -1]
            for step in (1e-4, -1e-4)
        ]
        slope = (ends[0] - ends[1]) / 2e-4
        np.testing.assert_allclose(told.sensitivity[:, -1, column], slope, atol=1e-4)


@pytest.mark.parametrize(("effect", "at", "amount"), [("sensor_gain", "SP02", 3.0), (MIXED, "", 0.9)])
def test_what_faces_do_passes_once_through_what_a_sensor_reads(case, monkeypatch, effect, at, amount):
    """A parameter of the machine stands for a moved face: both are derivatives of the run."""
    lying = next(
        c
        for c in candidates_for(case.view)
        if (c.effect, c.component) == (effect, at) or (effect == MIXED and c.form == MIXED)
    )
    own = Predictor(case.fast, [case.blank])
    moved = copy.copy(case.fast)
    moved.structural = [SimpleNamespace(name=own.uncertain()[0].name)]
    monkeypatch.setattr(structural_misdescriptions, "model_with_directions", lambda fast: moved)
    values, face = {lying.amplitude: amount}, moved.structural[0].name
    direction = Misdescription("face", "", "", 1.0, "", StructuralChange(face))
    about = with_misdescriptions(own, [direction], values, [lying])
    found = about.predict(0, values, [lying], [direction.coordinate, face]).sensitivity
    assert np.abs(found[:, :, 1]).max(axis=0).min() > 0.0
    np.testing.assert_allclose(found[:, :, 0], found[:, :, 1], atol=1e-9)


def test_what_rows_and_gaps_leave_open_is_not_worked_out_for_moved_faces(case, monkeypatch):
    """It moves readings to first order: a run of its own for each would change no derivative."""
    own, asked = Predictor(case.fast, [case.blank]), []
    moved, name = copy.copy(case.fast), own.uncertain()[0].name
    moved.structural = [SimpleNamespace(name=name)]
    monkeypatch.setattr(structural_misdescriptions, "model_with_directions", lambda fast: moved)
    plain = Predictor.at_places
    monkeypatch.setattr(
        Predictor,
        "at_places",
        lambda self, number, values, *rest: asked.append(values) or plain(self, number, values, *rest),
    )
    base = BaseRun(own, 0, {JUMP_PREFIX + "0.0": 0.3, GAP_PREFIX + "0.0": 1.0, name: 1.1})
    found = structural_misdescriptions.structural_columns(base)
    assert asked == [{name: 1.1}]
    assert np.abs(found[name]).max() > 0.0


@pytest.mark.parametrize(
    ("seconds", "tried"),
    [(1.1, {"clock_shift", "sensor_lag"}), (-1.1, {"clock_shift"}), (0.9, set())],
)
def test_a_large_delay_of_a_sensor_is_tried_as_its_effects(case, seconds, tried):
    """Of ``SP02`` alone; that it is early makes nobody late where no other delay is open."""
    plain = Predictor(case.fast, [case.blank])
    late = next(i for i in misdescriptions_of(plain) if i.name == "response.SP02")
    predictor = with_misdescriptions(plain, [late])
    problem = Problem(predictor, calibrate(None, predictor).known, EXPECTED_SLOW, predictor.observations)
    value = seconds * tuned.FAR_OFF * late.sigma
    null = problem.fit((), {late.coordinate: value}, iterations=0)

    search = SimpleNamespace(problem=problem, candidates=candidates_for(case.view), effects=catalogue())
    search.delaying = partial(Search.delaying, search)
    search.found = {identity(()): SimpleNamespace(fit=null)}
    tasks = search_course._far_off(search, null)
    assert {members[0].effect for members, _ in tasks} == tried
    for (member,), start in tasks:
        assert member.component == "SP02"
        assert start[member.amplitude] == pytest.approx(value)
        assert start[late.coordinate] == 0.0
    # Beside a set likewise, but for an effect that it holds.
    beside = next(c for c in search.candidates if (c.effect, c.component) == ("clock_shift", "SP01"))
    for held in ((beside,), (beside, *(members[0] for members, _ in tasks))):
        fit = problem.fit(held, {late.coordinate: value}, iterations=0)
        fit.position[[c.name for c in fit.coordinates].index(late.coordinate)] = value / late.sigma
        found = search_course._far_off(search, fit)
        assert all(members[:-1] == held for members, _ in found)
        assert {members[-1].effect for members, _ in found} == (tried if held == (beside,) else set())
    # Those that lowered nothing beside nothing missing are not tried again.
    for members, _ in tasks:
        search.found[identity(members)] = SimpleNamespace(fit=null)
    fit = problem.fit((beside,), {late.coordinate: value}, iterations=0)
    fit.position[[c.name for c in fit.coordinates].index(late.coordinate)] = value / late.sigma
    assert search_course._far_off(search, fit) == []


@pytest.mark.parametrize(("way", "tried"), [(-1.0, {"SP01", "SP02"}), (1.0, {"SP02"})])
def test_where_a_channel_seems_early_another_is_tried_as_late(case, way, tried):
    plain = Predictor(case.fast, [case.blank])
    delays = [i for i in misdescriptions_of(plain) if i.name in ("response.SP01", "response.SP02")]
    predictor = with_misdescriptions(plain, delays)
    problem = Problem(predictor, calibrate(None, predictor).known, EXPECTED_SLOW, predictor.observations)
    seconds = {"SP01": 3.0, "SP02": way * 1.1 * tuned.FAR_OFF * tuned.RESPONSE_SIGMA}
    null = problem.fit((), {i.coordinate: seconds[i.delays] for i in delays}, iterations=0)
    search = SimpleNamespace(problem=problem, candidates=candidates_for(case.view), effects=catalogue())
    search.delaying = partial(Search.delaying, search)
    search.found = {identity(()): SimpleNamespace(fit=null)}
    tasks = search_course._far_off(search, null)
    assert {member.component for (member,), _ in tasks} == tried
    for (member,), start in tasks:
        if member.component == "SP01":
            # By as much as lies between both, and the other one on time.
            assert start[member.amplitude] == pytest.approx(3.0 - seconds["SP02"])
            assert [start[i.coordinate] for i in delays] == [0.0, 0.0]
