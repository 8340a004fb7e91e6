"""What a machine may have done unseen within a gap of its recording."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.recording_gaps import about_rows_amid, hidden_in, spread_within, unseen_jumps

LAST = 24000.0


def recorded(speed, gap=(12000.0, 13200.0)):
    """A recording of a speed over the time, rows every minute but within a gap."""
    begin, end = gap
    times = np.concatenate((np.arange(0.0, begin + 1.0, 60.0), np.arange(end, LAST + 1.0, 60.0)))
    return SimpleNamespace(
        times=times,
        input_names=("speed",),
        input_at=lambda name, t: speed(np.asarray(t)),
        usual_spacing=60.0,
    )


def on_and_off(t):
    """Ten minutes at 3000 rpm, ten at rest."""
    return 3000.0 * (np.floor(t / 600.0) % 2 == 0)


def test_a_machine_that_starts_and_stops_may_have_done_so_in_a_gap():
    """A quarter of a period after its beginning half of all windows have changed, by all there is."""
    recording = recorded(on_and_off)
    assert spread_within(recording, 12240.0, 12360.0) == pytest.approx(np.sqrt(0.5), abs=0.01)
    assert spread_within(recording, 12000.0, 12000.0) == 0.0


def test_a_machine_that_runs_on_leaves_what_is_always_open():
    steady = recorded(lambda t: np.full(t.shape, 2000.0))
    assert spread_within(steady, 12240.0, 12360.0) == 0.0
    (quiet,) = hidden_in(steady, [(12240.0, 12360.0)], ["front"])
    (restless,) = hidden_in(recorded(on_and_off), [(12240.0, 12360.0)], ["front"])
    assert (quiet.sigma, restless.sigma) == (tuned.GAP_SIGMA, pytest.approx(np.sqrt(0.5), abs=0.01))


def test_windows_with_a_gap_of_their_own_and_speeds_nobody_recorded_tell_nothing():
    """A speed that changed only within one gap says nothing of what happens in the other."""
    once = recorded(lambda t: 3000.0 * (t > 12100.0))
    kept = once.times[(once.times <= 3000.0) | (once.times >= 4200.0)]
    assert spread_within(SimpleNamespace(**vars(once) | {"times": kept}), 3000.0, 3600.0) == 0.0
    unread = SimpleNamespace(times=np.arange(0.0, LAST, 60.0), input_names=(), usual_spacing=60.0)
    assert spread_within(unread, 60.0, 120.0) == 0.0


def test_only_inputs_that_are_held_change_between_rows():
    """Neither what was recorded beside them, means over steps, nor the rounding of straight lines."""
    times = 60.0 * np.arange(11.0)
    recording = SimpleNamespace(
        times=times, input_names=("speed", "ambient"), held=np.array([True, False]), usual_spacing=60.0
    )
    speed, torque = np.repeat([0.0, 40.0, 100.0], [5, 1, 4]), np.arange(10.0) ** 2
    start = np.column_stack((speed, 293.0 + np.arange(10.0), torque))
    end = np.column_stack((speed, 294.0 + np.arange(10.0) + 1e-13, torque))
    names = "speed", "ambient", "covariate.torque"
    drive = SimpleNamespace(grid=times, names=names, start=start, end=end)
    jumps = unseen_jumps(recording, drive)
    assert jumps == ((5, 0.0, 60.0), (6, 0.0, 60.0))
    assert about_rows_amid(recording, drive, jumps) == ([0], [], [1])
    start[5:, 0] = end[5:, 0] = [40.0, 0.0, 0.0, 0.0, 0.0]
    assert about_rows_amid(recording, drive, jumps) == ([], [], [])
