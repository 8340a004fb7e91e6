"""What experience with concealed recordings says of evidence, on experience made up for the purpose."""

import json

import numpy as np
import pytest
from scipy.special import expit

from spindle_fem.inference import tuned
from spindle_fem.inference.reliability import features, reliable
from validation.reliability import experience, fitted, log_loss


def test_the_regression_finds_what_made_the_experience():
    generator = np.random.default_rng(1)
    true = np.array([0.5, 0.3, 0.9, -0.8])
    rows = np.array(
        [
            features(float(p), float(share), float(more))
            for p, share, more in zip(
                expit(generator.uniform(-2.0, 9.0, 20_000)),
                10.0 ** generator.uniform(-2.5, 0.0, 20_000),
                10.0 ** generator.uniform(0.0, 2.0, 20_000) - 1.0,
                strict=True,
            )
        ]
    )
    right = (generator.random(20_000) < expit(rows @ true)).astype(float)
    assert fitted(rows, right) == pytest.approx(true, abs=0.1)
    assert log_loss(expit(rows @ true), right) < log_loss(expit(rows[:, 1]), right)


def test_experience_never_raises_what_evidence_says():
    own = [tuned.RELIABILITY_CONSTANT, tuned.BY_LOGIT, tuned.BY_SHARE, tuned.BY_MORE]
    for probability, share, more in ((0.99, 1.0, 30.0), (0.999, 0.04, 0.0), (1.0, 0.0, 2.0)):
        seen = expit(np.dot(own, features(probability, share, more)))
        assert reliable(probability, share, more) == pytest.approx(min(probability, seen))


def test_only_diagnoses_that_name_something_count(tmp_path):
    study, results = tmp_path / "study", tmp_path / "results"
    (study / "answers").mkdir(parents=True)
    finding = {"effect": "windage", "component": "shaft"}
    wanted = [{"effect": "windage", "components": ["shaft"]}]
    for name, effects, findings, foreign in (
        ("a", wanted, [finding], False),
        ("b", wanted, [], False),
        ("c", [], [finding], False),
        ("d", wanted, [{**finding, "effect": "radiation"}], False),
        ("e", wanted, [finding], True),
    ):
        concealed = [{**e, "outside_catalogue": foreign} for e in effects]
        answer = {"case": name, "effects": concealed, "acceptable_sets": [wanted] if effects else []}
        (study / "answers" / f"{name}.json").write_text(json.dumps(answer))
        (results / name).mkdir(parents=True)
        said = {
            "findings": findings,
            "evidence": {"probability": 0.9, "share_of_last": 1.0, "gain_of_more": 0.0},
        }
        (results / name / "diagnosis.json").write_text(json.dumps(said))
    rows, right = experience(study, results)
    assert rows.shape == (3, 4)
    assert right.tolist() == [1.0, 0.0, 0.0]
    (results / "a" / "diagnosis.json").write_text(json.dumps({"findings": [finding]}))
    with pytest.raises(SystemExit, match=r"a/diagnosis.json: says nothing of evidence"):
        experience(study, results)
