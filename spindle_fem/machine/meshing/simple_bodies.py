"""Structured curved meshes of simple bodies, built without a mesher.

They carry the same names, joints and curved midside nodes as a meshed machine
and serve wherever an exact solution is known: slab, box, tube, tube sector,
and tubes in contact. A block is a lattice of cells, each cut into the same six
tetrahedra (Kuhn 1960), mapped to space; every node, midside nodes included,
lies exactly on the mapped geometry.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError, MeshQualityError
from spindle_fem.machine.meshing.tagged_mesh import Joint, TaggedMesh

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
OUTWARD_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
FACES = ("u0", "u1", "v0", "v1", "w0", "w1")
_GAUSS_POINTS = 24
_PARAMETER_STEP = 1e-5

SpaceMapping = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class Block:
    """A lattice of cells mapped from the unit cube (u, v, w) to space.

    Attributes
    ----------
    counts : (int, int, int)
        Cells along u, v and w.
    mapping : callable
        ``(3, n)`` parameters in [0, 1] to ``(3, n)`` points [m]; smooth, and
        one-to-one but for the closed direction.
    faces : mapping of str to str
        Surface name of each face ``u0 u1 v0 v1 w0 w1`` that is not in a joint.
        Equal names merge into one surface.
    periodic : bool
        Whether v closes on itself (a full tube).
    """

    part: str
    counts: tuple[int, int, int]
    mapping: SpaceMapping
    faces: Mapping[str, str]
    periodic: bool = False
    rotating: bool = False


@dataclass(slots=True)
class _Lattice:
    points: NDArray[np.float64]
    n_corners: int
    tetrahedra: NDArray[np.int64]
    faces: dict[str, NDArray[np.int64]] = field(default_factory=dict)


def build_structured_mesh(
    blocks: Sequence[Block], joints: Sequence[tuple[str, str, str, str]] = ()
) -> TaggedMesh:
    """Mesh of blocks, joined face to face.

    Parameters
    ----------
    joints : sequence of (part_a, face_a, part_b, face_b)
        Faces that coincide point by point, for example
        ``("inner", "u1", "outer", "u0")``.

    Raises
    ------
    GeometryError
        A face without a name, or joined faces that do not coincide.
    MeshQualityError
        A mapping that folds.
    """
    lattices = [_build_lattice(block) for block in blocks]
    index_of = {block.part: index for index, block in enumerate(blocks)}
    if len(index_of) != len(blocks):
        raise GeometryError("blocks", "two blocks carry the same part name.", "Name each part once.")
    n_corners = sum(lattice.n_corners for lattice in lattices)
    node_maps = _global_numbers(lattices, n_corners)
    points = np.empty((sum(len(lattice.points) for lattice in lattices), 3))
    for lattice, numbers in zip(lattices, node_maps, strict=True):
        points[numbers] = lattice.points
    facets_of = {
        (block.part, face): numbers[lattice.faces[face]]
        for block, lattice, numbers in zip(blocks, lattices, node_maps, strict=True)
        for face in lattice.faces
    }
    joined: dict[str, Joint] = {}
    cad_area: dict[str, float] = {}
    for part_a, face_a, part_b, face_b in joints:
        name = f"{part_a}|{part_b}"
        facets_a, facets_b = facets_of.pop((part_a, face_a)), facets_of.pop((part_b, face_b))
        joined[name] = Joint(name, facets_a, _match_facets(name, points, facets_a, facets_b))
        cad_area[name] = _face_area(blocks[index_of[part_a]].mapping, face_a)
    surfaces: dict[str, NDArray[np.int64]] = {}
    part_of_surface: dict[str, str] = {}
    for (part, face), facets in facets_of.items():
        block = blocks[index_of[part]]
        if face not in block.faces:
            raise GeometryError(f"block {part}", f"face {face} has no name.", "Name it or put it in a joint.")
        name = f"{part}.{block.faces[face]}"
        surfaces[name] = np.vstack((surfaces[name], facets)) if name in surfaces else facets
        part_of_surface[name] = part
        cad_area[name] = cad_area.get(name, 0.0) + _face_area(block.mapping, face)
    tetrahedra = np.vstack([n[lattice.tetrahedra] for n, lattice in zip(node_maps, lattices, strict=True)])
    counts = [len(lattice.tetrahedra) for lattice in lattices]
    quality = signed_inverse_condition(points, tetrahedra)
    if quality <= 0.0:
        raise MeshQualityError("structured mesh", f"inverted elements (quality {quality:.3g}).", "Refine it.")
    return TaggedMesh(
        points=_frozen(points),
        n_corners=n_corners,
        tetrahedra=_frozen(tetrahedra),
        part_names=tuple(block.part for block in blocks),
        part_of_element=_frozen(np.repeat(np.arange(len(blocks), dtype=np.int32), counts)),
        surfaces={name: _frozen(facets) for name, facets in surfaces.items()},
        joints=joined,
        part_of_surface=part_of_surface,
        cad_area=cad_area,
        cad_volume={block.part: _block_volume(block.mapping) for block in blocks},
        rotating={block.part: block.rotating for block in blocks},
        min_quality=quality,
        digest=hashlib.sha256(points.tobytes() + tetrahedra.tobytes()).hexdigest(),
    )


def build_box(
    lengths: tuple[float, float, float], counts: tuple[int, int, int], part: str = "box"
) -> TaggedMesh:
    """Box from the origin; surfaces ``box.x0 box.x1 box.y0 ... box.z1``.

    Parameters
    ----------
    lengths : (float, float, float), [m]
    counts : (int, int, int)
        Cells along x, y, z; each makes six tetrahedra.
    >>> build_box((1.0, 1.0, 1.0), (1, 1, 1)).n_elements
    6
    """
    scale = np.asarray(lengths, dtype=float)[:, None]
    names = dict(zip(FACES, ("x0", "x1", "y0", "y1", "z0", "z1"), strict=True))
    return build_structured_mesh([Block(part, counts, lambda u: scale * u, names)])


def tube_mapping(
    radius_inner: float, radius_outer: float, z_start: float, z_end: float, angle: float = 2.0 * np.pi
) -> SpaceMapping:
    """Map (u, v, w) to radius, angle and z, with θ = 0 along +y turning to −x.

    Lengths in m, ``angle`` in rad.
    """

    def mapping(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        u, v, w = parameters
        radius = radius_inner + (radius_outer - radius_inner) * u
        return np.stack(
            (-radius * np.sin(angle * v), radius * np.cos(angle * v), z_start + (z_end - z_start) * w)
        )

    return mapping


_TUBE_NAMES: dict[str, str] = dict(
    zip(FACES, ("inner", "outer", "theta0", "theta1", "z0", "z1"), strict=True)
)


def build_tube(
    radii: tuple[float, float],
    length: float,
    counts: tuple[int, int, int],
    *,
    angle: float = 2.0 * np.pi,
    part: str = "tube",
    rotating: bool = False,
) -> TaggedMesh:
    """Tube or tube sector along z; surfaces ``tube.inner outer z0 z1 (theta0 theta1)``.

    Parameters
    ----------
    radii : (float, float), [m]
        Inner and outer.
    length : float, [m]
    counts : (int, int, int)
        Cells along radius, angle (3 at least when closed) and z.
    angle : float, [rad]
        Below 2π a sector with faces ``theta0`` and ``theta1``.
    >>> sorted(build_tube((0.1, 0.2), 0.1, (1, 6, 1)).surfaces)
    ['tube.inner', 'tube.outer', 'tube.z0', 'tube.z1']
    """
    return build_structured_mesh([_tube_block(part, radii, length, counts, angle, rotating)])


def build_joined_tubes(
    radii: Sequence[float],
    length: float,
    counts: tuple[Sequence[int], int, int],
    *,
    angle: float = 2.0 * np.pi,
    parts: Sequence[str] = ("inner", "outer"),
    rotating: Sequence[bool] | None = None,
) -> TaggedMesh:
    """Concentric tubes, each in contact with the next through a joint.

    Parameters
    ----------
    radii : sequence of float, [m]
        One more than parts.
    length : float, [m]
    counts : (sequence of int, int, int)
        Cells along the radius of each tube, angle and z.
    angle : float, [rad]
    >>> list(build_joined_tubes((0.1, 0.2, 0.3), 0.1, ((1, 1), 6, 1)).joints)
    ['inner|outer']
    """
    turns = rotating if rotating is not None else [False] * len(parts)
    blocks = [
        _tube_block(part, (radii[i], radii[i + 1]), length, (counts[0][i], *counts[1:]), angle, turns[i])
        for i, part in enumerate(parts)
    ]
    pairs = [(parts[i], "u1", parts[i + 1], "u0") for i in range(len(parts) - 1)]
    return build_structured_mesh(blocks, pairs)


def _tube_block(
    part: str,
    radii: tuple[float, float],
    length: float,
    counts: tuple[int, int, int],
    angle: float,
    rotating: bool,
) -> Block:
    closed = bool(np.isclose(angle, 2.0 * np.pi))
    mapping = tube_mapping(*radii, 0.0, length, angle)
    return Block(part, counts, mapping, _TUBE_NAMES, periodic=closed, rotating=rotating)


def signed_inverse_condition(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> float:
    """Smallest signed inverse condition number over corners and centroids, [-].

    1 is the regular tetrahedron, 0 degenerate, negative inverted. Source:
    Freitag & Knupp (2002), Int. J. Numer. Methods Eng. 53, 1377-1391.
    """
    ideal = np.array(
        [[1.0, 0.5, 0.5], [0.0, np.sqrt(0.75), np.sqrt(1.0 / 12.0)], [0.0, 0.0, np.sqrt(2.0 / 3)]]
    )
    inverse_ideal = np.linalg.inv(ideal)
    sample = np.vstack((np.zeros(3), np.eye(3), np.full(3, 0.25)))
    worst = np.inf
    for place in sample:
        jacobian = points[tetrahedra].transpose(0, 2, 1) @ _quadratic_gradients(place) @ inverse_ideal
        determinant = np.linalg.det(jacobian)
        adjugate_norm = np.sqrt(
            sum(
                np.sum(np.cross(jacobian[:, :, i], jacobian[:, :, (i + 1) % 3]) ** 2, axis=1)
                for i in range(3)
            )
        )
        worst = min(
            worst, float((3.0 * determinant / (np.linalg.norm(jacobian, axis=(1, 2)) * adjugate_norm)).min())
        )
    return worst


def _quadratic_gradients(place: NDArray[np.float64]) -> NDArray[np.float64]:
    barycentric = np.concatenate(([1.0 - place.sum()], place))
    gradients = np.vstack((-np.ones(3), np.eye(3)))
    corners = (4.0 * barycentric - 1.0)[:, None] * gradients
    middles = [4.0 * (barycentric[i] * gradients[j] + barycentric[j] * gradients[i]) for i, j in EDGES]
    return np.vstack((corners, *middles))


def _build_lattice(block: Block) -> _Lattice:
    counts = np.array(block.counts)
    if counts.min() < 1 or (block.periodic and counts[1] < 3):
        raise GeometryError(
            f"block {block.part}",
            f"counts {block.counts}.",
            "Allowed: 1 or more, 3 or more along a closed angle.",
        )
    fine = 2 * counts + 1
    extent = fine.copy()
    if block.periodic:
        extent[1] -= 1
    lattice_index = np.stack(np.unravel_index(np.arange(extent.prod()), extent))
    points = block.mapping(lattice_index / (fine - 1)[:, None]).T
    corners_of_cell = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1).reshape(-1, 3)
    paths = []
    for axes in permutations(range(3)):
        steps = np.vstack((np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(axes)], axis=0)))
        if np.linalg.det(np.eye(3)[list(axes)]) < 0.0:
            steps = steps[[0, 2, 1, 3]]
        paths.append(steps)
    corners = 2 * (corners_of_cell[:, None, None, :] + np.array(paths)[None]).reshape(-1, 4, 3)
    middles = np.stack([(corners[:, i] + corners[:, j]) // 2 for i, j in EDGES], axis=1)
    nodes = np.concatenate((corners, middles), axis=1)
    if block.periodic:
        nodes[..., 1] %= extent[1]
    tetrahedra = np.ravel_multi_index(tuple(np.moveaxis(nodes, -1, 0)), extent)
    is_corner = np.all(lattice_index % 2 == 0, axis=0)
    numbering = np.empty(len(points), dtype=np.int64)
    numbering[is_corner] = np.arange(is_corner.sum())
    numbering[~is_corner] = np.arange(is_corner.sum(), len(points))
    ordered = np.empty_like(points)
    ordered[numbering] = points
    tetrahedra = numbering[tetrahedra]
    edges = ordered[tetrahedra[:, 1:4]] - ordered[tetrahedra[:, :1]]
    if np.linalg.det(edges).sum() < 0.0:
        # a left-handed mapping: swap two corners and the middles that go with them
        tetrahedra = tetrahedra[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
        corners = corners[:, [0, 2, 1, 3]]
    lattice = _Lattice(ordered, int(is_corner.sum()), tetrahedra)
    for axis, side in product(range(3), range(2)):
        if axis == 1 and block.periodic:
            continue
        on_face = corners[..., axis] == side * 2 * counts[axis]
        lattice.faces[FACES[2 * axis + side]] = _faces_on(tetrahedra, on_face)
    return lattice


def _faces_on(tetrahedra: NDArray[np.int64], on_face: NDArray[np.bool_]) -> NDArray[np.int64]:
    edge_number = {frozenset(edge): 4 + number for number, edge in enumerate(EDGES)}
    found = []
    for a, b, c in OUTWARD_FACES:
        columns = [a, b, c, *(edge_number[frozenset(pair)] for pair in ((a, b), (b, c), (c, a)))]
        found.append(tetrahedra[np.all(on_face[:, [a, b, c]], axis=1)][:, columns])
    return np.vstack(found)


def _global_numbers(lattices: Sequence[_Lattice], n_corners: int) -> list[NDArray[np.int64]]:
    numbers = []
    next_corner, next_middle = 0, n_corners
    for lattice in lattices:
        n_middles = len(lattice.points) - lattice.n_corners
        numbers.append(
            np.concatenate((next_corner + np.arange(lattice.n_corners), next_middle + np.arange(n_middles)))
        )
        next_corner += lattice.n_corners
        next_middle += n_middles
    return numbers


def _match_facets(
    name: str, points: NDArray[np.float64], facets_a: NDArray[np.int64], facets_b: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Facets of b in the row and column order of a."""
    from scipy.spatial import KDTree

    nodes_b = np.unique(facets_b)
    distance, nearest = KDTree(points[nodes_b]).query(points[np.unique(facets_a)])
    size = np.ptp(points[nodes_b], axis=0).max()
    if len(facets_a) != len(facets_b) or distance.max() > 1e-9 * size:
        raise GeometryError(
            f"joint {name}", "the two faces do not coincide.", "Give them equal counts and shape."
        )
    partner = np.full(len(points), -1)
    partner[np.unique(facets_a)] = nodes_b[nearest]
    return partner[facets_a]


