"""``spindle-fem diagnose`` refuses what it cannot read and says why recordings tell too little."""

import json

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.diagnose_command import diagnose
from spindle_fem.errors import BadInputError
from tests.support.command_line import run_here
from tests.support.flawed_network import DURATION, MACHINE, STEP, record


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "drive.toml"
    path.write_text(MACHINE)
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('probe = "body"', 'probe = "boddy"'), ("boddy", "body")),
        (("spindle-fem/recording/1", "spindle-fem/recording/9"), ("schema", "spindle-fem/recording/1")),
    ],
    ids=["a probe that the machine lacks", "an unknown schema"],
)
def test_bad_input_ends_with_two_and_says_why(machine, tmp_path, change, words):
    manifest = record(tmp_path / "run", 3) / "recording.toml"
    manifest.write_text(manifest.read_text().replace(*change))
    process = run_here("diagnose", machine, manifest, "-o", tmp_path / "out")
    assert process.returncode == 2
    assert all(word in process.stderr for word in words)
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out" / "diagnosis.json").exists()


def test_too_little_ends_with_zero_and_a_reason(machine, tmp_path):
    run = record(tmp_path / "run", 3, times=np.arange(0.0, 12 * STEP, STEP))
    out = tmp_path / "out"
    process = run_here("diagnose", machine, run / "recording.toml", "-o", out)
    assert process.returncode == 0, process.stderr
    content = json.loads((out / "diagnosis.json").read_text())
    assert content["verdict"] == "unexplained"
    assert "usable readings" in content["reason"]
    assert "usable readings" in process.stdout


def quiet(folder, **changes):
    """A recording, and its columns changed."""
    record(folder, 3, times=np.arange(0.0, changes.pop("until", DURATION) + 1.0, changes.pop("step", STEP)))
    frame = pd.read_csv(folder / "data.csv")
    for name, value in changes.items():
        frame[name] = value(frame)
    frame.to_csv(folder / "data.csv", index=False)
    return folder


def noisy(frame):
    return 21.0 + np.random.default_rng(len(frame)).normal(0.0, 0.1, len(frame))


TOO_LITTLE = {
    "shorter than a time constant": ({"until": 600.0, "step": 10.0}, "to answer a change at the probes"),
    "no excitation": (
        {"P": lambda f: 0.0 * f.P, "n": lambda f: 0.0 * f.n, "room": lambda f: 21.0 + 0.0 * f.P}
        | dict.fromkeys(("Tw", "Tl", "Tb"), noisy),
        "holds no excitation",
    ),
    "too few readings": ({"step": 900.0}, "at least 30 are needed"),
}


@pytest.mark.parametrize("name", TOO_LITTLE)
def test_what_says_too_little_is_unexplained_with_the_reason(machine, tmp_path, name):
    changes, reason = TOO_LITTLE[name]
    content = diagnose(machine, [quiet(tmp_path / "run", **changes)], tmp_path / "out")
    assert content["verdict"] == "unexplained"
    assert reason in content["reason"]
    assert content["findings"] == content["alternatives"] == []
    assert not content["mismatch"]["detected"]
    assert content["next_measurement"]["why"] == content["reason"]
    written = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert written["verdict"] == "unexplained"


def test_a_recording_of_inputs_only_is_refused(machine, tmp_path):
    run = record(tmp_path / "run", 3)
    kept = [line for line in (run / "recording.toml").read_text().splitlines() if '"temperature"' not in line]
    (run / "recording.toml").write_text("\n".join(kept))
    with pytest.raises(BadInputError, match="no channel is a temperature") as caught:
        diagnose(machine, [run], tmp_path / "out")
    assert caught.value.exit_status == 2
