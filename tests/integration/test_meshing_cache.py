"""Meshes on disk: digests, damaged files, checksums, files for other programs."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace

import meshio
import numpy as np
import pytest

from spindle_fem.cache import CACHE_VARIABLE, _module_file, _package_digest, cache_directory, source_digest
from spindle_fem.errors import BadInputError, MeshTagError
from spindle_fem.machine.geometry.assembly import assemble
from spindle_fem.machine.geometry.part_shapes import AnnularSegment, PartGeometry
from spindle_fem.machine.meshing.mesh_cache import (
    cached_mesh,
    load_npz,
    mesh_digest,
    save_npz,
    store_mesh,
)
from spindle_fem.machine.meshing.mesh_files import load_named_mesh, named_mesh_folder, write_mesh
from spindle_fem.machine.meshing.sizes import build_sizes


@pytest.fixture(scope="module")
def tiny():
    return load_named_mesh("tiny_spindle")


def ring(outer=0.06):
    return assemble([PartGeometry("ring", (AnnularSegment(0.0, 0.02, 0.05, outer),))])


def same(one, two):
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.tetrahedra, two.tetrahedra)
    assert np.array_equal(one.part_of_element, two.part_of_element)
    assert list(one.surfaces) == list(two.surfaces)
    assert all(np.array_equal(one.surfaces[name], two.surfaces[name]) for name in one.surfaces)
    assert list(one.joints) == list(two.joints)
    for name, joint in one.joints.items():
        assert np.array_equal(joint.facets_a, two.joints[name].facets_a)
        assert np.array_equal(joint.facets_b, two.joints[name].facets_b)
    for key in ("n_corners", "part_names", "min_quality", "digest", "notes"):
        assert getattr(one, key) == getattr(two, key)
    for key in ("cad_area", "cad_volume", "rotating", "part_of_surface"):
        assert dict(getattr(one, key)) == dict(getattr(two, key))


def test_digest_follows_geometry_and_sizes():
    reference = mesh_digest(ring(), build_sizes(ring(), "normal"))
    assert reference == mesh_digest(ring(), build_sizes(ring(), "normal"))
    assert len(reference) == 64
    assert reference != mesh_digest(ring(0.061), build_sizes(ring(), "normal"))
    assert reference != mesh_digest(ring(), build_sizes(ring(), "coarse"))


def test_a_key_follows_the_source_and_what_it_imports(tmp_path, monkeypatch):
    package = tmp_path / "lathe"
    (package / "mesher").mkdir(parents=True)
    (package / "mesher" / "__init__.py").write_text("")
    (package / "mesher" / "one.py").write_text("def f():\n    from lathe.mesher import two\n")
    (package / "mesher" / "two.py").write_text("SIZE = 1\n")
    (package / "unused.py").write_text("SIZE = 1\n")
    monkeypatch.setattr("spindle_fem.cache._PACKAGE", package)
    monkeypatch.setattr("spindle_fem.cache._IMPORT", re.compile(r"^\s*from (lathe[\w.]*) import (.*)", re.M))

    def digest(name):
        _package_digest.cache_clear()
        _module_file.cache_clear()
        return source_digest(name)

    first = digest("lathe.mesher.one")
    assert digest("lathe.mesher.one") == first
    (package / "unused.py").write_text("SIZE = 2\n")
    assert digest("lathe.mesher.one") == first
    (package / "mesher" / "two.py").write_text("SIZE = 2\n")
    assert digest("lathe.mesher.one") != first
    with pytest.raises(FileNotFoundError):
        digest("lathe.missing")
    monkeypatch.undo()
    _package_digest.cache_clear()
    _module_file.cache_clear()


def test_round_trip_keeps_everything(tiny, tmp_path):
    same(tiny, load_npz(save_npz(tiny, tmp_path / "mesh.npz")))


def test_same_mesh_same_bytes(tiny, tmp_path):
    one, two = save_npz(tiny, tmp_path / "a.npz"), save_npz(tiny, tmp_path / "b.npz")
    assert one.read_bytes() == two.read_bytes()


def test_arrays_are_read_only(tiny):
    with pytest.raises(ValueError, match="read-only"):
        tiny.points[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        tiny.surfaces["housing.outside"][0, 0] = 1


def test_cache_finds_only_its_digest(tiny, tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    assert cache_directory() == tmp_path / "cache"
    assert cached_mesh(tiny.digest) is None
    path = store_mesh(tiny)
    same(tiny, cached_mesh(tiny.digest))
    assert [file.name for file in path.parent.iterdir()] == [f"{tiny.digest}.npz"]
    store_mesh(replace(tiny, digest="other"))
    shutil.move(path.parent / "other.npz", path)
    assert cached_mesh(tiny.digest) is None


@pytest.mark.parametrize("content", [b"", b"not a mesh", b"PK\x03\x04 broken"])
def test_damaged_cache_file_is_no_mesh(tmp_path, monkeypatch, content):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    (tmp_path / "abc.npz").write_bytes(content)
    assert cached_mesh("abc") is None
    with pytest.raises(MeshTagError, match="is no mesh of this package"):
        load_npz(tmp_path / "abc.npz")


def test_truncated_file(tiny, tmp_path):
    path = save_npz(tiny, tmp_path / "mesh.npz")
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(MeshTagError, match="is no mesh of this package"):
        load_npz(path)


def test_named_meshes_are_small():
    files = list(named_mesh_folder().glob("*.npz"))
    assert {file.stem for file in files} == {"tiny_spindle", "one_bearing"}
    assert all(file.stat().st_size < 1_000_000 for file in files)
    assert "housing.channel_wall" not in load_named_mesh("one_bearing").surfaces


def test_unknown_named_mesh():
    with pytest.raises(BadInputError, match=r'has no mesh "tiny_spindel". Did you mean "tiny_spindle"'):
        load_named_mesh("tiny_spindel")


def test_checksum_is_verified(tmp_path):
    for name in ("SHA256SUMS", "tiny_spindle.npz"):
        shutil.copy(named_mesh_folder() / name, tmp_path)
    load_named_mesh("tiny_spindle", tmp_path)
    with (tmp_path / "tiny_spindle.npz").open("ab") as stream:
        stream.write(b"x")
    with pytest.raises(MeshTagError, match="differs from its checksum"):
        load_named_mesh("tiny_spindle", tmp_path)


def test_msh_keeps_names(tiny, tmp_path):
    content = meshio.read(write_mesh(tiny, tmp_path / "mesh.msh"))
    names = {name: tuple(int(value) for value in pair) for name, pair in content.field_data.items()}
    volumes = {name for name, (_, dimension) in names.items() if dimension == 3}
    assert volumes == set(tiny.part_names)
    tag, _ = names["housing.channel_wall"]
    triangles = content.cells_dict["triangle6"]
    physical = content.cell_data_dict["gmsh:physical"]["triangle6"]
    assert np.count_nonzero(physical == tag) == len(tiny.surfaces["housing.channel_wall"])
    assert len(triangles) == sum(len(f) for f in tiny.surfaces.values()) + 2 * sum(
        len(joint.facets_a) for joint in tiny.joints.values()
    )
    assert content.points == pytest.approx(tiny.points)
    assert np.array_equal(content.cells_dict["tetra10"], tiny.tetrahedra)


def test_vtu_keeps_names(tiny, tmp_path):
    import pyvista

    content = pyvista.read(write_mesh(tiny, tmp_path / "mesh.vtu"))
    parts = [str(name) for name in content.field_data["part_names"]]
    faces = [str(name) for name in content.field_data["face_names"]]
    assert parts == list(tiny.part_names)
    wall = content.cell_data["face"] == faces.index("housing.channel_wall")
    assert np.count_nonzero(wall) == len(tiny.surfaces["housing.channel_wall"])
    shaft = content.cell_data["part"] == parts.index("shaft")
    assert np.count_nonzero(shaft) == np.count_nonzero(tiny.part_of_element == tiny.part_names.index("shaft"))


def test_other_suffixes_are_refused(tiny, tmp_path):
    with pytest.raises(BadInputError, match=r'suffix ".stl". Allowed: .msh, .vtu.'):
        write_mesh(tiny, tmp_path / "mesh.stl")
