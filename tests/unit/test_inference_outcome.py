"""Where, when, what next and the report, on a lumped spindle that was made to differ in a known way."""

import json
import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from spindle_fem.definition.load import write_machine
from spindle_fem.errors import BadInputError
from spindle_fem.inference import tuned
from spindle_fem.inference.diagnosis import overlapping_components
from spindle_fem.inference.findings import findings_of, noise_level, predictions_at_stamps, rmse
from spindle_fem.inference.further_tests import AGAIN, answer, reachable_places, trials_of
from spindle_fem.inference.hypothesis import Ranked
from spindle_fem.inference.mismatch_place import (
    main_component,
    significant_stretches,
    smoothed_scores,
    where_of,
)
from spindle_fem.inference.next_measurement import (
    EXISTING,
    Option,
    choose,
    expected_information,
    next_measurement,
    pairwise_distances,
    rivals_of,
)
from spindle_fem.inference.prepared_problem import (
    known_before,
)
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.machine.view.meridian_places import centre_of
from spindle_fem.report.diagnosis_data import diagnosis_dataset
from spindle_fem.report.diagnosis_odds import set_probabilities
from spindle_fem.report.diagnosis_report import SCHEMA, draw_ahead, write_diagnosis_report
from spindle_fem.report.diagnosis_tables import where_text
from spindle_fem.report.diagnosis_words import place_named, verdict_sentence
from tests.support.diagnosed_spindle import (
    FROM,
    HEAT,
    PROBES,
    TIMES,
    UNTIL,
)


@pytest.fixture(scope="module")
def proposal(heated):
    return next_measurement(heated)


@pytest.fixture(scope="module")
def consistent(case):
    return case.diagnosis(None, 0.0, "consistent", ())


@pytest.fixture(scope="module")
def lying(case):
    return case.diagnosis(("sensor_offset", "SP02"), 2.0, "sensor", ())


# ---------------------------------------------------------------------- places


def test_a_decision_does_not_wait_for_which_part_of_a_component_it_is(case):
    one = overlapping_components(case.view)
    assert one["F1"] == one["front_bearings"] >= {"F1", "F2", "F3", "front_bearings"}
    assert one["SP04"] == {"SP04", "housing"}
    assert one["housing"] >= {"housing", "SP04", "SP05"}
    assert "flange" not in one["housing"]


def test_probes_of_a_part_are_off_along_the_radius_together(heated):
    belief = known_before(heated.predictor)
    names = [c.name for c in belief.coordinates]
    sigmas = np.array([c.sigma for c in belief.coordinates])
    covariance = np.linalg.inv(belief.root.T @ belief.root) * np.outer(sigmas, sigmas)
    radial = [names.index(f"probe.{name}.r") for name in ("SP01", "SP05")]
    along = [names.index(f"probe.{name}.z") for name in ("SP01", "SP05")]
    own, common = tuned.PROBE_PLACE_SIGMA**2, tuned.COMMON_RADIAL_SIGMA**2
    assert covariance[np.ix_(radial, radial)] == pytest.approx(own * np.eye(2) + common, rel=1e-9)
    assert covariance[np.ix_(along, along)] == pytest.approx(own * np.eye(2), rel=1e-9, abs=1e-18)
    # What the probes share is no matter of the machine's parameters.
    rest = [i for i, name in enumerate(names) if not name.startswith("probe.")]
    assert covariance[np.ix_(rest, radial)] == pytest.approx(0.0)


