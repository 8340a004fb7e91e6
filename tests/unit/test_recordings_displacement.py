"""Displacement channels: read in metres from their first reading, written in micrometres."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from spindle_fem.errors import FaultsError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.compare import displacement_errors, write_simulated

MANIFEST = """schema = "spindle-fem/recording/1"
name = "nose"
data = "nose.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "T1"
role = "temperature"
probe = "SP01"
unit = "degC"
[[channel]]
column = "S1"
role = "displacement"
probe = "S1"
unit = "um"
"""
DATA = "time_s,T1,S1\n0,20.0,\n60,20.5,101.0\n120,21.0,104.5\n180,21.5,108.0\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "recording.toml").write_text(MANIFEST)
    (tmp_path / "nose.csv").write_text(DATA)
    return tmp_path


def test_displacements_count_from_their_first_reading(folder) -> None:
    recording = read_recording(folder)
    assert recording.displacement_names == recording.displacement_sensors == ("S1",)
    np.testing.assert_allclose(recording.displacements[:, 0], [np.nan, 0.0, 3.5e-6, 7.0e-6], atol=1e-15)
    assert recording.temperature_names == ("T1",)


def test_simulated_displacements_are_written_in_micrometres(folder) -> None:
    recording = read_recording(folder)
    predicted = np.array([[0.0], [0.0], [4.5e-6], [6.0e-6]])
    write_simulated(folder / "simulated.csv", recording, recording.temperature, predicted)
    written = pd.read_csv(folder / "simulated.csv")
    assert written["S1"].tolist() == [0.0, 0.0, 4.5, 6.0]
    (error,) = displacement_errors(recording, predicted)
    assert error["rmse_um"] == pytest.approx(np.sqrt(2.0 / 3.0))
    assert error["max_um"] == pytest.approx(1.0)


def test_a_displacement_in_kelvins_is_refused(folder) -> None:
    (folder / "recording.toml").write_text(MANIFEST.replace('"um"', '"degC"'))
    with pytest.raises(FaultsError, match="Allowed: units of m"):
        read_recording(folder)
