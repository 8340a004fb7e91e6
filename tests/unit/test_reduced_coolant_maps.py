"""The march in reduced coordinates against the march itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.model.reduced.coolant_maps import UniformFilmMaps, coolant_maps, film_derivative
from spindle_fem.physics.coolant.march import march_enthalpy


def walls_as_unknowns(starts, cells, seed=0):
    """A model whose unknowns are the wall temperatures of the cells themselves."""
    area = np.random.default_rng(seed).uniform(0.002, 0.004, (starts, cells))
    film = np.zeros((area.size, area.size, area.size))
    film[np.arange(area.size), np.arange(area.size), np.arange(area.size)] = area.ravel()
    return SimpleNamespace(cell_area=area, cell_load=np.diag(area.ravel()), cell_film=film)


@pytest.mark.parametrize("starts", [1, 2])
@pytest.mark.parametrize("pumping", [0.0, 30.0])
@pytest.mark.parametrize("film", [243.0, 5.0e4, 1.0e-6])
def test_heat_and_outlet_are_those_of_the_enthalpy_march(starts, pumping, film):
    model = walls_as_unknowns(starts, 20)
    rng = np.random.default_rng(1)
    films = film * rng.uniform(0.8, 1.2, model.cell_area.size)
    wall = rng.uniform(290.0, 320.0, model.cell_area.shape)
    share = pumping / starts * model.cell_area / model.cell_area.sum(axis=-1, keepdims=True)
    exact = march_enthalpy(288.15, 0.3, 1860.0, wall, model.cell_area, films.reshape(wall.shape), share)
    maps = coolant_maps(model, films, 0.3 * 1860.0, pumping)
    heat = maps.conduction @ wall.ravel() - maps.inlet_load * 288.15 - maps.constant_load
    assert heat == pytest.approx(exact.heat.ravel(), abs=1e-9)
    outlet = maps.outlet @ wall.ravel() + maps.outlet_inlet * 288.15 + maps.outlet_constant
    assert outlet == pytest.approx(exact.mixed_outlet_temperature, abs=1e-10)


def test_wall_and_coolant_of_one_temperature_exchange_nothing():
    model = walls_as_unknowns(1, 30)
    maps = coolant_maps(model, np.full(30, 400.0), 500.0)
    assert maps.conduction @ np.ones(30) == pytest.approx(maps.inlet_load, abs=1e-13)
    assert maps.outlet.sum() + maps.outlet_inlet == pytest.approx(1.0, abs=1e-13)


NAMES = ("conduction", "inlet_load", "constant_load", "outlet", "outlet_inlet", "outlet_constant")


def test_derivatives_are_those_of_differences():
    model = walls_as_unknowns(2, 8)
    film, step = np.full(16, 300.0), 1e-5
    ends = [coolant_maps(model, film * (1 + sign * step), 560.0, 10.0) for sign in (1, -1)]
    by_film = film_derivative(model, film, 560.0, 10.0)
    for name in NAMES:
        difference = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * step)
        assert getattr(by_film, name) == pytest.approx(difference, abs=1e-7)


@pytest.mark.parametrize("film", [100.0, 243.7, 4.0e3])
@pytest.mark.parametrize("rate", [40.0, 560.0])
def test_uniform_films_are_interpolated_as_they_are_worked_out(film, rate):
    model = walls_as_unknowns(2, 8)
    table, films = UniformFilmMaps(model), np.full(16, film)
    for exact, quick in (
        (coolant_maps(model, films, rate, 12.0), table.maps(film, rate, 12.0)),
        (film_derivative(model, films, rate, 12.0), table.film_derivative(film, rate, 12.0)),
    ):
        for name in NAMES:
            size = np.abs(getattr(exact, name)).max()
            assert np.abs(getattr(quick, name) - getattr(exact, name)).max() <= 1e-8 * size, name