# ----------------------------------------------------------------------- where
def test_missing_heat_is_found_where_and_when_it_is(heated):
    where = where_of(heated)
    assert where.component == "front_bearings"
    assert where.credible[0] == "front_bearings"
    assert (where.radius, where.axial) == centre_of(heated.predictor.fast.spec, "front_bearings")
    heat = where.missing_heat["front_bearings"]
    # The machine's parameters take their part, and a walk of even steps comes late to a change: over draws of
    # the noise the peak is half to four fifths of the heat. Cooling that the parameters add asks for more.
    assert 0.45 * HEAT < heat.peak < 1.1 * HEAT
    mean = HEAT * (UNTIL - FROM) / TIMES[-1]
    assert 0.35 * mean < heat.mean < 1.3 * mean
    assert all(0.0 <= item.start < item.end <= TIMES[-1] for item in where.when)
    inside = sum(max(0.0, min(i.end, UNTIL) - max(i.start, FROM)) for i in where.when)
    assert inside > 0.8 * (UNTIL - FROM)
    assert "2750-3250 rpm" in where.condition


def test_shares_are_probabilities(heated):
    where = where_of(heated)
    assert sum(where.shares.values()) == pytest.approx(1.0)
    content = json.loads(json.dumps(where.to_json()))
    assert content["where"]["r_mm"] == pytest.approx(1e3 * where.radius, abs=1e-3)
    assert set(content["when"][0]) == {"start", "end", "condition"}


def test_where_nothing_is_missing_there_is_no_place(consistent):
    content = where_of(consistent).to_json()
    assert content["where"]["component"] is None
    assert content["where"]["r_mm"] is None
    assert content["when"] == []
    assert content["missing_heat_W"] == {}


def test_a_lying_sensor_is_the_place_itself(lying):
    where = where_of(lying)
    assert where.component == "SP02"
    assert where.radius == pytest.approx(0.096)
    assert "SP02" not in where.missing_heat


@pytest.mark.parametrize("verdict", ["missing_physics", "ambiguous", "unexplained"])
def test_the_place_is_of_the_physics_and_of_no_sensor(verdict):
    heat = SimpleNamespace(kind="missing_physics", component="housing")
    sensor = SimpleNamespace(kind="sensor", component="SP02")
    diagnosis = SimpleNamespace(
        final=SimpleNamespace(candidates=(sensor, heat)), judgement=SimpleNamespace(verdict=verdict)
    )
    assert main_component(diagnosis) == "housing"
    findings = [{"kind": item.kind, "component": item.component} for item in (heat, sensor)]
    where = {"component": "housing", "r_mm": 70.0, "z_mm": 180.0, "credible": ["housing", "SP02", "shaft"]}
    content = {"findings": findings, "mismatch": {"where": where}}
    (told,) = where_text(content)
    assert "Place: housing (centroid at r = 70 mm" in told.text
    assert "Sensor SP02: " in told.text
    assert "Heat missing at shaft alone" in told.text
    where["component"] = "SP02"
    assert place_named(content) == ""
    assert "Place" not in where_text(content)[0].text


def test_where_nothing_else_can_be_tried_it_is_read_again():
    trial = SimpleNamespace(name=AGAIN, effort=0)
    only = Option(trial, None, 0.1, 0.2, "housing", 0.3, 0.4, 0.0, (300.0, 300.3))
    assert choose([only]) is only


def test_noise_alone_is_not_significant(consistent):
    own = significant_stretches(consistent.predictor, consistent.null)
    # What is told comes near the largest departure, which itself is small.
    assert sum(item.end - item.start for item in own) < 0.25 * TIMES[-1]


def test_smoothed_noise_has_unit_variance():
    generator = np.random.default_rng(3)
    times = 60.0 * np.arange(400.0)
    slow = SimpleNamespace(sigma=1e-9, time=1500.0)
    scores = [
        smoothed_scores(times, generator.normal(0.0, 0.1, 400), np.full(400, 0.01), slow, 900.0)
        for _ in range(60)
    ]
    assert np.std(scores) == pytest.approx(1.0, abs=0.03)


def test_a_slow_error_is_not_averaged_away():
    times = 60.0 * np.arange(50.0)
    slow = SimpleNamespace(sigma=0.2, time=1e6)
    scores = smoothed_scores(times, np.full(50, 0.2), np.full(50, 1e-12), slow, 900.0)
    assert scores == pytest.approx(1.0, rel=1e-3)


