"""A recording exported as devices write it, drafted, is the recording that it was."""

import os
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pytest
from nptdms import ChannelObject, TdmsWriter

from spindle_fem.commands.diagnose_command import diagnose_without_report
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.draft_recording import data_text, draft_recording, manifest_text
from spindle_fem.recordings.recordable_names import recordable_names
from spindle_fem.studies.simulate import simulate_recordings

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "recordings"
CASE = Path(os.environ.get("SPINDLE_FEM_RECORDINGS", BESIDE)) / "spindle_examples" / "example_2_heat_scale"
pytestmark = pytest.mark.skipif(not CASE.is_dir(), reason="no folder of recordings")

NAMES = {
    "SP01": "Temp. SP01 Flansch",
    "SP02": "Temp. SP02",
    "SP03": "Temp. SP03",
    "SP04": "Temp. SP04",
    "SP05": "Temp. SP05",
    "COOLANT_OUT": "Kühlmittel Rücklauf",
    "ambient": "Hallentemperatur",
    "coolant_in": "Kühlmittel Vorlauf",
    "speed": "Drehzahl",
    "thrust": "Axialkraft",
}
UNITS = ["°C"] * 8 + ["1/min", "kN"]
START = pd.Timestamp("2026-03-11 07:58:12.250")


def table(name):
    """Stamps and columns as the device has them: forces in kN, as texts with a decimal comma."""
    data = pd.read_csv(CASE / f"{name}.csv.gz")
    values = data[list(NAMES)].assign(thrust=data["thrust"] / 1000.0).rename(columns=NAMES)
    texts = values.map(lambda value: "" if np.isnan(value) else f"{value:.6f}".replace(".", ","))
    return START + pd.to_timedelta(data["time_s"], unit="s"), values, texts


def german_csv(path, name):
    """Windows-1252, a preamble, date beside clock, milliseconds behind a comma, a row of units."""
    stamps, _, texts = table(name)
    lines = ["Messprotokoll;;", "Prüfstand 4;Bearbeiter: Müller", ""]
    lines += [";".join(["Datum", "Uhrzeit", *texts]), ";".join(["TT.MM.JJJJ", "hh:mm:ss,000", *UNITS])]
    for stamp, row in zip(stamps, texts.to_numpy(), strict=True):
        clock = f"{stamp:%d.%m.%Y;%H:%M:%S},{stamp.microsecond // 1000:03d}"
        lines.append(";".join([clock, *row]))
    path.write_bytes("\r\n".join([*lines, ""]).encode("cp1252"))


def utf16_tsv(path, name):
    """UTF-16, tabs, units beside the names."""
    stamps, _, texts = table(name)
    heads = [f"{column} [{unit}]" for column, unit in zip(texts, UNITS, strict=True)]
    lines = ["\t".join(["Zeit", *heads])]
    for stamp, row in zip(stamps, texts.to_numpy(), strict=True):
        lines.append("\t".join([f"{stamp:%d.%m.%Y %H:%M:%S}", *row]))
    path.write_text("\n".join(lines), encoding="utf-16")


def excel(path, name):
    """A sheet with a title, dates as Excel has them, a row of units."""
    workbook = openpyxl.Workbook()
    stamps, values, _ = table(name)
    sheet = workbook.active
    for row in (["Messung Spindel"], [], ["Zeitstempel", *values], ["", *UNITS]):
        sheet.append(row)
    for stamp, row in zip(stamps, values.to_numpy(), strict=True):
        sheet.append([stamp.to_pydatetime(), *(None if np.isnan(v) else float(v) for v in row)])
    workbook.save(path)


def parquet(path, name):
    """Stamps as the index, units beside the names."""
    stamps, values, _ = table(name)
    values.columns = [f"{column} [{unit}]" for column, unit in zip(values, UNITS, strict=True)]
    values.set_index(pd.DatetimeIndex(stamps, name="Zeit")).to_parquet(path)


def hdf5(path, name):
    """A group with seconds and columns, units as attributes."""
    stamps, values, _ = table(name)
    with h5py.File(path, "w") as file:
        group = file.create_group("Messung")
        for column, unit, cells in _columns(stamps, values):
            group.create_dataset(column, data=cells).attrs["unit"] = unit


def tdms(path, name):
    """A group with seconds and channels, units as their properties."""
    stamps, values, _ = table(name)
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("Messung", column, cells, {"unit_string": unit})
                for column, unit, cells in _columns(stamps, values)
            ]
        )


def _columns(stamps, values):
    """Name, unit and cells of the seconds and of every column."""
    yield "time", "s", (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy()
    for column, unit in zip(values, UNITS, strict=True):
        yield column, unit, values[column].to_numpy()


FORMS = {
    "german.csv": german_csv,
    "export.tsv": utf16_tsv,
    "messung.xlsx": excel,
    "messung.parquet": parquet,
    "messung.h5": hdf5,
    "messung.tdms": tdms,
}


def drafted(folder, form, name="recording"):
    file, place = folder / form, folder / name
    FORMS[form](file, name)
    found = draft_recording([file], recordable_names("recorded_spindle"))
    place.mkdir()
    (place / "recording.csv").write_text(data_text(found), encoding="utf-8")
    (place / "recording.toml").write_text(manifest_text(found), encoding="utf-8")
    return place


@pytest.mark.parametrize("form", FORMS)
def test_what_was_exported_is_read_as_the_original(form, tmp_path):
    told, found = read_recording(CASE), read_recording(drafted(tmp_path, form))
    # HDF5 has columns by name
    probes = [found.probes.index(name) for name in told.probes]
    inputs = [found.input_names.index(name) for name in told.input_names]
    assert (len(found.probes), len(found.input_names)) == (len(probes), len(inputs))
    assert np.array_equal(found.held[inputs], told.held)
    assert found.covariate_names == ()
    np.testing.assert_allclose(found.times, told.times, atol=1e-3)
    np.testing.assert_allclose(found.temperature[:, probes], told.temperature, atol=2e-6)
    np.testing.assert_allclose(found.inputs[:, inputs], told.inputs, rtol=1e-6, atol=1e-9)
    assert np.array_equal(found.flags[:, probes], told.flags)


@pytest.mark.slow
def test_a_drafted_recording_is_simulated_and_diagnosed_as_the_original(tmp_path):
    found, earlier = (drafted(tmp_path, "german.csv", name) for name in ("recording", "calibration"))
    overrides = ("mesh.preset=coarse",)
    simulated, told = (
        simulate_recordings("recorded_spindle", read_recording(place), overrides=overrides).predicted
        for place in (found, CASE)
    )
    np.testing.assert_allclose(simulated, told, atol=1e-3)
    answers = [
        diagnose_without_report(
            "recorded_spindle", [place], tmp_path / "out" / place.name, before, overrides, full_model="off"
        )
        for place, before in ((found, [earlier]), (CASE, [CASE / "calibration.toml"]))
    ]
    assert answers[0]["verdict"] == answers[1]["verdict"]
    effects, told = (
        [
            (
                item["effect"],
                item["component"],
                pytest.approx(item["parameters"]["factor"]["value"], rel=0.01),
            )
            for item in answer["findings"]
        ]
        for answer in answers
    )
    assert effects == told != []
