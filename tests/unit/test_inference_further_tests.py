"""Tests that could be run on a network, as hypotheses predict them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.registry import effect_of
from spindle_fem.inference.further_tests import answer, trials_of
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import MACHINE, record


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
