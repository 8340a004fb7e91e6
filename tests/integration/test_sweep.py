"""Studies with real solves: the same rows however they are run, stopped or resumed."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from spindle_fem.commands.sweep_command import sweep_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, FaultsError
from spindle_fem.report.sweep_report import rebuild_sweep_report
from spindle_fem.results.output_folder import MARKER, is_complete
from spindle_fem.results.run_summary import build_summary
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.sweep import run_tasks as runner
from spindle_fem.studies.sweep.evaluate_design import FILM_HIGH, FILM_LOW
from spindle_fem.studies.sweep.outputs import derived_values, output_paths, value_of
from spindle_fem.studies.sweep.results_table import RESULTS, read_results

MACHINE = "small_two_start"
QUICK = ("mesh.preset=coarse", "mesh.order=1", "heat.model=table")
GRID = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "channel.depth"
values = ["5 mm", "6 mm", "60 mm"]
[[parameter]]
path = "coolant.inlet_temperature"
low = "15 degC"
high = "25 degC"
number = 2
[study]
mesh = "new"
outputs = ["temperature.max_degC", "bearings.B1.ring_difference_K", "coolant.regime"]
[[constraint]]
output = "coolant.pressure_drop_Pa"
max = "1 bar"
[[objective]]
output = "temperature.max_degC"
"""
SEARCH = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.flow"
low = "4 L/min"
high = "12 L/min"
[[parameter]]
path = "coolant.inlet_temperature"
low = "15 degC"
high = "25 degC"
[study]
design = "sobol"
size = 2
outputs = ["temperature.max_degC", "coolant.pumping_power_W"]
film_uncertainty = true
[[objective]]
output = "temperature.max_degC"
[search]
trials = 2
batch = 1
[[reference]]
name = "present"
values = {"coolant.flow" = "6 L/min", "coolant.inlet_temperature" = "20 degC"}
"""


def study_file(folder, text):
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    """The grid study, solved in this process: its file, its folder, its summary."""
    place = tmp_path_factory.mktemp("grid")
    path = study_file(place, GRID)
    return path, place / "out", sweep_machine(MACHINE, path, place / "out", QUICK)


def test_every_design_is_a_row(grid):
    _, folder, summary = grid
    rows = read_results(folder)
    assert [row["design"] for row in rows] == [1, 2, 3, 4, 5, 6]
    assert [row["channel.depth"] for row in rows] == [0.005, 0.005, 0.006, 0.006, 0.06, 0.06]
    assert [row["coolant.inlet_temperature"] for row in rows] == [15.0, 25.0] * 3
    assert [row["status"] for row in rows] == ["ok"] * 4 + ["impossible"] * 2
    assert "breaks through" in rows[4]["reason"]
    assert rows[4]["temperature.max_degC"] is None
    assert (summary["ok"], summary["impossible"], summary["geometries"]) == (4, 2, 2)
    assert rows[0]["temperature.max_degC"] < rows[1]["temperature.max_degC"]


def test_a_row_is_what_a_run_of_that_machine_gives(grid):
    _, folder, _ = grid
    row = read_results(folder)[2]
    spec = load_machine(MACHINE, [*QUICK, "channel.depth=6 mm", "coolant.inlet_temperature=15 degC"])
    run = build_summary(solve_prepared(prepare_machine(spec)), 0.0, 0.0)
    assert row["temperature.max_degC"] == pytest.approx(run["temperature"]["max_degC"], abs=1e-6)
    assert row["bearings.B1.ring_difference_K"] == pytest.approx(
        run["bearings"]["B1"]["ring_difference_K"], abs=1e-6
    )
    assert row["coolant.regime"] == run["coolant"]["regime"]
    run["derived"] = derived_values(run, spec)
    for path in output_paths(spec):  # all that a study may name is there
        assert value_of(run, path) is not None


def test_limits_and_optimum(grid):
    _, folder, summary = grid
    rows = read_results(folder)
    broken = [row for row in rows if row["feasible"] == "no"]
    assert broken
    assert all(
        row["coolant.pressure_drop_Pa"] > 1e5 and "at most 100000 Pa" in row["reason"] for row in broken
    )
    feasible = [row for row in rows if row["feasible"] == "yes"]
    best = min(feasible, key=lambda row: row["temperature.max_degC"])
    assert summary["optimum"]["best"]["design"] == best["design"]


def test_the_folder_is_complete_and_the_report_stands_alone(grid):
    _, folder, _ = grid
    assert is_complete(folder)
    html = (folder / "report.html").read_text()
    assert "breaks through" in html
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")
    assert rebuild_sweep_report(folder).read_text() == html
    pictures = {path.stem for path in (folder / "figures").glob("*.png")}
    assert "responses" in pictures
    # The paper's choice of its channel is no question of another machine.
    assert not pictures & {"film_maps", "pump_maps"}


@pytest.mark.usefixtures("unpictured")
def test_processes_give_the_same_file(grid, tmp_path):
    path, folder, _ = grid
    sweep_machine(MACHINE, path, tmp_path / "out", QUICK, jobs=2)
    assert (tmp_path / "out" / RESULTS).read_bytes() == (folder / RESULTS).read_bytes()


@pytest.mark.usefixtures("unpictured")
def test_nothing_runs_twice(grid, tmp_path, monkeypatch):
    """A study that was stopped in the middle of a line solves the rest only."""
    path, folder, _ = grid
    whole = (folder / RESULTS).read_bytes()
    place = tmp_path / "out"
    place.mkdir()
    lines = whole.splitlines(keepends=True)
    (place / RESULTS).write_bytes(b"".join(lines[:4]) + lines[4][:30])
    (place / MARKER).write_text("killed")
    solved = []
    evaluate = runner.evaluate_tasks

    def counted(tasks, question):
        solved.extend(task.design.number for task in tasks)
        return evaluate(tasks, question)

    monkeypatch.setattr(runner, "evaluate_tasks", counted)
    summary = sweep_machine(MACHINE, path, place, QUICK)
    assert sorted(solved) == [4, 5, 6]
    assert summary["reused_rows"] == 3
    assert (place / RESULTS).read_bytes() == whole


@pytest.mark.usefixtures("unpictured")
def test_killed_in_the_middle_and_run_again(grid, tmp_path):
    path, folder, _ = grid
    place = tmp_path / "out"
    code = (
        "import sys; from spindle_fem.commands.sweep_command import sweep_machine; "
        "sweep_machine(sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, MACHINE, str(path), str(place), *QUICK],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    table = place / RESULTS
    while process.poll() is None and not (table.exists() and b",ok," in table.read_bytes()):
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert (place / MARKER).exists()
    kept = table.read_bytes().count(b",ok,")
    assert 1 <= kept < 4
    summary = sweep_machine(MACHINE, path, place, QUICK)
    assert summary["reused_rows"] >= kept
    assert table.read_bytes() == (folder / RESULTS).read_bytes()


def test_another_study_in_the_folder_is_refused_and_harms_nothing(grid, tmp_path):
    _, folder, _ = grid
    other = study_file(tmp_path, GRID.replace('"coolant.regime"', '"coolant.reynolds"'))
    before = (folder / RESULTS).read_bytes()
    with pytest.raises(BadInputError, match="another study"):
        sweep_machine(MACHINE, other, folder, QUICK)
    assert (folder / RESULTS).read_bytes() == before
    assert is_complete(folder)


def test_a_bad_study_writes_nothing(tmp_path):
    path = study_file(tmp_path, GRID.replace("channel.depth", "channel.depht"))
    with pytest.raises(FaultsError):
        sweep_machine(MACHINE, path, tmp_path / "out", QUICK)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("unpictured")
def test_a_design_that_fails_is_a_row_with_its_reason(tmp_path):
    text = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.inlet_temperature"
values = ["20 degC", "2000 degC"]
[study]
outputs = ["temperature.max_degC"]
"""
    sweep_machine(MACHINE, study_file(tmp_path, text), tmp_path / "out", QUICK)
    rows = read_results(tmp_path / "out")
    assert [row["status"] for row in rows] == ["ok", "failed"]
    assert rows[1]["reason"]


