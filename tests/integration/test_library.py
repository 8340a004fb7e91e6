"""What ``import spindle_fem`` answers with: short to print, tables for notebooks, data, plots, folders."""

import json
import pkgutil
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import spindle_fem
from spindle_fem.definition.load import write_machine
from spindle_fem.errors import SpecError
from spindle_fem.results.output_folder import is_complete
from tests.unit.test_bearings_file import BEARING, OPERATION

EXAMPLES = Path(__file__).parents[2] / "examples"
LONGEST_REPR = 200


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The pump of the examples, warming for an hour."""
    folder = tmp_path_factory.mktemp("pump")
    times = np.arange(0.0, 3601.0, 60.0)
    rise = 1.0 - np.exp(-times / 900.0)
    data = pd.DataFrame(
        {"t": times, "T1": 22.0 + 30.0 * rise, "T2": 22.0 + 18.0 * rise, "room": 22.0, "P": 60.0}
    )
    data.to_csv(folder / "data.csv", index=False)
    manifest = folder / "recording.toml"
    manifest.write_text((EXAMPLES / "pump_recording.toml").read_text(encoding="utf-8"), encoding="utf-8")
    return spindle_fem.read_recording(manifest)


@pytest.fixture(scope="module")
def solved():
    overrides = ["mesh.preset=coarse", "mesh.order=1", "heat.model=palmgren"]
    return spindle_fem.solve(spindle_fem.load_machine("small_two_start", overrides))


@pytest.fixture(scope="module")
def simulated(recording):
    return spindle_fem.simulate(spindle_fem.load_machine(EXAMPLES / "pump.toml"), recording)


@pytest.mark.parametrize(
    ("machine", "counts"),
    [("small_two_start", "5 parts, 2 bearings"), (EXAMPLES / "pump.toml", "2 nodes, 2 links")],
)
def test_a_definition_prints_in_one_line(machine, counts):
    spec = spindle_fem.load_machine(machine)
    assert repr(spec) == str(spec) == f"<{type(spec).__name__}: {spec.name}, {counts}>"


def require_shown(found, *words):
    assert len(repr(found)) < LONGEST_REPR
    assert repr(found).startswith(f"<{type(found).__name__}: ")
    page = found._repr_html_()
    assert page.count("<tr>") >= 1
    for word in words:
        assert word in page


def test_a_recording(recording, tmp_path):
    place = recording.save(tmp_path / "read")
    assert {"recording.nc", "recording.png"} <= {item.name for item in recording.save(place).iterdir()}
    require_shown(recording, "T1", "22.0 to")
    data = recording.to_xarray()
    assert data["temperature"].sel(channel="T2").values[0] == pytest.approx(22.0)
    assert data["input_unit"].sel(driven="ambient") == "kelvin"
    assert data["probe"].values.tolist() == ["motor", "casing"]
    assert len(recording.plot_channels().axes) == 4


def test_a_solved_machine(solved):
    require_shown(solved, "B1", "imbalance")
    data = solved.to_xarray()
    assert float(data["bearing_heat"].sel(bearing="B1")) == solved.bearings["B1"].heat
    grid = solved.to_pyvista()
    assert grid["temperature_degC"].max() == pytest.approx(solved.temperature_maximum - 273.15)
    volumes = grid.compute_cell_sizes()["Volume"]
    for number, name in enumerate(grid.field_data["parts"]):
        own = volumes[grid.cell_data["part"] == number].sum()
        # curved elements against straight ones of the same corners, on a coarse mesh
        assert own == pytest.approx(solved.mesh.cad_volume[str(name)], rel=0.05)
    for plot in ("temperature", "profiles", "heat_balance", "bearings", "coolant"):
        assert isinstance(getattr(solved, f"plot_{plot}")(), Figure)


def test_a_machine_is_solved_again_from_its_file(solved, tmp_path):
    file = tmp_path / "machine.toml"
    file.write_text(write_machine(solved.spec), encoding="utf-8")
    assert spindle_fem.solve(file).probes == pytest.approx(solved.probes, rel=1e-9)


def test_a_network_is_loaded_but_not_solved():
    with pytest.raises(SpecError, match="Only simulate and diagnose"):
        spindle_fem.solve(spindle_fem.load_machine("bench_motor"))


def test_a_simulated_recording(simulated, recording, tmp_path):
    require_shown(simulated, "T1", "noise 0.100 K")
    data = simulated.to_xarray()
    error = float(np.sqrt(((data["measured"] - data["predicted"]) ** 2).mean("time")).sel(channel="T1"))
    assert error == pytest.approx(simulated["channels"][0]["rmse_K"], rel=1e-6)
    assert isinstance(simulated.plot_channels(), Figure)
    assert json.loads(json.dumps(simulated))["recording"] == recording.name
    kept = simulated.save(tmp_path / "kept")
    assert is_complete(kept)
    assert (kept / "report.html").read_bytes() == simulated.report.read_bytes()
    assert "INFO    simulation" in (kept / "log.txt").read_text(encoding="utf-8")


def test_a_folder_that_was_not_asked_for_goes_with_its_result(recording, tmp_path):
    found = spindle_fem.simulate(EXAMPLES / "pump.toml", recording)
    place = found.folder
    assert place.is_dir()
    del found
    assert not place.exists()
    asked = spindle_fem.simulate(EXAMPLES / "pump.toml", recording.source, tmp_path / "asked").folder
    assert (asked / "simulation.json").is_file()


def test_a_bearing_of_tables():
    written = {"bearing": BEARING, "operation": OPERATION}
    tables = {
        name: {key: json.loads(value) for key, value in table.items()} for name, table in written.items()
    }
    found = spindle_fem.bearing(tables)
    require_shown(found, "axial stiffness")
    data = found.to_xarray()
    assert data.sizes["ball"] == tables["bearing"]["ball_count"]
    assert float(data["load_inner_N"][0, 0]) == found["balls"][0]["load_inner_N"]


def test_editors_see_the_names_that_load_on_first_use():
    folder = Path(spindle_fem.__file__).parent
    assert (folder / "py.typed").is_file()
    stub = (folder / "__init__.pyi").read_text(encoding="utf-8")
    expected = {}
    for name, place in spindle_fem._PLACES.items():
        module, _, attribute = place.partition(":")
        expected[name] = f"from {module} import {attribute or name} as {name}"
    found = {line.rpartition(" as ")[2]: line for line in stub.splitlines() if " as " in line}
    assert found == expected


def test_no_module_can_stand_in_the_place_of_a_function():
    modules = {item.name for item in pkgutil.iter_modules(spindle_fem.__path__)}
    assert not modules & set(spindle_fem.__all__)


@pytest.mark.slow
def test_a_transient(tmp_path):
    study = tmp_path / "study.toml"
    phase = 'phase = [{name = "warm", speed = "3000 rpm", duration = "10 min"}]'
    heading = 'schema = "spindle-fem/transient/1"\nname = "warm"\nfields_every = "4 min"\n'
    study.write_text(f"{heading}{phase}\n", encoding="utf-8")
    overrides = ["mesh.preset=coarse", "mesh.order=1"]
    machine = spindle_fem.load_machine("small_two_start", overrides)
    found = spindle_fem.transient(study, machine=machine)
    require_shown(found, "warm")
    data = found.to_xarray()
    ends = data["probe_temperature"].isel(time=-1)
    expected = found["phases"][-1]["probes_degC"]
    assert {str(name): float(ends.sel(probe=name)) for name in ends["probe"].values} == pytest.approx(
        expected
    )
    assert found.to_pyvista()["temperature_degC"].max() == pytest.approx(found["phases"][-1]["hottest_degC"])
    with h5py.File(found.save(tmp_path / "kept") / "fields.vtkhdf") as series:
        assert series["VTKHDF/Steps/Values"][:].tolist() == [0.0, 240.0, 480.0, 600.0]
        last = series["VTKHDF/PointData/temperature_degC"][-len(found.machine.mesh.points) :]
    assert last == pytest.approx(found.to_pyvista()["temperature_degC"], abs=1e-5)
    for plot in ("probes", "bearings", "heat"):
        assert isinstance(getattr(found, f"plot_{plot}")(), Figure)


@pytest.mark.slow
def test_a_sweep_and_a_crosscheck(tmp_path):
    overrides = ("mesh.preset=coarse", "mesh.order=1", "heat.model=table")
    study = tmp_path / "study.toml"
    study.write_text(
        'schema = "spindle-fem/study/1"\n'
        '[[parameter]]\npath = "coolant.flow"\nvalues = ["4 L/min", "8 L/min"]\n'
        '[study]\noutputs = ["temperature.max_degC"]\n',
        encoding="utf-8",
    )
    found = spindle_fem.sweep("small_two_start", study, None, overrides)
    require_shown(found, "designs")
    table = found.to_pandas()
    assert found.to_xarray()["coolant.flow"].attrs["units"] == "m**3/s"
    assert table["temperature.max_degC"].is_monotonic_decreasing
    assert isinstance(found.plot_responses(), Figure)
    check = spindle_fem.crosscheck("small_two_start", tmp_path / "check", overrides)
    require_shown(check, "network")
    data = check.to_xarray()
    apart = abs(data["network_temperature"] - data["fem_temperature"]).max()
    assert float(apart) == pytest.approx(max(abs(item["difference_K"]) for item in check["nodes"]), abs=1e-6)
    assert isinstance(check.plot_difference(), Figure)
