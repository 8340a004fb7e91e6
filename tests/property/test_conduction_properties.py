"""What every conduction solution obeys: linearity, maximum principle, balance, symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.model.mesh.step_control import StepControl
from spindle_fem.model.mesh.thermal_state import uniform_state
from spindle_fem.model.mesh.time_stepper import integrate

OPERATORS = {
    order: build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 12, 1)), order)
    for order in (1, 2)
}
log_range = st.floats(-1.0, 3.5).map(lambda x: 10.0**x)
orders = st.sampled_from([1, 2])
methods = st.sampled_from(["direct", "multigrid"])


@st.composite
def problems(draw):
    operators = OPERATORS[draw(orders)]
    n = len(operators.facet_areas("outer.outer"))
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    return ConductionProblem(
        operators,
        {"inner": draw(log_range), "outer": draw(log_range)},
        films=(
            Film("outer.outer", rng.uniform(0.1, 1.0, n) * draw(log_range), rng.uniform(280.0, 340.0, n)),
            Film("inner.z0", draw(log_range), draw(st.floats(280.0, 340.0))),
        ),
        joint_conductance={"inner|outer": draw(log_range) * 10.0},
        lumped_nodes=(LumpedNode("balls", (("inner.z1", draw(log_range)), ("outer.z1", draw(log_range)))),),
        volumetric_capacity={"inner": 3.6e6, "outer": 3.6e6},
        adiabatic="rest",
    )


@settings(max_examples=40)
@given(problems(), st.floats(1.0, 1e4), methods)
def test_twice_the_heat_gives_twice_the_rise(problem, heat, method):
    cold = solve_steady(problem, method=method).temperature
    once = solve_steady(replace(problem, surface_heat={"inner.inner": heat}), method=method).temperature
    twice = solve_steady(
        replace(problem, surface_heat={"inner.inner": 2.0 * heat}), method=method
    ).temperature
    scale = np.abs(twice - cold).max()
    np.testing.assert_allclose(twice - cold, 2.0 * (once - cold), rtol=0, atol=1e-7 * max(scale, 1.0))


@settings(max_examples=40)
@given(problems())
def test_without_heat_surroundings_bound_the_mean_temperatures(problem):
    """Facet means and lumped nodes stay between the coldest and the hottest surroundings."""
    solution = solve_steady(problem)
    low = min(np.min(film.ambient_temperature) for film in problem.films)
    high = max(np.max(film.ambient_temperature) for film in problem.films)
    assert low - 0.01 <= solution.lumped_temperature[0] <= high + 0.01
    part = problem.operators.part_of_unknown
    for index in range(2):
        own = part == index
        mean = (
            problem.operators.part_load[own]
            @ solution.temperature[own]
            / problem.operators.part_load[own].sum()
        )
        assert low <= mean <= high


@settings(max_examples=40)
@given(problems(), st.floats(0.0, 1e4), st.floats(0.0, 1e4), methods)
def test_heat_in_equals_heat_out(problem, surface, part, method):
    loaded = replace(problem, surface_heat={"inner.inner": surface}, part_heat={"outer": part})
    balance = solve_steady(loaded, method=method).balance
    assert balance.imbalance_relative < 1e-10
    assert abs(sum(balance.films.values()) - surface - part) < 1e-9 * balance.turnover


@settings(max_examples=25)
@given(problems())
def test_matrix_is_symmetric_and_carries_no_heat_of_its_own(problem):
    system = assemble_system(problem)
    matrix = system.full_matrix()
    assert abs(matrix - matrix.T).max() == 0.0
    no_films = replace(problem, films=())
    ones = np.ones(matrix.shape[0])
    residual = assemble_system(no_films).full_matrix() @ ones
    assert np.abs(residual).max() < 1e-12 * abs(matrix).max()


@settings(max_examples=15)
@given(problems(), st.floats(10.0, 1e3), st.floats(1.0, 1e5))
def test_stored_heat_is_heat_in_minus_heat_out(problem, heat, span):
    loaded = replace(problem, part_heat={"inner": heat})
    result = integrate(loaded, uniform_state(loaded, 300.0), span, control=StepControl(tolerance=0.5))
    assert result.energy.imbalance_relative < 1e-8
