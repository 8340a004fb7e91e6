import json

import pytest

from validation.score_families import figures, must_be_told, score_study, summary


def answer(name, effects, verdict="missing_physics"):
    return {
        "case": name,
        "family": "hidden_heat" if effects else "consistent",
        "machine": "tool",
        "noise": {"total_K": 0.5},
        "effects": effects,
        "acceptable_sets": [
            [{"effect": e["effect"], "components": e["acceptable_components"]} for e in effects]
        ]
        if effects
        else [],
        "acceptable_verdicts": [verdict],
        "verdict": verdict,
        "true_verdict": verdict,
        "detectable": bool(effects),
    }


HIDDEN = {
    "effect": "unrecorded_heat_source",
    "component": "oil",
    "acceptable_components": ["oil"],
    "parameters": {"heat": {"value": 100.0, "unit": "W"}},
    "intervals": [[0.0, 100.0], [200.0, 300.0]],
    "moves_over_noise": 5.0,
}


def diagnosis(verdict, findings):
    fit = {"heldout_rmse_K": 1.0}
    return {
        "verdict": verdict,
        "findings": findings,
        "alternatives": [],
        "mismatch": {"detected": bool(findings)},
        "fit": {"before": fit, "after": {"heldout_rmse_K": 0.5}},
    }


@pytest.fixture
def rows(tmp_path):
    (tmp_path / "answers").mkdir()
    found = {
        "effect": "unrecorded_heat_source",
        "component": "oil",
        "probability": 0.95,
        "parameters": {"heat": {"value": 90.0, "low": 80.0, "high": 95.0}},
        "intervals": [{"start": 0.0, "end": 100.0}],
    }
    cases = {
        "case_0001": (answer("case_0001", [HIDDEN]), diagnosis("missing_physics", [found])),
        "case_0002": (answer("case_0002", [], "consistent"), diagnosis("consistent", [])),
        "case_0003": (answer("case_0003", [], "consistent"), diagnosis("missing_physics", [found])),
        "case_0004": (answer("case_0004", [HIDDEN]), None),
    }
    for name, (truth, told) in cases.items():
        (tmp_path / "answers" / f"{name}.json").write_text(json.dumps(truth))
        folder = tmp_path / "results" / name
        folder.mkdir(parents=True)
        (folder / ("diagnosis.json" if told else "failed.json")).write_text(json.dumps(told))
    return score_study(tmp_path, tmp_path / "results")


def test_right_wrong_and_failed(rows):
    assert [r["right"] for r in rows] == [True, True, False, False]
    assert [r["failed"] for r in rows] == [False, False, False, True]


def test_states_are_held_against_the_truth_by_time(rows):
    assert rows[0]["states_f1"] == pytest.approx(2 * 100 / 300)
    assert rows[0]["states_seen"]


def test_figures_by_family(rows):
    found = summary(rows)
    assert found["by_family"]["consistent"]["flagged_of_consistent"]["share"] == 0.5
    assert found["by_family"]["hidden_heat"]["right"]["share"] == 0.5
    assert found["all"]["intervals_hold"] == pytest.approx(
        {"share": 0.0, "of": 1, "low": 0.0, "high": 0.73}, abs=0.01
    )
    assert found["all"]["confident_wrong"]["share"] == 0.25


def test_what_is_too_faint_to_be_named_is_not_asked_to_be_called_undecidable():
    seen = answer("case_0001", [HIDDEN], "ambiguous")
    assert must_be_told(seen)
    assert not must_be_told(seen | {"acceptable_sets": [*seen["acceptable_sets"], []]})
    # What is known to read alike says which member it is in the stead of.
    twin = seen | {"indistinguishable": [{"effect": "heat_scale", "component": "oil"}]}
    assert must_be_told(twin)
    assert not must_be_told(twin | {"acceptable_sets": [*seen["acceptable_sets"], []]})


def test_undecidable_cases_are_called_so_or_named_as_they_are(rows):
    asked = rows[0] | {"undecidable": True, "detectable": True, "consistent": False}
    called = asked | {"called_undecidable": True, "verdict": "ambiguous", "found": ["mount_sink@flange"]}
    named = asked | {"called_undecidable": False, "verdict": "missing_physics", "found": asked["truth"]}
    guessed = named | {"found": ["mount_sink@flange"]}
    silent = named | {"verdict": "consistent", "found": []}
    found = figures([called, named, guessed, silent])
    assert found["undecidable_called"]["share"] == 0.25
    assert (found["undecidable_named"]["share"], found["undecidable_named"]["of"]) == (0.5, 2)


def test_nothing_to_count_gives_no_share():
    assert figures([])["right"]["share"] is None


def test_states_table_goes_before_the_findings(rows, tmp_path):
    (tmp_path / "results" / "case_0001" / "states.csv").write_text(
        "start,end,effect,component,value,unit\n0,100,unrecorded_heat_source,oil,90,W\n200,300,unrecorded_heat_source,oil,90,W\n"
    )
    assert score_study(tmp_path, tmp_path / "results")[0]["states_f1"] == 1.0
