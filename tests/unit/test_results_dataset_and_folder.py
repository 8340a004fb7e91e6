"""Datasets and output folders of a run: units, provenance, completeness."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from spindle_fem.definition.load import load_machine, validate
from spindle_fem.errors import BadInputError
from spindle_fem.report.run_report import rebuild_report
from spindle_fem.results.dataset import build_dataset, default_paths, read_dataset, spec_digest, write_dataset
from spindle_fem.results.output_folder import MARKER, is_complete, output_folder, require_complete
from tests.support.made_result import WALL, make_result


@pytest.fixture(scope="module")
def result():
    return make_result()


def test_dataset_has_units_names_and_provenance(result, tmp_path):
    dataset = build_dataset(result, sources=("Somebody (1999)",))
    path = write_dataset(dataset, tmp_path / "result.nc")
    read = read_dataset(path)
    xr.testing.assert_identical(read, dataset)
    for name, variable in read.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert "Somebody (1999)" in read.attrs["sources"]
    assert read.attrs["spec_sha256"] == spec_digest(result.spec)
    assert json.loads(read.attrs["versions"])["python"]
    assert float(read["bearing_temperature_ball"].sel(bearing="F1")) == pytest.approx(41.85)
    assert float(read["bearing_heat_term"].sel(bearing="F1", heat_term="sliding")) == 20.0


def test_dataset_means_are_exact_for_a_field_linear_in_z(result):
    dataset = build_dataset(result)
    wall = dataset.sel(surface=WALL)
    assert float(wall["surface_area"]) == pytest.approx(2.0 * np.pi * 0.15 * 0.1, rel=1.0e-4)
    assert float(wall["surface_temperature_mean"]) == pytest.approx(300.0 + 5.0 - 7.5 - 273.15, abs=2.0e-3)
    assert float(wall["surface_film_coefficient"]) == pytest.approx(262.0)
    assert float(wall["surface_fluid_temperature"]) == pytest.approx(15.35)
    assert np.isnan(float(dataset["surface_film_coefficient"].sel(surface="shaft.z0")))
    assert float(dataset["part_temperature_max"].sel(part="shaft")) == pytest.approx(300 + 10 - 1.5 - 273.15)


def test_definition_in_the_dataset_reads_back_to_the_same_machine(result):
    import tomllib

    text = build_dataset(result).attrs["machine_definition_toml"]
    assert spec_digest(validate(tomllib.loads(text), "result.nc")) == spec_digest(result.spec)


def test_digest_follows_values():
    assert spec_digest(load_machine("wu_tan_2016")) != spec_digest(
        load_machine("wu_tan_2016", ["channel.depth=11mm"])
    )


def test_defaults_are_what_the_file_does_not_give():
    paths = default_paths(load_machine("wu_tan_2016"))
    assert "coolant.pumping_heat" in paths
    assert "coolant.flow" not in paths


def test_unknown_schema_is_refused(tmp_path):
    xr.Dataset(attrs={"schema": "spindle-fem/result/99"}).to_netcdf(tmp_path / "result.nc", engine="h5netcdf")
    with pytest.raises(BadInputError, match=r'schema is .*/99.* Known: "spindle-fem/result/1"'):
        read_dataset(tmp_path / "result.nc")


def test_missing_dataset_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="there is no such file"):
        read_dataset(tmp_path / "result.nc")


def test_folder_is_marked_until_it_is_complete(tmp_path):
    with output_folder(tmp_path / "a" / "run") as folder:
        assert not is_complete(folder)
    assert is_complete(folder)


def test_folder_keeps_its_marker_and_the_reason_after_an_error(tmp_path):
    with pytest.raises(ZeroDivisionError), output_folder(tmp_path / "run") as folder:
        raise ZeroDivisionError("half way")
    assert "ZeroDivisionError: half way" in (folder / MARKER).read_text()
    with pytest.raises(BadInputError, match=r"is incomplete: .*half way"):
        require_complete(folder)
    with output_folder(folder):
        pass
    assert is_complete(folder)


def test_folder_refuses_a_file(tmp_path):
    (tmp_path / "run").write_text("mine")
    with pytest.raises(BadInputError, match="is a file"), output_folder(tmp_path / "run"):
        pass


def test_folder_refuses_what_is_not_its_own(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(BadInputError, match=r"other content \(thesis\.tex\)"), output_folder(tmp_path):
        pass
    assert [item.name for item in tmp_path.iterdir()] == ["thesis.tex"]


def test_folder_that_does_not_exist_has_no_report(tmp_path):
    with pytest.raises(BadInputError, match="there is no such folder"):
        rebuild_report(tmp_path / "nothing")
