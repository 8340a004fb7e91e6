"""Areas, volumes and quality of curved elements, and the relaxation of bad ones."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spindle_fem.errors import MeshQualityError
from spindle_fem.machine.meshing.improve_quality import improve_elements
from spindle_fem.machine.meshing.mesh_files import load_named_mesh
from spindle_fem.machine.meshing.quality import (
    TETRAHEDRON_EDGES,
    area_errors,
    enclosed_volume,
    facet_areas,
    gmsh_quality,
    linear_quality,
    require_quality,
    sampled_quality,
    volume_errors,
)

REGULAR = np.array([[1.0, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])


@pytest.fixture(scope="module")
def tiny():
    return load_named_mesh("tiny_spindle")


def with_middles(corners):
    return np.vstack([corners, [0.5 * (corners[a] + corners[b]) for a, b in TETRAHEDRON_EDGES]])


def test_quarter_ring_area_converges_with_fourth_order():
    """One quadratic triangle pair on a cylinder patch: error of the chord's fourth power."""
    errors = []
    for angle in (0.4, 0.2):

        def at(a, z):
            return [np.cos(a), np.sin(a), z]

        corners = np.array([at(0, 0), at(angle, 0), at(0, 0.3)])
        middles = np.array([at(angle / 2, 0), at(angle / 2, 0.15), at(0, 0.15)])
        area = facet_areas(np.vstack([corners, middles]), np.arange(6)[None])[0]
        errors.append(abs(area / (0.5 * angle * 0.3) - 1.0))
    assert errors[0] < 1e-4
    assert 3.5 < np.log2(errors[0] / errors[1]) < 5.0


def test_volume_of_a_cube_from_its_skin():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    points, facets = [], []
    for square in squares:
        for triangle in ((0, 1, 2), (0, 2, 3)):
            nodes = corners[[square[i] for i in triangle]]
            facets.append(np.arange(6) + len(points) * 6)
            points.append(np.vstack([nodes, [(nodes[i] + nodes[(i + 1) % 3]) / 2 for i in range(3)]]))
    assert enclosed_volume(np.vstack(points), np.array(facets)) == pytest.approx(1.0, rel=1e-13)


@given(st.floats(0.05, 3.0))
def test_quality_of_a_stretched_regular_tetrahedron(stretch):
    """Inverse condition number of diag(1, 1, s): 3 / sqrt((2 + s²)(2 + 1/s²))."""
    stretched = REGULAR * [1.0, 1.0, stretch]
    expected = 3.0 / np.sqrt((2 + stretch**2) * (2 + stretch**-2))
    assert linear_quality(stretched, np.array([[0, 1, 2, 3]]))[0] == pytest.approx(expected, rel=1e-12)
    assert sampled_quality(with_middles(stretched)[None])[0] == pytest.approx(expected, rel=1e-10)


def test_inverted_elements_have_negative_quality():
    assert linear_quality(REGULAR, np.array([[1, 0, 2, 3]]))[0] == pytest.approx(-1.0)
    folded = with_middles(REGULAR)
    folded[4] = REGULAR[3]
    assert sampled_quality(folded[None])[0] < 0.0


def test_samples_bound_gmsh_from_above(tiny):
    chosen = tiny.tetrahedra[::7]
    sampled = sampled_quality(tiny.points[chosen])
    exact = gmsh_quality(tiny.points, chosen)
    assert np.all(sampled >= exact - 1e-6)
    assert np.max(sampled - exact) < 0.12


def test_reported_quality_is_gmsh_s_worst(tiny):
    assert gmsh_quality(tiny.points, tiny.tetrahedra).min() == pytest.approx(tiny.min_quality, abs=1e-6)


def test_relaxation_repairs_a_displaced_node(tiny):
    fixed = np.zeros(len(tiny.points), dtype=bool)
    for facets in (*tiny.surfaces.values(), *(j.facets_a for j in tiny.joints.values())):
        fixed[facets] = True
    for joint in tiny.joints.values():
        fixed[joint.facets_b] = True
    free = np.flatnonzero(~fixed[: tiny.n_corners])
    node = int(free[len(free) // 2])
    around = tiny.tetrahedra[(tiny.tetrahedra[:, :4] == node).any(axis=1)]
    points = tiny.points.copy()
    # Push it almost onto a neighbour.
    neighbour = next(n for n in around[0, :4] if n != node)
    push = 0.8 * (points[neighbour] - points[node])
    points[node] += push
    middles = {
        int(element[middle])
        for element in around
        for middle, (a, b) in enumerate(TETRAHEDRON_EDGES, start=4)
        if node in (element[a], element[b])
    }
    points[sorted(middles)] += 0.5 * push
    before = sampled_quality(points[tiny.tetrahedra])
    moved, after = improve_elements(points, tiny.tetrahedra, tiny.n_corners, fixed, before)
    assert before.min() < 0.1
    assert after.min() > 0.15
    assert np.array_equal(moved[fixed], points[fixed])
    assert after == pytest.approx(sampled_quality(moved[tiny.tetrahedra]), abs=1e-12)


def test_small_mesh_matches_its_solid_model(tiny):
    assert max(map(abs, area_errors(tiny).values())) < 1e-3
    assert max(map(abs, volume_errors(tiny).values())) < 1e-3
    require_quality(tiny)


def test_area_off_is_named(tiny):
    wrong = replace(tiny, cad_area=MappingProxyType({**tiny.cad_area, "housing.outside": 0.05}))
    with pytest.raises(
        MeshQualityError, match=r"area of housing\.outside [-+]\d+\.\d+% away from the solid model"
    ):
        require_quality(wrong)


def test_volume_off_is_named(tiny):
    wrong = replace(tiny, cad_volume=MappingProxyType({**tiny.cad_volume, "shaft": 1e-4}))
    with pytest.raises(MeshQualityError, match=r"volume of shaft .* Allowed: 0\.1%"):
        require_quality(wrong)


@pytest.mark.parametrize(("quality", "state"), [(-0.1, "inverted"), (0.0, "inverted"), (0.1, "distorted")])
def test_poor_elements_are_an_error(tiny, quality, state):
    with pytest.raises(
        MeshQualityError, match=rf"{state} elements: the worst minSICN is .*Allowed: above 0\.15"
    ):
        require_quality(replace(tiny, min_quality=quality))
