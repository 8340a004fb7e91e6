"""Courses of hidden states and changes of level, found in small linear systems whose truth is known."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from spindle_fem.inference.change_points import find_changes, levels_over_lowest
from spindle_fem.inference.switching_model import (
    Chain,
    LinearAnswer,
    ReadingFilter,
    Readings,
    find_course,
    sizes_of,
    with_another_level,
)

STEPS, STEP, CAPACITY, LOSS, HEAT = 700, 60.0, 20_000.0, 25.0, 300.0
# Of a mass that follows within two steps: heat that flickers is none of a lower level.
QUICK_MASS = 3_000.0


def one_mass(conductance: bool = False, capacity: float = CAPACITY) -> LinearAnswer:
    """A mass that loses heat to its surroundings, 20 K below it where a conductance is asked for."""
    kept = np.exp(-LOSS / capacity * STEP)
    unit = (1.0 - kept) / LOSS
    return LinearAnswer(
        np.array([[[kept]]]),
        np.array([[[unit if conductance else 0.0]]]),
        np.zeros(STEPS, dtype=np.int64),
        np.full((STEPS, 1), -20.0 * unit if conductance else unit),
        np.arange(STEPS) == 0,
        np.zeros(STEPS, dtype=np.int64),
        np.ones((1, 1, 1)),
    )


def truth(generator: np.random.Generator, condition: np.ndarray) -> np.ndarray:
    """A sticky course that begins only where a condition holds."""
    on = np.zeros(STEPS, dtype=bool)
    for t in range(1, STEPS):
        chance = 0.9 if on[t - 1] else 0.06 * condition[t]
        on[t] = generator.random() < chance
    return on


def at_levels(generator: np.random.Generator) -> np.ndarray:
    """Something that is on a third of the time, in turn at one level and at two fifths of it."""
    share = np.zeros(STEPS)
    for number, begin in enumerate(range(20, STEPS - 30, 45)):
        share[begin : begin + generator.integers(8, 22)] = (1.0, 0.4)[number % 2]
    return share


def readings(answer: LinearAnswer, on: np.ndarray, size: float, generator: np.random.Generator) -> Readings:
    """What a channel reads with noise of 0.2 K, beside an offset of unit prior that nobody knows."""
    state, found = np.zeros(1), np.zeros((STEPS, 1))
    for t in range(STEPS):
        added = answer.entering[t] - answer.loss[0] @ state
        state = answer.advance[0] @ state + size * on[t] * added
        found[t] = answer.outputs @ state
    noisy = found + 0.7 + 0.2 * generator.standard_normal((STEPS, 1))
    noisy[100:130] = np.nan
    slopes = np.ones((STEPS, 1, 1))
    slow = np.array([0.02]), np.array([1800.0])
    return Readings(noisy, np.full((STEPS, 1), 0.04), slopes, np.full(STEPS, STEP), *slow)


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    """F1 of two courses by time."""
    return 2.0 * float((one & other).sum()) / float(one.sum() + other.sum())


@pytest.mark.parametrize("conductance", [False, True])
def test_a_course_and_its_size_are_found_together(conductance):
    generator = np.random.default_rng(3)
    condition = (np.arange(STEPS) // 70) % 2
    on, answer = truth(generator, condition), one_mass(conductance)
    size = 40.0 if conductance else HEAT
    filter_ = ReadingFilter(readings(answer, on, size, generator))
    found = find_course(answer, filter_, Chain.usual(condition), 0.3 * size, 4.0 * size)
    assert overlap(found.on, on) > 0.85
    assert found.size == pytest.approx(size, rel=0.1)
    assert found.log_evidence > 100.0
    # The probability says how sure the course is.
    assert found.probability[found.on].mean() > 0.85
    assert found.probability[~found.on].mean() < 0.1
    assert found.chain.begin[1] > 2.0 * found.chain.begin[0]


@pytest.mark.parametrize("conductance", [False, True])
def test_levels_of_what_is_on_are_found_where_there_are_two(conductance):
    generator = np.random.default_rng(13)
    share, answer = at_levels(generator), one_mass(conductance, QUICK_MASS)
    size = 15.0 if conductance else HEAT
    filter_ = ReadingFilter(readings(answer, share, size, generator))
    single = find_course(answer, filter_, Chain.usual(np.zeros(STEPS, dtype=int)), size, 4.0 * size)
    found = with_another_level(answer, filter_, single, 4.0 * size)
    assert sorted(found.size * np.array(found.shares)) == pytest.approx([0.4 * size, size], rel=0.1)
    sizes = np.where(found.on, found.size * np.concatenate(([0.0], found.shares))[found.level], 0.0)
    assert np.mean(np.abs(sizes - size * share) < 0.1 * size) > 0.93
    # There is no third one.
    assert with_another_level(answer, filter_, found, 4.0 * size) is None


def test_one_level_stays_one():
    generator = np.random.default_rng(17)
    on, answer = at_levels(generator) > 0.0, one_mass(capacity=QUICK_MASS)
    filter_ = ReadingFilter(readings(answer, on, HEAT, generator))
    single = find_course(answer, filter_, Chain.usual(np.zeros(STEPS, dtype=int)), HEAT, 4.0 * HEAT)
    assert with_another_level(answer, filter_, single, 4.0 * HEAT) is None


def test_moves_between_levels_are_probabilities():
    chain = Chain(np.array([0.02, 0.1]), np.array([0.05, 0.2]), np.zeros(STEPS, dtype=int))
    for levels in (1, 2, 3):
        moves = np.exp(chain.log_moves(levels))
        np.testing.assert_allclose(moves.sum(axis=2), 1.0)
        np.testing.assert_allclose(moves[:, 0, 1:].sum(axis=1), chain.begin)
        np.testing.assert_allclose(1.0 - moves[:, 1, 1], chain.end)


def test_nothing_is_found_in_noise():
    generator = np.random.default_rng(5)
    answer = one_mass()
    filter_ = ReadingFilter(readings(answer, np.zeros(STEPS, dtype=bool), 0.0, generator))
    found = find_course(answer, filter_, Chain.usual(np.zeros(STEPS, dtype=np.int64)), HEAT, 3.0 * HEAT)
    assert found is None or found.log_evidence < 3.0


def test_the_size_of_a_known_course_has_the_error_that_it_states():
    generator = np.random.default_rng(7)
    answer = one_mass()
    on = truth(generator, np.ones(STEPS))
    apart = []
    for _ in range(30):
        filter_ = ReadingFilter(readings(answer, on, HEAT, generator))
        sizes, sigma = sizes_of(answer, filter_, on.astype(int), np.array([HEAT]), 10.0 * HEAT)
        apart.append((sizes[0] - HEAT) / sigma)
    assert 0.6 < np.std(apart) < 1.5


def test_changes_are_found_and_no_more():
    generator = np.random.default_rng(11)
    count, kept = 90, 0.9
    # Answers of one lag to a unit step at each instant, four readings to an instant.
    times = np.arange(4 * count) / 4.0
    answers = np.where(
        times[:, None] >= np.arange(count), 1.0 - kept ** (times[:, None] - np.arange(count)), 0.0
    )
    read = 3.0 * answers[:, 30] - 2.0 * answers[:, 62] + 0.3 * generator.standard_normal(len(times))
    found = find_changes(answers.T @ answers / 0.09, answers.T @ read / 0.09, 3.0)
    assert found.at == (30, 62)
    np.testing.assert_allclose(found.steps, [3.0, -2.0], atol=0.2)
    intervals, levels = levels_over_lowest(found, np.arange(count, dtype=float), float(count))
    assert intervals == [(30.0, 62.0), (62.0, 90.0)]
    np.testing.assert_allclose(levels, [3.0, 1.0], atol=0.2)
    noise = 0.3 * generator.standard_normal(len(times))
    assert find_changes(answers.T @ answers / 0.09, answers.T @ noise / 0.09, 3.0) is None


def test_a_conductance_never_takes_more_in_a_step_than_there_is():
    generator = np.random.default_rng(4)
    answer = one_mass(conductance=True)
    on = truth(generator, np.ones(STEPS))
    filter_ = ReadingFilter(readings(answer, on, 40.0, generator))
    assert answer.largest == pytest.approx(CAPACITY / STEP, rel=0.05)
    assert one_mass().largest == np.inf
    found = find_course(answer, filter_, Chain.usual(np.zeros(STEPS, dtype=int)), 1e6, 1e6)
    assert found is None or np.isfinite(found.size + found.log_evidence)
    course = filter_.courses(answer, Chain.usual(np.zeros(STEPS, dtype=int)), np.array([1e6]), 24)
    assert not course[0].any()


def test_no_course_at_two_levels_is_lost_that_is_likelier_than_what_is_found():
    """Against all courses, where a sensor behind two further masses answers late."""
    steps, sizes, sigma = 8, np.array([1.0, 2.0]), 0.05
    advance = np.array([[[0.6, 0.2, 0.0], [0.3, 0.5, 0.2], [0.0, 0.3, 0.75]]])
    begins, entering = np.arange(steps) == 0, np.tile([1.0, 0.0, 0.0], (steps, 1))
    whole = np.zeros(steps, dtype=np.int64)
    answer = LinearAnswer(
        advance, np.zeros((1, 3, 3)), whole, entering, begins, whole, np.array([[[0.0, 0.0, 1.0]]])
    )
    chain = Chain(np.array([0.1]), np.array([0.2]), whole)
    courses = np.array(list(product(range(3), repeat=steps)))
    heat, state = np.concatenate(([0.0], sizes))[courses], np.zeros((len(courses), 3))
    read = np.empty(heat.shape)
    for step in range(steps):
        state = state @ advance[0].T
        state[:, 0] += heat[:, step]
        read[:, step] = state[:, 2]
    moves = chain.log_moves(2)[0]
    prior = moves[np.hstack((np.zeros((len(courses), 1), dtype=int), courses[:, :-1])), courses].sum(axis=1)
    true = np.flatnonzero((courses == [0, 0, 2, 2, 0, 0, 0, 0]).all(axis=1))[0]
    slow = np.array([1e-6]), np.array([300.0])
    for seed in range(12):
        residual = read[true] + np.random.default_rng(seed).normal(0.0, sigma, steps)
        variance, slopes = np.full((steps, 1), sigma**2), np.zeros((steps, 1, 0))
        seen = Readings(residual[:, None], variance, slopes, np.full(steps, STEP), *slow)
        level, *_ = ReadingFilter(seen).courses(answer, chain, sizes, 2000)
        weight = prior - 0.5 * np.sum((residual - read) ** 2, axis=1) / sigma**2
        found = np.flatnonzero((courses == level).all(axis=1))[0]
        assert weight[found] > weight.max() - 1e-3
