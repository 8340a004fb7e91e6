"""Heat of a network within gaps of its recording, which nobody recorded."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.continued_run import _drive_of
from spindle_fem.inference.drive_steps import even_drive
from spindle_fem.inference.gap_misdescriptions import autocovariance, bridge_modes, gap_misdescriptions
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.recording_gaps import with_changes_amid
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.recording_window import piece_of

MACHINE = """
schema = "spindle-fem/machine/1"
name = "rig"
[[network.node]]
name = "plate"
capacity = {value = "900 J/K", sigma_rel = 0.5}
[[network.boundary]]
name = "room"
temperature = "20 degC"
[[network.link]]
between = ["plate", "room"]
conductance = {value = "2 W/K", sigma_rel = 0.5}
[[network.source]]
node = "plate"
input = "load"
gain = {value = "1 W/W", sigma_rel = 0.1}
"""
RECORDING = """
schema = "spindle-fem/recording/1"
name = "run"
data = "run.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "plate"
role = "temperature"
probe = "plate"
unit = "degC"
sigma = 0.02
[[channel]]
column = "load"
role = "input"
drives = "load"
hold = "previous"
unit = "W"
"""
STEP, GAP = 10.0, (3010.0, 3400.0)


def run_with_gap(folder, plate=None, *, held=True, load_every=1, jitter=0.0):
    """A load that switches now and then; the stamps within a gap are missing, and of the load most."""
    times = np.arange(0.0, 9000.0, STEP)
    times[1:-1] += np.random.default_rng(5).uniform(0.0, jitter, len(times) - 2).round(4)
    on = np.random.default_rng(3).exponential(200.0, 400).cumsum()
    load = 100.0 * (np.searchsorted(on, times) % 2)
    table = pd.DataFrame({"time_s": times, "plate": 20.0 if plate is None else plate, "load": load})
    table.loc[np.arange(len(times)) % load_every > 0, "load"] = np.nan
    if held:
        table = table[(times <= GAP[0]) | (times >= GAP[1])]
    table.to_csv(folder / "run.csv", index=False)
    (folder / "run.toml").write_text(RECORDING)
    return read_recording(folder / "run.toml"), load


def network():
    spec = validate_network_machine(tomllib.loads(MACHINE), "rig")
    return fast_network(build_network(spec.network), spec)


@pytest.mark.parametrize("correlated", [4.0, 40.0])
def test_modes_of_a_bridge_hold_what_is_known_of_a_process_between_its_ends(correlated):
    end, at = 30, np.arange(1, 30)
    modes = bridge_modes(np.exp(-np.arange(31) / correlated), at, end)
    variance = sum(size**2 * shape**2 for size, shape in modes)
    exact = 2.0 * np.sinh(at / correlated) * np.sinh((end - at) / correlated) / np.sinh(end / correlated)
    assert np.all(variance <= exact + 1e-9)
    assert variance.sum() > 0.7 * exact.sum()
    assert all(np.abs(shape).max() == pytest.approx(1.0) for _, shape in modes)


def test_an_autocovariance_is_told_by_the_pairs_that_are_known():
    values = np.random.default_rng(0).normal(size=400)
    known = np.ones(400, dtype=bool)
    known[100:130] = False
    values[~known] = 0.0
    found = autocovariance(values, known, 5)
    for lag in range(5):
        pairs = known[lag:] & known[: 400 - lag]
        assert found[lag] == pytest.approx((values[lag:] * values[: 400 - lag])[pairs].mean())


def test_a_held_input_that_is_another_after_a_gap_changes_amid_it(tmp_path):
    recording, load = run_with_gap(tmp_path)
    before, after = load[int(GAP[0] / STEP)], load[int(GAP[1] / STEP)]
    assert before != after
    drive = even_drive(network(), recording)
    middle = 0.5 * (drive.grid[1:] + drive.grid[:-1])
    heat = drive.start[:, drive.names.index("load")]
    amid = 0.5 * (GAP[0] + GAP[1])
    assert set(heat[(middle > GAP[0]) & (middle < amid)]) == {before}
    assert set(heat[(middle > amid) & (middle < GAP[1])]) == {after}
    assert heat.min() == 0.0


def test_a_held_input_changes_amid_a_gap_of_jittering_stamps_too(tmp_path):
    recording, _ = run_with_gap(tmp_path, jitter=0.5)
    row = int(np.argmax(np.diff(recording.times)))
    before, after = recording.inputs[row : row + 2, 0]
    assert before != after
    drive = even_drive(network(), recording)
    heat = drive.start[:, drive.names.index("load")]
    energy = np.concatenate(([0.0], np.cumsum(heat * drive.steps)))
    first, last = recording.times[row : row + 2]
    amid = 0.5 * (first + last)
    parts = np.diff(np.interp([first, amid, last], drive.grid, energy))
    np.testing.assert_allclose(parts, 0.5 * (last - first) * np.array([before, after]), atol=100.0 * STEP)
    assert heat.min() > -1e-9
    assert heat.max() < 100.0 + 1e-9


def test_what_a_source_did_within_a_gap_is_within_what_is_open(tmp_path):
    (tmp_path / "whole").mkdir()
    whole, _ = run_with_gap(tmp_path / "whole", held=False)
    truth = Predictor(network(), [whole], at_stamps=True).predict(0, {}).temperature[:, 0]
    recording, _ = run_with_gap(tmp_path, truth - 273.15)
    predictor = Predictor(network(), [recording])
    directions = list(gap_misdescriptions(predictor))
    assert {item.name.split(".")[0] for item in directions} == {"gap"}
    open_to = with_misdescriptions(predictor, directions)
    names = [item.coordinate for item in directions]
    told = open_to.predict(0, {}, (), names)
    grid = predictor.drives[0].grid
    left = np.interp(grid, whole.times, truth) - told.temperature[:, 0]
    seen = (grid <= GAP[0]) | (grid >= GAP[1])
    columns = told.sensitivity[:, 0] * [item.sigma for item in directions]
    ridge = np.vstack((columns[seen], 0.02 * np.eye(len(names))))
    size = np.linalg.lstsq(ridge, np.append(left[seen], np.zeros(len(names))), rcond=None)[0]
    assert np.abs(left[seen]).max() > 0.5
    assert np.sqrt(np.mean((left - columns @ size)[seen] ** 2)) < 0.02
    assert np.all(np.abs(size) < 3.0)


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_a_watch_follows_a_gap_in_steps_of_its_rows(tmp_path, jitter):
    """As a diagnosis does: how heat varies from step to step is seen from its rows."""
    recording, _ = run_with_gap(tmp_path, jitter=jitter)
    piece = piece_of(recording, 200, 320)
    steps = _drive_of(network(), piece).steps
    assert len(steps) > len(piece.times) + 30
    np.testing.assert_allclose(steps, STEP, atol=1.1 * jitter + 1e-9)


def test_heat_within_a_gap_comes_at_its_time_on_other_steps_too(tmp_path):
    recording, _ = run_with_gap(tmp_path)
    predictor = Predictor(network(), [recording])
    heat = next(gap_misdescriptions(predictor)).change
    grids, energies = [], []
    for own in (predictor, Predictor(network(), [recording], at_stamps=True)):
        base = BaseRun(own, 0, {})
        grids.append(base.drive.grid)
        energies.append(np.append(0.0, np.cumsum(heat(base).start[:, 0] * base.drive.steps)))
    assert len(grids[0]) != len(grids[1])
    assert np.abs(energies[1]).max() > 100.0
    np.testing.assert_allclose(energies[1], np.interp(grids[1], grids[0], energies[0]), atol=1e-9)


def test_nothing_is_open_without_gaps_or_where_inputs_are_not_held(tmp_path):
    whole, _ = run_with_gap(tmp_path, held=False)
    assert not list(gap_misdescriptions(Predictor(network(), [whole])))


def test_an_input_read_rarely_changes_amid_its_readings_and_when_is_open(tmp_path):
    every = 9
    (tmp_path / "whole").mkdir()
    whole, load = run_with_gap(tmp_path / "whole", held=False)
    truth = Predictor(network(), [whole], at_stamps=True).predict(0, {}).temperature[:, 0]
    rare, _ = run_with_gap(tmp_path, truth - 273.15, held=False, load_every=every)
    recording = with_changes_amid(rare)
    read = load[::every]
    at = np.flatnonzero(np.diff(read))
    assert recording.unseen_changes == tuple(
        ("load", STEP * every * i, STEP * every * (i + 1)) for i in at.tolist()
    )
    inside = recording.inputs[every * at[0] : every * (at[0] + 1) + 1, 0].tolist()
    assert inside == [*[read[at[0]]] * 5, *[read[at[0] + 1]] * 5]

    predictor = Predictor(network(), [recording])
    directions = list(gap_misdescriptions(predictor))
    assert {item.name.split(".")[0] for item in directions} == {"change"}
    np.testing.assert_allclose([item.sigma for item in directions], 100.0 / np.sqrt(12.0))
    names = [item.coordinate for item in directions]
    told = with_misdescriptions(predictor, directions).predict(0, {}, (), names)
    left = np.interp(predictor.drives[0].grid, whole.times, truth) - told.temperature[:, 0]
    columns = told.sensitivity[:, 0] * [item.sigma for item in directions]
    size = np.linalg.lstsq(np.vstack((columns, 0.1 * np.eye(len(names)))), np.pad(left, (0, len(names))))[0]
    assert np.sqrt(np.mean((left - columns @ size) ** 2)) < 0.35 * np.sqrt(np.mean(left**2))
    assert np.all(np.abs(size) < 2.0)


def test_an_input_read_with_the_temperatures_stays_as_it_is(tmp_path):
    whole, _ = run_with_gap(tmp_path)
    assert with_changes_amid(whole) is whole
