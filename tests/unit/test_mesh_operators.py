"""Operators equal scikit-fem's forms; measures are those of the geometry; bad meshes are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skfem import asm

from spindle_fem.errors import MeshQualityError, MeshTagError, SpecError, UnknownSurfaceError
from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes, build_tube
from spindle_fem.model.mesh import element_integrals, forms, threads
from spindle_fem.model.mesh.mesh_operators import build_operators, spread
from spindle_fem.model.mesh.skfem_mesh import load_into_skfem
from spindle_fem.parallel import worker_threads as parallel


@pytest.fixture(autouse=True, params=["scikit-fem", "kernels"])
def door(request, monkeypatch):
    """Every test holds by scikit-fem and by kernels, these in two threads."""
    if request.param == "kernels":
        monkeypatch.setattr(element_integrals, "MANY_ELEMENTS", 0)
        monkeypatch.setattr(parallel, "_thread_count", lambda: 2)
        monkeypatch.setattr(threads, "LEAST_ROWS", 50)


MESH = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((2, 1), 12, 2))
ROUND_OFF = 1e-13


def _largest_difference(one, other):
    return abs(one - other).max() / abs(other).max()


@pytest.mark.parametrize("order", [1, 2])
def test_volume_operators_equal_scikit_fem(order):
    operators = build_operators(MESH, order)
    loaded = load_into_skfem(MESH, order)
    for form, unit in ((forms.conduction, operators.conduction), (forms.capacity, operators.storage)):
        expected = loaded.in_our_order(form.assemble(loaded.basis))
        assert _largest_difference(operators.matrix(unit), expected) < ROUND_OFF
    load = np.empty(operators.n_unknowns)
    load[loaded.unknown_of_dof] = forms.source.assemble(loaded.basis)
    np.testing.assert_allclose(operators.part_load, load, rtol=0, atol=ROUND_OFF * load.max())


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("surface", ["outer.outer", "inner.z0"])
def test_film_operators_equal_scikit_fem(order, surface):
    operators = build_operators(MESH, order)
    loaded = load_into_skfem(MESH, order)
    basis = loaded.facet_basis(MESH.surfaces[surface])
    expected = loaded.in_our_order(forms.film.assemble(basis))
    assert _largest_difference(operators.film_matrix(surface), expected) < ROUND_OFF
    load = np.empty(operators.n_unknowns)
    load[loaded.unknown_of_dof] = forms.source.assemble(basis)
    rows = operators.surface_rows[surface]
    ours = operators.facet_vector(np.ones(rows.stop - rows.start), rows)
    np.testing.assert_allclose(ours, load, rtol=0, atol=ROUND_OFF * load.max())


def test_straight_elements_equal_scikit_fem():
    mesh = build_box((0.1, 0.2, 0.3), (2, 2, 2))
    operators = build_operators(mesh, 2)
    loaded = load_into_skfem(mesh, 2)
    expected = loaded.in_our_order(forms.conduction.assemble(loaded.basis))
    assert _largest_difference(operators.matrix(operators.conduction), expected) < ROUND_OFF


@pytest.mark.parametrize("order", [1, 2])
def test_films_of_varying_coefficient_sum_on_the_common_pattern(order):
    operators = build_operators(MESH, order)
    rng = np.random.default_rng(1)
    coefficient = np.zeros(len(operators.facet_area))
    expected = 0.0
    for surface in ("outer.outer", "inner.inner"):
        values = rng.uniform(1.0, 9.0, len(MESH.surfaces[surface]))
        coefficient[operators.surface_rows[surface]] = values
        expected = expected + operators.film_matrix(surface, values)
    upper = np.zeros(operators.pattern.n_upper)
    operators.add_films(upper, coefficient)
    assert _largest_difference(operators.matrix(upper), expected) < ROUND_OFF


@pytest.mark.parametrize("order", [1, 2])
def test_joint_operators_equal_scikit_fem(order):
    operators = build_operators(MESH, order)
    loaded = load_into_skfem(MESH, order)
    joint = MESH.joints["inner|outer"]
    sides = [loaded.facet_basis(facets) for facets in (joint.facets_a, joint.facets_b)]
    expected = loaded.in_our_order(asm(forms.joint, sides, sides))
    assert _largest_difference(operators.joint_matrix("inner|outer"), expected) < ROUND_OFF


@pytest.mark.parametrize("order", [1, 2])
def test_joint_acts_on_the_jump_only(order):
    operators = build_operators(MESH, order)
    joint = "inner|outer"
    conductance = np.linspace(1.0, 2.0, len(operators.joint_facet_areas(joint)))
    matrix = operators.joint_matrix(joint, conductance)
    assert abs(matrix @ np.ones(operators.n_unknowns)).max() < 1e-15
    upper = np.zeros(operators.pattern.n_upper)
    films = np.zeros(len(operators.facet_area))
    for side in operators.joint_rows[joint]:
        films[side] = conductance
    operators.add_films(upper, films)
    operators.add_joint(upper, joint, conductance)
    assert _largest_difference(operators.matrix(upper), matrix) < ROUND_OFF
    jump = (operators.part_of_unknown == 0).astype(float)
    energy = jump @ (matrix @ jump)
    assert energy == pytest.approx(conductance @ operators.joint_facet_areas(joint), rel=1e-12)


def test_unit_matrices_of_a_part_sum_to_the_whole():
    operators = build_operators(MESH, 2)
    total = 3.0 * operators.parts_conduction(["inner"]) + 5.0 * operators.parts_conduction(["outer"])
    whole = operators.matrix(operators.sum_conduction(np.array([3.0, 5.0])))
    assert _largest_difference(total, whole) < ROUND_OFF
    mass = operators.parts_storage(["outer"])
    assert mass.sum() == pytest.approx(operators.part_volume["outer"], rel=1e-12)


def test_measures_of_a_tube_converge_to_the_cylinder():
    errors = []
    for n in (8, 16):
        operators = build_operators(build_tube((0.1, 0.2), 0.1, (1, n, 1)), 1, area_tolerance=0.1)
        errors.append(abs(operators.area_error()["tube.outer"]))
        assert operators.surface_area("tube.outer") == pytest.approx(2 * np.pi * 0.2 * 0.1, rel=2e-3)
        assert operators.part_volume["tube"] == pytest.approx(np.pi * 0.03 * 0.1, rel=2e-3)
    assert errors[0] / errors[1] > 12.0


def test_coarse_geometry_is_refused_by_name():
    with pytest.raises(
        MeshQualityError, match=r'area of "tube\.\w+" is [+-]\d.* % away from the solid model'
    ):
        build_operators(build_tube((0.1, 0.2), 0.1, (1, 5, 1)), 1)


def test_inverted_elements_are_refused():
    mesh = build_box((1.0, 1.0, 1.0), (1, 1, 1))
    turned = mesh.tetrahedra[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    with pytest.raises(MeshQualityError, match="6 elements are inverted"):
        build_operators(replace(mesh, tetrahedra=turned), 2)


def test_shared_nodes_are_refused():
    mesh = build_box((1.0, 1.0, 1.0), (2, 1, 1))
    parts = np.repeat(np.array([0, 1], dtype=np.int32), 6)
    broken = replace(mesh, part_names=("a", "b"), part_of_element=parts)
    with pytest.raises(MeshTagError, match="two parts share a node"):
        build_operators(broken, 1)


def test_joint_sides_apart_are_refused():
    joint = MESH.joints["inner|outer"]
    moved = replace(joint, facets_b=np.roll(joint.facets_b, 1, axis=0))
    with pytest.raises(MeshTagError, match=r"joint inner\|outer: nodes of its two sides are .* m apart"):
        build_operators(replace(MESH, joints={"inner|outer": moved}), 1)


def test_facets_that_are_not_in_the_mesh_are_refused():
    mesh = build_box((1.0, 1.0, 1.0), (2, 1, 1))
    wrong = mesh.surfaces["box.x0"].copy()
    wrong[0, 0] = mesh.surfaces["box.x1"][0, 0]
    broken = replace(mesh, surfaces={**mesh.surfaces, "box.x0": wrong})
    with pytest.raises(MeshTagError, match="is no facet of any element"):
        build_operators(broken, 1)
    with pytest.raises(MeshTagError, match="1 tagged triangles are no facets"):
        load_into_skfem(mesh, 1).find_facets(wrong)


def test_unknown_names_and_orders():
    operators = build_operators(MESH, 1)
    with pytest.raises(UnknownSurfaceError, match=r'"outer\.outr".*Did you mean "outer\.outer"'):
        operators.surface_area("outer.outr")
    with pytest.raises(UnknownSurfaceError, match=r'names joint "inner\|outter"'):
        operators.joint_matrix("inner|outter")
    with pytest.raises(UnknownSurfaceError, match='names part "shaft"'):
        operators.parts_conduction(["shaft"])
    with pytest.raises(SpecError, match=r"order: 3\. Allowed: 1 or 2"):
        build_operators(MESH, 3)


def test_spread_refuses_wrong_lengths_and_nan():
    with pytest.raises(SpecError, match=r"shape \(2,\). Allowed: a number or 3 values"):
        spread([1.0, 2.0], 3, "film")
    with pytest.raises(SpecError, match="not finite"):
        spread(np.nan, 3, "film")
