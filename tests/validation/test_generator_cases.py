import gzip
import json
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.registry import catalogue
from validation.cycles import draw_drive
from validation.draw import EVERY_EFFECT, FOREIGN_EFFECTS
from validation.generate import choose_effects, judge, make_case
from validation.laws import Intervals, Starvation
from validation.recorder import Noise, record, slow_error
from validation.reduction import load_reduced
from validation.run_study import not_concealed
from validation.score import changes_unseen, matches, score_case, summarise, undecidable
from validation.sensor_errors import Sensor, first_order
from validation.stepping import Moment


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    return load_reduced(tmp_path_factory.mktemp("cache"), sectors=8, size=60, draws=1)


def test_mix_of_cases():
    chosen = [choose_effects(n, np.random.default_rng(n)) for n in range(1, 241)]
    counts = [sum(len(c) == k for c in chosen) for k in range(3)]
    assert counts == [60, 120, 60]
    assert {c[0] for c in chosen if len(c) == 1} == set(EVERY_EFFECT)
    assert all(a != b for a, b in (c for c in chosen if len(c) == 2))


def test_first_order_sensor_on_a_ramp():
    time = np.arange(0.0, 4000.0, 10.0)
    lagged = first_order(time, 0.01 * time, 300.0)
    exact = 0.01 * (time - 300.0 * (1.0 - np.exp(-time / 300.0)))
    assert np.abs(lagged - exact).max() < 1e-10


def test_late_clock_reads_the_past():
    time = np.arange(0.0, 1000.0, 10.0)
    readings = np.tile(time[:, None], (1, 6))
    late = Sensor("clock_shift", 2, 200.0).apply(time, readings, np.zeros(time.size))
    assert late[50, 2] == time[50] - 200.0
    assert np.array_equal(late[:, [0, 1, 3, 4, 5]], readings[:, [0, 1, 3, 4, 5]])


def test_gain_turns_about_twenty_degrees():
    readings = np.full((3, 6), 30.0)
    out = Sensor("sensor_gain", 0, 1.1).apply(np.arange(3.0), readings, np.zeros(3))
    assert out[:, 0] == pytest.approx(31.0)


def test_intervals_switch():
    law = Intervals("nose", 50.0, ((100.0, 200.0, 1.0), (300.0, 400.0, 0.5)))
    assert [law.level(t) for t in (50.0, 100.0, 199.0, 200.0, 350.0)] == [0, 1, 1, 0, 0.5]


def test_starvation_acts_above_its_onset(reduced):
    law = Starvation("R", 0.4, 2000.0)
    for speed, factor in ((1000.0, 1.0), (3500.0, 1.4)):
        law.start(reduced)
        moment = Moment(reduced, 20.0 * reduced.uniform, 0.0, 10.0, speed, 1750.0, 20.0, 15.0, 20.0)
        law.act(moment)
        assert moment.bearing == pytest.approx([1, 1, 1, factor, factor], abs=1e-6)


