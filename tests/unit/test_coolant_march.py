"""Enthalpy march against exact solutions of plug flow along a wall."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
from spindle_fem.physics.coolant.coolants.water import Water
from spindle_fem.physics.coolant.linear_march import MarchMaps, march_maps, outlet_stretch
from spindle_fem.physics.coolant.march import DrivenChannel, FilmChoice, march_enthalpy

CHANNEL = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
OIL = OilIsoVg32()
FLOW = 20e-3 / 60.0
INLET = 288.15


@pytest.mark.parametrize("wall", [300.0, 280.0])
@pytest.mark.parametrize("cells", [1, 7, 200])
@pytest.mark.parametrize("film", [1e-9, 250.0, 1e5])
def test_uniform_wall_is_exact_for_any_number_of_cells(wall, cells, film):
    mass_flow, capacity, area = 0.29, 1858.0, 0.1562
    march = march_enthalpy(
        INLET, mass_flow, capacity, np.full(cells, wall), np.full(cells, area / cells), film
    )
    units = film * area / (mass_flow * capacity)
    rise = (wall - INLET) * -np.expm1(-units)
    assert march.outlet_temperature - INLET == pytest.approx(rise, rel=1e-10, abs=1e-13)
    edges = INLET + (wall - INLET) * -np.expm1(-units * np.arange(cells + 1) / cells)
    np.testing.assert_allclose(march.edge_temperature, edges, rtol=0.0, atol=1e-11)
    assert march.heat.sum() == pytest.approx(mass_flow * capacity * rise, rel=1e-10)
    assert march.imbalance_relative < 1e-12


def test_uniform_heat_flux_gives_a_straight_line():
    # A wall that keeps its distance to the coolant: T_wall = T_in + q/h + q A x/(m c).
    mass_flow, capacity, area, film, flux, cells = 0.29, 1858.0, 0.1562, 250.0, 5000.0, 400
    middle = (np.arange(cells) + 0.5) / cells
    slope = flux * area / (mass_flow * capacity)
    march = march_enthalpy(
        INLET, mass_flow, capacity, INLET + flux / film + slope * middle, np.full(cells, area / cells), film
    )
    assert march.outlet_temperature - INLET == pytest.approx(slope, rel=1e-5)
    np.testing.assert_allclose(march.heat, flux * area / cells, rtol=2e-3)


def test_friction_heat_alone_warms_an_adiabatic_channel():
    march = march_enthalpy(INLET, 0.3, 2000.0, [350.0] * 4, [0.04] * 4, 0.0, [10.0, 20.0, 30.0, 40.0])
    np.testing.assert_allclose(
        march.edge_temperature - INLET, np.array([0, 10, 30, 60, 100]) / 600.0, atol=1e-12
    )
    np.testing.assert_allclose(march.heat, 0.0, atol=1e-12)
    # Linear profile: the mean is half way.
    np.testing.assert_allclose(march.bulk_temperature - INLET, np.array([5, 20, 45, 80]) / 600.0, atol=1e-12)


def test_friction_heat_and_wall_together_against_a_fine_integration():
    mass_flow, capacity, film, area, pumping, wall = 0.05, 1900.0, 900.0, 0.16, 150.0, 320.0

    def slope(_, temperature):
        return (film * area * (wall - temperature) + pumping) / (mass_flow * capacity)

    exact = solve_ivp(slope, (0.0, 1.0), [INLET], rtol=1e-11, atol=1e-11).y[0, -1]
    march = march_enthalpy(INLET, mass_flow, capacity, [wall] * 3, [area / 3] * 3, film, [pumping / 3] * 3)
    assert float(march.outlet_temperature) == pytest.approx(exact, abs=1e-8)
    assert march.imbalance_relative < 1e-12


@pytest.mark.parametrize("film", [1e-6, 30.0, 250.0, 1e4])
def test_bulk_temperature_is_the_one_that_carries_the_heat(film):
    wall, area = np.array([300.0, 295.0, 280.0, 310.0]), np.array([0.01, 0.04, 0.02, 0.05])
    march = march_enthalpy(INLET, 0.1, 1900.0, wall, area, film, 5.0)
    np.testing.assert_allclose(
        march.heat, film * area * (wall - march.bulk_temperature), rtol=1e-9, atol=1e-12
    )


def test_small_number_of_transfer_units_joins_its_series():
    # The series takes over at 0.01 transfer units: no step there.
    units = 0.01 * np.array([1.0 - 1e-9, 1.0 + 1e-9])
    found = [
        march_enthalpy(INLET, 1.0, 1000.0, [300.0], [n], 1000.0, [50.0]).bulk_temperature[0] for n in units
    ]
    assert found[0] - INLET == pytest.approx(found[1] - INLET, rel=1e-7)


def test_parallel_starts_are_independent_and_mix():
    wall = np.array([[300.0, 305.0], [290.0, 280.0]])
    area = np.full((2, 2), 0.04)
    march = march_enthalpy(INLET, 0.15, 1900.0, wall, area, 250.0)
    for start in range(2):
        alone = march_enthalpy(INLET, 0.15, 1900.0, wall[start], area[start], 250.0)
        np.testing.assert_allclose(march.heat[start], alone.heat, rtol=1e-13)
        assert march.outlet_temperature[start] == alone.outlet_temperature
    assert march.mixed_outlet_temperature == pytest.approx(march.outlet_temperature.mean())
    assert march.imbalance_relative < 1e-12


@pytest.mark.parametrize("properties_at", ["inlet", "local"])
def test_outlets_over_many_walls_are_those_of_each(properties_at):
    section = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0, starts=2)
    walls = INLET + np.random.default_rng(1).uniform(2.0, 25.0, size=(7, 2, 6))
    choice = FilmChoice("sieder_tate", properties_at, 0.8)
    channel = DrivenChannel(section, OIL, FLOW, INLET, np.full(6, 0.026), choice, 30.0)
    each = [channel.settle(wall).march.mixed_outlet_temperature for wall in walls]
    np.testing.assert_allclose(channel.outlets(walls), each, rtol=0.0, atol=1e-7)
    assert np.ptp(each) > 0.01


@pytest.mark.parametrize("shape", [(5,), (2, 6)])
def test_maps_give_heat_bulk_and_outlet_of_the_march(shape):
    rng = np.random.default_rng(5)
    wall, area = 290.0 + 20.0 * rng.random(shape), 0.01 + 0.03 * rng.random(shape)
    film, pumping = 100.0 + 900.0 * rng.random(shape), 10.0 * rng.random(shape)
    maps = march_maps(0.05 * 1900.0, area, film, pumping)
    march = march_enthalpy(INLET, 0.05, 1900.0, wall, area, film, pumping)
    heat = np.einsum("...ij,...j->...i", maps.heat_from_wall, wall - INLET) + maps.heat_from_friction
    np.testing.assert_allclose(heat, march.heat, rtol=1e-10)
    assert (np.triu(maps.heat_from_wall, k=1) == 0.0).all()
    # A warmer wall upstream leaves less for the cells downstream.
    assert (np.tril(maps.heat_from_wall, k=-1) <= 0.0).all()
    bulk = np.einsum("...ij,...j->...i", maps.bulk_from_wall, wall)
    bulk += INLET * maps.bulk_from_inlet + maps.bulk_from_friction
    np.testing.assert_allclose(bulk, march.bulk_temperature, rtol=1e-13)
    outlet = (maps.outlet_from_wall * wall).sum(axis=-1)
    outlet += INLET * maps.outlet_from_inlet + maps.outlet_from_friction
    np.testing.assert_allclose(outlet, march.outlet_temperature, rtol=1e-13)


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_maps_take_complex_films_for_their_derivative(scale):
    area, film = np.array([0.01, 0.03, 0.02]), scale * np.array([200.0, 600.0, 400.0])
    step, difference = 1e-30, 1e-6
    by_step = march_maps(95.0, area, film * (1.0 + 1j * step), 4.0)
    above, below = (march_maps(95.0, area, film * factor, 4.0) for factor in (1 + difference, 1 - difference))
    for name in MarchMaps.__slots__:
        central = (getattr(above, name) - getattr(below, name)) / (2.0 * difference)
        exact = np.imag(getattr(by_step, name)) / step
        np.testing.assert_allclose(exact, central, rtol=1e-6, atol=1e-9)


def test_a_cell_counted_from_its_outlet_takes_the_same_heat():
    march = march_enthalpy(INLET, 0.05, 1900.0, [310.0], [0.04], [800.0])
    units = np.array([800.0 * 0.04 / 95.0])
    stretch, slope = outlet_stretch(units)
    heat = stretch * 800.0 * 0.04 * (310.0 - march.outlet_temperature)
    assert heat == pytest.approx(march.heat, rel=1e-13)
    above, below = outlet_stretch(units + 1e-6)[0], outlet_stretch(units - 1e-6)[0]
    assert slope == pytest.approx((above - below) / 2e-6, rel=1e-8)


def test_results_are_frozen():
    march = march_enthalpy(INLET, 0.3, 1900.0, [300.0], [0.1], 250.0)
    with pytest.raises(ValueError, match="read-only"):
        march.heat[0] = 0.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass_flow": 0.0}, "mass_flow is 0, allowed above 0"),
        ({"wetted_area": [0.1, -0.1]}, "wetted_area is -0.1"),
        ({"film_coefficient": [np.nan, 1.0]}, "film_coefficient is nan"),
        ({"specific_heat_capacity": -1900.0}, "specific_heat_capacity is -1900"),
        ({"wall_temperature": [-5.0, 300.0]}, "wall_temperature is -5"),
    ],
)
def test_march_refuses(changes, message):
    values = {
        "inlet_temperature": INLET,
        "mass_flow": 0.3,
        "specific_heat_capacity": 1900.0,
        "wall_temperature": [300.0, 301.0],
        "wetted_area": [0.1, 0.1],
        "film_coefficient": 250.0,
    }
    with pytest.raises(OutOfValidityError) as caught:
        march_enthalpy(**(values | changes))
    assert message in str(caught.value)


class TestDrivenChannel:
    WALL = np.linspace(292.0, 300.0, 30)
    AREA = np.full(30, 0.1562 / 30)

    def march(self, **changes):
        options = {"model": "sieder_tate", "properties_at": "inlet"} | changes
        coolant, power = options.pop("coolant", OIL), options.pop("pumping_power", 0.0)
        choice = FilmChoice(**options)
        return DrivenChannel(CHANNEL, coolant, FLOW, INLET, self.AREA, choice, power).settle(self.WALL)

    def test_inlet_properties_are_those_of_the_recorded_machine(self):
        # h = 243 W/(m²K) everywhere, mass flow from the density at the inlet.
        found = self.march()
        assert found.film.value == pytest.approx(243.0, rel=5e-3)
        assert found.mass_flow == pytest.approx(FLOW * 873.3, rel=1e-4)
        units = found.film.value * 0.1562 / (found.mass_flow * 1857.63)
        choice = FilmChoice("sieder_tate", "inlet")
        uniform = DrivenChannel(CHANNEL, OIL, FLOW, INLET, self.AREA, choice).settle(np.full(30, 300.0))
        exact = INLET + (300.0 - INLET) * -np.expm1(-units)
        assert uniform.march.mixed_outlet_temperature == pytest.approx(exact, abs=1e-4)

    @pytest.mark.parametrize("coolant", [OIL, Water()], ids=lambda fluid: fluid.name)
    @pytest.mark.parametrize("model", ["helical", "paper", "sieder_tate"])
    def test_local_properties_close_the_coolants_own_enthalpy(self, coolant, model):
        found = self.march(coolant=coolant, model=model, properties_at="local")
        edges = found.march.edge_temperature
        enthalpy = coolant.specific_enthalpy(edges[[0, -1]])
        taken = found.march.heat.sum()
        assert taken == pytest.approx(found.mass_flow * (enthalpy[1] - enthalpy[0]), rel=1e-12)
        assert found.march.imbalance_relative < 1e-12
        # Film and heat capacity are those of the final temperatures.
        again = coolant.properties(0.5 * (edges[1:] + edges[:-1])).specific_heat_capacity
        np.testing.assert_allclose(found.march.specific_heat_capacity, again, rtol=1e-6)
        heat = found.film.value * self.AREA * (self.WALL - found.march.bulk_temperature)
        np.testing.assert_allclose(found.march.heat, heat, rtol=1e-8)

    def test_warming_oil_changes_the_local_film(self):
        local = self.march(properties_at="local", model="helical")
        assert local.film.value.shape == (30,)
        assert local.film.value[-1] > local.film.value[0]

    def test_film_factor_scales_the_film(self):
        plain, fouled = self.march(), self.march(factor=0.5)
        direct = march_enthalpy(
            INLET,
            plain.mass_flow,
            plain.march.specific_heat_capacity,
            self.WALL,
            self.AREA,
            0.5 * plain.film.value,
        )
        np.testing.assert_allclose(fouled.march.heat, direct.heat, rtol=1e-13)

    def test_pumping_power_is_all_found_again(self):
        found = self.march(pumping_power=60.0, properties_at="local")
        assert found.march.pumping_heat.sum() == pytest.approx(60.0, rel=1e-12)
        assert found.march.imbalance_relative < 1e-12

    def test_two_starts_share_flow_and_pumping_power(self):
        double = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0, starts=2)
        wall, area = np.stack([self.WALL, self.WALL]), np.stack([self.AREA, self.AREA])
        both = DrivenChannel(double, OIL, 2 * FLOW, INLET, area, pumping_power=80.0).settle(wall)
        one = DrivenChannel(CHANNEL, OIL, FLOW, INLET, self.AREA, pumping_power=40.0).settle(self.WALL)
        assert both.mass_flow == pytest.approx(one.mass_flow, rel=1e-14)
        np.testing.assert_allclose(both.march.heat[1], one.march.heat, rtol=1e-12)
        assert both.march.pumping_heat.sum() == pytest.approx(80.0, rel=1e-12)
        assert both.march.mixed_outlet_temperature == pytest.approx(
            one.march.mixed_outlet_temperature, abs=1e-9
        )
        # One start given stands for both and reports its own share.
        twin = DrivenChannel(double, OIL, 2 * FLOW, INLET, self.AREA, pumping_power=80.0).settle(self.WALL)
        assert twin.march.pumping_heat.sum() == pytest.approx(40.0, rel=1e-12)

    def test_unequal_starts_mix_by_enthalpy(self):
        double = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0, starts=2)
        wall, area = np.stack([self.WALL, self.WALL + 20.0]), np.stack([self.AREA, self.AREA])
        found = DrivenChannel(double, OIL, 0.2 * FLOW, INLET, area).settle(wall)
        mixed = OIL.specific_enthalpy(found.march.mixed_outlet_temperature)
        assert float(mixed) == pytest.approx(
            OIL.specific_enthalpy(found.march.outlet_temperature).mean(), rel=1e-13
        )

    def test_walls_of_a_wrong_number_of_starts(self):
        wall, area = np.tile(self.WALL, (3, 1)), np.tile(self.AREA, (3, 1))
        with pytest.raises(OutOfValidityError, match="walls of 3 starts are given, the channel has 1"):
            DrivenChannel(CHANNEL, OIL, FLOW, INLET, area).settle(wall)

    def test_unknown_option(self):
        with pytest.raises(OutOfValidityError, match='Did you mean "inlet"'):
            self.march(properties_at="inlets")


@pytest.mark.parametrize("properties_at", ["local", "inlet"])
def test_the_bounds_of_a_march_are_those_of_a_settled_one(properties_at):
    """A march leaves them out: who needs a band asks for it."""
    choice = FilmChoice("helical", properties_at)
    channel = DrivenChannel(CHANNEL, OIL, FLOW, INLET, [0.1562 / 20] * 20, choice)
    wall = np.full(20, 295.0)
    settled = channel.settle(wall)
    plain = channel.settle(wall, bounds=False)
    assert np.all(np.asarray(plain.film.low) == plain.film.value)
    found = channel.with_bounds(wall, plain).film
    for end in ("low", "value", "high"):
        own, whole = (np.asarray(getattr(film, end)) for film in (found, settled.film))
        assert own == pytest.approx(whole, rel=1e-3)
    assert np.all(np.asarray(found.low) < found.value)
    assert np.all(np.asarray(found.value) < found.high)
