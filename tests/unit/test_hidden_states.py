"""What a linear answer to heat that switches reads, against the run that it is taken from."""

import numpy as np
import pandas as pd

from spindle_fem.definition.load import load_machine
from spindle_fem.inference import switching_loops
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.hidden_states import answer_of, readings_about
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.missing_heat import Pattern
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import expected_slow_error, known_before
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import MACHINE, record
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


def read_by(answer, heat):
    """Channels at the ends of the steps, (T, c) K, by an answer to heat (T,) W that switches."""
    level = (heat > 0.0).astype(np.int64)
    states, _ = switching_loops.states(
        answer.advance,
        answer.loss,
        answer.group,
        answer.entering,
        answer.begins,
        level,
        heat.max(keepdims=True),
    )
    return answer.read(states)


def test_outlet_reads_heat_at_the_flow_of_every_step(tmp_path):
    spec = load_machine("recorded_spindle")
    fast = fast_spindle(lumped_model(spec), spec)
    base = BaseRun(Predictor(fast, [flow_that_jumps(tmp_path)]), 0, {}, ())
    pattern = Pattern("drive_end", ("housing",))
    answer = answer_of(base, pattern)
    heat = 100.0 * (base.drive.grid[:-1] >= 3600.0)
    load = (heat[:, None] * fast.model.place("housing"))[:, :, None]
    expected = base.march(load, load)[1:, :, 0]
    assert len(answer.outputs) == 2
    np.testing.assert_allclose(read_by(answer, heat), expected, atol=1e-9)
    assert expected[-1, 1] > 0.05


def test_readings_at_which_a_run_starts_anew_tell_nothing_of_what_was_on_before_a_long_gap(tmp_path):
    (tmp_path / "drive.toml").write_text(MACHINE)
    times = np.concatenate((np.arange(0.0, 5000.0, 60.0), np.arange(9600.0, 14401.0, 60.0)))
    recording = read_recording(record(tmp_path / "run", 3, times=times))
    fast = open_machine(tmp_path / "drive.toml", (), [recording], []).fast
    predictor = Predictor(fast, [recording])
    base = BaseRun(predictor, 0, {}, ())
    assert base.drive.restarts
    answer = answer_of(base, Pattern("body", ("body",)))
    heat = np.where((base.drive.grid[:-1] > 3000.0) & (base.drive.grid[1:] < 5000.0), 100.0, 0.0)
    load = (heat[:, None] * fast.model.place("body"))[:, :, None]
    problem = Problem(
        predictor, known_before(predictor), expected_slow_error(predictor), predictor.observations
    )
    seen = np.isfinite(readings_about(problem, problem.fit(), 0).residual)
    assert seen.sum() > 0.9 * times.size * seen.shape[1]
    expected = base.march(load, load)[1:, :, 0]
    np.testing.assert_allclose(read_by(answer, heat)[seen], expected[seen], atol=1e-9)
