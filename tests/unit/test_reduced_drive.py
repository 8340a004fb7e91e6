"""Inputs over time: steps, classes, heat by table."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import RecordingError
from spindle_fem.model.reduced.drive import (
    FITTED,
    PREDICTED,
    STANDARD,
    WALL_BIN,
    inputs_at,
    make_drive,
    with_walls,
)
from spindle_fem.operation.bearing_heat import heat_of_table, table_heat
from spindle_fem.operation.operating_point import OperatingPoint

HELD = np.array([True, True, False, False, True])


def inputs(times, speed, ambient=293.15, inlet=288.15, flow=3.3e-4):
    columns = [speed, 1750.0, ambient, inlet, flow]
    return np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])


def test_long_gaps_are_divided_and_every_stamp_is_a_step_end():
    times = np.array([0.0, 10.0, 20.0, 320.0, 330.0])
    drive = make_drive(times, STANDARD, inputs(times, 100.0), HELD, largest_step=60.0)
    assert np.isin(times, drive.grid).all()
    assert drive.steps.max() <= 60.0
    assert len(drive.steps) == 3 + 5


def test_held_inputs_jump_and_the_others_run_straight():
    times = np.array([0.0, 100.0, 200.0])
    values = inputs(times, [0.0, 300.0, 300.0], ambient=[290.0, 292.0, 291.0])
    drive = make_drive(times, STANDARD, values, HELD, largest_step=50.0)
    speed, ambient = drive.column("speed"), drive.column("ambient")
    assert drive.start[:, speed].tolist() == drive.end[:, speed].tolist() == [0.0, 0.0, 300.0, 300.0]
    assert drive.start[:, ambient].tolist() == [290.0, 291.0, 292.0, 291.5]
    assert drive.end[:, ambient].tolist() == [291.0, 292.0, 291.5, 291.0]
    assert inputs_at(drive, np.array([75.0]))["ambient"] == pytest.approx(291.5)


def test_operating_points_that_hardly_differ_share_a_class_and_standstill_is_one_of_its_own():
    times = np.arange(7) * 10.0
    speed = np.array([0.0, 0.0, 314.0, 314.005, 314.0, 0.3, 0.3])
    drive = make_drive(times, STANDARD, inputs(times, speed), HELD)
    assert 0.005 < PREDICTED.speed * 314.0 < FITTED.speed * 314.0
    assert drive.step_class.tolist()[0] == drive.step_class.tolist()[1]
    assert len({int(c) for c in drive.step_class}) == 3
    assert drive.points[drive.step_class[0]].speed == 0.0
    assert drive.points[drive.step_class[2]].speed == pytest.approx(314.0 + 0.005 / 3, abs=1e-6)


def test_readings_have_the_class_of_their_moment_where_that_is_asked():
    times = np.array([0.0, 100.0, 200.0])
    values = inputs(times, [100.0, 200.0, 200.0], inlet=[288.0, 289.0, 290.0])
    drive = make_drive(times, STANDARD, values, HELD, largest_step=100.0)
    read = [drive.points[number] for number in drive.read_class]
    # speed as it is just after, the inlet as it is then and not in the middle of a step
    assert [point.speed for point in read] == [100.0, 200.0, 200.0]
    assert [point.coolant_inlet_temperature for point in read] == [288.0, 289.0, 290.0]
    assert [drive.points[n].coolant_inlet_temperature for n in drive.step_class] == [288.5, 289.5]
    assert make_drive(times, STANDARD, values, HELD, widths=FITTED).read_class is None


def test_a_noisy_speed_makes_no_more_classes_than_allowed():
    rng = np.random.default_rng(0)
    times = np.arange(3000) * 1.0
    drive = make_drive(times, STANDARD, inputs(times, 300.0 * rng.random(3000)), HELD)
    assert len(drive.points) <= PREDICTED.most


def test_jittering_stamps_get_equal_steps_between_changes_of_held_inputs():
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(8.0, 12.0, 1000))
    speed = np.where(times < 5000.0, 100.0, 200.0)
    drive = make_drive(times, STANDARD, inputs(times, speed), HELD)
    change = times[np.argmax(speed == 200.0)]
    assert np.unique(np.round(drive.steps, 6)).size < 10
    assert np.isclose(drive.grid, change).any()
    assert drive.grid[0] == times[0]
    assert drive.grid[-1] == times[-1]
    column = drive.column("speed")
    assert (drive.start[drive.grid[:-1] < change - 1e-9, column] == 100.0).all()


def test_standard_inputs_are_required():
    times = np.array([0.0, 1.0])
    with pytest.raises(RecordingError, match=r"Allowed: .*speed"):
        make_drive(times, ("speed",), np.zeros((2, 1)), np.array([True]))


def test_heat_over_time_is_the_tables_heat_at_each_instant():
    spec = load_machine("recorded_spindle")
    speed = np.array([0.0, 10.0, 52.36, 314.2, 471.0, 520.0])
    thrust = np.array([0.0, 500.0, 1750.0, 3000.0, 100.0, 1750.0])
    found = heat_of_table(spec, speed, thrust)
    for row, (n, f) in enumerate(zip(speed, thrust, strict=True)):
        expected, _ = table_heat(spec, OperatingPoint(n, f, 293.15, 288.15, 3.3e-4))
        names = [bearing.name for _, bearing in spec.bearings]
        assert found[row].tolist() == pytest.approx([expected[name] for name in names])


def test_classes_are_divided_by_the_temperature_of_the_wall():
    times = np.arange(0.0, 1300.0, 100.0)
    drive = make_drive(times, STANDARD, inputs(times, np.where(times < 600.0, 100.0, 200.0)), HELD)
    walls = 290.0 + np.outer(drive.grid / 400.0, [0.9, 1.1])
    found = with_walls(drive, walls)
    # in the middle of steps, and where readings are
    wall = np.vstack((0.5 * (walls[:-1] + walls[1:]), walls))
    owner, divided = (np.append(item.step_class, item.read_class) for item in (drive, found))
    assert len(found.points) > len(drive.points) == 2
    for number, point in enumerate(found.points):
        rows = divided == number
        assert len(set(owner[rows])) == 1
        assert point.speed == drive.points[owner[rows][0]].speed
        assert point.channel_wall == pytest.approx(wall[rows].mean(axis=0))
        assert np.ptp(wall[rows].mean(axis=1)) <= WALL_BIN
    assert len(with_walls(drive, np.full_like(walls, 300.0)).points) == 2
