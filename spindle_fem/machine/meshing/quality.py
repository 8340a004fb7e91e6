"""Areas, volumes and element quality of curved meshes, and the checks on them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshQualityError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh

AREA_TOLERANCE = 1.0e-3
VOLUME_TOLERANCE = 1.0e-3
MINIMUM_QUALITY = 0.15

# Seven points, exact to degree five on the triangle: Radon (1948), as in
# Dunavant (1985), Int. J. Numer. Methods Eng. 21, 1129-1148, degree 5.
_ROOT = np.sqrt(15.0)
_A, _B = (6.0 - _ROOT) / 21.0, (6.0 + _ROOT) / 21.0
_BARYCENTRIC = np.array(
    [
        [1 / 3, 1 / 3, 1 / 3],
        *([1 - 2 * c, c, c] for c in (_A, _B)),
        *([c, 1 - 2 * c, c] for c in (_A, _B)),
        *([c, c, 1 - 2 * c] for c in (_A, _B)),
    ]
)
_WEIGHTS = 0.5 * np.array([9 / 40, *[(155 - _ROOT) / 1200, (155 + _ROOT) / 1200] * 3])


def _quadratic_triangle() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shape functions (7, 6) and their derivatives (7, 2, 6) at the points."""
    l0, l1, l2 = _BARYCENTRIC.T
    values = np.stack(
        [l0 * (2 * l0 - 1), l1 * (2 * l1 - 1), l2 * (2 * l2 - 1), 4 * l0 * l1, 4 * l1 * l2, 4 * l2 * l0],
        axis=1,
    )
    zero = np.zeros_like(l0)
    along_1 = np.stack([1 - 4 * l0, 4 * l1 - 1, zero, 4 * (l0 - l1), 4 * l2, -4 * l2], axis=1)
    along_2 = np.stack([1 - 4 * l0, zero, 4 * l2 - 1, -4 * l1, 4 * l1, 4 * (l0 - l2)], axis=1)
    return values, np.stack([along_1, along_2], axis=1)


_SHAPE, _DERIVATIVE = _quadratic_triangle()


