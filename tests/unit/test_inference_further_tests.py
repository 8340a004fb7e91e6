"""Tests that could be run on a network, as hypotheses predict them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.effects.registry import effect_of
from spindle_fem.inference.further_tests import answer, trials_of
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import MACHINE, record
from tests.support.written_texts import manifest_text, network_text


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    (folder / "drive.toml").write_text(MACHINE, encoding="utf-8")
    run = read_recording(record(folder / "run", 3))
    return open_machine(folder / "drive.toml", (), [run, run], [])


def test_heat_of_any_recording_acts_in_every_trial(machine):
    predictor = Predictor(machine.fast, machine.recordings)
    heat = effect_of("unrecorded_heat_source").over(machine.view, "body", [(1800.0, 5400.0)])

    def readings(trial, *candidates):
        values = dict.fromkeys((item.amplitude for item in candidates), 40.0)
        fit = SimpleNamespace(candidates=candidates, coordinates=(), values=values)
        return answer(predictor, fit, trial, (), 300.0).readings

    trials = trials_of(predictor, machine.view)
    assert len(trials) == 4
    for trial in trials:
        first, second = (readings(trial, replace(heat, recording=number)) for number in (0, 1))
        np.testing.assert_array_equal(second, first)
        assert np.max(second - readings(trial)) > 5.0


def test_every_input_of_a_network_is_usual_as_it_is_while_on(tmp_path):
    loads = {"speed": "0.1 W/(rad/s)", "power": "1 W/W", "electrical_power": "1 W/W", "thrust": "1 W/N"}
    text = network_text(
        "loads",
        {"body": "1500 J/K"},
        {"body|ambient": "2 W/K", "body|oil": "1 W/K"},
        [("body", *item) for item in loads.items()],
        {"ambient": "ambient", "oil": "coolant_inlet"},
    )
    (tmp_path / "machine.toml").write_text(text, encoding="utf-8")
    inputs = ["ambient", "coolant_inlet", *loads]
    text = manifest_text("loads", {"T": "body"}, {name: name for name in inputs})
    (tmp_path / "recording.toml").write_text(text, encoding="utf-8")
    times = np.arange(0.0, 7201.0, 60.0)
    columns = {"time_s": times, "T": 20.0 + 0.1 * np.cos(times), "ambient": 20.0, "coolant_inlet": 22.0}
    columns |= dict.fromkeys(loads, np.where(times % 1800.0 < 900.0, 30.0, 0.0))
    pd.DataFrame(columns).to_csv(tmp_path / "data.csv", index=False)
    opened = open_machine(tmp_path / "machine.toml", (), [read_recording(tmp_path)], [])
    trials = trials_of(Predictor(opened.fast, opened.recordings), opened.view)[1:]
    assert [trial.quantity for trial in trials] == [name.replace("_", " ") for name in loads]
    for trial in trials:
        others = [name for name in loads if name != "speed" and name.replace("_", " ") != trial.quantity]
        held = trial.drive.start[:, [trial.drive.column(name) for name in others]]
        np.testing.assert_allclose(held, 30.0)
