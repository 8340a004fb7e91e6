"""Tight and loose rings as two answers of one set: which one stands, and what is stated of both."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Coordinate
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.other_answers import draws_of, other_starts, with_other_answers

CLEARANCE, SIZE = "preload.outer_clearance", "preload.friction_increase_at_10K"
COORDINATES = (
    Coordinate(SIZE, 0.0, 0.1, False, 0.0, np.inf, ""),
    Coordinate(CLEARANCE, 5.0e-6, 1.0e-5, False, -2.0, 4.0, "m"),
)
PROBLEMS = SimpleNamespace(of=lambda fit: None)
STARTS = tuple({CLEARANCE: clearance} for clearance in (5.0e-6, 18.0e-6, 31.0e-6))


def candidate(effect="thermal_preload"):
    return Candidate(
        effect, "front_bearings", "bearing mechanics", "missing_physics", SIZE, 0.0, 0.1, starts=STARTS
    )


def fit_at(clearance, cost=100.0, sigma=0.2, effect="thermal_preload"):
    """A fit that ended at a clearance in µm, with a standard deviation in units of the prior's."""
    position = np.array([1.0, (clearance - 5.0) / 10.0])
    covariance = np.diag([0.1, sigma]) ** 2
    evidence = -0.5 * cost + 0.5 * float(np.linalg.slogdet(covariance)[1])
    return Fit(
        (candidate(effect),),
        COORDINATES,
        position,
        covariance,
        evidence,
        cost,
        cost,
        np.zeros(100),
        SimpleNamespace(),
        SimpleNamespace(),
    )


def answered(first, by_start, effect="thermal_preload"):
    """What stands after fits from the other starts ended as told, by the start in µm."""
    asked = []

    def fits(problem, orders):
        asked.extend(round(1e6 * order.start[CLEARANCE]) for order in orders)
        return [by_start[round(1e6 * order.start[CLEARANCE])] for order in orders]

    (found,) = with_other_answers(PROBLEMS, [Hypothesis(first, -1.0)], SimpleNamespace(fits=fits))
    return found.fit, asked


def clearance_of(fit):
    return 1e6 * fit.values[CLEARANCE]


def test_every_start_but_the_nearest_is_fitted_with_the_rest_as_it_was():
    assert [start[CLEARANCE] for start in other_starts(fit_at(15.0))] == [5.0e-6, 31.0e-6]
    assert other_starts(fit_at(15.0, effect="starvation")) == []


def test_the_likelier_answer_stands_and_the_other_is_kept():
    found, asked = answered(fit_at(4.0), {18: fit_at(20.0, cost=90.0), 31: None})
    assert asked == [18, 31]
    assert clearance_of(found) == pytest.approx(20.0)
    assert [clearance_of(fit) for fit in found.others] == pytest.approx([4.0])


def test_fits_that_end_at_the_same_place_are_one_answer():
    found, _ = answered(fit_at(4.0), {18: fit_at(5.0, cost=101.0), 31: fit_at(24.0, cost=103.0)})
    assert clearance_of(found) == pytest.approx(4.0)
    assert [clearance_of(fit) for fit in found.others] == pytest.approx([24.0])


def test_sets_far_behind_and_effects_of_one_answer_are_left_alone():
    behind = fit_at(4.0, cost=100.0 + 3.0 * tuned.NEGLIGIBLE_SCORE)
    other = fit_at(4.0, effect="starvation")
    sets = [Hypothesis(other, -1.0), Hypothesis(behind, -1.0)]
    nothing = SimpleNamespace(fits=lambda problem, orders: [pytest.fail("fitted") for _ in orders])
    assert [h.fit for h in with_other_answers(PROBLEMS, sets, nothing)] == [
        other,
        behind,
    ]


@pytest.mark.parametrize(("loose", "asked"), [(90.0, [18, 31, 20]), (110.0, [18, 31])])
def test_a_set_that_holds_a_likelier_one_begins_where_that_moved(loose, asked):
    more = replace(fit_at(4.0, cost=101.0), candidates=(candidate(), candidate("radiation")))
    begun = []

    def fits(problem, orders):
        begun.extend(round(1e6 * order.start[CLEARANCE]) for order in orders)
        ends = [fit_at(20.0, cost=loose) for _ in orders]
        return [replace(e, candidates=o.candidates) for e, o in zip(ends, orders, strict=True)]

    sets = [Hypothesis(fit_at(4.0), -1.0), Hypothesis(more, -1.0)]
    part, whole = with_other_answers(PROBLEMS, sets, SimpleNamespace(fits=fits))
    assert begun == asked
    assert clearance_of(part.fit) == clearance_of(whole.fit) == pytest.approx(20.0 if loose < 100.0 else 4.0)


def test_draws_are_of_all_answers_by_what_each_holds():
    """Shares of two normal distributions, their misfits counted as widened intervals count them."""
    widening = tuned.INTERVAL_WIDENING**2
    found, _ = answered(fit_at(-5.0, sigma=0.1), {18: fit_at(35.0, cost=104.0, sigma=0.2), 31: None})
    draws = draws_of(found, np.random.default_rng(1), 20000)[:, 1]
    loose = draws > 1.5
    odds = 2.0 * np.exp(-0.5 * 4.0 / widening)
    assert loose.mean() == pytest.approx(odds / (1.0 + odds), abs=0.01)
    assert draws[loose].std() == pytest.approx(0.2 * tuned.INTERVAL_WIDENING, rel=0.05)
    assert draws[~loose].mean() == pytest.approx(-1.0, abs=0.01)
