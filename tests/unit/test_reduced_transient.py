"""The fast model on a spindle of one unknown per part, where everything can be checked by hand."""

from pickle import loads

import numpy as np
import pytest
from joblib.externals.loky.backend.reduction import dumps

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.model.reduced.term_march import TermMarch
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.coefficient_table import free_parameters
from spindle_fem.physics.surroundings.still_air import outside_coefficient
from tests.support.lumped_spindle import drive_of, with_natural_film


def test_nothing_changes_where_everything_has_one_temperature(fast):
    times = np.arange(0.0, 20000.0, 50.0)
    run = simulate_fast(fast, drive_of(times, 0.0, ambient=300.0, inlet=300.0), 300.0)
    assert np.abs(run.temperature - 300.0).max() < 1e-9


def test_steady_state_carries_away_exactly_the_heat_put_in(fast, spec):
    times = np.linspace(0.0, 3.0e6, 4000)
    drive = drive_of(times, 3000.0)
    run = simulate_fast(fast, drive, 293.15)
    point = drive.points[0]
    state = run.states[-1]
    nodes = dict(zip(fast.model.place_names, fast.model.places @ state, strict=True))
    coefficients = fast.coefficients(point, {})
    out = sum(
        coefficients[name] * (load @ (state - 293.15))
        for name, load in zip(fast.model.fluid_names, fast.model.fluid_load, strict=True)
    )
    _, capacity_rate, _ = fast.channel.film(point, {})
    taken = capacity_rate * (run.temperature[-1, fast.channels.index("COOLANT_OUT")] - 290.15)
    assert out + taken == pytest.approx(2 * 155 + 140 + 2 * 85, rel=1e-7)
    assert nodes["F1.inner_ring"] > nodes["F1.outer_ring"] > nodes["housing"] > 290.15


def test_heat_scales_the_rise_in_proportion(fast):
    times = np.arange(0.0, 7200.0, 30.0)
    drive = drive_of(times, 3000.0, inlet=293.15)
    one = simulate_fast(fast, drive, 293.15).temperature - 293.15
    double = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 2.0, "heat.rear": 2.0}).temperature
    assert double - 293.15 == pytest.approx(2.0 * one, abs=1e-9)


def test_factors_do_what_changed_definitions_do(fast, spec, steps):
    factors = {
        "heat.front": 1.2,
        "joint.inner_ring_seats": 0.7,
        "shaft_end_films": 1.4,
        "heat_capacity_factor": 1.1,
        "coolant.film_factor": 0.8,
        "heat.inner_share": 1.1,
        "gap.air_gap": 1.3,
        "ball_conductance": 0.6,
    }
    by_factor = simulate_fast(fast, steps, 293.15, parameters=factors).temperature
    changed = fast_spindle(fast.model, with_parameters(spec, factors))
    assert simulate_fast(changed, steps, 293.15).temperature == pytest.approx(by_factor, abs=1e-9)


def test_every_derivative_is_that_of_differences(fast, spec, steps):
    names = (*free_parameters(spec), "heat.F2", "joint.F1.outer_ring|housing", "film.housing.outside")
    start = {"heat.front": 1.1, "heat.inner_share": 0.95, "coolant.film_factor": 1.2}
    run = simulate_fast(fast, steps, 293.15, parameters=start, derivatives=names)
    for column, name in enumerate(names):
        ends = [
            simulate_fast(
                fast, steps, 293.15, parameters={**start, name: start.get(name, 1.0) * np.exp(sign * 1e-5)}
            ).temperature
            for sign in (1.0, -1.0)
        ]
        difference = (ends[0] - ends[1]) / 2e-5
        assert run.sensitivity[:, :, column] == pytest.approx(difference, abs=1e-6), name


