"""Contacts, faces and faults found in the meridian plane."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError, GeometryError
from spindle_fem.machine.geometry.assembly import assemble, build_assembly
from spindle_fem.machine.geometry.part_shapes import AnnularSegment, FaceBox, PartGeometry, SurfaceDefinition


def ring(z_start, z_end, inner, outer):
    """Segment in millimetres."""
    return AnnularSegment(z_start * 1e-3, z_end * 1e-3, inner * 1e-3, outer * 1e-3)


def shaft(*segments):
    return PartGeometry("shaft", segments or (ring(0, 100, 10, 20),), rotating=True)


def hub(z_start=20, z_end=60, inner=20, outer=40):
    return PartGeometry("hub", (ring(z_start, z_end, inner, outer),))


def faults_of(*arguments, **options):
    with pytest.raises(FaultsError) as caught:
        assemble(*arguments, **options)
    assert all(isinstance(fault, GeometryError) for fault in caught.value.faults)
    return [str(fault) for fault in caught.value.faults]


@pytest.fixture(scope="module")
def reference():
    return build_assembly(load_machine("wu_tan_2016"))


def total_area(assembly, name):
    return sum(edge.area for edge in assembly.edges if edge.name == name)


def test_cylindrical_contact_takes_the_common_face_only():
    assembly = assemble([shaft(), hub()])
    assert assembly.joint_names == ("hub|shaft",)
    assert assembly.joint_parts["hub|shaft"] == ("hub", "shaft")
    assert total_area(assembly, "hub|shaft") == pytest.approx(2 * math.pi * 0.020 * 0.040, rel=1e-12)
    outward_rest = 2 * math.pi * 0.020 * 0.060
    ends = 2 * math.pi * (0.020**2 - 0.010**2)
    bore = 2 * math.pi * 0.010 * 0.100
    assert total_area(assembly, "shaft.adiabatic") == pytest.approx(outward_rest + ends + bore, rel=1e-12)


def test_plane_contact_has_a_name_of_its_own():
    stepped = shaft(ring(0, 20, 10, 30), ring(20, 100, 10, 20))
    assembly = assemble([stepped, hub()])
    assert assembly.joint_names == ("hub|shaft", "hub|shaft:face")
    assert total_area(assembly, "hub|shaft:face") == pytest.approx(math.pi * (0.030**2 - 0.020**2), rel=1e-12)


def test_segments_of_one_part_may_overlap_and_make_no_face():
    one = assemble([shaft(ring(0, 100, 10, 20))])
    fused = assemble([shaft(ring(0, 60, 10, 20), ring(40, 100, 10, 20))])
    assert fused.edges == one.edges


def test_partial_faces_are_imprinted():
    nose = SurfaceDefinition("shaft.nose", "shaft", (FaceBox("outward", z=(0.0, 0.025)), FaceBox("front")))
    assembly = assemble([shaft()], [nose])
    assert total_area(assembly, "shaft.nose") == pytest.approx(
        2 * math.pi * 0.020 * 0.025 + math.pi * (0.020**2 - 0.010**2), rel=1e-12
    )
    outward = [edge for edge in assembly.edges if edge.facings == ("outward",)]
    assert sorted(edge.z for edge in outward) == [(0.0, 0.025), (0.025, 0.1)]


def test_selector_takes_no_contact_face():
    surface = SurfaceDefinition("shaft.outside", "shaft", (FaceBox("outward"),))
    assembly = assemble([shaft(), hub()], [surface])
    assert total_area(assembly, "shaft.outside") == pytest.approx(2 * math.pi * 0.020 * 0.060, rel=1e-12)


def test_solid_shaft_has_no_face_on_its_axis():
    assembly = assemble([shaft(ring(0, 100, 0, 20))])
    assert total_area(assembly, "shaft.adiabatic") == pytest.approx(
        2 * math.pi * 0.020 * 0.100 + 2 * math.pi * 0.020**2, rel=1e-12
    )


def test_coordinates_are_compared_in_nanometres():
    nearly = hub(inner=20.0 + 4e-7)  # 0.4 nm off
    assert assemble([shaft(), nearly]).joint_names == ("hub|shaft",)


def test_overlap_names_both_parts():
    (text,) = faults_of([shaft(), hub(inner=19)])
    assert 'part "hub": z 20 mm to 60 mm, r 19 mm to 40 mm overlaps part "shaft".' in text


def test_floating_part_is_named():
    texts = faults_of([shaft(), hub(), PartGeometry("lost", (ring(200, 210, 5, 6),))])
    assert texts == [
        'part "lost": touches no other part; the nearest, part "shaft", is 100 mm away along z and '
        "4 mm away along r. Allowed: parts with a face in contact."
    ]


def test_part_that_comes_apart():
    (text,) = faults_of([shaft(ring(0, 40, 10, 20), ring(50, 100, 10, 20))])
    assert 'part "shaft": comes apart into 2 bodies.' in text


def test_edge_contact_has_zero_thickness():
    texts = faults_of([shaft(ring(0, 40, 10, 20), ring(40, 100, 20, 30))])
    assert any("has zero thickness at z 40 mm, r 20 mm" in text for text in texts)


@pytest.mark.parametrize(
    ("segment", "message"),
    [
        (ring(10, 10, 10, 20), "z 10 mm to 10 mm, r 10 mm to 20 mm has no thickness"),
        (ring(0, 10, 20, 20), "z 0 mm to 10 mm, r 20 mm to 20 mm has no thickness"),
        (ring(0, 10, -5, 20), "inner radius is -5 mm"),
    ],
)
def test_degenerate_segment(segment, message):
    assert any(message in text for text in faults_of([shaft(), hub(), PartGeometry("bad", (segment,))]))


def test_selector_without_a_face_lists_those_there_are():
    surface = SurfaceDefinition("shaft.step", "shaft", (FaceBox("outward", r=(0.025, 0.025)),))
    (text,) = faults_of([shaft()], [surface])
    assert 'surface "shaft.step", where[1]: facing "outward", r 25 mm matches no exposed face' in text
    assert "faces that look outward: r 20 mm, z 0 to 100 mm." in text


@pytest.mark.parametrize("backwards", [False, True])
def test_walls_of_a_circuit_are_told_once_by_the_key_of_the_circuit(backwards):
    cells = [(0.0, 0.01), (0.01, 0.02), (0.02, 0.03)]
    surfaces = [
        SurfaceDefinition(
            f"jacket.{number}", "shaft", (FaceBox("outward", z, (0.025, 0.025)),), "film.jacket.diameter"
        )
        for number, z in enumerate(cells[::-1] if backwards else cells, 1)
    ]
    (text,) = faults_of([shaft()], surfaces)
    assert text.startswith('film.jacket.diameter: facing "outward", z 0 to 30 mm, r 25 mm matches no')
    moved = [
        replace(
            each, where=(replace(each.where[0], z=tuple(z + 0.2 for z in each.where[0].z), r=(0.02,) * 2),)
        )
        for each in surfaces
    ]
    (text,) = faults_of([shaft()], moved)
    assert text.startswith("film.jacket.z: ")


def test_a_wall_of_a_circuit_is_exposed_over_its_whole_length():
    box = FaceBox("outward", (0.0, 0.14), (0.02, 0.02))
    wall = SurfaceDefinition("jacket.1", "shaft", (box,), "film.jacket.diameter")
    (text,) = faults_of([shaft()], [wall])
    assert text.startswith(
        'film.jacket.z: facing "outward", z 0 to 140 mm, r 20 mm is not all an exposed face'
    )
    assert "Allowed: faces that look outward: r 20 mm, z 0 to 100 mm" in text


def test_overlaps_that_lie_together_in_one_segment_are_one_fault():
    bodies = [
        shaft(),
        PartGeometry("ring", (ring(40, 60, 20, 30),)),
        PartGeometry("nut", (ring(58, 70, 19, 29),)),
    ]
    (text,) = faults_of(bodies)
    assert text.startswith(
        'part "nut": z 58 mm to 70 mm, r 19 mm to 29 mm overlaps parts "shaft" and "ring".'
    )
    apart = [
        shaft(),
        PartGeometry("one", (ring(0, 20, 19, 30),)),
        PartGeometry("two", (ring(70, 90, 19, 30),)),
    ]
    assert [text.split('"')[1] for text in faults_of(apart)] == ["one", "two"]


def test_faces_that_an_overlap_cuts_are_no_faults_of_their_own():
    surface = SurfaceDefinition("hub.bore", "hub", (FaceBox("inward", (0.0, 0.1), (0.02, 0.02)),))
    thick = PartGeometry("shaft", (AnnularSegment(0.0, 0.1, 0.0, 0.0201),))
    sleeve = PartGeometry("hub", (AnnularSegment(0.0, 0.1, 0.02, 0.03),))
    (text,) = faults_of([thick, sleeve], [surface])
    assert "overlaps" in text


def test_surface_of_unknown_part_suggests_one():
    (text,) = faults_of([shaft()], [SurfaceDefinition("a", "shft", (FaceBox("outward"),))])
    assert 'part "shft" does not exist. Did you mean "shaft"? Allowed: shaft.' in text


def test_face_in_two_surfaces():
    surfaces = [
        SurfaceDefinition("one", "shaft", (FaceBox("outward", z=(0.0, 0.06)),)),
        SurfaceDefinition("two", "shaft", (FaceBox("outward", z=(0.04, 0.1)),)),
    ]
    (text,) = faults_of([shaft()], surfaces)
    assert (
        text
        == 'surface "two": claims a face that surface "one" has already. Allowed: each face in one surface.'
    )


def test_unnamed_faces_may_be_faults():
    texts = faults_of([shaft()], [SurfaceDefinition("s", "shaft", (FaceBox("outward"),))], remaining="error")
    assert len(texts) == 3
    assert any("the inward face r 10 mm, z 0 to 100 mm belongs to no surface" in text for text in texts)


def test_names_used_twice_or_reserved():
    texts = faults_of(
        [shaft(), shaft()],
        [SurfaceDefinition("shaft.adiabatic", "shaft", (FaceBox("outward"),))],
    )
    assert any('part "shaft": is defined twice.' in text for text in texts)
    assert any("takes a name that the geometry gives itself" in text for text in texts)


def test_part_name_with_a_bar():
    (text,) = faults_of([PartGeometry("a|b", (ring(0, 1, 1, 2),))])
    assert 'contains "|" or ":".' in text


def test_no_parts():
    assert faults_of([]) == ["part: no part is defined. Allowed: at least one part."]


def test_all_faults_come_at_once():
    texts = faults_of(
        [shaft(), hub(inner=19), PartGeometry("lost", (ring(200, 210, 5, 6),))],
        [SurfaceDefinition("none", "shaft", (FaceBox("rear", z=(0.5, 0.5)),))],
    )
    assert len(texts) == 3


def test_reference_spindle_contacts(reference):
    """The contacts that shared/reference/spindle.md lists for this machine."""
    seats = {name for name in reference.joint_names if ":" not in name}
    assert seats == {
        *(f"{name}.inner_ring|shaft" for name in ("F1", "F2", "F3", "R1", "R2")),
        *(f"{name}.outer_ring|housing" for name in ("F1", "F2", "F3", "R1", "R2")),
        "front_inner_spacer|shaft",
        "front_outer_spacer|housing",
        "housing|rear_outer_spacer",
        "rear_inner_spacer|shaft",
    }
    faces = {name for name in reference.joint_names if ":" in name}
    # Shoulders at z 45, 137, 430, 484, outer shoulder, cover, nose clearance,
    # two tandem pairs and eight ring-spacer faces.
    assert len(faces) == 4 + 1 + 1 + 1 + 2 + 8


def test_reference_spindle_areas(reference):
    assert total_area(reference, "housing.flange_back") == pytest.approx(
        math.pi * (0.190**2 - 0.150**2), rel=1e-12
    )
    assert total_area(reference, "F1.inner_ring|shaft") == pytest.approx(
        2 * math.pi * 0.070 * 0.024, rel=1e-12
    )
    assert total_area(reference, "shaft.gap") == pytest.approx(
        2 * math.pi * 0.065 * (0.410 - 0.157), rel=1e-12
    )
    assert total_area(reference, "F1.outer_ring|shaft:face") == pytest.approx(
        math.pi * (0.090**2 - 0.086**2), rel=1e-12
    )


def test_rotating_parts(reference):
    turning = {name for name, rotates in reference.rotating.items() if rotates}
    assert turning == {
        "shaft",
        "front_inner_spacer",
        "rear_inner_spacer",
        *(f"{name}.inner_ring" for name in ("F1", "F2", "F3", "R1", "R2")),
    }
