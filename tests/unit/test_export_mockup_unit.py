"""An exported functional mock-up unit is valid and steps as the model itself; it needs PythonFMU3."""

import sys
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.commands.export_command import export_machine
from spindle_fem.errors import BadInputError
from spindle_fem.studies.export.portable_model import PortableModel

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
