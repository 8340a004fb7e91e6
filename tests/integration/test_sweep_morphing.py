"""Moved meshes against new ones: shape, areas, volumes, temperatures; rows of studies that use them."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.errors import FaultsError, MeshQualityError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.classify_faces import port_coordinates
from spindle_fem.machine.meshing.quality import AREA_TOLERANCE, area_errors, gmsh_quality, volume_errors
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.solvers.prepared_machine import machine_on_mesh
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.sweep import evaluate_design as evaluation
from spindle_fem.studies.sweep import morphing
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.evaluate_design import Question, TaskBuilder
from spindle_fem.studies.sweep.morphing import move_mesh
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.studies.sweep.run_tasks import run_tasks

MACHINE = "small_two_start"
COARSE = ("mesh.preset=coarse", "mesh.order=1", "heat.model=palmgren")
# Two starts with ports, left-handed: all of the map at once.
CHANGE = ("channel.depth=5.2 mm", "channel.width=7.3 mm", "channel.pitch=24.4 mm")


def meshed(*overrides):
    spec = load_machine(MACHINE, [*COARSE, *overrides])
    assembly = build_assembly(spec)
    return spec, assembly, build_mesh(assembly, spec.mesh.preset)


@pytest.fixture(scope="module")
def source():
    return meshed()


@pytest.fixture(scope="module")
def fresh():
    return meshed(*CHANGE)


@pytest.fixture(scope="module")
def moved(source, fresh):
    return move_mesh(source[2], source[1], fresh[1])


def test_a_machine_onto_itself_keeps_its_mesh(source):
    _, assembly, mesh = source
    assert move_mesh(mesh, assembly, assembly) is mesh


def test_middles_are_put_where_the_mesher_put_them(source):
    """A change of a billionth of a millimetre leaves every node of every face where it was."""
    _, assembly, mesh = source
    channel = assembly.channel
    definition = replace(channel.definition, depth=channel.definition.depth + 1e-12)
    nudged = replace(assembly, channel=replace(channel, definition=definition))
    found = move_mesh(mesh, assembly, nudged)
    on_faces = np.unique(np.concatenate([facets.ravel() for facets in mesh.surfaces.values()]))
    assert np.abs(found.points - mesh.points)[on_faces].max() < 1e-10


def test_areas_and_volumes_are_those_of_the_new_solid(moved, fresh):
    """The exact change of the channel is what the CAD kernel measures, and the moved mesh has it."""
    solid = fresh[2]
    assert dict(moved.cad_area) == pytest.approx(dict(solid.cad_area), rel=3e-5)
    assert dict(moved.cad_volume) == pytest.approx(dict(solid.cad_volume), rel=1e-6)
    against_cad = replace(moved, cad_area=solid.cad_area, cad_volume=solid.cad_volume)
    assert max(map(abs, area_errors(against_cad).values())) < AREA_TOLERANCE
    assert max(map(abs, volume_errors(against_cad).values())) < 1e-4


def test_no_element_is_inverted_or_flat(moved):
    assert gmsh_quality(moved.points, moved.tetrahedra).min() == pytest.approx(moved.min_quality, abs=1e-6)
    assert moved.min_quality > 0.15


def test_nodes_lie_on_the_walls_and_ports_of_the_new_channel(moved, fresh):
    """Corners and middles alike, within what the CAD kernel leaves of a swept helix."""
    channel = fresh[1].channel
    definition = channel.definition
    nodes = np.unique(moved.surfaces["housing.channel_wall"])
    x, y, z = moved.points[nodes].T
    radius, angle = np.hypot(x, y), np.arctan2(-x, y)
    on_cylinder = np.minimum(abs(radius - definition.inner_radius), abs(radius - channel.outer_radius))
    turn = np.sign(channel.angle_span) * angle / (2 * np.pi) * definition.starts
    height = (z - definition.z_start) * definition.starts / definition.pitch - turn
    clearance = np.abs(height - np.round(height)) * definition.pitch / definition.starts
    assert np.minimum(on_cylinder, abs(clearance - 0.5 * definition.width)).max() < 5e-6
    nodes = np.unique(moved.surfaces["housing.channel_ports"])
    points = moved.points[nodes]
    distance = np.full(len(points), np.inf)
    for port in channel.ports:
        along, across, axial = port_coordinates(port, points)
        flats = np.minimum(abs(along - port.start_radius), abs(across))  # start, and end of the channel
        drilled = np.minimum(abs(np.hypot(across, axial) - port.radius), flats)
        distance = np.minimum(distance, np.where(along > 0.0, drilled, np.inf))
    assert distance.max() < 5e-6


def test_the_other_surfaces_and_joints_are_as_before(moved, source):
    mesh = source[2]
    before, after = area_errors(mesh), area_errors(moved)
    for name in mesh.cad_area:
        if "channel" not in name and name != "housing.outside":
            assert after[name] == pytest.approx(before[name], abs=1e-7)
    for joint in moved.joints.values():
        assert (moved.points[joint.facets_a] == moved.points[joint.facets_b]).all()
    assert not moved.points.flags.writeable


def temperatures(spec, mesh):
    result = solve_prepared(machine_on_mesh(spec, mesh, build_operators(mesh, spec.mesh.order)))
    rings = [
        value
        for bearing in result.bearings.values()
        for value in (bearing.temperature_inner, bearing.temperature_outer)
    ]
    return np.array([result.temperature_maximum, *result.probes.values(), *rings])


def test_temperatures_differ_by_less_than_the_mesh_errs(moved, fresh):
    """The error of linear temperatures on the new mesh: what quadratic ones on it change."""
    spec, _, mesh = fresh
    new, other = temperatures(spec, mesh), temperatures(spec, moved)
    better = temperatures(load_machine(MACHINE, [*COARSE, *CHANGE, "mesh.order=2"]), mesh)
    assert 0.0 < np.abs(other - new).max() < np.abs(better - new).max()


def test_a_change_too_large_is_refused(source):
    """A pitch of 28 mm in place of 24 mm over two turns carries the end 8 mm away."""
    _, assembly, mesh = source
    target = build_assembly(load_machine(MACHINE, [*COARSE, "channel.pitch=28 mm"]))
    with pytest.raises(MeshQualityError, match="elements: the worst minSICN"):
        move_mesh(mesh, assembly, target)


STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "channel.depth"
values = [{depths}]
[study]
{mesh}
outputs = ["temperature.max_degC", "mesh.nodes", "mesh.min_quality"]
"""