# ------------------------------------------------------------------ what next
def test_bhattacharyya_distance_of_equal_and_of_wide_gaussians():
    mean, one = np.zeros(2), np.eye(2)
    found = pairwise_distances([mean, mean], [one, 4.0 * one])
    assert found[0, 1] == pytest.approx(np.log(2.5 / 2.0))
    assert np.diag(found) == pytest.approx(0.0)


def test_distances_stand_where_a_parameter_is_known_to_nothing_but_rounding():
    slope = np.random.default_rng(1).normal(size=(60, 1))
    vast = 1e13 * slope @ slope.T + 1e-2 * np.eye(60)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(vast)
    found = pairwise_distances([np.zeros(60), np.ones(60)], [vast, np.eye(60)])
    assert np.isfinite(found).all()
    assert found[0, 1] > 1.0


def test_information_is_at_most_the_entropy_of_the_explanations():
    weights = np.array([0.5, 0.25, 0.25])
    apart = 100.0 * (1.0 - np.eye(3))
    assert expected_information(weights, apart) == pytest.approx(1.5)
    assert expected_information(weights, 0.0 * apart) == 0.0


def test_the_proposal_tells_rivals_apart_with_numbers(proposal):
    found = proposal
    assert set(found) >= {"where", "quantity", "condition", "why", "expected_information"}
    assert found["between"] == [
        "unrecorded heat source at the front bearings",
        "thermal preload at the front bearings",
    ]
    entropy = -(0.6 * np.log2(0.6) + 0.4 * np.log2(0.4))
    informations = [option["expected_information"] for option in found["options"]]
    assert all(-1e-9 <= value <= entropy + 1e-9 for value in informations)
    assert found["expected_information"] >= 0.9 * max(informations[1:])
    assert re.search(r"they differ by [\d.]+ K", found["why"])
    assert not (found["where"].startswith(EXISTING) and found["condition"] == AGAIN)
    assert [option["chosen"] for option in found["options"]].count(True) == 1


def test_a_further_sensor_never_tells_less(proposal):
    options = proposal["options"]
    alone = {o["condition"]: o["expected_information"] for o in options if o["where"] == EXISTING}
    for option in options:
        assert option["expected_information"] >= alone[option["condition"]] - 1e-6


def test_a_doubted_sensor_gets_a_second_one_beside_it(lying):
    found = next_measurement(lying)
    assert "a second sensor beside SP02" in {option["where"] for option in found["options"]}
    assert found["why"].startswith("The data have decided")


def test_without_a_rival_there_is_nothing_to_tell_apart(consistent):
    found = next_measurement(consistent)
    assert found["options"] == []
    assert found["condition"] == AGAIN
    assert "No other explanation" in found["why"]


def test_slopes_of_a_trial_are_differences(heated):
    predictor, fit = heated.predictor, heated.final
    trial = trials_of(predictor, heated.view)[1]
    places = reachable_places(predictor.fast.spec, predictor.fast.model.place_names)
    told = answer(predictor, fit, trial, places, 600.0)
    position = [c.name for c in fit.coordinates].index("film.outside")
    step = 1e-4
    moved = replace(fit, position=fit.position + step * np.eye(len(fit.position))[position])
    difference = (answer(predictor, moved, trial, places, 600.0).readings - told.readings) / step
    assert told.slopes[:, :, position] == pytest.approx(difference, abs=2e-3 * np.abs(difference).max())


def test_sensors_go_where_a_hand_can_reach(heated):
    spec = heated.predictor.fast.spec
    names = [place.name for place in reachable_places(spec, heated.predictor.fast.model.place_names)]
    assert "F1.outer_ring" in names
    assert not any("inner" in name or "balls" in name or "spacer" in name for name in names)


