"""Disorder, repeats, spikes, drop-outs, stuck sensors, gaps, holds, noise: found and counted."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.channel_checks import (
    Flag,
    resolution,
    slow_error,
    stale_readings,
    temperature_flags,
    white_noise,
)

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "test"
data = "data.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "SP01"
role = "temperature"
probe = "SP01"
unit = "degC"
sigma = 0.1
[[channel]]
column = "ambient"
role = "input"
drives = "ambient"
unit = "degC"
[[channel]]
column = "speed"
role = "input"
drives = "speed"
unit = "rpm"
hold = "previous"
"""


def read(folder, rows, **options):
    (folder / "recording.toml").write_text(MANIFEST)
    lines = [",".join("" if value is None else repr(float(value)) for value in row) for row in rows]
    (folder / "data.csv").write_text("\n".join(["time_s,SP01,ambient,speed", *lines]) + "\n")
    return read_recording(folder, **options)


def signal(number=400, sigma=0.1, seed=0):
    """A warming spindle in degC."""
    random = np.random.default_rng(seed)
    times = np.arange(number) * 10.0
    return times, 20.0 + 15.0 * (1.0 - np.exp(-times / 1500.0)) + sigma * random.standard_normal(number)


def test_disorder_and_repeats_are_sorted_merged_and_counted(tmp_path):
    rows = [
        (0.0, 20.0, 20.0, 0.0),
        (20.0, 22.0, 20.0, 200.0),
        (10.0, 21.0, 20.0, 100.0),
        (20.0, 22.0, 20.0, 200.0),
    ]
    rows += [(30.0, 23.0, 21.0, 100.0), (30.0, 25.0, 23.0, 300.0)]
    recording = read(tmp_path, rows)
    report = recording.defects
    assert recording.times.tolist() == [0.0, 10.0, 20.0, 30.0]
    assert (report.rows, report.stamps, report.unordered_rows, report.repeated_rows) == (6, 4, 1, 2)
    assert report.conflicting_stamps == 1
    # temperatures and straight inputs are averaged; of a held input the last value counts
    np.testing.assert_allclose(recording.temperature[:, 0] - 273.15, [20.0, 21.0, 22.0, 24.0])
    np.testing.assert_allclose(recording.input_at("ambient", np.array([30.0])) - 273.15, [22.0])
    np.testing.assert_allclose(recording.inputs[:, 1] * 60 / (2 * np.pi), [0.0, 100.0, 200.0, 300.0])


def test_repeat_fills_an_empty_cell(tmp_path):
    recording = read(tmp_path, [(0.0, None, 20.0, 0.0), (0.0, 20.5, None, None), (10.0, 21.0, 20.0, 0.0)])
    assert recording.temperature[0, 0] == pytest.approx(293.65)
    assert recording.defects.conflicting_stamps == 0


def test_holds(tmp_path):
    rows = [
        (0.0, 20.0, 20.0, 100.0),
        (10.0, 20.0, None, None),
        (20.0, 20.0, 24.0, 300.0),
        (30.0, 20.0, None, 300.0),
    ]
    recording = read(tmp_path, rows)
    at = np.array([-5.0, 0.0, 5.0, 10.0, 19.9, 20.0, 35.0])
    rpm = recording.input_at("speed", at) * 60 / (2 * np.pi)
    np.testing.assert_allclose(rpm, [100.0, 100.0, 100.0, 100.0, 100.0, 300.0, 300.0])
    np.testing.assert_allclose(
        recording.input_at("ambient", at) - 273.15, [20.0, 20.0, 21.0, 22.0, 23.98, 24.0, 24.0]
    )
    history = recording.input_history()
    assert history.held.tolist() == [False, True]
    np.testing.assert_allclose(history.values[:, 0] - 273.15, [20.0, 22.0, 24.0, 24.0])
    with pytest.raises(RecordingError, match='no channel drives "thrust"'):
        recording.input_at("thrust", at)


def test_gaps_and_segments(tmp_path):
    times = [0.0, 10.0, 20.0, 60.0, 70.0, 5000.0, 5010.0, 5021.0]
    recording = read(tmp_path, [(t, 20.0, 20.0, 0.0) for t in times], long_gap=1000.0)
    assert [(gap.start, gap.end) for gap in recording.defects.gaps] == [(20.0, 60.0), (70.0, 5000.0)]
    assert recording.defects.non_uniform_steps == 3
    assert recording.segments.tolist() == [[0, 5], [5, 8]]
    assert recording.first_readings(1) == {"SP01": pytest.approx(293.15)}


def test_first_reading_skips_what_is_flagged(tmp_path):
    times, values = signal()
    rows = [[t, float(v), 20.0, 0.0] for t, v in zip(times, values, strict=True)]
    rows[0][1], rows[1][1] = None, 90.0
    recording = read(tmp_path, rows)
    assert recording.first_readings()["SP01"] == pytest.approx(values[2] + 273.15)


