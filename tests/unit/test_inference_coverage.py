"""The study that asks whether stated intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.inference.coverage import coverage_study
from spindle_fem.inference.predictor import Prior
from spindle_fem.recordings.align import read_recording


@pytest.fixture(scope="module")
def recording(recorded_in, tmp_path_factory):
    """Two hours; the readings are put in by the study."""
    times = np.arange(0.0, 7200.0, 30.0)
    frame = pd.DataFrame({"time": times, "room": 20.0})
    frame["A"] = 20.0 + np.random.default_rng(0).normal(0.0, 0.1, times.size)
    folder = recorded_in(tmp_path_factory.mktemp("made"), frame, {"A": "A"}, {"room": "ambient"})
    found = read_recording(folder)
    return replace(found, flags=np.zeros_like(found.flags))


class Line:
    """Level and slope over the recording, in which everything is linear."""

    def __init__(self, recordings, *, stretch=1.0, highest=np.inf):
        self.recordings = tuple(recordings)
        self.priors = (Prior("level", 1.0, 0.5, "K", highest), Prior("slope", 1.0, 0.4, "K"))
        self.stretch = stretch

    def predict(self, log_factors, *, derivatives=True):
        found = []
        for item in self.recordings:
            shapes = np.stack([np.ones(item.times.size), item.times / item.times[-1]], axis=1)
            found.append((290.0 + (shapes @ log_factors)[:, None], self.stretch * shapes[:, None]))
        return found


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
    drawn = []

    class Remembered(Line):
        def predict(self, log_factors, *, derivatives=True):
            if not derivatives:
                drawn.append(log_factors)
            return super().predict(log_factors)

    coverage_study(lambda items: Remembered(items, highest=1.2), (recording,), 30, seed=3)
    drawn = np.array(drawn)
    assert drawn[:, 0].max() <= np.log(1.2)
    assert np.all(np.abs(drawn) <= 3.0 * np.array([0.5, 0.4]))
    assert np.std(drawn[:, 1]) == pytest.approx(0.4, rel=0.35)
