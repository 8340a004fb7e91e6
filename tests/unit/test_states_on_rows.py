"""Hidden states of recordings that are averaged for fits, followed on the rows of those recordings."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.framework.unrecorded import STATES, InIntervals
from spindle_fem.effects.registry import catalogue
from spindle_fem.inference import opened_machine
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.followed_states import inferred_states, states_on_rows
from spindle_fem.inference.hypothesis_search import BLUR
from spindle_fem.inference.set_problems import SetProblems
from tests.support.flawed_network import DURATION
from tests.support.searched_network import searched
from validation.score_families import overlap_score

# Heat on for 70 s and off for 50 s in turn, some minutes at a time: steps of a fit are 48 s here, rows 5 s.
SIZE, ON, PERIOD, ROW, STAMPS = 120.0, 70.0, 120.0, 5.0, 300
BEGINS = (1500.0, 5100.0, 7200.0, 10200.0)
FLICKER = [(begin + PERIOD * n, begin + PERIOD * n + ON) for begin in BEGINS for n in range(5)]


def flickers(time):
    return SIZE if any(start <= time < end for start, end in FLICKER) else 0.0


def share_on(on, times):
    """Share that is on at instants, by the parameters as they are."""

    values = {item.name: item.value for item in on.parameters}
    return on.share(SimpleNamespace(parameters=values, time=times)).real


def test_blurred_edges_give_the_means_over_steps_that_are_longer_than_intervals():
    step, span = 48.0, (4800.0, 6000.0)
    intervals = [edges for edges in FLICKER if span[0] <= edges[0] < span[1]]
    times = np.arange(*span, step)
    exact = sum(end - start for start, end in intervals)
    blurred = InIntervals(intervals, STATES, blurred=BLUR * step)
    assert step * share_on(blurred, times).sum() == pytest.approx(exact, rel=5e-3)
    # Sharp edges are counted by whole steps.
    assert step * share_on(InIntervals(intervals, STATES), times).sum() != pytest.approx(exact, rel=0.02)


def test_what_switches_within_a_step_of_the_fit_is_found_on_the_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(opened_machine, "MOST_STAMPS", STAMPS)
    machine, search = searched(tmp_path, np.arange(0.0, DURATION + 1.0, ROW), flickers)
    problem, fit = search.problem, search.ranked()[0].fit
    (name,) = (c.amplitude for c in fit.candidates)
    states = {"steps": inferred_states(search, problem, fit)}
    states["rows"] = states_on_rows(search, problem, fit, machine.rows, ())
    effect = catalogue()[fit.candidates[0].effect]
    score = {
        key: overlap_score(FLICKER, effect.intervals(found[name].candidate, {}))
        for key, found in states.items()
    }
    assert score["steps"] < 0.9
    assert score["rows"] > 0.97
    # On the steps of the fit, the same state has the size that it has.
    readings = FollowedReadings(SetProblems(problem, problem))
    followed = readings.with_states(fit, states["rows"])
    assert readings.left_with(followed) < 0.8 * readings.left_with(readings.with_states(fit, states["steps"]))
    (candidate,) = followed.fit.candidates
    assert effect.report(candidate, followed.fit.values)["heat"].value == pytest.approx(SIZE, rel=0.1)
