"""An exported machine whose preload follows its temperatures: Python and C as simulate has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.export.export_machine import machine_state_space
from spindle_fem.studies.export.exported_files import file_writer
from spindle_fem.studies.simulate import simulate_recordings
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.growing_spindle import MANIFEST, OVERRIDES, SENSORS
from tests.support.stepped_model import c_readings_along, needs_compiler, readings_along

pytestmark = [pytest.mark.slow, needs_compiler]
TIMES = np.arange(0.0, 3601.0, 60.0)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A machine with displacement sensors, a recording of its inputs, and its state space."""
    place: Path = tmp_path_factory.mktemp("exported")
    machine = place / "machine.toml"
    machine.write_text(write_machine(load_machine("wu_tan_2016", OVERRIDES)) + SENSORS)
    frame = pd.DataFrame({"time": TIMES, "n": np.where(TIMES < 1800.0, 3000.0, 1000.0)})
    for name in ("SP01", "SP05", "S1", "S2"):
        frame[name] = 20.0
    frame.to_csv(place / "made.csv", index=False)
    (place / "recording.toml").write_text(MANIFEST)
    recording = read_recording(place)
    return machine, recording, machine_state_space(machine, (), [recording])


def test_python_and_c_agree_with_simulate(exported, tmp_path):
    machine, recording, space = exported
    told = simulate_recordings(machine, recording)
    model = space.model()
    drive = drive_of_recording(load_machine(machine), recording)
    start = drive.first("ambient") - ZERO_CELSIUS_K
    rows = np.searchsorted(drive.grid, drive.times[1:] - 1e-7) - 1
    found = readings_along(model, drive, {0: start})[rows]
    probes = [model.outputs.index(name) for name in recording.probes]
    assert np.abs(found[:, probes] + ZERO_CELSIUS_K - told.predicted[1:]).max() < 1e-3
    grown = found[:, [model.outputs.index(name) for name in recording.displacement_sensors]]
    # a displacement counts from its first reading
    moved = 1e6 * (told.displacements[1:] - told.displacements[1])
    np.testing.assert_allclose(grown - grown[0], moved, atol=5e-3)
    assert np.ptp(moved, axis=0).min() > 2.0
    file_writer(tmp_path / "model.c")(space, tmp_path / "model.c")
    in_c = c_readings_along(tmp_path, "wu_tan_2016", model, drive, start)[rows]
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-6)


def test_bearings_far_from_what_was_solved_are_told(exported):
    _, _, space = exported
    model = space.model()
    model.start(17.6)
    assert "preload" not in model.step(60.0, {"speed": 300.0})
    model.start(dict.fromkeys(model.outputs[:4], 60.0))
    assert "preload" in model.step(60.0, {"speed": 300.0})
