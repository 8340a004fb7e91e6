"""Steps in time: restart, breakpoints, sampling, refusals; simple structured meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.errors import BadInputError, ConvergenceError, GeometryError, SpecError
from spindle_fem.machine.meshing.simple_bodies import (
    Block,
    build_box,
    build_joined_tubes,
    build_structured_mesh,
    signed_inverse_condition,
)
from spindle_fem.model.mesh import time_stepper
from spindle_fem.model.mesh.conduction_problem import (
    PERFECT_CONTACT,
    ConductionProblem,
    Film,
    FilmLaw,
    LumpedNode,
)
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.model.mesh.step_control import StepControl
from spindle_fem.model.mesh.thermal_state import ThermalState, uniform_state
from spindle_fem.model.mesh.time_stage import same_coefficients
from spindle_fem.model.mesh.time_stepper import StopTimes, integrate

OPERATORS = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 12, 2)), 1)
PROBLEM = ConductionProblem(
    OPERATORS,
    {"inner": 40.0, "outer": 20.0},
    films=(Film("outer.outer", 50.0, 293.15),),
    joint_conductance={"inner|outer": 1000.0},
    surface_heat={"inner.inner": 100.0},
    lumped_nodes=(LumpedNode("balls", (("inner.z0", 100.0), ("outer.z0", 100.0)), capacity=50.0, heat=10.0),),
    volumetric_capacity={"inner": 3.6e6, "outer": 3.6e6},
    adiabatic="rest",
)
START = uniform_state(PROBLEM, 293.15)


def test_restart_from_a_saved_state_goes_on_as_before(tmp_path):
    control = StepControl(tolerance=None, first_step=50.0, linear_tolerance=1e-10)
    whole = integrate(PROBLEM, START, 1000.0, control=control)
    half = integrate(PROBLEM, START, 500.0, control=control)
    half.state.save(tmp_path / "state.npz")
    rest = integrate(PROBLEM, ThermalState.load(tmp_path / "state.npz"), 1000.0, control=control)
    np.testing.assert_allclose(rest.state.temperature, whole.state.temperature, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        rest.state.lumped_temperature, whole.state.lumped_temperature, rtol=0, atol=1e-8
    )
    assert half.energy.stored + rest.energy.stored == pytest.approx(whole.energy.stored, rel=1e-9)


def test_files_that_hold_no_state_are_refused(tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(BadInputError, match="no saved thermal state"):
        ThermalState.load(tmp_path / "bad.npz")
    np.savez(tmp_path / "old.npz", schema="spindle-fem/thermal-state/0")
    with pytest.raises(BadInputError, match=r'schema "spindle-fem/thermal-state/0".*state/1'):
        ThermalState.load(tmp_path / "old.npz")


def test_jump_at_a_breakpoint_acts_from_there_on():
    """Heat on in [200, 600): the account holds exactly 400 s of it."""

    def inputs(time, state):
        return replace(PROBLEM, surface_heat={"inner.inner": 100.0 if 200.0 <= time < 600.0 else 0.0})

    result = integrate(
        inputs, START, 1000.0, stops=StopTimes((200.0, 600.0)), control=StepControl(tolerance=0.02)
    )
    assert result.energy.heat_in == pytest.approx(100.0 * 400.0 + 10.0 * 1000.0, rel=1e-9)
    assert {200.0, 600.0} <= set(result.step_times.tolist())
    assert result.energy.imbalance_relative < 1e-10


def test_steps_begin_anew_after_a_restart():
    control = StepControl(tolerance=0.05, first_step=0.5)
    result = integrate(PROBLEM, START, 5e4, stops=StopTimes(restarts=(3e4,)), control=control)
    sizes, begins = np.diff(result.step_times), result.step_times[:-1]
    assert 3e4 in begins
    assert sizes[begins == 3e4] == 0.5
    assert sizes[begins < 3e4].max() > 1000.0


def test_energy_closes_with_a_perfect_joint_and_a_node_without_capacity():
    node = replace(PROBLEM.lumped_nodes[0], capacity=0.0)
    problem = replace(PROBLEM, joint_conductance={"inner|outer": PERFECT_CONTACT}, lumped_nodes=(node,))
    for method in ("direct", "multigrid"):
        result = integrate(problem, START, 5e5, control=StepControl(tolerance=0.05, method=method))
        steady = solve_steady(problem)
        assert result.energy.imbalance_relative < 1e-9
        np.testing.assert_allclose(result.state.temperature, steady.temperature, rtol=0, atol=2e-3)
        assert result.state.lumped_temperature[0] == pytest.approx(steady.lumped("balls"), abs=2e-3)


def test_film_law_in_time_ends_at_its_steady_state():
    law = FilmLaw("outer.outer", lambda t: 2.0 + 1.3 * np.abs(t - 293.15) ** 0.25, 293.15)
    problem = replace(PROBLEM, films=(), film_laws=(law,))
    result = integrate(problem, START, 2e6, control=StepControl(tolerance=0.5))
    steady = solve_steady(problem)
    np.testing.assert_allclose(result.state.temperature, steady.temperature, rtol=0, atol=0.05)
    assert result.energy.imbalance_relative < 1e-8


def test_inputs_that_look_at_the_temperature_are_iterated():
    """A film coefficient of the mean temperature, against the same law with tiny steps."""

    def inputs(time, state):
        film = 20.0 + 0.5 * (state.temperature.mean() - 293.15)
        return replace(PROBLEM, films=(Film("outer.outer", film, 293.15),))

    results = [
        integrate(
            inputs, START, 4000.0, control=StepControl(tolerance=tolerance, temperature_dependent=True)
        ).state.temperature
        for tolerance in (0.05, 0.0005)
    ]
    np.testing.assert_allclose(results[0], results[1], rtol=0, atol=0.1)


def test_a_stage_that_does_not_settle_takes_a_shorter_step(monkeypatch):
    """Few iterations suffice for a strong coupling only where little time passes."""

    def inputs(time, state):
        film = 20.0 + 20.0 * (state.temperature.mean() - 293.15)
        return replace(PROBLEM, films=(Film("outer.outer", film, 293.15),))

    control = StepControl(
        tolerance=5.0, first_step=500.0, temperature_dependent=True, nonlinear_tolerance=1e-6
    )
    free = integrate(inputs, START, 1000.0, control=replace(control, tolerance=0.02))
    monkeypatch.setattr("spindle_fem.model.mesh.time_stage.MAX_STAGE_ITERATIONS", 3)
    held = integrate(inputs, START, 1000.0, control=control)
    assert held.rejected > 0
    np.testing.assert_allclose(held.state.temperature, free.state.temperature, rtol=0, atol=0.2)
    with pytest.raises(ConvergenceError, match="a stage still changes"):
        integrate(inputs, START, 1000.0, control=replace(control, tolerance=None))


def test_a_trusted_contraction_saves_solves_and_keeps_the_tolerance():
    """A film that follows the mean temperature: a weak coupling, known after the first step."""
    asked = []

    def inputs(time, state):
        asked.append(time)
        film = 20.0 + 0.5 * (state.temperature.mean() - 293.15)
        return replace(PROBLEM, films=(Film("outer.outer", film, 293.15),))

    def run(**settings):
        asked.clear()
        control = StepControl(tolerance=None, first_step=200.0, temperature_dependent=True, **settings)
        return integrate(inputs, START, 20000.0, control=control).state.temperature, len(asked)

    exact, _ = run(nonlinear_tolerance=1e-9)
    plain, calls = run(nonlinear_tolerance=1e-5)
    trusting, fewer = run(nonlinear_tolerance=1e-5, trust_contraction=True)
    assert fewer < 0.85 * calls
    assert np.abs(plain - exact).max() < 1e-5
    assert np.abs(trusting - exact).max() < 1e-5


def test_samples_lie_on_the_path():
    times = np.linspace(0.0, 2000.0, 41)
    mean = OPERATORS.part_load[None, :] / OPERATORS.part_load.sum()
    from scipy import sparse

    fine = StepControl(tolerance=2e-4)
    result = integrate(
        PROBLEM, START, 2000.0, outputs=sparse.csr_array(mean), sample_times=times, control=fine
    )
    coarse = integrate(
        PROBLEM,
        START,
        2000.0,
        outputs=sparse.csr_array(mean),
        sample_times=times,
        control=StepControl(tolerance=0.02),
    )
    assert np.all(np.diff(result.samples[:, 0]) > 0.0)
    np.testing.assert_allclose(coarse.samples, result.samples, rtol=0, atol=0.02)


def test_without_outputs_the_lumped_nodes_are_sampled():
    result = integrate(PROBLEM, START, 100.0, sample_times=[0.0, 100.0])
    assert result.samples[0, 0] == 293.15
    assert result.samples[1, 0] == result.state.lumped_temperature[0]


def test_observer_ends_the_run():
    result = integrate(PROBLEM, START, 1e6, observer=lambda state: state.time > 500.0)
    assert 500.0 < result.state.time < 1e6


def test_equal_steps_share_one_matrix():
    control = StepControl(tolerance=None, first_step=10.0)
    assert integrate(PROBLEM, START, 500.0, control=control).matrix_builds == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: integrate(PROBLEM, START, 0.0), "end time: 0 s is not after the start"),
        (lambda: integrate(PROBLEM, START, 9.0, sample_times=[1.0, 0.5]), "sample times: they do not rise"),
        (lambda: integrate(PROBLEM, START, 9.0, sample_times=[10.0]), "sample times"),
        (lambda: integrate(PROBLEM, replace(START, temperature=np.zeros(3)), 9.0), "another mesh"),
        (lambda: StepControl(tolerance=None), "neither a tolerance nor a step"),
        (lambda: StepControl(tolerance=-1.0), "step control: tolerance: -1.0"),
        (lambda: integrate(_other_capacity, START, 9.0), "heat capacities changed in time"),
        (lambda: integrate(_other_nodes, START, 9.0), "changed its mesh or its lumped nodes"),
        (
            lambda: integrate(replace(PROBLEM, volumetric_capacity={}), START, 9.0),
            "no value for inner, outer",
        ),
    ],
)
def test_unsound_transients_are_refused(call, message):
    with pytest.raises(SpecError, match=message):
        call()


def _other_capacity(time, state):
    capacity = {"inner": 3.6e6, "outer": 3.6e6 if time == 0.0 else 1e6}
    return replace(PROBLEM, volumetric_capacity=capacity)


def _other_nodes(time, state):
    return PROBLEM if time == 0.0 else replace(PROBLEM, lumped_nodes=())


def test_hidden_jump_is_an_error_that_asks_for_breakpoints(monkeypatch):
    monkeypatch.setattr("spindle_fem.model.mesh.time_stepper.MAX_REJECTIONS", 1)

    def inputs(time, state):
        return replace(PROBLEM, surface_heat={"inner.inner": 1e6 * (time > 50.0)})

    with pytest.raises(ConvergenceError, match="Name jumps of the inputs as breakpoints"):
        integrate(inputs, START, 100.0, control=StepControl(tolerance=1e-3, first_step=40.0))


def test_same_coefficients_ignores_heat_and_surroundings():
    warmer = replace(PROBLEM, films=(Film("outer.outer", 50.0, 300.0),), surface_heat={})
    assert same_coefficients(PROBLEM, warmer)
    for changed in (
        replace(PROBLEM, films=(Film("outer.outer", 51.0, 293.15),)),
        replace(PROBLEM, joint_conductance={"inner|outer": 999.0}),
        replace(PROBLEM, conductivity={"inner": 41.0, "outer": 20.0}),
        replace(
            PROBLEM, lumped_nodes=(replace(PROBLEM.lumped_nodes[0], connections=(("inner.z0", 100.0),)),)
        ),
    ):
        assert not same_coefficients(PROBLEM, changed)


def test_structured_meshes_have_positive_quality_and_exact_nodes():
    mesh = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((2, 2), 12, 2))
    assert mesh.min_quality == signed_inverse_condition(mesh.points, mesh.tetrahedra) > 0.2
    wall = mesh.points[np.unique(mesh.surfaces["outer.outer"])]
    np.testing.assert_allclose(np.hypot(wall[:, 0], wall[:, 1]), 0.2, rtol=1e-14)
    joint = mesh.joints["inner|outer"]
    np.testing.assert_array_equal(mesh.points[joint.facets_a], mesh.points[joint.facets_b])
    assert not set(joint.facets_a.ravel()) & set(joint.facets_b.ravel())
    for facets in mesh.surfaces.values():
        corner = mesh.points[facets[:, :3]]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        assert np.all(np.linalg.norm(normal, axis=1) > 0.0)


def test_surface_normals_point_outwards():
    mesh = build_box((1.0, 2.0, 3.0), (1, 2, 1))
    for facets in mesh.surfaces.values():
        corner = mesh.points[facets[:, :3]]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        outward = corner.mean(axis=1) - np.array([0.5, 1.0, 1.5])
        assert np.all(np.einsum("fx,fx->f", normal, outward) > 0.0)


def test_blocks_that_do_not_fit_are_refused():
    names = {face: face for face in ("u0", "u1", "v0", "v1", "w0", "w1")}
    one = Block("a", (1, 1, 1), lambda u: u, names)
    apart = Block("b", (1, 1, 1), lambda u: u + 5.0, names)
    with pytest.raises(GeometryError, match=r"joint a\|b: the two faces do not coincide"):
        build_structured_mesh([one, apart], [("a", "u1", "b", "u0")])
    with pytest.raises(GeometryError, match="two blocks carry the same part name"):
        build_structured_mesh([one, one])
    with pytest.raises(GeometryError, match="face v0 has no name"):
        build_structured_mesh([Block("a", (1, 1, 1), lambda u: u, {"u0": "x", "u1": "x"})])
    with pytest.raises(GeometryError, match=r"counts \(1, 0, 1\)"):
        build_box((1.0, 1.0, 1.0), (1, 0, 1))


def test_steps_follow_the_trend_of_their_error():
    """While a machine relaxes, each step is about as long as the error asked for lets it."""
    result = integrate(PROBLEM, START, 5e4, control=StepControl(tolerance=0.01, first_step=0.5))
    # The last steps are cut to end in time.
    sizes, errors = np.diff(result.step_times)[:-2], result.step_errors[:-2]
    assert (sizes[1:] / sizes[:-1]).max() <= 4.0 + 1e-9
    assert result.step_errors.max() <= 0.01
    grown = sizes > 10.0 * sizes[0]
    assert np.median(errors[grown]) > 0.004
    assert len(sizes) < 26


@pytest.mark.parametrize(("power", "most"), [(0.5, 2), (0.6, 2), (1.0, 2), (3.0, 1)])
def test_a_refused_step_finds_the_power_with_which_its_error_goes(power, most):
    """After a jump at a surface it is the root of the length: the third power would take seven tries."""
    choice = time_stepper._StepChoice(0.5)
    size, tries = 30.0, 0
    while (error := 2.0 * (size / 30.0) ** power) > 0.5:
        size, tries = choice.shorter(size, error), tries + 1
    assert 1 <= tries <= most
    assert error > 1e-4


def test_the_mean_error_asks_for_fewer_steps_after_a_jump():
    """A strong film comes on: the surface is far off the course of a step, the machine as a whole is not."""
    cooled = replace(PROBLEM, films=(Film("outer.outer", 2.0e4, 273.15),))

    def run(**choice):
        return integrate(cooled, START, 600.0, control=StepControl(first_step=5.0, **choice))

    largest, mean = (run(tolerance=None, error_norm=norm) for norm in ("largest", "mean"))
    assert np.all(mean.step_errors < largest.step_errors)
    assert np.array_equal(mean.state.temperature, largest.state.temperature)
    assert mean.step_errors[0] < 0.5 * largest.step_errors[0]
    every, fewer = (run(tolerance=0.02, error_norm=norm) for norm in ("largest", "mean"))
    assert len(fewer.step_errors) < 0.85 * len(every.step_errors)
    exact = run(tolerance=1e-4).state
    capacity = np.append(OPERATORS.matrix(OPERATORS.sum_storage(np.full(2, 3.6e6))).sum(axis=0), 50.0)
    apart = fewer.state.vector() - exact.vector()
    assert np.sqrt(capacity @ apart**2 / capacity.sum()) < 0.02
    with pytest.raises(SpecError, match=r"error_norm: 'rms'.* Allowed: largest, mean"):
        StepControl(error_norm="rms")


def test_one_preconditioner_serves_steps_of_many_sizes():
    result = integrate(
        PROBLEM, START, 5e4, control=StepControl(tolerance=0.01, first_step=0.5, method="multigrid")
    )
    assert result.matrix_builds > 10
    assert 1 <= result.preconditioner_builds <= result.matrix_builds // 2


def test_a_preconditioner_that_has_become_useless_is_renewed():
    """The contact opens by four decades after a while: the old factor would need far more iterations."""

    def inputs(time, state):
        return replace(PROBLEM, joint_conductance={"inner|outer": 1e5 if time < 500.0 else 1.0})

    control = StepControl(tolerance=None, first_step=50.0, method="direct")
    result = integrate(inputs, START, 2000.0, stops=StopTimes((500.0,)), control=control)
    assert result.preconditioner_builds == 2
