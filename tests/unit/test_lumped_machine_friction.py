"""Friction, ball contacts and preload in a machine's network: tables, laws, and the loop that runs away."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import NoSteadyStateError
from spindle_fem.model.lumped.ball_contacts import BallContactLaw
from spindle_fem.model.lumped.friction_table import tabulate_friction
from spindle_fem.model.lumped.machine_balance import SparseBalance
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.lumped.operating_state import operate
from spindle_fem.operation.bearing_heat import BearingTemperatures, heat_model_of
from spindle_fem.operation.friction_map import film_temperature
from spindle_fem.operation.friction_map import tabulate_friction as tabulate_speeds
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.machine_network_steady import network_heat_model, solve_machine_network
from spindle_fem.solvers.preload_runaway import beyond_the_branch, no_equilibrium
from tests.support.near_rings import NEAR_RINGS


@pytest.fixture(scope="module")
def friction_machine():
    spec = load_machine("wu_tan_2016", ("heat.thermal_preload=false",))
    return build_machine_network(spec), OperatingPoint.of(spec), heat_model_of(spec)


@pytest.fixture(scope="module")
def networked():
    spec = load_machine("wu_tan_2016")
    return build_machine_network(spec), OperatingPoint.of(spec)


def test_jacobian_of_friction_and_contacts_is_the_derivative(friction_machine):
    network, point, model = friction_machine
    state = solve_machine_network(network, point, heat_model=model)
    around = {name: BearingTemperatures(*(300.0,) * 5) for name in network.ball_nodes}
    tables = tabulate_friction(network.spec, point, model)
    net = operate(network, point, model, around=around, friction=tables)
    balance = SparseBalance(net)
    analytic = balance(state.temperature)[1]
    step = 1.0e-4
    for node in network.ball_nodes.values():
        shift = np.zeros(network.n_nodes)
        shift[node] = step
        numeric = (balance(state.temperature + shift)[0] - balance(state.temperature - shift)[0]) / (
            2.0 * step
        )
        assert analytic[:, node] == pytest.approx(numeric, abs=2e-5 * np.abs(analytic[:, node]).max())


def test_contacts_made_anywhere_give_the_same_balance_once_they_follow(friction_machine):
    """Links and shares of other film temperatures, with the law that corrects them."""
    network, point, model = friction_machine
    tables = tabulate_friction(network.spec, point, model)
    state = solve_machine_network(network, point, heat_model=model)
    net = [
        SparseBalance(operate(network, point, model, around=around, friction=tables))(state.temperature)[0]
        for around in (
            {name: BearingTemperatures(*(kelvin,) * 5) for name in network.ball_nodes}
            for kelvin in (295.0, 330.0)
        )
    ]
    # what is left is the film temperature, taken with the raceways of the contacts as made
    moved = np.abs(np.array(net)).max(axis=1)
    assert moved.max() < 0.2
    bare = [operate(network, point, model, around=None, friction=tables)]
    fixed = replace(bare[0], laws=tuple(law for law in bare[0].laws if not isinstance(law, BallContactLaw)))
    assert np.abs(SparseBalance(fixed)(state.temperature)[0]).max() > 1.0


def test_tables_stand_for_the_heat_model(friction_machine):
    network, point, model = friction_machine
    tables = tabulate_friction(network.spec, point, model)
    state = solve_machine_network(network, point, heat_model=model)
    exact, _ = model(point, state.bearing_temperatures())
    for name, heat in exact.items():
        around = state.bearing_temperatures()[name]
        kelvin = float(film_temperature(around.inner, around.outer, around.ball))
        assert tables.at(name, kelvin).total == pytest.approx(heat.total, rel=1e-4)
        assert tables.at(name, kelvin).conductance_inner == pytest.approx(heat.conductance_inner, rel=1e-4)
        assert state.network.friction_heat(state.temperature)[name] == pytest.approx(heat.total, rel=1e-4)
    one_by_one = tabulate_friction(network.spec, point, lambda p, around: model(p, around))
    for name in tables.heat:
        assert tables.heat[name].c == pytest.approx(one_by_one.heat[name].c, rel=1e-6, abs=1e-9)


def test_network_follows_the_preload_to_its_fixed_point():
    spec = load_machine("wu_tan_2016", (*NEAR_RINGS, "operation.speed=650 rpm"))
    network, point = build_machine_network(spec), OperatingPoint.of(spec)
    model = network_heat_model(network)
    state = solve_machine_network(network, point)
    exact, _ = model(point, state.bearing_temperatures())
    heat = state.network.friction_heat(state.temperature)
    for name in exact:
        assert heat[name] == pytest.approx(exact[name].total, rel=1e-5)
    assert 1.5 < exact["F3"].preload / spec.bearing_set[0].preload < 5.0
    assert exact["F3"].seat_pressure[1] > 0.0
    around = state.bearing_temperatures()
    front = [found for name, found in model.states(point, around, expand=True).items() if name[0] == "F"]
    inner, outer = np.array([found.ball_forces for found in front]).T
    shifts = np.stack([around[found.name].shifts for found in front])
    law = model.sets["front"].seats.law(shifts, point.speed, outer - inner)
    pressure = [value for found in front for value in exact[found.name].seat_pressure]
    assert pressure == pytest.approx(law.seats(inner)[0], rel=1e-6)
    assert state.imbalance_relative < 1e-10


@pytest.mark.slow
def test_network_says_at_which_speed_equilibria_fold():
    spec = load_machine("wu_tan_2016", NEAR_RINGS)
    network, point = build_machine_network(spec), OperatingPoint.of(spec)
    with pytest.raises(NoSteadyStateError, match=r"no thermal equilibrium at 3000 rpm") as caught:
        solve_machine_network(network, point)
    limit = float(str(caught.value).split("a fold at ")[1].split(" rpm")[0])
    below = replace(point, speed=0.97 * limit * np.pi / 30.0)
    assert solve_machine_network(network, below).imbalance_relative < 1e-10
    with pytest.raises(NoSteadyStateError, match="a fold at"):
        solve_machine_network(network, replace(point, speed=1.02 * limit * np.pi / 30.0))


def test_searches_from_the_last_equilibrium_find_what_those_from_rest_find(networked, monkeypatch):
    network, point = networked
    around = {
        kelvin: {
            name: BearingTemperatures(
                kelvin + 4.0, kelvin, kelvin + 3.0, kelvin + 4.0, kelvin, network.growth.shifts(field)[name]
            )
            for name in network.ball_nodes
        }
        for kelvin, field in ((k, np.full(network.n_solid, k)) for k in (300.0, 301.5))
    }
    again, fresh = network_heat_model(network), network_heat_model(network)
    again(point, around[300.0])
    expected = fresh(point, around[301.5])[0]

    def refuse(*_, **__):
        raise AssertionError("a search from rest")

    monkeypatch.setattr("spindle_fem.physics.bearings.bearing_set.solve_equilibrium", refuse)
    found = again(point, around[301.5])[0]
    for name, heat in expected.items():
        assert found[name].total == pytest.approx(heat.total, rel=1e-8)
        assert found[name].preload == pytest.approx(heat.preload, rel=1e-7)


def test_a_fold_is_said_before_where_the_search_ended():
    """What a designer can act on first: the lubricant of a state that does not exist is no cause."""
    point = SimpleNamespace(speed=4000.0 * np.pi / 30.0)
    error = no_equilibrium("spindle", point, "lubricant temperature: at 169 °C it is too thin.")
    branch = SimpleNamespace(end="fold", limit=2126.0 * np.pi / 30.0, reason="")
    text = str(beyond_the_branch(error, branch))
    assert text.startswith(
        "spindle: no thermal equilibrium at 4000 rpm: heat and preload feed each other, equilibria end in a "
        "fold at 2126 rpm. Lower the speed"
    )
    assert text.endswith(
        "(Heated beyond the fold it ends at: lubricant temperature: at 169 °C it is too thin.)"
    )
    other = SimpleNamespace(end="limit", limit=2126.0 * np.pi / 30.0, reason="too thin an oil.")
    text = str(beyond_the_branch(error, other))
    assert "4000 rpm: lubricant temperature" in text
    assert "exists up to about 2126 rpm: too thin an oil." in text


def test_a_row_without_load_keeps_its_heat_path_at_standstill(friction_machine):
    """F3 of the reference spindle lifts off under 6500 N; at rest the wedge of lubricant joins its balls."""
    network, point, model = friction_machine
    friction_map = tabulate_speeds(network.spec, point.speed, (1750.0, 6500.0))
    assert np.all(np.isfinite(friction_map.nominal_conductance(0.0, 1750.0)))
    assert friction_map.nominal_conductance(0.0, 6500.0)[2] == pytest.approx([0.64, 0.69], rel=0.05)
    still = replace(point, speed=0.0, thrust=9000.0)
    found = solve_machine_network(network, still, heat_model=model)
    assert np.all(np.isfinite(found.temperature))
