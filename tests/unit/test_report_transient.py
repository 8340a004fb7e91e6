"""What is told of a transient: approach to equilibrium in words, phases on the terminal."""

import json
from pathlib import Path

from spindle_fem.commands.console import print_transient
from spindle_fem.commands.report_command import rebuild
from spindle_fem.report.transient_report import equilibrium_text

EQUILIBRIUM = {
    "exists": True,
    "left_K": 0.214,
    "shares_s": {"0.95": 9360.0, "0.99": 14400.0},
    "bands_s": {"1": 9000.0, "0.5": 12240.0, "0.1": None},
}


def phase(name, settled, end):
    return {
        "name": name,
        "settled": settled,
        "end_s": end,
        "heat_W": 621.04,
        "hottest_degC": 48.126,
        "probes_degC": {"SP01": 25.498, "SP05": 39.581},
        "start_s": 0.0,
        "energy": {
            "heat_in_J": 6e5,
            "stored_J": 2e5,
            "heat_out_J": {"coolant": 4e5},
            "imbalance_relative": 3e-10,
        },
        "steps": 37,
        "cpu_seconds": 41.0,
    }


def test_the_approach_to_equilibrium_is_told_in_hours():
    text = equilibrium_text(EQUILIBRIUM)
    assert "within 0.21 K of the steady state" in text
    assert "95 % of the way: after 2.60 h; 99 %: after 4.00 h." in text
    assert "All probes stay within 0.5 K: after 3.40 h; within 0.1 K: not within this run." in text


def test_a_last_phase_without_equilibrium_says_why():
    text = equilibrium_text({"exists": False, "reason": "the temperatures run away."})
    assert text == "The last phase tends to no steady state: the temperatures run away."


def test_the_terminal_shows_the_end_of_every_phase(capsys):
    content = {
        "study": "Step test",
        "machine": "wu_tan_2016",
        "unknowns": 88000,
        "phases": [phase("0 rpm", True, 5400.0), phase("500 rpm", False, 27000.0)],
        "equilibrium": EQUILIBRIUM,
    }
    print_transient(content, Path("out"))
    shown = " ".join(capsys.readouterr().out.split())
    for text in (
        "Step test: wu_tan_2016, 88,000 temperatures",
        "0 rpm 1.50 621.0 48.13 25.50 39.58",
        "500 rpm (not settled) 7.50",
        "95 % of the way: after 2.60 h",
        "74 steps, heat in less out and stored 3.0e-10, 82 s of processor",
        "out/report.html",
    ):
        assert text in shown, text


def test_the_page_is_rebuilt_from_the_folder(tmp_path):
    content = {
        "schema": "spindle-fem/transient-result/1",
        "study": "Heat-up",
        "machine": "m",
        "mesh_preset": "coarse",
        "unknowns": 1234,
        "phases": [phase("3000 rpm", True, 7200.0)],
        "equilibrium": EQUILIBRIUM,
    }
    (tmp_path / "transient.json").write_text(json.dumps(content), encoding="utf-8")
    page = rebuild(tmp_path).read_text(encoding="utf-8")
    for text in ("Heat-up", "2.00 h", "39.58", "within 0.21 K of the steady state"):
        assert text in page
