"""Exports of spindles with oil, purge air, cutting fluid and a bore: as simulate has them."""

import numpy as np
import pandas as pd
import pytest
import tomli_w

from spindle_fem.definition.load import load_machine
from spindle_fem.recordings.align import read_recording
from tests.integration.test_circuits_in_models import BORED
from tests.integration.test_streams_in_models import PURGED
from tests.support.oiled_machine import OILED
from tests.support.stepped_model import needs_compiler, told_and_found

pytestmark = [pytest.mark.slow, needs_compiler]
# Largest difference from simulate, K.
AGREEMENT = 1e-3
COARSE = ("mesh.preset=coarse",)
STREAMS = OILED + PURGED.split('name = "purged"')[1]
UNITS = {"ambient": "degC", "speed": "rpm", "thrust": "N", "coolant_inlet": "degC", "coolant_flow": "L/min"}


def recorded(folder, probes, speed, flow, thrust):
    """A recording of two hours in which everything moves; what the probes read is of no matter."""
    times = np.arange(0.0, 7201.0, 60.0)
    columns = {
        "ambient": 21.0 + np.sin(times / 1500.0),
        "speed": np.select([times < 2400.0, times < 4200.0], [speed, 0.0], 0.6 * speed),
        "thrust": np.full(times.size, thrust),
        "coolant_inlet": 19.0 + np.cos(times / 900.0),
        "coolant_flow": flow * np.interp(times, [5000.0, 5600.0], [1.0, 0.8]),
    }
    read = {name: np.full(times.size, 22.0) for name in probes}
    pd.DataFrame({"t": times, **columns, **read}).to_csv(folder / "data.csv", index=False)
    channels = [
        {"column": name, "role": "temperature", "probe": name, "unit": "degC", "sigma": 0.1} for name in read
    ]
    hold = {"speed": "previous"}
    channels += [
        {
            "column": name,
            "role": "input",
            "drives": name,
            "unit": UNITS[name],
            "hold": hold.get(name, "linear"),
        }
        for name in columns
    ]
    head = {"schema": "spindle-fem/recording/1", "name": "made", "data": "data.csv"}
    manifest = {**head, "time": {"column": "t", "unit": "s"}, "channel": channels}
    (folder / "recording.toml").write_text(tomli_w.dumps(manifest), encoding="utf-8")
    return read_recording(folder / "recording.toml")


@pytest.mark.parametrize(
    ("text", "speed", "flow", "streams"),
    [(STREAMS, 12000.0, 3.0, {"OIL_OUT", "PURGE_OUT"}), (BORED, 3000.0, 20.0, {"BORE_OUT"})],
    ids=["oil_and_streams", "bore_beside_a_channel"],
)
def test_python_and_c_agree_with_simulate(text, speed, flow, streams, tmp_path):
    file = tmp_path / "machine.toml"
    file.write_text(text, encoding="utf-8")
    spec = load_machine(str(file), COARSE)
    recording = recorded(tmp_path, [probe.name for probe in spec.probe], speed, flow, spec.operation.thrust)
    told, found, in_c = told_and_found(tmp_path, str(file), COARSE, recording)
    # what is compared moves, the outlets too
    assert streams <= {probe.name for probe in spec.probe}
    assert np.ptp(found, axis=0).min() > 0.05
    assert np.abs(found - told).max() < AGREEMENT
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-7)
