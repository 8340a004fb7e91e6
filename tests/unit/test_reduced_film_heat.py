"""Friction of an analytical heat model as a map, against the model itself."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError, SpecError
from spindle_fem.inference import followed_model
from spindle_fem.model.reduced.drive import with_walls
from spindle_fem.model.reduced.film_heat import FilmHeat, operators_machine, tabulated_machine
from spindle_fem.model.reduced.followed_preload import MountedRun
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.bearing_heat import BearingMechanics, heat_of_table
from spindle_fem.operation.friction_map import CONDUCTANCES, MOMENT, tabulate_friction, thrusts_between
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.units import Uncertain
from tests.support.lumped_spindle import drive_of, lumped_model

RPM = np.pi / 30.0
THRUSTS = (875.0, 1312.5, 1750.0)


@pytest.fixture(scope="module")
def spec():
    return load_machine("wu_tan_2016")


@pytest.fixture(scope="module")
def factors(spec):
    """On the friction heat of every bearing."""
    return np.array([group.heat_factor.value for group, _ in spec.bearings])


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
    ("speed", "celsius", "thrust"),
    [(400.0, 15.0, 1750.0), (1500.0, 33.0, 1530.0), (3000.0, 61.0, 1750.0), (4200.0, 88.0, 1090.0)],
)
def test_the_map_is_the_heat_model_between_its_points(spec, factors, friction, speed, celsius, thrust):
    given = OperatingPoint.of(spec)
    point = OperatingPoint(
        speed * RPM,
        thrust,
        given.ambient_temperature,
        given.coolant_inlet_temperature,
        given.coolant_flow,
    )
    exact = BearingMechanics(spec).over_film_temperature(point, [celsius + 273.15])
    kelvin = np.full(len(friction.bearings), celsius + 273.15)
    found = factors * friction.heat(point.speed, thrust, kelvin)
    conductance = np.exp(friction.at(point.speed, thrust).at(kelvin[:, None], CONDUCTANCES))[:, :, 0]
    for row, name in enumerate(friction.bearings):
        assert found[row] == pytest.approx(exact[name].heat[0], rel=2e-3)
        assert conductance[row, 0] == pytest.approx(exact[name].conductance_inner[0], rel=1e-3)
        assert conductance[row, 1] == pytest.approx(exact[name].conductance_outer[0], rel=1e-3)


@pytest.mark.parametrize(("rpm", "within"), [(0.0, 1e-3), (1e-6, 1e-3), (30.0, 2e-3), (90.0, 1e-3)])
def test_balls_lose_their_lubricant_as_the_spindle_stops(spec, friction, rpm, within):
    """Down to standstill, where only the contacts conduct."""
    given, celsius = OperatingPoint.of(spec), 40.0
    exact = BearingMechanics(spec).over_film_temperature(
        replace(given, speed=rpm * RPM, thrust=1500.0), [celsius + 273.15]
    )
    kelvin = np.full((len(friction.bearings), 1), celsius + 273.15)
    found = np.exp(friction.at(rpm * RPM, 1500.0).at(kelvin, CONDUCTANCES))[:, :, 0]
    turning = np.exp(friction.at(90.0 * RPM, 1500.0).at(kelvin, CONDUCTANCES))[:, :, 0]
    for row, name in enumerate(friction.bearings):
        assert found[row, 0] == pytest.approx(exact[name].conductance_inner[0], rel=within)
        assert found[row, 1] == pytest.approx(exact[name].conductance_outer[0], rel=within)
    if rpm < 1.0:
        assert np.all(found < 0.95 * turning)


def test_table_and_term_together_are_the_map(spec, factors, friction, table):
    term = FilmHeat(friction, spec, table)
    film = 273.15 + np.linspace(20.0, 50.0, len(friction.bearings))
    for speed, thrust in ((700.0 * RPM, 1750.0), (3900.0 * RPM, 1200.0)):
        factor = term.friction(context(term, np.repeat(film, 3)[:, None], speed=speed, thrust=thrust))
        tabulated = heat_of_table(table, np.array([speed]), np.array([thrust]))[0]
        expected = factors * friction.heat(speed, thrust, film)
        assert factor[:, 0].real * tabulated == pytest.approx(expected, rel=1e-9)
    assert term.friction(context(term, np.repeat(film, 3)[:, None], speed=0.0)).tolist() == [[1.0]] * 5


def test_many_instants_are_those_one_by_one(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    warm = 303.15 + np.random.default_rng(1).uniform(0.0, 20.0, (3 * len(friction.bearings), 6))
    speeds = RPM * np.array([0.0, 900.0, 3000.0, 900.0, 0.0, 900.0])
    thrusts = np.array([1750.0] * 5 + [1200.0])
    together = context(term, warm, speed=speeds, thrust=thrusts)
    for answer in (term.friction, term.heat):
        alone = [
            answer(context(term, warm[:, [i]], speed=speeds[i], thrust=thrusts[i]))[:, 0] for i in range(6)
        ]
        assert answer(together) == pytest.approx(np.array(alone).T, rel=1e-12)


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
    exact = np.exp(friction.at(speed, thrust).at(film, CONDUCTANCES))[:, :, 0]
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
        low, high = friction.at(300.0, 1750.0).at(kelvin, MOMENT)[:, 0].T
        assert low == pytest.approx(high, abs=1e-6)


def test_what_no_map_can_hold_is_refused(spec, friction):
    with pytest.raises(SpecError, match=r"heat.model: the heat is given by table already"):
        tabulate_friction(load_machine("recorded_spindle"), 400.0, THRUSTS)
    follows = spec.model_copy(update={"heat": spec.heat.model_copy(update={"thermal_preload": True})})
    with pytest.raises(
        SpecError,
        match=r"heat.thermal_preload: with it heat follows every ring.*--set heat.thermal_preload=false",
    ):
        tabulate_friction(follows, 400.0, THRUSTS)
    film = np.full(len(friction.bearings), 300.0)
    with pytest.raises(OutOfValidityError, match=r"speed: 5729.58 rpm is outside 0 to 4500 rpm"):
        friction.heat(600.0, 1750.0, film)
    with pytest.raises(OutOfValidityError, match=r"thrust: 100 N is outside 875 to 1750 N.* recording"):
        friction.heat(300.0, 100.0, film)


def test_bearings_that_cannot_be_tabulated_are_refused_with_their_state(spec, monkeypatch):
    def refuse(self, point, kelvin):
        raise NoEquilibriumError("F1", "gross sliding.", "Raise preload.")

    monkeypatch.setattr(BearingMechanics, "over_film_temperature", refuse)
    words = r"gross sliding\. .* near 4 rpm, 875 N of thrust and a film of 5 °C, at the size of assembly"
    with pytest.raises(NoEquilibriumError, match=words):
        tabulate_friction(spec, 4500.0 * RPM, THRUSTS)


@pytest.fixture(scope="module")
def with_cold_states_refused(spec):
    """The map of bearings that slide in films below 15 °C at 300 to 400 rpm, and at 200 rpm in any."""
    solve = BearingMechanics.over_film_temperature

    def slide(self, point, kelvin):
        rpm = point.speed / RPM
        if (300.0 < rpm < 400.0 and np.min(kelvin) < 288.15) or 150.0 < rpm < 200.0:
            raise NoEquilibriumError("F1", "gross sliding.", "Raise preload.")
        return solve(self, point, kelvin)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BearingMechanics, "over_film_temperature", slide)
        return tabulate_friction(spec, 4500.0 * RPM, [1750.0])


def test_a_map_lacks_states_that_the_bearings_have_not_and_is_right_beside_them(
    friction, with_cold_states_refused
):
    """Of a map to 4500 rpm 180 and 360 rpm are two of its speeds."""
    holed = with_cold_states_refused
    assert {round(holed.speed[row] / RPM) for row, _, _ in holed.refused} == {180, 360}
    assert {film for row, _, film in holed.refused if holed.speed[row] > 200.0 * RPM} == {0, 1, 2}
    for rpm, celsius, within in ((360.0, 40.0, 2e-3), (600.0, 8.0, 5e-3), (90.0, 8.0, 1e-9)):
        film = np.full(len(friction.bearings), celsius + 273.15)
        expected = friction.heat(rpm * RPM, 1750.0, film)
        assert holed.heat(rpm * RPM, 1750.0, film) == pytest.approx(expected, rel=within)


@pytest.mark.parametrize(
    ("rpm", "coldest", "state"),
    [
        (360.0, 10.0, "360 rpm, 1750 N of thrust and a film of 8 °C"),
        (300.0, 60.0, "180 rpm, 1750 N of thrust and a film of 44 °C"),
        (360.0, 30.0, None),
        (0.0, 8.0, None),
        (80.0, 8.0, None),
    ],
)
def test_only_a_run_that_comes_to_a_state_without_equilibrium_is_refused(
    with_cold_states_refused, rpm, coldest, state
):
    films = np.full((len(with_cold_states_refused.bearings), 3), 323.15)
    films[1, 2] = coldest + 273.15
    speed, thrust = np.array([3000.0, 2000.0, rpm]) * RPM, np.full(3, 1750.0)
    if state is None:
        with_cold_states_refused.require_solved(speed, thrust, films)
        return
    with pytest.raises(NoEquilibriumError, match=f"gross sliding.*near {state}, at the size of assembly"):
        with_cold_states_refused.require_solved(speed, thrust, films)


@pytest.mark.parametrize("speed", [360.0 * RPM, 3000.0 * RPM])
def test_a_recording_is_refused_where_its_run_comes_to_such_a_state(
    spec, with_cold_states_refused, monkeypatch, speed
):
    holed = with_cold_states_refused
    term = FilmHeat(holed, spec, tabulated_machine(spec, holed))
    fast = SimpleNamespace(
        inputs=SimpleNamespace(extra_terms=(term,)), model=SimpleNamespace(place=lambda name: np.ones(1))
    )
    cold_then_warm = MountedRun(
        np.zeros(2), np.array([[283.15], [323.15]]), np.array([speed, 3000.0 * RPM]), np.full(2, 1750.0)
    )
    monkeypatch.setattr(followed_model, "Predictor", lambda *given, **named: None)
    monkeypatch.setattr(followed_model, "_run", lambda predictor, number, factors: cold_then_warm)
    if speed > 1000.0 * RPM:
        followed_model.require_solved_friction(fast, [None], None)
        return
    with pytest.raises(NoEquilibriumError, match="near 360 rpm, 1750 N of thrust and a film of 8 °C"):
        followed_model.require_solved_friction(fast, [None], None)
    # Bearings that follow expansion have states of their own.
    term.preload = object()
    followed_model.require_solved_friction(fast, [None], None)


def test_tables_of_a_map_are_given_where_it_is_whole(friction, with_cold_states_refused):
    friction.require_complete()
    with pytest.raises(NoEquilibriumError, match="gross sliding"):
        with_cold_states_refused.require_complete()


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (1750.0, 1750.0, (1750.0,)),
        (0.0, 1750.0, (0.0, 875.0, 1750.0)),
        (1745.0, 1760.0, (1745.0, 1750.0, 1760.0)),
        (500.0, 3000.0, (500.0, 1750.0, 3000.0)),
        (3000.0, 3000.0, (1750.0, 2375.0, 3000.0)),
    ],
)
def test_thrusts_of_a_map_cover_those_that_occur_and_the_definition(spec, low, high, expected):
    assert thrusts_between(spec, low, high) == expected


def test_heat_by_table_stays_where_only_the_ball_rows_follow(spec, friction):
    given = spec.model_copy(update={"heat": spec.heat.model_copy(update={"model": "table"})})
    table = tabulated_machine(given, friction)
    assert table.heat == given.heat
    assert {group.ball_row.kind for group in table.bearing_set} == {"constant"}
    term = FilmHeat(friction, given, table)
    assert term.bearings == ()
    assert term.friction(context(term, np.full((15, 1), 310.0))).shape == (0, 1)
    assert len(term.heat_places) == 15


def test_constant_ball_rows_stay_where_only_friction_follows(spec, friction):
    row = spec.bearing_set[0].ball_row.model_copy(
        update={"kind": "constant", "conductance": Uncertain(2.0, 0.1)}
    )
    front = spec.bearing_set[0].model_copy(update={"ball_row": row})
    given = spec.model_copy(update={"bearing_set": (front, spec.bearing_set[1])})
    table = tabulated_machine(given, friction)
    assert table.bearing_set[0].ball_row == row
    term = FilmHeat(friction, given, table)
    assert {place.split(".")[0] for place in term.heat_places} == {"R1", "R2"}
    assert operators_machine(table, term).bearing_set[0].ball_row == row


def test_operators_do_not_depend_on_which_thrusts_a_recording_has(spec, friction, table):
    # What tabulating two of the three thrusts gives.
    solved = friction.turning(np.log(friction.speed))[:, 1:]
    other = replace(
        friction,
        thrust=friction.thrust[1:],
        turning=CubicSpline(np.log(friction.speed), solved),
        at_rest=friction.at_rest[1:],
        shares=CubicSpline(friction.thrust[1:], np.eye(2)),
    )
    assert other.thrust.tolist() == [1312.5, 1750.0]
    machines = []
    for known in (friction, other):
        tabulated = tabulated_machine(spec, known)
        machines.append(operators_machine(tabulated, FilmHeat(known, spec, tabulated)))
    assert machines[0].model_dump() == machines[1].model_dump()


def test_the_range_of_the_ball_rows_holds_what_the_map_gives(spec, friction, table):
    found = operators_machine(table, FilmHeat(friction, spec, table))
    for row, (group, _) in enumerate(found.bearings):
        prior = group.ball_row.conductance
        reach = np.exp(3.0 * prior.sigma_log)
        for speed in (0.0, 1000.0 * RPM, 4500.0 * RPM):
            for thrust in THRUSTS:
                film = np.full((len(friction.bearings), 1), 320.0)
                values = np.exp(friction.at(speed, thrust).at(film, CONDUCTANCES))[row]
                assert values.min() > prior.value / reach
                assert values.max() < prior.value * reach


def test_values_at_an_operating_point_are_remembered_and_do_not_mix(spec, friction, table):
    term = FilmHeat(friction, spec, table)
    columns = np.tile([320.0, 316.0, 330.0], len(friction.bearings))[:, None]
    first = term.heat(context(term, columns, speed=900.0 * RPM))
    term.heat(context(term, columns, speed=3300.0 * RPM))
    assert term.heat(context(term, columns, speed=900.0 * RPM)).tolist() == first.tolist()
    assert term.heat(context(term, columns, speed=900.0 * RPM, thrust=900.0))[0, 0] != first[0, 0]


@pytest.fixture(scope="module")
def lumped(spec, friction, table):
    """The tabulated machine with one unknown a part, and a drive through two speeds and a rest."""
    fast = fast_spindle(lumped_model(table), table, (FilmHeat(friction, spec, table),))
    times = np.arange(0.0, 2700.0, 120.0)
    return fast, drive_of(times, np.select([times < 1200, times < 1800], [3000.0, 1000.0], 0.0))


def test_given_terms_are_always_there_and_stay_on_a_smaller_basis(lumped):
    fast, drive = lumped
    [term] = fast.inputs.extra_terms
    assert term in fast.own_terms(drive)
    assert term not in fast_spindle(fast.model, fast.spec).own_terms(drive)
    slopes = np.zeros((len(fast.model.probe_names), 2, fast.model.size))
    sloped = fast_spindle(replace(fast.model, probe_gradients=slopes), fast.spec, fast.inputs.extra_terms)
    assert sloped.projected(np.eye(fast.model.size)[:, :-1]).inputs.extra_terms == (term,)


@pytest.mark.parametrize(
    ("properties_at", "share", "names"),
    [
        ("inlet", 1e-4, ("heat.front", "film.outside", "coolant.film_factor", "heat.inner_share")),
        ("bulk", 2e-3, ("heat.front", "coolant.film_factor")),
    ],
)
def test_derivatives_through_the_films_are_those_of_differences(lumped, properties_at, share, names):
    """Where the channel's film follows its wall, derivatives hold it: they miss what that changes."""
    given, drive = lumped
    coolant = given.spec.coolant.model_copy(update={"properties_at": properties_at})
    spec = given.spec.model_copy(update={"coolant": coolant})
    fast = fast_spindle(given.model, spec, given.inputs.extra_terms)
    assert fast.channel.film_follows_wall == (properties_at == "bulk")
    run = simulate_fast(fast, drive, 291.0, derivatives=names)
    for column, name in enumerate(names):
        ends = [
            simulate_fast(fast, drive, 291.0, parameters={name: np.exp(sign * 1e-4)}).temperature
            for sign in (1.0, -1.0)
        ]
        expected = (ends[0] - ends[1]) / 2e-4
        assert run.sensitivity[:, :, column] == pytest.approx(
            expected, rel=share, abs=share * np.abs(expected).max()
        ), name


def test_the_channels_film_is_that_at_its_wall(lumped):
    fast, drive = lumped
    states = np.tile(300.0 * fast.model.one, (len(drive.grid), 1))
    walls = fast.channel.walls(states)
    assert walls == pytest.approx(300.0)
    point = with_walls(drive, walls).points[0]
    shape = fast.model.cell_area.shape
    expected = fast.channel.loop.at(drive.points[0], np.full(shape, 300.0)).film_coefficient.ravel()
    film, _, _ = fast.channel.film(point, {})
    assert film == pytest.approx(expected, rel=1e-12)
    cold, _, _ = fast.channel.film(drive.points[0], {})
    # The coolant warms along it.
    assert np.all(np.diff(film) > 0.0)
    assert film[-1] > 1.005 * cold[-1]


def test_a_warmer_film_makes_less_heat_than_the_table(lumped):
    fast, drive = lumped
    with_films = simulate_fast(fast, drive, 320.0).temperature
    by_table = simulate_fast(fast_spindle(fast.model, fast.spec), drive, 320.0).temperature
    row = fast.channels.index("SP01")
    assert with_films[10, row] < by_table[10, row] - 0.01
