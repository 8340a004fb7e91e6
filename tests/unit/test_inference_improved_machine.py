"""The improved machine, written and read back: it predicts what the fit did."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from spindle_fem.effects.registry import candidates_for, effect_of, interval_effects
from spindle_fem.inference.findings import predictions_at_stamps, reported_parameters, rmse
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.improved_machine import improved_machine
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate, expected_slow_error
from spindle_fem.inference.sufficiency import response_time, says_too_little
from spindle_fem.recordings.align import read_recording
from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "small motor",
    {"winding": ("180 J/K", 0.3), "body": {"low": "400 J/K", "high": "700 J/K"}},
    {"winding|body": ("2.3 W/K", 0.3), "body|ambient": "0.9 W/K"},
    [("winding", "power", ("0.8 W/W", 0.1))],
    initial="ambient",
)
MANIFEST = manifest_text(
    "synthetic", {"T_winding": "winding", "T_body": "body"}, {"T_room": "ambient", "P": "power"}
)


def written(folder, temperatures=None):
    times = np.arange(0.0, 6000.0, 30.0)
    read = np.full((times.size, 2), 21.0) if temperatures is None else temperatures - 273.15
    columns = {"time_s": times, "T_winding": read[:, 0], "T_body": read[:, 1], "T_room": 21.0}
    columns["P"] = np.where(times % 2400.0 < 900.0, 90.0, 10.0)
    pd.DataFrame(columns).to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(MANIFEST)
    return read_recording(folder)


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    folder = tmp_path_factory.mktemp("machine")
    (folder / "machine.toml").write_text(MACHINE)
    return open_machine(folder / "machine.toml", (), [written(folder)], ())


def predictor_of(machine, recording=None):
    chosen = machine.recordings[0] if recording is None else recording
    return Predictor(machine.fast, [chosen], [np.ones(chosen.times.size, dtype=bool)], machine.effects)


def candidate_of(opened, effect):
    for item in interval_effects():
        if item.name == effect:
            return item.over(opened.view, "body", [(1500.0, 3000.0)])
    return next(
        c
        for c in candidates_for(opened.view)
        if c.effect == effect and c.component in ("body", "winding|body", "ambient")
    )


@pytest.fixture(
    scope="module", params=["unrecorded_heat_source", "sensor_lag", "joint_conductance", "ambient_drift"]
)
def found(request, opened, tmp_path_factory):
    """A fit that found an effect, as the outcome of a diagnosis."""
    candidate = candidate_of(opened, request.param)
    blank = predictor_of(opened)
    factors = {item.name for item in candidate.factors}
    own = {("effect:" + n if n in factors else n): item.value for n, item in candidate.free.items()}
    name = candidate.amplitude
    own["effect:" + name if name in factors else name] = candidate.reference
    truth = {"capacity.body": 1.2, "gain.winding.power": 0.93} | own
    true = predictions_at_stamps(blank, SimpleNamespace(values=truth, candidates=(candidate,)))[0]
    noise = np.random.default_rng(1).normal(0.0, 0.1, true.shape)
    folder = tmp_path_factory.mktemp("run")
    predictor = predictor_of(opened, written(folder, true + noise))
    calibrated = calibrate(None, predictor)
    problem = Problem(predictor, calibrated.belief, expected_slow_error(predictor), predictor.observations)
    fit = problem.fit((candidate,), own)
    outcome = SimpleNamespace(
        stated_fit=fit,
        states={},
        final=fit,
        predictor=predictor,
        machine_coordinates=calibrated.belief.coordinates,
    )
    return outcome, folder


def test_the_written_machine_predicts_what_the_fit_did(found, opened):
    outcome, folder = found
    path = folder / "improved.toml"
    made = improved_machine(outcome, opened)
    path.write_text(made.text)
    again = open_machine(path, (), outcome.predictor.recordings, ())
    assert len(again.effects.factors) + len(again.effects.terms) + len(again.effects.readings) == 1
    nothing = SimpleNamespace(values={}, candidates=())
    expected = predictions_at_stamps(outcome.predictor, outcome.final)[0]
    plain = predictions_at_stamps(predictor_of(opened, outcome.predictor.recordings[0]), nothing)[0]
    told = predictions_at_stamps(predictor_of(again), nothing)[0]
    assert np.abs(plain - expected).max() > 0.3
    assert told == pytest.approx(expected, abs=2e-3)
    own = rmse(predictor_of(again), [told], heldout=False)
    assert made.errors["train_rmse_K"] == pytest.approx(own, abs=2e-3)


def test_what_is_switched_on_is_not_found_again(found, opened):
    outcome, folder = found
    path = folder / "again.toml"
    path.write_text(improved_machine(outcome, opened).text)
    again = open_machine(path, (), outcome.predictor.recordings, ())
    (candidate,) = outcome.final.candidates
    offered = {(c.effect, c.component, c.form) for c in candidates_for(again.view)}
    assert (candidate.effect, candidate.component, candidate.form) not in offered


def test_parameters_keep_what_is_left_of_their_uncertainty(found, opened):
    outcome, folder = found
    path = folder / "kept.toml"
    path.write_text(improved_machine(outcome, opened).text)
    again = open_machine(path, (), outcome.predictor.recordings, ())
    before = {prior.name: prior.sigma_log for prior in predictor_of(opened).uncertain()}
    after = {prior.name: prior.sigma_log for prior in predictor_of(again).uncertain()}
    assert set(after) == set(before)
    fit = outcome.final
    for index, coordinate in enumerate(fit.coordinates[: len(before)]):
        left = coordinate.sigma * np.sqrt(fit.covariance[index, index])
        assert after[coordinate.name] == pytest.approx(left, rel=1e-3)
        assert after[coordinate.name] < before[coordinate.name] + 1e-9


def test_stated_intervals_hold_the_value_and_the_truth(found):
    outcome, _ = found
    (candidate,) = outcome.final.candidates
    stated = reported_parameters(outcome.final, candidate)
    assert all(item["low"] <= item["value"] <= item["high"] for item in stated.values())
    true = effect_of(candidate.effect).report(candidate, {candidate.amplitude: candidate.reference})
    name, size = next(iter(true.items()))
    assert stated[name]["low"] <= size.value <= stated[name]["high"]
    assert stated[name]["unit"] == size.unit


def test_a_size_whose_place_is_unsure_has_a_wider_interval(found, monkeypatch):
    outcome, _ = found
    (candidate,) = outcome.final.candidates
    name = next(iter(reported_parameters(outcome.final, candidate)))
    monkeypatch.setattr(type(effect_of(candidate.effect)), "law_sigma", {})
    narrow = reported_parameters(outcome.final, candidate)[name]
    monkeypatch.setattr(type(effect_of(candidate.effect)), "law_sigma", {name: 0.45})
    wide = reported_parameters(outcome.final, candidate)[name]
    assert wide["value"] == narrow["value"]
    assert wide["low"] < narrow["low"] <= narrow["high"] < wide["high"]
    assert wide["high"] / wide["value"] > 0.85 * np.exp(1.645 * 0.45)
    monkeypatch.setattr(type(effect_of(candidate.effect)), "law_sigma", {})
    size = 5.0 * abs(narrow["value"])
    monkeypatch.setattr(type(effect_of(candidate.effect)), "law_shift", {name: size})
    shifted = reported_parameters(outcome.final, candidate)[name]
    assert shifted["value"] == narrow["value"]
    assert shifted["low"] < 0.0
    assert shifted["high"] - shifted["low"] == pytest.approx(2.0 * 1.645 * size, rel=0.2)


def test_heat_of_one_of_two_recordings_is_not_written_for_both(opened, tmp_path):
    heat = replace(candidate_of(opened, "unrecorded_heat_source"), recording=1)
    both = Predictor(opened.fast, [opened.recordings[0]] * 2)
    own = {heat.amplitude: heat.reference}
    true = predictions_at_stamps(both, SimpleNamespace(values=own, candidates=(heat,)))
    recordings = []
    for name, read in zip(("cold", "hot"), true, strict=True):
        (tmp_path / name).mkdir()
        recordings.append(replace(written(tmp_path / name, read), name=name))
    predictor = Predictor(opened.fast, recordings)
    calibrated = calibrate(None, predictor)
    problem = Problem(predictor, calibrated.belief, expected_slow_error(predictor), predictor.observations)
    outcome = SimpleNamespace(
        stated_fit=problem.fit((heat,), own),
        states={},
        predictor=predictor,
        machine_coordinates=calibrated.belief.coordinates,
    )
    path = tmp_path / "improved.toml"
    made = improved_machine(outcome, opened)
    path.write_text(made.text)
    assert made.errors == {}
    assert made.lacks == ("unrecorded_heat_source @ body, which acts in hot only",)
    again = open_machine(path, (), recordings, ())
    told = predictions_at_stamps(
        predictor_of(again, recordings[0]), SimpleNamespace(values={}, candidates=())
    )
    assert told[0] == pytest.approx(true[0], abs=0.05)
    assert np.abs(true[1] - true[0]).max() > 1.0


# ------------------------------------------------------------------------ sufficiency
def test_the_response_time_is_that_of_the_slow_mode(opened):
    """By the exact step response of two bodies."""
    capacity = np.array([180.0, np.sqrt(400.0 * 700.0)])
    conduction = np.array([[2.3, -2.3], [-2.3, 2.3 + 0.9]])
    matrix = -conduction / capacity[:, None]
    final = np.linalg.solve(conduction, [1.0, 0.0])
    crossed = []
    for node in range(2):
        times = np.arange(0.0, 6000.0, 5.0)
        share = np.array([1.0 - (expm(matrix * time) @ final)[node] / final[node] for time in times[::20]])
        crossed.append(float(np.interp(0.632, share, times[::20])))
    assert response_time(predictor_of(opened)) == pytest.approx(np.median(crossed), rel=0.02)


def test_a_recording_that_says_enough_is_not_refused(opened):
    assert says_too_little(opened) == ""