# ----------------------------------------------------------------------- report
def content_of(diagnosis, before, after, proposal):
    predictor, judgement = diagnosis.predictor, diagnosis.judgement

    def errors(predicted):
        return {
            "train_rmse_K": rmse(predictor, predicted, heldout=False),
            "heldout_rmse_K": rmse(predictor, predicted, heldout=True),
        }

    channels = [{"channel": n, "rmse_K": 0.2, "noise_K": 0.1, "max_K": 1.0} for n in PROBES]
    return {
        "schema": SCHEMA,
        "machine": "lumped",
        "recordings": ["steps"],
        "verdict": judgement.verdict,
        "mismatch": {"p_value": judgement.p_value, "channels": channels, **where_of(diagnosis).to_json()},
        "findings": findings_of(diagnosis, judgement.chosen, split=True),
        "set_probability": judgement.chosen.probability,
        "something_else_probability": judgement.other,
        "slow_error": {"sigma_K": diagnosis.final.slow.sigma, "time_s": diagnosis.final.slow.time},
        "alternatives": [
            {"findings": findings_of(diagnosis, item, split=False), "probability": item.probability}
            for item in judgement.alternatives
        ],
        "fit": {
            "before": errors(before),
            "after": errors(after),
            "noise_K": noise_level(predictor),
            "heldout": diagnosis.heldout,
        },
        "next_measurement": proposal,
        "defects": [recording.defects.to_json() for recording in predictor.recordings],
    }


def folder_of(diagnosis, folder, proposal):
    before, after = (
        predictions_at_stamps(diagnosis.predictor, fit) for fit in (diagnosis.null, diagnosis.final)
    )
    diagnosis_dataset(diagnosis, before, after).to_netcdf(folder / "diagnosis.nc")
    content = content_of(diagnosis, before, after, proposal)
    (folder / "diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "improved_machine.toml").write_text(
        write_machine(diagnosis.predictor.fast.spec), encoding="utf-8"
    )
    return content


