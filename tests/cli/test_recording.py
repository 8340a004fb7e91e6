"""``spindle-fem recording`` as it is typed: a German export becomes a recording that ``simulate`` takes."""

import json

import numpy as np
import pytest

from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.simulate import simulate_recordings

ROWS = 200


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("devices")
    lines = [
        "Prüfstand Süd;;;;;",
        "Datum;Uhrzeit;Wicklung winding;stator_body;Raumtemperatur;electrical power",
    ]
    lines.append(";;[°C];[°C];[°C];[W]")
    for k in range(ROWS):
        warm = 22.0 + 0.05 * k
        clock = f"{12 + k // 60}:{k % 60:02d}:00,500"
        lines.append(
            f"02.05.2016;{clock};{warm:.2f};{warm - 1.0:.2f};22.00;{40.0 * (k > 20):.1f}".replace(".", ",")
        )
        lines[-1] = lines[-1].replace("02,05,2016", "02.05.2016")
    lines[50] = lines[50].replace("22,00;", "Fehler;")
    (folder / "export.csv").write_bytes("\r\n".join(lines).encode("latin-1"))
    return folder


def test_an_export_becomes_a_recording_that_is_simulated(folder, process):
    told = process(
        "recording",
        "draft",
        folder / "export.csv",
        "--machine",
        "bench_motor",
        "-o",
        folder / "drafted",
        "--json",
    )
    assert told.returncode == 0, told.stderr
    content = json.loads(told.stdout)
    means = {item["column"]: item["probe"] or item["drives"] for item in content["channels"]}
    assert means == {
        "Wicklung winding": "winding",
        "stator_body": "stator_body",
        "Raumtemperatur": "ambient",
        "electrical power": "electrical_power",
    }
    assert content["lost_cells"] == ['export.csv line 51, column Raumtemperatur: "Fehler"']
    assert (folder / "drafted" / "recording.png").stat().st_size > 20_000
    recording = read_recording(folder / "drafted")
    assert len(recording.times) == ROWS
    assert np.isfinite(simulate_recordings("bench_motor", recording).predicted).all()


def test_a_picture_of_what_is_no_recording_is_refused(folder, command):
    told = command("recording", "show", folder / "export.csv", "-o", folder / "picture.png")
    assert told.returncode == 2
    assert "is not a manifest" in told.stderr
    assert not (folder / "picture.png").exists()


def test_what_a_user_has_edited_is_not_drafted_over(folder, tmp_path, command):
    place = tmp_path / "edit"
    words = ("recording", "draft", folder / "export.csv", "-o", place)
    assert command(*words).returncode == 0
    assert command(*words).returncode == 0
    for name, changed in (("recording.toml", "# mine\n"), ("recording.csv", "\n")):
        text = (place / name).read_text(encoding="utf-8")
        (place / name).write_text(text + changed, encoding="utf-8")
        told = command(*words)
        assert told.returncode == 2
        assert f"{name}: was changed since it was drafted" in " ".join(told.stderr.split())
        assert f"remove {name}" in " ".join(told.stderr.split())
        assert (place / name).read_text(encoding="utf-8") == text + changed
        (place / name).write_text(text, encoding="utf-8")
    (place / "recording.toml").unlink()
    assert command(*words).returncode == 0
    assert (place / "recording.toml").is_file()


def test_a_drafted_folder_is_no_place_for_results_nor_for_its_own_draft(folder, tmp_path, command):
    place = tmp_path / "drafted"
    assert command("recording", "draft", folder / "export.csv", "-o", place).returncode == 0
    before = {file.name: file.read_bytes() for file in place.iterdir()}
    told = command("simulate", "bench_motor", place, "-o", place)
    assert told.returncode == 2
    assert "is a folder with other content" in told.stderr
    told = command("run", "small_two_start", "-o", place)
    assert told.returncode == 2
    assert "is a folder with other content" in told.stderr
    told = command("recording", "draft", place / "recording.csv", "-o", place)
    assert told.returncode == 2
    assert "would be written over" in told.stderr
    assert {file.name: file.read_bytes() for file in place.iterdir()} == before


@pytest.mark.parametrize("fault", ["clock", "probe"])
def test_what_makes_no_recording_leaves_nothing_and_names_the_users_file(tmp_path, command, fault):
    rows = [
        f"02.05.2016;12:00:{0 if fault == 'clock' else k:02d};{22 + k if fault == 'clock' else -400}"
        for k in range(20)
    ]
    file = tmp_path / "device.csv"
    file.write_text("\n".join(["Datum;Uhrzeit;Lager [°C]", *rows]), encoding="utf-8")
    told = command("recording", "draft", file, "-o", tmp_path / "out")
    text = " ".join(told.stderr.split())
    assert told.returncode == 2
    assert f"RecordingError: {file}: " in text
    if fault == "clock":
        assert "has the same time in all 20 rows" in text
        assert 'columns "Datum" and "Uhrzeit" were taken for date and clock' in text
    assert "recording." not in text.replace(str(file), "")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("machine", ["small_two_start", "bench_motor"])
def test_a_manifest_with_four_faults_is_refused_once(folder, tmp_path, command, machine):
    place = tmp_path / "drafted"
    assert command("recording", "draft", folder / "export.csv", "-o", place).returncode == 0
    manifest = place / "recording.toml"
    text = manifest.read_text(encoding="utf-8").replace('unit = "W"', 'unit = "watts_"')
    text = text.replace('column = "electrical power"', 'column = "electrical pwr"')
    text = text.replace('drives = "ambient"', 'drives = "ambiente"')
    text = text.replace('probe = "stator_body"', 'probe = "FORNT"')
    manifest.write_text(text, encoding="utf-8")
    told = command("simulate", machine, place, "-o", tmp_path / "out")
    assert told.returncode == 2
    for word in ("watts_", "electrical pwr", "ambiente", "FORNT"):
        assert word in told.stderr
    assert not (tmp_path / "out").exists()
