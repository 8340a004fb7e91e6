"""Preload that follows the temperatures in the fast model, against the full model and through `simulate`."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.inference.followed_model import with_followed_preload
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.recordings.align import read_recording
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full
from spindle_fem.solvers.prepared_machine import prepare_machine
from tests.support.growing_spindle import MANIFEST, OVERRIDES, SENSORS

TIMES = np.arange(0.0, 2401.0, 20.0)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A machine with displacement sensors, and a recording of it by the full model."""
    place: Path = tmp_path_factory.mktemp("measured")
    machine = place / "machine.toml"
    machine.write_text(write_machine(load_machine("wu_tan_2016", OVERRIDES)) + SENSORS)
    spec = load_machine(machine)
    frame = pd.DataFrame({"time": TIMES, "n": np.where(TIMES < 1200.0, 3000.0, 1000.0)})
    for name in ("SP01", "SP05", "S1", "S2"):
        frame[name] = 0.0
    frame.to_csv(place / "made.csv", index=False)
    (place / "recording.toml").write_text(MANIFEST)
    full = simulate_full(
        prepare_machine(spec),
        read_recording(place).input_history(),
        sample_times=TIMES,
        options=TransientOptions(error=0.02),
    )
    for name in ("SP01", "SP05"):
        frame[name] = full.reading(name) - 273.15
    for name in ("S1", "S2"):
        frame[name] = 1e6 * full.motion_of(name) + 120.0
    frame.to_csv(place / "made.csv", index=False)
    return SimpleNamespace(place=place, machine=machine, spec=spec, full=full)


@pytest.mark.slow
def test_simulate_follows_preload_and_growth_as_the_full_model_does(measured, tmp_path):
    found = simulate_machine(measured.machine, measured.place, tmp_path)
    assert max(channel["max_K"] for channel in found["channels"]) < 0.05
    frame = pd.read_csv(tmp_path / "simulated.csv")
    for name in ("S1", "S2"):
        told = measured.full.motion_of(name)
        own = next(column for column in frame if name in column)
        assert np.abs(frame[own].to_numpy() - 1e6 * (told - told[0])).max() < 0.2
        assert np.ptp(told) > 3e-6
    steps = measured.full.steps
    hottest = dict(zip(measured.full.bearings, steps.preload.max(axis=0), strict=True))
    for name, values in json.loads((tmp_path / "simulation.json").read_text())["preload_N"].items():
        assert values["most"] == pytest.approx(hottest[name], rel=0.02), name
    assert any("preload follows the temperatures" in note for note in found["notes"])


@pytest.mark.slow
def test_without_it_the_same_recording_is_missed(measured, tmp_path):
    overrides = ("heat.thermal_preload=false",)
    found = simulate_machine(measured.machine, measured.place, tmp_path, overrides=overrides)
    assert max(channel["max_K"] for channel in found["channels"]) > 0.3
    assert "preload_N" not in found


@pytest.mark.slow
def test_a_diagnosis_follows_it_and_does_not_look_for_it(measured):
    recording = read_recording(measured.place)
    opened = open_machine(measured.machine, (), [recording], [])
    predicted = Predictor(opened.fast, [recording], at_stamps=True).predict(0, {}).temperature
    for number, name in enumerate(("SP01", "SP05")):
        assert np.abs(predicted[:, number] - measured.full.reading(name)).max() < 0.05, name
    assert "thermal_preload" in opened.view.has
    assert opened.spec.follows_preload
    assert any("preload follows the temperatures" in note for note in opened.notes)


@pytest.mark.slow
def test_it_keeps_on_another_basis(measured):
    """What it reads are sums over the unknowns of whichever model it stands in."""
    recording = read_recording(measured.place)
    assembled = fast_model_for(at_assembly_size(measured.spec), [recording], as_given=True)
    fast, error = with_followed_preload(measured.spec, assembled, [recording], NO_EFFECTS)
    assert error < 2e-3
    (term,) = fast.inputs.extra_terms
    basis = np.linalg.qr(np.random.default_rng(2).normal(size=(fast.model.size, fast.model.size)))[0]
    turned = fast.projected(basis)
    for name in term.combined:
        row = term.read_row(turned.model, name)
        assert row == pytest.approx(term.read_row(fast.model, name) @ basis, abs=1e-9)
