"""What must hold for every channel: continuity, monotone in flow, closed balance."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
from spindle_fem.physics.coolant.coolants.water import Water
from spindle_fem.physics.coolant.duct_friction import channel_pressure_drop
from spindle_fem.physics.coolant.linear_march import march_maps
from spindle_fem.physics.coolant.march import DrivenChannel, FilmChoice, march_enthalpy
from spindle_fem.physics.coolant.regimes import ChannelState, critical_reynolds_schmidt, select_film

OIL = OilIsoVg32()

sections = st.builds(
    ChannelSection,
    inner_radius=st.floats(0.06, 0.2),
    depth=st.floats(0.005, 0.030),
    width=st.floats(0.006, 0.020),
    pitch=st.floats(0.023, 0.040),
    turns=st.floats(1.0, 8.0),
    starts=st.integers(1, 2),
)
celsius = st.floats(10.0, 50.0)


def flow_at(section, reynolds, temperature, coolant=OIL):
    viscosity = float(coolant.properties(temperature).kinematic_viscosity)
    return section.volume_flow(reynolds * viscosity / section.hydraulic_diameter)


@given(section=sections, temperature=celsius, coolant=st.sampled_from([OIL, Water()]))
def test_helical_film_and_pressure_drop_have_no_jump_at_either_end_of_transition(
    section, temperature, coolant
):
    kelvin = temperature + 273.15
    critical = float(critical_reynolds_schmidt(section.curvature_ratio))
    for joint, names in ((critical, ("laminar", "transition")), (2.2e4, ("transition", "turbulent"))):
        sides = []
        for side in (1.0 - 1e-9, 1.0 + 1e-9):
            flow = flow_at(section, side * joint, kelvin, coolant)
            film = select_film("helical", section, ChannelState(coolant, flow, kelvin))
            drop = channel_pressure_drop(section, flow, coolant.properties(kelvin), critical)
            sides.append((film, drop))
        (below, drop_below), (above, drop_above) = sides
        assert (below.regime, above.regime) == names
        assert above.value == pytest.approx(below.value, rel=1e-6)
        assert drop_above.total == pytest.approx(drop_below.total, rel=1e-6)


@given(
    section=sections,
    temperature=celsius,
    reynolds=st.floats(1.0, 6e4),
    factor=st.floats(1.01, 3.0),
    model=st.sampled_from(["helical", "sieder_tate"]),
    coolant=st.sampled_from([OIL, Water()]),
)
def test_more_flow_never_cools_less_nor_costs_less_pressure(
    section, temperature, reynolds, factor, model, coolant
):
    kelvin = temperature + 273.15
    critical = float(critical_reynolds_schmidt(section.curvature_ratio))
    flow = flow_at(section, reynolds, kelvin, coolant)
    films = [select_film(model, section, ChannelState(coolant, q, kelvin)) for q in (flow, factor * flow)]
    assert films[1].value > films[0].value
    drops = [
        channel_pressure_drop(section, q, coolant.properties(kelvin), critical, port_diameter=0.01)
        for q in (flow, factor * flow)
    ]
    assert drops[1].total > drops[0].total


@given(
    section=sections,
    temperature=celsius,
    wall=st.floats(10.0, 50.0),
    reynolds=st.floats(1.0, 2e5),
    model=st.sampled_from(["helical", "paper", "sieder_tate"]),
    coolant=st.sampled_from([OIL, Water()]),
)
def test_low_value_high_are_ordered_and_an_extrapolation_is_always_said(
    section, temperature, wall, reynolds, model, coolant
):
    kelvin = temperature + 273.15
    flow = flow_at(section, reynolds, kelvin, coolant)
    film = select_film(model, section, ChannelState(coolant, flow, kelvin, wall + 273.15))
    assert 0.0 < film.low <= film.value <= film.high < np.inf
    said = any(warning.code == "coolant_film_extrapolated" for warning in film.warnings)
    assert film.in_range or said


@given(temperature=st.floats(10.0, 49.99), coolant=st.sampled_from([OIL, Water()]))
def test_helical_film_is_continuous_in_temperature(temperature, coolant):
    section = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    kelvin = temperature + 273.15 + np.array([0.0, 1e-6])
    film = select_film("helical", section, ChannelState(coolant, 20e-3 / 60, kelvin))
    assert film.value[1] == pytest.approx(film.value[0], rel=1e-6)


cells = st.integers(1, 40)


@given(
    seed=st.integers(0, 2**32 - 1),
    number=cells,
    inlet=st.floats(283.0, 313.0),
    spread=st.floats(0.0, 60.0),
    mass_flow=st.floats(1e-3, 2.0),
    film=st.floats(1.0, 2e4),
    pumping=st.floats(0.0, 200.0),
)
def test_march_closes_and_obeys_the_maximum_principle(seed, number, inlet, spread, mass_flow, film, pumping):
    rng = np.random.default_rng(seed)
    wall = inlet + spread * (rng.random(number) - 0.5)
    area = 0.2 * rng.random(number)
    march = march_enthalpy(inlet, mass_flow, 1900.0, wall, area, film, pumping / number)
    assert march.imbalance_relative < 1e-12
    assert march.edge_temperature.min() >= min(inlet, wall.min()) - 1e-9
    without = march_enthalpy(inlet, mass_flow, 1900.0, wall, area, film)
    assert without.edge_temperature.max() <= max(inlet, wall.max()) + 1e-9
    maps = march_maps(mass_flow * 1900.0, area, film, pumping / number)
    scale = max(np.abs(march.heat).max(), (maps.heat_from_wall * inlet).max() * 1e-4, 1e-9)
    heat = maps.heat_from_wall @ (wall - inlet) + maps.heat_from_friction
    np.testing.assert_allclose(heat, march.heat, atol=1e-8 * scale)


@example(inlet=12.0, difference=0.03125, litres=2.0, model="helical", number=1)
@given(
    inlet=st.floats(12.0, 30.0),
    difference=st.floats(-10.0, 20.0),
    litres=st.floats(2.0, 60.0),
    model=st.sampled_from(["helical", "sieder_tate"]),
    number=cells,
)
def test_channel_march_with_local_properties_closes_for_either_sign(inlet, difference, litres, model, number):
    assume(10.5 <= inlet + difference <= 49.5 and abs(difference) > 1e-3)
    section = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    wall = np.full(number, inlet + difference + 273.15)
    area = np.full(number, 0.1562 / number)
    found = DrivenChannel(section, OIL, litres * 1e-3 / 60, inlet + 273.15, area, FilmChoice(model)).settle(
        wall
    )
    assert found.march.imbalance_relative < 1e-12
    assert np.sign(found.march.heat.sum()) == np.sign(difference)
