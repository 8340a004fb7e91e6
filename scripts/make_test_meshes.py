"""Make the small meshes in meshes/ that tests load, and their checksums.

Run from the repository: ``python scripts/make_test_meshes.py``.
"""

from __future__ import annotations

from pathlib import Path

from spindle_fem.machine.geometry.assembly import AssemblyGeometry, assemble
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition
from spindle_fem.machine.geometry.part_shapes import AnnularSegment, FaceBox, PartGeometry, SurfaceDefinition
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.mesh_cache import file_checksum, save_npz
from spindle_fem.machine.meshing.mesh_files import CHECKSUMS, named_mesh_folder

MILLIMETRE = 1.0e-3


def small_spindle(channel: ChannelDefinition | None) -> AssemblyGeometry:
    """A shaft of 80 mm in one bearing, in a housing with or without a channel."""

    def ring(z_start: float, z_end: float, inner: float, outer: float) -> AnnularSegment:
        return AnnularSegment(*(value * MILLIMETRE for value in (z_start, z_end, inner, outer)))

    parts = [
        PartGeometry("shaft", (ring(0, 80, 10, 20),), rotating=True),
        PartGeometry("B1.inner_ring", (ring(20, 34, 20, 24),), rotating=True),
        PartGeometry("B1.outer_ring", (ring(20, 34, 27, 31),)),
        PartGeometry("housing", (ring(10, 70, 31, 55), ring(34, 40, 28, 31))),
    ]
    surfaces = [
        SurfaceDefinition("B1.inner_raceway", "B1.inner_ring", (FaceBox("outward"),)),
        SurfaceDefinition("B1.outer_raceway", "B1.outer_ring", (FaceBox("inward"),)),
        SurfaceDefinition(
            "housing.outside",
            "housing",
            (FaceBox("outward"), FaceBox("front"), FaceBox("rear", z=(0.07, 0.07))),
        ),
        SurfaceDefinition("shaft.ends", "shaft", (FaceBox("front"), FaceBox("rear"))),
    ]
    return assemble(parts, surfaces, channel)


def test_meshes() -> dict[str, AssemblyGeometry]:
    """Assemblies by the name of their mesh."""
    channel = ChannelDefinition(
        part="housing", inner_radius=0.038, depth=0.006, width=0.006, pitch=0.012, turns=2.0, z_start=0.024
    )
    return {"tiny_spindle": small_spindle(channel), "one_bearing": small_spindle(None)}


def main() -> None:
    """Write meshes/*.npz and meshes/SHA256SUMS."""
    folder: Path = named_mesh_folder()
    folder.mkdir(exist_ok=True)
    lines = []
    for name, assembly in test_meshes().items():
        mesh = build_mesh(assembly, "coarse", use_cache=False, threads=1)
        path = save_npz(mesh, folder / f"{name}.npz")
        lines.append(f"{file_checksum(path)}  {path.name}")
        print(f"{name}: {len(mesh.points)} nodes, {mesh.n_elements} elements, minSICN {mesh.min_quality:.3f}")
    (folder / CHECKSUMS).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
