"""``spindle-fem diagnose`` as a user runs it: files, schema, exit status."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.support.command_line import run_here
from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "pump",
    {"motor": ("500 J/K", 0.1), "casing": ("900 J/K", 0.1)},
    {"motor|casing": ("3 W/K", 0.1), "casing|ambient": ("2 W/K", 0.1)},
    [("motor", "power", ("1 W/W", 0.05))],
)
MANIFEST = manifest_text(
    "shift", {"T1": "motor", "T2": "casing"}, {"room": "ambient", "P": "power"}, time="t"
)
BEGIN, END, HEAT = 4200.0, 6600.0, 45.0
VERDICTS = {"consistent", "parameter", "sensor", "missing_physics", "ambiguous", "unexplained"}


def power(time):
    return 80.0 if 600.0 <= time < 3000.0 or 7800.0 <= time < 9600.0 else 10.0


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A machine, and a recording during which something else heats its casing for a while."""
    folder = tmp_path_factory.mktemp("pump")

    def slope(time, state):
        motor, casing = state
        between = 3.0 * (motor - casing)
        extra = HEAT if BEGIN <= time < END else 0.0
        return [(power(time) - between) / 500.0, (between - 2.0 * (casing - 22.0) + extra) / 900.0]

    times = np.arange(0.0, 12001.0, 30.0)
    solved = solve_ivp(slope, (0.0, 12000.0), [22.0, 22.0], t_eval=times, rtol=1e-8, atol=1e-8, max_step=10.0)
    told = solved.y.T + np.random.default_rng(2).normal(0.0, 0.1, (times.size, 2))
    columns = {"t": times, "T1": told[:, 0], "T2": told[:, 1], "room": 22.0, "P": [power(t) for t in times]}
    pd.DataFrame(columns).to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(MANIFEST)
    (folder / "pump.toml").write_text(MACHINE)
    return folder


@pytest.fixture(scope="module")
def done(files):
    out = files / "out"
    process = run_here("diagnose", files / "pump.toml", files / "recording.toml", "-o", out, "--json")
    return process, out


@pytest.fixture(scope="module")
def content(done):
    return json.loads((done[1] / "diagnosis.json").read_text(encoding="utf-8"))


def test_it_succeeds_and_prints_what_it_writes(done, content):
    process, _ = done
    assert process.returncode == 0, process.stderr
    assert json.loads(process.stdout) == content


def test_the_folder_holds_what_is_promised(done):
    _, out = done
    names = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert names >= {"diagnosis.json", "report.html", "improved_machine.toml", "states.csv"}
    assert any(name.startswith("figures/") and name.endswith(".png") for name in names)
    assert not any("incomplete" in name or name.endswith(".part") for name in names)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "unrecorded" in page.lower() or "no recorded input explains" in page


def test_the_answer_has_every_key_with_its_meaning(content):
    assert content["schema"] == "spindle-fem/diagnosis/1"
    assert content["verdict"] in VERDICTS
    mismatch = content["mismatch"]
    assert set(mismatch) >= {"detected", "p_value", "channels", "where", "when", "missing_heat_W"}
    assert 0.0 <= mismatch["p_value"] <= 1.0
    for row in mismatch["channels"]:
        assert set(row) >= {"channel", "rmse_K", "noise_K", "max_K"}
    assert [row["channel"] for row in mismatch["channels"]] == ["T1", "T2"]
    assert set(mismatch["where"]) >= {"component", "r_mm", "z_mm", "credible"}
    for row in mismatch["when"]:
        assert set(row) >= {"start", "end", "condition"}
        assert 0.0 <= row["start"] < row["end"] <= 12000.0
    for row in mismatch["missing_heat_W"].values():
        assert set(row) >= {"mean", "peak"}
    for row in (*content["findings"], *(f for a in content["alternatives"] for f in a["findings"])):
        keys = {"effect", "component", "probability", "parameters", "intervals", "statement"}
        assert set(row) >= keys
        for item in row["parameters"].values():
            assert set(item) == {"value", "low", "high", "unit"}
            assert item["low"] <= item["value"] <= item["high"]
    for row in content["alternatives"]:
        assert 0.0 < row["probability"] < 1.0
    fit = content["fit"]
    assert set(fit) >= {"before", "after", "noise_K", "heldout"}
    for part in ("before", "after"):
        assert set(fit[part]) == {"train_rmse_K", "heldout_rmse_K"}
        assert all(math.isfinite(value) for value in fit[part].values())
    assert set(content["next_measurement"]) >= {"where", "quantity", "condition", "why"}
    assert content["improved_model"] == "improved_machine.toml"


def test_probabilities_sum_to_at_most_one(content):
    total = sum(item["probability"] for item in content["findings"])
    total += sum(item["probability"] for item in content["alternatives"])
    assert 0.5 < total <= 1.0 + 1e-9


def test_it_names_what_was_done(done, content):
    assert content["verdict"] == "missing_physics"
    (finding,) = content["findings"]
    assert (finding["effect"], finding["component"]) == ("unrecorded_heat_source", "casing")
    assert finding["parameters"]["heat"]["value"] == pytest.approx(HEAT, rel=0.15)
    (interval,) = finding["intervals"]
    assert [interval["start"], interval["end"]] == pytest.approx([BEGIN, END], abs=200.0)
    table = pd.read_csv(done[1] / "states.csv")
    assert list(table.columns) == ["start", "end", "effect", "component", "value", "unit"]
    assert len(table) == 1
    errors = content["fit"]
    assert errors["noise_K"] == pytest.approx(0.1, rel=0.05)
    assert errors["after"]["heldout_rmse_K"] < 0.13 < errors["before"]["heldout_rmse_K"]


def test_report_builds_the_page_again(done):
    _, out = done
    page = out / "report.html"
    page.unlink()
    process = run_here("report", out)
    assert process.returncode == 0, process.stderr
    assert page.stat().st_size > 5000


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('probe = "casing"', 'probe = "pipe"'), ("pipe", "casing")),
        (("spindle-fem/recording/1", "spindle-fem/recording/9"), ("schema", "spindle-fem/recording/1")),
    ],
    ids=["a probe that the machine lacks", "an unknown schema"],
)
def test_bad_input_ends_with_two_and_says_why(files, tmp_path, change, words):
    (tmp_path / "data.csv").write_text((files / "data.csv").read_text())
    (tmp_path / "recording.toml").write_text(MANIFEST.replace(*change))
    process = run_here("diagnose", files / "pump.toml", tmp_path / "recording.toml", "-o", tmp_path / "out")
    assert process.returncode == 2
    assert all(word in process.stderr for word in words)
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out" / "diagnosis.json").exists()


def test_too_little_ends_with_zero_and_a_reason(files, tmp_path):
    frame = pd.read_csv(files / "data.csv").iloc[:12]
    frame.to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "recording.toml").write_text(MANIFEST)
    out = tmp_path / "out"
    process = run_here("diagnose", files / "pump.toml", tmp_path / "recording.toml", "-o", out)
    assert process.returncode == 0, process.stderr
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["verdict"] == "unexplained"
    assert "usable readings" in content["reason"]
    assert "usable readings" in process.stdout
