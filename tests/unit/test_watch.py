"""The watch: lines of a growing file, rows of a window, stated false alarms, a machine that leaves."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from spindle_fem.errors import RecordingError
from spindle_fem.inference import misdescription_columns
from spindle_fem.inference.continued_run import ContinuedRun
from spindle_fem.inference.cumulative_sums import CumulativeSums, level_for, run_length
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.innovations import InnovationFilter
from spindle_fem.inference.misdescription_columns import PROVIDERS
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate, machine_coordinates
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.watched_machine import MOST_AMID, WatchedMachine, _past_changes, white_noise
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.recordings import growing_file, recording_window
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.growing_file import follow_lines
from spindle_fem.recordings.manifest import load_manifest
from spindle_fem.recordings.recording_window import RecordingWindow, piece_of
from spindle_fem.studies import watch
from spindle_fem.studies.watch import Watching, watch_recording
from tests.conftest import write_recording
from tests.support.written_texts import network_text

MACHINE = network_text(
    "block",
    {"block": ("2000 J/K", 0.2)},
    {"block|ambient": ("2 W/K", 0.2)},
    [("block", "power", ("1 W/W", 0.1))],
)
TEMPERATURES, INPUTS = {"block": "block"}, {"power": "power", "room": "ambient"}


def heated(hours, *, cooled_from=np.inf, seed=0, every=None):
    """A block heated on and off, or at random times; from some hour on it loses twice as much."""
    times = np.arange(0.0, 3600.0 * hours, 30.0)
    power = np.where(np.sin(times / 2500.0) > 0.0, 60.0, 0.0)
    if every is not None:
        switched = np.random.default_rng(seed).exponential(every, 1000).cumsum()
        power = 60.0 * (np.searchsorted(switched, times) % 2)
    temperature, now = [], 20.0
    for time, heat in zip(times, power, strict=True):
        temperature.append(now)
        loss = 2.0 * (2.0 if time >= 3600.0 * cooled_from else 1.0)
        now += 30.0 / 2000.0 * (heat - loss * (now - 20.0))
    noise = 0.1 * np.random.default_rng(seed).standard_normal(times.size)
    return pd.DataFrame({"time": times, "block": temperature + noise, "power": power, "room": 20.0})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A machine, a sound recording of it, and one that leaves after five hours."""
    place = tmp_path_factory.mktemp("watched")
    (place / "machine.toml").write_text(MACHINE)
    write_recording(place / "sound", heated(6.0), TEMPERATURES, INPUTS)
    write_recording(place / "leaves", heated(8.0, cooled_from=5.0, seed=1), TEMPERATURES, INPUTS)
    return place


# ------------------------------------------------------------------------------------ statistics
@pytest.mark.parametrize("reference", [0.125, 0.35, 1.0])
def test_sums_alarm_as_often_by_chance_as_their_level_says(reference):
    length, number = 400.0, 1500
    level = level_for(length, reference)
    generator = np.random.default_rng(3)
    sums, run, alive = np.zeros(number), np.zeros(number), np.ones(number, dtype=bool)
    for _ in range(20 * int(length)):
        sums = np.maximum(0.0, sums + generator.standard_normal(number) - reference)
        run += alive
        alive &= sums < level
        if not alive.any():
            break
    assert run.mean() == pytest.approx(length, rel=0.1)


def test_a_run_length_of_a_table():
    # Montgomery (2013), table 9.3 for one side: twice the two-sided 168 and 465.
    assert run_length(4.0, 0.5) == pytest.approx(336.0, rel=0.01)
    assert run_length(5.0, 0.5) == pytest.approx(930.0, rel=0.01)


def test_all_channels_together_keep_the_stated_rate():
    between, runs, last = 100.0, [], 0
    sums, generator = CumulativeSums(3, between, 10.0), np.random.default_rng(5)
    for instant in range(15_000):
        sums.add(generator.standard_normal(3))
        if sums.evidence.max() >= 1.0:
            runs.append(instant - last)
            last = instant
            sums.sums[:] = 0.0
    # Sums of one channel find the same chance departures: fewer alarms than stated, never more.
    assert between < np.mean(runs) < 4.0 * between


