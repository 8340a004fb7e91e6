"""The integrals of a mesh, summed on one sparsity pattern."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshQualityError, MeshTagError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import integrate_elements, upper_pairs
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import assembly_loops as loops
from spindle_fem.model.mesh.kernels.linear_elements import fill_linear_rows, integrate_linear
from spindle_fem.model.mesh.sparsity_pattern import SymmetricPattern, expand_pattern, grouped
from spindle_fem.model.mesh.threads import fill_rows, row_blocks, run_blocks, unsigned
from spindle_fem.parallel import in_threads

# Elements integrated at once: their matrices take 60 MB.
BATCH = 1 << 16
# Calls that linear elements are divided into, so that threads end together.
INTEGRATION_CALLS = 8
# First guesses of the upper entries a row, with room for the last rows; wrong ones only cost time.
ENTRIES_OF_LINEAR = 9.0
ENTRIES_OF_QUADRATIC = 17.0


@dataclass(frozen=True, slots=True)
class MeshIntegrals:
    """Sums over all elements, on the entries of a pattern.

    Attributes
    ----------
    part_of_unknown : (n_unknowns,) int32 ndarray
    part_of_slot : (n_upper,) int16 ndarray
        -1 where only a joint couples.
    conduction, storage : (n_upper,) ndarray, [m], [m³]
    load : (n_unknowns,) ndarray, [m³]
    part_volume : (n_parts,) ndarray, [m³]
    facet_slots : (n_facets, n_upper of a facet) int32 ndarray
    cross_slots : list of (n, k, k) int32 ndarray
        One for each joint.
    """

    pattern: SymmetricPattern
    part_of_unknown: NDArray[np.int32]
    part_of_slot: NDArray[np.int16]
    conduction: NDArray[np.float64]
    storage: NDArray[np.float64]
    load: NDArray[np.float64]
    part_volume: NDArray[np.float64]
    facet_slots: NDArray[np.int32]
    cross_slots: list[NDArray[np.int32]]


@dataclass(frozen=True, slots=True)
class _Neighbours:
    """Surroundings of each node: its positions in the elements, and higher nodes across joints."""

    nodes: NDArray[np.uint32]
    part: NDArray[np.int32]
    part_of_unknown: NDArray[np.int32]
    members: tuple[NDArray[np.uint32], ...]
    joined: tuple[NDArray[np.uint32], ...]


@dataclass(frozen=True, slots=True)
class _UpperRows:
    """Compressed rows from the diagonal on, and what the elements sum to in them."""

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    part_of_slot: NDArray[np.int16]
    conduction: NDArray[np.float64]
    storage: NDArray[np.float64]
    load: NDArray[np.float64]
    part_volume: NDArray[np.float64]


def integrate_mesh(
    mesh: TaggedMesh,
    order: int,
    n_unknowns: int,
    facet_nodes: NDArray[np.int64],
    joints: list[tuple[slice, slice]],
) -> MeshIntegrals:
    """Integrate all elements of a mesh and find where facets and joints couple unknowns.

    Parameters
    ----------
    facet_nodes : (n_facets, n) int ndarray
    joints : list of (slice, slice)
        Rows of both sides of each joint in ``facet_nodes``.

    Raises
    ------
    MeshQualityError
        Inverted elements.
    MeshTagError
        A node of two parts or of none, a facet of no element.
    """
    crossings = [
        np.broadcast_arrays(facet_nodes[one][:, :, None], facet_nodes[other][:, None, :])
        for one, other in joints
    ]
    around = _neighbours(mesh, order, n_unknowns, crossings)
    fill = _linear_rows if mesh.tetrahedra.shape[1] == 4 else _general_rows
    upper = fill(mesh, order, n_unknowns, around)
    rows, columns = upper_pairs(facet_nodes.shape[1])
    facet_slots = _find(facet_nodes[:, rows], facet_nodes[:, columns], upper)
    if np.any(facet_slots < 0) or np.any(upper.part_of_slot[facet_slots] < 0):
        raise MeshTagError("mesh", "a tagged triangle is no facet of any element.")
    return MeshIntegrals(
        expand_pattern(upper.indptr, upper.indices),
        around.part_of_unknown,
        upper.part_of_slot,
        upper.conduction,
        upper.storage,
        upper.load,
        upper.part_volume,
        facet_slots,
        [_find(one, other, upper) for one, other in crossings],
    )


def _neighbours(
    mesh: TaggedMesh, order: int, n_unknowns: int, crossings: list[tuple[NDArray, NDArray]]
) -> _Neighbours:
    nodes = np.ascontiguousarray(mesh.tetrahedra[:, : 4 if order == 1 else 10], dtype=np.int32)
    part = np.array(mesh.part_of_element, dtype=np.int32)
    one, other = (
        np.concatenate([np.zeros(0, dtype=np.int32), *(pair[k].ravel() for pair in crossings)])
        for k in range(2)
    )
    members, (part_of_unknown, shared), (starts, pairs) = in_threads(
        [
            partial(grouped, nodes, n_unknowns),
            partial(loops.part_of_nodes, nodes.view(np.uint32), part, n_unknowns),
            partial(grouped, np.minimum(one, other), n_unknowns),
        ]
    )
    if shared:
        raise MeshTagError(
            "mesh", "two parts share a node.", "Parts need nodes of their own, tied by joints."
        )
    loose = int(np.sum(part_of_unknown < 0))
    if loose:
        raise MeshTagError("mesh", f"{loose} nodes belong to no element.", "Drop unused nodes.")
    joined = unsigned(starts, np.maximum(one, other)[pairs])
    return _Neighbours(nodes.view(np.uint32), part, part_of_unknown, unsigned(*members), joined)


def _general_rows(mesh: TaggedMesh, order: int, n_unknowns: int, around: _Neighbours) -> _UpperRows:
    """Rows of quadratic elements: the pattern first, then batches of element matrices into it."""
    nodes, part = around.nodes, around.part
    guess = ENTRIES_OF_LINEAR if order == 1 else ENTRIES_OF_QUADRATIC
    given = (nodes, *around.members, *around.joined)
    indptr, indices = fill_rows(loops.fill_upper, n_unknowns, given, guess, (np.int32,))
    # parts share no node, so what couples two nodes of one part is an element
    part_of_row = np.repeat(around.part_of_unknown.astype(np.int16), np.diff(indptr))
    part_of_slot = np.where(part_of_row == around.part_of_unknown[indices], part_of_row, np.int16(-1))
    conduction, storage = np.zeros(len(indices)), np.zeros(len(indices))
    load, volume = np.zeros(n_unknowns), np.zeros(len(mesh.part_names))
    upper = unsigned(indptr, indices)
    for start in range(0, len(nodes), BATCH):
        batch = slice(start, start + BATCH)
        own = integrate_elements(mesh, order, batch)
        both = (own.conduction, own.storage)
        blocks = row_blocks(n_unknowns)
        run_blocks(loops.add_element_values, blocks, nodes[batch], *both, *upper, conduction, storage)
        load += np.bincount(nodes[batch].ravel(), weights=own.load.ravel(), minlength=n_unknowns)
        volume += np.bincount(part[batch], weights=own.volume, minlength=len(volume))
    return _UpperRows(indptr, indices, part_of_slot, conduction, storage, load, volume)


def _linear_rows(mesh: TaggedMesh, order: int, n_unknowns: int, around: _Neighbours) -> _UpperRows:
    """Rows of linear elements, filled with their integrals at once."""
    nodes, part = around.nodes, around.part
    values, load = room((len(nodes), 7)), np.zeros(n_unknowns)
    bounds = np.linspace(0, len(nodes), INTEGRATION_CALLS + 1).astype(np.int64)
    given = (np.array(mesh.points), nodes, part, len(mesh.part_names), values)
    integrated = in_threads([partial(integrate_linear, low, high, *given) for low, high in pairwise(bounds)])
    inverted = sum(count for _, count in integrated)
    if inverted:
        raise MeshQualityError("mesh", f"{inverted} elements are inverted.", "Refine or optimise the mesh.")
    given = (nodes, *around.members, values, around.part_of_unknown, *around.joined, load)
    kinds = (np.int32, np.int16, np.float64, np.float64)
    rows = fill_rows(fill_linear_rows, n_unknowns, given, ENTRIES_OF_LINEAR, kinds)
    return _UpperRows(*rows, load, sum(volumes for volumes, _ in integrated))


def _find(one: NDArray[np.int64], other: NDArray[np.int64], upper: _UpperRows) -> NDArray[np.int32]:
    """Upper entries that couple pairs of nodes, in their shape; -1 where there is none."""
    slots = np.empty(one.shape, dtype=np.int32)
    pairs = unsigned(np.ascontiguousarray(one).ravel(), np.ascontiguousarray(other).ravel())
    rows = unsigned(upper.indptr, upper.indices)
    run_blocks(loops.find_pairs, row_blocks(one.size), *pairs, *rows, slots.reshape(-1))
    return slots
