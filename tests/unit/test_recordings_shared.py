"""Recordings that are not part of this repository, where their folder is at hand."""

import os
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.definition.load import machine_folder
from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.compare import compare
from tests.support.network_runs import run_on_recording

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "recordings"
FOLDER = Path(os.environ.get("SPINDLE_FEM_RECORDINGS", BESIDE))
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="no folder of recordings")

# Rows, distinct stamps, rows out of order, repeated rows, long or short gaps, empty cells, spikes:
# counted by hand and by a separate script over the raw files.
EXAMPLES = {
    "example_1_consistent/recording": (1325, 1325, 0, 0, 1, 0, 2),
    "example_2_heat_scale/calibration": (1401, 1401, 0, 0, 0, 0, 2),
    "example_2_heat_scale/recording": (844, 844, 0, 0, 2, 0, 2),
    "example_3_sensor_lag/recording": (669, 669, 0, 0, 1, 0, 3),
    "example_4_thermal_preload/calibration": (700, 699, 1, 1, 0, 6, 2),
    "example_4_thermal_preload/recording": (902, 901, 1, 1, 2, 36, 2),
    "example_5_coolant_film/calibration": (1277, 1277, 0, 0, 0, 0, 3),
    "example_5_coolant_film/recording": (1212, 1212, 0, 0, 1, 0, 3),
    "example_6_gap_closure/recording": (1384, 1383, 1, 1, 1, 39, 0),
    "example_7_unrecorded_heat_source/calibration": (1402, 1401, 1, 1, 0, 0, 0),
    "example_7_unrecorded_heat_source/recording": (1052, 1051, 1, 1, 0, 0, 0),
    "example_8_pair/calibration": (681, 681, 0, 0, 0, 43, 4),
    "example_8_pair/recording": (1401, 1401, 0, 0, 0, 57, 4),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_defects_of_the_examples(name):
    recording = read_recording(FOLDER / "spindle_examples" / f"{name}.toml")
    report = recording.defects
    found = (
        report.rows,
        report.stamps,
        report.unordered_rows,
        report.repeated_rows,
        len(report.gaps),
        sum(item.empty_cells for item in report.channels),
        sum(item.spikes for item in report.channels),
    )
    assert found == EXAMPLES[name]
    assert not any(item.dropouts or item.stuck or item.implausible for item in report.channels)


@pytest.mark.parametrize("name", EXAMPLES)
def test_measured_noise_of_the_examples_is_what_their_manifests_say(name):
    recording = read_recording(FOLDER / "spindle_examples" / f"{name}.toml")
    expected = np.hypot(recording.sigma, [noise.resolution / np.sqrt(12) for noise in recording.noise])
    np.testing.assert_allclose([noise.white for noise in recording.noise], expected, rtol=0.1)


def test_turning_centre():
    recording = read_recording(FOLDER / "turning_centre")
    report = recording.defects
    assert (report.rows, report.stamps, report.unordered_rows) == (181083, 181083, 0)
    assert report.channel("milling_spindle_degC").empty_cells == 6199
    assert recording.start == "2016-05-02T12:41:30Z"
    assert report.median_step_s == 30.0
    assert len(report.gaps) == 1868
    # the sensors have whole degrees, the half-minute means lie between
    assert recording.noise[0].coarse_step == 1.0
    # steep true peaks at restarts and after gaps are not spikes
    assert report.channel("main_spindle_degC").spikes == 0


@pytest.mark.parametrize("name", ["calibration_1", "calibration_2", "calibration_3", "test_1", "test_2"])
def test_bench_motor(name):
    recording = read_recording(FOLDER / "bench_motor" / f"{name}.toml")
    report = recording.defects
    assert report.rows == report.stamps
    assert report.median_step_s == pytest.approx(0.3)
    assert len(report.gaps) == 0
    assert recording.noise[0].resolution == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("machine", "name"), [("bench_motor", "bench_motor/test_1.toml"), ("turning_centre", "turning_centre")]
)
def test_shipped_machines_fit_their_recordings(machine, name):
    """Names and units agree; before calibration the error is only bounded by the priors' width."""
    network = build_network(load_network_machine(machine_folder() / f"{machine}.toml").network)
    recording = read_recording(FOLDER / name)
    result = run_on_recording(network, recording, parameters=network.parameters)
    comparison = compare(recording, result.predicted)
    prior = np.array([parameter.sigma_log for parameter in network.parameters])
    spread = np.sqrt(np.sum((result.sensitivity * prior) ** 2, axis=2) + recording.sigma**2)
    within = np.abs(comparison.residual) < 2.0 * spread
    assert within[np.isfinite(comparison.residual)].mean() > 0.9