def test_a_lasting_departure_is_found_and_left_again():
    sums, generator = CumulativeSums(2, 43_200.0, 10.0), np.random.default_rng(6)
    for _ in range(40):
        sums.add(generator.standard_normal(2) + np.array([1.5, np.nan]))
    assert sums.evidence.tolist() == [1.0, 0.0]
    for _ in range(120):
        sums.add(generator.standard_normal(2))
    assert not sums.rising.any()


@pytest.mark.parametrize("beside", [(), ((1, SlowError(0.2, 300.0)),)])
def test_innovations_are_white_and_of_unit_spread(beside):
    generator, slow, white = np.random.default_rng(7), SlowError(0.1, 1000.0), np.full(2, 0.05)
    count, apart = 4000, 60.0
    filtered = InnovationFilter(np.array([[1.0]]), [slow, slow], beside=beside)
    slopes = np.array([[0.3], [-0.2]])
    every = [(0, slow), (1, slow), *beside]
    errors, unknown = np.zeros(len(every)), generator.standard_normal()
    sigma, time = np.array([(item.sigma, item.time) for _, item in every]).T
    kept = np.exp(-apart / time)
    found = []
    for instant in range(count):
        errors = kept * errors + sigma * np.sqrt(1.0 - kept**2) * generator.standard_normal(len(every))
        read = np.array([sum(e for (c, _), e in zip(every, errors, strict=True) if c == k) for k in (0, 1)])
        away = slopes[:, 0] * np.sin(instant / 300.0) * unknown + read + white * generator.standard_normal(2)
        found.append(filtered.step(apart, away, slopes * np.sin(instant / 300.0), white, learn=True))
    numbers = np.array(found)[50:]
    assert np.std(numbers, axis=0) == pytest.approx([1.0, 1.0], abs=0.04)
    assert np.abs(np.mean(numbers[1:] * numbers[:-1], axis=0)).max() < 0.04
    assert filtered.mean[0] == pytest.approx(unknown, abs=4.0 * np.sqrt(filtered.covariance[0, 0]))
    assert filtered.slow_errors == pytest.approx(read, abs=0.3)


# ----------------------------------------------------------------------------------------- file
def test_a_growing_file_gives_whole_lines_through_truncation_and_rotation(tmp_path):
    data, told = tmp_path / "made.csv", []
    lines = follow_lines(data, to_end=False, poll=0.0, tell=told.append)
    assert next(lines) == []
    data.write_bytes(b"time,a\n1,2\n3,")
    assert next(lines) == [b"time,a", b"1,2"]
    assert next(lines) == []
    with data.open("ab") as stream:
        stream.write(b"4\n")
    assert next(lines) == [b"3,4"]
    assert next(lines) == []
    data.write_bytes(b"time,a\n5,6\n")
    assert next(lines) == []
    assert next(lines) == [b"time,a", b"5,6"]
    assert next(lines) == []
    os.replace(data, tmp_path / "old.csv")
    data.write_bytes(b"time,a\n7,8\n")
    assert next(lines) == []
    assert next(lines) == [b"time,a", b"7,8"]
    assert [text.rpartition(": ")[2].partition(";")[0] for text in told] == [
        "waiting for it",
        "cut short",
        "replaced",
    ]


def test_a_window_keeps_the_last_rows_and_leaves_out_what_is_no_row(folder):
    manifest, data = load_manifest(folder / "sound")
    told = []
    window = RecordingWindow(manifest, data, told.append)
    lines = data.read_bytes().split(b"\n")
    window.add(lines[:500])
    window.use(float(window.waiting[-1]))
    window.add([b"nonsense,1,2,3", b"0,1,2,3", *lines[500:502], lines[0], b""])
    assert (window.unreadable, window.late, window.waiting.size, len(told)) == (1, 1, 2, 2)
    recording = window.recording()
    assert recording.times.size == 302
    assert recording.times[-1] == 30.0 * 500


