"""What a calibration read, asked at coordinates far from its fit, on a small network."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.inference.coordinate_names import START_PREFIX
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.set_problems import SetProblems
from spindle_fem.inference.tuned import INTERVAL_WIDENING
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "pump",
    {"oil": ("8000 J/K", 0.6), "case": ("20000 J/K", 0.6)},
    {"oil|case": ("90 W/K", 0.5), "case|ambient": ("12 W/K", 0.5), "oil|ambient": ("9 W/K", 0.5)},
    [("oil", "power", ("0.05 W/W", 0.5))],
)
MANIFEST = manifest_text("synthetic", {"T_oil": "oil"}, {"T_room": "ambient", "P": "power"})
BUILT = {"conductance.case|ambient": 1.6, "gain.oil.power": 0.8, "capacity.case": 1.5}
NOISE = 0.1


def recorded(fast, folder, seed, built):
    """The machine as it was built on its duty, with white noise."""
    folder.mkdir()
    times = np.arange(0.0, 40_000.0, 60.0)
    frame = pd.DataFrame(
        {
            "time_s": times,
            "T_oil": 20.0,
            "T_room": 20.0,
            "P": np.where(times % 9000.0 < 4000.0, 8000.0, 500.0),
        }
    )
    for _ in range(2):
        frame.to_csv(folder / "data.csv", index=False)
        (folder / "recording.toml").write_text(MANIFEST)
        recording = read_recording(folder)
        if not built:
            break
        blank = Predictor(fast, [recording])
        told = blank.predict(0, built).temperature[:, 0]
        frame["T_oil"] = np.interp(times, blank.drives[0].grid, told) - 273.15
        frame["T_oil"] += np.random.default_rng(seed).normal(0.0, NOISE, times.size)
        built = {}
    return recording


@pytest.fixture(scope="module")
def fast():
    spec = validate_network_machine(tomllib.loads(MACHINE), "test")
    return fast_network(build_network(spec.network), spec)


@pytest.fixture(scope="module")
def calibrated(fast, tmp_path_factory):
    """Calibration, and a later recording whose links to the room conduct 1.8 times as well."""
    folder = tmp_path_factory.mktemp("pump")
    later = BUILT | {"conductance.case|ambient": 1.8 * 1.6, "conductance.oil|ambient": 1.8}
    earlier = Predictor(fast, [recorded(fast, folder / "earlier", 1, BUILT)])
    predictor = Predictor(fast, [recorded(fast, folder / "later", 2, later)])
    return calibrate(earlier, predictor), predictor


def test_a_fit_begins_where_the_calibration_ended_and_its_readings_cost_nothing_there(calibrated):
    found, _ = calibrated
    start = found.known.start
    assert found.known.at(start).cost == pytest.approx(float(start @ start), abs=1e-6)
    np.testing.assert_array_equal(found.known.start, found.belief.mean)


def test_far_from_the_fit_the_cost_is_that_of_the_readings(calibrated):
    found, _ = calibrated
    earlier = found.known.earlier
    problem = earlier.problem
    far = found.known.start.copy()
    far[[c.name for c in found.known.coordinates].index("conductance.case|ambient")] += 1.5
    values = {c.name: c.at(u) for c, u in zip(found.known.coordinates, far, strict=True)}
    starts = {n: v for n, v in found.fit.values.items() if n.startswith(START_PREFIX)}
    told = problem.predictor.predict(0, values | starts).temperature
    left = problem.data - problem.whitened([told])
    expected = (left @ left - found.fit.residual @ found.fit.residual) / INTERVAL_WIDENING**2
    own = far @ far - found.known.start @ found.known.start
    # The start of the calibration takes up a little of it.
    assert found.known.at(far).cost - own == pytest.approx(expected, rel=0.03)
    assert expected > 1000.0


def test_slopes_of_what_a_calibration_read_are_those_of_differences(calibrated):
    found, _ = calibrated
    at = found.known.start + 0.3
    slopes = found.known.at(at).slopes
    step = 1e-4
    for index in range(len(at)):
        unit = np.zeros(len(at))
        unit[index] = step
        difference = found.known.at(at + unit).residual - found.known.at(at - unit).residual
        np.testing.assert_allclose(
            slopes[:, index], difference / (2.0 * step), atol=1e-4 * np.abs(slopes).max()
        )


def test_about_a_fit_the_belief_is_normal_with_the_same_slope_and_curvature(calibrated):
    found, _ = calibrated
    departure = found.known.at(found.known.start + 0.3)
    local = departure.local(departure.slopes)
    assert local.earlier is None
    normal = local.at(departure.position)
    np.testing.assert_allclose(
        normal.slopes.T @ normal.residual, departure.slopes.T @ departure.residual, rtol=1e-8
    )
    np.testing.assert_allclose(
        normal.slopes.T @ normal.slopes, departure.slopes.T @ departure.slopes, rtol=1e-8, atol=1e-8
    )


def test_what_changed_since_the_calibration_is_not_taken_up_by_the_machine(calibrated):
    """A normal posterior lets all parameters of so rough a machine drift until nothing is left."""
    found, predictor = calibrated

    def nothing_missing(belief):
        return Problem(predictor, belief, found.slow, predictor.observations).fit()

    assert (
        nothing_missing(found.known).misfit_with_prior > 5.0 * nothing_missing(found.belief).misfit_with_prior
    )


def test_what_a_fit_gives_up_of_a_calibration_counts_beside_what_it_leaves(calibrated):
    """Nothing missing tells later readings at the calibration's expense."""
    found, predictor = calibrated
    known = found.known
    at_fit = known.earlier.given_up(known.coordinates, known.start)
    assert max(at_fit.misfit, at_fit.left, at_fit.error) < 1e-6
    final = Problem(predictor, known, found.slow, predictor.observations)
    readings = FollowedReadings(SetProblems(final, final))
    drifted = Problem(predictor, found.belief, found.slow, predictor.observations).fit()
    given = known.earlier.given_up(known.coordinates, drifted.position)
    assert min(given.misfit, given.left, given.error) > 1.0
    alone = Problem(predictor, found.belief, found.slow, predictor.observations)
    assert readings.left(drifted) ** 2 == pytest.approx(
        FollowedReadings(SetProblems(alone, alone)).left(drifted) ** 2 + given.left
    )
