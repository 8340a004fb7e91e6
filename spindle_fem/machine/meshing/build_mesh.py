"""A checked, tagged, curved mesh of an assembly, from the cache where it is known."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

from spindle_fem.errors import MeshQualityError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.meshing.generate import LADDER, Attempt, mesh_once
from spindle_fem.machine.meshing.mesh_cache import cached_mesh, mesh_digest, store_mesh
from spindle_fem.machine.meshing.quality import MINIMUM_QUALITY, require_quality
from spindle_fem.machine.meshing.sizes import MeshSizes, Preset, build_sizes
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.meshing.tags import tag_mesh

LOGGER = logging.getLogger(__name__)

# Below the aim, a mesh whose worst element is better than this is kept, with a
# note, when no settings do better; anything worse is an error.
TOLERATED_QUALITY = 0.05
# Elements that are fit for use: finer settings, which take many times as long, are not
# tried for the aim's sake.
FIT_QUALITY = 0.10
# Finer settings that would make more elements than this are not tried either.
MOST_ELEMENTS = 1_500_000


def build_mesh(
    assembly: AssemblyGeometry,
    preset: Preset = "normal",
    *,
    size_factor: float = 1.0,
    sizes: Mapping[str, float] | None = None,
    use_cache: bool = True,
    threads: int = 1,
) -> TaggedMesh:
    """Mesh an assembly.

    Parameters
    ----------
    preset : {"coarse", "normal", "fine"}
    size_factor : float
        On every size of the preset; 0.5 makes about eight times the elements.
    sizes : mapping of str to float, optional, [m]
        Sizes of single parts, and ``"channel"``, in place of the preset's.
    use_cache : bool
        Read a mesh made before from the user's cache, and keep this one there.
    threads : int
        Of the mesher. One gives the same mesh every time; more give one of the
        same quality but never quite the same, and are faster only on idle cores.

    Raises
    ------
    MeshQualityError
        No settings of the ladder gave areas and volumes within 0.1 % of the
        solid model and elements that are fit for use.
    """
    chosen = build_sizes(assembly, preset, size_factor=size_factor, overrides=sizes)
    digest = mesh_digest(assembly, chosen)
    if use_cache:
        mesh = cached_mesh(digest)
        if mesh is not None:
            return mesh
    mesh = generate_mesh(assembly, chosen, threads=threads, digest=digest)
    if use_cache:
        store_mesh(mesh)
    return mesh


def generate_mesh(
    assembly: AssemblyGeometry,
    sizes: MeshSizes,
    *,
    ladder: tuple[Attempt, ...] = LADDER,
    threads: int = 1,
    digest: str = "",
) -> TaggedMesh:
    """Mesh with the first settings of ``ladder`` that pass every check.

    The aim is minSICN above 0.15. What had to be tried beyond the first, or a
    worst element below the aim, is in the mesh's ``notes`` and logged. Finer settings than asked for are
    tried only while no mesh has a worst element above ``FIT_QUALITY``, and while none would have more than
    ``MOST_ELEMENTS``.

    Raises
    ------
    MeshQualityError
        With the reason of each attempt.
    """
    failures: list[str] = []
    best: TaggedMesh | None = None
    made = 0
    for attempt in ladder:
        if attempt.size_factor < 1.0:
            if best is not None and best.min_quality > FIT_QUALITY:
                break
            expected = made / attempt.size_factor**3
            if expected > MOST_ELEMENTS:
                failures.append(f"{attempt.describe()}: would make some {expected:.2g} elements")
                continue
        try:
            linear = mesh_once(assembly, sizes, attempt, threads)
            if attempt.size_factor == 1.0:
                made = len(linear.tetrahedra)
            mesh = tag_mesh(assembly, linear, digest)
            require_quality(mesh, minimum=TOLERATED_QUALITY)
        except MeshQualityError as error:
            failures.append(f"{attempt.describe()}: {error.what}")
            LOGGER.info("meshing attempt failed: %s", failures[-1])
            continue
        if best is None or mesh.min_quality > best.min_quality:
            best = replace(mesh, notes=(*mesh.notes, *_attempt_notes(attempt, failures)))
        if mesh.min_quality > MINIMUM_QUALITY:
            return best
        failures.append(f"{attempt.describe()}: worst minSICN {mesh.min_quality:.3f}")
        LOGGER.info("meshing attempt below the aim: %s", failures[-1])
    if best is not None:
        note = f"worst element has minSICN {best.min_quality:.3f}, below the {MINIMUM_QUALITY:g} aimed at"
        LOGGER.warning(note)
        return replace(best, notes=(*best.notes, note))
    raise MeshQualityError(
        "mesh",
        "no settings gave a sound mesh: " + "; ".join(failures) + ".",
        "Change mesh.preset, mesh.size_factor or mesh.size.",
    )


def _attempt_notes(attempt: Attempt, failures: list[str]) -> tuple[str, ...]:
    return (f"meshed with {attempt.describe()} after {'; '.join(failures)}",) if failures else ()
