"""A lumped spindle whose nose a displacement sensor sees, and what is recorded of it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd

from spindle_fem.definition.displacement_tables import DisplacementSensor
from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from tests.support.lumped_spindle import lumped_model

MANIFEST = """schema = "spindle-fem/recording/1"
name = "nose"
data = "nose.csv"
time = {column = "t", unit = "s"}
"""
RUN = np.arange(0.0, 10800.0, 60.0)
# µm/K of shaft and housing in the sensor's reading, as a nose that both carry.
BY_SHAFT, BY_HOUSING = 3.0, -1.2


def nose_machine():
    """The lumped spindle with a displacement sensor."""
    spec = load_machine("recorded_spindle")
    sensor = DisplacementSensor.model_validate(
        {"name": "S1", "at": "shaft.nose_end", "direction": "axial", "mount": "flange"}
    )
    spec = spec.model_copy(update={"displacement_sensor": (sensor,)})
    model = lumped_model(spec)
    places = dict(zip(model.place_names, model.places, strict=True))
    reading = BY_SHAFT * places["shaft"] + BY_HOUSING * places["housing"]
    return fast_spindle(
        replace(model, probe_names=(*model.probe_names, "S1"), probes=np.vstack([model.probes, reading])),
        spec,
    )


def nose_recording(folder, readings):
    columns = {"t": RUN, "speed": np.where((RUN > 900.0) & (RUN < 7200.0), 3000.0, 0.0), "ambient": 20.0}
    channels = [
        {"column": name, "role": role, "probe": name, "unit": unit, "sigma": 0.1}
        for name, role, unit in (
            ("SP01", "temperature", "degC"),
            ("SP05", "temperature", "degC"),
            ("S1", "displacement", "um"),
        )
    ] + [
        {"column": name, "role": "input", "hold": "previous", "drives": name, "unit": unit}
        for name, unit in (("speed", "rpm"), ("ambient", "degC"))
    ]
    text = MANIFEST
    for channel in channels:
        text += "[[channel]]\n" + "".join(f"{key} = {json.dumps(item)}\n" for key, item in channel.items())
    pd.DataFrame(columns | readings).to_csv(folder / "nose.csv", index=False)
    (folder / "recording.toml").write_text(text)
    return read_recording(folder)