def study(folder, depths, mesh="moved"):
    path = folder / "study.toml"
    values = ", ".join(f'"{depth} mm"' for depth in depths)
    path.write_text(STUDY.format(depths=values, mesh=f'mesh = "{mesh}"'), encoding="utf-8")
    return prepare_study(MACHINE, path, COARSE)


def solved(prepared, jobs=1):
    """Rows by design."""
    rows = []
    run_tasks(prepared.tasks, prepared.question, rows.append, plan=prepared.tasks, jobs=jobs)
    return sorted(rows, key=lambda row: row["design"])


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Depths around the lattice points 5 mm and 7.5 mm, in this process."""
    return solved(study(tmp_path_factory.mktemp("moved"), (5.4, 5, 6.9)))


def test_rows_tell_which_mesh_they_were_solved_on(rows):
    assert [row["status"] for row in rows] == ["ok"] * 3
    assert [row["mesh"] for row in rows] == ["moved", "new", "moved"]
    nodes = [row["mesh.nodes"] for row in rows]
    assert nodes[0] == nodes[1] != nodes[2]  # those of their source
    assert len({row["geometry"] for row in rows}) == 3


@pytest.mark.slow
def test_rows_depend_on_neither_workers_nor_company(rows, tmp_path):
    """In two processes; and, as a study that goes on does it, the last of them after another one."""
    assert solved(study(tmp_path, (5.4, 5, 6.9)), jobs=2) == rows
    assert solved(study(tmp_path, (7.2, 5.4)))[1] == rows[0] | {"design": 2}


def task_of(depth, mesh):
    question = Question(("mesh.nodes",), False, "full", mesh)
    content = read_definition(find_machine(MACHINE))
    return TaskBuilder(content, question).task(Design(1, (*COARSE, f"channel.depth={depth} mm"), {}))


def test_a_moved_mesh_that_fails_its_checks_is_made_anew(monkeypatch):
    """On a lattice of 9 mm of pitch 24 mm would come from 27 mm; the mesh is that of a new design instead."""
    monkeypatch.setattr(morphing, "LATTICE", {"depth": 0.5e-3, "width": 0.5e-3, "pitch": 9e-3})
    evaluation._LAST.clear()
    task = task_of("6", "moved")
    assert task.source
    mesh, _ = evaluation.shared_operators(task)
    assert evaluation.how_meshed(task, mesh.digest) == "new"
    evaluation._LAST.clear()
    plain, _ = evaluation.shared_operators(task_of("6", "new"))
    assert mesh.digest == plain.digest
    assert (mesh.points == plain.points).all()
    evaluation._LAST.clear()


def test_the_way_of_meshing_is_part_of_what_a_row_is():
    new, moved = task_of("5.4", "new"), task_of("5.4", "moved")
    assert new.key != moved.key
    assert (new.source, bool(moved.source)) == ("", True)
    assert task_of("5", "moved").geometry == task_of("5", "new").geometry


def test_another_word_for_the_mesh_is_refused(tmp_path):
    with pytest.raises(FaultsError, match=r"study.mesh.*\"stretched\".*moved, new"):
        study(tmp_path, (5, 6), mesh="stretched")
