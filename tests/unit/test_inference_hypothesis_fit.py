"""Fits, evidence and marginal likelihood on a small network, against exact linear-Gaussian results."""

import itertools
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2, multivariate_normal

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.effects.registry import candidates_for, interval_effects
from spindle_fem.errors import ConvergenceError
from spindle_fem.inference.belief import Belief
from spindle_fem.inference.candidate_response import BaseRun, Variant
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.drive_steps import even_drive
from spindle_fem.inference.hypothesis_fit import Problem, candidate_coordinates
from spindle_fem.inference.linearised_fit import LinearProblem
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate, machine_coordinates, slow_error_of
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.robust_size import huber
from spindle_fem.inference.tuned import INTERVAL_WIDENING
from spindle_fem.model.lumped.network_view import view_of_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "small motor",
    {"winding": ("180 J/K", 0.3), "body": ("500 J/K", 0.3), "foot": "900 J/K"},
    {
        "winding|body": ("2.3 W/K", 0.3),
        "body|ambient": ("0.5 W/K", 0.3),
        "body|foot": "1.5 W/K",
        "foot|ambient": "0.8 W/K",
    },
    [("winding", "power", ("0.8 W/W", 0.1)), ("body", "speed", "15 W", {"reference": "1000 rpm"})],
)
MANIFEST = manifest_text(
    "synthetic", {"T_winding": "winding", "T_body": "body"}, {"T_room": "ambient", "P": "power", "n": "speed"}
)
TRUTH = {
    "capacity.winding": 1.2,
    "capacity.body": 0.8,
    "conductance.winding|body": 1.3,
    "conductance.body|ambient": 0.75,
    "gain.winding.power": 1.08,
}
QUIET = SlowError(1e-5, 1500.0)


def frame_of(times, temperatures=None):
    read = np.full((times.size, 2), 21.0) if temperatures is None else temperatures - 273.15
    return pd.DataFrame(
        {
            "time_s": times,
            "T_winding": read[:, 0],
            "T_body": read[:, 1],
            "T_room": 21.0 + np.sin(times / 1500.0),
            "P": np.where(times % 2400.0 < 900.0, 90.0, 10.0),
            "n": np.where(times % 3000.0 < 1500.0, 600.0, 1500.0),
        }
    )


def written(folder, times, temperatures=None):
    frame_of(times, temperatures).to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(MANIFEST)
    return read_recording(folder)


@pytest.fixture(scope="module")
def fast():
    spec = validate_network_machine(tomllib.loads(MACHINE), "test")
    return fast_network(build_network(spec.network), spec)


@pytest.fixture(scope="module")
def blank(fast, tmp_path_factory):
    """The machine on a recording that says nothing yet."""
    recording = written(tmp_path_factory.mktemp("blank"), np.arange(0.0, 9000.0, 30.0))
    return Predictor(fast, [recording], [np.ones(recording.times.size, dtype=bool)])


def synthetic(predictor, folder, seed, values=None, candidates=()):
    """The machine on readings of its own with white noise of 0.1 K."""
    on_grid = predictor.predict(0, values or {}, candidates).temperature
    times = predictor.recordings[0].times
    true = np.column_stack([np.interp(times, predictor.drives[0].grid, column) for column in on_grid.T])
    noise = np.random.default_rng(seed).normal(0.0, 0.1, true.shape)
    recording = written(folder, times, true + noise)
    return Predictor(predictor.fast, [recording], [np.ones(times.size, dtype=bool)])


@pytest.fixture(scope="module")
def view(fast, blank):
    return view_of_network(fast.network, blank.recordings[0])


@pytest.fixture(scope="module")
def candidates(view):
    found = {(c.effect, c.component, c.form): c for c in candidates_for(view)}
    for effect in interval_effects():
        candidate = effect.over(view, "foot", [(2000.0, 4000.0)])
        found[candidate.effect, candidate.component, candidate.form] = candidate
    return found


