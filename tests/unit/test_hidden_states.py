"""What a linear answer to heat that switches reads, against the run that it is taken from."""

import numpy as np
import pandas as pd

from spindle_fem.definition.load import load_machine
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hidden_states import answer_of
from spindle_fem.inference.missing_heat import Pattern
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from tests.support.lumped_spindle import lumped_model

CHANNELS = (
    ("speed", "input", "drives", "speed", "rpm"),
    ("coolant_flow", "input", "drives", "coolant_flow", "l/min"),
    ("SP01", "temperature", "probe", "SP01", "degC"),
    ("out", "temperature", "probe", "COOLANT_OUT", "degC"),
)


def flow_that_jumps(folder):
    times = np.arange(0.0, 9000.0, 60.0)
    columns = {"t": times, "speed": 3000.0, "coolant_flow": np.where(times < 600.0, 1.5, 6.0)}
    text = 'schema = "spindle-fem/recording/1"\nname = "run"\ndata = "run.csv"\n'
    text += 'time = {column = "t", unit = "s"}\n'
    for column, role, key, value, unit in CHANNELS:
        text += f'[[channel]]\ncolumn = "{column}"\nrole = "{role}"\n{key} = "{value}"\nunit = "{unit}"\n'
        text += 'hold = "previous"\n' if role == "input" else "sigma = 0.1\n"
    pd.DataFrame(columns | {"SP01": 20.0, "out": 20.0}).to_csv(folder / "run.csv", index=False)
    (folder / "run.toml").write_text(text)
    return read_recording(folder / "run.toml")


def test_outlet_reads_heat_at_the_flow_of_every_step(tmp_path):
    spec = load_machine("recorded_spindle")
    fast = fast_spindle(lumped_model(spec), spec)
    base = BaseRun(Predictor(fast, [flow_that_jumps(tmp_path)]), 0, {}, ())
    pattern = Pattern("drive_end", ("housing",))
    answer = answer_of(base, pattern)
    heat = 100.0 * (base.drive.grid[:-1] >= 3600.0)
    load = (heat[:, None] * fast.model.place("housing"))[:, :, None]
    expected = base.march(load, load)[1:, :, 0]
    states = np.zeros((len(heat) + 1, fast.model.size))
    for step, watts in enumerate(heat):
        before = np.zeros(fast.model.size) if answer.begins[step] else states[step]
        states[step + 1] = answer.advance[answer.group[step]] @ before + watts * answer.entering[step]
    assert len(answer.outputs) == 2
    np.testing.assert_allclose(answer.read(states[1:]), expected, atol=1e-9)
    assert expected[-1, 1] > 0.05
