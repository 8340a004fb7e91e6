"""What a roughly drawn network leaves open: each direction against a network that is changed that way."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.inference import coarse_machine, tuned
from spindle_fem.inference.coarse_machine import Addition, TooCoarse, refined
from spindle_fem.inference.input_clocks import other_clocks, with_input_rate
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.network_misdescriptions import (
    MassBeside,
    OtherExponent,
    RoomCourse,
    TemperatureConductance,
    room_instants,
    room_modes,
)
from spindle_fem.inference.opened_machine import open_machine, with_network
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording

MACHINE = """
schema = "spindle-fem/machine/1"
name = "rig"
[[network.node]]
name = "plate"
capacity = {value = "900 J/K", sigma_rel = 0.5}
[[network.boundary]]
name = "room"
temperature = {low = "18 degC", high = "24 degC"}
[[network.link]]
between = ["plate", "room"]
conductance = {value = "2 W/K", sigma_rel = 0.5}
[[network.source]]
node = "plate"
input = "load"
gain = {value = "80 W", sigma_rel = 0.1}
reference = "100 percent"
exponent = 1.5
"""
BEHIND = """
[[network.node]]
name = "core"
capacity = "600 J/K"
[[network.link]]
between = ["plate", "core"]
conductance = "1.2 W/K"
"""
RECORDING = """
schema = "spindle-fem/recording/1"
name = "run"
data = "run.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "plate"
role = "temperature"
probe = "plate"
unit = "degC"
sigma = 0.05
[[channel]]
column = "load"
role = "input"
drives = "load"
hold = "previous"
unit = "percent"
"""
TIMES = np.arange(0.0, 9000.0, 10.0)
LOAD = np.where((TIMES // 1500.0) % 2 == 0, 80.0, 20.0)


def recorded(folder, plate, load=LOAD, times=TIMES):
    folder.mkdir(parents=True, exist_ok=True)
    table = pd.DataFrame({"time_s": times, "plate": plate, "load": load})
    table.to_csv(folder / "run.csv", index=False)
    (folder / "run.toml").write_text(RECORDING)
    return read_recording(folder / "run.toml")


def network(text=MACHINE):
    spec = validate_network_machine(tomllib.loads(text), "rig")
    return fast_network(build_network(spec.network), spec)


@pytest.fixture(scope="module")
def blank(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("blank"), np.full(TIMES.size, 21.0))


@pytest.fixture(scope="module")
def predictor(blank):
    return Predictor(network(), [blank])


def column_of(predictor, change):
    item = Misdescription("one", "", "", 1.0, "", change)
    own = with_misdescriptions(predictor, [item])
    return own.predict(0, {}, (), [item.coordinate]).sensitivity[:, 0, 0]


def told(blank, text):
    return Predictor(network(text), [blank]).predict(0, {}).temperature[:, 0]


def test_a_mass_beside_is_a_second_node_that_takes_its_share(blank, predictor):
    share, lag = 0.02, 120.0
    split = MACHINE.replace('{value = "900 J/K", sigma_rel = 0.5}', f'"{900.0 * (1.0 - share)} J/K"')
    beside = BEHIND.replace("600 J/K", f"{900.0 * share} J/K").replace(
        "1.2 W/K", f"{900.0 * share / lag} W/K"
    )
    moved = (told(blank, split + beside) - predictor.predict(0, {}).temperature[:, 0]) / share
    column = column_of(predictor, MassBeside("plate", lag))
    np.testing.assert_allclose(column, moved, atol=0.05 * np.abs(moved).max())


def test_a_mass_beside_begins_after_a_long_gap_as_a_recording_does(tmp_path):
    whole = np.concatenate((TIMES[:500], TIMES[:300] + 20000.0))
    columns = [
        column_of(
            Predictor(network(), [recorded(tmp_path / name, 21.0, 80.0 * (times >= 20000.0), times)]),
            MassBeside("plate", 300.0),
        )
        for name, times in (("whole", whole), ("second", whole[500:]))
    ]
    np.testing.assert_allclose(columns[0][500:], columns[1], atol=1e-9)
    assert np.abs(columns[1][1]) > 0.02 * np.abs(columns[1]).max()


def test_an_exponent_moves_heat_between_full_and_part_load(blank, predictor):
    more = MACHINE.replace("exponent = 1.5", "exponent = 1.51").replace("100 percent", "80 percent")
    less = MACHINE.replace("100 percent", "80 percent")
    scale = 0.8**1.5
    moved = scale * (told(blank, more) - told(blank, less)) / 0.01
    column = column_of(predictor, OtherExponent("plate.load", 1.5))
    np.testing.assert_allclose(column, moved, atol=0.02 * np.abs(moved).max())


def test_a_room_at_another_level_is_its_temperature(predictor):
    column = column_of(predictor, RoomCourse(("link.plate|room",), (0.0, 1.0e5), (1.0, 1.0)))
    by_factor = predictor.predict(0, {}, (), ["temperature.room"]).sensitivity[:, 0, 0]
    np.testing.assert_allclose(column, by_factor / (273.15 + np.sqrt(18.0 * 24.0)), rtol=0.02, atol=1e-4)


def test_a_conductance_that_grows_cools_what_is_warm(predictor):
    column = column_of(predictor, TemperatureConductance("link.plate|room", ("plate",)))
    warm = predictor.predict(0, {}).temperature[:, 0]
    assert np.corrcoef(column[100:], warm[100:])[0, 1] < -0.5


def test_a_room_has_a_day():
    modes = room_modes(np.linspace(0.0, 6 * 86400.0, 300))
    total = np.sqrt(sum(size**2 * np.mean(shape**2) for size, shape in modes))
    assert total == pytest.approx(np.hypot(tuned.ROOM_DAILY, tuned.ROOM_SLOW), rel=0.1)
    assert len(room_modes(np.linspace(0.0, 3600.0, 100))) < 4


def test_a_room_has_its_days_in_recordings_of_any_length():
    """Half a day later it is as far to the other side, however many days there are."""
    times = room_instants(np.linspace(0.0, 250 * 86400.0, 3000))
    hours = np.arange(0.0, 250 * 86400.0, 3600.0)
    course = np.array([size * np.interp(hours, times, shape) for size, shape in room_modes(times)])
    later = np.sum(course[:, 12:] * course[:, :-12]) / np.sum(course[:, 12:] ** 2)
    assert later == pytest.approx(-1.0, abs=0.05)
    assert room_instants(np.linspace(0.0, 86400.0, 3000)).size == 400
    assert room_instants(np.linspace(0.0, 86400.0, 300)).size == 300


def test_the_same_directions_for_every_recording_of_a_machine(predictor):
    names = {item.name.split(".")[0] for item in misdescriptions_of(predictor)}
    assert names == {"mass_beside", "over_temperature", "exponent", "heat_bend", "clock", "course"}


def test_a_machine_without_its_core_is_too_coarse_and_offered_one(tmp_path, blank):
    noise = np.random.default_rng(3).normal(0.0, 0.05, TIMES.size)
    own = Predictor(network(MACHINE + BEHIND), [blank], at_stamps=True).predict(0, {}).temperature[:, 0]
    run = recorded(tmp_path / "run", own - 273.15 + noise)
    (tmp_path / "rig.toml").write_text(MACHINE)
    opened = open_machine(tmp_path / "rig.toml", (), [run], [run])
    better = refined(opened)
    assert better.too_coarse.left > tuned.COARSE_LEFT
    assert [item.statement for item in better.too_coarse.additions] == ["one more node behind plate"]
    assert better.too_coarse.additions[0].left_after < 1.3
    assert "plate_behind_1" in json.dumps(better.spec.model_dump(mode="json"))
    assert refined(better).too_coarse == better.too_coarse


@pytest.mark.parametrize("heldout", ["blocks", "last:0.4"])
def test_what_is_held_out_does_not_enter_what_is_usual_on_another_network(tmp_path, heldout):
    (tmp_path / "rig.toml").write_text(MACHINE)
    # Warmest where either choice holds out.
    plate = 21.0 + 60.0 * np.exp(-(((TIMES - 8325.0) / 300.0) ** 2)) + 0.1 * np.sin(TIMES)
    run = recorded(tmp_path / "run", plate)
    opened = open_machine(tmp_path / "rig.toml", (), [run], [], heldout=heldout)
    assert with_network(opened, opened.spec).view == opened.view


def hurried(values, rate):
    """A log of the load that runs faster than the temperatures' clock from its first change on."""
    start = TIMES[np.argmax(values != values[0])]
    return np.interp(np.where(start < TIMES, start + (TIMES - start) * rate, TIMES), TIMES, values)


