"""The spindle examples with answers, where the recordings lie beside the repository."""

import json
from pathlib import Path

import pytest

from spindle_fem.commands.diagnose_command import diagnose_without_report
from spindle_fem.definition.load import load_machine

EXAMPLES = Path(__file__).resolve().parents[3] / "shared" / "recordings" / "spindle_examples"
CASES = sorted(path.name for path in EXAMPLES.glob("example_*") if path.is_dir())
# Names of parameters that an answer and a finding share; how near they have to come.
TOLERANCE = 0.15

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CASES, reason=f"no recordings in {EXAMPLES.name} beside the repository"),
]


def diagnosed(name, folder, *overrides):
    case = EXAMPLES / name
    earlier = case / "calibration.toml"
    return diagnose_without_report(
        "recorded_spindle",
        [case / "recording.toml"],
        folder,
        [earlier] if earlier.exists() else (),
        ("mesh.preset=coarse", *overrides),
        full_model="off",
    )


def is_acceptable(findings, accepted):
    """Whether every effect of a set is found once at one of its places, and nothing else."""
    left = list(findings)
    for wanted in accepted:
        match = next(
            (
                item
                for item in left
                if item["effect"] == wanted["effect"] and item["component"] in wanted["components"]
            ),
            None,
        )
        if match is None:
            return False
        left.remove(match)
    return not left


@pytest.mark.parametrize("name", CASES or ["none"])
def test_an_example_is_answered_right(name, tmp_path):
    answer = json.loads((EXAMPLES / "answers" / f"{name}.json").read_text(encoding="utf-8"))
    content = diagnosed(name, tmp_path / "out")
    assert content["verdict"] in answer["acceptable_verdicts"]
    found = [(item["effect"], item["component"]) for item in content["findings"]]
    assert any(is_acceptable(content["findings"], item) for item in answer["acceptable_sets"]), found
    for effect in answer["effects"]:
        finding = next((i for i in content["findings"] if i["effect"] == effect["effect"]), None)
        if finding is None:
            # Another acceptable set has other parameters.
            continue
        for parameter, given in effect["parameters"].items():
            true = given["value"]
            value = finding["parameters"][parameter]["value"]
            assert value == pytest.approx(true, rel=TOLERANCE), f"{effect['effect']} {parameter}"
    total = sum(item["probability"] for item in (*content["findings"], *content["alternatives"]))
    assert total <= 1.0 + 1e-9
    errors = content["fit"]
    assert errors["after"]["heldout_rmse_K"] < 1.5 * answer["noise"]["total_K"]
    if answer["effects"]:
        assert errors["after"]["heldout_rmse_K"] < errors["before"]["heldout_rmse_K"]
    else:
        assert errors["after"] == errors["before"]


@pytest.mark.parametrize(
    ("name", "verdict"),
    [("example_1_consistent", ("parameter", "consistent")), ("example_6_gap_closure", ("missing_physics",))],
)
def test_a_number_of_the_definition_that_is_wrong_is_told_with_what_is_missing_beside_it(
    name, verdict, tmp_path
):
    """The recordings are of a machine whose cast iron conducts 50 W/(m·K)."""
    answer = json.loads((EXAMPLES / "answers" / f"{name}.json").read_text(encoding="utf-8"))
    content = diagnosed(name, tmp_path / "out", "materials.cast_iron.thermal_conductivity=25W/m/K")
    assert content["verdict"] in verdict
    if answer["effects"]:
        assert any(is_acceptable(content["findings"], item) for item in answer["acceptable_sets"])
    wrong = content["misdescription"]["wrong"]
    assert wrong["key"] == "materials.cast_iron.thermal_conductivity"
    assert wrong["defined"]["given"] == 25.0
    assert wrong["defined"]["low"] < 50.0 < wrong["defined"]["high"]
    assert wrong["defined"]["value"] == pytest.approx(50.0, rel=TOLERANCE)
    assert content["fit"]["after"]["heldout_rmse_K"] < content["fit"]["before"]["heldout_rmse_K"]
    improved = load_machine(tmp_path / "out" / "improved_machine.toml")
    conductivity = improved.materials["cast_iron"].thermal_conductivity
    assert conductivity == pytest.approx(wrong["defined"]["value"], rel=0.05)


@pytest.mark.parametrize(
    ("name", "key", "given", "unit"),
    [
        ("example_2_heat_scale", "film.flange_back.coefficient", 20.0, "W/m**2/K"),
        ("example_5_coolant_film", "coolant.film_factor", 0.35, ""),
    ],
)
def test_a_value_with_a_prior_that_is_wrong_is_told_by_the_calibration_beside_what_has_changed_since(
    name, key, given, unit, tmp_path
):
    """The film that is wrong in the definition and the one that fouled are one film."""
    answer = json.loads((EXAMPLES / "answers" / f"{name}.json").read_text(encoding="utf-8"))
    true = {
        "film.flange_back.coefficient": 200.0 * answer["as_built"]["flg"],
        "coolant.film_factor": answer["as_built"]["film"],
    }[key]
    content = diagnosed(name, tmp_path / "out", f"{key}={given} {unit}".strip())
    assert any(is_acceptable(content["findings"], item) for item in answer["acceptable_sets"])
    wrong = content["misdescription"]["wrong"]
    assert wrong["key"] == key
    assert wrong["defined"]["given"] == given
    assert wrong["defined"]["low"] < true < wrong["defined"]["high"]
    assert content["misdescription"]["also_wrong"] == []