def test_slow_error_has_its_size_and_memory():
    time = np.arange(0.0, 4e6, 60.0)
    error = slow_error(np.random.default_rng(0), time, 0.04, 1200.0)
    assert np.std(error) == pytest.approx(0.04, rel=0.1)
    assert np.corrcoef(error[:-20], error[20:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.05)


def test_recording_depends_on_its_seed_alone(tmp_path):
    plan = draw_drive(np.random.default_rng(1))
    readings = np.full((plan.drive.time.size, 6), 25.0)
    for name in ("a", "b"):
        record(
            tmp_path / name,
            "recording",
            "case",
            plan,
            readings,
            Noise(0.1, 0.03, 900.0),
            np.random.default_rng(5),
        )
    assert (tmp_path / "a/recording.csv.gz").read_bytes() == (tmp_path / "b/recording.csv.gz").read_bytes()
    with gzip.open(tmp_path / "a/recording.csv.gz", "rt") as stream:
        header = stream.readline().strip()
    assert header == "time_s,SP01,SP02,SP03,SP04,SP05,COOLANT_OUT,ambient,coolant_in,speed,thrust"


@pytest.mark.parametrize("number", [1, 2, 4])
def test_inputs_tell_nothing_of_the_answer(reduced, tmp_path, number):
    answer = make_case(reduced, tmp_path, 3, number, identify=False)
    written = {p.name for p in (tmp_path / "inputs" / answer["case"]).iterdir()}
    assert written <= {"recording.toml", "recording.csv.gz", "calibration.toml", "calibration.csv.gz"}
    assert ("calibration.toml" in written) == answer["two_recordings"]
    text = (tmp_path / "inputs" / answer["case"] / "recording.toml").read_text(encoding="utf-8")
    assert not any(e["effect"] in text for e in answer["effects"])
    assert (
        json.loads((tmp_path / "answers" / f"{answer['case']}.json").read_text())["schema"]
        == "spindle-fem/answer/1"
    )


def _answer(effects, **known):
    listed = [
        {
            "effect": e,
            "component": c,
            "kind": "sensor" if e.startswith("sensor_") else "physics",
            "truth_form": {},
            "acceptable_components": [c],
            "outside_catalogue": False,
            "parameters": {"factor": {"value": 1.2, "unit": ""}},
        }
        for e, c in effects
    ]
    return {
        "case": "case_0001",
        "effects": listed,
        "true_verdict": "parameter" if effects else "consistent",
        "acceptable_verdicts": ["parameter" if effects else "consistent"],
        "clear": bool(effects),
        "detectable": True,
        "acceptable_sets": [[{"effect": e, "components": [c]} for e, c in effects]],
        "indistinguishable": [],
        "identifiability": {"ratio": 5.0} if effects else None,
        "two_recordings": True,
        "noise": {"white_K": 0.08, "slow_K": 0.06, "rounding_K": 0.0},
    } | known


def _diagnosis(verdict, effects, probability=0.95, alternatives=()):
    findings = [
        {
            "effect": e,
            "component": c,
            "probability": probability,
            "parameters": {"factor": {"value": 1.19, "low": 1.1, "high": 1.3, "unit": ""}},
        }
        for e, c in effects
    ]
    return {
        "verdict": verdict,
        "findings": findings,
        "mismatch": {"detected": bool(effects), "where": {}},
        "alternatives": [
            {"findings": [{"effect": e, "component": c, "parameters": {}} for e, c in s], "probability": p}
            for s, p in alternatives
        ],
        "fit": {"noise_K": 0.1, "before": {"heldout_rmse_K": 1.0}, "after": {"heldout_rmse_K": 0.103}},
    }


def test_score_of_a_right_and_a_wrong_case():
    answer = _answer([("heat_scale", "F1")])
    right = score_case(answer, _diagnosis("parameter", [("heat_scale", "F1")]), 12.0)
    wrong = score_case(
        answer,
        _diagnosis("missing_physics", [("windage", "shaft")], 0.95, [([("heat_scale", "F1")], 0.04)]),
        14.0,
    )
    assert right["exact"]
    assert right["rank"] == 1
    assert right["place"]
    assert right["after_over_noise"] == pytest.approx(1.03)
    assert right["coverage"][0]["inside"]
    assert not wrong["exact"]
    assert wrong["rank"] == 2
    assert wrong["place"] is None
    summary = summarise([right, wrong], [])
    assert summary["clear_single_first"] == {"share": 0.5, "of": 2}
    assert summary["clear_single_within_three"] == {"share": 1.0, "of": 2}
    assert summary["confident_wrong"]["share"] == 0.5
    assert summary["confusion"]["parameter"]["missing_physics"] == 1
    assert [row["case"] for row in summary["wrong"]] == ["case_0001"]


def test_a_sensor_that_comes_off_amid_a_held_out_stretch_does_so_unseen():
    answer, diagnosis = (
        _answer([("sensor_detached", "SP01")]),
        _diagnosis("sensor", [("sensor_detached", "SP01")]),
    )
    diagnosis["fit"]["heldout_s"] = [[[100.0, 200.0], [500.0, 600.0]]]
    found = []
    for onset in (0.0, 150.0, 300.0, 599.0, 600.0):
        answer["effects"][0]["truth_form"] = {"onset": onset}
        found.append(changes_unseen(answer, diagnosis))
    assert found == [False, True, False, True, False]
    answer["effects"][0]["truth_form"]["onset"] = 150.0
    rows = [score_case(answer, diagnosis, None)]
    summary = summarise(rows, [])
    assert summary["heldout_after_over_noise"] == {"of": 0}
    assert summary["heldout_after_over_noise_sensor_changes_unseen"]["of"] == 1
    # The speed at which starvation begins is no time.
    answer["effects"][0]["kind"] = "physics"
    assert not changes_unseen(answer, diagnosis)


def test_score_counts_false_alarms():
    rows = [
        score_case(_answer([]), _diagnosis("consistent", []), None),
        score_case(_answer([]), _diagnosis("sensor", [("sensor_gain", "SP01")]), None),
    ]
    assert summarise(rows, [])["false_alarms"] == {"share": 0.5, "of": 2}


def test_undecidable_is_what_reads_like_an_effect_that_has_to_be_named():
    pair = [("mount_sink", "flange"), ("radiation", "housing")]
    twin = {"effect": "natural_convection", "component": "housing", "instead_of": "radiation"}
    asked = _answer(pair, indistinguishable=[twin])
    assert undecidable(asked)
    # The second effect may be left unsaid; the first may not.
    asked["acceptable_sets"].append([{"effect": "mount_sink", "components": ["flange"]}])
    assert not undecidable(asked)
    assert undecidable(asked | {"indistinguishable": [twin, twin | {"instead_of": "mount_sink"}]})
    single = _answer([("radiation", "housing")], indistinguishable=[{"effect": "natural_convection"}])
    assert undecidable(single)
    assert not undecidable(_answer([("radiation", "housing")]))
    said = score_case(single, _diagnosis("missing_physics", [("radiation", "housing")]), None)
    faint = single | {"acceptable_sets": [*single["acceptable_sets"], []]}
    summary = summarise([said, score_case(faint, _diagnosis("consistent", []), None)], [])
    assert summary["ambiguous_called"] == {"share": 0.0, "of": 1}
    assert summary["ambiguous_called_faint_ones_too"]["of"] == 2
    assert summary["ambiguous_truth_kept"] == {"share": 1.0, "of": 1}


def test_score_says_whether_p_values_are_even():
    rows = [score_case(_answer([]), _diagnosis("consistent", []), None) for _ in range(40)]
    for number, row in enumerate(rows):
        row["p_value"] = (number + 0.5) / 40
    assert summarise(rows, [])["p_value_of_consistent"] == {
        "of": 40, "even": 1.0, "below_0.01": 0.0, "below_0.05": 0.05
    }  # fmt: skip
    for row in rows:
        row["p_value"] = 1.0 - 0.1 * row["p_value"]
    assert summarise(rows, [])["p_value_of_consistent"]["even"] < 1e-3


def test_score_counts_laws_of_recorded_quantities():
    answer = _answer([("unrecorded_heat_source", "flange")])
    answer["effects"][0]["follows"] = "thrust"
    rows = []
    for quantity in ("thrust", "change of speed", None):
        said = _diagnosis("missing_physics", [("unrecorded_heat_source", "flange")])
        said["findings"][0]["follows"] = quantity
        rows.append(score_case(answer, said, None))
    # Nothing to follow in this one.
    rows.append(score_case(_answer([("windage", "shaft")]), _diagnosis("missing_physics", []), None))
    assert [row["law"] for row in rows] == [True, False, False, None]
    assert summarise(rows, [])["law_of_recorded_quantity"]["of"] == 3


def test_sets_match_each_effect_once():
    wanted = [{"effect": "windage", "components": ["shaft"]}, {"effect": "windage", "components": ["shaft"]}]
    found = [{"effect": "windage", "component": "shaft"}, {"effect": "heat_scale", "component": "F1"}]
    assert not matches(found, wanted)
    assert matches([found[0], found[0]], wanted, place=True)


def test_judgement_of_what_cannot_be_seen(reduced):
    case = EVERY_EFFECT["mount_sink"]
    from validation.concealed_effect import Scene

    plan = draw_drive(np.random.default_rng(2))
    effect = case(Scene(np.random.default_rng(1), reduced, plan, None, 1.0))
    known = {
        "ratio": 0.1,
        "chi2": 2.0,
        "each": [],
        "best_mimics": [],
        "pair_mimics": [],
        "own_simple_form": None,
    }
    out = judge([effect], known, calibrated=True)
    assert "consistent" in out["acceptable_verdicts"]
    assert [] in out["acceptable_sets"]
    assert not out["detectable"]
    twin = {"effect": "ambient_drift", "component": "ambient", "form": "", "ratio": 0.1, "chi2": 3.0}
    known |= {"ratio": 4.0, "chi2": 900.0, "best_mimics": [twin]}
    assert judge([effect], known, calibrated=True)["acceptable_verdicts"] == ["missing_physics", "ambiguous"]
    known |= {"best_mimics": [twin | {"ratio": 2.0, "chi2": 400.0}]}
    undecided = judge([effect], known | {"best_mimics": [twin]}, calibrated=True)
    assert undecided["indistinguishable"] == [twin]
    # Unrecorded heat is named where no law fits, so it leaves nothing to decide.
    spare = twin | {"effect": "unrecorded_heat_source"}
    assert judge([effect], known | {"best_mimics": [spare]}, calibrated=True)["indistinguishable"] == []
    # The truth's own plain law comes no nearer than the twin that is off by as much.
    own = {"own_simple_form": {"ratio": 0.3, "chi2": 60.0}, "best_mimics": [twin | {"chi2": 65.0}]}
    assert judge([effect], known | own, calibrated=True)["indistinguishable"]
    clear = judge([effect], known, calibrated=True)
    assert clear["clear"]
    assert clear["acceptable_verdicts"] == ["missing_physics"]


@pytest.mark.parametrize(
    ("left", "accepted"), [((0.24, 400.0), True), ((2.0, 37.0), True), ((2.0, 400.0), False)]
)
def test_one_of_three_is_accepted_alone_where_the_others_hardly_show(left, accepted):
    effects = [
        SimpleNamespace(effect=name, kind="missing_physics", acceptable=["x"], outside_catalogue=False)
        for name in ("one", "two", "three")
    ]
    parts = [{"effect": item.effect, "ratio": 3.0, "chi2": 500.0} for item in effects]
    known = {"ratio": 5.0, "chi2": 4000.0, "each": parts, "best_mimics": [], "pair_mimics": []}
    known |= {"own_simple_form": None, "alone": [parts[0] | dict(zip(("ratio", "chi2"), left, strict=True))]}
    out = judge(effects, known, calibrated=True)
    sets = [[item["effect"] for item in one] for one in out["acceptable_sets"]]
    assert (["one"] in sets) is accepted
    assert out["clear"] is not accepted


def test_a_study_says_which_effects_it_conceals_in_no_case():
    known = set(catalogue())
    left_out = set(not_concealed())
    assert left_out == known - set(EVERY_EFFECT)
    assert set(EVERY_EFFECT) - set(FOREIGN_EFFECTS) <= known