def test_a_window_keeps_a_warm_up_of_more_rows_than_may_wait(folder, monkeypatch):
    monkeypatch.setattr(recording_window, "MOST_WAITING", 100)
    manifest, data = load_manifest(folder / "sound")
    rows = [b"%d,20,60,20" % (30 * k) for k in range(2000)]
    # Rows of a block of the file come at once, those of a live recording one by one.
    for size, kept in ((1, 1002), (900, 1800)):
        window = RecordingWindow(manifest, data, lambda text: None, warm_up=30.0 * 1000)
        window.add([b"time,block,power,room"])
        for begin in range(0, kept, size):
            assert not watch._may_begin(window, 30.0 * 1000)
            window.add(rows[begin : begin + size])
        assert watch._may_begin(window, 30.0 * 1000)
        assert window.recording().times.tolist() == (30.0 * np.arange(kept)).tolist()
        # Where no channel has a reading for ever, what is older than the warm-up goes; used rows go as ever.
        window.add(rows[kept:])
        window.add([b"60000,20,60,20"])
        assert window.waiting[0] == 30.0 * 999
        window.use(30.0 * 1999)
        window.add([b"%d,20,60,20" % (60000 + 30 * k) for k in range(1, 500)])
        window.add([b"80000,20,60,20"])
        assert window.recording().times.size == recording_window.CONTEXT + 100 + 1


def test_a_window_begins_with_the_last_reading_of_an_input(folder):
    manifest, data = load_manifest(folder / "sound")
    window = RecordingWindow(manifest, data, lambda text: None)
    window.add([b"time,block,power,room", b"0,20,60,20", *(b"%d,20,,20" % (30 * k) for k in range(1, 700))])
    window.use(30.0 * 699)
    window.add([b"%d,20,,20" % (30 * 700)])
    assert np.all(window.recording().input_at("power", window.recording().times) == 60.0)


# ---------------------------------------------------------------------------------------- model
@pytest.mark.parametrize(
    "providers",
    [(heat_misdescriptions,), pytest.param(PROVIDERS, marks=pytest.mark.slow)],
    ids=["heat", "all"],
)
def test_pieces_of_a_run_are_the_run(fast, tmp_path, monkeypatch, providers):
    monkeypatch.setattr(misdescription_columns, "PROVIDERS", providers)
    times = np.arange(0.0, 7200.0, 60.0)
    frame = pd.DataFrame(
        {
            "time": times,
            "SP01": 20.0,
            "SP03": 20.0,
            "speed": np.select([times < 1800.0, times < 5400.0], [0.0, 3000.0], 1500.0),
            "room": 20.0 + np.sin(times / 900.0),
            "oil": 16.0,
        }
    )
    inputs = {"speed": "speed", "room": "ambient", "oil": "coolant_inlet"}
    recording = read_recording(
        write_recording(tmp_path / "r", frame, {"SP01": "SP01", "SP03": "SP03"}, inputs)
    )
    run = ContinuedRun(fast, NO_EFFECTS)
    coordinates = machine_coordinates(run.begins(recording))
    names = [c.name for c in coordinates]
    assert any(name.startswith("misdescribed.") for name in names)
    values = {c.name: c.at(0.5) for c in coordinates}
    whole, _, opened = run.follow(recording, values, names, 60.0)
    run.restart()
    for begin, stop in ((0, 25), (24, 35), (34, 95), (94, 120)):
        piece, observed, open_now = run.follow(piece_of(recording, begin, stop), values, names, 60.0)
    assert sum(item.bins.number.sum() for item in observed) == 2 * 25
    assert piece.temperature[-1] == pytest.approx(whole.temperature[-1], abs=1e-3)
    assert piece.sensitivity[-1] == pytest.approx(whole.sensitivity[-1], rel=1e-3, abs=2e-3)
    # Each of the two changes is between rows of one piece.
    assert open_now.shape[2] == opened.shape[2] == 2
    assert open_now[-1] == pytest.approx(opened[-1], rel=1e-3, abs=1e-4)
    assert np.abs(opened).max() > 0.1
    # A small change of a coordinate moves the state that is carried on as its derivative says.
    name = names[0]
    before = run.begun[0].copy()
    run.move({name: 0.01, names[-1]: 1.0})
    assert run.begun[0] - before == pytest.approx(0.01 * run.begun[1][name], abs=1e-12)


