"""Studies of transients: what a file may hold, and the folder that is left."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from spindle_fem.commands.transient_command import run_transient_study
from spindle_fem.errors import (
    BadInputError,
    FaultsError,
)
from spindle_fem.studies.transient_study import load_study, study_of

SMALL = ["mesh.preset=coarse", "mesh.order=1"]
RPM = np.pi / 30.0


@pytest.mark.parametrize("name", ["heat_up_3000rpm", "step_test", "cool_down"])
def test_shipped_cases_are_sound(name, pytestconfig):
    study = load_study(pytestconfig.rootpath / "studies" / f"{name}.toml")
    assert study.machine == "wu_tan_2016"
    assert study.error == 0.05
    if name == "step_test":
        assert [round(phase.speed / RPM) for phase in study.phase] == list(range(0, 4501, 500))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema": "spindle-fem/transient/9"}, "schema: 'spindle-fem/transient/9' is not known"),
        ({"phase": [{"name": "x", "speed": "3000 rpm"}]}, "phase.x: has no end"),
        (
            {"phase": [{"name": "x", "sped": "3000 rpm", "duration": "1 h"}]},
            'unknown key.*Did you mean "speed"',
        ),
        ({"phase": [{"name": "x", "speed": "3000", "duration": "1 h"}]}, "phase.x.speed: .*unit"),
        ({"phase": [{"name": "x", "duration": "-1 h"}]}, "phase.x.duration: .*above 0 s"),
        (
            {"until": {"change": "1 K", "within": "10 min", "look_every": "3 min", "at_most": "1 h"}},
            "until.look_every: 180 s does not divide 600 s",
        ),
    ],
)
def test_bad_studies_are_refused(change, said):
    good = {
        "schema": "spindle-fem/transient/1",
        "name": "x",
        "phase": [{"name": "x", "speed": "3000 rpm", "duration": "1 h"}],
    }
    with pytest.raises(FaultsError, match=said):
        study_of({**good, **change})


@pytest.mark.slow
def test_a_study_leaves_a_complete_folder(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        'schema = "spindle-fem/transient/1"\nname = "short"\nsample_every = "5 min"\n'
        '[[phase]]\nname = "on"\nspeed = "3000 rpm"\nduration = "10 min"\n'
        '[[phase]]\nname = "off"\nspeed = "0 rpm"\nduration = "10 min"\n',
        encoding="utf-8",
    )
    folder = tmp_path / "out"
    summary = run_transient_study(path, folder, overrides=SMALL)
    assert json.loads((folder / "transient.json").read_text(encoding="utf-8")) == summary
    assert not (folder / "INCOMPLETE").exists()
    with (folder / "transient.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["time_s"]) for row in rows] == [0.0, 300.0, 600.0, 900.0, 1200.0]
    assert float(rows[2]["SP01_degC"]) > float(rows[0]["SP01_degC"])
    assert [phase["heat_W"] > 0.0 for phase in summary["phases"]] == [True, False]
    assert summary["equilibrium"]["exists"]
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "Time" in report or "time" in report
    for name in ("probes", "bearings", "heat", "steps"):
        assert (folder / "figures" / f"{name}.png").stat().st_size > 10_000
    again = run_transient_study(path, tmp_path / "again", overrides=SMALL, restart=folder / "state.npz")
    assert again["phases"][0]["start_s"] == 1200.0


def test_no_state_file(tmp_path):
    study = tmp_path / "study.toml"
    study.write_text(
        'schema = "spindle-fem/transient/1"\nname = "x"\n[[phase]]\nname = "x"\nduration = "1 h"\n',
        encoding="utf-8",
    )
    with pytest.raises(BadInputError, match="no saved thermal state"):
        run_transient_study(study, tmp_path / "out", restart=tmp_path / "none.npz")
