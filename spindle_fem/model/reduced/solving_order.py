"""A mesh model in the order and form in which products and sums of its operators are fastest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from spindle_fem.model.matrices_on_pattern import MatricesOnPattern
from spindle_fem.model.reduced.mesh_model import MeshModel
from spindle_fem.model.thermal_model import MATRIX_FIELDS


def in_solving_order(full: MeshModel) -> MeshModel:
    """The model with unknowns renumbered for fast products, all operators on one pattern.

    Neighbours near each other, each material's together, lumped nodes last.
    """
    order = _order(full)
    place = np.empty_like(order)
    place[order] = np.arange(full.size)

    def turned(matrix: sparse.csr_array) -> sparse.csr_array:
        entries = matrix.tocoo()
        at = (place[entries.row].astype(np.int32), place[entries.col].astype(np.int32))
        return sparse.coo_array((entries.data, at), shape=matrix.shape).tocsr()

    def columns(rows: sparse.csr_array) -> sparse.csr_array:
        entries = rows.tocoo()
        at = (entries.row, place[entries.col].astype(np.int32))
        return sparse.coo_array((entries.data, at), shape=rows.shape).tocsr()

    matrices = [matrix for name in MATRIX_FIELDS for matrix in getattr(full, name)]
    together = MatricesOnPattern.of(turned(_pattern(matrices)), map(turned, matrices))
    changed, first = {}, 0
    for name in MATRIX_FIELDS:
        last = first + len(getattr(full, name))
        changed[name], first = together.part(first, last), last
    changed |= {name: columns(getattr(full, name)) for name in ("places", "probes", "probe_gradients")}
    if full.ring_shifts.shape[0]:
        changed["ring_shifts"] = columns(full.ring_shifts)
    if full.cell_area.size:
        changed["cell_load"] = columns(full.cell_load)
    if full.prolongation is not None:
        changed["prolongation"] = full.prolongation.tocsr()[order[: full.n_unknowns]]
    return replace(full, fluid_load=full.fluid_load[:, order], one=full.one[order], **changed)


def _order(full: MeshModel) -> NDArray[np.int64]:
    """Old number of every new one, (n,)."""
    n = full.n_unknowns
    volumes = [
        matrix
        for name, matrix in zip(full.coefficient_names, full.operators, strict=True)
        if name.startswith("conductivity.")
    ]
    pattern = sum(volumes[1:], volumes[0]).tocsr()[:n, :n]
    near = np.asarray(reverse_cuthill_mckee(pattern, symmetric_mode=True))
    owner = np.zeros(n, dtype=np.int64)
    for index, matrix in enumerate(volumes):
        owner[np.flatnonzero(np.diff(matrix.indptr)[:n])] = index
    return np.concatenate((near[np.argsort(owner[near], kind="stable")], np.arange(n, full.size)))


def _pattern(matrices: list[sparse.csr_array]) -> sparse.csr_array:
    """Entries that any of some matrices (n, n) has."""
    rows, columns = [], []
    for matrix in matrices:
        entries = matrix.tocoo()
        rows.append(entries.row.astype(np.int32, copy=False))
        columns.append(entries.col.astype(np.int32, copy=False))
    ones = np.ones(sum(map(len, rows)), dtype=bool)
    at = np.concatenate(rows), np.concatenate(columns)
    return sparse.coo_array((ones, at), shape=matrices[0].shape).tocsr()
