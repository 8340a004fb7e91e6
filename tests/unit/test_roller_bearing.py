"""Cylindrical rollers: line contact, load of each roller against load integrals, the bearing file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

import spindle_fem
from spindle_fem.commands.bearing_console import print_bearing
from spindle_fem.errors import FaultsError, GeometryError, SpecError
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.line_contact import half_width, line_approach, line_pressure
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry, solve_roller_bearing

SIZES = {"roller_diameter": 10e-3, "roller_length": 9.6e-3, "roller_count": 14, "pitch_diameter": 65e-3}
FILE = """
[bearing]
kind = "cylindrical_roller"
roller_diameter = "10 mm"
roller_length = "9.6 mm"
roller_count = 14
pitch_diameter = "65 mm"
rows = 2
radial_clearance = "10 µm"
[operation]
speed = "3000 rpm"
radial_load = "4450 N"
"""


def load_integral(share: float, exponent: float = 10.0 / 9.0) -> float:
    """Sjovall's integral: mean over the circle of (1 - (1 - cos ψ)/2ε)^n cos ψ where loaded."""
    edge = np.arccos(np.clip(1.0 - 2.0 * share, -1.0, 1.0))

    def share_of_load(angle: float) -> float:
        return max(1.0 - (1.0 - np.cos(angle)) / (2.0 * share), 0.0) ** exponent * np.cos(angle)

    return quad(share_of_load, 0.0, edge)[0] / np.pi


@pytest.mark.parametrize(("share", "published"), [(0.1, 0.1268), (0.3, 0.2055), (0.5, 0.2453), (0.8, 0.2658)])
def test_most_loaded_roller_is_that_of_the_published_load_integral(share: float, published: float) -> None:
    # Harris & Kotzalas, vol. 1: the table's exponent is 1.1, that of Palmgren's approach 10/9
    assert load_integral(share, 1.1) == pytest.approx(published, rel=1e-3)
    assert load_integral(share) == pytest.approx(published, rel=0.02)
    # many rollers stand for the circle
    sizes = SIZES | {"roller_diameter": 1e-3, "roller_count": 180}
    interference, exponent = 5e-6, 10.0 / 9.0
    # ε is the greatest approach over twice the displacement
    displacement = interference / (2.0 * share)
    clearance = 2.0 * (displacement - interference)
    tight = RollerGeometry(**sizes, radial_clearance=clearance)
    largest = (interference / (2.0 * line_approach(1.0, tight.roller_length, tight.compliance))) ** exponent
    radial = float(largest) * 180 * load_integral(share)
    solved = solve_roller_bearing(tight, radial)
    assert solved.load[:, INNER].max() == pytest.approx(largest, rel=2e-3)
    assert solved.radial_displacement == pytest.approx(displacement, rel=2e-3)


def test_strip_balances_its_load_and_softens_with_radius() -> None:
    load, length, radius, compliance = 1000.0, 10e-3, 4e-3, 2 * (1 - 0.3**2) / 206e9
    width, pressure = (
        half_width(load, length, radius, compliance),
        line_pressure(load, length, radius, compliance),
    )
    # an elliptic pressure over the strip
    assert 0.5 * np.pi * width * pressure * length == pytest.approx(load, rel=1e-12)
    # p = E' b / 2R
    assert pressure == pytest.approx(width / (2.0 * radius * compliance), rel=1e-12)


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("clearance", [-10e-6, 0.0, 40e-6])
def test_rollers_balance_the_radial_load_at_speed(rows: int, clearance: float) -> None:
    geometry = RollerGeometry(**SIZES, rows=rows, radial_clearance=clearance)
    solved = solve_roller_bearing(geometry, 4450.0, 1000.0)
    assert solved.load[:, INNER] @ np.cos(solved.azimuth) == pytest.approx(4450.0, rel=1e-9)
    np.testing.assert_allclose(solved.load[:, OUTER] - solved.load[:, INNER], solved.centrifugal_force)
    loaded = solved.load[:, INNER] > 0.0
    wanted = solved.radial_displacement * np.cos(solved.azimuth) - 0.5 * clearance
    np.testing.assert_allclose(solved.approach[loaded].sum(axis=1), wanted[loaded], rtol=1e-8)


