"""Sections, clipping and edges of curved meshes against exact areas and lengths."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes, build_tube
from spindle_fem.report import drawn_surfaces as surfaces
from spindle_fem.report import plane_sections as sections
from spindle_fem.report.profiles import axial_profile, meridian_section, radial_profile

INNER, OUTER, LENGTH = 0.05, 0.08, 0.1


def triangle_area(shape):
    """Area of each flat triangle, (m,) in m²."""
    a, b, c = (shape.points[shape.triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.fixture(scope="module")
def tube():
    return build_tube((INNER, OUTER), LENGTH, (2, 13, 3))  # an odd number: the lower half cuts elements


@pytest.fixture(scope="module")
def pair():
    return build_joined_tubes((0.03, 0.05, 0.08), LENGTH, ((2, 2), 13, 3), parts=("shaft", "ring"))


def test_meridian_section_has_the_area_of_both_halves(tube):
    section = sections.section_of_volume(tube, tube.points[:, 2], tube.points[:, 0])
    area = triangle_area(section).sum()
    assert area == pytest.approx(2.0 * LENGTH * (OUTER - INNER), rel=1.0e-3)


def test_straight_section_is_coarser_than_the_curved_one(tube):
    exact = 2.0 * LENGTH * (OUTER - INNER)
    areas = [
        triangle_area(
            sections.section_of_volume(tube, tube.points[:, 2], tube.points[:, 0], curved=curved)
        ).sum()
        for curved in (True, False)
    ]
    assert abs(areas[0] - exact) < 0.2 * abs(areas[1] - exact)


def test_section_in_a_plane_of_nodes_is_found_once():
    box = build_box((1.0, 1.0, 1.0), (2, 2, 2))
    section = sections.section_of_volume(box, box.points[:, 0], box.points[:, 0] - 0.5)
    assert triangle_area(section).sum() == pytest.approx(1.0, rel=1.0e-6)
    assert np.allclose(section.points[:, 0], 0.5, atol=2.0e-9)


def test_section_interpolates_a_linear_field_exactly(tube):
    field = tube.points @ np.array([3.0, -2.0, 5.0])
    section = sections.section_of_volume(tube, field, tube.points[:, 0] - 0.013)
    assert np.allclose(section.values[:, 0], section.points @ np.array([3.0, -2.0, 5.0]), atol=1.0e-12)
    assert np.allclose(section.points[:, 0], 0.013, atol=1.0e-4)


def test_clipping_keeps_half_of_the_surface_and_its_values(tube):
    shape = surfaces.exposed_triangles(tube, tube.points[:, 0])
    half = sections.clip_triangles(shape, shape.points[:, 0])
    whole_area = triangle_area(shape).sum()
    assert triangle_area(half).sum() == pytest.approx(0.5 * whole_area, rel=1.0e-9)
    assert half.points[:, 0].min() >= -1.0e-12
    assert np.allclose(half.values[:, 0], half.points[:, 0], atol=1.0e-12)
    assert half.normals is not None


def test_clipping_keeps_all_or_nothing_where_the_plane_misses(tube):
    shape = surfaces.exposed_triangles(tube, tube.points[:, 0])
    assert len(sections.clip_triangles(shape, np.ones(len(shape.points))).triangles) == len(shape.triangles)
    assert len(sections.clip_triangles(shape, -np.ones(len(shape.points))).triangles) == 0


def test_normals_point_out_of_the_part(tube):
    shape = surfaces.exposed_triangles(tube, tube.points[:, 2])
    radius = np.hypot(shape.points[:, 0], shape.points[:, 1])
    outer = np.isclose(radius, OUTER, atol=1.0e-6) & (np.abs(shape.normals[:, 2]) < 0.5)
    radial = (shape.normals[outer, :2] * shape.points[outer, :2]).sum(axis=1) / OUTER
    assert outer.any()
    assert radial.min() > 0.99


def test_sharp_edges_of_a_tube_are_its_four_circles(tube):
    edges = surfaces.part_edges(tube)
    length = np.linalg.norm(edges.points[:, 1] - edges.points[:, 0], axis=1).sum()
    assert length == pytest.approx(2.0 * 2.0 * np.pi * (INNER + OUTER), rel=5.0e-3)


def test_edges_of_two_parts_in_contact_are_drawn_for_both(pair):
    edges = surfaces.part_edges(pair)
    length = np.linalg.norm(edges.points[:, 1] - edges.points[:, 0], axis=1).sum()
    assert length == pytest.approx(2.0 * 2.0 * np.pi * (0.03 + 0.05 + 0.05 + 0.08), rel=5.0e-3)


def test_clipped_segments_end_on_the_plane():
    line = surfaces.SegmentSet(
        np.array([[[-1.0, 0, 0], [3.0, 0, 0]], [[-2.0, 0, 0], [-1.0, 0, 0]]]),
        np.array([[[0.0], [4.0]], [[0.0], [0.0]]]),
        np.zeros(2, dtype=np.int32),
    )
    kept = sections.clip_segments(line, line.points[..., 0])
    assert len(kept.points) == 1
    assert np.allclose(kept.points[0, :, 0], [0.0, 3.0])
    assert np.allclose(kept.values[0, :, 0], [1.0, 4.0])


def test_outer_faces_of_chosen_elements_close(tube):
    chosen = tube.points[tube.tetrahedra[:, :4], 0].mean(axis=1) > 0.0
    faces, part = surfaces.element_faces(tube, chosen)
    normals = surfaces.facet_normals(tube.points, faces)
    assert part.shape == (len(faces),)
    assert normals.shape == (len(faces), 6, 3)
    # A closed surface: each corner edge belongs to exactly two faces.
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts % 2 == 0).all()


def test_radial_profile_jumps_at_the_joint(pair):
    temperature = np.hypot(pair.points[:, 0], pair.points[:, 1]) * 100.0
    ring = np.unique(pair.tetrahedra[pair.part_of_element == pair.part_names.index("ring")])
    temperature[ring] -= 7.0
    profile = radial_profile(meridian_section(pair, temperature), 0.047)
    assert list(profile) == ["shaft", "ring"]
    shaft_radius, shaft = profile["shaft"]
    ring_radius, outside = profile["ring"]
    assert (shaft_radius[0], shaft_radius[-1]) == pytest.approx((0.03, 0.05), abs=1.0e-5)
    assert (ring_radius[0], ring_radius[-1]) == pytest.approx((0.05, 0.08), abs=1.0e-5)
    assert shaft[-1] - outside[0] == pytest.approx(7.0, abs=1.0e-3)
    assert np.allclose(shaft, 100.0 * shaft_radius, atol=2.0e-3)


@pytest.mark.parametrize(("side", "radius"), [("inner", 0.05), ("outer", 0.08)])
def test_axial_profile_follows_the_asked_face(pair, side, radius):
    temperature = 1000.0 * np.hypot(pair.points[:, 0], pair.points[:, 1]) + pair.points[:, 2]
    z, values = axial_profile(meridian_section(pair, temperature), "ring", side)
    assert np.allclose(values, 1000.0 * radius + z, atol=0.02)
