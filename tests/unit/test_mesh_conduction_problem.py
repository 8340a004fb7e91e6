"""Problems say what is wrong with them; solvers say when they fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.errors import (
    ConvergenceError,
    EnergyBalanceError,
    MeshTagError,
    NoSteadyStateError,
    SpecError,
    UnknownSurfaceError,
)
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.mesh.column_solver import solve_many
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, FilmLaw, LumpedLink, LumpedNode
from spindle_fem.model.mesh.equations import assemble_capacity, assemble_system
from spindle_fem.model.mesh.heat_balance import require_balance
from spindle_fem.model.mesh.linear_solvers import build_preconditioner, solve_linear
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.renewed_equations import Equations, RenewedEquations
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.model.mesh.temperature_films import film_heat_flux, linearise_films

OPERATORS = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 12, 2)), 1)
PROBLEM = ConductionProblem(
    OPERATORS,
    {"inner": 40.0, "outer": 20.0},
    films=(Film("outer.outer", 50.0, 293.15),),
    joint_conductance={"inner|outer": 1000.0},
    surface_heat={"inner.inner": 100.0},
    adiabatic="rest",
)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"conductivity": {"inner": 40.0}}, SpecError, 'conductivity: no value for part "outer"'),
        ({"conductivity": {"inner": 40.0, "outer": 0.0}}, SpecError, 'conductivity of "outer": 0.0'),
        ({"conductivity": {"inner": 1.0, "outer": 1.0, "nut": 1.0}}, UnknownSurfaceError, 'names part "nut"'),
        (
            {"films": (Film("outer.top", 1.0, 300.0),)},
            UnknownSurfaceError,
            'film outer.top: names "outer.top"',
        ),
        ({"films": (Film("outer.outer", -1.0, 300.0),)}, SpecError, "film outer.outer: coefficient: "),
        ({"films": (Film("outer.outer", 1.0, -5.0),)}, SpecError, "ambient temperature: .*kelvin"),
        ({"films": (Film("outer.outer", [1.0, 2.0], 300.0),)}, SpecError, r"shape \(2,\)"),
        ({"films": (Film("outer.outer", 1.0, 300.0),) * 2}, SpecError, "each name once"),
        ({"joint_conductance": {}}, SpecError, r"no value for inner\|outer"),
        ({"joint_conductance": {"inner|outer": -1.0}}, SpecError, r"conductance of joint inner\|outer"),
        ({"joint_conductance": {"a|b": 1.0}}, UnknownSurfaceError, r'names joint "a\|b"'),
        ({"surface_heat": {"inner.bore": 1.0}}, UnknownSurfaceError, 'names "inner.bore"'),
        ({"surface_heat": {"inner.inner": np.nan}}, SpecError, "not finite"),
        ({"part_heat": {"inner": np.inf}}, SpecError, "heat of inner"),
        ({"adiabatic": ()}, MeshTagError, "nothing is said about inner.z0, inner.z1, outer.z0, outer.z1"),
        ({"adiabatic": ("outer.outer",)}, MeshTagError, "outer.outer also has a film"),
        ({"adiabatic": ("outer.lid",)}, UnknownSurfaceError, 'adiabatic: names "outer.lid"'),
        ({"volumetric_capacity": {"inner": -1.0}}, SpecError, 'volumetric capacity of "inner"'),
        (
            {"lumped_nodes": (LumpedNode("balls", (("inner.lip", 1.0),)),)},
            UnknownSurfaceError,
            "lumped node balls",
        ),
        ({"lumped_nodes": (LumpedNode("balls", (("inner.z0", -1.0),)),)}, SpecError, "balls: coefficient"),
        ({"lumped_nodes": (LumpedNode("balls", (), capacity=-1.0),)}, SpecError, "balls: capacity"),
        ({"lumped_nodes": (LumpedNode("balls", ()),) * 2}, SpecError, "lumped nodes: .*each name once"),
        ({"lumped_links": (LumpedLink("air", 1.0, other="balls"),)}, SpecError, '"air", no lumped node'),
        (
            {"lumped_nodes": (LumpedNode("a", ()),), "lumped_links": (LumpedLink("a", 1.0),)},
            SpecError,
            "another node or a temperature",
        ),
        (
            {
                "lumped_nodes": (LumpedNode("a", ()),),
                "lumped_links": (LumpedLink("a", -1.0, temperature=300.0),),
            },
            SpecError,
            "conductance: -1.0",
        ),
    ],
)
def test_unsound_problems_are_refused(changes, error, message):
    with pytest.raises(error, match=message):
        replace(PROBLEM, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"films": (Film("outer.outer", -1.0, 300.0),)}, "film outer.outer: coefficient: "),
        ({"films": (Film("outer.outer", np.nan, 300.0),)}, "not finite"),
        ({"films": (Film("outer.outer", 1.0, -5.0),)}, "ambient temperature: .*kelvin"),
        ({"joint_conductance": {"inner|outer": -1.0}}, r"conductance of joint inner\|outer"),
        ({"surface_heat": {"inner.inner": np.nan}}, "not finite"),
        ({"conductivity": {"inner": 40.0, "outer": 0.0}}, 'conductivity of "outer": 0.0'),
    ],
)
def test_impossible_values_of_an_altered_problem_are_refused(changes, message):
    with pytest.raises(SpecError, match=message):
        PROBLEM.altered(**changes)


def test_an_altered_problem_is_the_one_made_anew():
    values = {"films": (Film("outer.outer", 70.0, 300.0),), "surface_heat": {"inner.inner": 50.0}}
    altered, anew = PROBLEM.altered(**values), replace(PROBLEM, **values)
    assert altered == anew
    assert PROBLEM.films[0].coefficient == 50.0


def test_heat_that_cannot_leave_is_named():
    with pytest.raises(NoSteadyStateError, match="heat cannot leave inner\\."):
        solve_steady(replace(PROBLEM, joint_conductance={"inner|outer": 0.0}))
    with pytest.raises(NoSteadyStateError, match="heat cannot leave inner, outer, balls"):
        solve_steady(replace(PROBLEM, films=(), lumped_nodes=(LumpedNode("balls", (("outer.outer", 5.0),)),)))


def test_capacity_needs_every_part():
    with pytest.raises(SpecError, match="volumetric_capacity: no value for outer"):
        assemble_capacity(replace(PROBLEM, volumetric_capacity={"inner": 1e6}))


def test_lumped_nodes_carry_heat_between_parts():
    """A row of balls between two parts without other contact: a chain of resistances."""
    area_inner, area_outer = OPERATORS.surface_area("inner.z0"), OPERATORS.surface_area("outer.z1")
    problem = replace(
        PROBLEM,
        joint_conductance={"inner|outer": 0.0},
        surface_heat={"inner.inner": 80.0},
        lumped_nodes=(
            LumpedNode("balls", (("inner.z0", 300.0),), heat=20.0),
            LumpedNode("air", (("outer.z1", 200.0),)),
        ),
        lumped_links=(LumpedLink("balls", 4.0, other="air"),),
    )
    for method in ("direct", "multigrid"):
        solution = solve_steady(problem, method=method)
        assert solution.balance.films["outer.outer"] == pytest.approx(100.0, rel=1e-9)
        assert solution.balance.connections["inner.z0>balls"] == pytest.approx(80.0, rel=1e-9)
        assert solution.balance.links["balls|air"] == pytest.approx(100.0, rel=1e-9)
        assert solution.lumped("balls") - solution.lumped("air") == pytest.approx(25.0, abs=1e-7)
        mean = (
            OPERATORS.facet_integral(solution.temperature, OPERATORS.surface_rows["inner.z0"]).sum()
            / area_inner
        )
        assert mean - solution.lumped("balls") == pytest.approx(80.0 / (300.0 * area_inner), abs=1e-7)
        mean = (
            OPERATORS.facet_integral(solution.temperature, OPERATORS.surface_rows["outer.z1"]).sum()
            / area_outer
        )
        assert solution.lumped("air") - mean == pytest.approx(100.0 / (200.0 * area_outer), abs=1e-7)
    with pytest.raises(SpecError, match='"cage" is none'):
        solution.lumped("cage")


def test_link_to_given_temperature_takes_part_in_the_balance():
    problem = replace(
        PROBLEM,
        films=(),
        lumped_nodes=(LumpedNode("frame", (("outer.outer", 50.0),)),),
        lumped_links=(LumpedLink("frame", 3.0, temperature=290.0),),
    )
    solution = solve_steady(problem)
    assert solution.balance.films["frame|surroundings"] == pytest.approx(100.0, rel=1e-10)
    assert solution.lumped("frame") == pytest.approx(290.0 + 100.0 / 3.0, abs=1e-8)


def test_guess_and_preconditioner_of_a_similar_problem_serve():
    first = solve_steady(PROBLEM, method="multigrid")
    assert solve_steady(PROBLEM, first, first.preconditioner).iterations == 0
    changed = replace(PROBLEM, films=(Film("outer.outer", 60.0, 293.15),))
    reused = solve_steady(changed, first, first.preconditioner)
    np.testing.assert_allclose(reused.temperature, solve_steady(changed).temperature, rtol=0, atol=1e-7)


def test_foreign_guess_and_preconditioner_are_refused():
    other = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 14, 2)), 1)
    solution = solve_steady(replace(PROBLEM, operators=other))
    with pytest.raises(SpecError, match="guess: it belongs to another mesh"):
        solve_steady(PROBLEM, solution)
    with pytest.raises(SpecError, match="preconditioner: it has"):
        solve_steady(PROBLEM, preconditioner=solution.preconditioner)


def test_solver_reports_failure(monkeypatch):
    # small problems would have no coarser level
    monkeypatch.setattr("spindle_fem.model.mesh.multigrid.COARSEST_SIZE", 20)
    system = assemble_system(PROBLEM)
    preconditioner = build_preconditioner(system, "multigrid")
    with pytest.raises(ConvergenceError, match="after 1 iterations"):
        solve_linear(system.matrix, system.load, preconditioner, max_iterations=1)
    with pytest.raises(ConvergenceError, match="not positive definite"):
        solve_linear((-1.0 * system.matrix).tocsr(), system.load, preconditioner)
    with pytest.raises(SpecError, match="solver: 'magic'"):
        build_preconditioner(system, "magic")


def test_open_balance_is_an_error():
    balance = replace(solve_steady(PROBLEM).balance, imbalance=1e-3, imbalance_relative=1e-5)
    with pytest.raises(EnergyBalanceError, match=r"differ by 0.001 W \(1.00e-05 relative\). Allowed: 1e-08"):
        require_balance(balance, 1e-8)


def _radiation(temperature):
    return 5.670374419e-8 * (temperature**2 + 293.15**2) * (temperature + 293.15)


def test_film_law_heat_is_what_the_law_says():
    problem = replace(
        PROBLEM,
        films=(),
        film_laws=(FilmLaw("outer.outer", _radiation, 293.15),),
        surface_heat={"inner.inner": 60.0},
    )
    solution = solve_steady(problem)
    area = OPERATORS.surface_area("outer.outer")
    surface = (60.0 / (5.670374419e-8 * area) + 293.15**4) ** 0.25
    rows = OPERATORS.surface_rows["outer.outer"]
    mean = OPERATORS.facet_integral(solution.temperature, rows).sum() / area
    assert mean == pytest.approx(surface, abs=2e-3)
    assert solution.balance.films["outer.outer"] == pytest.approx(60.0, rel=1e-8)
    assert solution.nonlinear_iterations > 1
    with pytest.raises(SpecError, match="must be linearised"):
        assemble_system(problem)


def test_linearised_film_has_the_flux_and_slope_of_the_law():
    law = FilmLaw("outer.outer", lambda t: 1.3 * np.abs(t - 293.15) ** 0.25, 293.15)
    problem = replace(PROBLEM, films=(), film_laws=(law,))
    field = np.full(OPERATORS.n_unknowns, 320.0)
    film = linearise_films(problem, field).films[0]
    flux = film_heat_flux(OPERATORS, law, np.full_like(film.coefficient, 320.0))
    np.testing.assert_allclose(film.coefficient * (320.0 - film.ambient_temperature), flux, rtol=1e-10)
    np.testing.assert_allclose(film.coefficient, 1.25 * 1.3 * (320.0 - 293.15) ** 0.25, rtol=1e-6)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda t: t[:1], "coefficients of shape"),
        (lambda t: -t, "negative or infinite"),
        (lambda t: t * np.nan, "negative"),
    ],
)
def test_bad_film_laws_are_refused(law, message):
    problem = replace(PROBLEM, films=(), film_laws=(FilmLaw("outer.outer", law, 293.15),))
    with pytest.raises(SpecError, match=message):
        solve_steady(problem)


def test_film_law_that_runs_away_is_an_error():
    laws = (FilmLaw("outer.outer", lambda t: 40.0 / (1.0 + np.maximum(t - 293.15, 0.0)), 293.15),)
    with pytest.raises(ConvergenceError, match="film laws: temperatures still change"):
        solve_steady(replace(PROBLEM, films=(), film_laws=laws, surface_heat={"inner.inner": 600.0}))


@pytest.fixture(scope="module")
def quadratic_system():
    """Several levels of multigrid, and a lumped node."""
    operators = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((3, 2), 30, 4)), 2)
    node = LumpedNode("balls", (("inner.z0", 100.0), ("outer.z0", 100.0)), heat=10.0)
    return assemble_system(replace(PROBLEM, operators=operators, lumped_nodes=(node,))).tied()


@pytest.mark.parametrize("method", ["direct", "multigrid"])
def test_several_loads_at_once_are_solved_as_one_by_one(quadratic_system, method):
    system, matrix = quadratic_system, sparse.csr_array(quadratic_system.full_matrix())
    preconditioner = build_preconditioner(system, method)
    rng = np.random.default_rng(0)
    loads = rng.normal(size=(matrix.shape[0], 30)) * np.logspace(-6.0, 6.0, 30)
    solved = solve_many(matrix, loads, preconditioner, relative_tolerance=1e-9)
    for column in (0, 17, 29):
        single = solve_linear(matrix, loads[:, column], preconditioner).unknowns
        error = solved[:, column] - single
        assert error @ (matrix @ error) <= 1e-17 * (single @ loads[:, column])


def test_loads_that_converge_early_leave_and_zero_ones_stay_zero(quadratic_system):
    system, matrix = quadratic_system, sparse.csr_array(quadratic_system.full_matrix())
    preconditioner = build_preconditioner(system, "multigrid")
    exact = np.random.default_rng(1).normal(size=(matrix.shape[0], 3))
    loads = matrix @ exact
    loads[:, 1] = 0.0
    guesses = np.column_stack((exact[:, 0], np.zeros(len(exact)), 0.9 * exact[:, 2]))
    solved = solve_many(matrix, loads, preconditioner, guesses, relative_tolerance=1e-8)
    assert not solved[:, 1].any()
    assert solved[:, 0] == pytest.approx(exact[:, 0], abs=1e-6)
    assert solved[:, 2] == pytest.approx(exact[:, 2], abs=1e-6)


def test_several_loads_that_do_not_converge_are_refused(quadratic_system):
    system, matrix = quadratic_system, sparse.csr_array(quadratic_system.full_matrix())
    preconditioner = build_preconditioner(system, "multigrid")
    loads = np.random.default_rng(2).normal(size=(matrix.shape[0], 4))
    with pytest.raises(ConvergenceError, match=r"times what was asked after 2 iterations"):
        solve_many(matrix, loads, preconditioner, relative_tolerance=1e-12, max_iterations=2)
    with pytest.raises(ConvergenceError, match="not positive definite"):
        solve_many((-1.0 * matrix).tocsr(), loads, preconditioner, relative_tolerance=1e-6)


def test_a_share_of_the_guess_error_may_be_enough(quadratic_system):
    matrix = sparse.csr_array(quadratic_system.full_matrix())
    preconditioner = build_preconditioner(quadratic_system, "multigrid")
    exact = np.random.default_rng(3).normal(size=matrix.shape[0])
    load = matrix @ exact
    errors, iterations = [], []
    for reduction in (0.0, 1e-2, 1e-1):
        solution = solve_linear(matrix, load, preconditioner, error_tolerance=1e-9, reduction=reduction)
        errors.append(np.abs(solution.unknowns - exact).max())
        iterations.append(solution.iterations)
        assert solution.digits >= (9.0 if reduction == 0.0 else -np.log10(reduction)) - 0.5
    assert errors[0] < 1e-8 < errors[1] < errors[2] < 0.5
    assert errors[1] < 0.05
    assert iterations[0] > iterations[1] > iterations[2] >= 1
    # A guess that is good enough already costs no iteration.
    again = solve_linear(matrix, load, preconditioner, exact + 1e-12, error_tolerance=1e-9)
    assert (again.iterations, again.digits) == (0, 0.0)


def test_an_exact_guess_is_the_answer(quadratic_system):
    matrix = sparse.csr_array(quadratic_system.full_matrix())
    preconditioner = build_preconditioner(quadratic_system, "multigrid")
    nothing = np.zeros(matrix.shape[0])
    found = solve_linear(matrix, nothing, preconditioner, nothing, error_tolerance=1e-9)
    assert not found.unknowns.any()


def test_equations_are_renewed_as_they_are_made_anew():
    operators = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 12, 2)), 2)

    def problem(share: float, conductivity: float = 40.0, joint: float = 1000.0) -> ConductionProblem:
        count = operators.surface_rows["outer.outer"]
        film = share * np.linspace(30.0, 60.0, count.stop - count.start)
        return ConductionProblem(
            operators,
            {"inner": conductivity, "outer": 20.0},
            films=(Film("outer.outer", film, 293.15 + share),),
            joint_conductance={"inner|outer": share * joint},
            surface_heat={"inner.inner": 100.0 * share},
            lumped_nodes=(LumpedNode("air", (("inner.z1", 50.0 * share), ("outer.z1", 30.0)), heat=3.0),),
            adiabatic="rest",
        )

    kept = RenewedEquations()
    problems = (*(problem(share) for share in (1.0, 0.9, 1.2, 1.2)), problem(1.0, 45.0))
    for given in (*problems, problem(1.0, joint=np.inf), problem(1.0)):
        own, anew = kept.of(given), Equations.of(given)
        for name in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(own.matrix, name), getattr(anew.matrix, name))
        if own.system.matrix is not None:
            np.testing.assert_array_equal(own.system.matrix.data, anew.system.matrix.data)
        np.testing.assert_array_equal(own.system.exchange.toarray(), anew.system.exchange.toarray())
        # loads count from another temperature: what is solved is the same
        shift = own.system.reference_temperature - anew.system.reference_temperature
        np.testing.assert_allclose(
            own.tied.full_load(), anew.tied.full_load() - shift * anew.matrix.sum(axis=1), rtol=0.0, atol=1e-9
        )
