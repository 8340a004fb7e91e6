import json
import re
from pathlib import Path

import pytest

from validation import proof
from validation.proof import build, figures_of, is_wrong, render

REPORT = Path(proof.HERE).parent / "reports" / "proof"
TEMPLATE = (proof.HERE / "proof_page.md.j2").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    study = tmp_path_factory.mktemp("study")
    answer = {
        "case": "case_0001",
        "family": "hidden_heat",
        "machine": "motor",
        "noise": {"total_K": 0.2},
        "effects": [
            {
                "effect": "unrecorded_heat_source",
                "component": "body",
                "acceptable_components": ["body"],
                "statement": "the body receives heat",
                "parameters": {},
                "intervals": [[0.0, 50.0]],
                "moves_over_noise": 7.0,
            }
        ],
        "acceptable_sets": [[{"effect": "unrecorded_heat_source", "components": ["body"]}]],
        "acceptable_verdicts": ["missing_physics"],
        "verdict": "missing_physics",
        "true_verdict": "missing_physics",
        "detectable": True,
    }
    finding = {
        "effect": "unrecorded_heat_source",
        "component": "body",
        "probability": 0.8,
        "statement": "31 W of heat",
        "parameters": {"heat": {"value": 31.0, "low": 20.0, "high": 45.0, "unit": "W"}},
        "intervals": [{"start": 10.0, "end": 50.0}],
    }
    told = {
        "verdict": "missing_physics",
        "findings": [finding],
        "alternatives": [],
        "mismatch": {"detected": True, "channels": []},
        "fit": {
            "before": {"heldout_rmse_K": 2.3456},
            "after": {"heldout_rmse_K": 0.217},
            "heldout": "every 4th",
        },
    }
    wrong = {**told, "findings": [{**finding, "component": "winding"}]}
    (study / "study.json").write_text('{"seed": 987654, "generator": "networks"}')
    for name, said in (("case_0001", told), ("case_0002", wrong)):
        (study / "answers").mkdir(exist_ok=True)
        (study / "answers" / f"{name}.json").write_text(json.dumps({**answer, "case": name}))
        (study / "results" / name).mkdir(parents=True)
        (study / "results" / name / "diagnosis.json").write_text(json.dumps(said))
    return build([(study, study / "results")])


def test_figures_follow_from_the_rows(data):
    for study in data["studies"]:
        assert figures_of(study["rows"]) == {k: study[k] for k in ("summary", "reliability")}


def test_page_follows_from_the_data(data):
    page = render(json.loads(json.dumps(data)))
    assert "seed 987654" in page
    assert "2.35 K" in page
    assert "50 % (" in page
    data["studies"][0]["seed"] = 123
    assert "seed 123" in render(data)


def test_riddle_and_other_programs_are_told_where_the_book_has_them(data):
    assert "riddle" not in render(data)
    assert "Other programs" not in render(data)
    found = {"machine": "riddle_1", "verdict": "missing_physics", "found": ["starvation@F1"], "right": True}
    speeds = [{"speed_rpm": 2000.0, "before_K": 0.876, "after_K": 0.123}]
    peer = {"name": "peer", "version": "9.8", "largest_K": 2.5e-7, "rms_K": None}
    page = render(
        data
        | {
            "riddles": [found | {"set_probability": 0.91, "noise_K": 0.1, "speeds": speeds}],
            "programs": {"nodes": 10, "elements": 20, "low_degC": 15, "high_degC": 40, "programs": [peer]},
        }
    )
    assert "| 2000 | 0.88 | 0.12 |" in page
    assert "| peer | 9.8 | 2.5e-07 |  |" in page


def test_words_of_the_page_hold_no_number():
    words = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", TEMPLATE)
    assert not re.findall(r"\d", words)


def test_every_wrong_case_has_a_cause_or_says_that_it_has_none(data):
    study = data["studies"][0]
    assert [r["case"] for r in study["rows"] if is_wrong(r)] == ["case_0002"]
    assert study["causes"] == {"case_0002": {"kind": proof.OPEN, "cause": proof.OPEN}}


@pytest.mark.skipif(not (REPORT / "proof.json").exists(), reason="no proof page yet")
def test_published_page_is_what_its_data_say():
    published = json.loads((REPORT / "proof.json").read_text(encoding="utf-8"))
    page = (REPORT / "README.md").read_text(encoding="utf-8")
    assert render(published) == page
    for study in published["studies"]:
        assert figures_of(study["rows"]) == {k: study[k] for k in ("summary", "reliability")}
    for picture in re.findall(r"\]\((\S+\.png)\)", page):
        assert (REPORT / picture).exists()


def test_studies_that_stay_on_the_page_have_the_causes_that_are_known_now(data, monkeypatch):
    (study,) = data["studies"]
    other = study | {"name": "earlier"}
    cause = {"kind": "twin", "cause": "Both read the same."}
    monkeypatch.setattr(proof, "read_causes", lambda *ignored: {"case_0002": cause | {"seed": 1}})
    monkeypatch.setattr(proof, "read_note", lambda *ignored: "Seen before.")
    (kept,) = proof.kept_studies([study, other], [study])
    assert kept["name"] == "earlier"
    assert kept["causes"] == {"case_0002": cause}
    assert kept["note"] == "Seen before."
    assert kept["rows"] == study["rows"]


def test_a_worked_case_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match=r"runs/study/case_0001.*STUDY/case_0001 of one"):
        proof.worked_case({"one": (Path(), Path(), {"rows": []})}, "runs/study/case_0001")
    assert proof.worked_case({"one": (Path(), Path(), {"rows": []})}, None) is None
