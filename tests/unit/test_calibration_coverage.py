"""The study that asks whether stated intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.recordings.align import read_recording
from tests.support.straight_line import NAMES, Line
from validation.calibration_coverage import coverage_study


@pytest.fixture(scope="module")
def recording(recorded_in, tmp_path_factory):
    """Two hours; the readings are put in by the study."""
    times = np.arange(0.0, 7200.0, 30.0)
    frame = pd.DataFrame({"time": times, "room": 20.0})
    frame["A"] = 20.0 + np.random.default_rng(0).normal(0.0, 0.1, times.size)
    folder = recorded_in(tmp_path_factory.mktemp("made"), frame, {"A": "A"}, {"room": "ambient"})
    found = read_recording(folder)
    return replace(found, flags=np.zeros_like(found.flags))


def test_a_linear_model_is_covered_as_stated(recording):
    found = coverage_study(Line, (recording, recording), 60, seed=4)
    assert found.names == ("level", "slope")
    assert found.deviation.shape == (60, 2)
    # 120 intervals: nine in ten within three standard errors.
    assert 0.8 <= found.inside.mean() <= 0.98
    assert found.by_parameter() == pytest.approx(
        dict(zip(found.names, found.inside.mean(axis=0), strict=True))
    )
    assert np.all(found.sigma_share < 0.5)


def test_intervals_that_are_too_narrow_are_seen(recording):
    # Derivatives twice as large as they are halve what is stated, and the fit still ends at the optimum.
    narrow = coverage_study(lambda items: Line(items, stretch=2.0), (recording,), 40, seed=4)
    assert narrow.inside.mean() < 0.8


def test_the_same_seed_makes_the_same_study(recording):
    first, again, other = (coverage_study(Line, (recording,), 3, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first.deviation, again.deviation)
    assert not np.array_equal(first.deviation, other.deviation)


def test_no_machine_is_drawn_that_a_fit_could_not_reach(recording):
    drawn, made = [], []

    class Remembered(Line):
        def predict(self, number, values, candidates=(), derivatives=(), near=None):
            if self is made[0]:
                drawn.append(np.log([values[name] for name in NAMES]))
            return super().predict(number, values, candidates, derivatives)

    def predictor_of(items):
        made.append(Remembered(items, highest=1.2))
        return made[-1]

    coverage_study(predictor_of, (recording,), 30, seed=3)
    drawn = np.array(drawn)
    assert drawn[:, 0].max() <= np.log(1.2)
    assert np.all(np.abs(drawn) <= 3.0 * np.array([0.5, 0.4]))
    assert np.std(drawn[:, 1]) == pytest.approx(0.4, rel=0.35)