@pytest.fixture(scope="module")
def reported(heated, proposal, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    content = folder_of(heated, folder, proposal)
    return folder, content, write_diagnosis_report(folder)


def test_the_report_holds_the_sentence_and_every_figure(reported):
    folder, content, path = reported
    html = path.read_text(encoding="utf-8")
    assert path == folder / "report.html"
    assert verdict_sentence(content) in html
    figures = {item.stem for item in (folder / "figures").glob("*.png")}
    assert figures == {
        "before_after",
        "residual_map",
        "sets",
        "findings",
        "parameters",
        "where",
        "missing_heat",
    }
    assert html.count("data:image/") == len(figures)


def test_the_sentence_names_rivals_and_errors(reported):
    _, content, _ = reported
    sentence = verdict_sentence(content)
    place = "at the front bearings"
    assert f"unrecorded heat source {place} (0.60) or thermal preload {place} (0.40)" in sentence
    before, after = (content["fit"][key]["heldout_rmse_K"] for key in ("before", "after"))
    assert f"falls from {before:.2f} K to {after:.2f} K; noise 0.10 K." in sentence


def test_the_dataset_keeps_readings_and_what_was_held_out(reported, heated):
    folder, content, _ = reported
    data = xr.load_dataset(folder / "diagnosis.nc")
    recording = heated.predictor.recordings[0]
    assert data["measured"].values == pytest.approx(recording.temperature - 273.15, abs=1e-4)
    held = data["held_out"].values == 1
    assert data["time"].values[held].min() > 4000.0
    assert data["time"].values[held].max() < 5000.0
    error = (data["after"] - data["measured"]).values[held]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(content["fit"]["after"]["heldout_rmse_K"], rel=1e-4)
    assert data["spot_share"].sum() == pytest.approx(1.0)
    assert data["measured"].attrs["units"] == "degC"


def test_figures_may_be_drawn_before_the_report(reported, tmp_path):
    folder, content, path = reported
    for name in ("diagnosis.nc", "diagnosis.json", "improved_machine.toml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    known = {key: value for key, value in content.items() if key != "next_measurement"}
    pictures = draw_ahead(tmp_path, known)
    ahead = {item.name for item in (tmp_path / "figures").iterdir()}
    assert ahead == {item.name for item in (folder / "figures").iterdir()} - {"sets.png"}
    assert write_diagnosis_report(tmp_path, pictures).read_text(encoding="utf-8") == path.read_text(
        encoding="utf-8"
    )
    # What the full model's check may change is drawn with the report.
    assert write_diagnosis_report(tmp_path, {}).read_text(encoding="utf-8").count("data:image") == 1


def test_chart_of_sets_has_the_probabilities_that_are_stated(reported):
    folder, content, _ = reported
    checked = content | {"set_probability": 0.31, "something_else_probability": 0.62}
    figure = set_probabilities(xr.load_dataset(folder / "diagnosis.nc"), checked)
    drawn = [bar.get_width() for bar in figure.axes[0].patches]
    stated = [item["probability"] for item in content["alternatives"]]
    assert drawn[0] == 0.31
    assert drawn[1 : 1 + len(stated)] == pytest.approx(stated)
    assert drawn[-1] == 0.62
    assert not any(drawn[1 + len(stated) : -1])


def test_only_likely_alternatives_are_to_be_told_apart(heated):
    judged = heated.judgement
    rival = next(h for h in heated.hypotheses if h.keys != judged.chosen.fit.keys)
    for probability, decided in ((0.5 * tuned.LISTED, True), (0.2, False)):
        listed = replace(judged, alternatives=(Ranked(rival, probability),))
        found, weights, alone = rivals_of(replace(heated, judgement=listed))
        assert (alone, len(found)) == (decided, 2)
        assert weights[1] == pytest.approx(
            0.5 if decided else probability / (probability + judged.chosen.probability)
        )


def test_what_to_measure_next_is_the_same_from_another_process(heated, proposal):
    found = Workers(2).ahead(partial(next_measurement, heated))()
    assert (found["where"], found["condition"]) == (proposal["where"], proposal["condition"])
    assert found["expected_information"] == pytest.approx(proposal["expected_information"], rel=1e-6)
    assert len(found["options"]) == len(proposal["options"]) > 0


def test_a_consistent_report_draws_no_place(consistent, tmp_path):
    content = folder_of(consistent, tmp_path, next_measurement(consistent))
    html = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    assert verdict_sentence(content).startswith("The recording agrees with the machine")
    assert verdict_sentence(content) in html
    assert not (tmp_path / "figures" / "where.png").exists()


def test_an_unexplained_recording_without_data_still_reports(tmp_path):
    nothing = {"train_rmse_K": None, "heldout_rmse_K": None}
    content = {
        "schema": SCHEMA,
        "verdict": "unexplained",
        "reason": "nothing was switched on",
        "mismatch": {
            "p_value": 1.0,
            "channels": [{"channel": "SP01", "rmse_K": None, "noise_K": 0.1, "max_K": None}],
            "where": {"component": None, "r_mm": None, "z_mm": None, "credible": []},
            "when": [],
            "missing_heat_W": {},
        },
        "findings": [],
        "alternatives": [],
        "fit": {"before": nothing, "after": nothing, "noise_K": None, "heldout": "nothing was fitted"},
        "next_measurement": {"where": "all", "quantity": "temperature", "condition": "a step", "why": "x"},
    }
    (tmp_path / "diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    html = write_diagnosis_report(tmp_path).read_text(encoding="utf-8")
    assert "is not explained: nothing was switched on." in html


def test_another_schema_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="there is no such file"):
        write_diagnosis_report(tmp_path)
    (tmp_path / "diagnosis.json").write_text('{"schema": "spindle-fem/diagnosis/9"}', encoding="utf-8")
    with pytest.raises(BadInputError, match=r"'spindle-fem/diagnosis/9' is not known\. Allowed"):
        write_diagnosis_report(tmp_path)