def test_spikes_are_flagged_and_kept(tmp_path):
    times, values = signal()
    at = [40, 41, 200, 399]
    values[at] += [15.0, -4.0, -6.0, 8.0]
    recording = read(tmp_path, [(t, float(v), 20.0, 0.0) for t, v in zip(times, values, strict=True)])
    flagged = np.flatnonzero(recording.flags[:, 0] & Flag.SPIKE)
    assert flagged.tolist() == at
    assert recording.defects.channel("SP01").spikes == 4
    np.testing.assert_allclose(recording.temperature[:, 0] - 273.15, values, atol=1e-9)
    assert not recording.usable[at].any()


@pytest.mark.parametrize(("first", "second"), [(-27.9, 19.4), (6.0, -9.0)])
def test_two_spikes_to_either_side_are_both_flagged(first, second):
    _, values = signal()
    values[[40, 41]] += [first, second]
    flags = temperature_flags(values + 273.15, 0.05, 0.1, judge_stuck=True)
    assert np.flatnonzero(flags).tolist() == [40, 41]


@pytest.mark.parametrize("size", [7.0, -7.0, 31.0])
def test_spike_amid_a_start_is_flagged(size):
    time = np.arange(200.0)
    values = 296.0 + 12.0 * (1.0 - np.exp(-np.maximum(0.0, time - 99.0) / 8.0))
    values += 0.05 * np.random.default_rng(3).standard_normal(200)
    assert not temperature_flags(values, 0.05, 0.1, judge_stuck=True).any()
    values[101] += size
    assert np.flatnonzero(temperature_flags(values, 0.05, 0.1, judge_stuck=True)).tolist() == [101]


@pytest.mark.parametrize("samples", [2, 3, 4, 7])
def test_what_swings_all_the_time_is_no_pair_of_spikes(samples):
    swing = 300.0 + 3.0 * np.sin(2.0 * np.pi * np.arange(200) / samples + 0.4)
    assert not temperature_flags(swing, 0.05, 0.0, judge_stuck=True).any()


def test_spike_of_an_input_temperature_is_bridged(tmp_path):
    times, values = signal()
    ambient = np.full(400, 20.0)
    ambient[100] = 60.0
    rows = [(t, float(v), float(a), 0.0) for t, v, a in zip(times, values, ambient, strict=True)]
    recording = read(tmp_path, rows)
    assert recording.defects.channel("ambient").spikes == 1
    assert recording.input_at("ambient", np.array([1000.0]))[0] == pytest.approx(293.15)


def test_steps_and_steep_peaks_are_no_spikes():
    step = np.concatenate([np.full(100, 300.0), np.full(100, 330.0)])
    peak = 300.0 + 40.0 * np.exp(-np.abs(np.arange(200) - 100) / 3.0)
    for values in (step, peak):
        noisy = values + 0.05 * np.random.default_rng(2).standard_normal(200)
        flags = temperature_flags(noisy, 0.05, 0.0, judge_stuck=True)
        assert not flags.any()


def test_dropout_to_a_rail_and_implausible_readings():
    _, values = signal(600)
    values[100:130] = 0.0
    values[300:303] = -200.0
    values[400] = 1372.0
    flags = temperature_flags(values + 273.15, 0.1, 0.0, judge_stuck=True)
    assert np.flatnonzero(flags & Flag.DROPOUT).tolist() == list(range(100, 130))
    assert np.flatnonzero(flags & Flag.IMPLAUSIBLE).tolist() == [300, 301, 302, 400]
    assert np.count_nonzero(flags) == 34


def test_stuck_sensor_is_found_where_noise_shows():
    _, values = signal(600)
    values = np.round(values, 2)
    values[250:320] = values[250]
    flags = temperature_flags(values + 273.15, 0.1, 0.01, judge_stuck=True)
    assert np.flatnonzero(flags & Flag.STUCK).tolist() == list(range(251, 320))
    assert not (temperature_flags(values + 273.15, 0.1, 0.01, judge_stuck=False) & Flag.STUCK).any()


def test_constant_reading_of_a_coarse_sensor_proves_nothing():
    values = np.round(signal(600, sigma=0.01)[1])
    flags = temperature_flags(values + 273.15, None, 1.0, judge_stuck=True)
    assert not (flags & Flag.STUCK).any()


def test_reading_repeated_after_the_inputs_have_gone(tmp_path):
    """Whole degrees that stand still for an hour prove nothing, unless nothing else is read either."""
    times, values = signal(900, sigma=0.0)
    values = np.round(values)
    silent = (times >= 5000.0) & (times < 8000.0)
    values[silent] = values[500]
    rows = [
        (t, float(v), None if s else 20.0, None if s else 500.0)
        for t, v, s in zip(times, values, silent, strict=True)
    ]
    recording = read(tmp_path, rows)
    stuck = np.flatnonzero(recording.flags[:, 0] & Flag.STUCK)
    assert stuck[0] == 500
    assert stuck[-1] == 799
    assert recording.defects.channel("SP01").stuck == stuck.size == 300


