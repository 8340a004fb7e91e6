"""Correlations and friction: limits, refusals, known values."""

import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
from spindle_fem.physics.coolant.duct_friction import (
    channel_pressure_drop,
    friction_factor_channel,
    friction_factor_curved_laminar,
    friction_factor_helical_turbulent,
    port_loss_coefficient,
)
from spindle_fem.physics.coolant.film_models.dravid import nusselt_dravid
from spindle_fem.physics.coolant.film_models.gnielinski_helical import nusselt_gnielinski_helical
from spindle_fem.physics.coolant.film_models.janssen_hoogendoorn import nusselt_janssen_hoogendoorn
from spindle_fem.physics.coolant.film_models.manlapaz_churchill import nusselt_manlapaz_churchill
from spindle_fem.physics.coolant.film_models.paper import nusselt_paper_turbulent
from spindle_fem.physics.coolant.film_models.schmidt import nusselt_schmidt
from spindle_fem.physics.coolant.film_models.seban_mclaughlin import nusselt_seban_mclaughlin
from spindle_fem.physics.coolant.film_models.sieder_tate import nusselt_sieder_tate
from spindle_fem.physics.coolant.film_models.straight_developing import nusselt_hausen, nusselt_rectangle
from spindle_fem.physics.coolant.properties import CoolantProperties
from spindle_fem.physics.coolant.transition import (
    critical_reynolds_ito,
    critical_reynolds_schmidt,
)

CHANNEL = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
CRITICAL = float(critical_reynolds_schmidt(CHANNEL.curvature_ratio))
OIL = OilIsoVg32()

REFUSALS = [
    (nusselt_paper_turbulent, (5.0e3, 100.0), "reynolds is 5000, allowed 10000 to 120000"),
    (nusselt_paper_turbulent, (2.0e4, 562.0), "prandtl is 562, allowed 0.7 to 160"),
    (nusselt_sieder_tate, (5.0,), "graetz is 5, allowed at least 10"),
    (nusselt_sieder_tate, (50.0, 12.0), "viscosity_ratio is 12"),
    (nusselt_rectangle, (1.2,), "aspect_ratio is 1.2, allowed 0 to 1"),
    (nusselt_hausen, (-1.0, 3.0), "graetz is -1"),
    (nusselt_schmidt, (50.0, 10.0, 0.05), "reynolds is 50, allowed 100 to 22000"),
    (nusselt_schmidt, (500.0, 10.0, 0.5), "curvature_ratio is 0.5, allowed 0.012 to 0.2"),
    (nusselt_manlapaz_churchill, (-1.0, 10.0), "dean is -1"),
    (nusselt_seban_mclaughlin, (292.0, 1214.0, 0.048), "prandtl is 1214, allowed 100 to 657"),
    (
        nusselt_janssen_hoogendoorn,
        (292.0, 300.0, 0.048),
        "dean is 63.974, allowed 100 to 830",
    ),
    (nusselt_dravid, (100.0, 562.0), "prandtl is 562, allowed 5 to 175"),
    (
        nusselt_gnielinski_helical,
        (290.0, 200.0, 0.05),
        "reynolds is 290, allowed 22000 to 150000",
    ),
    (friction_factor_curved_laminar, (2500.0,), "dean is 2500, allowed 0 to 2000"),
    (friction_factor_helical_turbulent, (1000.0, 0.05), "reynolds is 1000, allowed 4500 to 100000"),
    (critical_reynolds_schmidt, (0.3,), "curvature_ratio is 0.3, allowed 0 to 0.2"),
    (critical_reynolds_ito, (0.1,), "curvature_ratio is 0.1, allowed 0.0012 to 0.067"),
]


@pytest.mark.parametrize(("correlation", "arguments", "message"), REFUSALS)
def test_refuses_outside_the_range_of_its_source(correlation, arguments, message):
    with pytest.raises(OutOfValidityError) as caught:
        correlation(*arguments)
    assert caught.value.where == correlation.__name__
    assert message in caught.value.what
    assert caught.value.how_to_fix


def test_extrapolation_must_be_asked_for():
    with pytest.raises(OutOfValidityError):
        nusselt_seban_mclaughlin(292.0, 1214.0, 0.048)
    assert float(nusselt_seban_mclaughlin(292.0, 1214.0, 0.048, extrapolate=True)) > 0.0


