"""Networks over time: exact solutions, order of the implicit scheme, derivatives."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from spindle_fem.errors import ConvergenceError, OutOfValidityError, RecordingError, SpecError
from spindle_fem.model.lumped.exact_steps import divided_differences, first_order_recurrence, phi_functions
from spindle_fem.model.lumped.network_transient import TimeScheme, simulate_transient
from spindle_fem.model.lumped.thermal_network import ConductanceLaw, Parameter, ThermalNetwork
from spindle_fem.recordings.input_samples import InputHistory


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


def three_bodies(laws=(), heat_laws=()):
    parameters = tuple(
        Parameter(f"{kind}.{index}", kind, index, value, 0.2, "")
        for kind, index, value in (
            ("capacity", 0, 100.0),
            ("capacity", 2, 200.0),
            ("conductance", 0, 2.0),
            ("conductance", 2, 1.0),
            ("gain", 0, 3.0),
            ("temperature", 1, 300.0),
        )
    )
    return ThermalNetwork(
        ("body0", "body1", "body2"), [100.0, 50.0, 200.0], [0, 1, 0, 2], [1, 2, 3, 4], [2.0, 4.0, 1.0, 0.5],
        ("air", "room"), [np.nan, 300.0], ("air", None),
        source_node=[1], source_input=("power",), source_gain=[3.0], source_exponent=[1.5],
        conductance_laws=laws, heat_laws=heat_laws, parameters=parameters,
    )  # fmt: skip


def some_history(number=40, seed=3):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.choice([5.0, 5.0, 7.5, 30.0], number))
    values = np.column_stack([290.0 + random.normal(size=number), random.uniform(0.0, 20.0, number)])
    return InputHistory(times, ("air", "power"), values, np.array([False, True]))


def test_step_of_a_held_boundary():
    history = InputHistory([0.0, 30.0, 80.0], ("room",), [[320.0], [320.0], [0.0]], [True])
    run = simulate_transient(lump(), history, np.array([300.0]))
    assert_allclose(run.temperature[:, 0], 320.0 - 20.0 * np.exp(-run.times / 50.0), atol=1e-10)


def test_ramp_of_a_linear_boundary():
    """T = T0 + a (t - tau) + a tau exp(-t / tau) for a room that warms by a a second."""
    times = np.array([0.0, 1e-3, 7.0, 100.0, 1000.0])
    history = InputHistory(times, ("room",), 300.0 + 0.1 * times[:, None], [False])
    run = simulate_transient(lump(), history, np.array([300.0]))
    expected = 300.0 + 0.1 * (times - 50.0) + 0.1 * 50.0 * np.exp(-times / 50.0)
    assert_allclose(run.temperature[:, 0], expected, atol=1e-10)


def test_exact_steps_against_matrix_exponential():
    """An augmented matrix exponential solves the same interval independently."""
    network, history = three_bodies(), some_history()
    run = simulate_transient(network, history, np.array([295.0, 310.0, 301.0]))
    assert run.method == "exact"
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
    assert_allclose(run.final, state, atol=1e-9)


def test_equal_time_constants():
    """Two equal lumps: divided differences turn into derivatives, and nothing divides by zero."""
    parameters = (Parameter("capacity.a", "capacity", 0, 100.0, 0.1, "J/K"),)
    network = ThermalNetwork(
        ("a", "b"), [100.0, 100.0], [0, 1], [2, 2], [2.0, 2.0], ("room",), [300.0], parameters=parameters
    )
    history = InputHistory.constant(np.array([0.0, 25.0, 50.0]), {})
    run = simulate_transient(network, history, np.array([310.0, 310.0]), parameters=parameters)
    # T = 300 + 10 exp(-G t / C): dT/dlnC = 10 (G t / C) exp(-G t / C)
    ratio = run.times / 50.0
    assert_allclose(run.sensitivity[:, 0, 0], 10.0 * ratio * np.exp(-ratio), atol=1e-9)
    assert_allclose(run.sensitivity[:, 1, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.3, 0.49999, 0.50001, 3.0, 700.0])
def test_phi_functions_satisfy_their_recursion(x):
    zero, one, two, three = phi_functions(np.array(x))
    assert_allclose(zero, np.exp(-x), rtol=1e-14)
    assert_allclose(1.0 - x * one, zero, atol=3e-16 * (1 + x))
    assert_allclose(1.0 - x * two, one, rtol=1e-13)
    assert_allclose(0.5 - x * three, two, rtol=1e-12)


def test_divided_differences_are_continuous_where_they_switch():
    near = divided_differences(np.array([0.8, 0.8 + 0.9e-4]))
    far = divided_differences(np.array([0.8, 0.8 + 1.1e-4]))
    for a, b in zip(near, far, strict=True):
        assert_allclose(a[0, 1], b[0, 1], rtol=5e-5)
        assert a[0, 0] < 0.0


@pytest.mark.parametrize("number", [1, 2, 5, 63, 64, 65])
def test_recurrence_against_a_loop(number):
    random = np.random.default_rng(number)
    decay, drive = random.uniform(0, 1, (number, 2, 1)), random.normal(size=(number, 2, 3))
    start = random.normal(size=(2, 3))
    expected = [start]
    for k in range(number):
        expected.append(decay[k] * expected[-1] + drive[k])
    assert_allclose(first_order_recurrence(decay, drive, start), expected, atol=1e-13)


def cooling_law(first, second, inputs):
    """Conductance that grows with the difference, smooth at zero."""
    difference = first - second
    root = np.sqrt(difference**2 + 4.0)
    conductance = 0.3 * root
    slope = 0.3 * difference / root
    return conductance, slope, -slope


def speed_heat(nodes, boundaries, inputs):
    heat, slope = np.zeros(nodes.size), np.zeros((nodes.size, nodes.size))
    heat[2] = 0.5 * inputs["power"] * np.exp(-0.01 * (nodes[2] - 290.0))
    slope[2, 2] = -0.01 * heat[2]
    return heat, slope


LAWS = {"laws": (ConductanceLaw(np.array([1]), cooling_law),), "heat_laws": (speed_heat,)}


def test_implicit_converges_to_exact():
    network, history = three_bodies(), some_history()
    start = np.array([295.0, 310.0, 301.0])
    exact = simulate_transient(network, history, start, parameters=network.parameters)
    implicit = simulate_transient(
        network,
        history,
        start,
        parameters=network.parameters,
        scheme=TimeScheme(method="implicit", step_error=1e-6),
    )
    assert_allclose(implicit.temperature, exact.temperature, atol=1e-3)
    assert_allclose(implicit.sensitivity, exact.sensitivity, atol=5e-3)
    assert implicit.counts.imbalance_relative < 1e-10


@pytest.mark.parametrize("nonlinear", [False, True])
def test_implicit_order_two(nonlinear):
    network = three_bodies(**LAWS) if nonlinear else three_bodies()
    history = InputHistory(
        np.linspace(0.0, 80.0, 5), ("air", "power"),
        np.column_stack([290.0 + np.arange(5.0), [5.0, 20.0, 3.0, 8.0, 1.0]]), [False, False],
    )  # fmt: skip
    start = np.array([295.0, 310.0, 301.0])

    def run(step):
        return simulate_transient(
            network, history, start, scheme=TimeScheme(method="implicit", step_error=None, max_step=step)
        ).temperature[-1]

    reference = run(0.01)
    errors = np.array([np.abs(run(step) - reference).max() for step in (4.0, 2.0, 1.0)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert_allclose(orders, 2.0, atol=0.1)


def test_step_error_is_kept():
    network, history = three_bodies(**LAWS), some_history()
    start = np.array([295.0, 310.0, 301.0])
    reference = simulate_transient(network, history, start, scheme=TimeScheme(step_error=1e-7))
    coarse = simulate_transient(network, history, start, scheme=TimeScheme(step_error=1e-2))
    fine = simulate_transient(network, history, start, scheme=TimeScheme(step_error=1e-4))
    error = [np.abs(run.temperature - reference.temperature).max() for run in (coarse, fine)]
    assert error[0] < 0.05
    assert error[1] < 2e-3
    assert coarse.counts.steps < fine.counts.steps


def test_stored_heat_is_heat_in_minus_out():
    network, history = three_bodies(**LAWS), some_history()
    start = np.array([295.0, 310.0, 301.0])
    run = simulate_transient(network, history, start)
    assert run.counts.heat_stored == pytest.approx(float(network.capacity @ (run.final - start)))
    assert run.counts.imbalance_relative < 1e-10


def test_no_net_heat_into_an_insulated_pair():
    """Laws between two nodes move heat without making any."""
    network = ThermalNetwork(
        ("a", "b"), [100.0, 60.0], [0, 1], [1, 2], [2.0, 1e-12], ("room",), [300.0],
        conductance_laws=(ConductanceLaw(np.array([0]), cooling_law),),
    )  # fmt: skip
    history = InputHistory.constant(np.linspace(0.0, 500.0, 20), {})
    run = simulate_transient(network, history, np.array([330.0, 300.0]))
    assert_allclose(network.capacity @ run.temperature.T, 100.0 * 330.0 + 60.0 * 300.0, rtol=1e-10)
    assert np.abs(np.diff(run.temperature[-1]))[0] < 0.01


@pytest.mark.parametrize("case", ["exact", "implicit", "nonlinear"])
def test_sensitivities_against_finite_differences(case):
    network = three_bodies(**LAWS) if case == "nonlinear" else three_bodies()
    method = "exact" if case == "exact" else "implicit"
    history, start = some_history(), np.array([295.0, 310.0, 301.0])
    fixed = {"scheme": TimeScheme(method, None, 5.0)}
    derivative = simulate_transient(
        network, history, start, parameters=network.parameters, **fixed
    ).sensitivity
    step = 1e-5
    for p, parameter in enumerate(network.parameters):
        shifted = [
            simulate_transient(
                network.with_values({parameter.name: parameter.value * np.exp(sign * step)}),
                history,
                start,
                **fixed,
            ).temperature
            for sign in (1.0, -1.0)
        ]
        numeric = (shifted[0] - shifted[1]) / (2 * step)
        assert np.abs(numeric).max() > 0.01
        assert_allclose(derivative[:, :, p], numeric, atol=1e-5 * np.abs(numeric).max() + 1e-7)


def test_sensitivity_of_many_step_lengths_matches_grouped_steps():
    """Irregular stamps take another path through the same formula."""
    network = three_bodies()
    times = np.cumsum(np.random.default_rng(0).uniform(1.0, 9.0, 400))
    values = np.column_stack([290.0 + np.sin(times / 50.0), 5.0 + np.cos(times / 30.0)])
    history = InputHistory(times, ("air", "power"), values, [False, False])
    start = np.array([295.0, 310.0, 301.0])
    whole = simulate_transient(network, history, start, parameters=network.parameters)
    first = simulate_transient(network, history.cut(0, 200), start, parameters=network.parameters)
    assert_allclose(whole.sensitivity[:200], first.sensitivity, atol=1e-9)
    assert_allclose(whole.temperature[:200], first.temperature, atol=1e-9)


def test_initial_temperature_as_a_parameter():
    parameter = Parameter("initial.body", "initial", 0, 310.0, 0.001, "K")
    history = InputHistory.constant(np.array([0.0, 50.0]), {"room": 300.0})
    for method in ("exact", "implicit"):
        run = simulate_transient(
            lump(), history, np.array([310.0]), parameters=(parameter,),
            initial_derivative=np.array([[310.0]]), scheme=TimeScheme(method=method, step_error=1e-6),
        )  # fmt: skip
        assert run.sensitivity[-1, 0, 0] == pytest.approx(310.0 * np.exp(-1.0), rel=1e-4)


def test_restart_from_the_last_state():
    network, history = three_bodies(), some_history()
    start = np.array([295.0, 310.0, 301.0])
    whole = simulate_transient(network, history, start)
    first = simulate_transient(network, history.cut(0, 21), start)
    second = simulate_transient(network, history.cut(20, 40), first.final)
    assert_allclose(second.temperature[-1], whole.temperature[-1], atol=1e-10)


def test_streams_need_the_implicit_scheme():
    """A cell of 20 J/K flushed by 2 W/K follows its inlet with 10 s."""
    network = ThermalNetwork(
        ("cell",), [20.0], [], [], [], ("inlet",), [300.0],
        stream_upstream=[1], stream_downstream=[0], stream_rate=[2.0],
    )  # fmt: skip
    history = InputHistory.constant(np.linspace(0.0, 30.0, 4), {})
    run = simulate_transient(network, history, np.array([310.0]), scheme=TimeScheme(step_error=1e-6))
    assert run.method == "implicit"
    assert_allclose(run.temperature[:, 0], 300.0 + 10.0 * np.exp(-run.times / 10.0), atol=1e-3)
    with pytest.raises(SpecError, match="without streams"):
        simulate_transient(network, history, np.array([310.0]), scheme=TimeScheme(method="exact"))


def test_runaway_in_time_is_an_error():
    def runaway(nodes, boundaries, inputs):
        heat = np.array([500.0 * np.exp(min((nodes[0] - 300.0) / 10.0, 600.0))])
        return heat, heat[:, None] / 10.0

    network = lump(heat_laws=(runaway,))
    history = InputHistory.constant(np.array([0.0, 600.0]), {"room": 300.0})
    with pytest.raises(ConvergenceError, match="no step succeeds at"):
        simulate_transient(network, history, np.array([300.0]))


def test_tightly_joined_nodes():
    """A joint of 1e8 W/K makes two lumps one, and its rounding does not stop the iteration."""
    network = ThermalNetwork(
        ("a", "b"), [60.0, 40.0], [0, 1], [1, 2], [1.0e8, 2.0], ("room",), [300.0],
    )  # fmt: skip
    history = InputHistory.constant(np.linspace(0.0, 100.0, 11), {})
    for method in ("exact", "implicit"):
        run = simulate_transient(
            network, history, np.array([310.0, 310.0]), scheme=TimeScheme(method=method, step_error=1e-5)
        )
        expected = 300.0 + 10.0 * np.exp(-run.times / 50.0)
        assert_allclose(run.temperature, np.stack([expected, expected], axis=1), atol=2e-3)


def test_negative_input_under_a_broken_power():
    history = InputHistory([0.0, 1.0], ("air", "power"), [[290.0, -1.0], [290.0, 1.0]], [True, True])
    with pytest.raises(OutOfValidityError, match=r'"power" falls to -1, which has no power 1.5'):
        simulate_transient(three_bodies(), history, np.full(3, 300.0))


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


def test_unknown_input_and_method_are_named():
    history = InputHistory.constant(np.array([0.0, 1.0]), {"romm": 300.0})
    with pytest.raises(RecordingError, match=r'needs the input "room".*Did you mean "romm"'):
        simulate_transient(lump(), history, np.array([300.0]))
    with pytest.raises(SpecError, match='"euler" is unknown'):
        simulate_transient(lump(), history, np.array([300.0]), scheme=TimeScheme(method="euler"))