def test_halving_the_steps_changes_little_and_less_each_time(fast):
    runs = []
    for step in (120.0, 60.0, 30.0):
        times = np.arange(0.0, 7200.1, step)
        drive = drive_of(times, 3000.0)
        drive = make_drive(
            times,
            STANDARD,
            np.repeat(drive.start[:1], times.size, axis=0),
            np.ones(5, dtype=bool),
            largest_step=step,
        )
        runs.append(simulate_fast(fast, drive, 293.15).temperature[-1])
    assert np.abs(runs[2] - runs[1]).max() < 0.5 * np.abs(runs[1] - runs[0]).max()
    assert np.abs(runs[2] - runs[1]).max() < 1e-3


def test_a_natural_film_carries_what_its_correlation_says(fast):
    natural = with_natural_film(fast)
    times = np.linspace(0.0, 5.0e5, 334)
    # Not at the definition's own ambient temperature.
    drive = drive_of(times, 3000.0, ambient=296.15)
    run = simulate_fast(natural, drive, 293.15)
    wall = natural.model.place("housing") @ run.states[-1]
    coefficient = outside_coefficient(np.array([wall]), 296.15, 0.3, 0.9, orientation="horizontal_cylinder")[
        0
    ]
    point = drive.points[0]
    values = natural.coefficients(point, {}) | {"film.housing.outside": coefficient}
    out = sum(
        values[name] * (load @ (run.states[-1] - 296.15))
        for name, load in zip(natural.model.fluid_names, natural.model.fluid_load, strict=True)
    )
    _, rate, _ = natural.channel.film(point, {})
    taken = rate * (run.temperature[-1, natural.channels.index("COOLANT_OUT")] - 290.15)
    assert out + taken == pytest.approx(2 * 155 + 140 + 2 * 85, rel=1e-6)


def test_natural_films_of_a_whole_run_are_those_step_by_step(fast, monkeypatch):
    natural = with_natural_film(fast)
    times = np.linspace(0.0, 7200.0, 121)
    drive = drive_of(times, 3000.0 * (times < 4000.0), ambient=294.15 + 4.0 * np.sin(times / 900.0))
    run = simulate_fast(natural, drive, 293.15)
    monkeypatch.setattr(TermMarch, "_at_once", lambda self, near, close: None)
    stepped = simulate_fast(natural, drive, 293.15)
    assert np.ptp(run.states) > 5.0
    assert np.abs(run.states - stepped.states).max() < 1e-6


def test_unknown_parameters_and_other_heat_models_are_refused(fast, spec, steps):
    with pytest.raises(SpecError, match=r'Did you mean "heat.front"'):
        simulate_fast(fast, steps, 293.15, parameters={"heat.frnt": 1.0})
    with pytest.raises(SpecError, match=r"the share becomes 1.5"):
        simulate_fast(fast, steps, 293.15, parameters={"heat.inner_share": 3.0})
    other = fast_spindle(fast.model, load_machine("recorded_spindle", ["heat.model=palmgren"]))
    with pytest.raises(SpecError, match=r"takes heat.model"):
        simulate_fast(other, steps, 293.15)


def test_a_model_goes_to_another_process_without_its_remembered_sums(fast, steps):
    point = steps.points[0]
    expected = fast.operators(point, {}, ("film.outside",))
    there = loads(dumps(fast))
    assert fast._sums
    assert not there._sums
    found = there.operators(point, {}, ("film.outside",))
    assert np.array_equal(found.conduction, expected.conduction)
    assert np.array_equal(found.conduction_by["film.outside"], expected.conduction_by["film.outside"])


def test_the_range_of_the_basis_is_watched(fast):
    assert fast.model.outside_range({"film.housing.outside": 10.0, "gap.air_gap": 1e9}) == ()
    assert fast.model.outside_range({"film.housing.outside": 30.0}) == ("film.housing.outside",)


def test_a_model_comes_back_from_disk_as_it_was(fast, tmp_path):
    path = tmp_path / "model.npz"
    fast.model.save(path)
    again = ThermalModel.load(path)
    assert again.ranges == fast.model.ranges
    assert again.coefficient_names == fast.model.coefficient_names
    assert np.array_equal(again.operators, fast.model.operators)
    path.write_bytes(path.read_bytes()[:1000])
    assert ThermalModel.load(path) is None
    assert ThermalModel.load(tmp_path / "none.npz") is None