# ------------------------------------------------------------------------ predictor
def test_derivatives_to_machine_and_start_of_a_network(blank):
    names = [prior.name for prior in blank.uncertain()] + [prior.name for prior in blank.starts()]
    assert len(names) == 5 + 3
    found = blank.predict(0, TRUTH, (), names)
    for column, name in enumerate(names):
        up, down = (
            blank.predict(0, {**TRUTH, name: TRUTH.get(name, 1.0) * np.exp(sign * 1e-5)}).temperature
            for sign in (1.0, -1.0)
        )
        difference = (up - down) / 2e-5
        size = np.abs(difference).max()
        assert size > 0.1, name
        assert np.abs(found.sensitivity[:, :, column] - difference).max() < 1e-5 * size, name


def test_a_start_belongs_to_its_own_recording(fast, blank):
    recording = blank.recordings[0]
    both = Predictor(fast, [recording, recording], [blank.use[0]] * 2)
    names = [prior.name for prior in both.starts()]
    assert len(names) == 6
    first, second = (both.predict(number, {}, (), names).sensitivity for number in (0, 1))
    assert np.abs(first[:, :, 3:]).max() == 0.0
    assert np.abs(second[:, :, :3]).max() == 0.0
    assert first[:, :, :3] == pytest.approx(second[:, :, 3:], abs=1e-12)


def test_first_order_answers_of_a_network_are_differences(blank, candidates):
    chosen = {(c.effect, c.form): c for c in candidates.values()}
    variants = []
    for candidate in chosen.values():
        amplitude = candidate.null + 1e-3 * (candidate.reference - candidate.null)
        variants.append(Variant(replace(candidate, reference=amplitude), candidate.starts[0]))
    base = BaseRun(blank, 0, TRUTH)
    answers = base.responses(variants)
    nothing = blank.predict(0, TRUTH).temperature
    seen = 0
    for column, variant in enumerate(variants):
        candidate = variant.candidate
        factors = {item.name for item in candidate.factors}
        own = variant.values(candidate.reference)
        own = {EFFECT_PREFIX + n if n in factors else n: v for n, v in own.items()}
        difference = blank.predict(0, TRUTH | own, (candidate,)).temperature - nothing
        size = np.abs(difference).max()
        if size < 1e-7:
            assert np.abs(answers[:, :, column]).max() < 1e-6, candidate.label
            continue
        seen += 1
        assert np.abs(answers[:, :, column] - difference).max() < 0.01 * size, candidate.label
    assert seen > 25


def test_even_steps_keep_the_integral_of_every_input(fast, tmp_path):
    generator = np.random.default_rng(3)
    times = np.cumsum(generator.uniform(10.0, 50.0, 300))
    times[150:] += 20000.0
    recording = written(tmp_path, times)
    drive = even_drive(fast, recording)
    fine = fast.inputs.drive(recording, largest_step=np.inf)
    assert len(drive.restarts) == len(fine.restarts) == 1
    ordinary = np.delete(drive.steps, np.array(drive.restarts) - 1)
    # Of a length, but for one at the end of each stretch.
    assert np.sum(np.abs(ordinary - np.median(ordinary)) > 1e-6) <= 2
    cut = (fine.restarts[0], drive.restarts[0])
    for name in ("ambient", "power", "speed"):
        column = drive.names.index(name)
        for part in (0, 1):
            rows = [slice(0, at - 1) if part == 0 else slice(at, None) for at in cut]
            exact, found = (
                float(np.sum(0.5 * (item.start + item.end)[own, column] * item.steps[own]))
                for item, own in ((fine, rows[0]), (drive, rows[1]))
            )
            # The last step reaches beyond the last reading by less than its own length.
            slack = ordinary.max() * np.abs(drive.end[:, column]).max()
            assert abs(found - exact) <= slack, name
    column = drive.names.index("power")
    edges = drive.grid[:40]
    coarse = np.concatenate(([0.0], np.cumsum(drive.start[:39, column] * drive.steps[:39])))
    own = 0.5 * (fine.start + fine.end)[:, column] * fine.steps
    exact = np.interp(edges, fine.grid, np.concatenate(([0.0], np.cumsum(own))))
    assert coarse == pytest.approx(exact, rel=1e-9)


