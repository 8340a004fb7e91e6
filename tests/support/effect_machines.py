"""A lumped spindle and a small network, each with a recording, to try every effect on."""

import tomllib

import numpy as np
import pandas as pd

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import HeatSource
from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.model.lumped.network_view import view_of_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.align import read_recording
from tests.support.lumped_spindle import lumped_model
from tests.support.written_texts import network_text

PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05", "COOLANT_OUT")
SPINDLE_RECORDING = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "spindle.csv"
time = {column = "t", unit = "s"}
"""
CHANNEL = """
[[channel]]
column = "%s"
role = "temperature"
probe = "%s"
unit = "degC"
sigma = 0.1
"""
INPUT = """
[[channel]]
column = "%s"
role = "input"
hold = "%s"
drives = "%s"
unit = "%s"
"""
NETWORK = network_text(
    "small motor",
    {"winding": ("180 J/K", 0.5), "body": ("500 J/K", 0.5), "jacket": ("300 J/K", 0.5)},
    {
        "winding|body": ("2.3 W/K", 0.5),
        "body|ambient": ("0.5 W/K", 0.5),
        "body|jacket": ("1.5 W/K", 0.5),
        "jacket|coolant": ("0.8 W/K", 0.5),
        "body|coolant": ("0.4 W/K", 0.5),
    },
    [("winding", "power", ("0.8 W/W", 0.1)), ("body", "speed", ("15 W", 0.3), {"reference": "1000 rpm"})],
    boundaries={"ambient": "ambient", "coolant": "18 degC"},
)


def _spindle(folder):
    """Fast model, recording, view and drive of a lumped reference spindle."""
    time = np.arange(0.0, 7200.0, 60.0)
    speed = np.select([time < 300, time < 2700, time < 3600, time < 5400], [0.0, 3000.0, 0.0, 1500.0], 4000.0)
    columns = {"t": time, "speed": speed, "ambient": 20.0 + 0.5 * np.sin(time / 900.0)}
    columns["coolant_in"] = np.where(time < 4000.0, 15.0, 30.0)
    text = SPINDLE_RECORDING
    for probe in PROBES:
        columns[f"{probe}_degC"] = 22.0 + 8.0 * time / time[-1]
        text += CHANNEL % (f"{probe}_degC", probe)
    for column, hold, drives, unit in (
        ("speed", "previous", "speed", "rpm"),
        ("ambient", "linear", "ambient", "degC"),
        ("coolant_in", "linear", "coolant_inlet", "degC"),
    ):
        text += INPUT % (column, hold, drives, unit)
    recording = _written(folder, "spindle", columns, text)
    source = HeatSource.model_validate({"name": "motor", "part": "housing", "heat": "80 W"})
    spec = load_machine("recorded_spindle").model_copy(update={"source": (source,)})
    fast = fast_spindle(lumped_model(spec), spec)
    return fast, recording, view_of(fast.names, recording), drive_of_recording(spec, recording)


def _network(folder):
    """Fast model, recording, view and drive of a small network."""
    time = np.arange(0.0, 5000.0, 25.0)
    columns = {
        "t": time,
        "winding": 20.0 + 20.0 * time / 5000.0,
        "body": 20.0 + 10.0 * time / 5000.0,
        "ambient": 20.0 + np.sin(time / 900.0),
        "power": np.where(time < 2500.0, 120.0, 40.0),
        "speed": np.select([time < 500, time < 2500, time < 3000], [0.0, 1500.0, 0.0], 800.0),
    }
    text = SPINDLE_RECORDING.replace("spindle.csv", "network.csv")
    for probe in ("winding", "body"):
        text += CHANNEL % (probe, probe)
    for name, hold, unit in (
        ("ambient", "linear", "degC"),
        ("power", "previous", "W"),
        ("speed", "previous", "rpm"),
    ):
        text += INPUT % (name, hold, name, unit)
    recording = _written(folder, "network", columns, text)
    spec = validate_network_machine(tomllib.loads(NETWORK), "motor.toml")
    fast = fast_network(build_network(spec.network), spec)
    return fast, recording, view_of_network(fast.network, recording), fast.inputs.drive(recording)


def _written(folder, name, columns, text):
    pd.DataFrame(columns).to_csv(folder / f"{name}.csv", index=False)
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return read_recording(folder / f"{name}.toml")


INTERVALS = [(900.0, 1800.0), (2600.0, 3900.0)]
KINDS = ("geometry", "network")
POINT = OperatingPoint(260.0, 1500.0, 293.0, 295.0, 3.0e-4)
