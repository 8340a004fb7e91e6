"""Sound inputs that cases spoil, made here: recordings, studies, bearing files, folders, a cache."""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w

from spindle_fem.cache import source_digest

from .child import Ended, Surroundings, run_command, run_process

ROOT = Path(__file__).parents[2]
# A machine with geometry that is quick to solve, and a network that shows every kind of its tables.
SPINDLE, PUMP = str(Path(__file__).with_name("spindle.toml")), ROOT / "examples" / "pump.toml"
COARSE = ("--set", "mesh.preset=coarse")
STEP_S, DURATION_S = 60.0, 7200.0
ORIGINALS, CACHE, SPENT, MADE_BY = "originals", "cache", "spent.json", "made_by.txt"
PATIENT = 600.0
# To build the fast model of the spindle takes at least this long, seconds of processor.
MODEL_SECONDS = 20.0
PUMP_CHANNELS = {"T1": "motor", "T2": "casing"}
SPINDLE_CHANNELS = {"F1": "F1_SEAT", "F2": "F2_SEAT", "M": "HOUSING_MIDDLE", "R": "REAR_SEAT"}
PUMP_INPUTS = {"room": ("ambient", "degC"), "P": ("power", "W")}
SPINDLE_INPUTS = {"room": ("ambient", "degC"), "n": ("speed", "rpm")}


def table_of(channels: Mapping[str, str], load: str, height: float) -> pd.DataFrame:
    """Readings that follow a load in steps, with noise: what a machine may have read."""
    times = np.arange(0.0, DURATION_S + 1.0, STEP_S)
    on = ((times >= 600.0) & (times < 3000.0)) | (times >= 4800.0)
    chance, columns = np.random.default_rng(2), {"t": times}
    for number, column in enumerate(channels, start=1):
        rise, lag = np.zeros(times.size), 1.0 - np.exp(-STEP_S / (400.0 * number))
        for i in range(1, times.size):
            rise[i] = rise[i - 1] + lag * (20.0 / number * on[i - 1] - rise[i - 1])
        columns[column] = np.round(20.0 + rise + chance.normal(0.0, 0.1, times.size), 3)
    columns["room"] = np.full(times.size, 20.0)
    columns[load] = np.where(on, height, 0.0)
    return pd.DataFrame(columns)


def manifest_of(
    channels: Mapping[str, str], inputs: Mapping[str, tuple[str, str]], data: str = "data.csv"
) -> dict[str, Any]:
    """Tables of the manifest of such readings."""
    read = [
        {"column": column, "role": "temperature", "probe": probe, "unit": "degC", "sigma": 0.1}
        for column, probe in channels.items()
    ]
    driven = [
        {"column": column, "role": "input", "drives": drives, "unit": unit, "hold": "previous"}
        for column, (drives, unit) in inputs.items()
    ]
    time = {"column": "t", "unit": "s"}
    return {
        "schema": "spindle-fem/recording/1",
        "name": "made",
        "data": data,
        "time": time,
        "channel": read + driven,
    }


def pump_recording() -> tuple[dict[str, Any], pd.DataFrame]:
    """Manifest and data that belong to the pump."""
    return manifest_of(PUMP_CHANNELS, PUMP_INPUTS), table_of(PUMP_CHANNELS, "P", 80.0)


def spindle_recording() -> tuple[dict[str, Any], pd.DataFrame]:
    """Manifest and data that belong to the spindle."""
    return manifest_of(SPINDLE_CHANNELS, SPINDLE_INPUTS), table_of(SPINDLE_CHANNELS, "n", 2500.0)


def write_recording(folder: Path, made: tuple[dict[str, Any], pd.DataFrame], name: str) -> Path:
    """Manifest ``NAME.toml`` beside its data."""
    manifest, frame = made
    frame.to_csv(folder / f"{name}.csv", index=False)
    file = folder / f"{name}.toml"
    file.write_text(tomli_w.dumps({**manifest, "data": f"{name}.csv"}), encoding="utf-8")
    return file


