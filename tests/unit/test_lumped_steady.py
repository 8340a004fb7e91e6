"""Networks at rest: exact balances, Jacobians, refusals."""

import numpy as np
import pytest

from spindle_fem.errors import NoSteadyStateError, SpecError, UnknownSurfaceError
from spindle_fem.model.lumped.node_balance import NetworkBalance
from spindle_fem.model.lumped.thermal_network import ConductanceLaw, Parameter, ThermalNetwork
from spindle_fem.solvers.network_steady import solve_steady

STEFAN_BOLTZMANN = 5.670374419e-8


def chain(**changes):
    """body0 - body1 - body2, the ends tied to air (driven) and room (fixed)."""
    content = {
        "node_names": ("body0", "body1", "body2"),
        "capacity": [100.0, 50.0, 200.0],
        "link_first": [0, 1, 0, 2],
        "link_second": [1, 2, 3, 4],
        "link_conductance": [2.0, 4.0, 1.0, 0.5],
        "boundary_names": ("air", "room"),
        "boundary_temperature": [np.nan, 300.0],
        "boundary_input": ("air", None),
        "source_node": [1],
        "source_input": ("power",),
        "source_gain": [3.0],
        "source_exponent": [2.0],
    }
    return ThermalNetwork(**(content | changes))


def natural_convection(first, second, inputs):
    """5 |dT|^0.25 W/K with its derivatives."""
    difference = first - second
    conductance = inputs.get("scale", 1.0) * 5.0 * np.abs(difference) ** 0.25
    slope = 0.25 * conductance / difference
    return conductance, slope, -slope


def radiation(first, second, inputs):
    area = 0.3
    conductance = STEFAN_BOLTZMANN * area * (first**2 + second**2) * (first + second)
    to_first = STEFAN_BOLTZMANN * area * (3 * first**2 + 2 * first * second + second**2)
    to_second = STEFAN_BOLTZMANN * area * (3 * second**2 + 2 * first * second + first**2)
    return conductance, to_first, to_second


def warm_friction(nodes, boundaries, inputs):
    """Heat of node 0 that falls as node 1 warms, as grease does."""
    heat, slope = np.zeros(nodes.size), np.zeros((nodes.size, nodes.size))
    heat[0] = 40.0 * np.exp(-0.02 * (nodes[1] - 293.15))
    slope[0, 1] = -0.02 * heat[0]
    return heat, slope


def nonlinear():
    return chain(
        conductance_laws=(
            ConductanceLaw(np.array([2]), natural_convection),
            ConductanceLaw(np.array([1, 3]), radiation),
        ),
        heat_laws=(warm_friction,),
    )


