"""Smoothing of measured inputs."""

from dataclasses import make_dataclass

import numpy as np
import pytest

from spindle_fem.recordings.smooth_inputs import smoothed, walk_and_noise, without_input_noise


@pytest.fixture
def walk():
    generator = np.random.default_rng(3)
    true = 293.0 + np.cumsum(0.004 * generator.standard_normal(4000))
    return true, true + 0.05 * generator.standard_normal(4000)


def test_step_and_noise_are_found(walk):
    step, noise = walk_and_noise(walk[1])
    assert np.sqrt(noise) == pytest.approx(0.05, rel=0.05)
    assert np.sqrt(step) == pytest.approx(0.004, rel=0.35)


def test_the_smoother_is_that_of_the_random_walk(walk):
    # Against the normal equations of the same model, away from the ends; the guard against
    # jumps and the truncated tails take a share of the noise of 0.05 back.
    read = walk[1][:300]
    step, noise = 0.004**2, 0.05**2
    difference = np.diff(np.eye(300), axis=0)
    exact = np.linalg.solve(np.eye(300) / noise + difference.T @ difference / step, read / noise)
    assert smoothed(read, step, noise)[80:220] == pytest.approx(exact[80:220], abs=0.008)


def test_a_jump_stays_where_it_is(walk):
    true, read = walk
    true, read = true.copy(), read.copy()
    true[2000:] += 2.0
    read[2000:] += 2.0
    step, noise = walk_and_noise(read)
    assert np.sqrt(noise) == pytest.approx(0.05, rel=0.05)
    left = smoothed(read, step, noise) - true
    assert np.abs(left[1990:2010]).max() < 0.15
    assert left.std() < 0.45 * (read - true).std()


def test_noise_is_seen_through_a_coarse_display():
    # Most neighbours read the same: a bath at 15.03 degC, of which the display shows 15.0 or 15.1.
    generator = np.random.default_rng(1)
    true = 288.18 + 0.01 * np.sin(np.linspace(0.0, 6.0, 1400))
    read = np.round(true + 0.03 * generator.standard_normal(1400), 1)
    step, noise = walk_and_noise(read)
    assert np.sqrt(noise) == pytest.approx((read - true).std(), rel=0.25)
    left = smoothed(read, step, noise) - true
    assert (left - left.mean()).std() < 0.35 * (read - true).std()
    assert walk_and_noise(np.full(100, 288.1)) == (0.0, 0.0)


def test_noise_shrinks_and_a_clean_series_stays(walk):
    true, read = walk
    step, noise = walk_and_noise(read)
    left = smoothed(read, step, noise) - true
    assert left.std() < 0.35 * (read - true).std()
    clean_step, clean_noise = walk_and_noise(true)
    assert clean_noise < 0.1 * clean_step


def test_held_inputs_and_other_units_stay():
    generator = np.random.default_rng(0)
    inputs = 290.0 + 0.05 * generator.standard_normal((400, 3))
    kind = make_dataclass("R", ["inputs", "input_names", "held", "input_units", "segments"])
    recording = kind(
        inputs,
        ("ambient", "set_point", "load"),
        np.array([False, True, False]),
        ("kelvin", "kelvin", "watt"),
        np.array([[0, 400]]),
    )
    found, notes = without_input_noise(recording)
    assert np.ptp(found.inputs[:, 0]) < 0.3 * np.ptp(inputs[:, 0])
    assert np.array_equal(found.inputs[:, 1:], inputs[:, 1:])
    assert len(notes) == 1
    assert "ambient" in notes[0]
