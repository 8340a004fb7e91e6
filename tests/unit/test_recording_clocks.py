"""Temperatures that a logger stamps late are read on the clock of the inputs."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.findings import at_stamps
from spindle_fem.inference.followed_states import _held_out
from spindle_fem.inference.hidden_states import readings_about
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.misdescription import EVERY_CHANNEL
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.misdescription_content import _late_already
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, calibrate
from spindle_fem.inference.recording_clocks import LEAST_LATE, on_clock_of_inputs, restamped
from spindle_fem.inference.unseen_moments import unread_changes
from tests.support.diagnosed_spindle import TIMES, written

QUIET = 0.02


def read_late(case, seconds):
    """A predictor on readings stamped so much later than inputs, open to delays, and its problem."""
    plain = Predictor(case.fast, [case.blank])
    true, grid = plain.predict(0, {}).temperature, plain.drives[0].grid
    stamped = np.array([np.interp(TIMES - seconds, grid, column) for column in true.T]).T
    noise = np.random.default_rng(3).normal(0.0, QUIET, stamped.shape)
    seen = Predictor(case.fast, [written(case.folder, stamped - 273.15 + noise)])
    directions = [item for item in misdescriptions_of(seen) if item.delays]
    predictor = with_misdescriptions(seen, directions)
    belief = calibrate(None, predictor).known
    return predictor, Problem(predictor, belief, replace(EXPECTED_SLOW, sigma=QUIET), predictor.observations)


def clock_of(predictor, fit):
    (clock,) = [item for item in predictor.misdescribed if item.delays == EVERY_CHANNEL]
    return fit.values[clock.coordinate] + _late_already(predictor, clock)


@pytest.mark.parametrize("seconds", [45.0, -45.0])
def test_what_a_clock_is_off_is_found_whole_and_leaves_nothing(case, seconds):
    predictor, problem = read_late(case, seconds)
    first = problem.fit()
    moved, about, fit = on_clock_of_inputs(predictor, problem, first, predictor.misdescribed)
    # What each of six channels may be late by itself leaves 4 s of it open.
    assert clock_of(moved, fit) == pytest.approx(seconds, abs=8.0)
    assert abs(moved.late[0] - seconds) < LEAST_LATE + 8.0
    assert about.predictor.late == moved.late
    _, on_time = read_late(case, 0.0)
    left = on_time.fit().misfit
    assert fit.misfit < 1.2 * left
    assert first.misfit > 1.4 * left


def test_a_clock_that_is_hardly_off_stays_a_number_of_the_fit(case):
    predictor, problem = read_late(case, 5.0)
    moved, _, fit = on_clock_of_inputs(predictor, problem, problem.fit(), predictor.misdescribed)
    assert not moved.late.any()
    assert clock_of(moved, fit) == pytest.approx(5.0, abs=3.0)


def test_a_fit_that_leaves_much_tells_no_clock(case):
    predictor, problem = read_late(case, 45.0)
    fit = problem.fit()
    for misfit, told in ((0.9, True), (1.1, False)):
        left = replace(fit, misfit=misfit * tuned.DISTORTED**2 * len(fit.residual))
        moved, values = restamped(predictor, left)
        assert (moved is not predictor) is told
        assert (values != left.values) is told


def test_putting_a_clock_right_leaves_what_each_channel_is_late_in_all(case):
    """What channels share goes into the stamps, and is taken off where the next fit begins."""
    predictor, problem = read_late(case, 45.0)
    fit = problem.fit()
    moved, values = restamped(predictor, fit)
    clock, *own = [item.coordinate for item in predictor.misdescribed if item.delays][::-1]
    shared = np.median([*(fit.values[name] for name in own), 0.0])
    assert abs(shared) > 0.5
    assert moved.late[0] == pytest.approx(fit.values[clock] + shared)
    assert moved.late[0] + values[clock] == pytest.approx(fit.values[clock])
    assert all(values[name] == fit.values[name] for name in own)


def test_what_looks_at_single_readings_has_them_on_the_clock_of_the_inputs(case):
    predictor, problem = read_late(case, 90.0)
    moved, about, fit = on_clock_of_inputs(predictor, problem, problem.fit(), predictor.misdescribed)
    left = readings_about(about, fit, 0, everything=True).residual
    assert np.sqrt(np.nanmean(left**2)) < 1.5 * QUIET
    # Held-out stretches, by which moments and courses are followed, are those of the readings.
    held = (TIMES > 4000.0) & (TIMES < 5000.0)
    moved.use = (~held,)
    unread, inside = [], [(float(a), float(b)) for a, b in stretches(held, moved.stamps(0))]
    moved.unread_within = lambda number, spans, values: unread.append(spans) or {}
    unread_changes(moved, fit)
    assert unread == [inside]
    middle = 0.5 * (moved.drives[0].grid[1:] + moved.drives[0].grid[:-1])
    np.testing.assert_array_equal(_held_out(moved, 0), (middle > inside[0][0]) & (middle < inside[0][1]))


def test_readings_are_told_on_their_own_stamps(case):
    predictor, _ = read_late(case, 45.0)
    moved = predictor.on_clocks(np.array([45.0]))
    on_grid = predictor.predict(0, {}).temperature
    early, late = at_stamps(predictor, 0, on_grid), at_stamps(moved, 0, on_grid)
    again = np.array([np.interp(TIMES - 45.0, TIMES, column) for column in early.T]).T
    assert np.abs(late - early).max() > 0.3
    assert np.abs(late - again).max() < 0.5 * np.abs(late - early).max()
    assert moved.with_model(case.fast).late == moved.late