def test_series_resistances():
    """10 W through 1/2 and 1/5 K/W above a room at 290 K."""
    network = ThermalNetwork(
        ("winding", "body"), [1.0, 1.0], [0, 1], [1, 2], [2.0, 5.0], ("room",), [290.0],
        source_node=[0], source_input=(None,), source_gain=[10.0], source_exponent=[1.0],
    )  # fmt: skip
    state = solve_steady(network)
    np.testing.assert_allclose(state.temperature, [297.0, 292.0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(state.link_heat, [10.0, 10.0], atol=1e-10)
    assert state.boundary_heat == {"room": pytest.approx(10.0, abs=1e-10)}


def test_source_is_gain_times_power_of_input():
    state = solve_steady(chain(), {"air": 290.0, "power": 2.0})
    assert state.heat_in == pytest.approx(12.0)
    assert sum(state.boundary_heat.values()) == pytest.approx(12.0, abs=1e-9)
    assert state.imbalance_relative < 1e-10


def test_radiating_plate_against_closed_form():
    """With radiation alone, Q = sigma A (T^4 - T_room^4)."""
    network = ThermalNetwork(
        ("plate",), [1.0], [0], [1], [1.0], ("room",), [300.0],
        source_node=[0], source_input=(None,), source_gain=[150.0], source_exponent=[1.0],
        conductance_laws=(ConductanceLaw(np.array([0]), radiation),),
    )  # fmt: skip
    expected = (300.0**4 + 150.0 / (STEFAN_BOLTZMANN * 0.3)) ** 0.25
    state = solve_steady(network)
    assert state.temperature[0] == pytest.approx(expected, abs=1e-8)
    assert state.imbalance_relative < 1e-10
    assert state.iterations > 1


def test_nonlinear_balance_closes():
    state = solve_steady(nonlinear(), {"air": 290.0, "power": 3.0})
    assert state.imbalance_relative < 1e-10
    assert state.heat_in == pytest.approx(27.0 + 40.0 * np.exp(-0.02 * (state.temperature[1] - 293.15)))


def test_jacobian_against_finite_differences():
    network = nonlinear()
    balance = NetworkBalance(network)
    temperature = np.array([310.0, 325.0, 318.0])
    arguments = (np.array([290.0, 300.0]), np.array([0.0, 5.0, 0.0]), {"scale": 1.3})
    _, derivative = balance(temperature, *arguments)
    step = 1e-4
    for node in range(3):
        shift = np.eye(3)[node] * step
        numeric = (
            balance(temperature + shift, *arguments)[0] - balance(temperature - shift, *arguments)[0]
        ) / (2 * step)
        np.testing.assert_allclose(derivative[:, node], numeric, rtol=1e-7, atol=1e-7)


def test_stream_carries_heat_downstream_only():
    """Water at 10 W/K enters at 290 K, takes 50 W in the first and 20 W in the second cell."""
    network = ThermalNetwork(
        ("cell0", "cell1"), [1.0, 1.0], [], [], [], ("inlet",), [290.0],
        source_node=[0, 1], source_input=(None, None), source_gain=[50.0, 20.0], source_exponent=[1.0, 1.0],
        stream_upstream=[2, 0], stream_downstream=[0, 1], stream_rate=[10.0, 10.0],
    )  # fmt: skip
    state = solve_steady(network)
    np.testing.assert_allclose(state.temperature, [295.0, 297.0], atol=1e-10)
    assert state.stream_heat == pytest.approx(70.0)


def test_thermal_runaway_has_no_steady_state():
    """Heat that grows exponentially overtakes a linear loss."""

    def runaway(nodes, boundaries, inputs):
        heat = np.array([30.0 * np.exp(min((nodes[0] - 300.0) / 20.0, 50.0))])
        return heat, heat[:, None] / 20.0

    network = ThermalNetwork(("b",), [1.0], [0], [1], [1.0], ("room",), [300.0], heat_laws=(runaway,))
    with pytest.raises(NoSteadyStateError, match="faster than it is lost"):
        solve_steady(network)


def test_unstable_balance_is_refused():
    """The upper crossing of an exponential heat with a linear loss is a balance that cannot last."""

    def heat(nodes, boundaries, inputs):
        value = np.array([5.0 * np.exp((nodes[0] - 300.0) / 20.0)])
        return value, value[:, None] / 20.0

    network = ThermalNetwork(("b",), [1.0], [0], [1], [1.0], ("room",), [300.0], heat_laws=(heat,))
    lower = solve_steady(network)
    assert lower.temperature[0] == pytest.approx(307.15, abs=0.1)  # 5 e^(x/20) = x at x = 7.148
    with pytest.raises(NoSteadyStateError, match="unstable"):
        solve_steady(network, initial=np.array([345.0]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"capacity": [100.0, -50.0, 200.0]}, 'capacity of node "body1" is -50 J/K'),
        ({"capacity": [100.0, np.nan, 200.0]}, 'capacity of node "body1" is nan'),
        ({"link_conductance": [2.0, -4.0, 1.0, 0.5]}, r'link "body1\|body2" is -4 W/K'),
        ({"node_names": ("body0", "body1", "body1")}, 'name "body1" is used twice'),
        ({"node_names": ("body0", "body1", "room")}, 'name "room" is used twice'),
        ({"link_second": [1, 1, 3, 4]}, 'joins "body1" to itself'),
        ({"link_first": [0, 0, 0, 1], "link_second": [1, 1, 3, 4]}, 'node "body2" floats'),
    ],
)
def test_bad_networks_are_refused_by_name(changes, message):
    with pytest.raises(SpecError, match=message):
        chain(**changes)


def test_missing_input_is_named():
    with pytest.raises(UnknownSurfaceError, match='needs "power"'):
        solve_steady(chain(), {"air": 290.0, "powr": 2.0})


def test_values_are_set_by_parameter_name():
    network = chain(parameters=(Parameter("conductance.body0|body1", "conductance", 0, 2.0, 0.3, "W/K"),))
    changed = network.with_values({"conductance.body0|body1": 7.0})
    assert changed.link_conductance.tolist() == [7.0, 4.0, 1.0, 0.5]
    assert network.link_conductance[0] == 2.0
    assert changed.parameters[0].value == 7.0
    with pytest.raises(UnknownSurfaceError, match=r"conductance\.body0"):
        network.with_values({"conductance.body0": 7.0})


def test_network_arrays_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        chain().capacity[0] = 1.0
