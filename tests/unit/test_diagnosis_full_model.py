"""What of a fit reaches the finite-element model, and when it is not run at all."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.diagnosis.full_model import (
    full_model_errors,
    inputs_of_drive,
    physics_of_fit,
    require_choice,
    spec_on,
)
from spindle_fem.diagnosis.plant import Plant
from spindle_fem.diagnosis.view import view_of
from spindle_fem.effects.catalogue import candidates_for, effect_of
from spindle_fem.errors import SpecError
from spindle_fem.recordings.align import read_recording
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.reporting.diagnosis_full_model import full_model_sections
from spindle_fem.spec.load import load_machine
from spindle_fem.transients.history import OperatingHistory

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
channel = [
{column = "speed", role = "input", hold = "previous", drives = "speed", unit = "rpm"},
{column = "ambient", role = "input", drives = "ambient", unit = "degC"},
{column = "SP01", role = "temperature", probe = "SP01", unit = "degC", sigma = 0.1},
{column = "SP05", role = "temperature", probe = "SP05", unit = "degC", sigma = 0.1},
]
"""


def lumped_model(spec):
    path = Path(__file__).with_name("test_reduced_transient.py")
    loaded = importlib.util.spec_from_file_location("lumped_spindle", path)
    module = importlib.util.module_from_spec(loaded)
    sys.modules[loaded.name] = module
    loaded.loader.exec_module(module)
    return module.lumped_model(spec)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lumped")
    times = np.arange(0.0, 3601.0, 50.0)
    columns = {
        "t": times,
        "speed": np.where((times >= 600.0) & (times < 2500.0), 3000.0, 0.0),
        "ambient": 20.0 + np.sin(times / 900.0),
        "SP01": np.full(times.size, 20.0),
        "SP05": np.full(times.size, 20.0),
    }
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    (folder / "steps.toml").write_text(MANIFEST, encoding="utf-8")
    recording = read_recording(folder / "steps.toml")
    spec = load_machine("recorded_spindle")
    return Plant(FastModel(lumped_model(spec), spec), [recording], [np.ones(times.size, dtype=bool)])


@pytest.fixture(scope="module")
def candidates(plant):
    view = view_of(plant.fast, plant.recordings[0])
    found = {(c.effect, c.component): c for c in reversed(candidates_for(view))}
    heat = effect_of("unrecorded_heat_source").over(view, "housing", [(900.0, 2000.0)])
    return found | {(heat.effect, heat.component): heat}


def fit_of(members, values):
    return SimpleNamespace(candidates=tuple(members), values=values)


def diagnosis_of(plant, null, final):
    return SimpleNamespace(plant=plant, null=null, final=final)


def test_a_fit_becomes_terms_values_and_factors(plant, candidates):
    scale = candidates["heat_scale", "front_bearings"]
    source = candidates["unrecorded_heat_source", "housing"]
    lying = candidates["sensor_offset", "SP05"]
    factor = scale.factors[0].name
    offset = next(name for name in lying.parameters if name.startswith(lying.reading.name))
    values = {factor: 1.1, f"effect:{factor}": 1.5, "film.outside": 0.8, source.amplitude: 80.0, offset: 2.0}
    values |= {"probe.SP01.r": 1e-3, "jump.0.0": 10.0, "within_gap.0.0": 0.4}
    physics = physics_of_fit(plant, 0, fit_of((scale, source, lying), values))
    assert physics.terms == source.terms
    assert physics.values[source.amplitude] == 80.0
    assert physics.values.keys() == {name for term in source.terms for name in term.names()}
    assert physics.factors == pytest.approx({factor: 1.65, "film.outside": 0.8})


def test_what_acts_in_another_recording_stays_out(plant, candidates):
    elsewhere = replace(candidates["heat_scale", "front_bearings"], recording=1)
    factor = elsewhere.factors[0].name
    fit = fit_of((elsewhere,), {factor: 1.1, f"effect:{factor}": 1.5})
    assert physics_of_fit(plant, 0, fit).factors == {factor: 1.1}
    assert physics_of_fit(plant, 1, fit).factors == pytest.approx({factor: 1.65})


def test_inputs_are_those_of_the_reduced_model_at_every_instant(plant):
    drive = plant.drives[0]
    inputs = inputs_of_drive(drive)
    held = dict(zip(inputs.names, inputs.held.tolist(), strict=True))
    assert held["speed"]
    assert not held["ambient"]
    history = OperatingHistory.of(plant.fast.spec, inputs)
    middle = 0.5 * (drive.grid[:-1] + drive.grid[1:])
    mean = 0.5 * (drive.start + drive.end)
    points = [history.at(time) for time in middle]
    speed, ambient = (mean[:, drive.column(name)] for name in ("speed", "ambient"))
    np.testing.assert_allclose([p.speed for p in points], speed, rtol=1e-12)
    np.testing.assert_allclose([p.ambient_temperature for p in points], ambient, rtol=1e-12)
    assert history.at(600.0).speed > 0.0
    assert history.at(599.9).speed == 0.0


def test_the_coarse_mesh_is_linear_and_without_sizes_of_its_own():
    spec = load_machine("recorded_spindle", ("mesh.preset=normal", "mesh.size_factor=0.7"))
    coarse = spec_on(spec, "coarse").mesh
    assert (coarse.preset, coarse.order, coarse.size_factor, dict(coarse.size)) == ("coarse", 1, 1.0, {})
    assert spec_on(spec, "own") is spec


def test_off_runs_nothing_and_leaves_no_section(plant):
    machine = SimpleNamespace(is_network=False, spec=plant.fast.spec)
    found = full_model_errors(diagnosis_of(plant, fit_of((), {}), fit_of((), {})), machine, mesh="off")
    assert found == {"mesh": "off", "reason": "It was not asked for."}
    assert full_model_sections({"fit": {"full_model": found}}) == []


def test_a_network_has_no_full_model(plant):
    machine = SimpleNamespace(is_network=True, spec=None)
    found = full_model_errors(diagnosis_of(plant, fit_of((), {}), fit_of((), {})), machine, mesh="coarse")
    assert found["reason"] == "The machine is a network: it has no finite-element model."
    (section,) = full_model_sections({"fit": {"full_model": found}})
    assert section.blocks[0].text == found["reason"]


def test_recorded_heat_is_said_to_be_beyond_the_full_model(plant):
    drive = plant.drives[0]
    heated = SimpleNamespace(drives=(replace(drive, names=(*drive.names, "heat.motor")),))
    machine = SimpleNamespace(is_network=False, spec=plant.fast.spec)
    found = full_model_errors(diagnosis_of(heated, fit_of((), {}), fit_of((), {})), machine, mesh="own")
    assert found["reason"] == "The recording gives heat.motor, which the full model does not take."


def test_another_mesh_is_refused():
    with pytest.raises(SpecError, match=r"'fine'.*Allowed: off, coarse, own"):
        require_choice("fine")
