"""One body in three dimensions against its forms and exact solutions: expansion, gradient, pressure."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import Basis, ElementTetP2, ElementVector

from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes, build_tube
from spindle_fem.model.elastic import solid_forms
from spindle_fem.model.elastic.elastic_body import Face
from spindle_fem.model.elastic.solid_body import SolidBody, SolidMesh
from spindle_fem.model.elastic.solid_facets import on_face
from spindle_fem.model.mesh.skfem_mesh import ELEMENT_QUADRATURE_DEGREE, load_into_skfem
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

STEEL = ElasticMaterial(206e9, 0.3, 12e-6, 7850.0)
INSIDE, OUTSIDE, LENGTH = 0.03, 0.07, 0.04


def tube(counts=(2, 16, 2)):
    return build_tube((INSIDE, OUTSIDE), LENGTH, counts)


def body_of(mesh, rise) -> SolidBody:
    parts = mesh.part_names
    return SolidBody.of(SolidMesh.of(mesh, parts), dict.fromkeys(parts, STEEL), rise)


def as_forms(mesh, rise):
    """Stiffness (n, 3, n, 3), expansion and rotation by scikit-fem, numbered as the mesh's nodes."""
    loaded = load_into_skfem(mesh, 2)
    basis = Basis(loaded.mesh, ElementVector(ElementTetP2()), intorder=ELEMENT_QUADRATURE_DEGREE)
    node = loaded.unknown_of_dof
    place = (3 * node[:, None] + np.arange(3)).ravel()
    own = rise[node]
    first, shear = STEEL.stiffness.normal[0, 1], STEEL.shear_modulus
    matrix = solid_forms.stiffness.assemble(basis, first_lame=first, shear=shear).toarray()
    loads = (
        solid_forms.expansion.assemble(
            basis, thermal=STEEL.stiffness.thermal[0], rise=loaded.basis.interpolate(own)
        ),
        solid_forms.rotation.assemble(basis, density=STEEL.density),
    )
    sorted_matrix = np.empty_like(matrix)
    sorted_matrix[np.ix_(place, place)] = matrix
    found = []
    for load in loads:
        sorted_load = np.empty_like(load)
        sorted_load[place] = load
        found.append(sorted_load.reshape(-1, 3))
    return sorted_matrix, *found


def test_the_kernel_integrates_what_the_forms_say() -> None:
    mesh = tube((1, 6, 1))
    rise = np.random.default_rng(2).normal(20.0, 5.0, len(mesh.points))
    body = body_of(mesh, rise)
    matrix, expansion, rotation = as_forms(mesh, rise)
    trial = np.random.default_rng(3).normal(size=mesh.points.shape)
    forces = (matrix @ trial.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(body.multiply(trial), forces, atol=1e-13 * np.abs(matrix).max() * 60)
    np.testing.assert_allclose(body.expansion, expansion, atol=1e-13 * np.abs(expansion).max())
    np.testing.assert_allclose(body.turning, rotation, atol=1e-13 * np.abs(rotation).max())


def test_even_expansion_leaves_no_stress() -> None:
    """Grown evenly, forces balance to what 1e-6 E α ΔT would give; both parts of a joint move together."""
    mesh = build_joined_tubes((0.03, 0.05, OUTSIDE), LENGTH, ((1, 1), 16, 2))
    body = body_of(mesh, np.full(len(mesh.points), 10.0))
    shift = body.solve(body.expansion, 1e-12)
    points = body.mesh.points
    apart = shift - shift[:1] - 12e-5 * (points - points[:1])
    turned = np.linalg.lstsq(body.rigid, apart.ravel(), rcond=None)[0]
    rest = apart.ravel() - body.rigid @ turned
    # strains of what is left, over the smallest distance of nodes
    assert np.abs(rest).max() / 0.005 < 1e-6 * 12e-5


def test_a_linear_temperature_bends_a_box_without_stress() -> None:
    """u along x is α g (x y), along y α g (y² − x² − z²) / 2: quadratic, so exact."""
    mesh = build_box((0.1, 0.05, 0.04), (3, 2, 2))
    gradient = 100.0
    x, y, z = mesh.points.T
    body = body_of(mesh, gradient * y)
    found = body.solve(body.expansion, 1e-12)
    exact = 12e-6 * gradient * np.column_stack([x * y, 0.5 * (y**2 - x**2 - z**2), z * y])
    off = (found - exact).ravel()
    off -= body.rigid @ (body.rigid.T @ off)
    assert np.abs(off).max() < 1e-9 * np.abs(exact).max()


def test_pressure_in_the_bore_by_lame() -> None:
    """Refined once, the error falls at least as the third power of the size."""
    shape = (OUTSIDE**2 + INSIDE**2) / (OUTSIDE**2 - INSIDE**2)
    exact = 1e7 * INSIDE / 206e9 * (shape + 0.3)
    errors = []
    for counts in ((2, 12, 1), (4, 24, 2)):
        mesh = tube(counts)
        body = body_of(mesh, np.zeros(len(mesh.points)))
        bore = on_face(mesh, ["tube"], Face((0.0, LENGTH), (INSIDE, INSIDE)))
        shift = body.solve(bore.load(1e7 * bore.outwards), 1e-10)
        errors.append(abs(bore.growth(shift) / exact - 1.0))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 8.0


def test_radial_gradient_converges_to_the_hollow_cylinder() -> None:
    """Mean growth of the bore by T linear in r with free ends: u(a) of the field's mean."""
    hot = 50.0
    moment = hot * (OUTSIDE**3 / 3.0 - INSIDE * OUTSIDE**2 / 2.0 + INSIDE**3 / 6.0) / (OUTSIDE - INSIDE)
    exact = 2.0 * 12e-6 * INSIDE / (OUTSIDE**2 - INSIDE**2) * moment
    errors = []
    for counts in ((2, 12, 1), (4, 24, 2)):
        mesh = tube(counts)
        radius = np.hypot(*mesh.points[:, :2].T)
        body = body_of(mesh, hot * (radius - INSIDE) / (OUTSIDE - INSIDE))
        bore = on_face(mesh, ["tube"], Face((0.0, LENGTH), (INSIDE, INSIDE)))
        errors.append(abs(bore.growth(body.solve(body.expansion, 1e-10)) / exact - 1.0))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 6.0


def test_parts_that_touch_nowhere_are_no_body() -> None:
    from spindle_fem.errors import GeometryError

    mesh = build_joined_tubes((0.03, 0.05, 0.06, OUTSIDE), LENGTH, ((1, 1, 1), 12, 1), parts=("a", "b", "c"))
    with pytest.raises(GeometryError, match="touch nowhere"):
        SolidMesh.of(mesh, ["a", "c"])