@pytest.mark.usefixtures("unpictured")
@pytest.mark.slow
def test_search_repeats_itself_and_carries_the_band(tmp_path):
    path = study_file(tmp_path, SEARCH)
    summary = sweep_machine(MACHINE, path, tmp_path / "one", QUICK)
    rows = read_results(tmp_path / "one")
    assert len(rows) == 2 + 1 + 2
    for row in rows:
        assert row["temperature.max_degC" + FILM_HIGH] <= row["temperature.max_degC"] + 1e-6
        assert row["temperature.max_degC"] <= row["temperature.max_degC" + FILM_LOW] + 1e-6
        assert 4 / 6e4 <= row["coolant.flow"] <= 12 / 6e4
    assert summary["references"]["present"]["parameters"]["coolant.flow"] == pytest.approx(1e-4)
    whole = (tmp_path / "one" / RESULTS).read_bytes()
    # Stopped after the first of the trials: the search proposes the same ones again.
    place = tmp_path / "two"
    place.mkdir()
    (place / RESULTS).write_bytes(b"".join(whole.splitlines(keepends=True)[:5]))
    (place / MARKER).write_text("killed")
    assert sweep_machine(MACHINE, path, place, QUICK)["reused_rows"] == 4
    assert (place / RESULTS).read_bytes() == whole
    assert json.loads((place / "sweep.json").read_text())["optimum"] == summary["optimum"]
