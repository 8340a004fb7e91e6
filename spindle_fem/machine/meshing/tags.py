"""Convert gmsh's shared-node mesh to parts with nodes of their own, names and joints."""

from __future__ import annotations

from collections import defaultdict
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshTagError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.meshing.curving import curved_middles, edge_key
from spindle_fem.machine.meshing.generate import LinearMesh, MeshedFace
from spindle_fem.machine.meshing.improve_quality import improve_elements
from spindle_fem.machine.meshing.quality import (
    TETRAHEDRON_EDGES,
    gmsh_quality,
    linear_quality,
    sampled_quality,
)
from spindle_fem.machine.meshing.tagged_mesh import Joint, TaggedMesh

# Each face of a tetrahedron with its outward normal, opposite corners 0 to 3.
_OUTWARD_FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
# Elements whose sampled quality is below this are measured over the whole element.
_MEASURE_BELOW = 0.35


def tag_mesh(assembly: AssemblyGeometry, linear: LinearMesh, digest: str = "") -> TaggedMesh:
    """Split parts, curve edges, name facets and measure quality.

    Raises
    ------
    MeshTagError
        A boundary facet without a name or with two, a name without facets.
    """
    n_shared = len(linear.points)
    tetrahedra = _positive(linear.points, linear.tetrahedra)
    # Corner nodes of their own for each part, sorted by part.
    corner_keys, corners = np.unique(
        linear.part_of_element[:, None].astype(np.int64) * n_shared + tetrahedra, return_inverse=True
    )
    corners = corners.reshape(-1, 4)
    shared_of = corner_keys % n_shared
    n_corners = len(corner_keys)

    edge_keys, edges = np.unique(
        np.column_stack([edge_key(corners[:, a], corners[:, b], n_corners) for a, b in TETRAHEDRON_EDGES]),
        return_inverse=True,
    )
    edges = edges.reshape(-1, 6)
    first, second = edge_keys // n_corners, edge_keys % n_corners
    points_of_corners = linear.points[shared_of]
    middles = 0.5 * (points_of_corners[first] + points_of_corners[second])
    ports = assembly.channel.ports if assembly.channel is not None else ()
    curved_keys, curved = curved_middles(linear, ports)
    place = _find(curved_keys, edge_key(shared_of[first], shared_of[second], n_shared))
    is_curved = place >= 0
    middles[is_curved] = curved[place[is_curved]]
    points = np.concatenate([points_of_corners, middles])
    elements = np.concatenate([corners, n_corners + edges], axis=1)

    def node_in(part: int, shared: NDArray[np.int64]) -> NDArray[np.int64]:
        found = _find(corner_keys, part * np.int64(n_shared) + shared)
        if (found < 0).any():
            raise MeshTagError("mesh", f'a face of part "{assembly.part_names[part]}" lies off its elements.')
        return found

    def with_middles(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
        columns = [triangles]
        for a, b in ((0, 1), (1, 2), (2, 0)):
            found = _find(edge_keys, edge_key(triangles[:, a], triangles[:, b], n_corners))
            columns.append((n_corners + found)[:, None])
        return np.concatenate(columns, axis=1)

    boundary = _Boundary(corners)
    surfaces: dict[str, list[NDArray[np.int64]]] = defaultdict(list)
    joints: dict[str, list[tuple[NDArray[np.int64], NDArray[np.int64]]]] = defaultdict(list)
    owners: dict[str, str] = {}
    area: dict[str, float] = defaultdict(float)
    for face in linear.faces:
        area[face.kind.name] += face.area
        name_parts = _parts_in_name_order(face, assembly)
        triangles = boundary.claim_outward(node_in(name_parts[0], face.triangles), face.kind.name)
        facets = with_middles(triangles)
        if len(name_parts) == 1:
            surfaces[face.kind.name].append(facets)
            owners[face.kind.name] = assembly.part_names[name_parts[0]]
            continue
        other = node_in(name_parts[1], shared_of[triangles])
        boundary.claim_outward(other, face.kind.name)
        joints[face.kind.name].append((facets, with_middles(other)))
    boundary.require_complete()
    _require_names(assembly, surfaces, joints)

    mesh_surfaces = {name: np.concatenate(surfaces[name]) for name in sorted(surfaces)}
    mesh_joints = {
        name: Joint(name, *(np.concatenate(side) for side in zip(*joints[name], strict=True)))
        for name in sorted(joints)
    }
    fixed = np.zeros(len(points), dtype=bool)
    for facets in mesh_surfaces.values():
        fixed[facets] = True
    for joint in mesh_joints.values():
        fixed[joint.facets_a] = True
        fixed[joint.facets_b] = True
    points, worst = _improved(points, elements, n_corners, fixed, is_curved[edges].any(axis=1))
    mesh = TaggedMesh(
        points=points,
        n_corners=n_corners,
        tetrahedra=elements,
        part_names=assembly.part_names,
        part_of_element=linear.part_of_element,
        surfaces=MappingProxyType(mesh_surfaces),
        joints=MappingProxyType(mesh_joints),
        part_of_surface=MappingProxyType({name: owners[name] for name in mesh_surfaces}),
        cad_area=MappingProxyType({name: area[name] for name in (*mesh_surfaces, *mesh_joints)}),
        cad_volume=MappingProxyType(dict(zip(assembly.part_names, linear.volume.tolist(), strict=True))),
        rotating=assembly.rotating,
        min_quality=worst,
        digest=digest,
        notes=(*assembly.notes, *linear.notes),
    )
    freeze(mesh)
    return mesh


def freeze(mesh: TaggedMesh) -> None:
    """Make every array read-only."""
    arrays = [mesh.points, mesh.tetrahedra, mesh.part_of_element, *mesh.surfaces.values()]
    for joint in mesh.joints.values():
        arrays += [joint.facets_a, joint.facets_b]
    for array in arrays:
        array.flags.writeable = False


class _Boundary:
    """Faces that belong to one element only, each to be claimed by one name."""

    def __init__(self, corners: NDArray[np.int64]) -> None:
        faces = np.concatenate([corners[:, list(face)] for face in _OUTWARD_FACES])
        # Two integers hold three sorted corners.
        ordered = np.sort(faces, axis=1)
        base = np.int64(corners.max()) + 1
        if base < 2_000_000:
            keys = (ordered[:, 0] * base + ordered[:, 1]) * base + ordered[:, 2]
        else:
            raise MeshTagError(
                "mesh", f"{base} corner nodes are too many.", "Allowed: fewer than two million."
            )
        order = np.argsort(keys)
        sorted_keys = keys[order]
        same_as_next = np.concatenate([sorted_keys[1:] == sorted_keys[:-1], [False]])
        same_as_last = np.concatenate([[False], sorted_keys[1:] == sorted_keys[:-1]])
        if (same_as_next & same_as_last).any():
            raise MeshTagError("mesh", "a face belongs to more than two elements, the mesh does not conform.")
        single = ~same_as_next & ~same_as_last
        self._base = base
        self._keys = sorted_keys[single]
        self._faces = faces[order[single]]
        self._claimed = np.zeros(len(self._keys), dtype=bool)

    def claim_outward(self, triangles: NDArray[np.int64], name: str) -> NDArray[np.int64]:
        """Mark faces as named and return them with their normal outward."""
        ordered = np.sort(triangles, axis=1)
        keys = (ordered[:, 0] * self._base + ordered[:, 1]) * self._base + ordered[:, 2]
        found = _find(self._keys, keys)
        if (found < 0).any():
            raise MeshTagError(
                f'surface "{name}"',
                f"{np.count_nonzero(found < 0)} facets lie inside the part or off the mesh.",
            )
        if self._claimed[found].any() or len(np.unique(found)) != len(found):
            raise MeshTagError(f'surface "{name}"', "claims facets that another name has already.")
        self._claimed[found] = True
        return self._faces[found]

    def require_complete(self) -> None:
        """Every boundary face has a name."""
        missing = np.count_nonzero(~self._claimed)
        if missing:
            raise MeshTagError("mesh", f"{missing} boundary facets have no name, the mesh does not conform.")


def _positive(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> NDArray[np.int64]:
    corners = points[tetrahedra]
    a, b, c = (corners[:, index] - corners[:, 0] for index in (1, 2, 3))
    inverted = np.einsum("ei,ei->e", a, np.cross(b, c)) < 0.0
    result = tetrahedra.copy()
    result[inverted, 2], result[inverted, 3] = tetrahedra[inverted, 3], tetrahedra[inverted, 2]
    return result


def _find(ascending: NDArray[np.int64], wanted: NDArray[np.int64]) -> NDArray[np.int64]:
    """Index of each wanted key, -1 where there is none."""
    if len(ascending) == 0:
        return np.full(wanted.shape, -1, dtype=np.int64)
    place = np.minimum(np.searchsorted(ascending, wanted), len(ascending) - 1)
    return np.where(ascending[place] == wanted, place, -1)


def _parts_in_name_order(face: MeshedFace, assembly: AssemblyGeometry) -> tuple[int, ...]:
    if len(face.parts) == 1:
        return face.parts
    return tuple(assembly.part_names.index(name) for name in assembly.joint_parts[face.kind.name])


def _require_names(assembly: AssemblyGeometry, surfaces: dict, joints: dict) -> None:
    for kind, expected, found in (
        ("surface", assembly.surface_names, surfaces),
        ("joint", assembly.joint_names, joints),
    ):
        missing = sorted(set(expected) - set(found))
        if missing:
            raise MeshTagError("mesh", f"{kind} {', '.join(missing)} has no facets.")


def _improved(
    points: NDArray[np.float64],
    elements: NDArray[np.int64],
    n_corners: int,
    fixed: NDArray[np.bool_],
    is_curved: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], float]:
    """Points with the worst elements relaxed, and the worst quality as gmsh measures it."""
    quality = np.empty(len(elements))
    quality[~is_curved] = linear_quality(points, elements[~is_curved])
    quality[is_curved] = sampled_quality(points[elements[is_curved]])
    points, quality = improve_elements(points, elements, n_corners, fixed, quality)
    # Between its samples an element may be worse: measure whichever may be the worst.
    doubtful = quality < max(_MEASURE_BELOW, float(quality.min()) + 0.1)
    measured = gmsh_quality(points, elements[doubtful])
    return points, float(min(quality[~doubtful].min(initial=1.0), measured.min(initial=1.0)))
