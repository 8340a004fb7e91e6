"""A network as a state space: the same temperatures as simulate in every kind of file, refusals."""

import importlib.util
import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.commands.export_command import export_machine
from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.errors import BadInputError
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.export.portable_model import PortableModel
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.written_texts import network_text

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "recordings"
FOLDER = Path(os.environ.get("SPINDLE_FEM_RECORDINGS", BESIDE))
# Largest difference from simulate, K.
AGREEMENT = 1e-3
MACHINE = network_text(
    "Spindle 2",
    {"bearing": "400 J/K", "shaft": "900 J/K", "housing": "3 kJ/K"},
    {
        "bearing|housing": "8 W/K",
        "bearing|shaft": "3 W/K",
        "housing|ambient": "4 W/K",
        "shaft|floor": "1 W/K",
    },
    [
        ("bearing", "speed", "80 W", {"reference": "1000 rpm", "exponent": 1.5}),
        ("housing", "load", "0.5 W/W"),
    ],
    {"ambient": "ambient", "floor": "18 degC"},
)
CONSTANT = {"ambient": 25.0, "speed": 200.0, "load": 100.0}


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "machine.toml"
    path.write_text(MACHINE)
    return path


def exported(machine, path):
    """The model in a file, loaded as a program that has nothing else would."""
    export_machine(machine, path)
    if path.suffix != ".py":
        return PortableModel.load(path)
    spec = importlib.util.spec_from_file_location("exported", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.model()


def test_names_and_units(machine, tmp_path):
    header = exported(machine, tmp_path / "m.json").header
    assert {item["name"]: item["unit"] for item in header["inputs"]} == {
        "ambient": "degC",
        "speed": "rad/s",
        "load": "W",
    }
    assert [(item["name"], item["unit"]) for item in header["outputs"]] == [
        (name, "degC") for name in ("bearing", "shaft", "housing")
    ]


def test_settles_where_heat_is_in_balance(machine, tmp_path):
    model = exported(machine, tmp_path / "m.npz")
    model.settle(CONSTANT)
    bearing, shaft, housing = model.read(CONSTANT)
    heat = 80.0 * (200.0 / (1000.0 * 2.0 * np.pi / 60.0)) ** 1.5 + 50.0
    assert 4.0 * (housing - 25.0) + (shaft - 18.0) == pytest.approx(heat, rel=1e-9)
    assert 3.0 * (bearing - shaft) == pytest.approx(shaft - 18.0, rel=1e-9)


@pytest.mark.parametrize("suffix", [".json", ".py"])
def test_files_step_alike(machine, tmp_path, suffix):
    one, other = exported(machine, tmp_path / "m.npz"), exported(machine, tmp_path / f"m{suffix}")
    for model in (one, other):
        model.start(30.0)
        model.step(45.0, CONSTANT, {**CONSTANT, "speed": 100.0})
    np.testing.assert_allclose(one.read(CONSTANT), other.read(CONSTANT), rtol=0.0, atol=1e-12)


def test_steps_are_exact_whatever_their_length(machine, tmp_path):
    model = exported(machine, tmp_path / "m.npz")
    model.start(20.0)
    model.step(600.0, CONSTANT)
    whole = model.read(CONSTANT)
    model.start(20.0)
    for _ in range(240):
        model.step(2.5, CONSTANT)
    np.testing.assert_allclose(model.read(CONSTANT), whole, rtol=0.0, atol=1e-10)


def test_inputs_beyond_the_range_or_without_number_are_named(machine, tmp_path):
    model = exported(machine, tmp_path / "m.npz")
    assert model.step(1.0, {**CONSTANT, "speed": -200.0}) == []
    assert model.step(1.0, {**CONSTANT, "load": np.nan}) == ["load"]
    assert np.all(np.isfinite(model.state))
    with pytest.raises(KeyError, match="spedd"):
        model.step(1.0, {"spedd": 1.0})


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_c_steps_as_python_does(machine, tmp_path):
    model = exported(machine, tmp_path / "m.npz")
    export_machine(machine, tmp_path / "m.c")
    (tmp_path / "main.c").write_text(
        """
        #include <math.h>
        #include <stdio.h>
        #include "m.h"
        int main(void) {
            static spindle_2_model model;
            double first[] = {25.0, -200.0, 100.0}, last[] = {20.0, 100.0, 50.0};
            double bad[] = {25.0, 1.0, NAN}, y[3];
            if (spindle_2_step(&model, 0.0, bad, 0) != 4) return 1;
            spindle_2_start(&model, 30.0);
            spindle_2_step(&model, 145.0, first, last);
            spindle_2_step(&model, 0.001, last, 0);
            spindle_2_read(&model, last, y);
            printf("[%.17g, %.17g, %.17g]", y[0], y[1], y[2]);
            return 0;
        }"""
    )
    build = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "main.c", "m.c", "-lm", "-o", "m"]
    subprocess.run(build, cwd=tmp_path, check=True)
    answer = subprocess.run([tmp_path / "m"], capture_output=True, text=True, check=True)
    model.start(30.0)
    last = [20.0, 100.0, 50.0]
    model.step(145.0, [25.0, 200.0, 100.0], last)
    model.step(0.001, last)
    np.testing.assert_allclose(json.loads(answer.stdout), model.read(last), rtol=0.0, atol=1e-9)


