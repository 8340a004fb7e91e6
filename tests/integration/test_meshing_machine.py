"""Meshes of whole machines by gmsh: names, conformity, areas, the helix, solids."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from scripts.design_space import draw_valid_designs
from scripts.random_machines import draw_machine
from spindle_fem.cache import CACHE_VARIABLE
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import GeometryError, MeshQualityError, MeshTagError
from spindle_fem.machine.geometry.assembly import assemble, build_assembly
from spindle_fem.machine.geometry.cad_solids import build_solids, gmsh_session
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition
from spindle_fem.machine.geometry.part_shapes import (
    AnnularSegment,
    BallRowGeometry,
    FaceBox,
    PartGeometry,
    SurfaceDefinition,
)
from spindle_fem.machine.geometry.step_file import export_step
from spindle_fem.machine.meshing.build_mesh import build_mesh, generate_mesh
from spindle_fem.machine.meshing.classify_faces import classify_face
from spindle_fem.machine.meshing.generate import LADDER, Attempt
from spindle_fem.machine.meshing.quality import area_errors, facet_areas, gmsh_quality, volume_errors
from spindle_fem.machine.meshing.sizes import build_sizes, edge_sizes


def ring(z_start, z_end, inner, outer):
    """Segment in millimetres."""
    return AnnularSegment(z_start * 1e-3, z_end * 1e-3, inner * 1e-3, outer * 1e-3)


PARTS = (
    PartGeometry("shaft", (ring(0, 70, 10, 20), ring(0, 8, 10, 24)), rotating=True),
    PartGeometry("hub", (ring(8, 60, 20, 55),)),
)
CHANNEL = ChannelDefinition(
    "hub", 0.034, 0.007, 0.007, 0.013, 2.5, starts=1, z_start=0.016, port_diameter=0.004
)


@pytest.fixture(scope="module")
def machine():
    surfaces = [
        SurfaceDefinition("hub.outside", "hub", (FaceBox("outward"),)),
        SurfaceDefinition("shaft.nose", "shaft", (FaceBox("front"), FaceBox("outward", r=(0.024, 0.024)))),
    ]
    return assemble(PARTS, surfaces, CHANNEL)


@pytest.fixture(scope="module")
def mesh(machine):
    return build_mesh(machine, "coarse", use_cache=False, threads=1)


def signed_volumes(mesh):
    corners = mesh.points[mesh.tetrahedra[:, :4]]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    return np.einsum("ei,ei->e", a, np.cross(b, c)) / 6.0


def test_every_name_is_there(machine, mesh):
    assert tuple(mesh.surfaces) == machine.surface_names
    assert tuple(mesh.joints) == machine.joint_names == ("hub|shaft", "hub|shaft:face")
    assert mesh.part_names == ("shaft", "hub")
    assert dict(mesh.rotating) == {"shaft": True, "hub": False}
    assert mesh.part_of_surface["hub.channel_wall"] == "hub"


def test_layout_of_nodes(mesh):
    assert mesh.tetrahedra[:, :4].max() == mesh.n_corners - 1
    assert mesh.tetrahedra[:, 4:].min() == mesh.n_corners
    assert np.array_equal(np.unique(mesh.tetrahedra), np.arange(len(mesh.points)))
    assert signed_volumes(mesh).min() > 0.0


def test_parts_share_no_node(mesh):
    nodes = [set(np.unique(mesh.tetrahedra[mesh.part_of_element == part]).tolist()) for part in (0, 1)]
    assert not nodes[0] & nodes[1]


def test_joint_nodes_match(mesh):
    for joint in mesh.joints.values():
        part_a, part_b = joint.name.partition(":")[0].split("|")
        assert np.abs(mesh.points[joint.facets_a] - mesh.points[joint.facets_b]).max() < 1e-12
        for facets, part in ((joint.facets_a, part_a), (joint.facets_b, part_b)):
            owned = np.unique(mesh.tetrahedra[mesh.part_of_element == mesh.part_names.index(part)])
            assert np.isin(facets, owned).all()


def test_facets_cover_the_boundary_once_and_point_outwards(mesh):
    faces = mesh.tetrahedra[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    keys, count = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    boundary = {tuple(key) for key in keys[count == 1].tolist()}
    listed = [*mesh.surfaces.values()]
    for joint in mesh.joints.values():
        listed += [joint.facets_a, joint.facets_b]
    found = [tuple(sorted(facet)) for facets in listed for facet in facets[:, :3].tolist()]
    assert len(found) == len(set(found))
    assert set(found) == boundary
    outward = mesh.points[mesh.surfaces["hub.outside"][:, :3]]
    normal = np.cross(outward[:, 1] - outward[:, 0], outward[:, 2] - outward[:, 0])
    assert (np.einsum("fi,fi->f", normal[:, :2], outward.mean(axis=1)[:, :2]) > 0.0).all()
    wall = mesh.points[mesh.surfaces["hub.channel_wall"][:, :3]]
    radius = np.hypot(wall[..., 0], wall[..., 1])
    inner = np.abs(radius - 0.034).max(axis=1) < 1e-5
    normal = np.cross(wall[:, 1] - wall[:, 0], wall[:, 2] - wall[:, 0])
    # Metal lies inside the inner wall, so its normal points away from the axis.
    assert (np.einsum("fi,fi->f", normal[inner, :2], wall[inner].mean(axis=1)[:, :2]) > 0.0).all()


def test_middles_lie_on_curved_faces(mesh):
    outside = mesh.points[mesh.surfaces["hub.outside"]]
    assert np.abs(np.hypot(outside[..., 0], outside[..., 1]) - 0.055).max() < 1e-7
    seat = mesh.points[mesh.joints["hub|shaft"].facets_a]
    assert np.abs(np.hypot(seat[..., 0], seat[..., 1]) - 0.020).max() < 1e-9


def test_channel_is_the_right_handed_helix(mesh):
    """Every node of a wall lies on r = inner or outer, or z = z_start ± w/2 + pitch θ / 2π."""
    nodes = np.unique(mesh.surfaces["hub.channel_wall"])
    x, y, z = mesh.points[nodes].T
    radius, theta = np.hypot(x, y), np.arctan2(-x, y)
    on_cylinder = np.minimum(np.abs(radius - 0.034), np.abs(radius - 0.041)) < 5e-6
    heights = [z - 0.016 - side * 0.007 - 0.013 * theta / (2 * np.pi) for side in (-0.5, 0.5)]
    off = np.min([np.abs(h - 0.013 * np.round(h / 0.013)) for h in heights], axis=0)
    assert (on_cylinder | (off < 5e-6)).all()
    assert np.count_nonzero(~on_cylinder) > 100


def test_areas_and_volumes_against_formulas(mesh):
    area = {name: facet_areas(mesh.points, facets).sum() for name, facets in mesh.surfaces.items()}
    ports = 2 * math.pi * 0.002**2
    assert area["hub.outside"] == pytest.approx(2 * math.pi * 0.055 * 0.052 - ports, rel=2e-4)
    shaft = math.pi * ((0.020**2 - 0.010**2) * 0.070 + (0.024**2 - 0.020**2) * 0.008)
    assert mesh.cad_volume["shaft"] == pytest.approx(shaft, rel=1e-6)
    assert max(map(abs, area_errors(mesh).values())) < 1e-3
    assert max(map(abs, volume_errors(mesh).values())) < 1e-3
    assert gmsh_quality(mesh.points, mesh.tetrahedra).min() == pytest.approx(mesh.min_quality, abs=1e-6)
    assert mesh.min_quality > 0.15


@pytest.mark.parametrize(
    ("starts", "hand", "turns", "pitch"),
    [(1, "right", 2.75, 0.013), (1, "left", 2.3, 0.013), (2, "right", 1.5, 0.024), (2, "left", 0.6, 0.030)],
)
def test_channel_area_and_volume_without_ports(starts, hand, turns, pitch):
    """Exact wall area and volume of the sweep: closed form of the helicoid."""
    definition = ChannelDefinition(
        "hub", 0.034, 0.007, 0.007, pitch, turns, starts=starts, hand=hand, z_start=0.016
    )
    assembly = assemble(PARTS, channel=definition)
    mesh = build_mesh(assembly, "coarse", use_cache=False, threads=1)
    exact = assembly.channel
    assert mesh.cad_area["hub.channel_wall"] == pytest.approx(exact.wall_area, rel=2e-5)
    assert mesh.cad_area["hub.channel_ends"] == pytest.approx(starts * 2 * 0.007**2, rel=1e-6)
    body = math.pi * (0.055**2 - 0.020**2) * 0.052
    assert body - mesh.cad_volume["hub"] == pytest.approx(exact.volume, rel=2e-5)
    wall = facet_areas(mesh.points, mesh.surfaces["hub.channel_wall"]).sum()
    assert wall == pytest.approx(exact.wall_area, rel=1e-3)


def test_port_that_straddles_a_step():
    stepped = PartGeometry("hub", (ring(8, 38, 20, 65), ring(38, 60, 20, 55)))
    channel = ChannelDefinition("hub", 0.034, 0.007, 0.012, 0.016, 1.0, z_start=0.021, port_diameter=0.010)
    mesh = build_mesh(assemble([PARTS[0], stepped], channel=channel), "coarse", use_cache=False, threads=1)
    assert mesh.min_quality > 0.05


def test_reference_spindle_mesh():
    """The whole machine: names, CAD within 0.1 %, worst element above 0.15, channel area of spindle.md."""
    assembly = build_assembly(load_machine("recorded_spindle"))
    mesh = build_mesh(assembly, "coarse", use_cache=False, threads=1)
    assert tuple(mesh.surfaces) == assembly.surface_names
    assert tuple(mesh.joints) == assembly.joint_names
    assert mesh.cad_area["housing.channel_wall"] == pytest.approx(0.1562, abs=5e-5)
    assert mesh.min_quality > 0.15
    assert max(map(abs, area_errors(mesh).values())) < 1e-3


@pytest.mark.parametrize("number", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_random_designs_mesh(number):
    """Housing of the reference spindle with channels of the design space."""
    reference = build_assembly(load_machine("wu_tan_2016"))
    housing = [part for part in reference.parts if part.name == "housing"]
    for assembly in draw_valid_designs(housing, reference.channel.definition, number, seed=2026):
        mesh = generate_mesh(assembly, build_sizes(assembly, "coarse"), threads=1)
        assert mesh.min_quality > 0.05, assembly.channel.definition
        assert max(map(abs, area_errors(mesh).values())) < 1e-3


def test_same_input_same_mesh_made_or_from_the_cache(machine, mesh, tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    made = build_mesh(machine, "coarse")
    monkeypatch.setattr("spindle_fem.machine.meshing.build_mesh.generate_mesh", None)
    for again in (made, build_mesh(machine, "coarse")):
        assert np.array_equal(again.points, mesh.points)
        assert np.array_equal(again.tetrahedra, mesh.tetrahedra)
        assert again.digest == mesh.digest


def test_second_attempt_is_noted(machine, monkeypatch):
    from spindle_fem.machine.meshing import build_mesh as build

    first, second = build.LADDER[:2]
    genuine = build.mesh_once

    def fail_first(assembly, sizes, attempt, threads):
        if attempt == first:
            raise MeshQualityError("mesh", "gmsh gave up.", "Change it.")
        return genuine(assembly, sizes, attempt, threads)

    monkeypatch.setattr(build, "mesh_once", fail_first)
    made = generate_mesh(machine, build_sizes(machine, "coarse"))
    (note,) = made.notes
    assert note == f"meshed with {second.describe()} after {first.describe()}: gmsh gave up."


@pytest.mark.slow
def test_thin_walls_mesh_with_short_chords(tmp_path):
    """A jacket of 3 mm around an annulus of 3.4 mm, which long chords flatten."""
    path = tmp_path / "thin.toml"
    path.write_text(tomli_w.dumps(draw_machine(np.random.default_rng([2, 146]))), encoding="utf-8")
    assembly = build_assembly(load_machine(path))
    sizes = build_sizes(assembly, "coarse")
    thin = next(attempt for attempt in LADDER if attempt.clearance_share == 0.15)
    assert sum(edge_sizes(assembly, sizes, 0.15)) < sum(edge_sizes(assembly, sizes))
    with pytest.raises(MeshQualityError, match="distorted elements"):
        generate_mesh(assembly, sizes, ladder=LADDER[:1])
    made = generate_mesh(assembly, sizes, ladder=(thin,))
    assert made.min_quality > 0.15
    assert made.n_elements < 60_000


def test_best_attempt_below_the_aim_is_kept_and_said_so(machine, monkeypatch):
    monkeypatch.setattr("spindle_fem.machine.meshing.build_mesh.MINIMUM_QUALITY", 0.9)
    made = generate_mesh(machine, build_sizes(machine, "coarse"), ladder=(Attempt(6, 10, 1.0),))
    assert made.notes[-1] == f"worst element has minSICN {made.min_quality:.3f}, below the 0.9 aimed at"


@pytest.mark.parametrize(
    ("limits", "tried"),
    [
        # fit elements end the search before settings that mesh finer
        ({}, ["Delaunay", "frontal", "thin", "end"]),
        # without them, finer settings are tried while they do not make too many elements
        ({"FIT_QUALITY": 0.95}, ["Delaunay", "frontal", "thin", "finer", "end"]),
        ({"FIT_QUALITY": 0.95, "MOST_ELEMENTS": 1000}, ["Delaunay", "frontal", "thin", "end"]),
    ],
)
def test_finer_settings_end(machine, monkeypatch, limits, tried):
    from spindle_fem.machine.meshing import build_mesh as build

    ladder = {
        "Delaunay": Attempt(5, 10, 1.0), "frontal": Attempt(6, 10, 1.0),
        "thin": Attempt(6, 10, 1.0, clearance_share=0.15), "finer": Attempt(6, 10, 0.85, 0.35),
    }  # fmt: skip
    names, genuine = {attempt: name for name, attempt in ladder.items()}, build.mesh_once
    mesh, asked = genuine(machine, build_sizes(machine, "coarse"), ladder["frontal"], 1), []
    monkeypatch.setattr(build, "mesh_once", lambda *given: asked.append(names[given[2]]) or mesh)
    for name, value in ({"MINIMUM_QUALITY": 0.9} | limits).items():
        monkeypatch.setattr(build, name, value)
    made = generate_mesh(machine, build_sizes(machine, "coarse"), ladder=tuple(ladder.values()))
    assert [*asked, "end"] == tried
    assert made.notes[-1].startswith("worst element has minSICN")


def test_no_attempt_left(machine, monkeypatch):
    def fail(*_):
        raise MeshQualityError("mesh", "gmsh failed", "Change it.")

    monkeypatch.setattr("spindle_fem.machine.meshing.build_mesh.mesh_once", fail)
    with pytest.raises(
        MeshQualityError, match="no settings gave a sound mesh: frontal Delaunay surfaces, HXT"
    ):
        generate_mesh(machine, build_sizes(machine, "coarse"), threads=1)


def test_face_of_nothing_is_refused(machine):
    stray = np.array([[0.03, 0.0, 0.02], [0.0, 0.03, 0.02], [0.0, 0.031, 0.021]])
    with pytest.raises(MeshTagError, match=r"a face of hub at z 0.02 to 0.021 m, .* belongs to no surface"):
        classify_face(machine, stray, ("hub",))


def test_solids_share_contact_faces(machine):
    import gmsh

    with gmsh_session() as geometry:
        solids = build_solids(machine, geometry)
        assert set(solids.volume_of_part) == {"shaft", "hub"}
        shared = [
            tag for _, tag in gmsh.model.getEntities(2) if len(gmsh.model.getAdjacencies(2, tag)[0]) == 2
        ]
        assert len(shared) == 2


def test_step_holds_every_solid_in_millimetres(machine, tmp_path):
    import gmsh

    balls = BallRowGeometry("B1", 0.080, 0.030, 0.006, 12)
    path = export_step(replace(machine, balls=(balls,)), tmp_path / "machine.step")
    with gmsh_session():
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        volumes = sorted(gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3))
    assert len(volumes) == 2 + 12
    assert volumes[:12] == pytest.approx([math.pi / 6 * 6.0**3] * 12, rel=1e-6)
    shaft = math.pi * ((20**2 - 10**2) * 70 + (24**2 - 20**2) * 8)
    assert volumes[12] == pytest.approx(shaft, rel=1e-6)


def test_step_needs_its_suffix(machine, tmp_path):
    with pytest.raises(GeometryError, match=r'suffix ".stl". Allowed: .step, .stp.'):
        export_step(machine, tmp_path / "machine.stl")