def test_centrifugal_force_of_a_roller_by_hand() -> None:
    geometry = RollerGeometry(**SIZES)
    mass = 7800.0 * np.pi / 4.0 * 0.01**2 * 0.0096
    orbit = 1000.0 * (65.0 - 10.0) / 130.0
    assert geometry.centrifugal_force(1000.0) == pytest.approx(mass * 0.0325 * orbit**2, rel=1e-12)


def test_rollers_that_touch_are_refused() -> None:
    with pytest.raises(GeometryError, match="touch"):
        RollerGeometry(**SIZES | {"roller_count": 21})


def test_file_of_a_roller_bearing(tmp_path: Path) -> None:
    file = tmp_path / "rollers.toml"
    file.write_text(FILE, encoding="utf-8")
    solved = spindle_fem.bearing(file)
    assert len(solved.to_pandas()) == 28
    assert {row["row"] for row in solved["rollers"]} == {1, 2}
    carried = sum(row["load_inner_N"] * np.cos(np.radians(row["azimuth_deg"])) for row in solved["rollers"])
    assert carried == pytest.approx(4450.0, rel=1e-9)
    assert solved["heat_W"] is None
    assert [note["code"] for note in solved["warnings"]] == ["roller_friction_missing"]
    assert "radial stiffness" in str(solved)


def test_a_file_with_lubricant_has_friction_and_films(tmp_path: Path) -> None:
    file = tmp_path / "rollers.toml"
    grease = '[lubricant]\nkinematic_viscosity_40 = "22 mm**2/s"\nkinematic_viscosity_100 = "5 mm**2/s"\n'
    load = '[operation]\nspeed = "3000 rpm"\nradial_load = "1 kN"\n'
    file.write_text(f'[bearing]\ncatalogue = "NN3014 K"\n{load}{grease}', encoding="utf-8")
    solved = spindle_fem.bearing(file)
    assert solved["heat_W"] == pytest.approx(sum(solved["terms_W"].values()))
    assert set(solved["terms_W"]) == {"viscous", "load"}
    assert len(solved["rollers"]) == 54
    top = max(solved["rollers"], key=lambda row: row["load_inner_N"])
    assert 0.3 < top["film_central_um"] < 1.0 < 3.0 < top["lambda"]
    assert solved["warnings"] == []
    file.write_text(f'[bearing]\ncatalogue = "NN3014 K"\n{load}{grease}[heat]\nmodel = "full"\n', "utf-8")
    with pytest.raises(SpecError, match=r'heat.model: "full" knows no rollers. Allowed: palmgren, skf'):
        spindle_fem.bearing(file)


def test_faults_of_a_roller_bearing_file_all_at_once(tmp_path: Path) -> None:
    file = tmp_path / "rollers.toml"
    text = FILE.replace("rows = 2", "rows = 3").replace('"65 mm"', '"65 N"') + 'axial_load = "1 N"\n'
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FaultsError) as caught:
        spindle_fem.bearing(file)
    assert all(key in str(caught.value) for key in ("bearing.rows", "bearing.pitch_diameter", "axial_load"))


def test_no_roller_bearing_turns_as_fast(tmp_path: Path) -> None:
    file = tmp_path / "rollers.toml"
    file.write_text(
        '[bearing]\ncatalogue = "NN3014 K"\n[operation]\nspeed = "1e6 rpm"\nradial_load = "1 kN"\n'
    )
    with pytest.raises(SpecError, match=r"operation\.speed: .*1e\+06 rpm.* runs above"):
        spindle_fem.bearing(file)


def test_terminal_shows_every_roller_and_what_is_missing(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    file = tmp_path / "rollers.toml"
    file.write_text(FILE, encoding="utf-8")
    print_bearing(spindle_fem.bearing(file))
    shown = capsys.readouterr().out
    assert "347.1" in shown
    assert "rating life h" in shown
    assert "…" not in shown
    assert "heat is unknown" in " ".join(shown.split())
    assert max(map(len, shown.splitlines())) <= 80
