"""One kind of effect at one place, at different times in two recordings of a written network."""

import csv
import logging

import numpy as np
import pytest

from spindle_fem.commands.diagnose_command import diagnose_without_report
from spindle_fem.report.diagnosis_words import set_words
from tests.support.flawed_network import HEAT, MACHINE, as_built, inputs_at, record

TIMES = np.arange(0.0, 9001.0, 60.0)
ON = {"monday": (1800.0, 3000.0), "tuesday": (5400.0, 6600.0)}


def test_heat_at_one_node_at_other_times_in_each_recording_is_two_findings(tmp_path, caplog):
    machine, built = tmp_path / "drive.toml", as_built(7)
    machine.write_text(MACHINE)
    runs = []
    for seed, (name, on) in enumerate(ON.items(), 7):
        heat = lambda time, on=on: HEAT if on[0] <= time < on[1] else 0.0  # noqa: E731
        runs.append(record(tmp_path / name, seed, built=built, times=TIMES, extra=heat))
    caplog.set_level(logging.WARNING)
    content = diagnose_without_report(machine, runs, tmp_path / "out")
    assert content["verdict"] == "missing_physics"
    findings = {item["recording"]: item for item in content["findings"]}
    assert len(content["findings"]) == 2
    assert findings.keys() == ON.keys()
    for name, on in ON.items():
        finding = findings[name]
        assert (finding["effect"], finding["component"]) == ("unrecorded_heat_source", "body")
        (told,) = finding["intervals"]
        assert told["recording"] == name
        assert (told["start"], told["end"]) == pytest.approx(on, abs=120.0)
        assert finding["parameters"]["heat"]["value"] == pytest.approx(HEAT, rel=0.1)
        assert f"That is in {name} only." in finding["statement"]
        assert f"lacks unrecorded_heat_source @ body, which acts in {name} only" in caplog.text
    assert "at the body in tuesday" in set_words(content["findings"])
    assert content["fit"]["after"]["heldout_rmse_K"] < 0.13 < content["fit"]["before"]["heldout_rmse_K"]
    with (tmp_path / "out" / "states.csv").open() as file:
        assert {row["recording"] for row in csv.DictReader(file)} == ON.keys()


def test_a_sensor_that_comes_off_at_another_time_in_each_recording_is_two_findings(tmp_path):
    machine, built = tmp_path / "drive.toml", as_built(7)
    machine.write_text(MACHINE)
    off, runs = {"monday": 3900.0, "tuesday": 6000.0}, []
    for seed, (name, begin) in enumerate(off.items(), 7):

        def reading(times, told, begin=begin):
            share = np.where(times >= begin, 0.6, 0.0)[:, None] * [1.0, 0.0, 0.0]
            air = np.array([inputs_at(time)[2] for time in times])[:, None]
            return told + share * (air - told)

        runs.append(record(tmp_path / name, seed, built=built, times=TIMES, reading=reading))
    content = diagnose_without_report(machine, runs, tmp_path / "out")
    assert content["verdict"] == "sensor"
    findings = {item["recording"]: item for item in content["findings"]}
    assert len(content["findings"]) == 2
    for name, begin in off.items():
        assert (findings[name]["effect"], findings[name]["component"]) == ("sensor_detached", "winding")
        assert findings[name]["parameters"]["time"]["value"] == pytest.approx(begin, abs=200.0)
        assert f"That is in {name} only." in findings[name]["statement"]
