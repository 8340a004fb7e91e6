"""``simulate`` on a machine without drawings."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.console import print_simulation
from spindle_fem.commands.report_command import rebuild
from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.errors import BadInputError, RecordingError
from tests.support.written_texts import network_text

MACHINE = network_text(
    "two lumps",
    {"winding": ("300 J/K", 0.4), "body": ("900 J/K", 0.4)},
    {"winding|body": ("2 W/K", 0.5), "body|ambient": ("1 W/K", 0.5)},
    [("winding", "power", "1 W/W")],
)

TEMPERATURES, INPUTS = {"W": "winding", "B": "body"}, {"P": "power", "room": "ambient"}
# winding and body [J/K], between them and to the room [W/K]
TRUE = (400.0, 700.0, 1.5, 1.4)


def made(seed: int, power) -> pd.DataFrame:
    """Readings of the true machine: explicit Euler with steps far below its time constants."""
    times = np.arange(0.0, 6000.0, 20.0)
    state, rows = np.array([20.0, 20.0]), []
    for time in times:
        rows.append(state.copy())
        for _ in range(200):
            between = TRUE[2] * (state[0] - state[1])
            out = TRUE[3] * (state[1] - 20.0)
            state = state + 0.1 * np.array([(power(time) - between) / TRUE[0], (between - out) / TRUE[1]])
    read = np.array(rows) + np.random.default_rng(seed).normal(0.0, 0.1, (times.size, 2))
    frame = pd.DataFrame({"time": times, "W": read[:, 0], "B": read[:, 1], "room": 20.0})
    frame["P"] = [power(time) for time in times]
    return frame


@pytest.fixture(scope="module")
def files(recorded_in, tmp_path_factory):
    folder = tmp_path_factory.mktemp("network")
    (folder / "machine.toml").write_text(MACHINE)
    frames = {
        "first": made(1, lambda t: 30.0 if t < 3000 else 0.0),
        "second": made(2, lambda t: 15.0 if t > 1000 else 40.0),
    }
    recordings = [recorded_in(folder / name, frame, TEMPERATURES, INPUTS) for name, frame in frames.items()]
    return folder / "machine.toml", *recordings


def test_a_calibrated_network_predicts_another_recording(files, tmp_path):
    machine, first, second = files
    plain = simulate_machine(machine, second, tmp_path / "plain")
    fitted = simulate_machine(machine, second, tmp_path / "fitted", calibrate=[first])
    assert max(row["rmse_K"] for row in plain["channels"]) > 1.0
    for row in fitted["channels"]:
        assert row["rmse_K"] < 0.13
        assert 0.8 < row["inside_90_percent_interval"] < 1.0
    true = dict(zip(("capacity.winding", "capacity.body"), TRUE[:2], strict=True))
    true |= {"conductance.winding|body": TRUE[2], "conductance.body|ambient": TRUE[3]}
    for item in fitted["calibration"]["parameters"]:
        if item["name"] in true:
            assert item["low"] * 0.99 < true[item["name"]] < item["high"] * 1.01, item
    # The network's own calibrated file predicts what the fit did.
    again = simulate_machine(tmp_path / "fitted" / "calibrated_machine.toml", second, tmp_path / "again")
    assert [row["rmse_K"] for row in again["channels"]] == pytest.approx(
        [row["rmse_K"] for row in fitted["channels"]], abs=1e-6
    )
    written = json.loads((tmp_path / "fitted" / "simulation.json").read_text())
    assert written["schema"] == "spindle-fem/simulation/1"
    assert {"channel", "rmse_K", "noise_K"} <= set(written["channels"][0])
    errors = pd.read_csv(tmp_path / "fitted" / "error_table.csv")
    assert set(errors["condition"]) >= {"all", "heating", "cooling"}


def test_the_report_says_errors_parameters_and_what_was_wrong_with_the_file(
    files, recorded_in, tmp_path, capsys
):
    machine, first, second = files
    frame = pd.read_csv(second / "made.csv")
    frame.loc[40:44, "B"] = np.nan
    frame.loc[100, "W"] += 30.0
    holey = recorded_in(tmp_path / "holey", pd.concat([frame, frame.iloc[[7]]]), TEMPERATURES, INPUTS)
    folder = tmp_path / "out"
    content = simulate_machine(machine, holey, folder, calibrate=[first])
    html = (folder / "report.html").read_text()
    for text in (
        "two lumps",
        "conductance.winding|body",
        "W: 1 spikes",
        "B: 5 empty cells",
        "1 with a repeated stamp",
        "heating",
        f"{content['channels'][0]['rmse_K']:.3f}",
        "beyond the robust limit",
    ):
        assert text in html, text
    assert html.count("data:image/") == 2
    assert "http" not in html.replace("http://www.w3.org", "")
    # The same page from the files alone.
    (folder / "report.html").unlink()
    assert rebuild(folder) == folder / "report.html"
    assert (folder / "report.html").read_text() == html
    print_simulation(content, folder)
    shown = capsys.readouterr().out
    assert "B: 5 empty cells" in shown
    assert "report.html" in shown


def test_overrides_reach_the_network(files, tmp_path):
    machine, first, _ = files
    text = "network.node.body.capacity=1 J/K"
    changed = simulate_machine(machine, first, tmp_path / "changed", overrides=[text])
    plain = simulate_machine(machine, first, tmp_path / "plain")
    assert changed["channels"][1]["rmse_K"] != pytest.approx(plain["channels"][1]["rmse_K"], rel=0.01)


def test_a_bad_recording_leaves_no_folder(files, tmp_path):
    machine, first, _ = files
    broken = tmp_path / "broken"
    shutil.copytree(first, broken)
    (broken / "made.csv").write_text("time,W\n0,x\n")
    with pytest.raises((RecordingError, BadInputError)):
        simulate_machine(machine, broken, tmp_path / "out")
    assert not (tmp_path / "out").exists()