# ------------------------------------------------------------------------- fits
def test_known_parameters_lie_within_their_intervals(blank, tmp_path):
    squares, inside = [], 0
    for seed in range(5):
        folder = tmp_path / str(seed)
        folder.mkdir()
        predictor = synthetic(blank, folder, seed, TRUTH)
        belief = Belief.prior(calibrate(None, predictor).belief.coordinates)
        fit = Problem(predictor, belief, QUIET, predictor.observations).fit()
        own = [i for i, c in enumerate(fit.coordinates) if c.name in TRUTH]
        true = np.array([fit.coordinates[i].of(TRUTH[fit.coordinates[i].name]) for i in own])
        apart = fit.position[own] - true
        squares.append(apart @ np.linalg.solve(fit.covariance[np.ix_(own, own)], apart))
        for name, value in TRUTH.items():
            low, high = fit.interval(name, 1.645)
            inside += low < value < high
            assert high / low < 1.3, name
            # What is stated is wider by what an inexact model adds, and no wider than what was known.
            stated = np.log(fit.interval(name, 1.645, fit.stated_sigmas))
            assert 1.3 < (stated[1] - stated[0]) / np.log(high / low) < 1.01 * INTERVAL_WIDENING, name
        assert (fit.stated_sigmas[: len(belief.mean)] <= 1.0 + 1e-9).all()
        assert fit.reduced_misfit == pytest.approx(1.0, abs=0.15)
    assert chi2.sf(sum(squares), 5 * len(TRUTH)) > 1e-3
    assert 17 <= inside <= 25


def test_a_fit_does_not_depend_on_where_it_starts(blank, tmp_path):
    predictor = synthetic(blank, tmp_path, 1, TRUTH)
    problem = Problem(predictor, calibrate(None, predictor).belief, QUIET, predictor.observations)
    near = problem.fit((), TRUTH)
    far = problem.fit((), {name: 1.0 / value for name, value in TRUTH.items()})
    assert far.misfit_with_prior == pytest.approx(near.misfit_with_prior, abs=0.1)
    sigma = np.sqrt(np.diag(near.covariance))
    assert np.all(np.abs(far.position - near.position) < 0.3 * sigma)


def test_steps_that_are_refused_cost_no_derivatives_and_are_not_tried_again(blank, tmp_path, monkeypatch):
    monkeypatch.setattr("spindle_fem.inference.tuned.SLOPES_KEPT", 0)
    predictor = synthetic(blank, tmp_path, 1, TRUTH)
    problem = Problem(predictor, calibrate(None, predictor).belief, QUIET, predictor.observations)
    asked = []
    plain = Problem.predict

    def predict(self, candidates, coordinates, position, *, by=None, near=None):
        # Nothing that the first step leads to can be simulated but what lies close to the start.
        if by == () and asked and np.abs(position - asked[0][0]).max() > 0.1:
            asked.append((position, "refused"))
            raise ConvergenceError("here", "nothing is found.")
        asked.append((position, "taken" if by == () else "slopes"))
        return plain(self, candidates, coordinates, position, by=by, near=near)

    monkeypatch.setattr(Problem, "predict", predict)
    problem.fit((), {name: 1.0 / value for name, value in TRUTH.items()}, iterations=1)
    kinds = [kind for _, kind in asked]
    assert kinds[:2] == ["taken", "slopes"]
    assert kinds.count("slopes") == kinds.count("taken") == 2
    start = asked[0][0]
    refused = [position - start for position, kind in asked if kind == "refused"]
    assert len(refused) > 1
    for first, second in itertools.pairwise(refused):
        assert np.abs(first - second).max() > 0.04 * np.abs(first).max()


def predictions_noted(monkeypatch):
    """Whether each prediction that is made from now on has derivatives."""
    asked = []
    plain = Problem.predict

    def predict(self, candidates, coordinates, position, *, by=None, near=None):
        asked.append(by != ())
        return plain(self, candidates, coordinates, position, by=by, near=near)

    monkeypatch.setattr(Problem, "predict", predict)
    return asked


