"""Friction of an analytical heat model as a map, against the model itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.term import TermContext
from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.loads.bearing_heat import BearingMechanics
from spindle_fem.loads.operating_point import OperatingPoint
from spindle_fem.reduced.drive import heat_of_table
from spindle_fem.reduced.film_heat import FilmHeat, tabulate_friction, tabulated_machine
from spindle_fem.spec.load import load_machine

RPM = np.pi / 30.0
THRUSTS = (900.0, 1750.0)


@pytest.fixture(scope="module")
def spec():
    return load_machine("wu_tan_2016")


@pytest.fixture(scope="module")
def friction(spec):
    return tabulate_friction(spec, 4500.0 * RPM, THRUSTS)


@pytest.fixture(scope="module")
def table(spec, friction):
    return tabulated_machine(spec, friction)


def context(term, temperatures, *, speed=3000.0 * RPM, thrust=1750.0):
    """A context with one column a temperature."""
    columns = np.asarray(temperatures, dtype=complex)
    return TermContext(0.0, {"speed": speed, "thrust": thrust}, columns, np.zeros((0, columns.shape[1])), {})


@pytest.mark.parametrize(
    ("speed", "celsius"), [(400.0, 15.0), (1500.0, 33.0), (3000.0, 61.0), (4200.0, 88.0)]
)
def test_the_map_is_the_heat_model_between_its_points(spec, friction, speed, celsius):
    given = OperatingPoint.of(spec)
    point = OperatingPoint(
        speed * RPM,
        1750.0,
        given.ambient_temperature,
        given.coolant_inlet_temperature,
        given.coolant_flow,
    )
    exact = BearingMechanics(spec).over_film_temperature(point, [celsius + 273.15])
    kelvin = np.full(len(friction.bearings), celsius + 273.15)
    found = friction.heat(point.speed, 1750.0, kelvin)
    conductance = np.exp(friction.log_conductance(point.speed, 1750.0, kelvin[:, None]))[:, :, 0]
    for row, name in enumerate(friction.bearings):
        assert found[row] == pytest.approx(exact[name].heat[0], rel=2e-3)
        assert conductance[row, 0] == pytest.approx(exact[name].conductance_inner[0], rel=1e-3)
        assert conductance[row, 1] == pytest.approx(exact[name].conductance_outer[0], rel=1e-3)


def test_table_and_term_together_are_the_map(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    film = 273.15 + np.linspace(20.0, 50.0, len(friction.bearings))
    for speed, thrust in ((700.0 * RPM, 1750.0), (3900.0 * RPM, 1200.0)):
        factor = term.friction(context(term, np.repeat(film, 3)[:, None], speed=speed, thrust=thrust))
        tabulated = heat_of_table(table, np.array([speed]), np.array([thrust]))[0]
        assert factor[:, 0].real * tabulated == pytest.approx(friction.heat(speed, thrust, film), rel=1e-9)
    assert term.friction(context(term, np.repeat(film, 3)[:, None], speed=0.0)).tolist() == [[1.0]] * 5


def test_the_film_has_a_quarter_of_each_raceway_and_half_of_the_balls(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    uneven = np.tile([310.0, 306.0, 302.0], len(friction.bearings))[:, None]
    even = np.full_like(uneven, 305.0)
    assert term.friction(context(term, uneven)) == pytest.approx(term.friction(context(term, even)))


def test_ball_rows_conduct_as_the_map_says_and_keep_their_heat(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    uneven = np.tile([320.0, 316.0, 330.0], len(friction.bearings))[:, None]
    film = np.full((len(friction.bearings), 1), 0.25 * (320.0 + 316.0) + 0.5 * 330.0)
    speed, thrust = 2500.0 * RPM, 1750.0
    more = term.heat(context(term, uneven, speed=speed)).reshape(-1, 3).real
    assert more.sum(axis=1) == pytest.approx(0.0, abs=1e-12)
    factors = term.operating_factor(SimpleNamespace(speed=speed, thrust=thrust), {})
    exact = np.exp(friction.log_conductance(speed, thrust, film))[:, :, 0]
    for row, (name, (group, _)) in enumerate(zip(friction.bearings, table.bearings, strict=True)):
        for side, (word, raceway) in enumerate((("inner", 320.0), ("outer", 316.0))):
            linear = group.ball_row.conductance.value * factors[f"balls.{name}.{word}"] * (330.0 - raceway)
            assert linear + more[row, side] == pytest.approx(exact[row, side] * (330.0 - raceway), rel=1e-9)


def test_derivatives_by_complex_steps_are_those_of_differences(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    # Inside the map, and beyond either end of it.
    for kelvin in (262.0, 305.0, 372.0):
        columns = np.full((len(term.reads), 3), kelvin, dtype=complex)
        columns[:, 0] += 1e-30j
        columns[:, 1] += 1e-3
        columns[:, 2] -= 1e-3
        found = term.friction(context(term, columns))
        differences = (found[:, 1].real - found[:, 2].real) / 2e-3
        assert found[:, 0].imag / 1e-30 == pytest.approx(differences, rel=1e-5)


def test_the_map_goes_on_without_a_jump_at_its_ends(friction):
    for end in (278.15, 368.15):
        kelvin = np.full((len(friction.bearings), 2), end)
        kelvin[:, 0] -= 1e-6
        kelvin[:, 1] += 1e-6
        low, high = friction.log_moment(300.0, 1750.0, kelvin).T
        assert low == pytest.approx(high, abs=1e-6)


def test_what_no_map_can_hold_is_refused(spec, friction):
    with pytest.raises(SpecError, match=r"heat.model: the heat is given by table already"):
        tabulate_friction(load_machine("recorded_spindle"), 400.0, THRUSTS)
    follows = spec.model_copy(update={"heat": spec.heat.model_copy(update={"thermal_preload": True})})
    with pytest.raises(SpecError, match=r"heat.thermal_preload: with it heat follows every ring"):
        tabulate_friction(follows, 400.0, THRUSTS)
    film = np.full(len(friction.bearings), 300.0)
    with pytest.raises(OutOfValidityError, match=r"friction map: speed: 600 is outside 0 to 471"):
        friction.heat(600.0, 1750.0, film)
    with pytest.raises(OutOfValidityError, match=r"friction map: thrust: 100 is outside 900 to 1750"):
        friction.heat(300.0, 100.0, film)