def test_a_room_that_is_not_recorded_has_no_course_of_its_own_in_every_piece(folder, tmp_path):
    text = MACHINE.replace('temperature = "ambient"', 'temperature = {low = "15 degC", high = "25 degC"}')
    (tmp_path / "machine.toml").write_text(text)
    how = Watching(calibrate=(folder / "sound",), until_end=True)
    assert list(watch_recording(tmp_path / "machine.toml", folder / "leaves", how))
    opened = open_machine(tmp_path / "machine.toml", (), [read_recording(folder / "sound")], ())
    begun = ContinuedRun(opened.fast, NO_EFFECTS).begins(opened.recordings[0])
    every = misdescription_columns.misdescriptions_of(begun)
    assert {d.name for d in every if d.recording is not None} > {"clock", "course.ambient.1"}
    assert {d.name for d in begun.misdescribed if d.recording is not None} == {"clock"}


# -------------------------------------------------------------------------------------- machine
def test_a_sound_machine_stays_and_a_changed_one_leaves(folder):
    how = Watching(calibrate=(folder / "sound",), heartbeat=1800.0, until_end=True)
    told = list(watch_recording(folder / "machine.toml", folder / "leaves", how))
    # the stated rate is that of "left"; a line that says "leaving" may take it back
    sound = [line["state"] for line in told if line["time"] < 5.0 * 3600.0]
    assert "left" not in sound
    assert sound.count("leaving") <= 1 < sound.count("as modelled")
    left = next(line for line in told if line["state"] == "left")
    assert left["channel"] == "block"
    assert left["time"] < 5.7 * 3600.0
    assert left["departure_K"] < -0.1
    assert min(line["departure_K"] for line in told if line["state"] == "left") < -2.0
    assert left["condition"] in ("standstill", "heating", "cooling", "steady running")


@pytest.mark.slow
def test_a_machine_as_sound_as_expected_raises_no_more_alarms_than_stated(folder, monkeypatch):
    days, alarms_a_day, slow = 4.0, 30.0, SlowError(0.2, 1500.0)
    monkeypatch.setattr(watch, "expected_slow_error", lambda predictor: slow)
    frame = heated(24.0 * days, seed=4)
    kept, fresh = np.exp(-30.0 / slow.time), np.random.default_rng(5).standard_normal(len(frame))
    frame["block"] += lfilter([slow.sigma * np.sqrt(1.0 - kept**2)], [1.0, -kept], fresh)
    write_recording(folder / "long", frame, TEMPERATURES, INPUTS)
    how = Watching(calibrate=(folder / "sound",), until_end=True, alarms=alarms_a_day * 365.25 / 12.0)
    states = [line["state"] for line in watch_recording(folder / "machine.toml", folder / "long", how)]
    found = sum(
        now == "left" and before != "left" for before, now in zip(["", *states], states, strict=False)
    )
    # Fewer, as Bonferroni has it: sums of one channel find the same departures, and an alarm holds.
    assert 0.05 * alarms_a_day * days < found < alarms_a_day * days