SWEEP = """
schema = "spindle-fem/study/1"
name = "thrust"
parameter = [{path = "operation.thrust", values = ["600 N", "800 N"]}]
study = {design = "grid", outputs = ["temperature.max_degC", "bearings.F2.heat_W"]}
constraint = [{output = "temperature.max_degC", max = "80 degC"}]
objective = [{output = "temperature.max_degC", direction = "minimize"}]
"""
TRANSIENT = """
schema = "spindle-fem/transient/1"
name = "minutes"
machine = "SPINDLE"
start = "ambient"
sample_every = "30 s"
fields_every = "30 s"
error = "1 K"
phase = [
    {name = "run", speed = "2500 rpm", thrust = "800 N", duration = "1 min"},
    {name = "stop", speed = "0 rpm", duration = "1 min"},
]
"""
BALL = """
[bearing]
ball_diameter = "11.906 mm"
ball_count = 19
pitch_diameter = "90 mm"
contact_angle = "15 deg"
groove_curvature_inner = 0.52
groove_curvature_outer = 0.52
young_modulus = "206 GPa"
poisson_ratio = 0.3
density = "7800 kg/m**3"
arrangement = "back_to_back"
preload = "400 N"
[operation]
speed = "3000 rpm"
axial_load = "800 N"
radial_load = "200 N"
moment = "1 N m"
temperature = "40 degC"
raceway_control = "outer"
[lubricant]
kinematic_viscosity_40 = "25 mm**2/s"
kinematic_viscosity_100 = "5.5 mm**2/s"
"""
ROLLER = """
[bearing]
kind = "cylindrical_roller"
roller_diameter = "11 mm"
roller_length = "11 mm"
roller_count = 24
pitch_diameter = "95 mm"
rows = 2
radial_clearance = "2 um"
[operation]
speed = "3000 rpm"
radial_load = "2 kN"
"""

# What those above have not: a groove that leans by its clearance, a cage that a ring guides, seals, fits and
# temperatures that change the clearance, types from the catalogue.
LUBRICANT = """
[lubricant]
kinematic_viscosity_40 = "22 mm**2/s"
kinematic_viscosity_100 = "5 mm**2/s"
"""
BEARINGS = {
    "deep_groove": """
[bearing]
catalogue = "6208"
radial_clearance = "10 um"
seal_moment = "0.03 N*m"
arrangement = "back_to_back"
preload = "150 N"
spacing = "60 mm"
[operation]
speed = "6000 rpm"
axial_load = "200 N"
radial_load = "300 N"
temperature = "45 degC"
[heat]
model = "skf"
"""
    + LUBRICANT,
    "caged": """
[bearing]
catalogue = "7014 C HC"
arrangement = [1, 1, -1]
preload = "300 N"
spacing = "40 mm"
seal_moment = "0.02 N*m"
[operation]
speed = "6000 rpm"
axial_load = "500 N"
radial_load = "800 N"
moment = "10 N*m"
[heat]
model = "full"
[cage]
land_diameter = "98 mm"
land_width = "4 mm"
clearance = "0.2 mm"
land = "outer"
[fit]
inner_interference = "5 um"
outer_clearance = "5 um"
housing_outer_diameter = "170 mm"
[temperatures]
assembly = "20 degC"
inner_ring = "45 degC"
outer_ring = "40 degC"
"""
    + LUBRICANT,
    "sealed_roller": """
[bearing]
catalogue = "NN3014 K"
radial_clearance = "-2 um"
seal_moment = "0.05 N*m"
[operation]
speed = "3000 rpm"
radial_load = "2000 N"
temperature = "45 degC"
[heat]
model = "skf"
"""
    + LUBRICANT,
}


