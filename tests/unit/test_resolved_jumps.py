"""Short steps where inputs jump: where they are, that inputs stay as they were, and that they suffice."""

import numpy as np
import pytest

from spindle_fem.model.reduced import resolved_jumps
from spindle_fem.model.reduced.drive import STANDARD, inputs_at, make_drive
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.resolved_jumps import shorter_steps, with_resolved_jumps

HELD = np.array([True, True, False, False, True])
MINUTES = np.arange(0.0, 3601.0, 60.0)
SIZE = 200  # unknowns of a fast model


def drive_of(speed, inlet=288.15, held=HELD):
    columns = [speed, 1750.0, 293.15, inlet, 3.3e-4]
    values = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), MINUTES.shape) for c in columns])
    return make_drive(MINUTES, STANDARD, values, held)


def divided(drive, found):
    """Minutes whose steps became shorter."""
    return [n for n in range(len(drive.steps)) if np.sum(np.floor(found.grid[:-1] / 60.0) == n) > 1]


def test_steps_are_short_after_the_start_and_after_jumps_and_grow_with_the_time_since():
    speed = np.where(MINUTES < 1200.0, 100.0, 300.0)
    drive = drive_of(speed)
    found = with_resolved_jumps(drive, SIZE)
    assert divided(drive, found) == [0, 1, 20, 21]
    assert np.isin(MINUTES, found.grid).all()
    for jump in (0.0, 1200.0):
        after = found.grid[:-1] - jump
        own = (after >= 0.0) & (after < 600.0)
        allowed = np.clip(after[own] * resolved_jumps.GROWTH, resolved_jumps.FIRST, 60.0)
        assert (found.steps[own] <= allowed + 1e-9).all()
    # no sliver: every step is at least half the one before, or begins anew
    assert (found.steps[1:] >= 0.5 * found.steps[:-1] - 1e-9).sum() >= len(found.steps) - 2


def test_inputs_are_what_they_were_at_all_times():
    drive = drive_of(np.where(MINUTES < 1200.0, 0.0, 300.0), inlet=288.15 + np.sin(MINUTES))
    found = with_resolved_jumps(drive, SIZE)
    # just after each time, and so never across a jump
    times = np.linspace(0.0, 3599.0, 5000)
    meant, now = inputs_at(drive, times), inputs_at(found, times)
    for name in STANDARD:
        np.testing.assert_allclose(now[name], meant[name], rtol=1e-12)
    assert found.times is drive.times
    # readings have the inputs of their own moment
    read = [found.points[number].speed for number in found.read_class]
    column = found.column("speed")
    np.testing.assert_allclose(read, [*found.start[:, column], found.end[-1, column]], atol=0.1)


@pytest.mark.parametrize(
    ("speed", "inlet"),
    [(300.0 + 2.0 * (MINUTES > 1200.0), 288.15), (300.0, 288.15 + 0.1 * (MINUTES > 1200.0))],
)
def test_what_does_not_matter_divides_nothing(speed, inlet):
    drive = drive_of(speed, inlet)
    assert divided(drive, with_resolved_jumps(drive, SIZE)) == [0, 1]


def test_a_steep_change_has_steps_within_which_heat_is_nearly_straight():
    drive = drive_of(np.where(MINUTES < 1200.0, 0.0, 300.0), held=np.zeros(5, dtype=bool))
    found = with_resolved_jumps(drive, SIZE)
    column = found.column("speed")
    changed = np.abs(found.end[:, column] - found.start[:, column])
    assert changed.max() <= 30.0 + 1e-9
    # bends at both ends of the minute in which the speed goes up
    assert divided(drive, found) == [0, 1, 19, 20, 21]


def test_jumps_without_end_have_longer_steps_then_only_larger_ones_count_and_it_says_so():
    rng = np.random.default_rng(3)
    loud = drive_of(200.0 + 100.0 * rng.random(MINUTES.size))
    assert with_resolved_jumps(loud, 100).notes == loud.notes
    counts = []
    for size, words in ((300, "times as long"), (2000, "changes of less than")):
        found = with_resolved_jumps(loud, size)
        assert words in found.notes[-1]
        counts.append(len(found.steps))
        times = np.linspace(0.0, 3599.0, 1000)
        np.testing.assert_allclose(inputs_at(found, times)["speed"], inputs_at(loud, times)["speed"])
    assert len(with_resolved_jumps(loud, 100).steps) > counts[0] > counts[1]


@pytest.mark.parametrize("rate", [0.02, 0.1, 0.5])
def test_a_mode_that_jumps_is_followed_within_three_thousandths(rate):
    # one mode, u' = 1 - rate u from 0, by the scheme of the runs
    gamma = 2.0 - np.sqrt(2.0)
    steps = [*shorter_steps(60.0, 0.0, 60.0), *shorter_steps(60.0, 60.0, 60.0)]

    def march(lengths):
        u = 0.0
        for h in lengths:
            d = 0.5 * gamma * h
            middle = (u + d * (2.0 - rate * u)) / (1.0 + d * rate)
            w = h * np.sqrt(2.0) / 4.0
            u = (u + w * (2.0 - rate * (u + middle)) + d) / (1.0 + d * rate)
        return u

    exact = (1.0 - np.exp(-120.0 * rate)) / rate
    assert march(steps) == pytest.approx(exact, rel=3e-3)
    if rate == 0.1:
        # a first minute in one step is what this is about
        assert abs(march([60.0]) * rate - (1.0 - np.exp(-6.0))) > 0.05


@pytest.mark.parametrize("held", [True, False])
def test_rows_a_minute_apart_read_as_rows_a_second_apart(fast, held):
    speed = np.select([MINUTES < 300.0, MINUTES < 1200.0, MINUTES < 1800.0], [450.0, 0.0, 200.0], 450.0)
    rows = drive_of(speed, held=np.array([held, True, False, False, True]))
    seconds = np.arange(0.0, 3601.0, 1.0)
    values = np.column_stack([inputs_at(rows, seconds)[name] for name in STANDARD])
    # just after each second, as the rows have it, and straight between seconds
    fine = make_drive(seconds, STANDARD, values, np.array([held, True, False, False, True]))
    meant = simulate_fast(fast, fine, 293.15).temperature[::60]
    found = simulate_fast(fast, with_resolved_jumps(rows, SIZE), 293.15).temperature
    coarse = simulate_fast(fast, rows, 293.15).temperature
    assert np.abs(found - meant).max() < 5e-3
    assert np.abs(coarse - meant).max() > 0.05