def test_a_fit_that_cannot_come_near_enough_is_given_up(blank, tmp_path, monkeypatch):
    monkeypatch.setattr("spindle_fem.inference.tuned.SLOPES_KEPT", 0)
    predictor = synthetic(blank, tmp_path, 1, TRUTH)
    problem = Problem(predictor, calibrate(None, predictor).belief, QUIET, predictor.observations)
    asked = predictions_noted(monkeypatch)
    start = {name: 1.0 / value for name, value in TRUTH.items()}
    whole = problem.fit((), start)
    steps = asked.count(True)
    asked.clear()
    within_reach = problem.fit((), start, hopeless=1.01 * whole.misfit_with_prior)
    assert within_reach.misfit_with_prior == whole.misfit_with_prior
    assert asked.count(True) == steps
    asked.clear()
    problem.fit((), start, hopeless=-1e9)
    assert asked.count(True) == 2 < steps


def test_derivatives_that_hold_are_used_again(blank, tmp_path, monkeypatch):
    predictor = synthetic(blank, tmp_path, 1, TRUTH)
    problem = Problem(predictor, calibrate(None, predictor).belief, QUIET, predictor.observations)
    asked = predictions_noted(monkeypatch)
    start = {name: 1.0 / value for name, value in TRUTH.items()}

    def fitted(kept, **told):
        monkeypatch.setattr("spindle_fem.inference.tuned.SLOPES_KEPT", kept)
        asked.clear()
        return problem.fit((), start, **told), asked.count(True)

    every, steps = fitted(0)
    for kept in (1, 2):
        some, fewer = fitted(kept)
        assert fewer <= 0.75 * steps
        assert abs(some.misfit_with_prior - every.misfit_with_prior) < 0.1
        assert np.abs(some.position - every.position).max() < 0.1
        assert some.log_evidence == pytest.approx(every.log_evidence, abs=0.1)
    (exact, steps), (same, as_many) = fitted(0, exact=True), fitted(1, exact=True)
    assert steps == as_many
    assert np.array_equal(exact.position, same.position)


def test_a_fit_does_not_end_by_derivatives_of_an_earlier_step(blank, tmp_path, monkeypatch):
    """Those here say that nothing moves the readings, so that no step promises anything."""
    predictor = synthetic(blank, tmp_path, 1, TRUTH)
    problem = Problem(predictor, calibrate(None, predictor).belief, QUIET, predictor.observations)
    start = {name: 1.0 / value for name, value in TRUTH.items()}
    wanted = problem.fit((), start)

    def useless(self, point):
        still = None if self.kept else replace(self, jacobian=1e-9 * self.jacobian, kept=1)
        return still and replace(still, point=point, pulled=point.apart.slopes)

    monkeypatch.setattr("spindle_fem.inference.fit_objective.Slopes.kept_at", useless)
    assert problem.fit((), start).misfit_with_prior == pytest.approx(wanted.misfit_with_prior, abs=0.1)


def test_a_prediction_without_derivatives_is_the_same(blank):
    predictor = blank
    belief = calibrate(None, predictor).belief
    problem = Problem(predictor, belief, QUIET, predictor.observations)
    at = belief.mean + 0.3
    whole = problem.predict((), belief.coordinates, at)
    bare = problem.predict((), belief.coordinates, at, by=(), near=whole)
    assert bare[0].sensitivity.shape[2] == 0
    assert whole[0].sensitivity.shape[2] == len(belief.coordinates)
    assert np.abs(bare[0].temperature - whole[0].temperature).max() < 1e-9


def sensor(candidates, effect):
    """The candidate of a sensor effect on the second channel."""
    own = [c for c in candidates.values() if c.effect == effect and c.reading.channel == "T_body"]
    assert len(own) == 1
    return own[0]


