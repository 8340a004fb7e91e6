"""Networks over time against closed solutions, and their derivatives."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from spindle_fem.errors import OutOfValidityError, RecordingError
from spindle_fem.model.lumped.thermal_network import Parameter, ThermalNetwork
from spindle_fem.model.reduced.network_inputs import NetworkInputs
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.network_start import initial_state
from tests.support.network_runs import run_network


def lump(**changes):
    """100 J/K tied by 2 W/K to a driven room: time constant 50 s."""
    content = {
        "node_names": ("body",),
        "capacity": [100.0],
        "link_first": [0],
        "link_second": [1],
        "link_conductance": [2.0],
        "boundary_names": ("room",),
        "boundary_temperature": [np.nan],
        "boundary_input": ("room",),
    }
    return ThermalNetwork(**(content | changes))


PARAMETERS = (
    "capacity.body0",
    "capacity.body2",
    "conductance.body0|body1",
    "conductance.body0|air",
    "gain.body1.power",
    "temperature.room",
)


def three_bodies():
    parameters = tuple(
        Parameter(name, kind, index, value, 0.2, "")
        for name, (kind, index, value) in zip(
            PARAMETERS,
            (
                ("capacity", 0, 100.0),
                ("capacity", 2, 200.0),
                ("conductance", 0, 2.0),
                ("conductance", 2, 1.0),
                ("gain", 0, 3.0),
                ("temperature", 1, 300.0),
            ),
            strict=True,
        )
    )
    return ThermalNetwork(
        ("body0", "body1", "body2"), [100.0, 50.0, 200.0], [0, 1, 0, 2], [1, 2, 3, 4], [2.0, 4.0, 1.0, 0.5],
        ("air", "room"), [np.nan, 300.0], ("air", None),
        source_node=[1], source_input=("power",), source_gain=[3.0], source_exponent=[1.5],
        parameters=parameters,
    )  # fmt: skip


def some_history(number=40, seed=3):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.choice([5.0, 5.0, 7.5, 30.0], number))
    values = np.column_stack([290.0 + random.normal(size=number), random.uniform(0.0, 20.0, number)])
    return InputHistory(times, ("air", "power"), values, np.array([False, True]))


def test_step_of_a_held_boundary():
    history = InputHistory([0.0, 30.0, 80.0], ("room",), [[320.0], [320.0], [0.0]], [True])
    run = run_network(lump(), history, np.array([300.0]))
    assert_allclose(run.temperature[:, 0], 320.0 - 20.0 * np.exp(-run.times / 50.0), atol=1e-10)


def test_ramp_of_a_linear_boundary():
    """T = T0 + a (t - tau) + a tau exp(-t / tau) for a room that warms by a a second."""
    times = np.array([0.0, 1e-3, 7.0, 100.0, 1000.0])
    history = InputHistory(times, ("room",), 300.0 + 0.1 * times[:, None], [False])
    run = run_network(lump(), history, np.array([300.0]))
    expected = 300.0 + 0.1 * (times - 50.0) + 0.1 * 50.0 * np.exp(-times / 50.0)
    assert_allclose(run.temperature[:, 0], expected, atol=1e-10)


def test_exact_steps_against_matrix_exponential():
    """An augmented matrix exponential solves the same interval independently."""
    network, history = three_bodies(), some_history()
    run = run_network(network, history, np.array([295.0, 310.0, 301.0]))
    matrix = network.conductance_matrix()
    state = np.array([295.0, 310.0, 301.0])
    for k, step in enumerate(np.diff(history.times)):
        heat = np.zeros(3)
        heat[1] = 3.0 * history.values[k, 1] ** 1.5
        start = (heat - matrix[:, 3:] @ [history.values[k, 0], 300.0]) / network.capacity
        end = (heat - matrix[:, 3:] @ [history.values[k + 1, 0], 300.0]) / network.capacity
        augmented = np.zeros((5, 5))
        augmented[:3, :3] = -matrix[:, :3] / network.capacity[:, None]
        augmented[:3, 3], augmented[:3, 4], augmented[4, 3] = 0.0, start, 0.0
        augmented[:3, 3] = (end - start) / step
        augmented[3, 4] = 1.0
        state = (scipy.linalg.expm(step * augmented) @ np.concatenate([state, [0.0, 1.0]]))[:3]
        assert_allclose(run.temperature[k + 1], state, atol=1e-9)
    assert_allclose(run.states[-1], state, atol=1e-9)


def test_equal_time_constants():
    """Two equal lumps: the derivative by one capacity is that of its own node."""
    parameters = (Parameter("capacity.a", "capacity", 0, 100.0, 0.1, "J/K"),)
    network = ThermalNetwork(
        ("a", "b"), [100.0, 100.0], [0, 1], [2, 2], [2.0, 2.0], ("room",), [300.0], parameters=parameters
    )
    history = InputHistory.constant(np.array([0.0, 25.0, 50.0]), {})
    run = run_network(network, history, np.array([310.0, 310.0]), ("capacity.a",))
    # T = 300 + 10 exp(-G t / C): dT/dlnC = 10 (G t / C) exp(-G t / C)
    ratio = run.times / 50.0
    assert_allclose(run.sensitivity[:, 0, 0], 10.0 * ratio * np.exp(-ratio), atol=1e-9)
    assert_allclose(run.sensitivity[:, 1, 0], 0.0, atol=1e-12)


def test_sensitivities_against_finite_differences():
    network, history, start = three_bodies(), some_history(), np.array([295.0, 310.0, 301.0])
    derivative = run_network(network, history, start, PARAMETERS).sensitivity
    step = 1e-5
    for p, parameter in enumerate(network.parameters):
        shifted = [
            run_network(
                NetworkInputs(network).moved({parameter.name: np.exp(sign * step)}), history, start
            ).temperature
            for sign in (1.0, -1.0)
        ]
        numeric = (shifted[0] - shifted[1]) / (2 * step)
        assert np.abs(numeric).max() > 0.01
        assert_allclose(derivative[:, :, p], numeric, atol=1e-5 * np.abs(numeric).max() + 1e-7)


def test_initial_temperature_as_a_parameter():
    history = InputHistory.constant(np.array([0.0, 50.0]), {"room": 300.0})
    run = run_network(lump(), history, [310.0], ("initial.body",), {"initial.body": np.array([[310.0]])})
    assert run.sensitivity[-1, 0, 0] == pytest.approx(310.0 * np.exp(-1.0), rel=1e-9)


def test_restart_from_the_last_state():
    network, history = three_bodies(), some_history()
    start = np.array([295.0, 310.0, 301.0])
    whole = run_network(network, history, start)
    first = run_network(network, history.cut(0, 21), start)
    second = run_network(network, history.cut(20, 40), first.states[-1])
    assert_allclose(second.temperature[-1], whole.temperature[-1], atol=1e-10)


def test_tightly_joined_nodes():
    """A joint of 1e8 W/K makes two lumps one."""
    network = ThermalNetwork(
        ("a", "b"), [60.0, 40.0], [0, 1], [1, 2], [1.0e8, 2.0], ("room",), [300.0],
    )  # fmt: skip
    history = InputHistory.constant(np.linspace(0.0, 100.0, 11), {})
    run = run_network(network, history, np.array([310.0, 310.0]))
    expected = 300.0 + 10.0 * np.exp(-run.times / 50.0)
    assert_allclose(run.temperature, np.stack([expected, expected], axis=1), atol=2e-3)


def test_negative_input_under_a_broken_power():
    history = InputHistory([0.0, 1.0], ("air", "power"), [[290.0, -1.0], [290.0, 1.0]], [True, True])
    with pytest.raises(OutOfValidityError, match=r'"power" falls to -1, which has no power 1.5'):
        run_network(three_bodies(), history, np.full(3, 300.0))


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 0.0], [[1.0], [1.0]], "increase strictly"),
        ([0.0, 1.0], [[1.0], [np.nan]], "input value is missing"),
        ([0.0, 1.0], [[1.0]], "does not fit 2 times"),
    ],
)
def test_bad_histories_are_refused(times, values, message):
    with pytest.raises(RecordingError, match=message):
        InputHistory(times, ("power",), values, [True])


def test_unknown_input_is_named():
    history = InputHistory.constant(np.array([0.0, 1.0]), {"romm": 300.0})
    with pytest.raises(RecordingError, match=r'needs the input "room".*Did you mean "romm"'):
        initial_state(lump(), history, {"body": 300.0})
