"""Displacements beside temperatures: units, a constant of their own, slow errors of their own size."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.effects.registry import candidates_for, effect_of
from spindle_fem.inference import full_model_check, full_model_runs, tuned
from spindle_fem.inference.calibration import calibrate
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.diagnosis import diagnose_recordings
from spindle_fem.inference.findings import (
    channel_errors,
    displacement_errors,
    noise_level,
    predictions_at_stamps,
    rmse,
)
from spindle_fem.inference.further_tests import answer, trials_of, unread_displacements
from spindle_fem.inference.growth_misdescriptions import growth_misdescriptions
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.hidden_states import answer_of, readings_about
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.innovations import ZERO_SIGMA
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.misdescription_content import misdescription_content
from spindle_fem.inference.mismatch_place import change_without
from spindle_fem.inference.missing_heat import Pattern
from spindle_fem.inference.next_measurement import EXISTING, next_measurement, reading_covariance
from spindle_fem.inference.opened_machine import DiagnosedMachine, with_growth
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, expected_slow_error, known_before
from spindle_fem.inference.prepared_problem import calibrate as calibrate_machine
from spindle_fem.inference.reading_noise import (
    SlowError,
    Whitener,
    channel_bins,
    likely_slow_error,
)
from spindle_fem.inference.switching_model import Chain, ReadingFilter, find_course
from spindle_fem.inference.unseen_moments import _MomentMisfit
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.compare import write_simulated
from spindle_fem.recordings.conditions import operating_conditions
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.report.diagnosis_data import diagnosis_dataset
from spindle_fem.report.diagnosis_full_model import full_model_sections
from spindle_fem.report.diagnosis_tables import misdescription_blocks, next_blocks
from spindle_fem.report.read_against_predicted import displaced_before_after
from tests.support.nose_spindle import RUN, nose_machine, nose_recording

MANIFEST = """schema = "spindle-fem/recording/1"
name = "nose"
data = "nose.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "T1"
role = "temperature"
probe = "SP01"
unit = "degC"
sigma = 0.1
[[channel]]
column = "S1"
role = "displacement"
probe = "S1"
unit = "um"
sigma = 0.2
"""


@pytest.fixture
def recording(tmp_path):
    times = np.arange(0.0, 7200.0, 60.0)
    rows = [f"{t:g},{20.0 + t / 900.0:.3f},{100.0 + t / 300.0:.3f}" for t in times]
    rows[3] = rows[3].rpartition(",")[0] + ","
    (tmp_path / "nose.csv").write_text("\n".join(("time_s,T1,S1", *rows)))
    (tmp_path / "recording.toml").write_text(MANIFEST)
    return read_recording(tmp_path)


def test_displacements_stand_beside_the_temperatures(recording):
    told = with_displacements(recording)
    assert told.temperature_names == ("T1", "S1")
    assert told.probes == ("SP01", "S1")
    assert told.temperature[[0, 60], 1] == pytest.approx([0.0, 12.0])
    assert told.sigma == pytest.approx([0.1, 0.2])
    assert not told.usable[3, 1]
    assert told.usable[3, 0]
    assert with_displacements(told) is told
    plain, displaced = channel_bins(told)
    assert (plain.is_relative, displaced.is_relative) == (False, True)


def test_a_constant_of_a_displacement_says_nothing(recording):
    plain, displaced = channel_bins(with_displacements(recording))
    random = np.random.default_rng(1).normal(size=len(plain.times))
    for bins, same in ((plain, False), (displaced, True)):
        white = Whitener(bins, SlowError(0.3, 900.0))
        values = random[: len(bins.times)]
        assert np.allclose(white(values), white(values + 250.0)) is same


def test_what_is_left_has_the_likelihood_over_all_constants(recording):
    """Against a Gaussian constant so wide that it is free."""
    _, displaced = channel_bins(with_displacements(recording))
    values = np.random.default_rng(2).normal(size=len(displaced.times)) + 40.0
    width = 1.0e4
    found = []
    for slow in (SlowError(0.05, 600.0), SlowError(0.6, 2400.0)):
        white = Whitener(displaced, slow)
        ours = 2.0 * white.log_root_determinant + np.sum(white(values) ** 2)
        covariance = displaced.factor(slow) @ displaced.factor(slow).T + width**2
        exact = np.linalg.slogdet(covariance)[1] + values @ np.linalg.solve(covariance, values)
        found.append((ours, exact - 2.0 * np.log(width)))
    assert found[0] == pytest.approx((found[0][1],) * 2, rel=1e-5)
    assert found[1] == pytest.approx((found[1][1],) * 2, rel=1e-5)


def test_displacements_have_a_slow_error_of_their_own_size(recording):
    plain, displaced = channel_bins(with_displacements(recording))
    random = np.random.default_rng(3)
    residuals = [
        (bins, bins.factor(true) @ random.normal(size=len(bins.times)))
        for bins, true in ((plain, SlowError(0.02, 1200.0)), (displaced, SlowError(1.6, 1200.0)))
    ]
    for by_channel in (False, True):
        slow = likely_slow_error(residuals, prior=SlowError(0.035), by_channel=by_channel)
        assert slow.of(displaced.key).sigma >= 0.65
        assert slow.of(plain.key).sigma <= 0.05
        assert slow.sigma <= 0.05


# ------------------------------------------------------------------ fits
TRUTH = {"shaft_end_films": 1.4, "heat.front": 1.1}


def test_a_displacement_tells_of_the_shaft(tmp_path):
    """Its interval holds what is true and is narrower; the constant of the sensor does no harm."""
    fast = nose_machine()
    blank = nose_recording(tmp_path, {name: np.full(RUN.size, 20.0) for name in ("SP01", "SP05", "S1")})
    told = Predictor(fast, [with_displacements(blank)], at_stamps=True).predict(0, TRUTH, ()).temperature
    random = np.random.default_rng(5)
    noisy = told + 0.1 * random.normal(size=told.shape)
    readings = {"SP01": noisy[:, 0] - 273.15, "SP05": noisy[:, 1] - 273.15, "S1": noisy[:, 2] + 57.0}
    recording = nose_recording(tmp_path, readings)
    found = {}
    for name, own in (("without", recording), ("with", with_displacements(recording))):
        result = calibrate(Predictor(fast, [own], at_stamps=True))
        found[name] = {item.name: item for item in result.estimates}
        assert result.chi_square < 1.5
    films = {name: item["shaft_end_films"] for name, item in found.items()}
    assert films["with"].low < TRUTH["shaft_end_films"] * films["with"].prior < films["with"].high
    assert films["with"].sigma_log < 0.6 * films["without"].sigma_log


# -------------------------------------------------------------- diagnosis
DRIVE_HEAT = 465.0


@pytest.fixture(scope="module")
def heated(tmp_path_factory):
    """A machine opened on what sensors read while its drive heats the shaft's end; the drive's heat."""
    folder = tmp_path_factory.mktemp("heated")
    fast = nose_machine()
    model = fast.model
    near = tuple(f"near.{name}" for name in model.probe_names)
    model = replace(
        model,
        probe_gradients=np.zeros((len(model.probe_names), 2, model.size)),
        place_names=(*model.place_names, *near),
        places=np.vstack((model.places, model.probes)),
    )
    fast = fast_spindle(model, fast.spec)
    blank = nose_recording(folder, {name: np.full(RUN.size, 20.0) for name in ("SP01", "SP05", "S1")})
    view = view_of(fast.names, blank)
    heat = next(c for c in candidates_for(view) if (c.effect, c.form) == ("drive_heat", "lag"))
    predictor = Predictor(fast, [with_displacements(blank)])
    on_grid = predictor.predict(0, {heat.amplitude: DRIVE_HEAT}, (heat,)).temperature
    told = np.array([np.interp(RUN, predictor.drives[0].grid, column) for column in on_grid.T]).T
    told = told + 0.1 * np.random.default_rng(5).normal(size=told.shape)
    readings = {"SP01": told[:, 0] - 273.15, "SP05": told[:, 1] - 273.15, "S1": told[:, 2] + 57.0}
    recording = nose_recording(folder, readings)
    return DiagnosedMachine("nose", fast.spec, fast, NO_EFFECTS, view, (recording,), ()), heat


def test_a_displacement_narrows_what_is_known_of_heat_in_the_shaft(heated):
    opened, heat = heated
    width, gain = [], []
    for machine in (opened, with_growth(opened)):
        predictor = Predictor(machine.fast, machine.recordings)
        known = calibrate_machine(None, predictor)
        problem = Problem(predictor, known.belief, known.slow, predictor.observations)
        fit = problem.fit((heat,))
        low, high = fit.interval(heat.amplitude, 1.645)
        assert low < DRIVE_HEAT < high
        width.append(high - low)
        gain.append(problem.fit().misfit_with_prior - fit.misfit_with_prior)
    assert width[1] < 0.5 * width[0]
    assert gain[1] > 5.0 * gain[0]


def test_displacements_are_told_apart_from_temperatures(heated):
    """Errors in kelvins, directions of sensors and what is usual leave them out; files have them in µm."""
    opened = with_growth(heated[0])
    predictor = Predictor(opened.fast, opened.recordings)
    recording = opened.recordings[0]
    fit = Problem(predictor, known_before(predictor), EXPECTED_SLOW, predictor.observations).fit()
    told = predictions_at_stamps(predictor, fit)
    far = [told[0] + [0.0, 0.0, 1000.0]]
    assert rmse(predictor, far, heldout=False) == rmse(predictor, told, heldout=False)
    assert noise_level(predictor) == pytest.approx(0.1, rel=1e-4)
    assert [row["channel"] for row in channel_errors(predictor, told)] == ["SP01", "SP05"]
    (row,) = displacement_errors(predictor, told)
    assert (row["channel"], row["noise_um"]) == ("S1", pytest.approx(0.1, rel=1e-4))
    apart = told[0][:, 2] - recording.temperature[:, 2]
    assert np.mean(apart) == pytest.approx(0.0, abs=1e-6)
    assert row["rmse_um"] == pytest.approx(np.std(apart))
    directions = [item.name for item in heat_misdescriptions(predictor)]
    assert "response.SP05" in directions
    assert "response.S1" not in directions
    assert not any(".S1." in name for name in predictor.displacements())
    assert "S1" not in opened.view.channels


def test_other_expansion_coefficients_move_displacements_alone(heated):
    opened = heated[0]
    assert not list(growth_misdescriptions(Predictor(opened.fast, opened.recordings)))
    predictor = Predictor(opened.fast, with_growth(opened).recordings)
    (direction,) = growth_misdescriptions(predictor)
    base = BaseRun(predictor, 0, {}, ())
    moved, told = direction.change(base).direct, base.predicted()
    assert not moved[:, :2].any()
    np.testing.assert_array_equal(moved[:, 2], told[:, 2])
    assert np.ptp(moved[:, 2]) > 10.0


def test_an_expansion_that_is_off_is_told_in_micrometres(heated):
    predictor = Predictor(heated[0].fast, with_growth(heated[0]).recordings)
    predictor = with_misdescriptions(predictor, tuple(growth_misdescriptions(predictor)))
    slow = expected_slow_error(predictor)
    fit = Problem(predictor, known_before(predictor), slow, predictor.observations).fit()
    judgement = SimpleNamespace(verdict="consistent")
    made = SimpleNamespace(
        predictor=predictor,
        unchanged=predictor,
        final=fit,
        stated_fit=fit,
        null=fit,
        judgement=judgement,
        wrong=(),
    )
    content = misdescription_content(made, SimpleNamespace(redefined=None))
    (row,) = content["left_open"]
    assert (row["name"], row["channel"], row["largest_K"]) == ("expansion", "S1", 0.0)
    # Most of the growth is 3 µm/K of the shaft less 1.2 µm/K of the housing.
    assert 1.0 < row["largest_um"] < 50.0
    whole = {"verdict": "consistent", "findings": [], "misdescription": content}
    assert "µm" in str(misdescription_blocks(whole)[0].rows)


def test_what_an_effect_changes_is_measured_on_temperatures_alone(heated):
    with_sensor, without = (
        Predictor(heated[0].fast, recordings)
        for recordings in (with_growth(heated[0]).recordings, heated[0].recordings)
    )
    heat = heated[1]
    fit = SimpleNamespace(candidates=(heat,), values={heat.amplitude: 200.0})
    assert change_without(with_sensor, fit, heat) == pytest.approx(change_without(without, fit, heat))


def test_predictions_are_written_in_the_units_of_their_channels(heated, tmp_path):
    recording = with_growth(heated[0]).recordings[0]
    write_simulated(tmp_path / "after.csv", recording, np.tile([300.0, 301.0, 12.5], (RUN.size, 1)))
    written = pd.read_csv(tmp_path / "after.csv")
    assert written.iloc[0][["SP01", "SP05", "S1"]].tolist() == pytest.approx([26.85, 27.85, 12.5])


def test_a_displacement_expects_an_error_of_its_own_size(heated):
    predictor = Predictor(heated[0].fast, with_growth(heated[0]).recordings)
    slow = expected_slow_error(predictor)
    key = next(item.bins.key for item in predictor.observations if item.bins.is_relative)
    assert slow.of(key).sigma == tuned.DISPLACEMENT_SLOW_SIGMA
    assert (slow.sigma, slow.of(0).sigma) == (EXPECTED_SLOW.sigma, EXPECTED_SLOW.sigma)


def test_heating_follows_from_temperatures_alone(recording):
    shrinking = replace(recording, displacements=-50.0 * recording.displacements)
    assert operating_conditions(with_displacements(shrinking)).names == ("heating",)


def test_a_hidden_state_is_sought_in_displacements_too(heated):
    """What they say of a course does not hang on their zero, and is more than temperatures say alone."""
    opened, _ = heated
    found = {}
    for name, machine in (("without", opened), ("with", with_growth(opened)), ("moved", with_growth(opened))):
        predictor = Predictor(machine.fast, machine.recordings)
        if name == "moved":
            recording = machine.recordings[0]
            shifted = recording.temperature + np.array([0.0, 0.0, 57.0])
            predictor = Predictor(machine.fast, [replace(recording, temperature=shifted)])
        problem = Problem(predictor, known_before(predictor), EXPECTED_SLOW, predictor.observations)
        fit = problem.fit()
        base = BaseRun(predictor, 0, fit.values, ())
        answer = answer_of(base, Pattern("drive_end", ("shaft",)))
        chain = Chain.usual(np.zeros(len(answer.group), dtype=np.int64))
        found[name] = find_course(
            answer, ReadingFilter(readings_about(problem, fit, 0)), chain, 100.0, 1000.0
        )
    assert found["with"].log_evidence > 3.0 * found["without"].log_evidence
    assert found["moved"].log_evidence == pytest.approx(found["with"].log_evidence, rel=1e-6)
    np.testing.assert_array_equal(found["moved"].on, found["with"].on)


def test_the_zero_of_a_displacement_is_free_while_a_state_is_sought(heated):
    """Filtered readings of the sensor alone have the likelihood of a Gaussian with a very wide constant."""
    opened = with_growth(heated[0])
    predictor = Predictor(opened.fast, opened.recordings)
    slow = expected_slow_error(predictor)
    problem = Problem(predictor, known_before(predictor), slow, predictor.observations)
    found = readings_about(problem, problem.fit(), 0)
    only = np.where([False, False, True], found.residual, np.nan)
    bare = replace(found, residual=only, slopes=np.ascontiguousarray(found.slopes[:, :, -1:]))
    assert (bare.slopes[:, :, 0] == [0.0, 0.0, ZERO_SIGMA]).all()
    ours = float(np.sum(ReadingFilter(bare).innovations() ** 2))
    seen = np.isfinite(only[:, 2])
    times, values = np.cumsum(found.steps)[seen], only[seen, 2]
    own = slow.of(-1)
    assert (found.slow_sigma[2], found.slow_sigma[0]) == (own.sigma, slow.of(0).sigma)
    assert own.sigma > slow.of(0).sigma
    apart = np.abs(times[:, None] - times)
    covariance = own.sigma**2 * np.exp(-apart / own.time) + np.diag(found.variance[seen, 2]) + ZERO_SIGMA**2
    assert ours == pytest.approx(values @ np.linalg.solve(covariance, values), rel=1e-6)


def test_a_moment_in_held_out_readings_does_not_follow_from_the_zero_of_a_displacement(heated):
    opened = with_growth(heated[0])
    (recording,), view = opened.recordings, opened.view
    heat = effect_of("unrecorded_heat_source").over(view, next(iter(view.spots)), [(3000.0, 5400.0)])
    name = next(name for name in heat.free if name.endswith("end_1"))
    costs = []
    for zero in (0.0, 10.0):
        moved = replace(recording, temperature=np.add(recording.temperature, [0.0, 0.0, zero]))
        predictor = Predictor(opened.fast, [moved], [(RUN < 4800.0) | (RUN > 6000.0)])
        problem = Problem(predictor, known_before(predictor), EXPECTED_SLOW, predictor.observations)
        fit = problem.fit((heat,), iterations=0)
        costs.append(_MomentMisfit(predictor, fit, fit.values, name).cost)
    assert costs[1] == pytest.approx(costs[0])


def test_the_full_model_checks_displacements_in_micrometres(heated, monkeypatch):
    """A mesh that answers as the fast model does, but for 1 % of growth and a zero of its own."""
    opened = with_growth(heated[0])
    predictor = Predictor(opened.fast, opened.recordings)
    fit = Problem(predictor, known_before(predictor), EXPECTED_SLOW, predictor.observations).fit()
    told = predictor.predict(0, fit.values).temperature

    def run(machine, predictor, number, fit, options):
        readings = dict(zip(("SP01", "SP05"), told.T, strict=False))
        moved = {"S1": 1e-6 * (1.01 * told[:, 2] + 250.0)}
        steps = SimpleNamespace(times=[0.0])
        return SimpleNamespace(steps=steps, reading=readings.get, motion_of=moved.get)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model_check, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model_runs, "_run", run)
    diagnosis = SimpleNamespace(predictor=predictor, unchanged=predictor, null=fit, stated_fit=fit)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    kept = {}
    found = full_model_check.full_model_errors(diagnosis, machine, keep=kept.__setitem__)
    assert found["reason"] is None
    assert [row["channel"] for row in found["differences"]] == ["SP01", "SP05"]
    assert all(row["before_K"] == 0.0 for row in found["differences"])
    (row,) = found["displacement_differences"]
    # Of readings from a zero of their own: 1 % of how far growth goes from its mean.
    away = told[:, 2] - np.interp(RUN, predictor.drives[0].grid, told[:, 2]).mean()
    assert row["before_um"] == pytest.approx(0.01 * np.abs(away).max(), rel=1e-3)
    assert [item["channel"] for item in found["before"]["displacements"]] == ["S1"]
    assert kept["before"][0].shape == (RUN.size, 3)
    fast = predictions_at_stamps(predictor, fit)
    warm, moved = channel_errors(predictor, fast), displacement_errors(predictor, fast)
    total = {"train_rmse_K": 1.0, "heldout_rmse_K": 1.0}
    content = {
        "mismatch": {"channels": warm, "displacements": moved},
        "fit": {
            "before": total,
            "after": total,
            "noise_K": 0.1,
            "channels_after": warm,
            "displacements_after": moved,
            "full_model": found,
        },
    }
    (section,) = full_model_sections(content)
    words, *tables = section.blocks
    assert "µm apart" in words.text
    assert [table.rows[0]["cells"][0] for table in tables[1:]] == ["SP01", "SP01", "S1", "S1"]
    # With nothing found there is one fit, of which each model has a column.
    assert "before" not in words.text
    assert [row["cells"][0] for row in tables[0].rows] == ["fast model", "full model", "noise"]
    assert [c["title"] for c in tables[2].columns] == ["channel", "difference / K"]
    found.pop("displacement_differences")
    assert len(full_model_sections(content)[0].blocks) == 4


@pytest.fixture(scope="module")
def diagnosed(heated):
    """From the recording to the judgement."""
    return diagnose_recordings(with_growth(heated[0]))


@pytest.mark.slow
def test_a_diagnosis_with_displacements_names_the_drive(diagnosed):
    assert [(c.effect, c.component) for c in diagnosed.final.candidates] == [("drive_heat", "drive_end")]
    after = predictions_at_stamps(diagnosed.predictor, diagnosed.final)
    (row,) = displacement_errors(diagnosed.predictor, after)
    assert row["rmse_um"] < 0.15


@pytest.mark.slow
def test_the_dataset_of_a_diagnosis_keeps_displacements_apart(diagnosed):
    before, after = (
        predictions_at_stamps(diagnosed.predictor, fit) for fit in (diagnosed.null, diagnosed.final)
    )
    data = diagnosis_dataset(diagnosed, before, after)
    assert list(data["channel"].values) == ["SP01", "SP05"]
    assert list(data["displacement_name"].values) == ["S1"]
    read = diagnosed.predictor.recordings[0].displacements
    assert data["displacement"].values == pytest.approx(read, abs=1e-11)
    assert data["displacement_noise"].values == pytest.approx(1e-7, rel=0.02)
    left = [float((data[f"displacement_{w}"] - data["displacement"]).std()) for w in ("before", "after")]
    assert left[0] > 5.0 * left[1]
    assert left[1] < 0.15e-6
    shown = displaced_before_after(data, 0).axes[0].lines[0].get_ydata()
    assert np.ptp(shown) == pytest.approx(1e6 * np.ptp(read), rel=1e-4)


def test_one_that_is_not_read_answers_a_test_as_one_that_is(heated):
    """In µm from the start of the test, the stretch by rotation included."""
    opened = with_growth(heated[0])
    fast = opened.fast
    spins = np.array([0.0] * (len(fast.model.probe_names) - 1) + [2e-5])
    fast = fast_spindle(replace(fast.model, probe_spins=spins), fast.spec)
    predictor = Predictor(fast, opened.recordings)
    fit = Problem(predictor, known_before(predictor), EXPECTED_SLOW, predictor.observations).fit()
    (place,) = unread_displacements(opened.spec, ("SP01", "SP05"))
    assert unread_displacements(opened.spec, ("SP01", "S1")) == ()
    for trial in trials_of(predictor, opened.view)[:3]:
        told = answer(predictor, fit, trial, (place,), 600.0)
        read, further = told.readings[:, 2:].T
        assert np.ptp(read) > 1.0
        np.testing.assert_allclose(further, read, atol=1e-6)
        np.testing.assert_allclose(told.slopes[:, 3], told.slopes[:, 2], atol=1e-6)


@pytest.mark.slow
def test_a_diagnosis_without_displacements_proposes_one(heated):
    """Of a machine whose definition has a sensor that nobody read."""
    proposal = next_measurement(diagnose_recordings(heated[0]))
    sensor = "displacement sensor S1 of the definition"
    (option,) = (item for item in proposal["options"] if item["where"] == sensor)
    assert option["sigma_um"] > 0.1
    assert "difference_K" not in option


@pytest.mark.slow
def test_the_next_measurement_reads_the_displacement(diagnosed):
    """Alone with its own change since the start of the test; what differs there is told in micrometres."""
    proposal = next_measurement(diagnosed)
    there = [item for item in proposal["options"] if item["where"] == EXISTING]
    moved = [item for item in there if item["channel"] == "S1"]
    assert moved
    for item in moved:
        assert "difference_K" not in item
        assert abs(item["difference_um"]) < 100.0
        assert item["sigma_um"] > 0.1
    assert "µm" in str(next_blocks({"next_measurement": proposal}))
    words = proposal["why"]
    assert ("µm" in words) == (proposal["quantity"] == "displacement")


def test_a_displacement_counts_from_a_reading_with_its_own_error():
    times, slow = np.array([600.0, 1200.0, 1e7]), SlowError(0.4, 900.0)
    found = reading_covariance(times, 0.3, 60.0, 300.0, slow, counted_from=0.0)
    white = 0.3**2 / 5.0
    assert found[2, 2] == pytest.approx(2.0 * (0.4**2 + white))
    assert found[0, 0] == pytest.approx(2.0 * 0.4**2 * (1.0 - np.exp(-600.0 / 900.0)) + 2.0 * white)
    assert found[0, 2] == pytest.approx(0.4**2 * (1.0 - np.exp(-600.0 / 900.0)) + white)
    plain = reading_covariance(times, 0.3, 60.0, 300.0, slow)
    assert plain[0, 0] == pytest.approx(0.4**2 + white)
