import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
from spindle_fem.physics.coolant.coolants.water import Water
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.physics.coolant.user_coolant import UserCoolant

# Temperatures of any shape give properties of that shape.
SHAPES = [(), (3,), (2, 3)]


def user_coolant(**changes):
    values = {
        "name": "VG 22",
        "reference_temperature": 313.15,
        "density": 860.0,
        "specific_heat_capacity": 1950.0,
        "thermal_conductivity": 0.13,
        "viscosity_temperatures": (313.15, 373.15),
        "kinematic_viscosities": (21.0e-6, 4.7e-6),
        "lowest_temperature": 273.15,
        "highest_temperature": 373.15,
    }
    return UserCoolant(**(values | changes))


FLUIDS = [OilIsoVg32(), Water(), user_coolant(specific_heat_capacity_slope=3.5, density_slope=-0.6)]


@pytest.mark.parametrize("shape", SHAPES)
def test_properties_take_the_shape_of_the_temperature(shape):
    found = OilIsoVg32().properties(np.full(shape, 300.0))
    assert found.density.shape == shape
    assert found.prandtl.shape == shape


@pytest.mark.parametrize("fluid", FLUIDS, ids=lambda fluid: fluid.name)
def test_enthalpy_is_the_integral_of_the_heat_capacity(fluid):
    step = 1e-2
    temperature = np.linspace(fluid.lowest_temperature + 1.0, fluid.highest_temperature - 1.0, 7)
    slope = (fluid.specific_enthalpy(temperature + step) - fluid.specific_enthalpy(temperature - step)) / (
        2.0 * step
    )
    np.testing.assert_allclose(slope, fluid.properties(temperature).specific_heat_capacity, rtol=1e-7)


def test_water_against_tabulated_values():
    # IAPWS R6-95, R12-08 and R15-11 (not the formulas used here) at 0.1 MPa:
    # density, heat capacity, viscosity, conductivity.
    table = {
        20.0: (998.21, 4184.1, 1.0016e-3, 0.5980),
        60.0: (983.20, 4185.0, 4.660e-4, 0.6510),
    }
    for celsius, expected in table.items():
        found = Water().properties(celsius + 273.15)
        values = (
            found.density,
            found.specific_heat_capacity,
            found.dynamic_viscosity,
            found.thermal_conductivity,
        )
        np.testing.assert_allclose(values, expected, rtol=5e-4)


def test_walther_meets_both_viscosities_and_published_values_between():
    # 21 and 4.7 mm²/s: 46.73 at 20, 30.48 at 30, 11.342 at 60, 6.970 mm²/s at 80 °C.
    fluid = user_coolant()
    temperature = np.array([20.0, 30.0, 40.0, 60.0, 80.0, 100.0]) + 273.15
    found = 1e6 * fluid.properties(temperature).kinematic_viscosity
    np.testing.assert_allclose(found, [46.73, 30.48, 21.0, 11.342, 6.970, 4.7], rtol=1e-3)


def test_andrade_is_a_straight_line_in_the_logarithm():
    thin = user_coolant(viscosity_law="andrade", kinematic_viscosities=(1.5e-6, 0.6e-6))
    middle = 2.0 / (1.0 / 313.15 + 1.0 / 373.15)
    found = float(thin.properties(middle).kinematic_viscosity)
    assert found == pytest.approx(np.sqrt(1.5e-6 * 0.6e-6), rel=1e-12)


@pytest.mark.parametrize("celsius", [9.99, 50.01, -273.15, np.nan])
def test_oil_refuses_outside_its_range(celsius):
    with pytest.raises(OutOfValidityError) as caught:
        OilIsoVg32().properties([300.0, celsius + 273.15])
    assert caught.value.where == "coolant iso_vg_32"
    assert "allowed 10 to 50" in caught.value.what
    assert "docs/python.md" in caught.value.how_to_fix


@pytest.mark.parametrize(("celsius", "warns"), [(14.9, True), (15.0, False), (45.0, False), (45.1, True)])
def test_oil_warns_outside_15_to_45(celsius, warns):
    warnings = OilIsoVg32().temperature_warnings(celsius + 273.15)
    assert [warning.code for warning in warnings] == ["coolant_property_accuracy"] * warns
    if warns:
        assert "allowed 15 to 45 °C" in warnings[0].text


def test_range_limits_survive_the_conversion_from_celsius():
    OilIsoVg32().properties(np.array([10.0, 50.0]) + 273.15)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kinematic_viscosities": (4.7e-6, 21e-6)}, "make no line"),
        ({"viscosity_temperatures": (313.15, 313.15)}, "make no line"),
        ({"kinematic_viscosities": (1.5e-6, 0.6e-6)}, 'Use viscosity_law = "andrade"'),
        ({"viscosity_law": "walter"}, 'Did you mean "walther"?'),
        ({"density_slope": -20.0}, "density is -340"),
        ({"lowest_temperature": 380.0}, "lowest_temperature is 380"),
        ({"kinematic_viscosities": (0.0, 4e-6)}, "kinematic_viscosity is 0"),
    ],
)
def test_user_coolant_that_cannot_be(changes, message):
    with pytest.raises(OutOfValidityError) as caught:
        user_coolant(**changes)
    assert "coolant VG 22" in str(caught.value)
    assert message in str(caught.value)


def test_names():
    assert {"iso_vg_32", "water"} <= set(COOLANTS)
    assert coolant_by_name("water").name == "water"
    with pytest.raises(OutOfValidityError, match='Did you mean "iso_vg_32"'):
        coolant_by_name("iso_vg_3")
