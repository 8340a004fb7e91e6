"""The bearing file: its report, and each fault by file, key, value and what is allowed."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from spindle_fem.errors import FaultsError, NoEquilibriumError, SpecError, UnitError, UnknownKeyError
from spindle_fem.physics.bearings.bearing_file import bearing_report, read_bearing_file

BEARING = {
    "ball_diameter": '"22.225 mm"',
    "ball_count": "16",
    "pitch_diameter": '"125.26 mm"',
    "contact_angle": '"40 deg"',
    "groove_curvature_inner": "0.5232",
    "groove_curvature_outer": "0.5232",
    "young_modulus": '"206.8 GPa"',
    "poisson_ratio": "0.29",
    "density": '"7800 kg/m**3"',
}
OPERATION = {"speed": '"10000 rpm"', "axial_load": '"17800 N"', "raceway_control": '"outer"'}
LUBRICANT = {"kinematic_viscosity_40": '"21 mm**2/s"', "kinematic_viscosity_100": '"4.7 mm**2/s"'}
BALL_KEYS = {
    "azimuth_deg", "contact_angle_inner_deg", "contact_angle_outer_deg", "load_inner_N", "load_outer_N",
    "pressure_inner_GPa", "pressure_outer_GPa", "semi_major_inner_mm", "semi_minor_inner_mm",
    "semi_major_outer_mm", "semi_minor_outer_mm", "deformation_inner_um", "deformation_outer_um",
    "centrifugal_force_N", "gyroscopic_moment_Nmm", "orbital_speed_rad_s", "spin_speed_rad_s",
    "film_central_um", "film_minimum_um", "lambda",
}  # fmt: skip


def write(folder: Path, *, greased: bool = False, extra: str = "", **changes: dict) -> Path:
    """A bearing file with some keys changed or (None) left out."""
    tables = {"bearing": dict(BEARING), "operation": dict(OPERATION)}
    if greased:
        tables["lubricant"] = dict(LUBRICANT)
    for table, values in changes.items():
        tables.setdefault(table, {}).update(values)
    lines = []
    for table, values in tables.items():
        lines += [f"[{table}]", *(f"{key} = {value}" for key, value in values.items() if value is not None)]
    file = folder / "bearing.toml"
    file.write_text(extra + "\n".join(lines) + "\n", encoding="utf-8")
    return file


def test_single_bearing_report(tmp_path: Path) -> None:
    report = bearing_report(write(tmp_path))
    json.dumps(report, allow_nan=False)
    assert set(report) >= {
        "axial_deflection_um", "radial_deflection_um", "axial_stiffness_N_um", "heat_W", "terms_W", "balls",
    }  # fmt: skip
    assert len(report["balls"]) == 16
    ball = report["balls"][0]
    assert set(ball) >= BALL_KEYS
    assert ball["contact_angle_inner_deg"] == pytest.approx(49.954, abs=0.05)
    assert ball["contact_angle_outer_deg"] == pytest.approx(31.341, abs=0.05)
    assert ball["gyroscopic_moment_Nmm"] == pytest.approx(1472.7, rel=3e-3)
    assert report["axial_deflection_um"] == pytest.approx(14.96, rel=3e-3)
    assert report["radial_deflection_um"] == 0.0
    # no lubricant: no film and no friction terms
    assert report["heat_W"] is None
    assert report["terms_W"] == {}
    assert ball["film_central_um"] is None
    assert ball["lambda"] is None


def test_lubricant_brings_films_and_terms(tmp_path: Path) -> None:
    operation = {"speed": '"3000 rpm"', "axial_load": '"2000 N"', "raceway_control": '"equilibrium"'}
    report = bearing_report(write(tmp_path, greased=True, operation=operation))
    json.dumps(report, allow_nan=False)
    ball = report["balls"][0]
    assert 0.0 < ball["film_minimum_um"] < ball["film_central_um"]
    assert ball["lambda"] > 0.0
    assert report["heat_W"] == pytest.approx(sum(report["terms_W"].values()))
    assert {"inner_sliding", "outer_rolling", "ball_drag"} <= set(report["terms_W"])
    assert "film_fit_extrapolated" in {warning["code"] for warning in report["warnings"]}


@pytest.mark.parametrize("model", ["paper", "palmgren", "skf"])
def test_heat_model_is_selectable(tmp_path: Path, model: str) -> None:
    operation = {"speed": '"3000 rpm"', "axial_load": '"2000 N"'}
    report = bearing_report(write(tmp_path, greased=True, operation=operation, heat={"model": f'"{model}"'}))
    assert report["heat_W"] > 0.0


def test_set_report_and_load_direction(tmp_path: Path) -> None:
    bearing = {"arrangement": '"TBT"', "preload": '"2000 N"'}
    operation = {"speed": '"1000 rpm"', "axial_load": '"500 N"'}
    report = bearing_report(write(tmp_path, bearing=bearing, operation=operation))
    assert "balls" not in report
    assert [len(entry["balls"]) for entry in report["bearings"]] == [16, 16, 16]
    loads = [entry["axial_load_N"] for entry in report["bearings"]]
    assert loads[0] + loads[1] - loads[2] == pytest.approx(500.0, rel=1e-6)
    assert report["axial_deflection_um"] == report["bearings"][0]["axial_deflection_um"]
    # face to face the first bearing takes a positive axial load as well
    faced = bearing_report(
        write(tmp_path, bearing=bearing | {"arrangement": '"face_to_face"'}, operation=operation)
    )["bearings"]
    assert faced[0]["axial_load_N"] - faced[1]["axial_load_N"] == pytest.approx(500.0, rel=1e-6)
    row = bearing_report(
        write(tmp_path, bearing=bearing | {"arrangement": "[1, 1, -1]"}, operation=operation)
    )
    assert row["axial_deflection_um"] == pytest.approx(report["axial_deflection_um"])


def test_radial_load_lies_at_azimuth_zero(tmp_path: Path) -> None:
    operation = {"speed": '"1000 rpm"', "radial_load": '"4000 N"', "moment": '"5 N*m"'}
    report = bearing_report(write(tmp_path, operation=operation))
    loads = [ball["load_inner_N"] for ball in report["balls"]]
    assert loads[0] == max(loads)
    assert report["radial_deflection_um"] > 0.0
    assert report["balls"][4]["azimuth_deg"] == pytest.approx(90.0)


def test_rest_has_no_film(tmp_path: Path) -> None:
    report = bearing_report(write(tmp_path, greased=True, operation={"speed": '"0 rpm"'}))
    assert report["heat_W"] == 0.0
    assert report["balls"][0]["film_central_um"] is None
    assert report["balls"][0]["contact_angle_inner_deg"] == pytest.approx(41.505, abs=0.01)


def test_spacing_of_a_radially_loaded_set_is_said(tmp_path: Path) -> None:
    bearing = {"arrangement": '"DB"', "preload": '"2000 N"'}
    operation = {"speed": '"0 rpm"', "radial_load": '"300 N"', "axial_load": '"0 N"'}
    warned = bearing_report(write(tmp_path, bearing=bearing, operation=operation))
    assert "spacing_assumed" in {warning["code"] for warning in warned["warnings"]}
    given = bearing_report(write(tmp_path, bearing=bearing | {"spacing": '"30 mm"'}, operation=operation))
    assert "spacing_assumed" not in {warning["code"] for warning in given["warnings"]}


FAULTS = [
    ({"bearing": {"ball_diameter": "22.2"}}, UnitError, "bearing.ball_diameter", "a unit is needed"),
    ({"bearing": {"ball_diameter": '"22 kg"'}}, UnitError, "bearing.ball_diameter", "wrong dimension"),
    ({"bearing": {"ball_count": "16.5"}}, SpecError, "bearing.ball_count", "16.5 is not a whole number"),
    ({"bearing": {"ball_count": "18"}}, SpecError, "bearing.ball_count", "At most 17 balls fit"),
    (
        {"bearing": {"contact_angle": '"80 deg"'}},
        SpecError,
        "bearing.contact_angle",
        "Allowed: 0 to below 65°",
    ),
    ({"bearing": {"pitch_diameter": None}}, SpecError, "bearing.pitch_diameter", "the key is missing"),
    (
        {"bearing": {"ball_diametre": '"1 mm"'}},
        UnknownKeyError,
        "bearing.ball_diametre",
        'mean "ball_diameter"',
    ),
    ({"bearing": {"arrangement": '"TBX"'}}, SpecError, "bearing.arrangement", 'Did you mean "TBT"'),
    (
        {"bearing": {"preload": '"-5 N"'}},
        SpecError,
        "bearing.preload",
        "preload is -5 N. It must not be negative",
    ),
    ({"bearing": {"preload": '"5 N"'}}, SpecError, "bearing.preload", "Preload needs a counter bearing"),
    ({"bearing": {"groove_curvature_inner": "0.5"}}, SpecError, "groove_curvature_inner", "above 0.5"),
    ({"operation": {"speed": '"-10 rpm"'}}, SpecError, "operation.speed", "speed is -10 rpm"),
    ({"operation": {"speed": '"1e9 rpm"'}}, SpecError, "operation.speed", "runs above 39917 rpm"),
    (
        {"operation": {"axial_load": '"-10 N"'}},
        SpecError,
        "operation.axial_load",
        "without a counter bearing",
    ),
    ({"operation": {"radial_load": '"-10 N"'}}, SpecError, "operation.radial_load", "azimuth 0 lies under"),
    ({"operation": {"raceway_control": '"free"'}}, SpecError, "raceway_control", "outer, inner, equilibrium"),
    (
        {"operation": {"raceway_control": '"equilibrium"'}},
        SpecError,
        "raceway_control",
        "there is no [lubricant]",
    ),
    ({"lubricant": {"path_fill": "0.9"} | LUBRICANT}, SpecError, "lubricant.path_fill", "Allowed: 0 to 0.3"),
    ({"lubricant": {"path_fill": "0.01"}}, FaultsError, "lubricant.kinematic_viscosity_40", "is missing"),
    ({"lubrication": {"path_fill": "0.01"}}, UnknownKeyError, "lubrication", 'Did you mean "lubricant"'),
    ({"heat": {"model": '"skff"'}}, SpecError, "heat.model", 'Did you mean "skf"'),
]


@pytest.mark.parametrize(
    ("changes", "kind", "key", "message"), FAULTS, ids=[f"{f[2]}-{i}" for i, f in enumerate(FAULTS)]
)
def test_faults_name_file_key_and_what_is_allowed(tmp_path, changes, kind, key: str, message: str) -> None:
    file = write(tmp_path, **changes)
    with pytest.raises(kind) as caught:
        bearing_report(file)
    text = str(caught.value)
    assert str(file) in text
    assert key in text
    assert message in text
    assert caught.value.exit_status == 2


def test_temperature_outside_the_viscosity_fit(tmp_path: Path) -> None:
    file = write(tmp_path, greased=True, operation={"temperature": '"260 degC"'})
    with pytest.raises(SpecError, match=r"operation\.temperature: 260\.0 °C lies outside the viscosity fit"):
        bearing_report(file)


def test_all_faults_at_once(tmp_path: Path) -> None:
    file = write(tmp_path, bearing={"ball_count": "99", "preload": '"-1 N"'}, operation={"speed": '"-1 rpm"'})
    with pytest.raises(FaultsError) as caught:
        read_bearing_file(file)
    assert len(caught.value.faults) == 3


def test_schema_and_syntax(tmp_path: Path) -> None:
    assert read_bearing_file(
        write(tmp_path, extra='schema = "spindle-fem/bearing/1"\n')
    ).speed == pytest.approx(10_000 * math.pi / 30)
    with pytest.raises(SpecError, match="schema: 'spindle-fem/bearing/2' is unknown"):
        read_bearing_file(write(tmp_path, extra='schema = "spindle-fem/bearing/2"\n'))
    with pytest.raises(SpecError, match="is not TOML"):
        read_bearing_file(write(tmp_path, extra="= 3\n"))
    with pytest.raises(SpecError, match="cannot be read"):
        read_bearing_file(tmp_path / "absent.toml")
    (tmp_path / "empty.toml").write_text("")
    with pytest.raises(FaultsError, match=r"Write \[bearing\]"):
        read_bearing_file(tmp_path / "empty.toml")


def test_no_equilibrium_is_no_bad_input(tmp_path: Path) -> None:
    file = write(tmp_path, operation={"speed": '"1000 rpm"', "axial_load": '"0 N"'})
    with pytest.raises(NoEquilibriumError) as caught:
        bearing_report(file)
    assert caught.value.exit_status == 1


REFERENCE = {
    "ball_diameter": '"14.2875 mm"', "ball_count": "30", "pitch_diameter": '"165 mm"',
    "contact_angle": '"15 deg"', "groove_curvature_inner": "0.52", "groove_curvature_outer": "0.52",
    "young_modulus": '"206 GPa"', "poisson_ratio": "0.3", "bore_diameter": '"140 mm"',
    "outer_diameter": '"190 mm"', "width": '"24 mm"', "arrangement": '"TBT"', "preload": '"1137.2 N"',
}  # fmt: skip
SEATS = {
    "inner_interference": '"8 um"', "outer_clearance": '"5 um"', "housing_outer_diameter": '"300 mm"',
    "shaft_bore_diameter": '"60 mm"', "housing_young_modulus": '"110 GPa"',
    "housing_thermal_expansion": '"10.5e-6 1/K"',
}  # fmt: skip
REST = {"speed": '"0 rpm"', "axial_load": '"0 N"'}


def test_fits_and_ring_temperatures_of_a_set(tmp_path: Path) -> None:
    def forces(**tables: dict) -> list[float]:
        report = bearing_report(write(tmp_path, bearing=REFERENCE, operation=REST, **tables))
        return [bearing["axial_load_N"] for bearing in report["bearings"]]

    assert forces(fit=SEATS) == pytest.approx([568.6, 568.6, 1137.2], rel=1e-6)
    warm = {"assembly": '"20 degC"', "inner_ring": '"32 degC"', "outer_ring": '"26 degC"',
            "ball": '"30 degC"', "shaft": '"31 degC"', "housing": '"24 degC"'}  # fmt: skip
    rigid, seated = forces(temperatures=warm)[2], forces(temperatures=warm, fit=SEATS)[2]
    assert 1137.2 < seated < rigid
    case = read_bearing_file(write(tmp_path, bearing=REFERENCE, operation=REST, fit=SEATS, temperatures=warm))
    assert case.bearing_set.bearings[0].fits.housing.thermal_expansion == pytest.approx(10.5e-6)
    assert case.bearing_set.bearings[0].fits.housing.poisson_ratio == 0.3
    assert (case.temperatures.assembly, case.temperatures.housing) == pytest.approx((293.15, 297.15))


def test_bad_fits_in_a_file(tmp_path: Path) -> None:
    for tables, message in (
        ({"fit": {**SEATS, "outer_clearance": None}}, "fit.outer_clearance: the key is missing"),
        ({"fit": {**SEATS, "inner_interference": '"1 mm"'}}, "fit.inner_interference: 1000 µm on 140 mm"),
        ({"fit": {**SEATS, "housing_outer_diameter": '"150 mm"'}}, "150 mm does not exceed outer_diameter"),
        ({"fit": {**SEATS, "clearance": '"1 um"'}}, "fit.clearance: unknown key"),
        ({"fit": SEATS, "bearing": {**REFERENCE, "width": None}}, "bearing.width: it is missing, but a fit"),
        ({"temperatures": {"ball": '"30 degC"'}}, "temperatures.assembly: the key is missing"),
    ):
        with pytest.raises((SpecError, FaultsError, UnknownKeyError)) as caught:
            read_bearing_file(write(tmp_path, **({"bearing": REFERENCE, "operation": REST} | tables)))
        assert message in str(caught.value)
