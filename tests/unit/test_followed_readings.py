"""What sets say of all readings, those that were held out included: on the lumped spindle."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.diagnosis_content import _by_what_is_told
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW
from spindle_fem.inference.set_problems import SetProblems
from spindle_fem.inference.worker_processes import Workers
from tests.support.diagnosed_spindle import FROM, HEAT, UNTIL, Case


@pytest.fixture(scope="module")
def problem_and_fits(tmp_path_factory):
    """Fits of a heat that ends too early within the held-out readings, and of nothing missing."""
    case = Case(tmp_path_factory.mktemp("followed"))
    heated = case.diagnosis(("unrecorded_heat_source", "front_bearings"), HEAT, "missing_physics", ())
    seen = heated.predictor.observations
    problem = Problem(heated.predictor, heated.calibrated.belief, EXPECTED_SLOW, seen)
    early = effect_of("unrecorded_heat_source").over(case.view, "front_bearings", [(FROM, 4600.0)])
    # Enough of them that every process has some.
    cut_short = [problem.fit((early,), {early.amplitude: HEAT}, iterations=0) for _ in range(6)]
    return problem, [*cut_short, heated.final, problem.fit()]


@pytest.mark.parametrize("number", [1, 2])
def test_sets_worked_out_side_by_side_say_what_each_says_alone(problem_and_fits, number):
    problem, fits = problem_and_fits
    problems = SetProblems(problem, problem)
    alone, together = FollowedReadings(problems), FollowedReadings(problems)
    together.work_out(fits, Workers(number))
    for fit in fits:
        assert together.heldout_misfit(fit) == pytest.approx(alone.heldout_misfit(fit), rel=1e-9)
        assert together.beyond(fit) == pytest.approx(alone.beyond(fit), rel=1e-9)
        for (_, one), (_, other) in zip(together.residuals(fit), alone.residuals(fit), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-9)
        # Whoever compares members of sets compares objects.
        followed = together.followed(fit).fit
        assert all(a is b for a, b in zip(followed.candidates, fit.candidates, strict=True))


def test_a_moment_within_held_out_readings_follows_them(problem_and_fits):
    problem, (early, *_) = problem_and_fits
    followed = FollowedReadings(SetProblems(problem, problem)).followed(early).fit
    ((_, ended),) = effect_of("unrecorded_heat_source").intervals(early.candidates[0], followed.values)
    assert 4900.0 < ended <= 5000.0 < UNTIL


@pytest.mark.parametrize(
    ("error", "beyond", "kept"), [(1.01, 1.01, False), (1.01, 0.99, True), (0.99, 1.01, True)]
)
def test_a_set_that_tells_held_out_readings_worse_than_a_part_of_it_is_given_up(error, beyond, kept):
    """By the mean square, ``error`` over its limit, unless most are told better, ``beyond`` over its."""
    law, event = ("windage", "shaft"), ("unrecorded_heat_source", "body")
    part, whole, other = (
        SimpleNamespace(keys=frozenset(keys), fit=name)
        for name, keys in (("part", {law}), ("whole", {law, event}), ("other", {event}))
    )
    errors = {"part": 2.0, "whole": 2.0 * error * tuned.WORSE_HELDOUT, "other": 9.0}
    most = {"part": 1.0, "whole": beyond * (1.0 - tuned.LEAST_IMPROVEMENT), "other": 9.0}
    readings = SimpleNamespace(_heldout_error=errors.get, beyond=most.get)
    assert (whole in FollowedReadings.kept(readings, [part, whole, other])) is kept


@pytest.mark.parametrize(("left", "kept"), [(0.9, True), (1.1, False)])
def test_intervals_with_edges_of_their_own_are_followed_where_that_leaves_less(monkeypatch, left, kept):
    pulses = SimpleNamespace(amplitude="heat", free={"heat": None, "start_1": None})
    state = SimpleNamespace(amplitude="loss", free={"loss": None})
    fit = SimpleNamespace(candidates=(pulses, state))
    readings = FollowedReadings.__new__(FollowedReadings)
    readings._followed, readings._follow = {}, lambda fit: {"heat": "by all", "loss": "by all"}
    monkeypatch.setattr(FollowedReadings, "with_states", lambda self, fit, states: states)
    monkeypatch.setattr(FollowedReadings, "left_with", lambda self, states: left if "heat" in states else 1.0)
    assert ("heat" in readings.followed(fit)) is kept
    assert "loss" in readings.followed(fit)


def test_nothing_found_has_no_error_of_its_own_by_what_all_readings_tell():
    """What inputs did between held-out rows is told with nothing missing too: after is as before then."""
    nothing = SimpleNamespace(candidates=())
    diagnosis = SimpleNamespace(final=nothing, followed=SimpleNamespace(fit=SimpleNamespace()))
    assert _by_what_is_told(diagnosis) == {}
