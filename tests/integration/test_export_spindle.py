"""The exported fast model of the recorded spindle on a recording: Python and C as simulate has it."""

import os
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.commands.export_command import export_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.export.portable_model import PortableModel
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.stepped_model import c_readings_along, needs_compiler, readings_along

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "recordings"
RECORDING = (
    Path(os.environ.get("SPINDLE_FEM_RECORDINGS", BESIDE)) / "spindle_examples" / "example_1_consistent"
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not RECORDING.is_dir(), reason="no folder of recordings"),
]
# Largest difference from simulate, K.
AGREEMENT = 1e-3
COARSE = ("mesh.preset=coarse",)


@needs_compiler
def test_python_and_c_agree_with_simulate(tmp_path):
    export_machine("recorded_spindle", tmp_path / "model.npz", COARSE)
    export_machine("recorded_spindle", tmp_path / "model.c", COARSE)
    spec, recording = load_machine("recorded_spindle", COARSE), read_recording(RECORDING)
    drive = drive_of_recording(spec, recording)
    start = drive.first("ambient")
    fast = fast_model_for(spec, [recording], as_given=True)
    told = simulate_fast(fast, drive, start).temperature - ZERO_CELSIUS_K
    model = PortableModel.load(tmp_path / "model.npz")
    rows = np.searchsorted(drive.grid, drive.times[1:] - 1e-7) - 1
    found = readings_along(model, drive, {0: start - ZERO_CELSIUS_K})[rows]
    assert np.abs(found - told[1:]).max() < AGREEMENT
    in_c = c_readings_along(tmp_path, "recorded_spindle", model, drive, start - ZERO_CELSIUS_K)[rows]
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-7)
