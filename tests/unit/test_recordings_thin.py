"""Averages over bins of time: what they keep, what they leave out, what they refuse."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from spindle_fem.errors import OutOfValidityError, RecordingError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.thin import thinned_recording

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "synthetic"
data = "data.csv"
time = {column = "time_s", unit = "s"}
channel = [
{column = "T", role = "temperature", probe = "node", unit = "degC", sigma = 0.2},
{column = "room", role = "input", drives = "ambient", unit = "degC"},
{column = "P", role = "input", drives = "power", unit = "W", hold = "previous"},
{column = "n", role = "input", drives = "speed", unit = "rpm", hold = "previous"},
{column = "load", role = "covariate", unit = "percent"},
]
"""


def written(folder, times, **columns):
    rng = np.random.default_rng(5)
    frame = pd.DataFrame(
        {
            "time_s": times,
            "T": 20.0 + times / 1000.0 + 0.2 * rng.normal(size=times.size),
            "room": 20.0 + times / 5000.0,
            "P": rng.uniform(0.0, 100.0, size=times.size).round(3),
            "n": rng.choice([-3000.0, 0.0, 3000.0], size=times.size),
            "load": np.full(times.size, 30.0),
        }
        | columns
    )
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(MANIFEST)
    return read_recording(folder)


@pytest.fixture(scope="module")
def gapped(tmp_path_factory):
    times = np.arange(0.0, 60000.0, 10.0)
    times = times[(times < 20000.0) | (times >= 29005.0)]
    return written(tmp_path_factory.mktemp("thin"), times)


def test_straight_lines_stay_straight_and_noise_falls_with_the_root_of_the_number(gapped):
    thinned = thinned_recording(gapped, 300.0)
    line = 293.15 + thinned.times / 1000.0
    assert thinned.sigma[0] == pytest.approx(0.2 / np.sqrt(30.0), rel=0.02)
    residual = thinned.temperature[:, 0] - line
    assert np.std(residual) == pytest.approx(0.2 / np.sqrt(30.0), rel=0.25)
    assert_allclose(thinned.inputs[:, 0], 293.15 + thinned.times / 5000.0, atol=2e-3)
    assert_allclose(thinned.covariates, 0.3)


def test_held_inputs_keep_their_integral_from_stamp_to_stamp(gapped):
    thinned = thinned_recording(gapped, 300.0)
    for begin, end in thinned.segments:
        times = thinned.times[begin:end]
        fine = np.arange(times[0], times[-1], 0.5)
        expected = gapped.input_at("power", fine).mean()
        found = np.average(thinned.inputs[begin : end - 1, 1], weights=np.diff(times))
        assert found == pytest.approx(expected, rel=1e-9)


def test_powers_are_averaged_where_heat_follows_them(gapped):
    plain = thinned_recording(gapped, 300.0)
    powered = thinned_recording(gapped, 300.0, exponents={"speed": 1.5})
    speed = 3000.0 * np.pi / 30.0
    moving = np.abs(gapped.inputs[:, 2]) > 0.0
    assert plain.inputs[:, 2].mean() == pytest.approx(speed * moving.mean(), rel=0.02)
    assert np.mean(powered.inputs[:, 2] ** 1.5) == pytest.approx(speed**1.5 * moving.mean(), rel=0.02)
    with pytest.raises(OutOfValidityError, match=r"has no power 0\.5"):
        thinned_recording(replace(gapped, inputs=-gapped.inputs), 300.0, exponents={"power": 0.5})


def test_no_bin_reaches_over_a_long_gap(gapped):
    thinned = thinned_recording(gapped, 3000.0)
    assert len(thinned.segments) == 2
    first, second = thinned.segments
    assert thinned.times[first[1] - 1] < 20000.0
    assert thinned.times[second[0]] > 29005.0
    assert thinned.defects.thinned.bins == thinned.times.size == 7 + 11
    assert thinned.defects.thinned.rows == gapped.times.size
    assert "18 bins" in " ".join(thinned.defects.lines())


def test_flagged_readings_enter_no_mean(tmp_path):
    times = np.arange(0.0, 6000.0, 10.0)
    values = np.full(times.size, 25.0) + 0.01 * np.sin(times)
    values[100:130] = np.nan
    values[200] = 300.0
    thinned = thinned_recording(written(tmp_path, times, T=values), 300.0)
    # Rows 100 to 129: less than half of the fourth bin's (90 to 119), third of the fifth's.
    assert np.flatnonzero(~thinned.usable[:, 0]).tolist() == [3]
    assert np.nanmax(thinned.temperature) < 273.15 + 25.1
    assert thinned.defects.thinned.missing == 1
    assert thinned.defects.thinned.readings_left_out == 31


def test_quantisation_does_not_average_away(tmp_path):
    times = np.arange(0.0, 60000.0, 10.0)
    values = np.round(20.0 + times / 3000.0)
    thinned = thinned_recording(written(tmp_path, times, T=values), 600.0)
    assert thinned.sigma[0] == pytest.approx(0.2)


def test_refusals(gapped):
    with pytest.raises(RecordingError, match="Allowed: above 0"):
        thinned_recording(gapped, 0.0)
    with pytest.raises(RecordingError, match="leave 1 of it"):
        thinned_recording(replace(gapped, segments=np.array([[0, gapped.times.size]])), 1.0e6)