def facet_areas(points: NDArray[np.float64], facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Areas of quadratic triangles.

    Parameters
    ----------
    points : (n, 3) ndarray, [m]
    facets : (m, 6) int ndarray

    Returns
    -------
    (m,) ndarray, [m²]

    >>> corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    >>> float(facet_areas(corner, np.arange(6)[None]).round(12)[0])
    0.5
    """
    normals, _ = _normals(points, facets)
    return np.linalg.norm(normals, axis=2) @ _WEIGHTS


def enclosed_volume(points: NDArray[np.float64], facets: NDArray[np.int64]) -> float:
    """Volume inside closed outward quadratic triangles, m³, by the divergence theorem."""
    normals, places = _normals(points, facets)
    return float(np.einsum("fqi,fqi,q->", normals, places, _WEIGHTS) / 3.0)


def _normals(
    points: NDArray[np.float64], facets: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    corners = points[facets]
    tangents = np.tensordot(corners, _DERIVATIVE, axes=(1, 2))  # facet, xyz, point, direction
    first, second = tangents[..., 0], tangents[..., 1]
    normals = np.cross(first, second, axis=1).transpose(0, 2, 1)
    places = np.tensordot(corners, _SHAPE, axes=(1, 1)).transpose(0, 2, 1)
    return normals, places


TETRAHEDRON_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
# Edges of the regular tetrahedron in columns: its inverse maps onto it.
_FROM_REGULAR = np.linalg.inv(
    np.array([[1.0, 0.5, 0.5], [0.0, np.sqrt(3.0) / 2.0, np.sqrt(3.0) / 6.0], [0.0, 0.0, np.sqrt(2.0 / 3.0)]])
)


def _quadratic_gradients() -> NDArray[np.float64]:
    """Gradients (20, 3, 10) of tetrahedron shape functions at the sample points.

    The ten nodes, the middles of the faces, the centroid, and the points
    half-way from there to the corners.
    """
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middles = np.array([0.5 * (corners[a] + corners[b]) for a, b in TETRAHEDRON_EDGES])
    faces = corners[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].mean(axis=1)
    centre = corners.mean(axis=0, keepdims=True)
    places = np.vstack([corners, middles, faces, centre, 0.5 * (corners + centre)])
    barycentric = np.column_stack([1.0 - places.sum(axis=1), places])
    slope = np.vstack([-np.ones(3), np.eye(3)])
    gradients = np.empty((len(places), 3, 10))
    for node in range(4):
        gradients[:, :, node] = (4.0 * barycentric[:, node] - 1.0)[:, None] * slope[node]
    for node, (a, b) in enumerate(TETRAHEDRON_EDGES, start=4):
        gradients[:, :, node] = 4.0 * (barycentric[:, [a]] * slope[b] + barycentric[:, [b]] * slope[a])
    return gradients


_REGULAR_GRADIENTS = np.einsum("qdn,de->qen", _quadratic_gradients(), _FROM_REGULAR)


def linear_quality(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> NDArray[np.float64]:
    """Signed inverse condition number of straight tetrahedra (gmsh's SICN).

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4 or more) int ndarray

    Returns
    -------
    (m,) ndarray, [-]
        1 for the regular tetrahedron, negative when inverted.

    >>> regular = np.array([[1.0, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])
    >>> float(linear_quality(regular, np.array([[0, 1, 2, 3]])).round(12)[0])
    1.0
    """
    corners = points[tetrahedra[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    jacobian = np.tensordot(edges, _FROM_REGULAR, axes=(1, 0))  # element, xyz, direction
    return _signed_inverse_condition(jacobian.transpose(2, 1, 0))


def sampled_quality(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest signed inverse condition number over sample points of quadratic tetrahedra.

    An upper bound of gmsh's minSICN, exact for straight elements.

    Parameters
    ----------
    places : (m, 10, 3) ndarray, [m]
        Nodes of each element.

    Returns
    -------
    (m,) ndarray, [-]
    """
    jacobian = np.tensordot(places, _REGULAR_GRADIENTS, axes=(1, 2))  # element, xyz, point, direction
    return _signed_inverse_condition(jacobian.transpose(3, 1, 2, 0)).min(axis=0)


def _signed_inverse_condition(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """3 / (|J| |J^-1|) in the Frobenius norm with the sign of det J; direction and xyz lead."""
    jacobian = np.ascontiguousarray(jacobian)
    first, second, third = jacobian
    crossed = _cross(second, third), _cross(third, first), _cross(first, second)
    determinant = sum(a * b for a, b in zip(first, crossed[0], strict=True))
    norm = sum(component * component for vector in jacobian for component in vector)
    adjugate = sum(component * component for vector in crossed for component in vector)
    scale = np.sqrt(norm * adjugate)
    return 3.0 * np.divide(determinant, scale, out=np.zeros_like(determinant), where=scale > 0.0)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Cross product of vectors whose components come first (several times faster than numpy's)."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def gmsh_quality(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> NDArray[np.float64]:
    """The minSICN of gmsh for quadratic tetrahedra, bounded over the whole element.

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 10) int ndarray

    Returns
    -------
    (m,) ndarray, [-]
    """
    import gmsh

    from spindle_fem.machine.geometry.cad_solids import gmsh_session

    if len(tetrahedra) == 0:
        return np.empty(0)
    used, local = np.unique(tetrahedra, return_inverse=True)
    # gmsh lists the middles of edges 23 and 13 the other way round.
    local = local.reshape(-1, 10)[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    with gmsh_session():
        entity = gmsh.model.addDiscreteEntity(3)
        gmsh.model.mesh.addNodes(3, entity, np.arange(1, len(used) + 1), points[used].ravel())
        elements = np.arange(1, len(local) + 1)
        gmsh.model.mesh.addElementsByType(entity, 11, elements, (local + 1).ravel())
        return np.asarray(gmsh.model.mesh.getElementQualities(elements, "minSICN"))


def area_errors(mesh: TaggedMesh) -> dict[str, float]:
    """Relative area error of each surface and joint against the solid model."""
    facets = {**mesh.surfaces, **{name: joint.facets_a for name, joint in mesh.joints.items()}}
    return {
        name: float(facet_areas(mesh.points, nodes).sum()) / mesh.cad_area[name] - 1.0
        for name, nodes in facets.items()
    }


def volume_errors(mesh: TaggedMesh) -> dict[str, float]:
    """Relative volume error of each part against the solid model."""
    facets: dict[str, list[NDArray[np.int64]]] = {name: [] for name in mesh.part_names}
    for name, nodes in mesh.surfaces.items():
        facets[mesh.part_of_surface[name]].append(nodes)
    for joint in mesh.joints.values():
        part_a, part_b = joint.name.partition(":")[0].split("|")
        facets[part_a].append(joint.facets_a)
        # Seen from the second part, the shared order points inwards.
        facets[part_b].append(joint.facets_b[:, [0, 2, 1, 5, 4, 3]])
    return {
        name: enclosed_volume(mesh.points, np.concatenate(nodes)) / mesh.cad_volume[name] - 1.0
        for name, nodes in facets.items()
    }


def require_quality(mesh: TaggedMesh, *, minimum: float = MINIMUM_QUALITY) -> None:
    """Refuse areas or volumes away from CAD and elements that are too distorted.

    Raises
    ------
    MeshQualityError
        Names every surface and part that is off.
    """
    _require_small("area of", area_errors(mesh), AREA_TOLERANCE)
    _require_small("volume of", volume_errors(mesh), VOLUME_TOLERANCE)
    if not mesh.min_quality > minimum:
        state = "inverted elements" if mesh.min_quality <= 0.0 else "distorted elements"
        raise MeshQualityError(
            "mesh",
            f"{state}: the worst minSICN is {mesh.min_quality:.3f}.",
            f"Allowed: above {minimum:g}; change mesh.preset or mesh.size_factor.",
        )


def _require_small(what: str, errors: Mapping[str, float], tolerance: float) -> None:
    off = {name: error for name, error in errors.items() if not abs(error) <= tolerance}
    if off:
        listing = ", ".join(f"{name} {error:+.2%}" for name, error in sorted(off.items()))
        raise MeshQualityError(
            "mesh",
            f"{what} {listing} away from the solid model.",
            f"Allowed: {tolerance:.1%}; refine mesh.size_factor.",
        )
