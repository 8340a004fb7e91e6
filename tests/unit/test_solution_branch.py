"""Branches of fixed points against folds that can be written down."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.errors import NoEquilibriumError, SpindleFemError
from spindle_fem.solvers.solution_branch import follow_branch


def test_the_fold_of_a_parabola_is_exact() -> None:
    """x = 1 + p x² turns at p = 1/4, x = 2."""
    branch = follow_branch(lambda x, p: 1.0 + p * x**2, np.array([1.0]), 0.01, 2.0)
    assert branch.end == "fold"
    assert branch.limit == pytest.approx(0.25, rel=1e-4)
    assert branch.states.max() > 2.0


def test_ignition_in_two_coupled_quantities() -> None:
    """Semenov: x = p exp(x) in each of two that share their heat turns at p = 1/e."""

    def respond(x: np.ndarray, p: float) -> np.ndarray:
        shared = 0.5 * (x[:, :1] + x[:, 1:] / 2.0)
        return p * np.exp(shared) * np.array([1.0, 2.0])

    branch = follow_branch(respond, np.array([0.1, 0.2]), 0.05, 1.0)
    assert branch.end == "fold"
    assert branch.limit == pytest.approx(np.exp(-1.0), rel=1e-4)


def test_a_quantity_that_moves_little_needs_no_differences() -> None:
    """The same fold, with a second quantity that follows the first and acts back a little."""

    def respond(x: np.ndarray, p: float) -> np.ndarray:
        first, second = x.T
        return np.stack([1.0 + p * first**2 * second**0.1, first**0.2], axis=-1)

    found = []
    for weak in (0, 1):
        branch = follow_branch(respond, np.array([1.0, 1.0]), 0.01, 1.0, weak=weak)
        assert branch.end == "fold"
        found.append(branch.limit)
    assert found[1] == pytest.approx(found[0], rel=1e-4)


def test_a_branch_without_fold_reaches_its_end() -> None:
    branch = follow_branch(lambda x, p: (1.0 + p) / (1.0 + x), np.array([0.6]), 0.1, 3.0)
    assert branch.end == "end"
    assert branch.limit == pytest.approx(3.0)
    x = branch.states[-1, 0]
    assert x * (1.0 + x) == pytest.approx(4.0, rel=1e-5)


def test_a_fold_just_ahead_of_the_start_is_found() -> None:
    start = 0.2499
    lower = (1.0 - np.sqrt(1.0 - 4.0 * start)) / (2.0 * start)
    branch = follow_branch(lambda x, p: 1.0 + p * x**2, np.array([lower]), start, 0.5)
    assert branch.end == "fold"
    assert branch.limit == pytest.approx(0.25, rel=1e-4)


def test_a_refusal_is_no_fold() -> None:
    def respond(x: np.ndarray, p: float) -> np.ndarray:
        if x.max() > 1.5:
            raise NoEquilibriumError("grease", "too hot.", "Cool it.")
        return 1.0 + p * x**2

    branch = follow_branch(respond, np.array([1.0]), 0.01, 1.0)
    assert branch.end == "refused"
    assert branch.limit == pytest.approx(0.5 / 1.5**2, rel=0.01)
    assert "too hot" in branch.reason


def test_no_point_to_start_from_is_said() -> None:
    with pytest.raises(SpindleFemError, match="fixed point"):
        follow_branch(lambda x, p: 1.0 + p * x**2, np.array([1.0]), 1.0, 2.0)


def test_a_start_just_below_the_fold_follows_derivatives_that_err() -> None:
    """Left out of the differences, a quantity that counts turns the first tangent round."""

    def respond(x: np.ndarray, p: float) -> np.ndarray:
        first, second = x.T
        return np.stack([1.0 + p * second**2, first], axis=-1)

    start = 0.2499
    lower = (1.0 - np.sqrt(1.0 - 4.0 * start)) / (2.0 * start)
    for weak in (0, 1):
        branch = follow_branch(respond, np.full(2, lower), start, 0.5, weak=weak)
        assert branch.end == "fold"
        assert branch.limit == pytest.approx(0.25, rel=1e-4)
        assert branch.top == pytest.approx(2.0, rel=0.02)
