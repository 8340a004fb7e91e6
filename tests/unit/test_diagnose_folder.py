"""Diagnoses of a folder of recordings: which it holds, a row each, what is broken, what is done already."""

import json

import pytest

from spindle_fem.commands import diagnose_folder_command as command
from spindle_fem.commands.diagnose_folder_command import FolderOrder, diagnose_folder
from spindle_fem.errors import BadInputError, RecordingError
from spindle_fem.recordings.recording_folder import recordings_in
from spindle_fem.report.diagnoses_report import write_diagnoses_report
from spindle_fem.results.output_folder import output_folder

MANIFEST = 'schema = "spindle-fem/recording/1"\nname = "%s"\n'
FOUND = {
    "verdict": "missing_physics",
    "findings": [{"effect": "radiation", "component": "block"}],
    "set_probability": 0.9,
    "fit": {"before": {"heldout_rmse_K": 0.5}, "after": {"heldout_rmse_K": 0.1}, "noise_K": 0.1},
    "reason": None,
}


@pytest.fixture
def folder(tmp_path):
    """Two manifests and a sub-folder with one, beside a machine and a calibration recording."""
    for name in ("first", "second", "earlier"):
        (tmp_path / f"{name}.toml").write_text(MANIFEST % name)
    (tmp_path / "machine.toml").write_text('schema = "spindle-fem/machine/1"')
    for name in ("third", "answers"):
        (tmp_path / name).mkdir()
    (tmp_path / "third" / "recording.toml").write_text(MANIFEST % "third")
    (tmp_path / "answers" / "note.txt").write_text("")
    return tmp_path


@pytest.fixture
def asked(monkeypatch):
    """Names that were diagnosed; the one named ``second`` is broken."""
    names = []

    def diagnosed(machine, recordings, place, calibrate, overrides, **options):
        names.append(place.name)
        if place.name == "second":
            raise RecordingError("second", "is broken.")
        with output_folder(place):
            (place / "diagnosis.json").write_text("{}")
        return FOUND

    monkeypatch.setattr(command, "diagnose", diagnosed)
    return names


def test_a_folder_holds_manifests_and_sub_folders_but_no_machines(folder):
    assert list(recordings_in(folder)) == ["earlier", "first", "second", "third"]
    assert list(recordings_in(folder, [folder / "earlier.toml"])) == ["first", "second", "third"]
    (folder / "none.toml").write_text("broken =")
    assert "none" in recordings_in(folder)


def test_a_folder_that_is_a_recording_stays_one(folder):
    assert recordings_in(folder / "third") == {}
    (folder / "third" / "recording.toml").rename(folder / "third" / "other.toml")
    assert recordings_in(folder / "third") == {}
    assert recordings_in(folder / "first.toml") == {}


def test_every_recording_is_a_row_and_a_broken_one_says_why(folder, asked, tmp_path):
    order = FolderOrder("bench_motor", (folder / "earlier.toml",))
    content = diagnose_folder(order, folder, tmp_path / "out")
    assert asked == ["first", "second", "third"]
    assert (content["recordings"], content["diagnosed"], content["failed"]) == (3, 2, 1)
    lines = (tmp_path / "out" / "diagnoses.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["recording", "first", "second", "third"]
    assert "is broken" in lines[2]
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'href="first/report.html"' in page
    assert 'href="second/report.html"' not in page
    assert "radiation @ block" in page


def test_what_is_done_is_not_done_again(folder, asked, tmp_path):
    order = FolderOrder("bench_motor", (folder / "earlier.toml",))
    diagnose_folder(order, folder, tmp_path / "out")
    asked.clear()
    (folder / "third" / "recording.toml").write_text(MANIFEST % "changed")
    content = diagnose_folder(order, folder, tmp_path / "out")
    assert asked == ["third"]
    assert content["reused"] == 2
    page = write_diagnoses_report(tmp_path / "out").read_text()
    assert "third" in page
    assert json.loads((tmp_path / "out" / "diagnoses.json").read_text())["diagnosed"] == 2


@pytest.mark.parametrize(("machine", "whole"), [("machine.toml", True), ("bench_motor", False)])
def test_workers_of_another_directory_are_told_whole_paths(folder, monkeypatch, machine, whole):
    sent = []

    def diagnosed(machine, recordings, place, calibrate, overrides, **options):
        sent.append((machine, [*recordings, place, *calibrate]))
        with output_folder(place):
            (place / "diagnosis.json").write_text("{}")
        return FOUND

    monkeypatch.setattr(command, "diagnose", diagnosed)
    monkeypatch.chdir(folder)
    # A recording may be named by its folder.
    diagnose_folder(FolderOrder(machine, ("third", "earlier.toml")), ".", "out")
    calibrate = [folder / "third" / "recording.toml", folder / "earlier.toml"]
    for name, (told, paths) in zip(("first", "second"), sent, strict=True):
        assert told == (folder / machine if whole else machine)
        assert paths == [folder / f"{name}.toml", folder / "out" / name, *calibrate]


def test_no_recording_and_none_that_works_are_bad_input(folder, asked, tmp_path):
    with pytest.raises(BadInputError, match="holds no recording"):
        diagnose_folder(FolderOrder("bench_motor"), folder / "answers", tmp_path / "out")
    (folder / "third" / "recording.toml").unlink()
    sound = (folder / "first.toml", folder / "earlier.toml")
    with pytest.raises(BadInputError, match="none of 1"):
        diagnose_folder(FolderOrder("bench_motor", sound), folder, tmp_path / "out")


def test_the_command_takes_a_folder_with_and_without_workers(folder, asked, tmp_path):
    from typer.testing import CliRunner

    from spindle_fem.cli import app

    given = ["diagnose", "bench_motor", str(folder), "-o", str(tmp_path / "out"), "--json"]
    for more in ([], ["--jobs", "1"]):
        result = CliRunner().invoke(app, [*given, *more])
        assert json.loads(result.stdout)["diagnosed"] == 3


def test_a_dask_scheduler_does_the_same(folder, asked, tmp_path):
    distributed = pytest.importorskip("distributed")
    order = FolderOrder("bench_motor", (folder / "earlier.toml",))
    with distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster:
        content = diagnose_folder(order, folder, tmp_path / "out", scheduler=cluster.scheduler_address)
    assert sorted(asked) == ["first", "second", "third"]
    assert (content["diagnosed"], content["failed"]) == (2, 1)
