"""Probes find their curved element; fields of the space are reproduced."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.errors import GeometryError, SpecError
from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes
from spindle_fem.model.mesh.evaluate import (
    locate_points,
    mean_matrix,
    probe_matrix,
    surface_mean,
    temperature_at_nodes,
)
from spindle_fem.model.mesh.mesh_operators import build_operators

TUBES = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((2, 2), 24, 3))


def _scattered(count=300):
    rng = np.random.default_rng(0)
    r, angle, z = rng.uniform(0.1, 0.2, count), rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 0.1, count)
    points = np.stack((-r * np.sin(angle), r * np.cos(angle), z), axis=1)
    return points, np.where(r < 0.15, "inner", "outer").tolist()


def test_points_are_found_on_the_curved_mesh():
    points, parts = _scattered()
    location = locate_points(TUBES, points, parts)
    nodes = TUBES.points[TUBES.tetrahedra[location.element]]
    from spindle_fem.model.mesh.evaluate import quadratic_shape

    values, _ = quadratic_shape(location.place)
    np.testing.assert_allclose(np.einsum("en,enx->ex", values, nodes), points, rtol=0, atol=1e-12)
    found = np.array(TUBES.part_names, dtype=object)[TUBES.part_of_element[location.element]]
    assert found.tolist() == parts


def test_linear_field_is_exact_at_probes_of_order_2():
    operators = build_operators(TUBES, 2)
    field = 300.0 + TUBES.points @ np.array([20.0, -10.0, 30.0])
    points, parts = _scattered()
    probed = probe_matrix(operators, points, parts) @ field
    np.testing.assert_allclose(probed, 300.0 + points @ np.array([20.0, -10.0, 30.0]), rtol=0, atol=1e-10)


def test_quadratic_field_is_exact_on_straight_elements():
    mesh = build_box((0.1, 0.1, 0.1), (2, 2, 2))
    operators = build_operators(mesh, 2)

    def field(x):
        return 300.0 + 1e3 * x[:, 0] * x[:, 1] - 2e3 * x[:, 2] ** 2

    points = np.random.default_rng(2).uniform(0.0, 0.1, (50, 3))
    probed = probe_matrix(operators, points, ["box"] * 50) @ field(mesh.points)
    np.testing.assert_allclose(probed, field(points), rtol=0, atol=1e-10)


def test_both_sides_of_a_joint_have_a_temperature():
    operators = build_operators(TUBES, 2)
    field = np.where(operators.part_of_unknown == 0, 310.0, 300.0)
    points = [[0.0, 0.15, 0.05]] * 2
    probed = probe_matrix(operators, points, ["inner", "outer"]) @ field
    assert probed.round(9).tolist() == [310.0, 300.0]


def test_point_outside_is_refused_with_its_distance():
    with pytest.raises(GeometryError, match=r'point \[300.0, 0.0, 0.0\] mm: .* mm outside part "outer"'):
        locate_points(TUBES, [[0.3, 0.0, 0.0]], ["outer"])
    with pytest.raises(SpecError, match='part "shaft" is not in this mesh'):
        locate_points(TUBES, [[0.12, 0.0, 0.0]], ["shaft"])
    with pytest.raises(SpecError, match="for 2 parts"):
        locate_points(TUBES, [[0.12, 0.0, 0.0]], ["inner", "outer"])


@pytest.mark.parametrize("order", [1, 2])
def test_means(order):
    operators = build_operators(TUBES, order)
    field = 300.0 + 100.0 * TUBES.points[: operators.n_unknowns, 2]
    assert surface_mean(operators, field, "outer.outer") == pytest.approx(305.0, abs=1e-9)
    assert (mean_matrix(operators, ["outer.z1"]) @ field)[0] == pytest.approx(310.0, abs=1e-9)


def test_linear_temperature_is_interpolated_to_edge_middles():
    operators = build_operators(build_box((0.1, 0.1, 0.1), (2, 2, 2)), 1)
    points = operators.mesh.points
    field = 300.0 + points @ np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(
        temperature_at_nodes(operators, field[: operators.n_unknowns]), field, atol=1e-12
    )
