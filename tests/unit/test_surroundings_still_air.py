import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.surroundings.natural_films import NATURAL_FILMS
from spindle_fem.physics.surroundings.natural_films.horizontal_cylinder import nusselt_churchill_chu_cylinder
from spindle_fem.physics.surroundings.natural_films.vertical_plate import nusselt_churchill_chu_plate
from spindle_fem.physics.surroundings.still_air import (
    STEFAN_BOLTZMANN,
    air_properties,
    natural_convection,
    outside_coefficient,
    radiation_coefficient,
    rayleigh_number,
)


def test_air_against_reference_values():
    # Lemmon et al. (2000), Lemmon & Jacobsen (2004) at 101 325 Pa: density, viscosity,
    # heat capacity, conductivity.
    table = {
        -20.0: (1.39565, 1.62012e-5, 1005.54, 0.0228117),
        20.0: (1.20458, 1.82057e-5, 1006.14, 0.0258738),
        100.0: (0.945869, 2.18965e-5, 1011.23, 0.0316199),
    }
    for celsius, expected in table.items():
        air = air_properties(celsius + 273.15)
        found = (air.density, air.dynamic_viscosity, air.specific_heat_capacity, air.thermal_conductivity)
        np.testing.assert_allclose(found, expected, rtol=5e-3)
    assert float(air_properties(300.0, 50662.5).density) == pytest.approx(
        0.5 * float(air_properties(300.0).density)
    )
    assert float(air_properties(300.0).expansion_coefficient) == pytest.approx(1.0 / 300.0)


def test_rayleigh_number_by_hand():
    # 10 K at a mean of 298.15 K over 0.3 m: 9.80665·10·0.027/298.15/(1.562e-5)² · 0.707.
    expected = 9.80665 * 10.0 * 0.027 / 298.15 / 1.562e-5**2 * 0.707
    assert float(rayleigh_number(303.15, 293.15, 0.3)) == pytest.approx(expected, rel=3e-3)


def test_conduction_limits_of_churchill_and_chu():
    assert float(nusselt_churchill_chu_cylinder(0.0, 0.71)) == pytest.approx(0.36)
    assert float(nusselt_churchill_chu_plate(0.0, 0.71)) == pytest.approx(0.825**2)


@pytest.mark.parametrize(
    ("correlation", "offset", "prandtl_constant"),
    [(nusselt_churchill_chu_cylinder, 0.60, 0.559), (nusselt_churchill_chu_plate, 0.825, 0.492)],
)
def test_turbulent_limit_of_churchill_and_chu(correlation, offset, prandtl_constant):
    # For Pr -> infinity and large Ra: 0.387² Ra^(1/3) = 0.150 Ra^(1/3), the textbook limit;
    # at Pr = the constant the bracket is 2^(8/27).
    infinite = float(correlation(1e12, 1e12))
    assert infinite == pytest.approx((offset + 0.387 * 100.0) ** 2, rel=1e-6)
    at_constant = float(correlation(1e12, prandtl_constant))
    assert at_constant == pytest.approx((offset + 38.7 * 2.0 ** (-8.0 / 27.0)) ** 2, rel=1e-12)


@pytest.mark.parametrize("orientation", NATURAL_FILMS)
def test_natural_convection_is_symmetric_and_grows_with_the_difference(orientation):
    mean = 298.15
    difference = np.array([1.0, 5.0, 20.0])
    warm = natural_convection(orientation, mean + difference, mean - difference, 0.3)
    cold = natural_convection(orientation, mean - difference, mean + difference, 0.3)
    np.testing.assert_allclose(warm, cold, rtol=1e-13)
    assert (np.diff(warm) > 0.0).all()


def test_radiation_is_exact_without_linearisation_error():
    surface, ambient = np.array([290.0, 350.0, 500.0]), 293.15
    flux = radiation_coefficient(surface, ambient, 0.8) * (surface - ambient)
    np.testing.assert_allclose(flux, 0.8 * STEFAN_BOLTZMANN * (surface**4 - ambient**4), rtol=1e-12)
    # At equal temperatures it is the derivative, not 0/0.
    assert float(radiation_coefficient(300.0, 300.0, 1.0)) == pytest.approx(4 * STEFAN_BOLTZMANN * 300.0**3)


def test_outside_of_the_reference_spindle_is_about_ten():
    # The assumed 10 W/(m²K) with 30 % (1 sigma) is what both parts give for a painted housing.
    found = outside_coefficient(303.15, 290.75, 0.3, 0.9)
    parts = natural_convection("horizontal_cylinder", 303.15, 290.75, 0.3) + radiation_coefficient(
        303.15, 290.75, 0.9
    )
    assert float(found) == pytest.approx(float(parts), rel=1e-13)
    assert 7.0 < float(found) < 13.0
    plate = outside_coefficient(303.15, 290.75, 0.3, 0.0, orientation="vertical_plate")
    assert float(plate) == pytest.approx(float(natural_convection("vertical_plate", 303.15, 290.75, 0.3)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: air_properties(600.0), "air_properties: temperature is 600"),
        (lambda: air_properties(300.0, 5e5), "pressure is 500000"),
        (lambda: nusselt_churchill_chu_cylinder(1e13, 0.7), "rayleigh is 1e+13"),
        (lambda: nusselt_churchill_chu_plate(1e6, 0.0), "prandtl is 0, allowed above 0"),
        (lambda: rayleigh_number(300.0, 290.0, 0.0), "length is 0, allowed above 0"),
        (lambda: radiation_coefficient(-1.0, 300.0, 0.5), "surface_temperature is -1"),
        (lambda: radiation_coefficient(300.0, 300.0, 1.02), "emissivity is 1.02, allowed 0 to 1"),
        (
            lambda: outside_coefficient(300.0, 290.0, 0.3, 0.9, orientation="vertical_plato"),
            'Did you mean "vertical_plate"',
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(OutOfValidityError) as caught:
        call()
    assert message in str(caught.value)
