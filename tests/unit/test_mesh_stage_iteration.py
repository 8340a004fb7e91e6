"""The fixed point of stages: exact for few modes, and never more sure of itself than it may be."""

import numpy as np
import pytest

from spindle_fem.model.mesh.stage_iteration import UNKNOWN_CONTRACTION, StageIteration

RNG = np.random.default_rng(3)


def map_of(shares):
    """A linear map whose modes leave these shares of a change, and its fixed point."""
    turn = np.linalg.qr(RNG.normal(size=(len(shares), len(shares))))[0]
    slope, offset = turn @ np.diag(shares) @ turn.T, RNG.normal(size=len(shares))
    return (lambda put: slope @ put + offset), np.linalg.solve(np.eye(len(shares)) - slope, offset)


def stage(iteration, answer_to, put, size=1.0, answers=3):
    iteration.begin(size)
    for _ in range(answers):
        iteration.answered(put, answer_to(put))
        put = iteration.mixed()
    return put


def test_a_linear_map_of_two_modes_is_solved_in_three_answers():
    answer_to, exact = map_of([0.9, -0.5])
    assert stage(StageIteration(), answer_to, np.zeros(2)) == pytest.approx(exact, abs=1e-9)


def test_what_earlier_stages_told_solves_the_next_at_its_first_answer():
    answer_to, exact = map_of([0.9, -0.5])
    iteration = StageIteration()
    stage(iteration, answer_to, np.zeros(2))
    moved = exact + np.array([0.3, -2.0])
    assert stage(iteration, answer_to, moved, answers=1) == pytest.approx(exact, abs=1e-9)
    iteration.forget()
    put = stage(iteration, answer_to, moved, answers=1)
    assert np.abs(put - exact).max() > 1e-2


def test_the_first_answer_alone_is_taken_as_it_is():
    iteration = StageIteration()
    iteration.begin(1.0)
    answer = RNG.normal(size=5)
    assert iteration.answered(np.ones(5), answer) == pytest.approx(np.abs(answer - 1.0).max())
    assert iteration.mixed() is answer
    assert iteration.contraction == UNKNOWN_CONTRACTION


@pytest.mark.parametrize("largest", [0.05, 0.3, 0.6])
def test_what_is_left_of_a_change_is_less_than_the_measured_contraction_says(largest):
    """Mixing makes the changes themselves fall much faster than a plain iteration would."""
    shares = largest * np.array([1.0, -0.9, 0.7, 0.5, 0.4, 0.3, 0.2, 0.1])
    answer_to, exact = map_of(shares)
    iteration, told = StageIteration(), []
    for _ in range(8):
        iteration.begin(1.0)
        put = exact + RNG.normal(size=8)
        for _ in range(4):
            answer = answer_to(put)
            change = iteration.answered(put, answer)
            contraction = iteration.contraction
            if contraction < UNKNOWN_CONTRACTION:
                told.append(np.abs(answer - exact).max() / (contraction / (1.0 - contraction) * change))
            put = iteration.mixed()
    assert len(told) > 8
    assert max(told) < 1.0


def test_longer_steps_are_trusted_less_and_good_news_is_believed_slowly():
    answer_to, _ = map_of([0.1, 0.05])
    iteration = StageIteration()
    for _ in range(6):
        stage(iteration, answer_to, RNG.normal(size=2), size=10.0)
    known = iteration.contraction
    assert known < 0.25
    iteration.begin(20.0)
    assert iteration.contraction == pytest.approx(2.0 * known)
    iteration.begin(5.0)
    assert iteration.contraction == pytest.approx(2.0 * known)
    stage(iteration, map_of([1e-4, 1e-5])[0], RNG.normal(size=2), size=5.0, answers=2)
    assert iteration.contraction == pytest.approx(known)