def test_a_sensor_offset_has_the_evidence_of_its_exact_gaussian(blank, candidates, tmp_path, monkeypatch):
    """An offset is linear: with the machine fixed, data are exactly Gaussian."""
    # Gaussian tails: nothing is an outlier.
    monkeypatch.setattr("spindle_fem.inference.robust_size.OUTLIER_SIGMAS", 1e9)
    offset = sensor(candidates, "sensor_offset")
    predictor = synthetic(blank, tmp_path, 5, {offset.amplitude: 0.06}, (offset,))
    nothing = Belief.prior(())
    slow = SlowError(0.02, 900.0)
    problem = Problem(predictor, nothing, slow, predictor.observations)
    empty, with_offset = problem.fit(), problem.fit((offset,))
    sigma = offset.parameters[offset.amplitude].sigma
    exact = {}
    predicted = predictor.predict(0, {}).temperature
    for spread in (0.0, sigma):
        total = 0.0
        for item in predictor.observations:
            factor = item.bins.factor(slow)
            covariance = factor @ factor.T
            if predictor.recordings[0].temperature_names[item.channel] == "T_body":
                covariance = covariance + spread**2
            residual = item.values - item.at(predicted[:, item.channel])
            total += multivariate_normal.logpdf(residual, np.zeros(len(residual)), covariance)
        exact[spread] = total
    gained = with_offset.log_evidence - empty.log_evidence
    assert gained == pytest.approx(exact[sigma] - exact[0.0], abs=1e-3)
    low, high = with_offset.interval(offset.amplitude, 2.0)
    assert low < 0.06 < high


def test_an_amplitude_of_one_sign_counts_the_half_prior_twice(blank, candidates, tmp_path):
    lag = sensor(candidates, "sensor_lag")
    (coordinate,) = candidate_coordinates(lag)
    assert coordinate.low == 0.0
    assert not coordinate.logarithmic
    predictor = synthetic(blank, tmp_path, 6, {lag.amplitude: 150.0}, (lag,))
    problem = Problem(predictor, Belief.prior(()), QUIET, predictor.observations)
    fit = problem.fit((lag,), {lag.amplitude: 60.0})
    assert fit.values[lag.amplitude] == pytest.approx(150.0, abs=5.0)
    # By quadrature over the half normal.
    values = np.linspace(120.0, 180.0, 121)
    misfits = []
    for value in values:
        read = problem.whitened([predictor.predict(0, {lag.amplitude: value}, (lag,)).temperature])
        misfits.append(float(np.sum(huber(problem.data - read))))
    prior = 2.0 * np.exp(-0.5 * (values / coordinate.sigma) ** 2) / (np.sqrt(2.0 * np.pi) * coordinate.sigma)
    likelihood = np.exp(-0.5 * (np.array(misfits) - min(misfits)))
    exact = np.log(np.trapezoid(prior * likelihood, values)) - 0.5 * min(misfits)
    assert fit.log_evidence == pytest.approx(exact, abs=0.05)


def test_marginal_likelihood_of_columns_is_that_of_the_whole_covariance(blank, tmp_path):
    predictor = synthetic(blank, tmp_path, 8, TRUTH)
    calibrated = calibrate(None, predictor)
    coordinates = calibrated.belief.coordinates
    generator = np.random.default_rng(0)
    root = np.triu(generator.normal(0.0, 0.3, (len(coordinates),) * 2)) + 1.5 * np.eye(len(coordinates))
    belief = Belief(coordinates, 0.2 * generator.normal(size=len(coordinates)), root)
    problem = Problem(predictor, belief, QUIET, predictor.observations)
    fit = problem.fit()
    linear = LinearProblem.about(problem, fit)
    # One reading went astray: it counts less.
    linear.weight[17] = 0.4
    weight = linear.weight
    predicted = problem.predict((), fit.coordinates, fit.position)
    jacobian = problem.whitened([p.sensitivity for p in predicted])
    residual = problem.data - problem.whitened([p.temperature for p in predicted])
    linear.data[:] = weight * (residual + jacobian @ (fit.position - belief.mean))
    linear.jacobian[:] = weight[:, None] * np.linalg.solve(root.T, jacobian.T).T
    columns = generator.normal(size=(len(weight), 3))
    gram, data, total = linear.gram(columns)
    # The machine's coordinates as part of the covariance, by its dense inverse.
    prior = np.linalg.inv(root.T @ root)
    weighted = weight[:, None] * jacobian
    inverse = np.linalg.inv(np.eye(len(weight)) + weighted @ prior @ weighted.T)
    seen, read = weight[:, None] * columns, linear.data
    assert gram == pytest.approx(seen.T @ inverse @ seen, rel=1e-8)
    assert data == pytest.approx(seen.T @ inverse @ read, rel=1e-7, abs=1e-7)
    assert total == pytest.approx(read @ inverse @ read, rel=1e-7)


