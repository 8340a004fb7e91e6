"""Meshes for other programs (.msh, .vtu, names kept) and the small meshes that ship for tests."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from spindle_fem.errors import BadInputError, MeshTagError, did_you_mean
from spindle_fem.machine.meshing.mesh_cache import file_checksum, load_npz
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh

SUFFIXES = (".msh", ".vtu")
CHECKSUMS = "SHA256SUMS"


def write_mesh(mesh: TaggedMesh, path: str | Path) -> Path:
    """Write a mesh with the names of its parts, surfaces and joints.

    Parameters
    ----------
    path : str or Path
        ``.msh``: Gmsh 2.2, physical groups by name, both sides of a joint as
        ``name:a`` and ``name:b``. ``.vtu``: cell arrays ``part`` and ``face``
        index the string arrays ``part_names`` and ``face_names`` (-1: none).

    Raises
    ------
    BadInputError
        Another suffix.
    """
    import meshio

    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise BadInputError(str(path), f'suffix "{path.suffix}".', f"Allowed: {', '.join(SUFFIXES)}.")
    faces = dict(mesh.surfaces)
    for name, joint in mesh.joints.items():
        faces[f"{name}:a"], faces[f"{name}:b"] = joint.facets_a, joint.facets_b
    face_names = tuple(faces)
    triangles = np.concatenate([faces[name] for name in face_names])
    face_of_triangle = np.repeat(np.arange(len(face_names)), [len(faces[name]) for name in face_names])
    cells = [("tetra10", mesh.tetrahedra), ("triangle6", triangles)]
    if path.suffix == ".msh":
        tags = [mesh.part_of_element.astype(np.int32) + 1, face_of_triangle.astype(np.int32) + 1]
        field_data = {name: np.array([index, 3]) for index, name in enumerate(mesh.part_names, start=1)}
        field_data |= {name: np.array([index, 2]) for index, name in enumerate(face_names, start=1)}
        content = meshio.Mesh(
            mesh.points,
            cells,
            cell_data={"gmsh:physical": tags, "gmsh:geometrical": [tag.copy() for tag in tags]},
            field_data=field_data,
        )
        meshio.write(path, content, file_format="gmsh22", binary=True)
        return path
    content = meshio.Mesh(
        mesh.points,
        cells,
        cell_data={
            "part": [mesh.part_of_element.astype(np.int32), np.full(len(triangles), -1, dtype=np.int32)],
            "face": [np.full(mesh.n_elements, -1, dtype=np.int32), face_of_triangle.astype(np.int32)],
        },
    )
    meshio.write(path, content, file_format="vtu")
    _add_names(path, {"part_names": mesh.part_names, "face_names": face_names})
    return path


def _add_names(path: Path, names: dict[str, Iterable[str]]) -> None:
    """String arrays in the field data of a .vtu, which meshio cannot write."""
    tree = ElementTree.parse(path)
    field_data = ElementTree.Element("FieldData")
    for key, values in names.items():
        values = tuple(values)
        array = ElementTree.SubElement(
            field_data,
            "DataArray",
            {"type": "String", "Name": key, "NumberOfTuples": str(len(values)), "format": "ascii"},
        )
        array.text = " ".join(str(code) for value in values for code in (*value.encode(), 0))
    tree.getroot().find("UnstructuredGrid").insert(0, field_data)
    tree.write(path, xml_declaration=True, encoding="utf-8")


def named_mesh_folder() -> Path:
    """Folder of the small meshes in a checkout."""
    return Path(__file__).resolve().parents[3] / "meshes"


def load_named_mesh(name: str, folder: str | Path | None = None) -> TaggedMesh:
    """A small mesh that ships with the repository, its checksum verified.

    Parameters
    ----------
    name : str
        For example ``"tiny_spindle"``.
    folder : str or Path, optional
        Where ``SHA256SUMS`` lies; ``meshes/`` of the checkout where none is given.

    Raises
    ------
    BadInputError
        No such mesh.
    MeshTagError
        The file differs from its checksum.
    """
    folder = Path(folder) if folder is not None else named_mesh_folder()
    listing = folder / CHECKSUMS
    lines = listing.read_text(encoding="utf-8").split("\n") if listing.is_file() else []
    checksums = {Path(file).stem: digest for digest, file in (line.split() for line in lines if line.strip())}
    if name not in checksums:
        raise BadInputError(str(folder), f'has no mesh "{name}".', did_you_mean(name, sorted(checksums)))
    path = folder / f"{name}.npz"
    if file_checksum(path) != checksums[name]:
        raise MeshTagError(str(path), "differs from its checksum.", f"Restore it, or correct {listing}.")
    return load_npz(path)
