"""The benchmarks' own arithmetic: one discrete problem for all, honest rows and ratios."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.errors import SpecError
from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
RNG = np.random.default_rng(0)


def positive(size):
    root = RNG.normal(size=(size, size))
    return sparse.csr_array(root @ root.T + np.eye(size))


@pytest.fixture(autouse=True)
def on_path(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.syspath_prepend(str(BENCHMARKS / "peers"))
    yield
    for name in (
        "case",
        "comparison",
        "stages",
        "scale",
        "scheduler",
        "protocol",
        "numbering",
        "solved_space",
    ):
        sys.modules.pop(name, None)


def test_a_divided_mesh_fills_the_same_volume_with_the_same_nodes():
    import case

    mesh = build_box((0.1, 0.2, 0.3), (2, 3, 2))
    fine = case.divided(mesh)
    volume = case.signed_volume(fine.points, fine.tetrahedra)
    assert fine.tetrahedra.shape == (8 * mesh.n_elements, 4)
    assert volume.min() > 0.0
    assert volume.sum() == pytest.approx(0.006, rel=1e-12)
    assert np.unique(fine.tetrahedra).size == len(mesh.points) == fine.n_corners
    for name, facets in fine.surfaces.items():
        assert case.facet_area(fine.points, facets).sum() == pytest.approx(mesh.cad_area[name], rel=1e-12)


def test_a_divided_mesh_conforms():
    import case

    fine = case.divided(build_box((1.0, 1.0, 1.0), (2, 2, 2)))
    faces = np.sort(fine.tetrahedra[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    inside, count = np.unique(faces, axis=0, return_counts=True)
    outside = {tuple(face) for face in inside[count == 1].tolist()}
    tagged = {tuple(sorted(face)) for facets in fine.surfaces.values() for face in facets.tolist()}
    assert count.max() == 2
    assert tagged == outside


def test_merged_nodes_are_those_that_coincide():
    import case

    mesh = case.divided(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((1, 1), 8, 2)))
    new, first = case.merged_nodes(mesh)
    distinct = np.unique(np.round(mesh.points, 9), axis=0)
    assert len(first) == len(distinct) < len(mesh.points)
    assert mesh.points[first][new] == pytest.approx(mesh.points, abs=1e-12)
    assert new[first].tolist() == list(range(len(first)))


def test_loads_count_from_the_start_temperature():
    import protocol

    problem = protocol.Problem(
        points=None, tetrahedra=None, part_of_element=np.array([1, 0]),
        part_conductivity=np.array([40.0, 50.0]), part_capacity=np.array([3.0, 4.0]), facets=None,
        film_coefficient=np.array([10.0, 0.0]), ambient_temperature=np.array([300.0, 0.0]),
        heat_flux=np.array([5.0, 7.0]), start_temperature=290.0, step_s=60.0, heat_factor=np.ones(4),
    )  # fmt: skip
    assert problem.flux(2.0).tolist() == [110.0, 14.0]
    assert problem.conductivity.tolist() == [50.0, 40.0]


def row(program, steady, agrees=True, **more):
    return {"program": program, "nodes": 10, "steady_s": steady, "agrees": agrees} | more


def test_ratios_are_to_the_best_other_program_that_agrees():
    import comparison

    rows = comparison.with_ratios(
        [
            row("spindle_fem", 1.0, steps_s=2.0),
            row("spindle_fem, 1 thread", 1.5),
            row("wrong and fast", 0.1, agrees=False),
            row("right", 4.0, steps_s=8.0),
            {"program": "absent", "nodes": 10, "error": "no"},
        ]
    )
    assert rows[0]["steady_ratio"] == 0.25
    assert rows[0]["steps_ratio"] == 0.25
    assert rows[2]["steady_ratio"] == pytest.approx(0.025)
    assert "steady_ratio" not in rows[4]


def test_a_row_says_when_temperatures_differ(monkeypatch):
    import comparison

    answers = {
        "spindle_fem": ({"seconds": {"solve": 2.0}, "peak_kB": 100}, {"steady": np.zeros(3)}),
        "near": ({"seconds": {"solve": 3.0}, "peak_kB": 50}, {"steady": np.full(3, 0.9e-5)}),
        "far": ({"seconds": {"solve": 1.0}, "peak_kB": 50}, {"steady": np.full(3, 1.1e-5)}),
        "failing": ({"error": "out of memory"}, {}),
    }
    turns = []

    def run(program, python, case, steps):
        turns.append(program.name)
        return answers[program.name]

    monkeypatch.setattr(comparison, "run_program", run)
    chosen = [(comparison.Program(name, "", ""), "python") for name in answers]
    rows = {item["program"]: item for item in comparison.compare(Path(), 10, 0, 2, chosen)}
    # in turn, and a program that failed is not tried again
    assert turns == ["spindle_fem", "near", "far", "failing", "spindle_fem", "near", "far"]
    assert rows["near"]["agrees"]
    assert not rows["far"]["agrees"]
    assert rows["failing"]["error"] == "out of memory"
    assert rows["spindle_fem"]["peak_kB_a_node"] == 10.0
    assert rows["near"]["steady_s"] == 3.0


def test_programs_that_are_not_installed_are_none():
    import comparison

    assert comparison.find_python(comparison.Program("x", "", "no_such_module_x"), [sys.executable]) is None
    assert comparison.find_python(comparison.Program("x", "", "$no_such_command_x"), [sys.executable]) is None
    assert comparison.find_python(comparison.Program("x", "", "numpy"), ["/no", sys.executable][1:])


def test_size_factors_fall_as_nodes_rise():
    import stages

    factors = [stages.size_factor_for(nodes) for nodes in (50_000, 68_000, 140_000, 220_000, 800_000)]
    assert factors == sorted(factors, reverse=True)
    assert stages.size_factor_for(218_985) == 0.54


def test_the_table_names_what_is_missing_and_what_disagrees():
    import stages

    right = row("spindle_fem", 1.0, seconds={"assembly": 0.2, "solve": 0.8}, peak_kB_a_node=1.2,
                difference_K={"steady": 0.0}, steady_ratio=0.4)  # fmt: skip
    wrong = row(
        "other", 2.5, False, seconds={"solve": 2.5}, peak_kB_a_node=2.0, difference_K={"steady": 0.02}
    )
    roof = {
        "nodes": 10,
        "product_bytes": 2e6,
        "product_at_stream_s": 1e-4,
        "stream_GB_s": {"1": 20.0},
        "product_s": {"scipy": 0.02, "1 threads": 0.01, "1 threads, single": 0.004},
    }
    text = stages.tables(
        {"rows": [right, wrong, {"program": "third", "nodes": 10, "error": "not done in 9 s"}],
         "roofline": [roof], "pipeline": [], "left_out": ["MFEM"]}
    )  # fmt: skip
    assert "| spindle_fem | 0.200 |  | 0.800 | 1.000 | 0.40 |" in text
    assert "2.0e-02 DOES NOT AGREE" in text
    assert "not done in 9 s" in text
    assert "takes 80 products" in text
    assert "left out: MFEM" in text


def test_a_simulated_study_is_bound_by_what_is_slowest_and_loses_nothing():
    from scheduler import Costs, simulate

    costs = Costs(solve=0.7, spread=0.2, read=0.001, dispatch=0.004, write=0.0002, begin=10.0)
    few, many = simulate(4000, 10, costs), simulate(4000, 2000, costs)
    assert few.seconds == pytest.approx(280.0 + 10.0, rel=0.05)
    # the scheduler serves one after the other
    assert 16.0 <= many.seconds < 16.0 + 10.0 + 8.0
    assert few.busy > 0.9 > 0.2 > many.busy
    dying = simulate(4000, 10, costs, lives_h=0.05)
    assert dying.repeated > 5
    assert dying.seconds * dying.busy * 10 == pytest.approx(few.seconds * few.busy * 10, rel=0.02)
    # one process reads and checks designs, unless there are more
    slow = simulate(4000, 100, Costs(0.1, 0.0, 0.1, 0.001, 0.0, 0.0))
    assert slow.seconds == pytest.approx(400.0, rel=0.01)
    assert simulate(4000, 100, Costs(0.1, 0.0, 0.1, 0.001, 0.0, 0.0), readers=8).seconds < 60.0


def test_another_numbering_changes_no_temperature():
    import case
    from numbering import numbered

    from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film
    from spindle_fem.model.mesh.mesh_operators import build_operators
    from spindle_fem.model.mesh.steady_conduction import solve_steady

    tubes = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((2, 2), 12, 3))
    mesh = case.divided(tubes)
    changed, number = numbered(mesh)
    assert np.array_equal(np.sort(number), np.arange(len(mesh.points)))
    assert np.array_equal(changed.points[number], mesh.points)
    fields = []
    for each in (mesh, changed):
        problem = ConductionProblem(
            build_operators(each, 1),
            {"inner": 40.0, "outer": 15.0},
            films=(Film("outer.outer", 300.0, 290.0),),
            joint_conductance={"inner|outer": 2e3},
            surface_heat={"inner.inner": 200.0},
            adiabatic="rest",
        )
        fields.append(solve_steady(problem).temperature)
    assert fields[1][number] == pytest.approx(fields[0], abs=1e-9)
    shuffled = np.random.default_rng(8).permutation(len(mesh.points))
    spread = np.abs(np.diff(shuffled[mesh.tetrahedra], axis=1)).mean()
    assert np.abs(np.diff(changed.tetrahedra, axis=1)).mean() < 0.4 * spread
    with pytest.raises(SpecError, match="10 nodes an element"):
        numbered(tubes)


def test_solutions_of_one_matrix_are_found_again_and_the_oldest_is_forgotten():
    from solved_space import SolvedSpace

    matrix = positive(20)
    space = SolvedSpace(matrix, 4)
    assert not space.guess(np.ones(20)).any()
    solutions = RNG.normal(size=(6, 20))
    for solution in solutions:
        space.add(solution)
        # single precision
        assert space.guess(matrix @ solution) == pytest.approx(solution, abs=1e-5)
    assert np.abs(space.guess(matrix @ solutions[0]) - solutions[0]).max() > 1e-3


def test_a_guess_from_solutions_leaves_nothing_along_them():
    from solved_space import SolvedSpace

    matrix = positive(20)
    space = SolvedSpace(matrix)
    solutions = RNG.normal(size=(5, 20)) * np.logspace(-4.0, 0.0, 5)[:, None]
    for solution in [*solutions, solutions[0]]:
        space.add(solution)
    load = RNG.normal(size=20)
    left = solutions @ (load - matrix @ space.guess(load))
    assert np.abs(left / np.linalg.norm(solutions, axis=1)).max() < 1e-4 * np.linalg.norm(load)
