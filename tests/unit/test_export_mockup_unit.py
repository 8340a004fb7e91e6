"""An exported functional mock-up unit is valid and steps as the model itself; it needs PythonFMU3."""

import sys
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.commands.export_command import export_machine
from spindle_fem.errors import BadInputError
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.studies.export.exported_files import file_writer
from spindle_fem.studies.export.geometry_export import geometry_state_space
from spindle_fem.studies.export.portable_model import PortableModel
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.lumped_spindle import RPM
from tests.support.stepped_model import resolved_run

PUMP = Path(__file__).parents[2] / "examples" / "pump.toml"


def test_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pythonfmu3", None)
    with pytest.raises(BadInputError, match="spindle-fem\\[fmu\\]"):
        export_machine(PUMP, tmp_path / "pump.fmu")


def test_steps_as_the_model_does(tmp_path):
    pytest.importorskip("pythonfmu3")
    fmpy = pytest.importorskip("fmpy")
    export_machine(PUMP, tmp_path / "pump.fmu")
    export_machine(PUMP, tmp_path / "pump.npz")
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(tmp_path / "pump.fmu")) == []
    description = fmpy.read_model_description(str(tmp_path / "pump.fmu"))
    units = {item.name: item.unit for item in description.modelVariables}
    assert (units["power"], units["ambient"], units["casing"]) == ("W", "degC", "degC")
    times = np.arange(0.0, 601.0, 20.0)
    power = np.where(times < 300.0, 80.0, 20.0)
    told = fmpy.simulate_fmu(
        str(tmp_path / "pump.fmu"),
        stop_time=600.0,
        output_interval=20.0,
        start_values={"initial_temperature": 25.0, "ambient": 22.0},
        input=np.array(list(zip(times, power, strict=True)), dtype=[("time", float), ("power", float)]),
        output=["motor", "casing", "outside_range"],
    )
    model = PortableModel.load(tmp_path / "pump.npz")
    model.start(25.0)
    for row, value in zip(told[1:], power[:-1], strict=True):
        model.step(20.0, {"power": value, "ambient": 22.0})
        found = dict(zip(model.outputs, model.read({"power": value, "ambient": 22.0}), strict=True))
        assert (row["motor"], row["casing"]) == pytest.approx((found["motor"], found["casing"]), abs=1e-9)
    assert not told["outside_range"].any()


def test_a_spindle_agrees_with_simulate_at_steps_of_a_minute(fast, tmp_path):
    pytest.importorskip("pythonfmu3")
    fmpy = pytest.importorskip("fmpy")
    path = tmp_path / "spindle.fmu"
    file_writer(path)(geometry_state_space(fast, "lumped", 4500.0 * RPM), path)
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(path)) == []
    times = np.arange(0.0, 3601.0, 60.0)
    speed = RPM * np.select([times < 900.0, times < 1800.0, times < 2400.0], [3000.0, 0.0, 4500.0], 1000.0)
    room = np.where(times < 1500.0, 22.0, 25.0)
    # what reaches the readings at once, coolant that is, stays as it is
    columns = [speed, 1750.0, room + ZERO_CELSIUS_K, 290.15, 20e-3 / 60.0]
    values = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])
    drive = make_drive(times, STANDARD, values, np.ones(len(STANDARD), dtype=bool))
    told = resolved_run(fast, drive, 22.0 + ZERO_CELSIUS_K).temperature - ZERO_CELSIUS_K
    given = [("time", float), ("speed", float), ("ambient", float)]
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=3600.0,
        output_interval=60.0,
        start_values={
            "initial_temperature": 22.0,
            "thrust": 1750.0,
            "coolant_inlet": 17.0,
            "coolant_flow": 20e-3 / 60.0,
        },
        input=np.array(list(zip(times, speed, room, strict=True)), dtype=given),
        output=[*fast.channels, "outside_range"],
    )
    assert not found["outside_range"].any()
    read = np.column_stack([found[name] for name in fast.channels])
    assert np.ptp(read, axis=0).min() > 0.1
    assert np.abs(read[1:] - told[1:]).max() < 1e-3
