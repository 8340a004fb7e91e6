"""The chapter of the concealed study on three cases made up for it."""

import json
import shutil

import pytest

from book import causes
from book.chapters import concealed
from book.makeup import counted
from book.page import Entry, Pictures, render_chapter
from book.work import Desk

NOISE = 0.1


def answer(number, effects, *, ratio=None):
    done = [
        {
            "effect": effect,
            "component": place,
            "acceptable_components": [place],
            "kind": "parameter",
            "truth_form": {},
            "parameters": {"factor": {"value": 1.3, "unit": ""}},
            "outside_catalogue": False,
        }
        for effect, place in effects
    ]
    verdict = "parameter" if effects else "consistent"
    return {
        "case": f"case_{number:04d}",
        "two_recordings": False,
        "true_verdict": verdict,
        "acceptable_verdicts": [verdict],
        "acceptable_sets": [[{"effect": effect, "components": [place]} for effect, place in effects]],
        "indistinguishable": [],
        "clear": bool(effects),
        "detectable": True,
        "identifiability": {"ratio": ratio} if effects else None,
        "effects": done,
        "noise": {"white_K": NOISE, "slow_K": 0.0, "rounding_K": 0.0},
    }


def diagnosis(verdict, findings, probability, after):
    stated = [
        {
            "effect": effect,
            "component": place,
            "probability": probability,
            "parameters": {"factor": {"value": 1.25, "low": 1.1, "high": 1.4, "unit": ""}},
        }
        for effect, place in findings
    ]
    return {
        "verdict": verdict,
        "mismatch": {"detected": verdict != "consistent", "p_value": 0.4, "where": {"component": None}},
        "findings": stated,
        "set_probability": probability,
        "alternatives": [],
        "fit": {
            "before": {"heldout_rmse_K": 0.5},
            "after": {"heldout_rmse_K": after},
            "noise_K": NOISE,
        },
    }


@pytest.fixture
def desk(tmp_path):
    cases = [
        (answer(1, []), diagnosis("consistent", [], 0.95, 0.1)),
        (
            answer(2, [("heat_scale", "rear_bearings")], ratio=5.0),
            diagnosis("parameter", [("heat_scale", "rear_bearings")], 0.99, 0.104),
        ),
        (
            answer(3, [("heat_split", "front_bearings")], ratio=3.0),
            diagnosis("parameter", [("joint_conductance", "flange")], 0.97, 0.2),
        ),
    ]
    study = tmp_path / "study"
    (study / "answers").mkdir(parents=True)
    (study / "study.json").write_text(json.dumps({"seed": 5, "cases": 4}), encoding="utf-8")
    for truth, said in cases:
        (study / "answers" / f"{truth['case']}.json").write_text(json.dumps(truth), encoding="utf-8")
        folder = study / "results" / truth["case"]
        folder.mkdir(parents=True)
        (folder / "diagnosis.json").write_text(json.dumps(said), encoding="utf-8")
        (folder / "timing.json").write_text(json.dumps({"wall_s": 12.0}), encoding="utf-8")
    waiting = answer(4, [])
    (study / "answers" / "case_0004.json").write_text(json.dumps(waiting), encoding="utf-8")
    return Desk(tmp_path / "work", study, study / "results", tmp_path / "recordings", tell=lambda text: None)


def page(desk, tmp_path):
    entry = Entry("concealed", concealed.TITLE, concealed.make)
    chapter = concealed.make(desk, Pictures(tmp_path / "pictures", "concealed"))
    return chapter, render_chapter(entry, chapter, (entry,))


def test_chapter_says_what_is_met_and_what_is_not(desk, tmp_path):
    chapter, _ = page(desk, tmp_path)
    assert chapter.outcome.startswith("3 concealed cases (seed 5): ")
    assert "clear single effects named first 50.0 %" in chapter.outcome
    assert "confident (above 0.9) and wrong 33.3 %" in chapter.outcome
    assert "false" not in chapter.outcome
    assert "1 of 4 are not diagnosed yet" in chapter.outcome
    assert chapter.tone != "good"


def test_every_wrong_case_stands_with_its_cause(desk, tmp_path, monkeypatch):
    _, html = page(desk, tmp_path)
    assert "case_0003" in html
    assert html.count(causes.OPEN) == 2  # in its row, and in the count of causes
    path = tmp_path / "causes.toml"
    path.write_text(
        '[[case]]\nseed = 5\ncase = "case_0003"\nkind = "twin"\ncause = "they warm alike"\n', encoding="utf-8"
    )
    monkeypatch.setattr(concealed, "CAUSES", path)
    _, html = page(desk, tmp_path)
    assert "they warm alike" in html
    assert causes.OPEN not in html


def test_makeup_counts_every_case_once_by_number_of_effects(desk):
    answers = [json.loads(path.read_text()) for path in (desk.study / "answers").iterdir()]
    answers[0] |= {
        "rows": {"recording": {"gaps": 2}, "calibration": {"gaps": 0}},
        "noise": {"rounding_K": 0.05},
        "cycle": "two_level",
    }
    rows = dict(counted(answers))
    assert (rows["nothing concealed"], rows["one effect"], rows["two effects"]) == ("2", "2", "0")
    assert rows["clear: strong, and nothing else comes near"] == "2"
    assert (rows["with gaps"], rows["with spikes"]) == ("1", "0")
    assert (rows["rounded to 0.05 K"], rows["load cycle: two level"]) == ("1", "1")


def test_pictures_and_score_are_kept(desk, tmp_path):
    page(desk, tmp_path)
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    wanted = {"verdicts", "effects", "strength", "calibration", "coverage", "errors", "times"}
    assert names == {f"concealed_{name}.png" for name in wanted}
    assert json.loads((desk.work / "concealed" / "score.json").read_text())["summary"]["cases"] == 3


def test_an_earlier_study_stands_beside_with_its_own_wrong_cases(desk, tmp_path):
    earlier = tmp_path / "earlier"
    shutil.copytree(desk.study, earlier)
    (earlier / "study.json").write_text(json.dumps({"seed": 3, "cases": 4}), encoding="utf-8")
    shutil.rmtree(earlier / "results" / "case_0002")
    desk.earlier = (earlier,)
    _, html = page(desk, tmp_path)
    assert "seed 3, 2 cases" in html
    assert "Wrong cases of the earlier study, seed 3" in html
    assert html.count("case_0003") == 2
