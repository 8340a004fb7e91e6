"""Meshes of designs whose channel is near that of a mesh that exists: moved instead of made.

A design's mesh is moved from that of the nearest point of a fixed lattice of
depths, widths and pitches. Which one that is depends on the design alone, so
a design has the same mesh in every study, order and process.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from math import ceil, floor
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from spindle_fem.cache import source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpindleFemError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, build_assembly
from spindle_fem.machine.geometry.channel_geometry import PortGeometry
from spindle_fem.machine.meshing.classify_faces import FaceClass, port_coordinates
from spindle_fem.machine.meshing.curving import curved_middles, edge_key
from spindle_fem.machine.meshing.generate import LinearMesh, MeshedFace
from spindle_fem.machine.meshing.improve_quality import improve_elements
from spindle_fem.machine.meshing.quality import (
    TETRAHEDRON_EDGES,
    gmsh_quality,
    linear_quality,
    require_quality,
    sampled_quality,
)
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.meshing.tags import freeze
from spindle_fem.studies.sweep.channel_map import MOVABLE, ChannelMap, build_map
from spindle_fem.studies.sweep.channel_measures import channel_measures

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Steps of the lattice, m: a mesh is moved by half of one at most (measured in docs/design_studies.md).
# The pitch moves the channel's end once a turn, so its step is divided where there are many.
LATTICE: Mapping[str, float] = MappingProxyType({"depth": 2.5e-3, "width": 2.0e-3, "pitch": 1.0e-3})
_TURNS_OF_WHOLE_STEP = 5
_ON_FACE = 5.0e-6
# Elements whose sampled quality is below this are measured over the whole element.
_MEASURE_BELOW = 0.35
_STRAIGHT = 1.0e-9


def lattice_machine(spec: MachineSpec) -> MachineSpec | None:
    """The machine whose mesh is moved to a design, None where the design lies on the lattice itself.

    Returns
    -------
    MachineSpec or None
        May be one that no geometry can be made of.
    """
    if spec.channel is None:
        return None
    steps = dict(LATTICE)
    steps["pitch"] /= max(1, ceil(spec.channel.turns / _TURNS_OF_WHOLE_STEP - 1.0e-9))
    nearest = {
        # Halves go up; values as texts give them must not fall on either side by their last digit.
        name: round(step * max(1, floor(round(getattr(spec.channel, name) / step + 0.5, 6))), 9)
        for name, step in steps.items()
    }
    if all(abs(getattr(spec.channel, name) - value) < 1.0e-9 for name, value in nearest.items()):
        return None
    return spec.model_copy(update={"channel": spec.channel.model_copy(update=nearest)})


def lattice_assembly(spec: MachineSpec) -> tuple[MachineSpec, AssemblyGeometry] | None:
    """Machine and geometry that the mesh of a design is moved from; None where it is to be made anew."""
    source = lattice_machine(spec)
    if source is None:
        return None
    try:
        assembly = build_assembly(source)
        build_map(assembly, build_assembly(spec))
    except SpindleFemError:
        return None  # no such machine, or no way from it
    return source, assembly


def moved_digest(source_digest_: str, target: AssemblyGeometry) -> str:
    """Identity of a moved mesh.

    Parameters
    ----------
    source_digest_ : str
        Of the mesh that is moved.
    target : AssemblyGeometry
        To which.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    content = [source_digest_, source_digest(__name__), asdict(target)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def move_mesh(mesh: TaggedMesh, source: AssemblyGeometry, target: AssemblyGeometry) -> TaggedMesh:
    """The mesh of one machine moved to another one with a channel of other depth, width or pitch.

    Corners go where :class:`ChannelMap` takes them; middles of edges on curved
    faces are put on the new faces, others keep their place beside the middle
    of their edge. Then the worst elements are relaxed as in a new mesh.

    Parameters
    ----------
    mesh : TaggedMesh
        Of ``source``.

    Returns
    -------
    TaggedMesh
        With the areas and the volume of the target: those of the source's
        solid model and the exact change of the channel and its ports.

    Raises
    ------
    GeometryError
        The machines differ in something else, or a port has no room to move.
    MeshQualityError
        Areas or volumes are off by more than 0.1 %, or the worst minSICN is
        not above 0.15.
    """
    channel_map = build_map(source, target)
    if source.channel == target.channel:
        return mesh
    n_corners = mesh.n_corners
    corners = mesh.points[:n_corners]
    new_corners = channel_map(corners)
    has_moved = np.any(new_corners != corners, axis=1)
    ends = _edge_ends(mesh)
    touched = has_moved[ends].any(axis=1)
    middles = mesh.points[n_corners:].copy()
    first, second = ends[touched].T
    chord = 0.5 * (corners[first] + corners[second])
    middles[touched] += 0.5 * (new_corners[first] + new_corners[second]) - chord
    keys, curved = curved_middles(
        LinearMesh(
            new_corners,
            mesh.tetrahedra[:, :4],
            mesh.part_of_element,
            _curved_faces(mesh, channel_map, has_moved),
            np.empty((0, 2), dtype=np.int64),
            np.empty(0),
        ),
        target.channel.ports,
    )
    own = edge_key(ends[:, 0], ends[:, 1], n_corners)
    order = np.argsort(own)
    place = order[np.searchsorted(own, keys, sorter=order)]
    on_moved = touched[place]
    middles[place[on_moved]] = curved[on_moved]
    points = np.concatenate([new_corners, middles])
    points, worst = _relaxed(points, mesh, ends)
    area, volume = _target_measures(mesh, channel_map)
    digest = moved_digest(mesh.digest, target)
    kept = (note for note in mesh.notes if note not in source.notes)
    found = replace(
        mesh,
        points=points,
        cad_area=MappingProxyType(area),
        cad_volume=MappingProxyType(volume),
        min_quality=worst,
        digest=digest,
        notes=(*target.notes, *kept, _note(channel_map)),
    )
    freeze(found)
    require_quality(found)
    return found


def _note(channel_map: ChannelMap) -> str:
    before = channel_map.source.definition
    values = ", ".join(f"{name} {getattr(before, name) * 1e3:g} mm" for name in MOVABLE)
    return f"mesh moved from that of a channel of {values}"


def _edge_ends(mesh: TaggedMesh) -> Indices:
    """Both corners of each edge, in the order of the middles, (n_middles, 2)."""
    ends = np.empty((len(mesh.points) - mesh.n_corners, 2), dtype=np.int64)
    for middle, (a, b) in enumerate(TETRAHEDRON_EDGES, start=4):
        ends[mesh.tetrahedra[:, middle] - mesh.n_corners] = mesh.tetrahedra[:, [a, b]]
    return ends


def _curved_faces(
    mesh: TaggedMesh, channel_map: ChannelMap, has_moved: NDArray[np.bool_]
) -> tuple[MeshedFace, ...]:
    """Facets with a moved corner that lie on something curved, by its shape."""
    corners = mesh.points[: mesh.n_corners]
    walls, rest = channel_map.source.surface_names
    facets = dict(mesh.surfaces)
    for name, joint in mesh.joints.items():
        facets |= {f"{name} a": joint.facets_a, f"{name} b": joint.facets_b}
    faces: list[MeshedFace] = []

    def add(triangles: Indices, shape: str, port: int = -1) -> None:
        if len(triangles):
            faces.append(MeshedFace(triangles, (), FaceClass(name, shape, port), 0.0))

    for name, nodes in facets.items():
        triangles = nodes[has_moved[nodes[:, :3]].any(axis=1), :3]
        radius = np.hypot(corners[triangles, 0], corners[triangles, 1])
        on_cylinder = np.ptp(radius, axis=1) < _ON_FACE
        flat = np.ptp(corners[triangles, 2], axis=1) < _STRAIGHT
        if name == rest:
            for index, port in enumerate(channel_map.source.ports):
                add(triangles[_on_port(port, corners[triangles])], "port", index)
            continue
        add(triangles[on_cylinder & ~flat], "cylinder")
        if name == walls:
            add(triangles[~on_cylinder], "helicoid")
    return tuple(faces)


def _on_port(port: PortGeometry, places: Array) -> NDArray[np.bool_]:
    """Mask of the triangles (n, 3, 3) on the cylinder of a port, without its flat start."""
    along, across, axial = port_coordinates(port, places)
    on_cylinder = np.abs(np.hypot(across, axial) - port.radius).max(axis=1) < _ON_FACE
    return on_cylinder & (along.min(axis=1) > 0.0) & (np.ptp(along, axis=1) > _STRAIGHT)


def _relaxed(points: Array, mesh: TaggedMesh, ends: Indices) -> tuple[Array, float]:
    """Points with the worst elements relaxed, and the worst quality as gmsh measures it."""
    elements = mesh.tetrahedra
    bent = points[mesh.n_corners :] - 0.5 * (points[ends[:, 0]] + points[ends[:, 1]])
    is_curved = (np.abs(bent).max(axis=1) > _STRAIGHT)[elements[:, 4:] - mesh.n_corners].any(axis=1)
    quality = np.empty(len(elements))
    quality[~is_curved] = linear_quality(points, elements[~is_curved])
    quality[is_curved] = sampled_quality(points[elements[is_curved]])
    fixed = np.zeros(len(points), dtype=bool)
    for facets in mesh.surfaces.values():
        fixed[facets] = True
    for joint in mesh.joints.values():
        fixed[joint.facets_a] = True
        fixed[joint.facets_b] = True
    points, quality = improve_elements(points, elements, mesh.n_corners, fixed, quality)
    doubtful = quality < max(_MEASURE_BELOW, float(quality.min()) + 0.1)
    measured = gmsh_quality(points, elements[doubtful])
    return points, float(min(quality[~doubtful].min(initial=1.0), measured.min(initial=1.0)))


def _target_measures(mesh: TaggedMesh, channel_map: ChannelMap) -> tuple[dict[str, float], dict[str, float]]:
    """Areas and volumes of the target: the source's with the exact change of the channel."""
    exits = [port.exit_radius for port in channel_map.ports]
    before = channel_measures(channel_map.source, exits)
    after = channel_measures(channel_map.target, exits)
    walls, rest = channel_map.source.surface_names
    area, volume = dict(mesh.cad_area), dict(mesh.cad_volume)
    area[walls] += after.wall - before.wall
    area[rest] += after.rest - before.rest
    for port, old, new in zip(channel_map.ports, before.openings, after.openings, strict=True):
        area[port.exit_name] -= new - old
    volume[channel_map.source.definition.part] -= after.volume - before.volume
    return area, volume