def test_expanded_equation_30_equals_its_dimensionless_form():
    # 0.0225 u^0.8 h^-0.2 k^0.7 rho^0.8 c^0.3 eta^-0.5
    oil = OIL.properties(313.15)
    speed, depth = 20.0, 0.019
    printed = (
        0.0225
        * speed**0.8
        * depth**-0.2
        * oil.thermal_conductivity**0.7
        * oil.density**0.8
        * oil.specific_heat_capacity**0.3
        * oil.dynamic_viscosity**-0.5
    )
    number = nusselt_paper_turbulent(speed * depth / oil.kinematic_viscosity, oil.prandtl, extrapolate=True)
    assert float(number * oil.thermal_conductivity / depth) == pytest.approx(float(printed), rel=1e-12)


def test_expanded_equation_31_equals_its_dimensionless_form():
    # 1.86 u^(1/3) (h L)^(-1/3) k^(2/3) (rho c)^(1/3)
    oil = OIL.properties(288.15)
    speed, depth, length = 2.778, 0.010, 3.552
    volumetric = oil.density * oil.specific_heat_capacity
    printed = 1.86 * np.cbrt(speed / (depth * length) * oil.thermal_conductivity**2 * volumetric)
    graetz = speed * depth / oil.kinematic_viscosity * oil.prandtl * depth / length
    number = nusselt_sieder_tate(graetz)
    assert float(number * oil.thermal_conductivity / depth) == pytest.approx(float(printed), rel=1e-12)


def test_straight_limits_of_the_curved_correlations():
    assert float(nusselt_manlapaz_churchill(0.0, 100.0)) == pytest.approx(3.657, rel=1e-12)
    assert float(friction_factor_curved_laminar(0.0)) == 1.0
    # Blasius.
    assert float(friction_factor_helical_turbulent(1.0e4, 0.0)) == pytest.approx(0.03164, rel=1e-12)


def test_gnielinski_straight_limit_is_the_petukhov_form():
    # f = 0.3164 Re^-0.25 at Re 5e4, Pr 7, by hand: f/8 = 0.0026449, Nu = 925.7/2.7369.
    assert float(nusselt_gnielinski_helical(5.0e4, 7.0, 0.0)) == pytest.approx(338.2, rel=1e-3)


def test_wall_correction_has_the_exponent_of_its_source():
    plain = nusselt_schmidt(500.0, 300.0, 0.05) - 3.66
    corrected = nusselt_schmidt(500.0, 300.0, 0.05, 2.0) - 3.66
    assert float(corrected / plain) == pytest.approx(2.0**0.14, rel=1e-12)
    ratio = nusselt_sieder_tate(500.0, 2.0) / nusselt_sieder_tate(500.0)
    assert float(ratio) == pytest.approx(2.0**0.14, rel=1e-12)


def test_gnielinski_corrects_by_the_prandtl_numbers():
    ratio = nusselt_gnielinski_helical(3e4, 50.0, 0.05, 2.0) / nusselt_gnielinski_helical(3e4, 50.0, 0.05)
    assert float(ratio) == pytest.approx(2.0**0.14, rel=1e-12)


def test_manlapaz_churchill_in_the_printed_form():
    # De 10, Pr 9.57: De² Pr = 957, so x3 = 4; x4 = 1 + 0.477/9.57.
    expected = np.cbrt((3.657 + 4.343 / 4.0) ** 3 + 1.158 * (10.0 / (1.0 + 0.477 / 9.57)) ** 1.5)
    assert float(nusselt_manlapaz_churchill(10.0, 9.57)) == pytest.approx(expected, rel=1e-12)


def test_hausen_forgets_the_inlet_far_from_it():
    assert float(nusselt_hausen(1e-6, 3.0)) == pytest.approx(3.0, abs=1e-6)


def test_white_against_mishra_and_gupta():
    # 1 + 0.033 (log10 De)^4, 1 < De < 3000: an independent fit, within a few per cent of White.
    dean = np.array([100.0, 500.0, 1000.0, 2000.0, 3000.0])
    white = friction_factor_curved_laminar(dean, extrapolate=True)
    np.testing.assert_allclose(white, 1.0 + 0.033 * np.log10(dean) ** 4, rtol=0.04)


def test_friction_of_the_channel_has_no_jump():
    for joint in (CRITICAL, 2.2e4):
        below, above = friction_factor_channel(
            [joint * (1.0 - 1e-9), joint * (1.0 + 1e-9)], CHANNEL, CRITICAL
        )
        assert above == pytest.approx(below, rel=1e-7)


def test_friction_refuses_standing_coolant():
    with pytest.raises(OutOfValidityError, match="The coolant must flow"):
        friction_factor_channel(0.0, CHANNEL, CRITICAL)


def test_pressure_drop_by_hand():
    # 20 L/min, 15 °C: f Re = 4·14.33, White 1.334 at De 64, L/D_h 325.6, 3370 Pa dynamic pressure.
    drop = channel_pressure_drop(CHANNEL, 20e-3 / 60, OIL.properties(288.15), CRITICAL)
    assert drop.channel == pytest.approx(4 * 14.33 / 292 * 1.334 * 325.6 * 3370.0, rel=5e-3)
    assert drop.ports == 0.0
    assert drop.pumping_power == pytest.approx(drop.total * 20e-3 / 60, rel=1e-12)
    assert drop.warnings == ()


