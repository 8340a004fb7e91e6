"""Networks at rest: exact balances and refusals."""

import numpy as np
import pytest

from spindle_fem.errors import NoSteadyStateError, SpecError, UnknownSurfaceError
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.solvers.network_steady import solve_steady
from spindle_fem.solvers.newton import _marched, newton


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


def test_a_body_without_loss_has_no_steady_state():
    with pytest.raises(NoSteadyStateError, match="loses no heat"):
        solve_steady(chain(link_conductance=[0.0, 0.0, 0.0, 0.5]), {"air": 290.0, "power": 2.0})


def test_network_arrays_cannot_be_written():
    with pytest.raises(ValueError, match="read-only"):
        chain().capacity[0] = 1.0


class OneNode:
    """A node that loses 1 W/K to 293 K and rubs by a law of its temperature."""

    name, node_names, is_linear = "one", ("node",), False

    def __init__(self, heat):
        self.heat = heat

    def __call__(self, temperature):
        net = self.heat(temperature) - (temperature - 293.0)
        slope = (self.heat(temperature + 1e-5) - self.heat(temperature - 1e-5)) / 2e-5
        return net, np.diag(slope - 1.0)

    def rounding(self, temperature, derivative):
        return 1e-9


def test_steps_in_time_follow_grease_that_first_rubs_more_as_it_warms():
    def hump(temperature):
        return 60.0 + 300.0 * np.exp(-(((temperature - 330.0) / 15.0) ** 2))

    found = _marched(OneNode(hump), np.array([318.0]))
    balance, _ = OneNode(hump)(found)
    # beyond the hump, where the heat has fallen to what is lost
    assert found[0] > 345.0
    assert abs(balance[0]) < 1.0
    assert newton(OneNode(hump), np.array([318.0]))[0][0] == pytest.approx(found[0], abs=1.0)


def test_what_warms_without_end_is_told_by_its_node():
    with pytest.raises(NoSteadyStateError, match='"node" warms beyond 627'):
        _marched(OneNode(lambda temperature: np.exp((temperature - 273.0) / 20.0)), np.array([400.0]))
