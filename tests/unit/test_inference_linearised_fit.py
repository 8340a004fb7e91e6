"""First order about a fit: quadratic forms with bounds, against a plain search over the same form."""

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from spindle_fem.inference.linearised_fit import Box, BoxedColumns, bounded_minimum

READINGS, COORDINATES, COLUMNS = 60, 4, 5


def problem(room):
    generator = np.random.default_rng(5)
    jacobian = generator.normal(size=(READINGS, COORDINATES))
    residual = generator.normal(size=READINGS) + jacobian @ np.array([2.0, -1.0, 0.5, 0.0])
    root = np.eye(COORDINATES) + 0.2 * np.triu(generator.normal(size=(COORDINATES, COORDINATES)), 1)
    departure = root @ generator.normal(0.0, 0.3, COORDINATES)
    box = Box(
        jacobian,
        residual,
        jacobian.T @ jacobian + root.T @ root,
        jacobian.T @ residual - root.T @ departure,
        float(residual @ residual + departure @ departure),
        np.full(COORDINATES, -room),
        np.full(COORDINATES, room),
    )
    columns = generator.normal(size=(READINGS, COLUMNS))
    boxed = BoxedColumns(box, jacobian.T @ columns, columns.T @ columns, columns.T @ residual)
    return box, boxed, columns, root, departure


@pytest.mark.parametrize("room", [0.3, 1.0, 50.0])
@pytest.mark.parametrize("members", [(2,), (0, 3), (1, 2, 4)])
def test_the_least_cost_within_bounds_is_the_true_one(room, members):
    box, boxed, columns, root, departure = problem(room)
    spread = np.array([0.5, 1.0, 2.0, 0.3, 1.0])
    one_sided = np.array([True, False, True, False, True])
    own = list(members)

    def cost(x):
        moves, amplitudes = x[:COORDINATES], x[COORDINATES:]
        left = box.residual - box.jacobian @ moves - columns[:, own] @ amplitudes
        prior = root @ moves + departure
        return left @ left + prior @ prior + np.sum((amplitudes / spread[own]) ** 2)

    bounds = [(-room, room)] * COORDINATES + [(0.0, None) if one_sided[i] else (None, None) for i in own]
    start = np.zeros(COORDINATES + len(own))
    found = minimize(cost, start, bounds=bounds, method="L-BFGS-B", options={"ftol": 1e-15, "gtol": 1e-10})
    least, amplitudes = boxed.least(members, spread, one_sided)
    assert least == pytest.approx(found.fun, rel=1e-7)
    assert amplitudes == pytest.approx(found.x[COORDINATES:], abs=1e-4)


@pytest.mark.parametrize("room", [0.05, 0.3, 1.0, 50.0])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_many_sets_cost_what_each_does_alone(room, size):
    boxed = problem(room)[1]
    spread = np.array([0.5, 1.0, 2.0, 0.3, 1.0])
    one_sided = np.array([True, False, True, False, True])
    sets = np.array(list(combinations(range(COLUMNS), size)))
    alone = [boxed.least(members, spread, one_sided)[0] for members in sets]
    assert boxed.costs(sets, spread, one_sided) == pytest.approx(alone, rel=1e-9)


def test_bounds_matter_only_where_they_hold_something_back():
    assert problem(0.3)[0].matters
    assert not problem(50.0)[0].matters


def test_a_bounded_minimum_is_the_one_of_a_slower_method():
    rng = np.random.default_rng(5)
    for size in (2, 9, 30):
        root = rng.normal(size=(size + 5, size)) * 10.0 ** rng.uniform(-2.0, 2.0, size)
        hessian = root.T @ root + 1e-3 * np.eye(size)
        downhill = 10.0 * rng.normal(size=size)
        low, high = -rng.uniform(0.0, 2.0, size), rng.uniform(0.0, 2.0, size)
        lower = np.linalg.cholesky(hessian)
        slow = lsq_linear(lower.T, np.linalg.solve(lower, downhill), (low, high), method="bvls").x
        quick = bounded_minimum(hessian, downhill, low, high)
        value, other = (0.5 * at @ hessian @ at - downhill @ at for at in (quick, slow))
        assert value <= other + 1e-9 * abs(other)
        assert np.all((quick >= low) & (quick <= high))
