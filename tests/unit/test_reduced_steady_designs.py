"""Steady designs on a spindle of one unknown per part, against the transient that leads to them."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.framework.term import Term
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.steady_designs import SteadyDesigns
from spindle_fem.operation.coefficients import free_parameters
from spindle_fem.operation.operating_point import OperatingPoint
from tests.support.lumped_spindle import lumped_model


@pytest.fixture(scope="module")
def spec():
    return load_machine("recorded_spindle")


@pytest.fixture(scope="module")
def fast(spec):
    return FastModel(lumped_model(spec), spec)


@pytest.fixture(scope="module")
def point(spec):
    return OperatingPoint.of(spec)


@pytest.fixture(scope="module")
def designs(fast, spec, point):
    return SteadyDesigns(fast, point, tuple(free_parameters(spec)), error=1e-6)


def inputs(point):
    values = (point.speed, point.thrust, point.ambient_temperature, point.coolant_inlet_temperature)
    return np.array([[*values, point.coolant_flow]])


def loads_of(fast, point, names, log_factors):
    factors = fast.table.factors(dict(zip(names, np.exp(log_factors), strict=True)))
    return fast.load_inputs(STANDARD, inputs(point), factors)[0]


def draws(designs, number, seed=3):
    rng = np.random.default_rng(seed)
    return designs.limits * rng.uniform(-0.99, 0.99, (number, len(designs.names)))


def test_a_design_is_where_its_transient_ends(fast, designs, point):
    [log] = draws(designs, 1)
    found = designs.temperatures(log, designs.amounts(loads_of(fast, point, designs.names, log))[0])
    times = np.linspace(0.0, 4.0e6, 4000)
    drive = make_drive(
        times,
        STANDARD,
        np.repeat(inputs(point), times.size, axis=0),
        np.ones(len(STANDARD), dtype=bool),
        largest_step=1.0e4,
    )
    factors = dict(zip(designs.names, np.exp(log).tolist(), strict=True))
    run = simulate_fast(fast, drive, 293.15, parameters=factors)
    assert found == pytest.approx(run.temperature[-1], abs=2e-5)
    assert np.ptp(found) > 3.0


def test_many_are_each_alone(fast, designs, point):
    logs = draws(designs, 300)
    amounts = designs.amounts(np.vstack([loads_of(fast, point, designs.names, log) for log in logs]))
    together = designs.many(logs, amounts)
    alone = [designs.temperatures(log, amount) for log, amount in zip(logs, amounts, strict=True)]
    assert together == pytest.approx(np.array(alone), abs=1e-9)
    assert np.ptp(together, axis=0).min() > 0.1


def test_all_fluids_at_one_temperature_and_no_heat_leave_no_other(designs, fast):
    amounts = np.where([name in ("ambient", "coolant_inlet") for name in designs.loads], 301.0, 0.0)
    for log in draws(designs, 5):
        assert designs.temperatures(log, amounts) == pytest.approx(301.0, abs=1e-6)


def test_a_smaller_basis_says_its_error(fast, spec, point, designs):
    rough = SteadyDesigns(fast, point, designs.names, error=0.5)
    assert rough.size <= designs.size
    logs = draws(designs, 40, seed=8)
    amounts = designs.amounts(np.vstack([loads_of(fast, point, designs.names, log) for log in logs]))
    error = np.abs(rough.many(logs, amounts) - designs.many(logs, amounts)).max()
    assert error < 2.0 * max(rough.checked_error, 1e-6)


def test_what_is_outside_the_range_is_refused(fast, designs, point):
    log = np.zeros(len(designs.names))
    place = designs.names.index("coolant.film_factor")
    log[place] = 1.01 * designs.limits[place]
    load = np.ones(len(designs.loads))
    with pytest.raises(OutOfValidityError, match=r"factor 1\.58 on coolant\.film_factor.*0\.638 to 1\.57"):
        designs.temperatures(log, load)
    with pytest.raises(OutOfValidityError, match=r"coolant\.film_factor"):
        designs.many(np.array([0.0 * log, log]), np.array([load, load]))


def test_a_load_that_is_not_named_is_refused(fast, designs, point):
    load = loads_of(fast, point, (), ())
    assert designs.amounts(load) @ designs._rows == pytest.approx(load, abs=1e-9)
    load[0, fast.load_names.index("F2.inner_raceway")] += 5.0
    with pytest.raises(SpecError, match=r"F2.inner_raceway has a load.*front.inner_raceway, front.outer"):
        designs.amounts(load)
    own = {name: np.eye(len(fast.load_names))[i] for i, name in enumerate(fast.load_names)}
    single = SteadyDesigns(fast, point, (), own, error=1e-6)
    assert single.temperatures(np.zeros(0), single.amounts(load)[0]).shape == (len(fast.channels),)


def test_an_unknown_parameter_is_refused(fast, point):
    with pytest.raises(SpecError, match=r"coolant.film_facto.*no parameter of this machine"):
        SteadyDesigns(fast, point, ("coolant.film_facto",))


def test_loads_that_follow_temperatures_are_refused(fast, spec, point):
    class Follows(Term):
        name = "follows"

    with pytest.raises(SpecError, match=r"follow its temperatures.*backend = \"reduced\""):
        SteadyDesigns(FastModel(fast.model, spec, (Follows(),)), point, ())


def test_an_error_that_no_basis_reaches_is_refused(fast, point):
    with pytest.raises(ConvergenceError, match=r"still err by .* Asked: 1e-30 K"):
        SteadyDesigns(fast, point, ("coolant.film_factor",), error=1e-30)


def test_designs_without_parameters_differ_in_their_loads_only(fast, point):
    fixed = SteadyDesigns(fast, point, (), error=1e-6)
    load = fixed.amounts(loads_of(fast, point, (), ()))[0]
    warm = load + np.where(load > 200.0, 5.0, 0.0)
    first, second = (fixed.temperatures(np.zeros(0), item) for item in (load, warm))
    assert second - first == pytest.approx(5.0, abs=1e-6)
    other = SteadyDesigns(fast, replace(point, coolant_flow=0.5 * point.coolant_flow), (), error=1e-6)
    assert np.abs(other.temperatures(np.zeros(0), load) - first).max() > 0.1