def _gauss(dimension: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    grid = np.stack(np.meshgrid(*([0.5 + 0.5 * nodes] * dimension), indexing="ij")).reshape(dimension, -1)
    weight = np.prod(np.meshgrid(*([0.5 * weights] * dimension), indexing="ij"), axis=0).ravel()
    return grid, weight


def _derivative(mapping: SpaceMapping, parameters: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    step = np.zeros((3, 1))
    step[axis] = _PARAMETER_STEP
    return (mapping(parameters + step) - mapping(parameters - step)) / (2.0 * _PARAMETER_STEP)


def _face_area(mapping: SpaceMapping, face: str) -> float:
    axis, side = divmod(FACES.index(face), 2)
    grid, weight = _gauss(2)
    parameters = np.insert(grid, axis, float(side), axis=0)
    first, second = (_derivative(mapping, parameters, other) for other in range(3) if other != axis)
    return float(weight @ np.linalg.norm(np.cross(first, second, axis=0), axis=0))


def _block_volume(mapping: SpaceMapping) -> float:
    grid, weight = _gauss(3)
    columns = [_derivative(mapping, grid, axis) for axis in range(3)]
    return float(weight @ np.abs(np.einsum("in,in->n", columns[0], np.cross(columns[1], columns[2], axis=0))))


def _frozen(array: NDArray) -> NDArray:
    array.setflags(write=False)
    return array
