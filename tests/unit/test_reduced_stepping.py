"""Steps of the reduced model: exact solutions, order, stiffness, conservation, derivatives."""

import numpy as np
import pytest
from scipy.linalg import expm

from spindle_fem.model.reduced.trbdf2_matrices import (
    MatrixChange,
    build_propagator,
    group_steps,
    load_response,
    sensitivity_forcing,
    stage_values,
)

STORAGE = np.diag([2.0, 3.0, 5.0])
LINKS = np.array([[3.0, -2.0, -1.0], [-2.0, 2.5, -0.5], [-1.0, -0.5, 1.5]])
LEAK = np.diag([0.4, 0.0, 0.1])
CONDUCTION = LINKS + LEAK


def march(storage, conduction, loads_start, loads_end, start, step):
    propagator = build_propagator(storage, conduction, step)
    response = load_response(propagator, loads_start, loads_end, np.eye(len(start)))
    states = [start]
    for added in response:
        states.append(propagator.advance @ states[-1] + added)
    return np.array(states), propagator


@pytest.mark.parametrize(
    "coupling", [CONDUCTION, CONDUCTION + np.array([[0, 0, 0], [0, 0, 0], [-0.8, 0, 0]])]
)
def test_decay_converges_at_second_order_also_where_the_matrix_is_not_symmetric(coupling):
    start = np.array([5.0, -2.0, 1.0])
    exact = expm(-np.linalg.solve(STORAGE, coupling) * 4.0) @ start
    errors = []
    for number in (8, 16, 32, 64):
        zero = np.zeros((number, 3))
        states, _ = march(STORAGE, coupling, zero, zero, start, 4.0 / number)
        errors.append(np.abs(states[-1] - exact).max())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates[-1] == pytest.approx(2.0, abs=0.1)


def test_ramped_loads_converge_at_second_order():
    # u = t² c solves M u' + K u = 2 t M c + t² K c, whose load is not linear in a step.
    shape = np.array([1.0, -0.5, 2.0])
    errors = []
    for number in (10, 20, 40):
        times = np.linspace(0.0, 3.0, number + 1)
        load = 2.0 * times[:, None] * (STORAGE @ shape) + times[:, None] ** 2 * (CONDUCTION @ shape)
        states, _ = march(STORAGE, CONDUCTION, load[:-1], load[1:], np.zeros(3), 3.0 / number)
        errors.append(np.abs(states[-1] - 9.0 * shape).max())
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(2.0, abs=0.1)


def test_what_is_far_too_fast_for_the_step_dies_at_once():
    stiff = np.diag([1e9, 1.0])
    zero = np.zeros((1, 2))
    states, _ = march(np.eye(2), stiff, zero, zero, np.array([1.0, 1.0]), 1.0)
    assert abs(states[1, 0]) < 1e-8
    assert states[1, 1] == pytest.approx(np.exp(-1.0), abs=0.02)


def test_an_unknown_without_capacity_follows_its_neighbours():
    storage = np.diag([1.0, 0.0])
    links = np.array([[1.5, -1.0], [-1.0, 1.0]])
    zero = np.zeros((5, 2))
    states, _ = march(storage, links, zero, zero, np.array([1.0, 1.0]), 0.3)
    assert states[1:, 1] == pytest.approx(states[1:, 0], abs=1e-12)


def test_stored_heat_is_what_was_put_in():
    rng = np.random.default_rng(3)
    start, end = rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    states, _ = march(STORAGE, LINKS, start, end, np.array([1.0, 2.0, 3.0]), 0.7)
    put_in = 0.7 * 0.5 * (start + end).sum()
    assert (np.diag(STORAGE) @ (states[-1] - states[0])) == pytest.approx(put_in, rel=1e-11)


@pytest.mark.parametrize("kind", ["conduction", "storage", "loads"])
def test_forcing_of_the_sensitivities_is_the_derivative_of_the_step(kind):
    rng = np.random.default_rng(5)
    start, end = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    change = rng.normal(size=(3, 3))
    change = change + change.T
    shift_start, shift_end = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))

    def run(amount):
        return march(
            STORAGE + (amount * change if kind == "storage" else 0.0),
            CONDUCTION + (amount * change if kind == "conduction" else 0.0),
            start + (amount * shift_start if kind == "loads" else 0.0),
            end + (amount * shift_end if kind == "loads" else 0.0),
            np.array([1.0, 0.0, -1.0]),
            0.5,
        )

    states, propagator = run(0.0)
    stage = stage_values(propagator, states[:-1], start, end, np.eye(3))
    own = {
        "conduction": MatrixChange(conduction=change),
        "storage": MatrixChange(storage=change),
        "loads": MatrixChange(load_start=shift_start, load_end=shift_end),
    }[kind]
    # beside others: each keeps its column
    others = (MatrixChange(), MatrixChange(conduction=np.eye(3)), MatrixChange(storage=np.eye(3)))
    forcing = sensitivity_forcing(propagator, states[:-1], stage, states[1:], (*others, own))
    assert not forcing[:, :, 0].any()
    forcing = forcing[:, :, 3]
    slope = np.zeros(3)
    for added in forcing:
        slope = propagator.advance @ slope + added
    difference = (run(1e-6)[0][-1] - run(-1e-6)[0][-1]) / 2e-6
    assert slope == pytest.approx(difference, abs=1e-7)


def test_steps_are_grouped_by_class_and_length():
    groups = group_steps(np.array([0, 0, 1, 0]), np.array([10.0, 10.0, 10.0, 5.0]))
    assert {key: rows.tolist() for key, rows in groups.items()} == {
        (0, 5.0): [3],
        (0, 10.0): [0, 1],
        (1, 10.0): [2],
    }
