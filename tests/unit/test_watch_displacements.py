"""The watch of a machine whose growth is read: the sensor's zero, growth by pieces, a nose that leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import misdescription_columns, tuned
from spindle_fem.inference.continued_run import ContinuedRun
from spindle_fem.inference.growth_misdescriptions import growth_misdescriptions
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.innovations import InnovationFilter
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate, machine_coordinates
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.watched_machine import WatchedMachine, white_noise
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.recordings.manifest import load_manifest
from spindle_fem.recordings.recording_window import RecordingWindow, piece_of
from tests.support.nose_spindle import RUN, nose_machine, nose_recording

NAMES = ("SP01", "SP05", "S1")
# Where the sensor is set, µm.
SET_AT = 357.0


@pytest.fixture(scope="module")
def fast():
    return nose_machine()


@pytest.fixture(autouse=True)
def few_directions(monkeypatch):
    monkeypatch.setattr(misdescription_columns, "PROVIDERS", (heat_misdescriptions, growth_misdescriptions))


@pytest.fixture
def sound(fast, tmp_path):
    """A recording of the machine as it is defined."""
    blank = nose_recording(tmp_path, {name: np.full(RUN.size, 20.0) for name in NAMES})
    told = Predictor(fast, [with_displacements(blank)], at_stamps=True).predict(0, {}, ()).temperature
    told = told + 0.1 * np.random.default_rng(8).normal(size=told.shape)
    columns = (told[:, 0] - 273.15, told[:, 1] - 273.15, told[:, 2] + SET_AT)
    return nose_recording(tmp_path, dict(zip(NAMES, columns, strict=True)))


def watched_on(fast, recording):
    run = ContinuedRun(fast, NO_EFFECTS)
    grown = with_displacements(recording)
    known = calibrate(None, run.begins(grown))
    watched = WatchedMachine(run, known, white_noise(grown), width=60.0, alarms=1.0)
    return watched.follow(grown, to_end=True)


def test_the_first_reading_sets_the_zero_and_later_ones_are_white():
    generator, slow, white = np.random.default_rng(7), SlowError(0.5, 1000.0), np.array([0.3])
    filtered = InnovationFilter(np.array([[1.0]]), [slow], [0])
    error, kept, found = 0.0, np.exp(-60.0 / slow.time), []
    for instant in range(3000):
        error = kept * error + slow.sigma * np.sqrt(1.0 - kept**2) * generator.standard_normal()
        slope = np.array([[4.0 * np.sin(instant / 300.0)]])
        read = SET_AT + 0.7 * slope[:, 0] + error + white * generator.standard_normal(1)
        found.append(filtered.step(60.0, read, slope, white, learn=True)[0])
    assert np.isnan(found[0])
    numbers = np.array(found[1:])
    assert np.std(numbers) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(numbers[1:] * numbers[:-1])) < 0.05
    assert filtered.mean[0] == pytest.approx(0.7, abs=0.1)
    assert filtered.zeros == pytest.approx([SET_AT], abs=0.5)


def test_growth_is_followed_from_piece_to_piece(fast, sound):
    grown = with_displacements(sound)
    run = ContinuedRun(fast, NO_EFFECTS)
    coordinates = machine_coordinates(run.begins(grown))
    names = [c.name for c in coordinates]
    assert "misdescribed.expansion" in names
    values = {c.name: c.at(0.5) for c in coordinates}
    whole, *_ = run.follow(grown, values, names, 60.0)
    run.restart()
    for begin, stop in ((0, 40), (39, 100), (99, RUN.size)):
        piece, *_ = run.follow(piece_of(grown, begin, stop), values, names, 60.0)
    assert piece.temperature[-1] == pytest.approx(whole.temperature[-1], abs=2e-3)
    assert piece.sensitivity[-1] == pytest.approx(whole.sensitivity[-1], rel=2e-3, abs=1e-2)


def test_a_window_counts_displacements_from_one_zero(sound, tmp_path):
    manifest, data = load_manifest(tmp_path)
    window = RecordingWindow(manifest, data, lambda text: None)
    lines = data.read_bytes().split(b"\n")
    window.add(lines[:100])
    first = window.recording()
    window.use(float(window.waiting[-1]))
    window._rows = window._rows[50:]
    window.add(lines[100:120])
    again = window.recording()
    assert again.displacements[0] == pytest.approx(first.displacements[50])
    column = lines[0].split(b",").index(b"S1")
    assert 1e6 * first.displacements[0, 0] == pytest.approx(float(lines[1].split(b",")[column]))


def test_a_sound_machine_stays(fast, sound):
    assert {item.state for item in watched_on(fast, sound)} == {"as modelled"}


def test_a_nose_that_moves_by_itself_leaves_in_micrometres(fast, sound):
    moved = sound.displacements + 6e-6 * (RUN >= 6000.0)[:, None]
    told = watched_on(fast, replace(sound, displacements=moved))
    assert {item.state for item in told if item.time < 5900.0} == {"as modelled"}
    left = next(item for item in told if item.state == "left")
    assert (left.channel, left.displaced) == ("S1", True)
    assert left.time < 7500.0
    assert max(item.departure for item in told if item.displaced) == pytest.approx(6.0, abs=1.5)


def test_a_calibration_without_displacements_leaves_theirs_as_expected(fast, sound):
    earlier = Predictor(fast, [sound])
    known = calibrate(earlier, Predictor(fast, [with_displacements(sound)]))
    assert known.slow.of(-1).sigma == tuned.DISPLACEMENT_SLOW_SIGMA
    assert known.slow.of(0).sigma == known.slow.sigma
