"""Everything about a mesh that a conduction problem needs, integrated once.

A problem's matrix is ``K = Σ k_p K_p + Σ h_f R_f + Σ c_j J_j``; the unit
integrals are kept here on one sparsity pattern, so that new conductivities,
films and joints only re-sum them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.errors import MeshTagError, SpecError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import EDGES, integrate_facets
from spindle_fem.model.mesh.integration import integrate_mesh
from spindle_fem.model.mesh.thermal_operators import AREA_TOLERANCE, ThermalOperators, spread

__all__ = ["ThermalOperators", "build_operators", "prolongation_from_corners", "spread"]

MATCH_TOLERANCE = 1e-6


def build_operators(
    mesh: TaggedMesh,
    order: int = 2,
    *,
    area_tolerance: float = AREA_TOLERANCE,
) -> ThermalOperators:
    """Integrate everything that conduction problems on a mesh share.

    Parameters
    ----------
    mesh : TaggedMesh
        Its elements may also be linear, (n, 4) with facets (n, 3), for order 1.
    order : int
        Of the temperature: 1 (corner nodes) or 2 (all nodes). The geometry is
        the mesh's in both.
    area_tolerance : float, [-]
        Largest deviation of an area or volume from the solid model.

    Raises
    ------
    SpecError
        Another order.
    MeshQualityError
        Inverted elements, or a measure away from CAD.
    MeshTagError
        A node of two parts, a joint whose sides do not match.
    """
    if order not in (1, 2):
        raise SpecError("order", f"{order!r}.", "Allowed: 1 or 2.")
    if order == 2 and mesh.tetrahedra.shape[1] == 4:
        raise SpecError("order", "2 on linear elements.", "Allowed: 1, or a quadratic mesh.")
    n_unknowns = mesh.n_corners if order == 1 else len(mesh.points)
    surface_rows, joint_rows, facets = _stack_facets(mesh)
    _require_joint_match(mesh, joint_rows, facets)
    facet_nodes = np.ascontiguousarray(facets[:, : 3 if order == 1 else 6]).astype(np.int64)
    integrals = integrate_mesh(mesh, order, n_unknowns, facet_nodes, list(joint_rows.values()))
    facet_integrals = integrate_facets(mesh, facets, order)
    distinct, inverse = _distinct(integrals.facet_slots, integrals.pattern.n_upper)
    operators = ThermalOperators(
        mesh=mesh,
        order=order,
        n_unknowns=n_unknowns,
        pattern=integrals.pattern,
        part_of_slot=integrals.part_of_slot,
        part_of_unknown=integrals.part_of_unknown,
        conduction=integrals.conduction,
        storage=integrals.storage,
        part_load=integrals.load,
        part_volume=dict(zip(mesh.part_names, integrals.part_volume.tolist(), strict=True)),
        facet_nodes=facet_nodes,
        facet_film=facet_integrals.film,
        facet_load=facet_integrals.load,
        facet_area=facet_integrals.area,
        facet_slots=distinct,
        facet_inverse=inverse,
        surface_rows=surface_rows,
        joint_rows=joint_rows,
        joint_cross_slots=dict(zip(joint_rows, integrals.cross_slots, strict=True)),
        prolongation=None if order == 1 else prolongation_from_corners(mesh),
    )
    operators.require_measures(area_tolerance)
    return operators


def prolongation_from_corners(mesh: TaggedMesh) -> sparse.csr_array:
    """Linear temperatures at all nodes, (n_nodes, n_corners): edge middles take the mean of the ends."""
    n = len(mesh.points)
    ends = np.empty((n, 2), dtype=np.int32)
    ends[: mesh.n_corners] = np.arange(mesh.n_corners, dtype=np.int32)[:, None]
    for column, edge in enumerate(EDGES):
        ends[mesh.tetrahedra[:, 4 + column]] = mesh.tetrahedra[:, edge]
    matrix = sparse.csr_array(
        (np.full(2 * n, 0.5), ends.ravel(), np.arange(0, 2 * n + 1, 2, dtype=np.int32)),
        shape=(n, mesh.n_corners),
    )
    matrix.sum_duplicates()
    return matrix


def _distinct(slots: NDArray[np.int32], size: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Distinct values below ``size``, rising, and the place of each value among them."""
    used = np.zeros(size, dtype=bool)
    used[slots] = True
    place = np.cumsum(used, dtype=np.int32)
    place -= 1
    return np.flatnonzero(used), place[slots]


def _stack_facets(
    mesh: TaggedMesh,
) -> tuple[dict[str, slice], dict[str, tuple[slice, slice]], NDArray[np.int64]]:
    blocks: list[NDArray[np.int64]] = []
    total = 0

    def append(block: NDArray[np.int64]) -> slice:
        nonlocal total
        blocks.append(block)
        total += len(block)
        return slice(total - len(block), total)

    surface_rows = {name: append(facets) for name, facets in mesh.surfaces.items()}
    joint_rows = {
        name: (append(joint.facets_a), append(joint.facets_b)) for name, joint in mesh.joints.items()
    }
    return surface_rows, joint_rows, np.vstack(blocks)


def _require_joint_match(
    mesh: TaggedMesh, joint_rows: Mapping[str, tuple[slice, slice]], facets: NDArray[np.int64]
) -> None:
    for name, (side_a, side_b) in joint_rows.items():
        if side_a.stop - side_a.start != side_b.stop - side_b.start:
            raise MeshTagError(f"joint {name}", "its sides have different numbers of facets.")
        points_a, points_b = mesh.points[facets[side_a]], mesh.points[facets[side_b]]
        size = np.abs(points_a[:, 1] - points_a[:, 0]).max()
        gap = float(np.abs(points_a - points_b).max())
        if gap > MATCH_TOLERANCE * size:
            raise MeshTagError(f"joint {name}", f"nodes of its two sides are {gap:.3g} m apart.")
