"""Kernels give what scikit-fem and scipy give; threads change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from skfem import Basis, ElementTetP1, MeshTet

from spindle_fem.errors import MeshQualityError, MeshTagError, SpecError
from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes
from spindle_fem.machine.meshing.tagged_mesh import Joint
from spindle_fem.model.mesh import element_integrals, forms, threads
from spindle_fem.model.mesh.column_solver import product_of, solve_many
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import multigrid_loops
from spindle_fem.model.mesh.kernels.team_loops import LARGEST, conjugate_step
from spindle_fem.model.mesh.linear_solvers import build_preconditioner, multiply, solve_linear
from spindle_fem.model.mesh.linear_system import merged
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.multigrid import build_hierarchy, scales_of_smoothing
from spindle_fem.model.mesh.skfem_mesh import ELEMENT_QUADRATURE_DEGREE
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.parallel import worker_threads as parallel

ROUND_OFF = 1e-13
TUBES = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((3, 3), 24, 5))


@pytest.fixture
def loops(monkeypatch):
    """Have kernels run by so many threads, however small the problem."""

    def switch(count):
        monkeypatch.setattr(parallel, "_thread_count", lambda: count)
        monkeypatch.setattr(element_integrals, "MANY_ELEMENTS", 0)
        monkeypatch.setattr(threads, "LEAST_ROWS", 50)
        monkeypatch.setattr(threads, "ENTRIES_A_CHUNK", 500)

    return switch


def linear(mesh):
    """A mesh of straight sides with linear elements."""
    return replace(
        mesh,
        points=mesh.points[: mesh.n_corners].copy(),
        tetrahedra=mesh.tetrahedra[:, :4].copy(),
        surfaces={name: facets[:, :3].copy() for name, facets in mesh.surfaces.items()},
        joints={
            name: Joint(name, joint.facets_a[:, :3].copy(), joint.facets_b[:, :3].copy())
            for name, joint in mesh.joints.items()
        },
    )


def problem_on(operators):
    return ConductionProblem(
        operators,
        {"inner": 40.0, "outer": 15.0},
        films=(Film("outer.outer", 300.0, 290.0), Film("inner.z0", 20.0, 310.0)),
        joint_conductance={"inner|outer": 2e3},
        surface_heat={"inner.inner": 200.0},
        lumped_nodes=(LumpedNode("air", (("inner.z1", 50.0), ("outer.z1", 30.0)), heat=3.0),),
        adiabatic="rest",
    )


@pytest.mark.parametrize("count", [1, 2])
def test_linear_meshes_give_scikit_fem_s_matrices(loops, count):
    loops(count)
    mesh = linear(build_box((0.1, 0.2, 0.3), (5, 4, 6)))
    operators = build_operators(mesh, 1)
    basis = Basis(MeshTet(mesh.points.T.copy(), mesh.tetrahedra.T.copy()), ElementTetP1(),
                  intorder=ELEMENT_QUADRATURE_DEGREE)  # fmt: skip
    for form, unit in ((forms.conduction, operators.conduction), (forms.capacity, operators.storage)):
        expected = form.assemble(basis)
        assert abs(operators.matrix(unit) - expected).max() < ROUND_OFF * abs(expected).max()
    assert operators.part_load == pytest.approx(forms.source.assemble(basis), rel=1e-12)
    assert operators.surface_area("box.x0") == pytest.approx(0.06, rel=1e-13)


@pytest.mark.parametrize("order", [1, 2])
def test_scikit_fem_and_kernels_make_the_same_operators(loops, monkeypatch, order):
    loops(2)
    fast = build_operators(TUBES, order)
    monkeypatch.setattr(element_integrals, "MANY_ELEMENTS", 10**9)
    plain = build_operators(TUBES, order)
    for name in ("conduction", "storage", "part_load", "facet_film", "facet_load", "facet_area"):
        expected = getattr(plain, name)
        assert np.abs(getattr(fast, name) - expected).max() < ROUND_OFF * np.abs(expected).max()
    assert fast.part_volume == pytest.approx(plain.part_volume, rel=ROUND_OFF)


@pytest.mark.parametrize("count", [1, 2])
def test_an_inverted_linear_element_is_refused(loops, count):
    loops(count)
    mesh = linear(build_box((0.1, 0.2, 0.3), (3, 3, 3)))
    mesh.tetrahedra[7] = mesh.tetrahedra[7, [0, 1, 3, 2]]
    with pytest.raises(MeshQualityError, match="1 elements are inverted"):
        build_operators(mesh, 1)


def test_quadratic_temperatures_need_a_quadratic_mesh():
    with pytest.raises(SpecError, match="2 on linear elements"):
        build_operators(linear(build_box((1.0, 1.0, 1.0), (1, 1, 1))), 2)


@pytest.mark.parametrize("count", [1, 2])
def test_merged_rows_are_the_triple_product(loops, count):
    loops(count)
    rng = np.random.default_rng(3)
    n, size = 400, 300
    root = sparse.random_array((n, n), density=0.02, rng=rng)
    matrix = sparse.csr_array(root @ root.T + sparse.eye_array(n))
    matrix.sort_indices()
    label = np.concatenate((rng.permutation(size), rng.integers(0, size, n - size)))
    tie = sparse.csr_array((np.ones(n), (np.arange(n), label)), shape=(n, size))
    answer, expected = merged(matrix, tie), tie.T @ matrix @ tie
    assert abs(answer - expected).max() < 1e-14 * abs(expected).max()
    assert answer.has_sorted_indices
    assert np.all(
        np.diff(answer.indices)[np.diff(np.repeat(np.arange(size), np.diff(answer.indptr))) == 0] > 0
    )


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("count", [1, 2])
def test_the_cycle_is_symmetric_positive_and_contracts(loops, order, count):
    loops(count)
    system = assemble_system(problem_on(build_operators(TUBES, order)))
    hierarchy = build_hierarchy(system.matrix, system.prolongation)
    assert len(hierarchy.levels) >= order
    rng = np.random.default_rng(0)
    one, other = rng.standard_normal((2, system.matrix.shape[0]))
    answers = hierarchy.cycle(np.column_stack((one, other)))
    # single precision
    assert one @ answers[:, 1] == pytest.approx(other @ answers[:, 0], rel=1e-4)
    assert one @ answers[:, 0] > 0.0
    error = one
    energies = [error @ (system.matrix @ error)]
    for _ in range(6):
        error = error - hierarchy.cycle(system.matrix @ error)
        energies.append(error @ (system.matrix @ error))
    assert max(np.array(energies[1:]) / energies[:-1]) < 0.6


def test_a_cycle_is_the_same_to_the_last_digit_whatever_the_threads(loops):
    answers = []
    for count in (1, 2, 3):
        loops(count)
        system = assemble_system(problem_on(build_operators(TUBES, 2)))
        residual = np.random.default_rng(4).standard_normal(system.matrix.shape[0])
        hierarchy = build_hierarchy(system.matrix, system.prolongation)
        answers.append((system.matrix.data, hierarchy.cycle(residual)))
    for data, answer in answers[1:]:
        assert np.array_equal(data, answers[0][0])
        assert np.array_equal(answer, answers[0][1])


def test_a_solution_is_the_same_to_the_last_digit_whatever_the_threads(loops):
    answers = []
    for count in (1, 2, 3):
        loops(count)
        system = assemble_system(problem_on(build_operators(TUBES, 1)))
        preconditioner = build_preconditioner(system, "multigrid")
        found = solve_linear(system.full_matrix(), system.full_load(), preconditioner)
        answers.append(found.unknowns)
    assert all(np.array_equal(answer, answers[0]) for answer in answers)


def test_a_cycle_leaves_earlier_answers_alone(loops):
    loops(1)
    system = assemble_system(problem_on(build_operators(TUBES, 1)))
    hierarchy = build_hierarchy(system.matrix, system.prolongation)
    one, other = np.random.default_rng(6).standard_normal((2, system.matrix.shape[0]))
    first = hierarchy.cycle(one)
    kept = first.copy()
    hierarchy.cycle(other)
    assert np.array_equal(first, kept)
    assert np.array_equal(hierarchy.cycle(one), kept)


def test_smoothing_is_scaled_so_that_no_eigenvalue_is_above_what_it_is_made_for():
    rng = np.random.default_rng(7)
    root = sparse.random_array((80, 80), density=0.1, rng=rng)
    matrix = sparse.csr_array(root @ root.T + 0.1 * sparse.eye_array(80))
    inverse, smoothing = scales_of_smoothing(matrix)
    dense = matrix.toarray()
    assert inverse == pytest.approx(1.0 / np.diag(dense))
    assert np.linalg.eigvals(inverse[:, None] * dense).real.max() > LARGEST
    assert np.linalg.eigvals(smoothing[:, None] * dense).real.max() <= LARGEST * (1.0 + 1e-12)
    easy = np.abs(dense).sum(axis=1) <= LARGEST * np.diag(dense)
    assert smoothing[easy] == pytest.approx(inverse[easy])


def test_a_prolongation_keeps_the_largest_entries_of_each_row_and_its_sum(loops):
    loops(1)
    matrix = assemble_system(problem_on(build_operators(TUBES, 2))).matrix
    n = matrix.shape[0]
    given = (*threads.unsigned(matrix.indptr, matrix.indices), matrix.data)
    label, size = multigrid_loops.aggregate(*given)
    inverse = 1.0 / matrix.diagonal()
    columns, values = np.empty((n, 4), dtype=np.uint32), np.empty((n, 4))
    multigrid_loops.smoothed_prolongation(
        0, n, *given, inverse, label.view(np.uint32), 0.8, size, columns, values
    )
    constant = sparse.csr_array((np.ones(n), label, np.arange(n + 1)), shape=(n, size))
    whole = sparse.csr_array(constant - 0.8 * sparse.diags_array(inverse) @ matrix @ constant)
    assert values.sum(axis=1) == pytest.approx(whole.sum(axis=1), abs=1e-12)
    kept = sparse.csr_array((values.ravel(), columns.ravel(), np.arange(0, 4 * n + 1, 4)), shape=(n, size))
    assert np.diff(whole.indptr).max() > 4
    short = np.diff(whole.indptr) <= 4
    assert abs((kept - whole)[short]).max() < 1e-12
    for i in np.flatnonzero(~short)[:50]:
        row = np.abs(whole[[i]].toarray()[0])
        chosen = columns[i][values[i] != 0.0]
        assert row[chosen].min() >= np.sort(row)[-4] * (1.0 - 1e-12)


def test_a_prolongation_with_long_rows_is_refused(loops):
    loops(1)
    system = assemble_system(problem_on(build_operators(TUBES, 1)))
    n = system.matrix.shape[0]
    with pytest.raises(SpecError, match="5 entries in a row"):
        build_hierarchy(system.matrix, sparse.csr_array(np.ones((n, 5))))


@pytest.mark.parametrize("count", [1, 2])
def test_a_tagged_triangle_that_is_no_facet_is_refused(loops, count):
    loops(count)
    mesh = linear(build_box((0.1, 0.2, 0.3), (3, 3, 3)))
    mesh.surfaces["box.x0"][0] = [0, 1, mesh.n_corners - 1]
    with pytest.raises(MeshTagError, match="no facet of any element"):
        build_operators(mesh, 1)


@pytest.mark.parametrize("count", [1, 2])
def test_solutions_are_those_of_the_direct_solver(loops, count):
    loops(count)
    problem = problem_on(build_operators(TUBES, 2))
    found = solve_steady(problem, method="multigrid", relative_tolerance=1e-12)
    exact = solve_steady(problem, method="direct")
    assert found.temperature == pytest.approx(exact.temperature, abs=1e-8)
    assert found.lumped_temperature == pytest.approx(exact.lumped_temperature, abs=1e-8)


@pytest.mark.parametrize("count", [1, 2])
def test_products_are_scipy_s(loops, count):
    loops(count)
    matrix = assemble_system(problem_on(build_operators(TUBES, 1))).matrix
    vector = np.random.default_rng(9).standard_normal(matrix.shape[0])
    assert np.abs(multiply(matrix, vector) - matrix @ vector).max() < 1e-13 * np.abs(matrix @ vector).max()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 7, 8, 13, 16, 23, 24, 45])
def test_products_with_any_number_of_columns_are_scipy_s(loops, kind, count):
    loops(2)
    rng = np.random.default_rng(5)
    matrix = sparse.random_array((300, 300), density=0.05, format="csr", rng=rng, dtype=kind)
    vectors = rng.standard_normal((300, count)).astype(kind)
    answer = np.empty_like(vectors)
    product_of(matrix)(vectors, answer)
    np.testing.assert_allclose(answer, matrix @ vectors, atol=50.0 * np.finfo(kind).eps)


def test_iterations_are_few(loops):
    loops(2)
    system = assemble_system(problem_on(build_operators(TUBES, 2)))
    preconditioner = build_preconditioner(system, "multigrid")
    solution = solve_linear(
        system.full_matrix(), system.full_load(), preconditioner, relative_tolerance=1e-10
    )
    assert solution.iterations < 30


def test_space_for_rows_grows_until_they_fit(loops):
    loops(2)
    rng = np.random.default_rng(5)
    one = sparse.random_array((600, 500), density=0.05, rng=rng).tocsr()
    two = sparse.random_array((500, 400), density=0.05, rng=rng).tocsr()
    given = [(*threads.unsigned(item.indptr, item.indices), item.data) for item in (one, two)]
    starts, columns, values = threads.fill_rows(
        multigrid_loops.product_rows, 600, (*given[0], *given[1], 400), 0.1
    )
    answer = sparse.csr_array((values, columns, starts), shape=(600, 400))
    assert abs(answer - one @ two).max() < 1e-14


def test_rows_of_several_ranges_come_without_gaps(monkeypatch):
    monkeypatch.setattr(parallel, "_thread_count", lambda: 3)
    monkeypatch.setattr(threads, "LEAST_ROWS", 10)

    def rows(low, high, counts, columns, values):
        places = [(i, k) for i in range(low, high) for k in range(i % 4)]
        for place, (i, k) in enumerate(places):
            columns[place], values[place] = k, i
        counts[low + 1 : high + 1] = np.arange(low, high) % 4
        return len(places)

    starts, columns, values = threads.fill_rows(rows, 100, (), 3.0)
    assert starts.tolist() == [0, *np.cumsum(np.arange(100) % 4).tolist()]
    assert columns.tolist() == [k for i in range(100) for k in range(i % 4)]
    assert values.tolist() == [i for i in range(100) for _ in range(i % 4)]


@pytest.mark.parametrize("shape", [7, (3, 2), 3_000_001, (700_000, 4)])
def test_room_is_an_array_of_its_own(shape):
    one, other = room(shape, np.float32), room(shape, np.float32)
    one[:], other[:] = 1.0, 2.0
    assert one.shape == other.shape == np.empty(shape).shape
    assert one.dtype == np.float32
    assert one.flags.c_contiguous
    assert one.flags.writeable
    assert np.all(one == 1.0)


def test_the_environment_says_how_many_threads(monkeypatch):
    for name in ("SPINDLE_FEM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    parallel._thread_count.cache_clear()
    try:
        assert parallel.thread_count() >= 1
        monkeypatch.setenv("OMP_NUM_THREADS", "3")
        parallel._thread_count.cache_clear()
        assert parallel.thread_count() == 3
        monkeypatch.setenv("SPINDLE_FEM_THREADS", "5")
        parallel._thread_count.cache_clear()
        assert parallel.thread_count() == 5
    finally:
        parallel._thread_count.cache_clear()


def test_work_that_fails_in_another_thread_fails_where_it_was_asked(monkeypatch):
    monkeypatch.setattr(parallel, "_thread_count", lambda: 3)

    def refuse():
        raise SpecError("work", "it was refused.")

    for place in range(4):
        jobs = [lambda k=k: k for k in range(4)]
        assert parallel.in_threads(jobs) == [0, 1, 2, 3]
        jobs[place] = refuse
        with pytest.raises(SpecError, match="it was refused"):
            parallel.in_threads(jobs)


def test_a_team_does_every_chunk_once_whoever_comes(loops):
    rng = np.random.default_rng(12)
    root = sparse.random_array((1000, 1000), density=0.01, rng=rng)
    matrix = sparse.csr_array(root @ root.T + sparse.eye_array(1000))
    rows = (*threads.unsigned(matrix.indptr, matrix.indices), matrix.data)
    bounds = np.array([0, 10, 300, 300, 999, 1000])
    preconditioned, residual = rng.standard_normal((2, 1000))
    step = (preconditioned @ residual) / (preconditioned @ (matrix @ preconditioned))
    answers = []
    for count in (1, 2, 5):
        loops(count)
        image, direction, unknowns, left = (*np.zeros((3, 1000)), residual.copy())
        shares = np.empty((4, 5))
        threads.run_team(
            conjugate_step,
            5,
            bounds,
            *rows,
            preconditioned,
            left,
            image,
            direction,
            unknowns,
            0.0,
            0.0,
            shares,
        )
        assert shares[3].sum() == pytest.approx(left @ left)
        answers.append((unknowns, left))
    assert answers[0][0] == pytest.approx(step * preconditioned)
    assert answers[0][1] == pytest.approx(residual - step * (matrix @ preconditioned))
    assert all(np.array_equal(answer, answers[0]) for answer in answers)


def test_chunks_have_as_many_entries_and_do_not_depend_on_threads(loops):
    starts = np.concatenate((np.arange(0, 9000, 9), np.arange(9000, 30001, 30)))
    loops(1)
    bounds = threads.chunk_bounds(starts)
    assert bounds[0] == 0
    assert bounds[-1] == len(starts) - 1
    assert np.diff(starts[bounds]) == pytest.approx(30000 / (len(bounds) - 1), abs=30)
    loops(4)
    assert np.array_equal(threads.chunk_bounds(starts), bounds)
    assert threads.chunk_bounds(np.array([0, 3])).tolist() == [0, 1]


def test_sparse_arrays_keep_room_as_it_is():
    n = 400_000
    data, indices = room(n), room(n, np.int32)
    data[:], indices[:] = 1.0, np.arange(n)
    matrix = sparse.csr_array((data, indices, np.arange(n + 1, dtype=np.int32)), shape=(n, n))
    assert np.shares_memory(matrix.data, data)
    assert np.shares_memory(matrix.indices, indices)


def test_ranges_cover_all_rows_and_return_in_order(monkeypatch):
    monkeypatch.setattr(parallel, "_thread_count", lambda: 3)
    monkeypatch.setattr(threads, "LEAST_ROWS", 10)
    bounds = threads.row_blocks(100)
    assert bounds.tolist() == [0, 33, 66, 100]
    assert threads.run_blocks(lambda low, high, add: low + high + add, bounds, 1) == [34, 100, 167]
    assert threads.row_blocks(9).tolist() == [0, 9]


@pytest.mark.parametrize("count", [1, 2])
def test_lumped_nodes_border_the_matrix(loops, count):
    loops(count)
    system = assemble_system(problem_on(build_operators(TUBES, 1)))
    expected = sparse.block_array(
        [[system.matrix, -system.exchange], [-system.exchange.T, system.lumped_matrix]]
    ).toarray()
    answer = system.full_matrix()
    assert np.array_equal(answer.toarray(), expected)
    assert answer.has_sorted_indices


@pytest.mark.parametrize("count", [1, 2])
def test_several_right_hand_sides_are_solved_as_one_by_one(loops, count):
    loops(count)
    system = assemble_system(problem_on(build_operators(TUBES, 2)))
    preconditioner = build_preconditioner(system, "multigrid")
    loads = np.random.default_rng(2).standard_normal((len(system.full_load()), 30))
    matrix = system.full_matrix()
    found = solve_many(matrix, loads, preconditioner, relative_tolerance=1e-10)
    left = loads - matrix @ found
    assert np.linalg.norm(left, axis=0).max() < 1e-7 * np.linalg.norm(loads)
    hierarchy = build_hierarchy(system.matrix, system.prolongation)
    columns = np.random.default_rng(3).standard_normal((system.matrix.shape[0], 3))
    many = hierarchy.cycle(columns)
    one = hierarchy.cycle(columns[:, 1])
    assert np.abs(many[:, 1] - one).max() < 1e-5 * np.abs(one).max()


def test_one_thread_is_what_it_says_whatever_the_machine_has(monkeypatch):
    monkeypatch.setattr(parallel, "_thread_count", lambda: 4)
    assert len(threads.row_blocks(10 * threads.LEAST_ROWS)) == 5
    with parallel.one_thread():
        assert threads.row_blocks(10 * threads.LEAST_ROWS).tolist() == [0, 10 * threads.LEAST_ROWS]
    assert parallel.thread_count() == 4
