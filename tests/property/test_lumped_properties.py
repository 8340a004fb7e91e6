"""What holds for every conducting network: superposition, maximum principle, balance, reciprocity, decay."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.network_steady import solve_steady
from tests.support.network_runs import modal_solution, run_network

ROOM, BATH = 293.15, 303.15
several = settings(max_examples=40)


@st.composite
def networks(draw):
    """A random tree of nodes with extra links, tied to two boundaries."""
    number = draw(st.integers(2, 8))
    conductance = st.floats(0.05, 50.0)
    first, second, values = [], [], []
    for node in range(1, number):
        first.append(node)
        second.append(draw(st.integers(0, node - 1)))
        values.append(draw(conductance))
    for _ in range(draw(st.integers(0, 4))):
        a, b = draw(st.lists(st.integers(0, number - 1), min_size=2, max_size=2, unique=True))
        first.append(a)
        second.append(b)
        values.append(draw(conductance))
    for boundary in (number, number + 1):
        first.append(draw(st.integers(0, number - 1)))
        second.append(boundary)
        values.append(draw(conductance))
    capacity = draw(st.lists(st.floats(1.0, 5000.0), min_size=number, max_size=number))
    heat = draw(st.lists(st.floats(0.0, 200.0), min_size=number, max_size=number))
    return ThermalNetwork(
        tuple(f"n{k}" for k in range(number)),
        capacity,
        first,
        second,
        values,
        ("room", "bath"),
        [ROOM, BATH],
        link_names=tuple(f"link{k}" for k in range(len(values))),
        source_node=np.arange(number),
        source_input=("power",) * number,
        source_gain=heat,
        source_exponent=np.ones(number),
    )


@several
@given(networks())
def test_double_heat_is_double_rise(network):
    cold, once, twice = (solve_steady(network, {"power": p}).temperature for p in (0.0, 1.0, 2.0))
    assert_allclose(twice - cold, 2.0 * (once - cold), rtol=1e-9, atol=1e-9)


@several
@given(networks())
def test_maximum_principle(network):
    cold = solve_steady(network, {"power": 0.0}).temperature
    assert np.all(cold >= ROOM - 1e-9)
    assert np.all(cold <= BATH + 1e-9)
    assert np.all(solve_steady(network, {"power": 1.0}).temperature >= cold - 1e-9)


@several
@given(networks())
def test_heat_in_is_heat_out(network):
    state = solve_steady(network, {"power": 1.0})
    assert state.imbalance_relative < 1e-10
    assert_allclose(
        sum(state.boundary_heat.values()), network.source_gain.sum(), atol=1e-8 * (1 + state.heat_in)
    )


@several
@given(networks(), st.data())
def test_reciprocity(network, data):
    """A watt at node a warms node b as a watt at b warms a."""
    number = network.n_nodes
    a, b = data.draw(st.integers(0, number - 1)), data.draw(st.integers(0, number - 1))
    inverse = np.linalg.inv(network.conductance_matrix()[:, :number])
    assert_allclose(inverse[a, b], inverse[b, a], rtol=1e-9)


@several
@given(networks(), st.floats(0.1, 1000.0))
def test_transient_stays_between_its_start_and_its_surroundings(network, step):
    start = np.linspace(285.0, 310.0, network.n_nodes)
    history = InputHistory.constant(step * np.arange(20.0), {"power": 0.0})
    run = run_network(network, history, start)
    assert np.all(run.temperature >= 285.0 - 1e-8)
    assert np.all(run.temperature <= 310.0 + 1e-8)


@several
@given(networks(), st.floats(0.1, 1000.0))
def test_transient_ends_in_the_steady_state(network, power):
    rates = np.linalg.eigvals(network.conductance_matrix()[:, : network.n_nodes] / network.capacity[:, None])
    times = np.arange(41.0) / rates.real.min()
    history = InputHistory.constant(times, {"power": power / 100.0})
    run = run_network(network, history, np.full(network.n_nodes, 300.0))
    assert_allclose(
        run.temperature[-1], solve_steady(network, {"power": power / 100.0}).temperature, rtol=1e-8
    )


@several
@given(networks(), st.integers(2, 12))
def test_exact_steps_do_not_depend_on_how_time_is_cut(network, parts):
    start = np.full(network.n_nodes, 300.0)
    times = np.linspace(0.0, 7.5 * parts, parts + 1)
    whole = run_network(network, InputHistory.constant(times[[0, -1]], {"power": 1.0}), start)
    cut = run_network(network, InputHistory.constant(times, {"power": 1.0}), start)
    assert_allclose(cut.states[-1], whole.states[-1], rtol=1e-10)


@settings(max_examples=10)
@given(networks())
def test_agreement_with_the_modes(network):
    history = InputHistory(
        np.linspace(0.0, 200.0, 6), ("power",), [[0.0], [2.0], [1.0], [0.0], [3.0], [0.0]], [False]
    )
    start = np.full(network.n_nodes, 300.0)
    run = run_network(network, history, start)
    assert_allclose(run.temperature, modal_solution(network, history, start), atol=1e-6)


@several
@given(networks(), st.integers(3, 80).map(lambda sixteenths: sixteenths / 16.0))
def test_scaling_time_and_capacity_together_changes_nothing(network, factor):
    """Capacity and time enter only as their ratio; steps are whole microseconds, as in the model."""
    slower = ThermalNetwork(
        network.node_names,
        network.capacity * factor,
        network.link_first,
        network.link_second,
        network.link_conductance,
        network.boundary_names,
        network.boundary_temperature,
        link_names=network.link_names,
        source_node=network.source_node,
        source_input=network.source_input,
        source_gain=network.source_gain,
        source_exponent=network.source_exponent,
    )
    times, start = 62.5 * np.arange(9.0), np.full(network.n_nodes, 310.0)
    one = run_network(network, InputHistory.constant(times, {"power": 1.0}), start)
    two = run_network(slower, InputHistory.constant(times * factor, {"power": 1.0}), start)
    assert_allclose(one.temperature, two.temperature, rtol=1e-9)
