"""Words of a diagnosis follow its verdict."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from spindle_fem.commands.console import print_diagnosis
from spindle_fem.inference.next_measurement import lead_words
from spindle_fem.report.diagnosis_tables import cards, channel_table, fit_table, next_blocks, set_tables
from spindle_fem.report.diagnosis_words import checks, confidence_words, verdict_sentence

STATEMENT = "312 W of heat enters the housing."


def content(verdict):
    finding = {
        "effect": "unrecorded_heat_source",
        "component": "housing",
        "kind": "missing_physics",
        "parameters": {"heat": {"value": 312.0, "low": 128.0, "high": 683.0, "unit": "W"}},
        "intervals": [],
        "statement": STATEMENT,
    }
    return {
        "verdict": verdict,
        "reason": "the best set leaves 2.1 times what errors allow" if verdict == "unexplained" else "",
        "findings": [finding],
        "set_probability": 0.34,
        "alternatives": [],
        "mismatch": {
            "p_value": 0.0001,
            "channels": [],
            "where": {"component": "housing", "r_mm": None, "z_mm": None, "credible": ["housing"]},
            "missing_heat_W": {},
        },
        "fit": {
            "before": {"train_rmse_K": 0.464, "heldout_rmse_K": 0.558},
            "after": {"train_rmse_K": 0.186, "heldout_rmse_K": 0.243},
            "noise_K": 0.075,
            "heldout": "every 4th",
            "full_model": {"mesh": "off", "reason": "off"},
        },
        "next_measurement": {"where": "SP01", "quantity": "temperature", "condition": "a step", "why": "x"},
    }


@pytest.mark.parametrize("verdict", ["unexplained", "missing_physics"])
def test_findings_of_a_verdict_without_explanation_are_no_statements(verdict, capsys):
    told = content(verdict)
    unexplained = verdict == "unexplained"
    sentence = verdict_sentence(told)
    assert STATEMENT in sentence
    assert ("is not explained: the best set leaves 2.1 times" in sentence) == unexplained
    assert ("What comes nearest" in sentence) == unexplained
    table = set_tables(told)[0]
    assert table.caption == ("What comes nearest." if unexplained else "What was found.")
    assert any("comes nearest" in item["name"] for item in cards(told).items) == unexplained
    told["reason"] = "something else is likelier than the best set"
    assert unexplained or "Probability 0.34. Something else is likelier" in verdict_sentence(told)
    print_diagnosis(told, Path())
    assert ("Comes nearest: 312 W" in capsys.readouterr().out) == unexplained


@pytest.mark.parametrize(
    ("verdict", "found"), [("missing_physics", 1), ("unexplained", 1), ("unexplained", 0)]
)
def test_every_wrong_number_of_a_definition_is_said_whatever_else_is(verdict, found, capsys):
    def number(key, given):
        defined = {"given": given, "value": 2.0 * given, "low": given, "high": 3.0 * given, "unit": "mm"}
        return {"key": key, "defined": defined}

    told = content(verdict)
    told["findings"] = told["findings"][:found]
    told["misdescription"] = {
        "wrong": number("channel.depth", 3.0),
        "also_wrong": [number("channel.z_start", 50.0)],
    }
    said = (
        "The definition is off at channel.depth: 6 mm (3 to 9), where it says 3.",
        "The definition is off at channel.z_start: 100 mm (50 to 150), where it says 50.",
    )
    assert all(text in verdict_sentence(told) for text in said)
    assert [text for text in checks(told) if "channel" in text] == [
        "Drawing, data sheet or machine: is channel.depth as the definition has it?",
        "Drawing, data sheet or machine: is channel.z_start as the definition has it?",
    ]
    print_diagnosis(told, Path())
    shown = " ".join(capsys.readouterr().out.split())
    assert all(text in shown for text in said)


def test_what_switches_is_held_against_readings_that_tell_when(capsys):
    told = content("missing_physics")
    assert "With it the held-out error falls from 0.56 K to 0.24 K" in verdict_sentence(told)
    told["fit"]["after"] = {
        "train_rmse_K": 0.186,
        "heldout_rmse_K": 0.571,
        "heldout_states_told_rmse_K": 0.21,
    }
    words = "its moments told by all readings"
    assert f"With it, {words}, the held-out error falls from 0.56 K to 0.21 K" in verdict_sentence(told)
    assert {"value": "0.56 K → 0.21 K", "name": f"held-out error, before → after, {words}"} in cards(
        told
    ).items
    rows = [row["cells"] for row in fit_table(told).rows]
    assert rows[1:] == [["after", "0.186", "0.571"], [f"after, {words}", "–", "0.210"]]
    print_diagnosis(told, Path())
    assert f"after, {words}" in capsys.readouterr().out


def test_missing_heat_is_told_in_the_mean_and_at_its_peak_each_with_its_sign():
    told = content("missing_physics")
    told["findings"][0]["effect"] = "grease_churning"
    told["mismatch"]["missing_heat_W"] = {"housing": {"mean": -2.8, "peak": 28.9}}
    words = "gave 3 W less heat than modelled in the mean of all time, and 29 W more at the utmost"
    assert f"{words}. " in verdict_sentence(told)
    # findings are larger: the parameters of the fit with nothing missing take up part of them
    assert verdict_sentence(told).startswith(
        "Beyond what the machine's uncertain values took up, the readings"
    )
    told["mismatch"]["where"]["condition"] = "3000-4000 rpm"
    assert f"{words}, above all at 3000-4000 rpm. " in verdict_sentence(told)


def test_a_p_value_that_says_nothing_beside_what_is_left_is_not_stated(capsys):
    told = content("unexplained")
    for p_value, stated in ((0.0001, True), (0.7, False)):
        told["mismatch"]["p_value"] = p_value
        print_diagnosis(told, Path())
        assert ("(p " in capsys.readouterr().out) == stated
        assert any("nothing were missing" in item["name"] for item in cards(told).items) == stated
        assert any("nothing were missing" in words for words in confidence_words(told)) == stated


def test_what_a_consistent_recording_does_not_rule_out_is_named():
    told = content("consistent") | {"findings": [], "slow_error": {"sigma_K": 0.05, "time_s": 600.0}}
    assert "Not ruled out" not in verdict_sentence(told)
    windage = {"effect": "windage", "component": "shaft"}
    told["alternatives"] = [
        {"findings": [windage], "probability": 0.5},
        {"findings": [windage, windage], "probability": 0.001},
    ]
    assert verdict_sentence(told).endswith(" Not ruled out: windage at the shaft (0.50).")


def test_the_improved_machine_stands_in_the_table_with_its_own_error():
    told = content("missing_physics")
    told["fit"]["improved_machine"] = {"train_rmse_K": 0.983, "heldout_rmse_K": None}
    assert fit_table(told).rows[-1]["cells"] == ["improved_machine.toml", "0.983", "–"]


def test_sizes_of_intervals_stand_beside_their_times():
    told = content("missing_physics")
    told["findings"][0]["intervals"] = [
        {"start": 3600.0, "end": 7200.0, "value": 34.83},
        {"start": 9000.0, "end": 9600.0, "value": 147.5},
    ]
    table = next(item for item in set_tables(told) if item.caption.startswith("When it is on"))
    assert [row["cells"][-3:] for row in table.rows] == [
        ["1.00 h", "2.00 h", "34.8 W"],
        ["2.50 h", "2.67 h", "148 W"],
    ]


def test_a_difference_of_proposed_tests_is_that_of_the_second_answer_from_the_first():
    told = content("ambiguous")
    told["next_measurement"] |= {
        "between": ["heat", "cooling"],
        "options": [
            {
                "where": "SP01",
                "channel": "SP01",
                "condition": "a step",
                "expected_information": 0.5,
                "difference_K": -4.0,
                "sigma_K": 0.5,
                "after_s": 600.0,
            }
        ],
    }
    assert "what is read if it is cooling, less what if it is heat" in next_blocks(told)[-1].caption


def test_probabilities_are_shown_beside_sets_of_long_names(capsys):
    told = content("missing_physics")
    finding = told["findings"][0] | {"component": "milling_spindle|room"}
    told["alternatives"] = [{"findings": [finding] * 3, "probability": 0.123}]
    print_diagnosis(told, Path())
    assert "0.123" in capsys.readouterr().out


def test_one_set_that_is_doubted_is_not_told_apart_from_others():
    told = content("ambiguous") | {"reason": "something else is likelier than the best set"}
    sentence = verdict_sentence(told)
    assert "The likeliest set is" in sentence
    assert "but something else is likelier than the best set." in sentence
    rival = told["findings"][0] | {"component": "flange"}
    several = told | {"alternatives": [{"findings": [rival], "probability": 0.3}]}
    assert "cannot tell apart" in verdict_sentence(several)
    pair = told | {"findings": [*told["findings"], rival]}
    less = [{"findings": [rival], "probability": chance} for chance in (0.3, 0.004)]
    told_apart = ["cannot tell apart" in verdict_sentence(pair | {"alternatives": [item]}) for item in less]
    assert told_apart == [True, False]


def test_a_consistent_machine_needs_no_check_for_what_is_merely_not_ruled_out():
    weak = {"findings": content("missing_physics")["findings"], "probability": 0.06}
    told = content("consistent") | {"findings": [], "alternatives": [weak]}
    assert checks(told) == ["Nothing: the machine does what its definition says."]
    assert checks(told | {"verdict": "ambiguous"})[0].startswith("The housing")


def test_only_a_verdict_that_decides_says_that_the_data_have_decided():
    def lead(verdict, decided):
        return lead_words(SimpleNamespace(judgement=SimpleNamespace(verdict=verdict)), decided)

    assert lead("parameter", True).startswith("The data have decided")
    assert "decided" not in lead("unexplained", True)
    assert lead("ambiguous", False) == ""


def test_errors_are_told_beside_the_noise_and_by_no_second_measure():
    table = fit_table(content("unexplained"))
    assert "0.07 K" in table.caption or "0.08 K" in table.caption
    assert "noise" not in str(table.columns).lower()


def test_where_nothing_was_found_errors_are_not_told_twice():
    told = content("consistent") | {"findings": []}
    told["mismatch"]["channels"] = [{"channel": "SP01", "rmse_K": 0.07, "noise_K": 0.04, "max_K": 0.2}]
    told["fit"]["before"] = told["fit"]["after"]
    assert [row["cells"] for row in fit_table(told).rows] == [["nothing missing", "0.186", "0.243"]]
    assert {"value": "0.24 K", "name": "held-out error"} in cards(told).items
    assert [c["title"] for c in channel_table(told)[0].columns] == [
        "channel",
        "error / K",
        "noise / K",
        "largest / K",
    ]


def test_the_report_tells_of_displacements_in_micrometres():
    error = {"channel": "S1", "rmse_um": 1.5, "noise_um": 0.1, "max_um": 4.0}
    fit = {"channels_after": [], "displacements_after": [error | {"rmse_um": 0.2, "max_um": 0.5}]}
    errors = {when: content("missing_physics")["fit"][when] for when in ("before", "after")}
    told = {"mismatch": {"channels": [], "displacements": [error]}, "fit": fit | errors}
    _, grown = channel_table(told)
    assert "before / µm" in str(grown.columns)
    assert "0.200" in str(grown.rows)