def test_rows_that_come_one_by_one_say_what_the_whole_file_says(folder):
    how = Watching(warm_up=3.0 * 3600.0, heartbeat=600.0, until_end=True)
    whole = list(watch_recording(folder / "machine.toml", folder / "leaves", how))
    text = (folder / "leaves" / "made.csv").read_bytes()
    manifest = (folder / "leaves" / "recording.toml").read_text().replace('"made.csv"', '"-"')
    (folder / "piped.toml").write_text(manifest)
    command = [sys.executable, "-m", "spindle_fem", "watch", "machine.toml", "piped.toml"]
    command += ["--warm-up", "3 h", "--heartbeat", "600 s"]
    with subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        for begin in range(0, len(text), 4099):
            process.stdin.write(text[begin : begin + 4099])
        found = [json.loads(line) for line in process.communicate()[0].splitlines()]
    assert process.returncode == 0
    first, second = (
        next(line["time"] for line in lines if line["state"] == "left") for lines in (whole, found)
    )
    assert abs(first - second) < 300.0
    assert abs(len(whole) - len(found)) < 6


def test_a_watch_begins_with_all_rows_of_its_warm_up(folder, monkeypatch):
    def begun(machine, how, first, *others):
        raise RecordingError("begun", f"from {first.times[0]:g} s")

    monkeypatch.setattr(watch, "_begin", begun)
    monkeypatch.setattr(recording_window, "MOST_WAITING", 10)
    monkeypatch.setattr(growing_file, "BLOCK", 1000)
    how = Watching(warm_up=4.0 * 3600.0, until_end=True)
    with pytest.raises(RecordingError, match="from 0 s"):
        list(watch_recording(folder / "machine.toml", folder / "leaves", how))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "whose noise is not known"),
        (("--warm-up", "9 h"), "Too few"),
        (("--warm-up", "0 h"), "above 0"),
        (("--warm-up", "3 h", "--false-alarms", "never"), "1/month"),
        (("--warm-up", "3 h", "--calibrate", "sound"), "Give one of them"),
    ],
)
def test_bad_input_is_refused(folder, options, said):
    from typer.testing import CliRunner

    from spindle_fem.cli import app

    asked = ["watch", str(folder / "machine.toml"), str(folder / "leaves"), "--until-end", *options]
    asked = [str(folder / "sound") if item == "sound" else item for item in asked]
    error = CliRunner().invoke(app, asked).exception
    assert error.exit_status == 2
    assert said in str(error)


def test_a_compressed_file_does_not_grow(tmp_path):
    with pytest.raises(RecordingError, match="cannot grow"):
        next(follow_lines(tmp_path / "made.csv.gz", to_end=False, poll=0.0, tell=print))


