"""Calibrations of a machine with geometry whose parameters are known: stated intervals hold the truth."""

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.recordings.align import read_recording
from validation.calibration_coverage import coverage_study

PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05", "COOLANT_OUT")
INPUTS = ("speed", "thrust", "ambient", "coolant_inlet")


@pytest.fixture(scope="module")
def recording(recorded_in, tmp_path_factory):
    """Seven hours of four speeds and standstill, a reading every half minute; the study puts readings in."""
    times = np.arange(0.0, 7.0 * 3600.0, 30.0)
    steps = np.array([3000.0, 1500.0, 4500.0, 0.0, 2500.0])
    frame = pd.DataFrame({"time": times, "speed": steps[np.minimum(times // 5400.0, 4).astype(int)]})
    frame["thrust"] = 1750.0
    frame["ambient"] = 20.0 + np.sin(times / 5000.0)
    frame["coolant_inlet"] = 17.0 + 0.3 * np.cos(times / 1500.0)
    noise = np.random.default_rng(0).normal(0.0, 0.1, (times.size, len(PROBES)))
    frame[list(PROBES)] = 20.0 + noise
    temperatures, inputs = ({name: name for name in names} for names in (PROBES, INPUTS))
    folder = tmp_path_factory.mktemp("made")
    return read_recording(recorded_in(folder, frame, temperatures, inputs))


@pytest.mark.slow
def test_a_hundred_spindles_drawn_from_their_prior(recording, record_property):
    """Nine in ten intervals of all parameters, and no parameter far from that."""
    fast = fast_model_for(load_machine("recorded_spindle", ["mesh.preset=coarse"]), [recording])
    found = coverage_study(lambda items: Predictor(fast, items, at_stamps=True), (recording,), 100, seed=6)
    for name, share in found.by_parameter().items():
        narrower = np.median(found.sigma_share[:, found.names.index(name)])
        record_property(name, share)
        print(f"{name:28s} {share:.2f}  interval {narrower:.2f} of the prior's")
    print(f"all {found.inside.mean():.3f}")
    assert 0.85 <= found.inside.mean() <= 0.95
    # A hundred cases: 0.9 within three standard errors.
    assert all(0.81 <= share <= 0.99 for share in found.by_parameter().values())