def test_an_input_is_stretched_from_where_it_first_changes(tmp_path, blank):
    quick = recorded(tmp_path, np.full(TIMES.size, 21.0), hurried(LOAD, 1.25))
    back = with_input_rate(quick, ["load"], 1.25)
    assert np.abs(back.inputs - blank.inputs).max(axis=1)[TIMES < 7000.0] == pytest.approx(0.0, abs=1e-12)
    assert with_input_rate(quick, ["other"], 1.25).inputs == pytest.approx(quick.inputs)


@pytest.fixture(scope="module")
def timed(tmp_path_factory, blank):
    """A machine calibrated by a good recording and by one whose load was logged too fast."""
    folder = tmp_path_factory.mktemp("timed")
    plate = told(blank, MACHINE) - 273.15 + np.random.default_rng(3).normal(0.0, 0.05, TIMES.size)
    good, quick = recorded(folder / "good", plate), recorded(folder / "quick", plate, hurried(LOAD, 1.15))
    (folder / "rig.toml").write_text(MACHINE)
    return open_machine(folder / "rig.toml", (), [good], [good, quick])


def test_inputs_on_a_clock_of_their_own_are_found(timed):
    *_, (statement, right) = other_clocks(timed)
    assert "inputs of run stretched 1.15 times" in statement
    good, quick = right.calibration
    late = TIMES < 7500.0
    assert np.mean(good.inputs[late] != quick.inputs[late]) < 0.02
    assert np.mean(good.inputs[late] != timed.calibration[1].inputs[late]) > 0.05


@pytest.mark.slow
def test_a_calibration_whose_inputs_have_a_clock_of_their_own_is_put_right(timed):
    better = refined(timed)
    first = better.too_coarse.additions[0]
    assert "inputs of run stretched 1.15 times" in first.statement
    assert first.left_after < 0.5 * first.left_before
    assert refined(replace(timed, calibration=timed.calibration[:1])).too_coarse is None


def test_what_nothing_helps_is_said(monkeypatch):
    assert "No further node" in TooCoarse(3.0, (), 3.0).statement
    assert "instead of 4.0" in TooCoarse(3.0, (Addition("a link", 4.0, 2.0),), 1.8).statement
    assert coarse_machine.LEAST_GAIN < 1.0