def test_reading_that_stops_in_the_middle_of_a_change():
    times = np.arange(1000) * 10.0
    values = np.round(300.0 + np.minimum(times, 3000.0) * 0.02)
    missing = np.zeros(1000, dtype=bool)
    stale = stale_readings(times, values, missing, 1.0)
    assert stale[310:].all()
    assert not stale[:290].any()
    # an approach that slows down may end in one whole degree for hours
    slow = np.round(320.0 + 40.0 * np.exp(-times / 1500.0))
    assert not stale_readings(times, slow, missing, 1.0).any()


def test_channel_without_noise_gets_the_smallest_sigma(tmp_path):
    rows = [(10.0 * k, 20.0 + k, 20.0, 0.0) for k in range(50)]
    (tmp_path / "recording.toml").write_text(MANIFEST.replace("sigma = 0.1\n", ""))
    lines = [",".join(repr(float(value)) for value in row) for row in rows]
    (tmp_path / "data.csv").write_text("\n".join(["time_s,SP01,ambient,speed", *lines]) + "\n")
    assert 1e-3 <= read_recording(tmp_path).sigma[0] < 0.5


@pytest.mark.parametrize("sigma", [0.02, 0.3])
def test_white_noise_on_a_drift(sigma):
    _, values = signal(5000, sigma=sigma)
    assert white_noise(values) == pytest.approx(sigma, rel=0.05)


def test_noise_ignores_spikes():
    _, values = signal(3000)
    values[::100] += 20.0
    assert white_noise(values) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("step", [1.0, 0.2, 0.05, 0.001])
def test_resolution(step):
    values = np.round(signal(2000)[1] / step) * step
    assert resolution(values) == pytest.approx(step)


def test_resolution_of_exact_numbers_is_zero():
    assert resolution(signal(2000)[1]) == 0.0


def test_slow_error_beside_white_noise():
    """A slow error of 0.05 K with 300 s correlation under 0.1 K of white noise."""
    random = np.random.default_rng(5)
    times = np.arange(20000) * 10.0
    slow = np.zeros(times.size)
    keep = np.exp(-10.0 / 300.0)
    kicks = 0.05 * np.sqrt(1 - keep**2) * random.standard_normal(times.size)
    for k in range(1, times.size):
        slow[k] = keep * slow[k - 1] + kicks[k]
    quiet = 0.1 * random.standard_normal(times.size)
    assert slow_error(times, quiet + slow, 0.1) == pytest.approx(0.05, rel=0.5)
    assert slow_error(times, quiet, 0.1) < 0.01


def test_a_sensor_that_reads_one_value_beside_others_that_change_is_told(tmp_path):
    times, values = signal()
    same = read(tmp_path, [(t, 23.2, 20.0, 0.0) for t in times]).defects
    (column,) = (item.column for item in same.channels if item.role == "temperature")
    assert not same.silent()  # a machine at rest, as far as this says
    moving = replace(same.channel(column), column="other", never_changes=False)
    beside = replace(same, channels=(*same.channels, moving))
    assert any(line.startswith(f"{column}: never changes while") for line in beside.lines())
    plain = {item["channel"]: item.get("never_changes") for item in beside.to_json()["channels"]}
    assert (plain[column], plain["other"]) == (True, None)
    changing = read(tmp_path, [(t, float(v), 20.0, 0.0) for t, v in zip(times, values, strict=True)])
    assert not changing.defects.channel(column).never_changes


def test_report_as_text_and_plain_data(tmp_path):
    times, values = signal()
    values[40] += 15.0
    recording = read(tmp_path, [(t, float(v), 20.0, 0.0) for t, v in zip(times, values, strict=True)])
    lines = recording.defects.lines()
    assert lines[0] == "test: 400 rows, 400 distinct stamps over 3990 s, median step 10 s"
    assert any(line.startswith("SP01: 1 spikes; noise 0.") for line in lines)
    content = recording.defects.to_json()
    assert content["channels"][0]["spikes"] == 1
    assert content["segments"] == 1


def test_recording_arrays_cannot_be_written(tmp_path):
    recording = read(tmp_path, [(0.0, 20.0, 20.0, 0.0), (1.0, 20.0, 20.0, 0.0)])
    with pytest.raises(ValueError, match="read-only"):
        recording.temperature[0, 0] = 0.0


def test_a_stamp_far_away_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="days"):
        read(tmp_path, [(0.0, 20.0, 20.0, 0.0), (60.0, 20.1, 20.0, 0.0), (1e19, 20.2, 20.0, 0.0)])
