"""The integrals of a mesh on one sparsity pattern: in numpy, or by compiled loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import MeshQualityError, MeshTagError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import (
    integrate_circumferential,
    integrate_elements,
    is_straight,
    upper_pairs,
)
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.sparsity_pattern import SymmetricPattern, build_pattern
from spindle_fem.model.mesh.threads import (
    fill_rows,
    row_blocks,
    run_blocks,
    unsigned,
    use_compiled,
)
from spindle_fem.parallel import in_threads

# Elements integrated at once where the compiled loops do not integrate themselves.
BATCH = 1 << 16
# Calls that straight elements are divided into, so that threads end together.
INTEGRATION_CALLS = 8
# First guesses of the upper entries a row, with room for the last rows; wrong ones only cost time.
ENTRIES_OF_LINEAR = 9.0
ENTRIES_OF_QUADRATIC = 17.0


@dataclass(frozen=True, slots=True)
class MeshIntegrals:
    """Sums over all elements, on the entries of a pattern.

    Attributes
    ----------
    pattern : SymmetricPattern
    part_of_unknown : (n_unknowns,) int32 ndarray
    part_of_slot : (n_upper,) int16 ndarray
        -1 where only a joint couples.
    conduction, storage : (n_upper,) ndarray, [m], [m³]
    circumferential : (n_upper,) ndarray or None, [m]
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
    circumferential: NDArray[np.float64] | None
    load: NDArray[np.float64]
    part_volume: NDArray[np.float64]
    facet_slots: NDArray[np.int32]
    cross_slots: list[NDArray[np.int32]]


def integrate_mesh(
    mesh: TaggedMesh,
    order: int,
    n_unknowns: int,
    facet_nodes: NDArray[np.int64],
    joint_sides: list[tuple[slice, slice]],
    circumferential_parts: list[int],
) -> MeshIntegrals:
    """Integrate all elements of a mesh and find where facets and joints couple unknowns.

    Parameters
    ----------
    mesh : TaggedMesh
    order : int
    n_unknowns : int
    facet_nodes : (n_facets, n) int ndarray
    joint_sides : list of (slice, slice)
        Rows of both sides in ``facet_nodes``.
    circumferential_parts : list of int

    Raises
    ------
    MeshQualityError
        Inverted elements.
    MeshTagError
        A node of two parts or of none, a facet of no element.
    """
    make = _compiled if use_compiled(n_unknowns) else _in_numpy
    return make(mesh, order, n_unknowns, facet_nodes, joint_sides, circumferential_parts)


