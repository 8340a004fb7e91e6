"""Fits in which the prior of one number of a definition is given up."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.inference import freed_priors
from spindle_fem.inference.freed_priors import Freed
from spindle_fem.inference.heat_misdescriptions import Conductivity
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.misdescription import Factored
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, calibrate
from spindle_fem.inference.structural_misdescriptions import MaterialCapacity
from spindle_fem.inference.uncertain_numbers import uncertain_numbers
from tests.support.diagnosed_spindle import TIMES, Case, written


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return Case(tmp_path_factory.mktemp("freed"))


def freed_about(case, name, factor):
    """Problem, fit and freed numbers of a machine one of whose parameters is off by a factor."""
    predictor = Predictor(case.fast, [case.blank])
    true = predictor.predict(0, {name: factor}).temperature
    at_stamps = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in true.T]).T
    noise = np.random.default_rng(2).normal(0.0, 0.1, at_stamps.shape)
    seen = Predictor(case.fast, [written(case.folder, at_stamps - 273.15 + noise)])
    directions = misdescriptions_of(seen)
    seen = with_misdescriptions(seen, directions)
    problem = Problem(seen, calibrate(None, seen).belief, EXPECTED_SLOW, seen.observations)
    null = problem.fit()
    return problem, null, Freed.of(problem, null, (*directions, *uncertain_numbers(case.spec)))


def found(freed, name):
    """What is explained by a number, and the logarithm of the factor that it is off by."""
    k = next(k for k, item in enumerate(freed.items) if item.name == name)
    return freed.misfit[k], freed.items[k].sigma * freed.position[k]


@pytest.mark.parametrize(("name", "factor"), [("gap.air_gap", 9.0), ("coolant.film_factor", 0.25)])
def test_a_number_that_is_far_off_is_found_where_first_order_misses_it(case, name, factor):
    problem, null, first = freed_about(case, name, factor)
    (_, foreseen), (explained, value) = found(first, name), found(first.fitted(problem, null), name)
    assert value == pytest.approx(np.log(factor), abs=0.1)
    assert abs(foreseen - np.log(factor)) > 1.4 * abs(value - np.log(factor))
    # the prior that takes the place of one given up is part of both
    belief = freed_priors.without_prior(problem.belief, first.rows[[i.name for i in first.items].index(name)])
    fit = replace(problem, belief=belief).fit((), null.values | {name: factor})
    assert explained == pytest.approx(null.misfit_with_prior - fit.misfit_with_prior, abs=0.1)


def test_what_explains_little_or_cannot_be_simulated_stays_of_first_order(case, monkeypatch):
    problem, null, first = freed_about(case, "gap.air_gap", 1.5)
    monkeypatch.setattr(Problem, "simulated", lambda *given: pytest.fail("fitted"))
    assert max(first.misfit) < freed_priors.FITTED_FROM
    np.testing.assert_array_equal(first.fitted(problem, null).position, first.position)
    problem, null, first = freed_about(case, "gap.air_gap", 9.0)
    monkeypatch.setattr(Problem, "simulated", lambda *given: None)
    np.testing.assert_array_equal(first.fitted(problem, null).misfit, first.misfit)


@pytest.mark.parametrize("change", [Conductivity("cast_iron"), MaterialCapacity("c", material="cast_iron")])
def test_a_material_is_changed_by_the_factor_that_was_fitted(case, change):
    assert isinstance(change, Factored)
    given = change.quantity(case.spec).value
    for factor in (0.4, 1.0, 2.5):
        changed = change.redefined(case.spec, change.of_factor(factor))
        assert change.quantity(changed).value == pytest.approx(factor * given)


def test_a_number_counts_as_the_values_of_a_definition_that_it_stands_for(case):
    stands_for = {item.name: item.stands_for for item in uncertain_numbers(case.spec)}
    assert stands_for["heat_capacity_factor"] == len(case.spec.materials) == 3
    assert stands_for["shaft_end_films"] == 2
    assert stands_for["film.outside"] == 1
