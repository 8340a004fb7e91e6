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
