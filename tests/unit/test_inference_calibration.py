"""Parameters fitted to recordings: the optimum, its uncertainty, outliers, slow errors."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.errors import RecordingError
from spindle_fem.inference.calibration import BOUND_SIGMAS, calibrate, prediction_interval
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError, channel_bins, likely_slow_error, whiten
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from tests.support.straight_line import Line

NETWORK = {
    "schema": "spindle-fem/machine/1",
    "name": "made",
    "network": {
        "node": [
            {"name": "winding", "capacity": {"value": "300 J/K", "sigma_rel": 0.3}},
            {"name": "body", "capacity": {"value": "800 J/K", "sigma_rel": 0.3}},
        ],
        "boundary": [{"name": "ambient", "temperature": "ambient"}],
        "link": [
            {"between": ["winding", "body"], "conductance": {"value": "2 W/K", "sigma_rel": 0.5}},
            {"between": ["body", "ambient"], "conductance": {"value": "0.8 W/K", "sigma_rel": 0.5}},
        ],
        "source": [{"node": "winding", "input": "power", "gain": {"value": "0.9 W/W", "sigma_rel": 0.1}}],
    },
}


@pytest.fixture(scope="module")
def recording(recorded_in, tmp_path_factory):
    """Two hours of heating and cooling; the readings are put in by each test."""
    rng = np.random.default_rng(0)
    times = np.arange(0.0, 7200.0, 20.0)
    frame = pd.DataFrame({"time": times, "room": 20.0 + 0.5 * np.sin(times / 2000.0)})
    frame["power"] = np.select([times < 3000, times < 5000], [40.0, 0.0], 25.0)
    frame[["A", "B"]] = 20.0 + rng.normal(0.0, 0.1, (times.size, 2))
    temperatures, inputs = {"A": "winding", "B": "body"}, {"room": "ambient", "power": "power"}
    found = read_recording(recorded_in(tmp_path_factory.mktemp("made"), frame, temperatures, inputs))
    return replace(found, flags=np.zeros_like(found.flags))


@pytest.fixture(scope="module")
def network():
    return build_network(validate_network_machine(NETWORK, "made").network)


def at_stamps(network, recordings, initial="ambient", use=None):
    spec = validate_network_machine({**NETWORK, "initial": initial}, "made")
    return Predictor(fast_network(network, spec), recordings, use, at_stamps=True)


def priors_of(predictor):
    return (*predictor.uncertain(), *predictor.starts())


def predicted(predictor, log_factors):
    """Readings of the first recording and their derivatives to all logarithms."""
    names = [prior.name for prior in priors_of(predictor)]
    told = predictor.predict(0, dict(zip(names, np.exp(log_factors), strict=True)), (), names)
    return told.temperature, told.sensitivity


def slow_error(rng, times, sigma, time):
    values = np.empty(times.size)
    values[0] = sigma * rng.normal()
    for k, step in enumerate(np.diff(times)):
        kept = np.exp(-step / time)
        values[k + 1] = kept * values[k] + sigma * np.sqrt(1.0 - kept**2) * rng.normal()
    return values


def made(network, recording, truth, rng, *, slow=(0.03, 1200.0)):
    """The recording that a machine with given parameters would have made."""
    exact, _ = predicted(at_stamps(network, [recording]), truth)
    errors = np.stack([slow_error(rng, recording.times, *slow) for _ in range(2)], axis=1)
    return replace(recording, temperature=exact + errors + rng.normal(0.0, 0.1, exact.shape))


def sigmas(predictor):
    return np.array([prior.sigma_log for prior in priors_of(predictor)])


# ------------------------------------------------------------------------ noise
def test_bins_average_what_is_usable_and_nothing_else(recording):
    flags = recording.flags.copy()
    flags[:30, 0] = 1
    some = replace(recording, flags=flags)
    use = recording.times < 6000.0
    first, second = channel_bins(some, use)
    assert first.number.sum() == np.count_nonzero(use) - 30
    assert second.number.sum() == np.count_nonzero(use)
    values = np.column_stack([recording.times, 2.0 * recording.times])
    assert first.average(values)[:, 0] == pytest.approx(first.times)
    assert first.average(values)[:, 1] == pytest.approx(2.0 * first.times)


def test_whitened_errors_have_unit_variance_and_no_memory(recording):
    rng = np.random.default_rng(2)
    bins = channel_bins(recording)[0]
    slow = SlowError(0.2, 900.0)
    white = []
    for _ in range(200):
        error = slow_error(rng, recording.times, slow.sigma, slow.time) + rng.normal(
            0, 0.1, recording.times.size
        )
        white.append(whiten(bins.factor(slow), bins.average(error)))
    white = np.array(white)
    assert white.var() == pytest.approx(1.0, abs=0.05)
    assert np.mean(white[:, 1:] * white[:, :-1]) == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("sigma", [0.02, 0.4])
def test_the_slow_error_is_found_from_residuals(recording, sigma):
    rng = np.random.default_rng(4)
    found = []
    for _ in range(8):
        bins = channel_bins(recording)[0]
        error = slow_error(rng, recording.times, sigma, 1200.0) + rng.normal(0, 0.1, recording.times.size)
        found.append((bins, bins.average(error)))
    best = likely_slow_error(found)
    assert sigma / 2.0 <= best.sigma < 2.0 * sigma
    if sigma > 0.1:
        assert 600.0 <= best.time <= 2400.0
        # What is expected counts as much as a few readings.
        assert likely_slow_error(found, prior=SlowError(0.01)).sigma > 0.1


# -------------------------------------------------------------------------- fit
def test_the_truth_is_found_within_its_uncertainty(network, recording):
    rng = np.random.default_rng(11)
    predictor = at_stamps(network, [recording])
    truth = np.array([0.3, -0.25, 0.5, -0.4, 0.0])
    data = made(network, recording, truth, rng)
    found = calibrate(at_stamps(network, [data]))
    deviation = (found.log_factors - truth) / np.sqrt(np.diag(found.covariance))
    assert np.abs(deviation).max() < 3.0
    assert found.chi_square == pytest.approx(1.0, abs=0.15)
    # A gain and what carries the heat away scale together: only the prior tells them apart.
    names = [prior.name for prior in priors_of(predictor)]
    assert {frozenset(pair[:2]) for pair in found.cannot_tell_apart()} >= {
        frozenset(("conductance.body|ambient", "gain.winding.power"))
    }
    assert "gain.winding.power" in found.unlearned()
    assert found.factors[names[0]] == pytest.approx(np.exp(0.3), rel=0.1)


def test_readings_that_say_nothing_leave_the_prior(network, recording):
    silent = replace(recording, sigma=np.full(2, 1e4))
    found = calibrate(at_stamps(network, [silent]), slow=SlowError(1e4, 600.0))
    assert np.abs(found.log_factors).max() < 1e-3
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(
        [prior.sigma_log for prior in found.priors], rel=1e-3
    )
    assert set(found.unlearned()) == {prior.name for prior in found.priors}


def test_a_few_wild_readings_hardly_move_the_fit(network, recording):
    rng = np.random.default_rng(12)
    truth = np.array([0.2, 0.1, -0.3, 0.3, 0.05])
    data = made(network, recording, truth, rng)
    wild = data.temperature.copy()
    wild[np.arange(7, 350, 50), 0] += 25.0
    clean = calibrate(at_stamps(network, [data]), slow=SlowError(0.03, 1200.0))
    spoiled = calibrate(at_stamps(network, [replace(data, temperature=wild)]), slow=SlowError(0.03, 1200.0))
    assert spoiled.outlier_share > 0.0
    moved = np.abs(spoiled.log_factors - clean.log_factors) / np.sqrt(np.diag(clean.covariance))
    assert moved.max() < 2.0


def test_parameters_stay_within_three_sigma(network, recording):
    rng = np.random.default_rng(13)
    far = np.zeros(5)
    far[3] = 3.0
    data = made(network, recording, far, rng)
    predictor = at_stamps(network, [data])
    found = calibrate(predictor)
    assert np.all(np.abs(found.log_factors) <= BOUND_SIGMAS * sigmas(predictor) + 1e-12)
    assert found.log_factors[3] == pytest.approx(BOUND_SIGMAS * 0.5, rel=0.02)


def test_two_recordings_know_more_than_one(network, recording):
    rng = np.random.default_rng(14)
    truth = np.array([0.1, 0.1, 0.1, 0.1, 0.1])
    first, second = (made(network, recording, truth, rng) for _ in range(2))
    slow = SlowError(0.03, 1200.0)
    one = calibrate(at_stamps(network, [first]), slow=slow)
    both = calibrate(at_stamps(network, [first, second]), slow=slow)
    assert np.all(np.diag(both.covariance) < np.diag(one.covariance))


def test_held_out_readings_do_not_touch_the_fit_and_lie_within_the_interval(network, recording):
    rng = np.random.default_rng(15)
    data = made(network, recording, np.array([0.2, 0.2, -0.2, 0.2, 0.0]), rng)
    use = data.times < 4500.0
    spoiled = data.temperature.copy()
    spoiled[~use] += 50.0
    slow = SlowError(0.03, 1200.0)
    found = calibrate(at_stamps(network, [data], use=[use]), slow=slow)
    other = calibrate(at_stamps(network, [replace(data, temperature=spoiled)], use=[use]), slow=slow)
    assert np.array_equal(found.log_factors, other.log_factors)
    told, sensitivity = predicted(at_stamps(network, [data]), found.log_factors)
    half_width = prediction_interval(found.covariance, slow, sensitivity, data.sigma)
    inside = np.abs(told - data.temperature)[~use] <= half_width[~use]
    assert 0.82 < inside.mean() < 0.98


def test_starting_temperatures_are_fitted_beside_their_reading_by_what_sensors_err(network, recording):
    predictor = at_stamps(network, [recording], "first_reading")
    priors = priors_of(predictor)
    starts = [prior for prior in priors if prior.name.startswith("start.")]
    assert [prior.name for prior in starts] == ["start.0.initial.winding", "start.0.initial.body"]
    spreads = [prior.sigma_log * prior.value for prior in starts]
    assert spreads == pytest.approx([np.hypot(0.1, 1.5)] * 2, rel=1e-6)
    values, slopes = predicted(predictor, np.zeros(len(priors)))
    moved = np.zeros(len(priors))
    place = priors.index(starts[0])
    moved[place] = 1e-6
    difference = (predicted(predictor, moved)[0] - values) / 1e-6
    assert slopes[:, :, place] == pytest.approx(difference, rel=1e-3, abs=1e-2)


def test_starting_temperatures_are_told_by_node_and_number_of_recording(network, recording):
    one, two = (calibrate(at_stamps(network, [recording] * n, "first_reading"), rounds=1) for n in (1, 2))
    assert [p.name for p in one.priors[-2:]] == ["initial.winding", "initial.body"]
    assert [p.name for p in two.priors[-2:]] == ["initial.winding[2]", "initial.body[2]"]


def test_a_recording_without_a_usable_reading_is_refused(network, recording):
    empty = replace(recording, flags=np.ones_like(recording.flags))
    with pytest.raises(RecordingError, match="no usable reading"):
        calibrate(at_stamps(network, [empty]))


def test_a_linear_model_gets_the_posterior_of_linear_regression(recording):
    rng = np.random.default_rng(16)
    offsets = (290.0, 300.0)
    truth = {"level": np.exp(0.2), "slope": np.exp(-0.3)}
    exact = Line([recording], offsets=offsets).predict(0, truth).temperature
    data = replace(recording, temperature=exact + rng.normal(0.0, 0.1, exact.shape))
    slow = SlowError(0.05, 900.0)
    line = Line([data], offsets=offsets)
    found = calibrate(line, slow=slow)
    precision, right = np.diag([0.5**-2, 0.4**-2]), np.zeros(2)
    for column, bins in enumerate(channel_bins(data)):
        factor = bins.factor(slow)
        shape = whiten(factor, bins.average(line.shapes(0)))
        rest = whiten(factor, bins.average(data.temperature[:, column] - offsets[column]))
        precision += shape.T @ shape
        right += shape.T @ rest
    # No whitened residual lies beyond three sigma with this seed, so the loss is quadratic.
    assert found.outlier_share < 0.01
    assert found.covariance == pytest.approx(np.linalg.inv(precision), rel=0.02)
    assert found.log_factors == pytest.approx(np.linalg.solve(precision, right), abs=2e-3)


def coverage(network, recording, cases, seed):
    """Share of true values inside their 90 % interval, parameters drawn from the prior."""
    rng = np.random.default_rng(seed)
    predictor = at_stamps(network, [recording])
    sigma = sigmas(predictor)
    inside = []
    for _ in range(cases):
        truth = np.clip(rng.normal(size=sigma.size), -2.0, 2.0) * sigma
        slow = (rng.uniform(0.02, 0.05), rng.uniform(600.0, 2400.0))
        found = calibrate(at_stamps(network, [made(network, recording, truth, rng, slow=slow)]))
        deviation = (found.log_factors - truth) / np.sqrt(np.diag(found.covariance))
        inside.append(np.abs(deviation) < 1.6449)
    return np.array(inside)


def test_intervals_hold_the_truth_about_nine_times_in_ten(network, recording):
    inside = coverage(network, recording, 12, 21)
    # 60 correlated intervals: nine in ten within three standard errors.
    assert 0.78 <= inside.mean() <= 1.0


@pytest.mark.slow
def test_coverage_over_a_hundred_machines(network, recording):
    inside = coverage(network, recording, 100, 22)
    assert 0.85 <= inside.mean() <= 0.95