def _facet_pairs(facet_nodes: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows, columns = upper_pairs(facet_nodes.shape[1])
    return facet_nodes[:, rows], facet_nodes[:, columns]


def _cross_pairs(
    facet_nodes: NDArray[np.int64], sides: tuple[slice, slice]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return np.broadcast_arrays(facet_nodes[sides[0]][:, :, None], facet_nodes[sides[1]][:, None, :])


def _require_parts(part_of_unknown: NDArray[np.int32], shared: bool) -> None:
    if shared:
        raise MeshTagError(
            "mesh", "two parts share a node.", "Parts need nodes of their own, tied by joints."
        )
    loose = int(np.sum(part_of_unknown < 0))
    if loose:
        raise MeshTagError("mesh", f"{loose} nodes belong to no element.", "Drop unused nodes.")


def _require_facets(inside: bool) -> None:
    if not inside:
        raise MeshTagError("mesh", "a tagged triangle is no facet of any element.")


def _require_upright(inverted: int) -> None:
    if inverted:
        raise MeshQualityError("mesh", f"{inverted} elements are inverted.", "Refine or optimise the mesh.")


# -------------------------------------------------------------------- in numpy
def _in_numpy(
    mesh: TaggedMesh,
    order: int,
    n_unknowns: int,
    facet_nodes: NDArray[np.int64],
    joint_sides: list[tuple[slice, slice]],
    circumferential_parts: list[int],
) -> MeshIntegrals:
    element_nodes = mesh.tetrahedra[:, : 4 if order == 1 else 10].astype(np.int64)
    part = np.asarray(mesh.part_of_element, dtype=np.int32)
    part_of_unknown = np.full(n_unknowns, -1, dtype=np.int32)
    part_of_unknown[element_nodes] = part[:, None]
    _require_parts(part_of_unknown, bool(np.any(part_of_unknown[element_nodes] != part[:, None])))
    integrals = integrate_elements(mesh.points, mesh.tetrahedra, order)
    rows, columns = upper_pairs(element_nodes.shape[1])
    groups = [(element_nodes[:, rows], element_nodes[:, columns]), _facet_pairs(facet_nodes)]
    groups += [_cross_pairs(facet_nodes, sides) for sides in joint_sides]
    pattern, (element_slots, facet_slots, *cross_slots) = build_pattern(n_unknowns, groups)
    part_of_slot = np.full(pattern.n_upper, -1, dtype=np.int16)
    part_of_slot[element_slots] = part[:, None]
    _require_facets(not np.any(part_of_slot[facet_slots] < 0))
    circumferential = None
    if circumferential_parts:
        chosen = np.flatnonzero(np.isin(part, circumferential_parts))
        values = integrate_circumferential(mesh.points, mesh.tetrahedra[chosen], order)
        circumferential = _sum_into(element_slots[chosen], values, pattern.n_upper)
    return MeshIntegrals(
        pattern,
        part_of_unknown,
        part_of_slot,
        _sum_into(element_slots, integrals.conduction, pattern.n_upper),
        _sum_into(element_slots, integrals.storage, pattern.n_upper),
        circumferential,
        _sum_into(element_nodes, integrals.load, n_unknowns),
        np.bincount(part, weights=integrals.volume, minlength=len(mesh.part_names)),
        facet_slots,
        cross_slots,
    )


def _sum_into(slots: NDArray, values: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    return np.bincount(slots.ravel(), weights=values.ravel(), minlength=size)


# -------------------------------------------------------------------- compiled
def _compiled(
    mesh: TaggedMesh,
    order: int,
    n_unknowns: int,
    facet_nodes: NDArray[np.int64],
    joint_sides: list[tuple[slice, slice]],
    circumferential_parts: list[int],
) -> MeshIntegrals:
    from spindle_fem.model.mesh.kernels import assembly_loops as compiled
    from spindle_fem.model.mesh.kernels import facet_loops as compiled_facets

    tetrahedra = mesh.tetrahedra
    nodes = np.ascontiguousarray(tetrahedra[:, : 4 if order == 1 else 10], dtype=np.int32).view(np.uint32)
    part = np.asarray(mesh.part_of_element, dtype=np.int32)
    small_nodes = facet_nodes.astype(np.int32).view(np.uint32)
    one, other = (
        (_facets_of(small_nodes, sides) for sides in zip(*joint_sides, strict=True))
        if joint_sides
        else (small_nodes[:0], small_nodes[:0])
    )
    around = room(nodes.size, np.int32)
    straight = is_straight(mesh.points, tetrahedra) if order == 1 else np.zeros(len(tetrahedra), dtype=bool)
    values, integrate = _straight_elements(mesh, nodes, part, straight)
    starts, (part_of_unknown, shared), joined, *integrated = in_threads(
        [
            partial(compiled.elements_of_nodes, nodes, n_unknowns, around),
            partial(compiled.part_of_nodes, nodes, part, n_unknowns),
            partial(compiled_facets.upper_crossings, one, other, n_unknowns),
            *integrate,
        ]
    )
    _require_parts(part_of_unknown, bool(shared))
    members, joined = unsigned(starts, around), unsigned(*joined)
    load, volume = np.zeros(n_unknowns), np.zeros(len(mesh.part_names))
    if straight.any():
        _require_upright(sum(inverted for _, inverted in integrated))
        volume = sum(volumes for volumes, _ in integrated)
        given = (nodes, *members, values, part_of_unknown, *joined, load)
        kinds = (np.int32, np.int16, np.float64, np.float64)
        indptr, indices, part_of_slot, conduction, storage = fill_rows(
            compiled.fill_linear_rows, n_unknowns, given, ENTRIES_OF_LINEAR, kinds
        )
        del given
    else:
        given = (nodes, *members, *joined)
        guess = ENTRIES_OF_LINEAR if order == 1 else ENTRIES_OF_QUADRATIC
        indptr, indices = fill_rows(compiled.fill_upper, n_unknowns, given, guess, (np.int32,))
        # parts share no node, so what couples two nodes of one part is an element
        part_of_row = np.repeat(part_of_unknown.astype(np.int16), np.diff(indptr))
        part_of_slot = np.where(part_of_row == part_of_unknown[indices], part_of_row, np.int16(-1))
        conduction, storage = np.zeros(len(indices)), np.zeros(len(indices))
    del members, around, starts, values, integrate
    upper = unsigned(indptr, indices)
    blocks = row_blocks(n_unknowns)
    rest = np.flatnonzero(~straight)
    for start in range(0, len(rest), BATCH):
        chosen = rest[start : start + BATCH]
        integrals = integrate_elements(mesh.points, tetrahedra[chosen], order)
        both = (integrals.conduction, integrals.storage)
        run_blocks(compiled.add_element_values, blocks, nodes[chosen], *both, *upper, conduction, storage)
        load += np.bincount(nodes[chosen].ravel(), weights=integrals.load.ravel(), minlength=n_unknowns)
        volume += np.bincount(part[chosen], weights=integrals.volume, minlength=len(volume))
    starts = compiled.full_starts(*upper)
    full = room(int(starts[-1]), np.int32), room(int(starts[-1]), np.int32)
    run_blocks(compiled.expand_upper, blocks, *upper, starts, *full)
    pattern = SymmetricPattern(n_unknowns, len(indices), starts, *full)
    circumferential = None
    if circumferential_parts:
        circumferential, unused = np.zeros((2, pattern.n_upper))
        own = np.flatnonzero(np.isin(part, circumferential_parts))
        for start in range(0, len(own), BATCH):
            chosen = own[start : start + BATCH]
            values = integrate_circumferential(mesh.points, tetrahedra[chosen], order)
            run_blocks(
                compiled.add_element_values,
                blocks,
                nodes[chosen],
                values,
                values,
                *upper,
                circumferential,
                unused,
            )

    facet_slots = np.empty((len(facet_nodes), len(upper_pairs(facet_nodes.shape[1])[0])), dtype=np.int32)
    given = (small_nodes, *upper, part_of_slot, facet_slots)
    _require_facets(not sum(run_blocks(compiled_facets.find_facets, row_blocks(len(facet_nodes)), *given)))
    slots = np.empty((*one.shape, one.shape[1]), dtype=np.int32)
    run_blocks(compiled_facets.find_crossings, row_blocks(len(one)), one, other, *upper, slots)
    ends = np.cumsum([side.stop - side.start for side, _ in joint_sides], dtype=int)
    cross_slots = np.split(slots, ends[:-1]) if joint_sides else []
    return MeshIntegrals(
        pattern,
        part_of_unknown,
        part_of_slot,
        conduction,
        storage,
        circumferential,
        load,
        volume,
        facet_slots,
        cross_slots,
    )


def _facets_of(nodes: NDArray[np.uint32], rows: Sequence[slice]) -> NDArray[np.uint32]:
    return np.concatenate([nodes[each] for each in rows])


def _straight_elements(
    mesh: TaggedMesh, nodes: NDArray[np.uint32], part: NDArray[np.int32], straight: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], list[Callable]]:
    """Room for what ``integrate_linear`` gives, zeros for elements that are not straight, and its calls."""
    from spindle_fem.model.mesh.kernels.assembly_loops import integrate_linear

    if not straight.any():
        return np.zeros((0, 7)), []
    values = room((len(nodes), 7))
    chosen = np.flatnonzero(straight).astype(np.int32)
    values[~straight] = 0.0
    bounds = np.linspace(0, len(chosen), INTEGRATION_CALLS + 1).astype(np.int64)
    given = (mesh.points, nodes, unsigned(chosen)[0], part, len(mesh.part_names), values)
    return values, [partial(integrate_linear, low, high, *given) for low, high in pairwise(bounds)]
