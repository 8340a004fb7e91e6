"""``spindle-fem run`` and ``report`` on a small machine."""

import json
from unittest import mock

import meshio
import pytest
import xarray as xr

from spindle_fem import load_machine, solve
from spindle_fem.commands.console import print_run
from spindle_fem.report import run_outputs
from spindle_fem.results.run_summary import build_summary

FILES = ("summary.json", "fields.vtu", "result.nc", "report.html", "machine.toml")


@pytest.mark.render
def test_run_writes_every_file(small_run):
    folder, process = small_run
    assert process.returncode == 0, process.stderr
    assert [name for name in FILES if not (folder / name).is_file()] == []
    assert len(list((folder / "figures").glob("*.png"))) >= 8
    assert not (folder / "INCOMPLETE").exists()


@pytest.mark.render
def test_json_output_is_the_summary(small_run):
    folder, process = small_run
    assert json.loads(process.stdout) == json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.render
def test_summary_has_the_keys_that_stay_put(small_run):
    summary = json.loads((small_run[0] / "summary.json").read_text(encoding="utf-8"))
    assert {"schema", "machine", "versions", "wall_time_s", "peak_rss_MB", "warnings"} <= set(summary)
    assert {"nodes", "elements", "min_quality", "area_error_relative"} <= set(summary["mesh"])
    assert abs(summary["energy"]["imbalance_relative"]) < 1e-8
    assert max(map(abs, summary["mesh"]["area_error_relative"].values())) < 1e-3
    assert {"flow_m3_s", "inlet_degC", "outlet_degC", "reynolds", "regime", "pressure_drop_Pa"} <= set(
        summary["coolant"]
    )
    assert set(summary["coolant"]["film_coefficient_W_m2K"]) == {"value", "low", "high"}
    for bearing in summary["bearings"].values():
        assert {
            "heat_W", "terms_W", "temperature_inner_degC", "temperature_outer_degC", "temperature_ball_degC",
            "ring_difference_K", "contact_angle_inner_deg", "contact_angle_outer_deg", "preload_N", "film_um",
            "lambda",
        } <= set(bearing)  # fmt: skip
    assert {"min_degC", "max_degC", "max_at_mm"} == set(summary["temperature"])
    growth = summary["growth"]
    assert {f"nose_{place}" for place in ("axial_um", "radial_up_um", "radial_across_um")} <= set(growth)
    assert {"nose_tilt_up_urad", "nose_tilt_across_urad"} <= set(growth)
    for bearing in summary["bearings"]:
        assert set(growth["raceways"][bearing]) == {"inner_um", "outer_um"}
        assert set(growth["seats"][bearing]) == {"shaft_um", "housing_um"}
        for side in ("shaft", "housing"):
            fit = summary["fits"][bearing][side]
            assert min(fit["pressure_MPa"], fit["gap_um"]) == 0.0 < max(fit["pressure_MPa"], fit["gap_um"])


@pytest.mark.render
def test_heat_in_equals_heat_out_by_surface(small_run):
    energy = json.loads((small_run[0] / "summary.json").read_text(encoding="utf-8"))["energy"]
    assert sum(energy["heat_out_W"].values()) == pytest.approx(energy["heat_in_W"], rel=1e-8)


@pytest.mark.render
def test_fields_open_in_meshio_and_agree_with_the_summary(small_run):
    folder, _ = small_run
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    fields = meshio.read(folder / "fields.vtu")
    temperature = next(values for name, values in fields.point_data.items() if "temperature" in name)
    assert temperature.max() == pytest.approx(summary["temperature"]["max_degC"], abs=1e-3)
    with xr.open_dataset(folder / "result.nc", engine="h5netcdf") as dataset:
        assert dataset.attrs


def test_resolved_machine_solves_again_to_the_same_numbers(small_run):
    folder, _ = small_run
    again = solve(load_machine(folder / "machine.toml"))
    first = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["probes"]
    assert {name: value - 273.15 for name, value in again.probes.items()} == pytest.approx(first, abs=1e-6)


@pytest.mark.render
def test_report_is_rebuilt_from_the_folder(small_run, command):
    folder, _ = small_run
    (folder / "report.html").unlink()
    process = command("report", folder)
    assert process.returncode == 0, process.stderr
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text


def test_report_of_an_empty_folder_is_bad_input(command, tmp_path):
    process = command("report", tmp_path)
    assert process.returncode == 2
    assert "summary.json" in process.stderr


def test_run_into_a_folder_of_other_things_is_refused(command, tmp_path):
    (tmp_path / "letters.txt").write_text("mine", encoding="utf-8")
    process = command("run", "small_two_start", "-o", tmp_path)
    assert process.returncode == 2
    assert "letters.txt" in process.stderr
    assert (tmp_path / "letters.txt").read_text(encoding="utf-8") == "mine"


def test_a_failed_check_comes_with_one_document_and_where_the_results_are(
    command, tmp_path, capsys, monkeypatch
):
    def write_summary(result, folder, **settings):
        (folder / "summary.json").write_text(json.dumps(build_summary(result, 0.0, 0.0)), encoding="utf-8")

    monkeypatch.setattr(run_outputs, "OutputHelpers", mock.MagicMock)
    monkeypatch.setattr(run_outputs, "write_outputs", write_summary)
    done = command(
        "run", "small_two_start", "--set", "mesh.preset=coarse", "--set", "mesh.order=1",
        "--set", "grease.temperature_limit=21 degC", "-o", tmp_path / "out", "--json",
    )  # fmt: skip
    assert done.returncode == 1
    summary = json.loads(done.stdout)
    assert [check["name"] for check in summary["checks"] if not check["passed"]] == ["grease temperature"]
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    # without --json the same is shown as tables
    print_run(summary, folder=tmp_path / "out")
    assert "inner °C" in capsys.readouterr().out
    assert "grease temperature" in done.stderr
    assert str(tmp_path / "out" / "report.html") in done.stderr.replace("\n", "")
