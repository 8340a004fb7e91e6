import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.surroundings.air_gaps import taylor_number
from spindle_fem.physics.surroundings.gap_laws.becker_kaye import (
    gap_coefficient_becker_kaye,
    nusselt_becker_kaye,
)
from spindle_fem.physics.surroundings.gap_laws.power_law import gap_coefficient_power_law
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_films.becker import nusselt_becker
from spindle_fem.physics.surroundings.rotating_films.cylinder import nusselt_cylinder
from spindle_fem.physics.surroundings.rotating_films.disc import nusselt_rotating_disc
from spindle_fem.physics.surroundings.rotating_films.dropkin_carmi import nusselt_dropkin_carmi
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film, rotational_reynolds

RPM = 2.0 * np.pi / 60.0


@pytest.mark.parametrize("diameter", [0.18, 0.11])
@pytest.mark.parametrize("speed", [0.0, 50.0, 3000.0, 4500.0])
def test_shaft_ends_of_the_recorded_spindle(diameter, speed):
    # h = max(10, 0.133 Re^(2/3) 0.71^(1/3) 0.026/D), Re = omega D²/(2·1.55e-5)
    reynolds = speed * RPM * diameter**2 / (2 * 1.55e-5)
    expected = max(10.0, 0.133 * reynolds ** (2 / 3) * 0.71 ** (1 / 3) * 0.026 / diameter)
    film = rotating_film("becker", speed * RPM, diameter, minimum=10.0)
    assert film.value == pytest.approx(expected, rel=1e-12)
    assert film.in_range == (expected == 10.0 or 800.0 <= reynolds <= 1e5)


def test_rotating_film_says_when_it_extrapolates():
    film = rotating_film("becker", 4500 * RPM, 0.18, minimum=10.0)
    assert [warning.code for warning in film.warnings] == ["rotating_film_extrapolated"]
    assert "rotational Reynolds number is 492" in film.warnings[0].text
    assert rotating_film("becker", 1000 * RPM, 0.11).warnings == ()


@pytest.mark.parametrize("model", ROTATING_FILMS)
def test_rotating_film_of_arrays_and_sense(model):
    speeds = np.array([-300.0, 0.0, 100.0, 300.0])
    film = rotating_film(model, speeds, 0.11, minimum=5.0)
    assert film.value.shape == film.in_range.shape == (4,)
    assert film.value[0] == film.value[3] > film.value[2] >= film.value[1] >= 5.0


def test_becker_and_dropkin_agree_where_both_are_valid():
    # Two independent experiments in air: within 25 % of each other over their common range.
    reynolds = np.array([1e4, 3e4, 1e5])
    np.testing.assert_allclose(nusselt_becker(reynolds), nusselt_dropkin_carmi(reynolds), rtol=0.25)


def test_a_cylinder_passes_from_becker_to_dropkin_and_carmi_where_both_are_valid():
    slow, fast = np.array([800.0, 3e3, 8e3]), np.array([1e5, 2e5, 4.3e5])
    np.testing.assert_allclose(nusselt_cylinder(slow), nusselt_becker(slow))
    np.testing.assert_allclose(nusselt_cylinder(fast), nusselt_dropkin_carmi(fast))
    both = np.geomspace(8.1e3, 0.99e5, 20)
    assert np.all(nusselt_cylinder(both) < nusselt_becker(both))
    assert np.all(nusselt_cylinder(both) > nusselt_dropkin_carmi(both))
    whole = nusselt_cylinder(np.geomspace(800.0, 4.3e5, 2000))
    # The Reynolds number rises by 0.3 % from one to the next.
    assert np.all((np.diff(whole) > 0.0) & (np.diff(whole) < 0.003 * whole[1:]))
    # 80 mm at 9000 rpm: beyond Becker, not beyond these.
    assert not rotating_film("becker", 9000 * RPM, 0.08).in_range
    assert rotating_film("cylinder", 9000 * RPM, 0.08).warnings == ()


def test_disc_branches_meet_and_tend_to_the_turbulent_law():
    below, above = nusselt_rotating_disc([2.4e5 * (1 - 1e-9), 2.4e5 * (1 + 1e-9)])
    assert above == pytest.approx(below, rel=1e-7)
    assert float(nusselt_rotating_disc(1e4)) == pytest.approx(36.0)
    assert float(nusselt_rotating_disc(5e6)) == pytest.approx(0.015 * 5e6**0.8, rel=0.02)


def test_disc_film_uses_the_radius():
    film = rotating_film("disc", 10.0, 0.2, kinematic_viscosity=1.5e-5, thermal_conductivity=0.026)
    reynolds = 10.0 * 0.1**2 / 1.5e-5
    assert film.reynolds == pytest.approx(reynolds)
    assert film.value == pytest.approx(0.36 * np.sqrt(reynolds) * 0.026 / 0.1)


def test_becker_kaye_branches():
    np.testing.assert_allclose(nusselt_becker_kaye([0.0, 1500.0]), 2.0)
    assert float(nusselt_becker_kaye(5000.0)) == pytest.approx(0.128 * 5000.0**0.367)
    assert float(nusselt_becker_kaye(1e6)) == pytest.approx(0.409 * 1e6**0.241)
    below, above = nusselt_becker_kaye([9999.9, 10000.1])
    assert above == pytest.approx(below, rel=5e-3)
    below, above = nusselt_becker_kaye([1699.9, 1700.1])
    assert above == pytest.approx(below, rel=2e-2)


def test_gap_at_rest_conducts_through_the_air():
    assert float(gap_coefficient_becker_kaye(0.0, 0.09, 0.001)) == pytest.approx(0.026 / 0.001)


def test_labyrinth_of_the_reference_spindle_is_close_to_its_assumed_value():
    # 1 mm gap on Ø180, assumed 30 W/(m²K) at every speed: conduction gives 26.
    found = gap_coefficient_becker_kaye(np.array([0.0, 500.0]) * RPM, 0.09, 0.001)
    np.testing.assert_allclose(found, [26.0, 26.0])


def test_gap_of_the_reference_spindle_by_its_power_law():
    speeds = np.array([0.0, 1500.0, 3000.0, -4500.0]) * RPM
    expected = 8.0 + 12.0 * np.array([0.0, 0.5, 1.0, 1.5]) ** 0.75
    np.testing.assert_allclose(gap_coefficient_power_law(speeds), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: nusselt_becker(500.0), "reynolds is 500, allowed 800 to 100000"),
        (lambda: nusselt_dropkin_carmi(5e3), "reynolds is 5000, allowed 8000 to 430000"),
        (lambda: nusselt_rotating_disc(1e7), "reynolds is 1e+07, allowed 0 to 5e+06"),
        (lambda: rotational_reynolds(1.0, 0.0, 1e-5), "diameter is 0, allowed above 0"),
        (lambda: rotational_reynolds(np.nan, 0.1, 1e-5), "angular_speed is nan"),
        (lambda: rotating_film("bekker", 1.0, 0.1), 'Did you mean "becker"'),
        (lambda: rotating_film("becker", 1.0, 0.1, minimum=-1.0), "minimum is -1"),
        (lambda: nusselt_becker_kaye(9e8), "Use gap_coefficient_power_law for a wide gap."),
        (lambda: taylor_number(1.0, 0.1, 0.0, 1e-5), "gap is 0, allowed above 0"),
        (lambda: gap_coefficient_power_law(1.0, at_rest=-8.0), "at_rest is -8"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(OutOfValidityError) as caught:
        call()
    assert message in str(caught.value)
