"""Meshes on disk by the hash of what made them."""

from __future__ import annotations

import hashlib
import json
import zipfile
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType

import numpy as np

from spindle_fem.cache import DAMAGED, cache_directory, keep_entry, source_digest
from spindle_fem.errors import MeshTagError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.meshing.sizes import MeshSizes
from spindle_fem.machine.meshing.tagged_mesh import Joint, TaggedMesh
from spindle_fem.machine.meshing.tags import freeze

FORMAT = "spindle-fem/mesh/1"


def mesh_digest(assembly: AssemblyGeometry, sizes: MeshSizes) -> str:
    """Hash of geometry, sizes, and versions and source of the mesher: the identity of a mesh.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    content = {
        "format": FORMAT,
        "source": source_digest("spindle_fem.machine.meshing.build_mesh"),
        "versions": {name: version(name) for name in ("gmsh", "pygmsh", "numpy")},
        "assembly": asdict(assembly),
        "sizes": sizes.key(),
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def cached_mesh(digest: str) -> TaggedMesh | None:
    """The mesh of this digest, or None where there is none or its file is damaged."""
    path = cache_directory() / f"{digest}.npz"
    if not path.is_file():
        return None
    try:
        mesh = load_npz(path)
    except MeshTagError:
        # A damaged file is as good as none: the mesh is made again and replaces it.
        return None
    return mesh if mesh.digest == digest else None


def store_mesh(mesh: TaggedMesh) -> Path:
    """Keep a mesh under its digest; readers never see half a file."""
    path = cache_directory() / f"{mesh.digest}.npz"
    keep_entry(path, lambda stream: _save(mesh, stream, compressed=False))
    return path


def save_npz(mesh: TaggedMesh, path: str | Path) -> Path:
    """Write a mesh as a compressed .npz that :func:`load_npz` reads.

    The file's bytes depend on the mesh alone.
    """
    path = Path(path)
    with path.open("wb") as stream:
        _save(mesh, stream, compressed=True)
    return path


def _save(mesh: TaggedMesh, stream: object, *, compressed: bool) -> None:
    header = {
        "schema": FORMAT,
        "n_corners": mesh.n_corners,
        "part_names": mesh.part_names,
        "part_of_surface": dict(mesh.part_of_surface),
        "cad_area": dict(mesh.cad_area),
        "cad_volume": dict(mesh.cad_volume),
        "rotating": dict(mesh.rotating),
        "min_quality": mesh.min_quality,
        "digest": mesh.digest,
        "notes": mesh.notes,
        "surfaces": list(mesh.surfaces),
        "joints": list(mesh.joints),
    }
    small = np.int32
    arrays = {
        "header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
        "points": mesh.points,
        "tetrahedra": mesh.tetrahedra.astype(small),
        "part_of_element": mesh.part_of_element,
    }
    for index, nodes in enumerate(mesh.surfaces.values()):
        arrays[f"surface_{index}"] = nodes.astype(small)
    for index, joint in enumerate(mesh.joints.values()):
        arrays[f"joint_{index}_a"] = joint.facets_a.astype(small)
        arrays[f"joint_{index}_b"] = joint.facets_b.astype(small)
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, array in arrays.items():
            # A fixed date: the same mesh gives the same bytes.
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = method
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)


def load_npz(path: str | Path) -> TaggedMesh:
    """Read a mesh written by this package.

    Raises
    ------
    MeshTagError
        The file is damaged or of another version.
    """
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as archive:
            header = json.loads(archive["header"].tobytes().decode())
            if header.get("schema") != FORMAT:
                raise MeshTagError(
                    str(path), f'schema is "{header.get("schema")}".', f'Allowed: "{FORMAT}"; mesh again.'
                )
            wide = np.int64
            mesh = TaggedMesh(
                points=archive["points"],
                n_corners=header["n_corners"],
                tetrahedra=archive["tetrahedra"].astype(wide),
                part_names=tuple(header["part_names"]),
                part_of_element=archive["part_of_element"],
                surfaces=MappingProxyType(
                    {
                        name: archive[f"surface_{index}"].astype(wide)
                        for index, name in enumerate(header["surfaces"])
                    }
                ),
                joints=MappingProxyType(
                    {
                        name: Joint(
                            name,
                            archive[f"joint_{index}_a"].astype(wide),
                            archive[f"joint_{index}_b"].astype(wide),
                        )
                        for index, name in enumerate(header["joints"])
                    }
                ),
                part_of_surface=MappingProxyType(header["part_of_surface"]),
                cad_area=MappingProxyType(header["cad_area"]),
                cad_volume=MappingProxyType(header["cad_volume"]),
                rotating=MappingProxyType(header["rotating"]),
                min_quality=header["min_quality"],
                digest=header["digest"],
                notes=tuple(header["notes"]),
            )
    except (*DAMAGED, AttributeError) as error:
        raise MeshTagError(str(path), f"is no mesh of this package ({error}).", "Mesh again.") from error
    freeze(mesh)
    return mesh


def file_checksum(path: Path) -> str:
    """SHA-256 of a file, 64 hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
