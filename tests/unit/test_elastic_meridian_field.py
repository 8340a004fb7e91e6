"""Fields of a thermal mesh in a body's meridian plane: even, linear, and warmer on one side."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.machine.meshing.simple_bodies import build_tube
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.growth_outputs import RADIAL, SIDEWAYS, BodyOutputs
from spindle_fem.model.elastic.meridian_field import MeridianField
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

INSIDE, OUTSIDE, LENGTH = 0.03, 0.07, 0.1


@pytest.fixture(scope="module")
def field() -> MeridianField:
    mesh = build_tube((INSIDE, OUTSIDE), LENGTH, (4, 16, 6))
    section = MeridianMesh.of([[AnnularSegment(0.0, LENGTH, INSIDE, OUTSIDE)]], 0.01)
    return MeridianField(mesh, 2, mesh.part_names, section)


def rows(field: MeridianField, around: str = "even") -> np.ndarray:
    """Every corner value of the fitted field."""
    return field.rows(np.eye(field.section.mesh.nvertices), around)


def test_even_field_comes_out_exactly(field) -> None:
    assert rows(field) @ np.full(len(field.mesh.points), 7.0) == pytest.approx(7.0, rel=1e-12)


def test_a_field_linear_along_the_axis_within_the_damping(field) -> None:
    z, _ = field.section.mesh.p
    inner = (z > 0.015) & (z < LENGTH - 0.015)
    found = rows(field) @ (100.0 * field.mesh.points[:, 2])
    np.testing.assert_allclose(found[inner], 100.0 * z[inner], atol=0.02)


def test_warmer_above_is_the_first_harmonic_up_and_nothing_else(field) -> None:
    x, y, _ = field.mesh.points.T
    _, r = field.section.mesh.p
    warmer = 300.0 + 100.0 * y
    inner = (r > INSIDE + 0.005) & (r < OUTSIDE - 0.005)
    np.testing.assert_allclose((rows(field, "up") @ warmer)[inner], 100.0 * r[inner], rtol=0.03)
    assert np.abs(rows(field, "across") @ warmer).max() < 1e-9
    left = rows(field, "across") @ (300.0 - 100.0 * x)
    np.testing.assert_allclose(left[inner], 100.0 * r[inner], rtol=0.03)


def test_growth_and_bending_from_the_mesh(field) -> None:
    steel = ElasticMaterial(206e9, 0.3, 12e-6).stiffness
    body = ElasticBody("tube", field.section, [steel])
    bore = {"bore": body.mean_shift(Face((0.0, LENGTH), (INSIDE, INSIDE)), RADIAL)}
    even = field.rows(BodyOutputs.of(body, bore).by_temperature()) @ np.full(len(field.mesh.points), 10.0)
    assert even[0] == pytest.approx(12e-6 * 10.0 * INSIDE, rel=1e-9)
    bent = ElasticBody("tube", field.section, [steel], harmonic=1)
    ends = [Face((a, b), (INSIDE, INSIDE)) for a, b in ((0.0, 0.02), (0.04, 0.06), (0.08, 0.1))]
    first, middle, last = (bent.mean_shift(face, SIDEWAYS) for face in ends)
    outputs = BodyOutputs.of(bent, {"sagitta": middle - 0.5 * (first + last)})
    sagitta = field.rows(outputs.by_temperature(), "up") @ (100.0 * field.mesh.points[:, 1])
    assert sagitta[0] == pytest.approx(12e-6 * 100.0 * 0.04**2 / 2.0, rel=0.02)