def test_what_other_readings_say_is_the_evidence_that_they_add(blank, tmp_path):
    predictor = synthetic(blank, tmp_path, 4, TRUTH)
    belief = Belief.prior(calibrate(None, predictor).belief.coordinates)
    first, second = (
        tuple(item for item in predictor.observations if item.channel == channel) for channel in (0, 1)
    )
    one, other, both = (Problem(predictor, belief, QUIET, seen) for seen in (first, second, first + second))
    fit = one.fit(exact=True)
    together = both.fit((), fit.values, exact=True)
    added = -2.0 * (together.log_evidence - fit.log_evidence)
    assert other.averaged_misfit(fit) == pytest.approx(added, rel=0.02)
    # At the fit alone they seem far less likely: the body's own capacity is not known from the winding.
    assert other.cost_at((), fit.values) > 1.4 * added


def test_what_calibration_told_is_the_belief_of_the_diagnosis(fast, blank, tmp_path):
    earlier = synthetic(blank, tmp_path, 11, TRUTH)
    calibrated = calibrate(earlier, blank)
    fit, belief = calibrated.fit, calibrated.belief
    count = len(machine_coordinates(blank))
    assert [c.name for c in belief.coordinates[:count]] == [c.name for c in fit.coordinates[:count]]
    covariance = np.linalg.inv(belief.root.T @ belief.root)
    # What was learned beyond the prior, of unit variance, counts as widely as intervals are stated.
    learned = np.linalg.inv(fit.covariance[:count, :count]) - np.eye(count)
    expected = np.linalg.inv(np.eye(count) + learned / INTERVAL_WIDENING**2)
    assert covariance[:count, :count] == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert belief.mean[:count] == pytest.approx(fit.position[:count])
    for coordinate, position in zip(belief.coordinates[:count], belief.mean, strict=False):
        assert coordinate.at(position) == pytest.approx(TRUTH[coordinate.name], rel=0.1)
    # Temperatures at the start of the other recording are as open as before.
    assert covariance[count:, count:] == pytest.approx(np.eye(3))


def test_slow_error_of_white_readings_is_small_and_of_drifting_ones_is_not(blank, tmp_path):
    names = ("white", "drifting")
    found = {}
    for name in names:
        folder = tmp_path / name
        folder.mkdir()
        predictor = synthetic(blank, folder, 12)
        if name == "drifting":
            wander = 0.8 * np.sin(predictor.recordings[0].times / 400.0)[:, None]
            predictor = synthetic_with(blank, folder, predictor.recordings[0].temperature + wander)
        problem = Problem(predictor, Belief.prior(()), SlowError(0.1, 300.0), predictor.observations)
        found[name] = slow_error_of(problem, problem.fit())
    # A tenth of a per cent of what the temperatures move is the least that a network is off.
    moved = np.ptp(np.quantile(blank.predict(0, {}).temperature, [0.05, 0.95], axis=0), axis=0)
    assert found["white"].sigma == pytest.approx(0.001 * np.median(moved), rel=0.1)
    assert found["drifting"].sigma >= 2.0 * found["white"].sigma
    assert found["drifting"].sigma == pytest.approx(0.8 / np.sqrt(2.0), rel=1.0)


def synthetic_with(predictor, folder, temperatures):
    recording = written(folder, predictor.recordings[0].times, temperatures)
    return Predictor(predictor.fast, [recording], [np.ones(recording.times.size, dtype=bool)])


# ------------------------------------------------------------------- coordinates


# ---------------------------------------------------------------------- whitener
