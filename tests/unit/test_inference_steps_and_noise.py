"""Steps of a fit within bounds, large residuals, and readings whose errors are correlated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from spindle_fem.inference.belief import Coordinate
from spindle_fem.inference.fit_objective import bounded_step
from spindle_fem.inference.reading_noise import (
    Absorbed,
    ChannelBins,
    SlowError,
    Whitener,
    likely_slow_error,
    whiteners_of,
)
from spindle_fem.inference.robust_size import huber


def test_coordinates_go_there_and_back():
    logarithmic = Coordinate("a", 5.0, 0.3, True, -4.0, 4.0)
    assert logarithmic.at(1.0) == pytest.approx(5.0 * np.exp(0.3))
    assert logarithmic.of(logarithmic.at(-1.7)) == pytest.approx(-1.7)
    linear = Coordinate("b", 20.0, 4.0, False, -2.0, np.inf, "K")
    assert linear.at(0.5) == 22.0
    assert linear.of(30.0) == pytest.approx(2.5)
    assert linear.of(-100.0) == -2.0


@pytest.mark.parametrize("seed", range(8))
def test_a_bounded_step_is_the_least_squares_step_within_the_bounds(seed):
    generator = np.random.default_rng(seed)
    jacobian, residual = generator.normal(size=(12, 4)), 3.0 * generator.normal(size=12)
    # Nearly orthogonal columns, for which holding what would leave is exact.
    jacobian, _ = np.linalg.qr(jacobian)
    position = generator.uniform(-0.5, 0.5, 4)
    low, high = np.full(4, -0.8), np.array([0.8, np.inf, 0.6, np.inf])
    move = bounded_step(jacobian.T @ jacobian, jacobian.T @ residual, 0.0, position, low, high)
    exact = lsq_linear(jacobian, residual, bounds=(low - position, high - position), tol=1e-14).x
    assert position + move == pytest.approx(np.clip(position + move, low, high), abs=1e-15)
    assert move == pytest.approx(exact, abs=1e-6)


def test_an_unbounded_step_is_newtons():
    generator = np.random.default_rng(2)
    root, gradient = generator.normal(size=(5, 3)), generator.normal(size=3)
    hessian = root.T @ root
    free = np.full(3, np.inf)
    move = bounded_step(hessian, gradient, 0.0, np.zeros(3), -free, free)
    assert hessian @ move == pytest.approx(gradient)
    damped = bounded_step(hessian, gradient, 10.0, np.zeros(3), -free, free)
    assert (hessian + 10.0 * np.diag(np.diag(hessian))) @ damped == pytest.approx(gradient)


def test_large_residuals_count_linearly():
    assert huber(np.array([-2.0, 3.0, 10.0])) == pytest.approx([4.0, 9.0, 51.0])
    step = 1e-6
    slope = (huber(np.array([3.0 + step])) - huber(np.array([3.0 - step]))) / (2.0 * step)
    assert slope == pytest.approx([6.0], abs=1e-4)


def bins_of(count, *, number=1.0, spacing=0.0, seed=0):
    generator = np.random.default_rng(seed)
    times = np.cumsum(generator.uniform(40.0, 90.0, count))
    many = np.full(count, number)
    rows = np.arange(count)
    return ChannelBins(0, rows, rows, times, many, np.full(count, spacing), 0.1, 0)


def test_whitened_readings_are_independent_of_unit_variance():
    bins, slow = bins_of(60, number=4.0, spacing=12.0), SlowError(0.2, 700.0)
    factor = bins.factor(slow)
    white = Whitener(bins, slow)
    assert white(factor) == pytest.approx(np.eye(60), abs=1e-10)
    assert white.log_root_determinant == pytest.approx(0.5 * np.linalg.slogdet(factor @ factor.T)[1])


def test_channels_that_are_read_alike_share_a_whitener_and_others_do_not():
    first, slow = bins_of(60), SlowError(0.2, 700.0, channels=((3, 0.1, 700.0),))
    every = [replace(first, key=1), replace(first, key=2), replace(first, white=0.2), replace(first, key=3)]
    whiteners = whiteners_of([*every, replace(first, times=first.times + 1.0), replace(first, key=-1)], slow)
    assert whiteners[0] is whiteners[1]
    assert len({id(item) for item in whiteners}) == 5
    for bins, shared in zip(every, whiteners, strict=False):
        assert shared.factor == pytest.approx(Whitener(bins, slow).factor)


def test_the_filter_is_the_cholesky_factor(monkeypatch):
    bins, slow = bins_of(150), SlowError(0.15, 900.0)
    values = np.random.default_rng(1).normal(size=(150, 3))
    dense = Whitener(bins, slow)
    monkeypatch.setattr("spindle_fem.inference.reading_noise.MOST_DENSE", 100)
    filtered = Whitener(bins, slow)
    assert filtered.factor is None
    assert filtered(values) == pytest.approx(dense(values), rel=1e-9, abs=1e-9)
    assert filtered(values[:, 0]) == pytest.approx(dense(values[:, 0]), rel=1e-9, abs=1e-9)
    assert filtered.log_root_determinant == pytest.approx(dense.log_root_determinant, rel=1e-10)


def test_the_slow_error_of_a_known_process_is_found():
    generator = np.random.default_rng(4)
    true = SlowError(0.17, 1200.0)
    residuals = []
    for seed in range(6):
        bins = bins_of(120, seed=seed)
        residuals.append((bins, bins.factor(true) @ generator.normal(size=120)))
    choices = {"sigmas": (0.01, 0.05, 0.11, 0.17, 0.25, 0.65), "times": (300.0, 1200.0, 4800.0)}
    found = likely_slow_error(residuals, **choices)
    assert found.sigma in (0.11, 0.17, 0.25)
    assert found.time == 1200.0
    held = likely_slow_error(residuals, prior=SlowError(0.01, 1200.0), prior_width=0.005, **choices)
    assert held.sigma == 0.01


def test_what_coordinates_take_up_of_a_slow_error_counts():
    generator = np.random.default_rng(8)
    true, bins = SlowError(0.05, 4800.0), bins_of(240, number=4.0, spacing=12.0)
    root = np.eye(40)
    choices = {"sigmas": (0.02, 0.03, 0.045, 0.065, 0.09), "times": (600.0, 1200.0, 2400.0, 4800.0)}
    plain, restricted = [], []
    whitener = Whitener(bins, true)
    for _ in range(12):
        hours = bins.times[:, None] / bins.times[-1] * np.arange(1, 9) * np.pi
        columns = [0.1 * np.cos(hours) @ generator.normal(size=(8, 40)) for _ in range(5)]
        errors = [bins.factor(true) @ generator.normal(size=240) for _ in columns]
        white = np.concatenate([whitener(item) for item in columns])
        moved = np.linalg.solve(
            root + white.T @ white, white.T @ np.concatenate([whitener(item) for item in errors])
        )
        left = [(bins, error - own @ moved) for error, own in zip(errors, columns, strict=True)]
        plain.append(likely_slow_error(left, **choices))
        restricted.append(likely_slow_error(left, **choices, absorbed=Absorbed(columns, root)))
    sizes = [np.mean([item.sigma * np.sqrt(item.time) for item in found]) for found in (plain, restricted)]
    wanted = true.sigma * np.sqrt(true.time)
    assert sizes[0] < 0.8 * wanted
    assert sizes[1] == pytest.approx(wanted, rel=0.15)
