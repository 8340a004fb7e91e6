"""Where, when, what next and the report, on a lumped spindle that was made to differ in a known way."""

import json
import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.effects.registry import candidates_for, catalogue, effect_of, interval_effects
from spindle_fem.errors import BadInputError
from spindle_fem.inference.diagnosis import Diagnosis, _overlapping
from spindle_fem.inference.findings import findings_of, noise_level, predictions_at_stamps, rmse
from spindle_fem.inference.further_tests import AGAIN, answer, reachable_places, trials_of
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import OTHER_SPOTS, Hypothesis, Search
from spindle_fem.inference.mismatch_place import significant_stretches, smoothed_scores, where_of
from spindle_fem.inference.missing_heat import Pattern, explain, onset_answers
from spindle_fem.inference.next_measurement import (
    EXISTING,
    expected_information,
    next_measurement,
    pairwise_distances,
)
from spindle_fem.inference.prepared_problem import (
    COMMON_RADIAL_SIGMA,
    EXPECTED_SLOW,
    PROBE_PLACE_SIGMA,
    calibrate,
    known_before,
)
from spindle_fem.inference.simulated_plant import Plant
from spindle_fem.inference.verdict import Judgement, Ranked
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.machine.view.meridian_places import centre_of, regions_of
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.recordings.align import read_recording
from spindle_fem.report.diagnosis_data import diagnosis_dataset
from spindle_fem.report.diagnosis_report import SCHEMA, draw_figures, write_diagnosis_report
from spindle_fem.report.diagnosis_words import verdict_sentence
from tests.support.lumped_spindle import lumped_model

PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05", "COOLANT_OUT")
MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
[[channel]]
column = "speed"
role = "input"
hold = "previous"
drives = "speed"
unit = "rpm"
[[channel]]
column = "ambient"
role = "input"
drives = "ambient"
unit = "degC"
"""
CHANNEL = """
[[channel]]
column = "%s"
role = "temperature"
probe = "%s"
unit = "degC"
sigma = 0.1
"""
TIMES = np.arange(0.0, 10800.0, 30.0)
RUNS, STOPS = 1800.0, 8100.0
FROM, UNTIL, HEAT = 3000.0, 6000.0, 200.0


def written(folder, temperatures):
    columns = {
        "t": TIMES,
        "speed": np.where((TIMES >= RUNS) & (TIMES < STOPS), 3000.0, 0.0),
        "ambient": np.full(TIMES.size, 20.0),
    }
    columns |= {name: temperatures[:, column] for column, name in enumerate(PROBES)}
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    text = MANIFEST + "".join(CHANNEL % (name, name) for name in PROBES)
    (folder / "steps.toml").write_text(text, encoding="utf-8")
    return read_recording(folder / "steps.toml")


class Case:
    """A lumped spindle, and recordings of it with one effect more."""

    def __init__(self, folder):
        self.folder = folder
        self.spec = load_machine("recorded_spindle")
        model = lumped_model(self.spec)
        slopes = np.zeros((len(model.probe_names), 2, model.size))
        model = replace(
            model,
            probe_gradients=slopes,
            place_names=(*model.place_names, *(f"near.{name}" for name in model.probe_names)),
            places=np.vstack((model.places, model.probes)),
        )
        self.fast = FastModel(model, self.spec)
        self.blank = written(folder, np.tile(20.0, (TIMES.size, len(PROBES))))
        self.view = view_of(self.fast.names, self.blank)
        self.candidates = {(c.effect, c.component): c for c in reversed(candidates_for(self.view))}
        heat = effect_of("unrecorded_heat_source").over(self.view, "front_bearings", [(FROM, UNTIL)])
        self.candidates[heat.effect, heat.component] = heat

    def diagnosis(self, truth, amplitude, verdict, rivals):
        """Fits and judgement about a recording with an effect, as the search would hand them on."""
        candidate = self.candidates[truth] if truth else None
        plant = Plant(self.fast, [self.blank], [np.ones(TIMES.size, dtype=bool)])
        values, chosen = {}, ()
        if candidate is not None:
            factors = {item.name for item in candidate.factors}
            name = candidate.amplitude
            values, chosen = {f"effect:{name}" if name in factors else name: amplitude}, (candidate,)
        on_grid = plant.predict(0, values, chosen).temperature
        true = np.array([np.interp(TIMES, plant.drives[0].grid, column) for column in on_grid.T]).T
        noise = np.random.default_rng(7).normal(0.0, 0.1, true.shape)
        recording = written(self.folder, true - 273.15 + noise)
        held = (TIMES > 4000.0) & (TIMES < 5000.0)
        plant = Plant(self.fast, [recording], [~held])
        calibrated = calibrate(None, plant)
        problem = Problem(plant, calibrated.belief, EXPECTED_SLOW, plant.observations)
        sets = [(self.candidates[key],) for key in ((truth,) if truth else ()) + rivals]
        null = problem.fit()
        found = [Hypothesis(problem.fit(members), -3.0) for members in sets]
        hypotheses = (*found, Hypothesis(null, -1.0))
        shares = [1.0] if not rivals else [0.6, 0.4]
        ranked = [Ranked(item, share) for item, share in zip(found, shares, strict=False)]
        best = ranked[0] if ranked else Ranked(hypotheses[-1], 1.0)
        judgement = Judgement(verdict, 0.5 if not truth else 1e-6, best, tuple(ranked[1:]), 0.0, "")
        patterns = [Pattern(spot, places) for spot, places in self.view.spots.items()]
        tracks = [explain(item) for item in onset_answers(problem, null, patterns, 0)]
        return Diagnosis(
            plant,
            self.view,
            calibrated,
            hypotheses,
            judgement,
            null,
            best.fit,
            tuple(tracks),
            "from 4000 s to 5000 s",
            len(self.candidates),
            {},
        )


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return Case(tmp_path_factory.mktemp("lumped"))


@pytest.fixture(scope="module")
def heated(case):
    """Front bearings get heat for a while that nobody wrote down; thermal preload may be it too."""
    return case.diagnosis(
        ("unrecorded_heat_source", "front_bearings"),
        HEAT,
        "ambiguous",
        (("thermal_preload", "front_bearings"),),
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
def test_places_are_those_of_the_drawing():
    spec = load_machine("recorded_spindle")
    probe = next(p for p in spec.probe if p.name == "SP04")
    assert centre_of(spec, "SP04") == (probe.r, probe.z)
    assert centre_of(spec, "near.SP04") == centre_of(spec, "SP04")
    bearing = next(b for _, b in spec.bearings if b.name == "F2")
    radius, place = centre_of(spec, "F2")
    assert place == pytest.approx(sum(bearing.z) / 2.0)
    assert radius == pytest.approx(0.0825)
    assert centre_of(spec, "F2.inner_ring")[0] < radius < centre_of(spec, "F2.outer_ring")[0]
    front = [b.z for group, b in spec.bearings if group.name == "front"]
    assert centre_of(spec, "front_bearings")[1] == pytest.approx(np.mean(front))
    assert centre_of(spec, "nose")[1] < min(front)[0]
    assert centre_of(spec, "drive_end")[1] > max(b.z[1] for _, b in spec.bearings)
    assert centre_of(spec, "ambient") is None


def test_the_channel_lies_within_its_turns():
    spec = load_machine("recorded_spindle")
    (region,) = regions_of(spec, "channel")
    assert region.r == pytest.approx((0.108, 0.118))
    assert region.z == pytest.approx((0.042, 0.174))


def test_the_shaft_between_its_bearings_ends_where_they_sit():
    spec = load_machine("recorded_spindle")
    found = regions_of(spec, "shaft_gap")
    seats = [b.z for _, b in spec.bearings]
    assert min(r.z[0] for r in found) >= max(z[1] for z in seats if z[1] < 0.3)
    assert max(r.z[1] for r in found) <= min(z[0] for z in seats if z[0] > 0.3)


def test_walls_that_face_the_shaft_and_rings_have_a_place():
    spec = load_machine("recorded_spindle")
    walls = regions_of(spec, "standing_gap")
    assert [region.z for region in walls] == [pytest.approx((0.157, 0.180)), pytest.approx((0.180, 0.410))]
    assert [region.r for region in walls] == [pytest.approx((0.095, 0.095)), pytest.approx((0.090, 0.090))]
    # By their areas.
    assert centre_of(spec, "standing_gap")[1] == pytest.approx(0.282, abs=1e-3)
    (ring,) = regions_of(spec, "around.SP04")
    assert ring.z == pytest.approx((0.27845, 0.30155), abs=1e-4)
    assert ring.r == pytest.approx((0.090, 0.10255), abs=1e-4)


def test_the_cover_holds_the_seal_of_the_nose():
    spec = load_machine("recorded_spindle")
    heat = Layout(spec, {"cover", "front_outer_spacer"}).heat()
    assert heat["standing_nose"] == ("cover",)
    assert "standing_drive_end" not in heat
    assert "standing_nose" not in Layout(spec, set()).heat()


def test_a_probe_lies_in_the_largest_segment_around_it():
    spec = load_machine("recorded_spindle")
    probes = {probe.name: probe for probe in spec.probe}
    layout = Layout(spec, {"housing.middle_body", "housing.flange"})
    assert layout.place_of_probe(probes["SP04"]) == "housing.middle_body"
    assert Layout(spec, set()).place_of_probe(probes["SP04"]) == "housing"


def test_a_decision_does_not_wait_for_which_part_of_a_component_it_is(case):
    one = _overlapping(case.view)
    assert one["F1"] == one["front_bearings"] >= {"F1", "F2", "F3", "front_bearings"}
    assert one["SP04"] == {"SP04", "housing"}
    assert one["housing"] >= {"housing", "SP04", "SP05"}
    assert "flange" not in one["housing"]


def test_probes_of_a_part_are_off_along_the_radius_together(heated):
    belief = known_before(heated.plant)
    names = [c.name for c in belief.coordinates]
    sigmas = np.array([c.sigma for c in belief.coordinates])
    covariance = np.linalg.inv(belief.root.T @ belief.root) * np.outer(sigmas, sigmas)
    radial = [names.index(f"probe.{name}.r") for name in ("SP01", "SP05")]
    along = [names.index(f"probe.{name}.z") for name in ("SP01", "SP05")]
    own, common = PROBE_PLACE_SIGMA**2, COMMON_RADIAL_SIGMA**2
    assert covariance[np.ix_(radial, radial)] == pytest.approx(own * np.eye(2) + common, rel=1e-9)
    assert covariance[np.ix_(along, along)] == pytest.approx(own * np.eye(2), rel=1e-9, abs=1e-18)
    # What the probes share is no matter of the machine's parameters.
    rest = [i for i, name in enumerate(names) if not name.startswith("probe.")]
    assert covariance[np.ix_(rest, radial)] == pytest.approx(0.0)


# ---------------------------------------------------------------------- search
def search_over(case, diagnosis, kind=Search):
    problem = Problem(
        diagnosis.plant, diagnosis.calibrated.belief, EXPECTED_SLOW, diagnosis.plant.observations
    )
    effects = catalogue()
    weights = dict.fromkeys(effects, 1.0)
    candidates = candidates_for(case.view)
    return kind(problem, case.view, effects, candidates, interval_effects(), weights, workers=Workers(1))


def test_heat_found_at_a_wrong_spot_is_tried_at_the_right_one(case, heated):
    search = search_over(case, heated)
    problem = search.problem
    search.found = {}
    wrong = effect_of("unrecorded_heat_source").over(case.view, "rear_bearings", [(FROM, UNTIL)])
    for candidates in ((), (wrong,)):
        search._keep(Hypothesis(problem.fit(candidates), -1.0))
    found = max(search.ranked(), key=lambda h: len(h.fit.candidates))
    (first, start), *others = search._at_other_spots(found.fit, wrong, ())
    assert [c.component for c in first] == ["front_bearings"]
    assert start[first[0].amplitude] == pytest.approx(HEAT, rel=0.3)
    assert wrong.component not in {c.component for members, _ in others for c in members}
    assert len(others) < OTHER_SPOTS
    search._exchange()
    assert search.ranked()[0].keys == {("unrecorded_heat_source", "front_bearings")}


def test_laws_are_extended_beside_a_way_out(case, heated):
    search = search_over(case, heated)
    out, law = heated.hypotheses[:2]
    assert search._to_extend([out, law], 1) == [out, law]
    assert search._to_extend([law, out], 1) == [law]


class Tabled(Search):
    """A search whose fits have the evidence of a table."""

    def _fit_all(self, tasks):
        for candidates, values in tasks:
            keys = frozenset((c.effect, c.component) for c in candidates)
            fit = SimpleNamespace(
                candidates=candidates, values=values, keys=keys, log_evidence=EVIDENCE.get(keys, -1e3)
            )
            self._keep(Hypothesis(fit, 0.0))

    def _exchange(self):
        pass


DRY_BEARING, DRY_SET = ("starvation", "F2"), ("starvation", "front_bearings")
LOOSE, SEAT = ("sensor_detached", "SP02"), ("joint_conductance", "F2")
EVIDENCE = {
    frozenset((DRY_BEARING, LOOSE)): -60.0,
    frozenset((DRY_BEARING, LOOSE, SEAT)): -40.0,
    frozenset((DRY_SET, LOOSE, SEAT)): -15.0,
    frozenset((DRY_SET, LOOSE)): -10.0,
}


def test_what_a_single_bearing_needed_beside_it_is_left_out_beside_its_set(case, heated):
    search = search_over(case, heated, Tabled)
    search.found = {}
    for keys in ((DRY_BEARING, LOOSE), (DRY_BEARING, LOOSE, SEAT)):
        search._fit_all([(tuple(case.candidates[key] for key in keys), {})])
    search._improve()
    assert search.ranked()[0].keys == {DRY_SET, LOOSE}


# ----------------------------------------------------------------------- where
def test_missing_heat_is_found_where_and_when_it_is(heated):
    where = where_of(heated)
    assert where.component == "front_bearings"
    assert where.credible[0] == "front_bearings"
    assert (where.radius, where.axial) == centre_of(heated.plant.fast.spec, "front_bearings")
    heat = where.missing_heat["front_bearings"]
    assert heat.peak == pytest.approx(HEAT, rel=0.25)
    assert heat.mean == pytest.approx(HEAT * (UNTIL - FROM) / TIMES[-1], rel=0.5)
    assert all(0.0 <= item.start < item.end <= TIMES[-1] for item in where.when)
    inside = sum(max(0.0, min(i.end, UNTIL) - max(i.start, FROM)) for i in where.when)
    assert inside > 0.8 * (UNTIL - FROM)
    assert "2500-3000 rpm" in where.condition


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


def test_noise_alone_is_not_significant(consistent):
    own = significant_stretches(consistent.plant, consistent.null)
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
    plant, fit = heated.plant, heated.final
    trial = trials_of(plant, heated.view)[1]
    places = reachable_places(plant.fast.spec, plant.fast.model.place_names)
    told = answer(plant, fit, trial, places, 600.0)
    position = [c.name for c in fit.coordinates].index("film.outside")
    step = 1e-4
    moved = replace(fit, position=fit.position + step * np.eye(len(fit.position))[position])
    difference = (answer(plant, moved, trial, places, 600.0).readings - told.readings) / step
    assert told.slopes[:, :, position] == pytest.approx(difference, abs=2e-3 * np.abs(difference).max())


def test_sensors_go_where_a_hand_can_reach(heated):
    spec = heated.plant.fast.spec
    names = [place.name for place in reachable_places(spec, heated.plant.fast.model.place_names)]
    assert "F1.outer_ring" in names
    assert not any("inner" in name or "balls" in name or "spacer" in name for name in names)


# ----------------------------------------------------------------------- report
def content_of(diagnosis, before, after, proposal):
    plant, judgement = diagnosis.plant, diagnosis.judgement

    def errors(predicted):
        return {
            "train_rmse_K": rmse(plant, predicted, heldout=False),
            "heldout_rmse_K": rmse(plant, predicted, heldout=True),
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
        "slow_error": {"sigma_K": diagnosis.final.slow.sigma, "time_s": diagnosis.final.slow.time},
        "alternatives": [
            {"findings": findings_of(diagnosis, item, split=False), "probability": item.probability}
            for item in judgement.alternatives
        ],
        "fit": {
            "before": errors(before),
            "after": errors(after),
            "noise_K": noise_level(plant),
            "heldout": diagnosis.heldout,
        },
        "next_measurement": proposal,
        "defects": [recording.defects.to_json() for recording in plant.recordings],
    }


def folder_of(diagnosis, folder, proposal):
    before, after = (predictions_at_stamps(diagnosis.plant, fit) for fit in (diagnosis.null, diagnosis.final))
    diagnosis_dataset(diagnosis, before, after).to_netcdf(folder / "diagnosis.nc")
    content = content_of(diagnosis, before, after, proposal)
    (folder / "diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "improved_machine.toml").write_text(write_machine(diagnosis.plant.fast.spec), encoding="utf-8")
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
    assert html.count("data:image/webp") == len(figures)


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
    recording = heated.plant.recordings[0]
    assert data["measured"].values == pytest.approx(recording.temperature - 273.15, abs=1e-4)
    held = data["held_out"].values == 1
    assert data["time"].values[held].min() > 4000.0
    assert data["time"].values[held].max() < 5000.0
    error = (data["after"] - data["measured"]).values[held]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(content["fit"]["after"]["heldout_rmse_K"], rel=1e-4)
    assert data["spot_share"].sum() == pytest.approx(1.0)
    assert data["measured"].attrs["units"] == "degC"


def test_figures_may_be_drawn_by_another_process_before_the_report(reported, tmp_path):
    folder, content, path = reported
    for name in ("diagnosis.nc", "diagnosis.json", "improved_machine.toml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    known = {key: value for key, value in content.items() if key != "next_measurement"}
    pictures = Workers(2).ahead(partial(draw_figures, tmp_path, known))()
    assert {item.name for item in (tmp_path / "figures").iterdir()} == {
        item.name for item in (folder / "figures").iterdir()
    }
    assert write_diagnosis_report(tmp_path, pictures).read_text(encoding="utf-8") == path.read_text(
        encoding="utf-8"
    )
    assert "data:image" not in write_diagnosis_report(tmp_path, {}).read_text(encoding="utf-8")


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
