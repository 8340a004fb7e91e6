"""The exported fast model of the recorded spindle on a recording: Python and C as simulate has it."""

import os
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.recordings.align import read_recording
from tests.support.stepped_model import needs_compiler, told_and_found

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
    told, found, in_c = told_and_found(tmp_path, "recorded_spindle", COARSE, read_recording(RECORDING))
    assert np.abs(found - told).max() < AGREEMENT
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-7)