def test_ports_add_their_loss_and_starts_share_the_flow():
    oil = OIL.properties(304.15)
    alone = channel_pressure_drop(CHANNEL, 10e-3 / 60, oil, CRITICAL, port_diameter=0.01, port_length=0.077)
    assert alone.ports > 0.0
    assert alone.total == alone.channel + alone.ports
    double = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0, starts=2)
    both = channel_pressure_drop(double, 20e-3 / 60, oil, CRITICAL, port_diameter=0.01, port_length=0.077)
    assert both.total == pytest.approx(alone.total, rel=1e-12)
    assert both.pumping_power == pytest.approx(2.0 * alone.pumping_power, rel=1e-12)


def test_port_loss_limits():
    # Two-constant method, fully turbulent end, 1 inch: turn 1.15·2, exit 1, entry 0.5.
    assert float(port_loss_coefficient(1e12, 0.0254, 0.0, outlet=True)) == pytest.approx(3.3, rel=1e-6)
    assert float(port_loss_coefficient(1e12, 0.0254, 0.0, outlet=False)) == pytest.approx(2.8, rel=1e-6)
    slender = port_loss_coefficient(1000.0, 0.0254, 10.0, outlet=True)
    short = port_loss_coefficient(1000.0, 0.0254, 0.0, outlet=True)
    assert float(slender - short) == pytest.approx(64.0 / 1000.0 * 10.0, rel=1e-9)


@pytest.mark.parametrize(("reynolds", "friction"), [(2300.0, 64 / 2300), (4e4, 0.3164 * 4e4**-0.25)])
def test_friction_along_a_port(reynolds, friction):
    slender = port_loss_coefficient(reynolds, 0.01, 10.0, outlet=False)
    short = port_loss_coefficient(reynolds, 0.01, 0.0, outlet=False)
    assert float(slender - short) == pytest.approx(10.0 * friction, rel=1e-9)


def test_extrapolated_friction_warns():
    deep = ChannelSection(0.108, 0.030, 0.020, 0.040, 5.0)
    critical = float(critical_reynolds_schmidt(deep.curvature_ratio))
    thin = CoolantProperties(*map(np.float64, (860.0, 3e-3, 1900.0, 0.13)))
    laminar = channel_pressure_drop(deep, 0.9 * critical * 3e-3 / 860.0 / 0.024 * 6e-4, thin, critical)
    assert laminar.reynolds == pytest.approx(0.9 * critical, rel=1e-9)
    assert [warning.code for warning in laminar.warnings] == ["coolant_friction_extrapolated"]
    assert "Dean number" in laminar.warnings[0].text
    turbulent = channel_pressure_drop(deep, 2e5 * 3e-3 / 860.0 / 0.024 * 6e-4, thin, critical)
    assert "Reynolds number is 200000" in turbulent.warnings[0].text


def test_pressure_drop_refuses_no_flow():
    with pytest.raises(OutOfValidityError, match=r"Set coolant\.flow above 0"):
        channel_pressure_drop(CHANNEL, 0.0, OIL.properties(300.0), CRITICAL)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": 0.0}, "depth is 0"),
        ({"width": -0.01}, "width is -0.01"),
        ({"turns": 0.0}, "turns is 0"),
        ({"starts": 0}, "starts is 0, allowed at least 1"),
        ({"starts": 1.5}, "starts is 1.5"),
        ({"inner_radius": np.nan}, "inner_radius is nan"),
    ],
)
def test_section_that_cannot_be(changes, message):
    values = {"inner_radius": 0.108, "depth": 0.01, "width": 0.012, "pitch": 0.024, "turns": 5.0}
    with pytest.raises(OutOfValidityError) as caught:
        ChannelSection(**(values | changes))
    assert message in str(caught.value)


def test_section_geometry():
    double = ChannelSection(0.108, 0.010, 0.012, 0.048, 2.5, starts=2)
    assert double.coil_diameter == pytest.approx(0.226)
    assert double.area == pytest.approx(1.2e-4)
    assert double.perimeter == pytest.approx(0.044)
    assert double.aspect_ratio == pytest.approx(10.0 / 12.0)
    assert double.length == pytest.approx(2.5 * np.hypot(np.pi * 0.226, 0.048))
    assert double.wetted_area == pytest.approx(2 * 0.044 * double.length)
    assert double.velocity(double.volume_flow(1.3)) == pytest.approx(1.3)