def tables(text: str) -> dict[str, Any]:
    """Tables of one of the texts above."""
    return tomllib.loads(text.replace("SPINDLE", SPINDLE))


# A mesh as a file, by way of the cache.
MESH = ("mesh", SPINDLE, "-o", "out.msh")
# Finished folders, and the command that makes each.
FOLDERS = {
    "run": ("run", SPINDLE, "-o", "run", *COARSE),
    "simulate_spindle": ("simulate", SPINDLE, "spindle.toml", "-o", "simulate_spindle", *COARSE),
    "simulate": ("simulate", str(PUMP), "pump.toml", "-o", "simulate"),
    "diagnose": ("diagnose", str(PUMP), "pump.toml", "-o", "diagnose"),
    "sweep": ("sweep", SPINDLE, "sweep.toml", "-o", "sweep", *COARSE),
    "transient": ("transient", "transient.toml", "-o", "transient", *COARSE),
    "heat": ("heat", SPINDLE, "-o", "heat"),
}


def make_originals(place: Path) -> Path:
    """Folder with everything that cases start from; what is there already stays.

    Raises
    ------
    RuntimeError
        A command failed on sound input.
    """
    folder, made_by = place / ORIGINALS, source_digest("spindle_fem.cli")
    if folder.is_dir() and _noted(folder / MADE_BY) != made_by:
        # Meshes, models and results of other code are not those that commands give now.
        shutil.rmtree(folder)
        shutil.rmtree(place / CACHE, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MADE_BY).write_text(made_by, encoding="utf-8")
    write_recording(folder, pump_recording(), "pump")
    write_recording(folder, spindle_recording(), "spindle")
    for name, text in (("sweep", SWEEP), ("transient", TRANSIENT)):
        (folder / f"{name}.toml").write_text(tomli_w.dumps(tables(text)), encoding="utf-8")
    for name, arguments in FOLDERS.items():
        if (folder / name).is_dir() and not (folder / name / "INCOMPLETE").exists():
            continue
        _sound(run_process(arguments, folder, Surroundings(patience_s=PATIENT)))
    if not (folder / SPENT).is_file():
        _sound(run_process(MESH, folder))
        _measure(folder)
        # Cases spoil copies of the cache as it is now: definitions that are solved beside them add to it.
        shutil.copytree(place / CACHE, folder / CACHE, dirs_exist_ok=True)
    return folder


def _noted(file: Path) -> str:
    return file.read_text(encoding="utf-8") if file.is_file() else ""


def _sound(ended: Ended) -> Ended:
    if ended.status != 0:
        raise RuntimeError(f"a command failed on sound input: {ended.err}")
    return ended


def _measure(folder: Path) -> None:
    """Note what the commands of the kills take in a warm process."""
    spent = {}
    for kind, name in (
        ("run", "run"),
        ("sweep", "sweep"),
        ("transient", "transient"),
        ("diagnose", "diagnose"),
    ):
        command, *rest = FOLDERS[name]
        arguments = [command, *("measured" if item == name else item for item in rest)]
        spent[kind] = _sound(run_command(arguments, folder, Surroundings(patience_s=PATIENT))).seconds
        shutil.rmtree(folder / "measured")
    spent["report"] = _sound(run_command(["report", "run"], folder)).seconds
    empty = Surroundings({"SPINDLE_FEM_CACHE": str(folder / "measured")}, patience_s=PATIENT)
    spent["mesh cache"] = _sound(run_command(["mesh", SPINDLE, "-o", "m.msh"], folder, empty)).seconds
    shutil.rmtree(folder / "measured")
    # most of a simulation that builds its model is the building
    spent["model cache"] = MODEL_SECONDS
    (folder / SPENT).write_text(json.dumps(spent), encoding="utf-8")


def spent_on(originals: Path, kind: str) -> float:
    """Seconds of processor that a command of the kills takes."""
    return json.loads((originals / SPENT).read_text(encoding="utf-8"))[kind]