def test_after_a_gap_a_network_begins_again_and_geometry_waits(fast, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(misdescription_columns, "PROVIDERS", (heat_misdescriptions,))
    frame = heated(8.0, seed=2)
    frame = frame[(frame.time < 4.0 * 3600.0) | (frame.time > 5.5 * 3600.0)]
    write_recording(tmp_path / "gap", frame, TEMPERATURES, INPUTS)
    how = Watching(calibrate=(folder / "sound",), until_end=True)
    told = list(watch_recording(folder / "machine.toml", tmp_path / "gap", how))
    assert {line["state"] for line in told} == {"as modelled"}
    assert told[-1]["time"] > 7.9 * 3600.0
    times = np.append(np.arange(0.0, 3600.0, 60.0), 9000.0 + np.arange(0.0, 3600.0, 60.0))
    cold = pd.DataFrame({"time": times, "SP01": 20.0, "speed": 0.0, "room": 20.0, "oil": 20.0})
    # Heat that nobody saw: the machine comes out of the gap warm.
    cold.loc[cold.time >= 9000.0, "SP01"] += 5.0
    inputs = {"speed": "speed", "room": "ambient", "oil": "coolant_inlet"}
    recording = read_recording(
        write_recording(tmp_path / "r", cold, {"SP01": "SP01"}, inputs), long_gap=np.inf
    )
    run = ContinuedRun(fast, NO_EFFECTS)
    known = calibrate(None, run.begins(recording))
    watched = WatchedMachine(run, known, np.array([0.1]), width=60.0, alarms=1.0)
    assert run.begun is None
    told = watched.follow(recording, to_end=True)
    assert {item.state for item in told} == {"as modelled"}
    assert 300.0 < run.slowest_time() < 1e6


def test_what_rows_and_gaps_hide_is_no_departure(fast, tmp_path, monkeypatch):
    monkeypatch.setattr(misdescription_columns, "PROVIDERS", (heat_misdescriptions,))
    fine, stood = np.arange(0.0, 4.0 * 3600.0, 20.0), (8000.0, 8800.0)
    # Changes 100, 60 and 20 s before the row that shows them, and a stop that no row shows.
    speed = np.select([fine < 1220.0, fine < 4260.0, fine < 6100.0], [0.0, 3000.0, 800.0], 3000.0)
    speed[(fine > stood[0]) & (fine < stood[1])] = 0.0
    inputs = {"speed": "speed", "room": "ambient", "oil": "coolant_inlet"}
    frame = pd.DataFrame(
        {"time": fine, "SP01": 20.0, "SP03": 20.0, "speed": speed, "room": 20.0, "oil": 20.0}
    )
    probes = {"SP01": "SP01", "SP03": "SP03"}
    truth = read_recording(write_recording(tmp_path / "all", frame, probes, inputs))
    told = Predictor(fast, [truth], at_stamps=True).predict(0, {}, ()).temperature - 273.15
    noise = 0.05 * np.random.default_rng(4).standard_normal(told.shape)
    frame[["SP01", "SP03"]] = told + noise
    rows = (np.arange(fine.size) % 6 == 0) & ~((fine > stood[0] - 200.0) & (fine < stood[1] + 200.0))
    seen = read_recording(write_recording(tmp_path / "seen", frame[rows], probes, inputs), long_gap=np.inf)
    run = ContinuedRun(fast, NO_EFFECTS)
    watched = WatchedMachine(
        run, calibrate(None, run.begins(seen)), white_noise(seen), width=120.0, alarms=1.0
    )
    assert {item.state for item in watched.follow(seen, to_end=True)} == {"as modelled"}


def test_what_a_network_did_in_a_gap_is_no_departure(folder, tmp_path):
    frame = heated(16.0, seed=3, every=600.0)
    times = frame.time.to_numpy()
    gaps = np.arange(7.0, 16.0) * 3600.0
    seen = np.all(np.abs(times[:, None] - gaps) > 500.0, axis=1)
    write_recording(tmp_path / "seen", frame[seen], TEMPERATURES, INPUTS)
    how = Watching(warm_up=6.0 * 3600.0, until_end=True)
    told = list(watch_recording(folder / "machine.toml", tmp_path / "seen", how))
    assert {line["state"] for line in told} == {"as modelled"}


@pytest.mark.parametrize(
    ("speed", "stop", "expected"),
    [
        ([0.0, 0.0, 0.0, 3000.0, 3000.0], 3, 3),
        ([0.0, 0.0, 0.0, 3000.0, 3000.0], 4, 5),
        # A change over two rows, one that may go on, and a speed that never rests.
        ([0.0, 0.0, 0.0, 1500.0, 3000.0, 3000.0], 4, 6),
        ([0.0, 0.0, 0.0, 1500.0, 3000.0], 4, 6),
        ([0.0, *range(1000, 1000 + 100 * (MOST_AMID + 4), 100)], 4, 4),
    ],
)
def test_a_piece_does_not_end_with_a_row_whose_inputs_are_others(speed, stop, expected):
    values = np.array(speed)
    recording = SimpleNamespace(
        times=60.0 * np.arange(values.size),
        input_names=("speed",),
        held=np.array([True]),
        inputs=values[:, None],
        input_at=lambda name, times: np.interp(times, 60.0 * np.arange(values.size), values),
    )
    assert _past_changes(recording, stop) == expected


def test_a_watch_expects_no_less_than_the_usual_slow_error_of_each_channel(folder, monkeypatch):
    usual = SlowError(1.0, 1000.0, ((0, 9.0, 5000.0),))
    monkeypatch.setattr(watch, "expected_slow_error", lambda predictor: usual)
    first, sound = read_recording(folder / "leaves"), read_recording(folder / "sound")
    watched = watch._begin(folder / "machine.toml", Watching(), first, [sound], lambda stage: None)
    watched.follow(first)
    assert (watched.slow.of(0).sigma, watched.slow.of(0).time) == (9.0, 5000.0)
    assert watched._filter.slow_sigma == pytest.approx([9.0], rel=1e-2)


def test_sources_by_a_power_of_what_switches_within_rows_wander(folder, tmp_path):
    spindle = ("block", "speed", ("20 W", 0.1), {"reference": "1000 rpm", "exponent": 5.0 / 3.0})
    text = network_text(
        "block",
        {"block": ("2000 J/K", 0.2)},
        {"block|ambient": ("2 W/K", 0.2)},
        [("block", "power", ("1 W/W", 0.1)), spindle],
    )
    (tmp_path / "machine.toml").write_text(text)
    frame = heated(4.0).assign(speed=0.0)
    inputs = INPUTS | {"speed": "speed"}
    still = read_recording(write_recording(tmp_path / "still", frame, TEMPERATURES, inputs))
    frame.loc[:, "speed"] = 1000.0 * (np.arange(len(frame)) % 3 == 0)
    works = read_recording(write_recording(tmp_path / "works", frame, TEMPERATURES, inputs))
    for recording, wander in ((still, []), (works, ["gain.block.speed"])):
        opened = open_machine(tmp_path / "machine.toml", (), [recording], [still])
        assert watch._wandering(opened) == wander
    known = watch._known(opened, opened.calibration, ContinuedRun(opened.fast, NO_EFFECTS).begins(works))
    ((node, error),) = watch._of_inputs(opened, known).items()
    # Heat that differs from row to row as white noise: P = S gain² / (2 C G), forgotten with C/G.
    apart, gain, capacity, conductance = 30.0, 20.0, 2000.0, 2.0
    changes = 2.0 / 3.0  # of the power of the speed, in thousands, from row to row
    expected = gain * np.sqrt(0.5 * changes * apart / (2.0 * capacity * conductance))
    assert node == "block"
    assert error.sigma == pytest.approx(expected, rel=0.3)
    assert error.time == pytest.approx(capacity / conductance, rel=0.5)


def test_each_half_of_what_is_sound_is_followed_by_what_the_others_tell(folder):
    frame = heated(4.0)
    frame = frame[(frame.time < 3600.0) | (frame.time > 3.0 * 3600.0)]
    write_recording(folder / "gap", frame, TEMPERATURES, INPUTS)
    sound = [read_recording(folder / "sound"), read_recording(folder / "gap")]
    assert len(sound[1].segments) == 2
    parts = watch._halves(sound)
    assert [own.times.size for own, _ in parts] == [360, 360, 119, 120]
    assert all(len(others) == 3 and not any(own is other for other in others) for own, others in parts)
    assert [own.segments.tolist() for own, _ in parts[2:]] == [[[0, 119]], [[0, 1], [1, 120]]]
    # A half may hold a single row before a gap.
    opened = open_machine(folder / "machine.toml", (), [sound[0]], [])
    begun = ContinuedRun(opened.fast, NO_EFFECTS).begins(sound[0])
    belief = watch._known(opened, [parts[3][0]], begun).belief
    told = {c.name: c.at(u) for c, u in zip(belief.coordinates, belief.mean, strict=True)}
    assert told["gain.block.power"] / told["conductance.block|ambient"] == pytest.approx(1.0, abs=0.1)