def largest_difference(name, recording, model, most_steps):
    """Largest difference from what simulate marches on a recording's inputs, K."""
    spec = load_network_machine(name)
    predictor = Predictor(fast_network(build_network(spec.network), spec), [recording], at_stamps=True)
    drive, start, told = predictor.drives[0], predictor.start(0), predictor.predict(0, {})
    offsets = [ZERO_CELSIUS_K if item["unit"] == "degC" else 0.0 for item in model.header["inputs"]]
    columns = [drive.column(name) for name in model.inputs]
    begin, end = drive.start[:, columns] - offsets, drive.end[:, columns] - offsets
    given = dict(zip(start.points.tolist(), start.states - ZERO_CELSIUS_K, strict=True))
    worst = 0.0
    for step in range(min(len(drive.steps), most_steps)):
        if step in given:
            model.start(dict(zip(model.outputs, given[step], strict=True)), begin[step])
        model.step(drive.steps[step], begin[step], end[step])
        if step + 1 not in given:
            found = model.read(end[step]) + ZERO_CELSIUS_K - told.states[step + 1]
            worst = max(worst, np.abs(found).max())
    return worst


@pytest.mark.parametrize(
    ("name", "recording"), [("bench_motor", "bench_motor/test_1.toml"), ("turning_centre", "turning_centre")]
)
@pytest.mark.skipif(not FOLDER.is_dir(), reason="no recordings")
def test_agrees_with_simulate_on_recordings(name, recording, tmp_path):
    model = exported(name, tmp_path / "m.npz")
    assert largest_difference(name, read_recording(FOLDER / recording), model, 2000) < AGREEMENT


def test_starts_as_simulate_does_where_nodes_are_not_read(tmp_path, machine):
    model = exported(machine, tmp_path / "m.npz")
    model.start({"bearing": 40.0, "housing": 30.0}, {**CONSTANT, "speed": 0.0})
    bearing, shaft, housing = model.read(CONSTANT)
    assert (bearing, housing) == pytest.approx((40.0, 30.0))
    # Its own balance: 3 W/K to the bearing, 1 W/K to the floor.
    assert shaft == pytest.approx((3.0 * 40.0 + 18.0) / 4.0)


def test_refuses_other_kinds_of_file_and_effects(machine, tmp_path):
    with pytest.raises(BadInputError, match="xls"):
        export_machine(machine, tmp_path / "m.xls")
    path = tmp_path / "with_effect.toml"
    entry = '[[effect]]\neffect = "sensor_lag"\ncomponent = "housing"\n'
    path.write_text(MACHINE + entry + 'parameters = {time_constant = "60 s"}\n')
    with pytest.raises(BadInputError, match=r"sensor_lag @ housing .*read before"):
        export_machine(path, tmp_path / "m.npz")
    assert not (tmp_path / "m.npz").exists()


def test_leaves_a_c_file_and_its_header_alone_in_a_new_folder(machine, tmp_path):
    content = export_machine(machine, tmp_path / "new" / "m.c")
    assert content["files"] == [str(tmp_path / "new" / name) for name in ("m.c", "m.h")]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["m.c", "m.h"]
