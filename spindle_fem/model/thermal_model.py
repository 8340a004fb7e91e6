"""One thermal model for the finite-element mesh, its projection on few unknowns and a lumped network.

``M dT/dt + K T = F`` with ``K = Σ c_i K_i`` and ``M = Σ m_i M_i``: every coefficient stays free.
A mesh holds its operators as sparse matrices, a projection or a network as dense stacks;
:func:`project` of one model is another of the same kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.cache import load_record, save_record
from spindle_fem.model.matrices_on_pattern import MatricesOnPattern, sum_of
from spindle_fem.parallel import in_threads

Array = NDArray[np.float64]
Matrix = Array | sparse.csr_array
# A tuple of sparse (n, n) matrices, or a dense (m, n, n) stack.
Matrices = Sequence[sparse.csr_array] | Array

FORMAT = "spindle-fem/thermal-model/1"
# Fields that hold one matrix (n, n) for each coefficient.
MATRIX_FIELDS = ("operators", "cell_film", "storage")
# Columns of a basis that are multiplied by a sparse matrix at a time.
COLUMNS_AT_ONCE = 32
# Relative rounding allowed at the ends of a coefficient's range.
RANGE_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalModel:
    """Named unit operators of a machine or network on ``n`` unknowns.

    Attributes
    ----------
    coefficient_names : tuple of str
        ``conductivity.<material>``, ``joint.<contact>``, ``film.<surface>``,
        ``gap.<gap>``, ``balls.<bearing>.inner``, ``balls.<bearing>.outer``;
        ``link.<link>`` of a network.
    operators : (n_c) matrices (n, n)
        ``K_i`` of unit coefficient: symmetric, positive semi-definite.
    fluid_names : tuple of str
        Coefficients that are films to a fluid.
    fluid_load : (n_f, n) ndarray
        ``K_i · 1``: what a fluid of 1 K puts in at unit coefficient.
    storage_names : tuple of str
        ``capacity.<material>`` [J/(m³·K)] and ``capacity.<bearing>.balls`` [J/K].
    storage : (n_s) matrices (n, n)
    place_names : tuple of str
        Volumes (``<part>``, ``<part>.<segment>``, ``<bearing>.inner_ring``), surfaces,
        ``<bearing>.balls``, seats (``<contact>@0``, ``@1``) and the neighbourhoods
        of point probes (``near.<probe>``, ``around.<probe>``).
    places : (n_p, n) matrix
        Mean over each place; its transpose is the load of 1 W spread over it.
    probe_names : tuple of str
        Point probes, then displacement sensors, which read micrometres.
    probes : (n_q, n) matrix
    one : (n,) ndarray
        The uniform field of 1 K: with it heat is conserved exactly.
    probe_gradients : (n_q, 2, n) ndarray, [1/m]
        Change of each reading with a displacement of the probe along r and
        along z; where sparse, the (2 n_q, n) rows of the same.
    probe_spins : (n_q,) ndarray, [µm s²]
        What a reading gains by rotation, for each (rad/s)²; empty where none does.
    ring_shifts : (4 n_bearings, n) matrix, [µm/K]
        What temperature does to the rings of every bearing, as ``SeatBodies.law`` takes it; empty where no
        elastic bodies carry them.
    cell_film : (n_cells) matrices (n, n), [m²]
        Unit film of each coolant cell.
    cell_load : (n_cells, n) matrix, [m²]
        ``∫ N dA`` over each cell's wall.
    cell_area : (n_starts, n_along) ndarray, [m²]
    cell_angle, cell_position : (n_along,) ndarray, [rad], [m]
    cell_is_port : (n_along,) bool ndarray
    gap_radii : mapping of gap to (float, float), [m]
        Mean radius of the turning side and of what faces it.
    ranges : mapping of coefficient to (float, float)
        Where the model was made and checked; coefficients without one are not limited.
    errors : mapping of str to float, [K]
        Largest error against the full model where it was checked, by what was compared.
    n_full : int
        Unknowns of the full model that it was projected from; 0 where it is that itself.
    nodes : (n, n_nodes) float32 ndarray
        Temperature of every node of the mesh from the unknowns; empty where not kept.
    mesh_numbers : mapping of str to float
        ``nodes``, ``elements``, ``min_quality``, where the nodes are kept.
    checked : tuple of str
        Keys of the designs that were solved in full to check it.
    digest : str
        Hash of all that made it.
    """

    coefficient_names: tuple[str, ...]
    operators: Matrices
    fluid_names: tuple[str, ...]
    fluid_load: Array
    storage_names: tuple[str, ...]
    storage: Matrices
    place_names: tuple[str, ...]
    places: Matrix
    probe_names: tuple[str, ...]
    probes: Matrix
    one: Array
    probe_gradients: Matrix = field(default_factory=lambda: np.zeros((0, 2, 0)))
    probe_spins: Array = field(default_factory=lambda: np.zeros(0))
    ring_shifts: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    cell_film: Matrices = field(default_factory=lambda: np.zeros((0, 0, 0)))
    cell_load: Matrix = field(default_factory=lambda: np.zeros((0, 0)))
    cell_area: Array = field(default_factory=lambda: np.zeros((1, 0)))
    cell_angle: Array = field(default_factory=lambda: np.zeros(0))
    cell_position: Array = field(default_factory=lambda: np.zeros(0))
    cell_is_port: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    contacts: tuple[str, ...] = ()
    gap_radii: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    errors: Mapping[str, float] = field(default_factory=dict)
    n_full: int = 0
    nodes: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.float32))
    mesh_numbers: Mapping[str, float] = field(default_factory=dict)
    mesh_digest: str = ""
    checked: tuple[str, ...] = ()
    digest: str = ""

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.one)

    def place(self, name: str) -> Array:
        """Mean over a place, and the load of 1 W spread over it, (n,)."""
        return self.place_rows([name])[0]

    def place_rows(self, names: Sequence[str]) -> Array:
        """Means over some places, (len(names), n)."""
        return _dense(self.places[[self.place_names.index(name) for name in names]])

    def conduction(self, coefficients: Mapping[str, float], channel_film: Array) -> Matrix:
        """``Σ c_i K_i`` with the channel's film by cell [W/(m²·K)]; the coolant counts as given."""
        values = [coefficients[name] for name in self.coefficient_names]
        total = _weighted(self.operators, values, self.size)
        if not len(self.cell_film):
            return total
        films = _weighted(self.cell_film, np.ravel(channel_film), self.size)
        return sum_of(total, films) if sparse.issparse(total) else total + films

    def capacity(self, volumetric: Mapping[str, float]) -> Matrix:
        """``Σ m_i M_i``, (n, n) [J/K]."""
        return _weighted(self.storage, [volumetric[name] for name in self.storage_names], self.size)

    def outside_range(self, coefficients: Mapping[str, float]) -> tuple[str, ...]:
        """Coefficients for which the model was not made."""
        return tuple(
            name
            for name, value in coefficients.items()
            if name in self.ranges
            and not self.ranges[name][0] * (1.0 - RANGE_ROUNDING)
            <= value
            <= self.ranges[name][1] * (1.0 + RANGE_ROUNDING)
        )

    def save(self, path: Path) -> None:
        """Write a dense model to an .npz file; readers never see half of it."""
        save_record(self, path, FORMAT)

    @classmethod
    def load(cls, path: Path) -> ThermalModel | None:
        """Read a model that :meth:`save` wrote; None if missing, of another version, or damaged."""
        found = load_record(path, FORMAT, cls)
        if found is None:
            return None
        for name in ("gap_radii", "ranges"):
            found[name] = {key: tuple(pair) for key, pair in found[name].items()}
        return cls(**found)


def project(model: ThermalModel, basis: Array, one: Array) -> ThermalModel:
    """Galerkin projection of a model: dense, with every name and coefficient of the model.

    Its unknowns ``u`` represent ``basis @ u``; every operator is ``Vᵀ K_i V``.

    Parameters
    ----------
    basis : (n, r) ndarray
    one : (r,) ndarray
        Coordinates of the uniform field, which the basis should hold.
    """
    size = basis.shape[1]
    own = {name: getattr(model, name) for name in ThermalModel.__slots__}
    own |= {name: _projected(getattr(model, name), basis) for name in MATRIX_FIELDS}
    own |= {
        "fluid_load": np.asarray(model.fluid_load @ basis).reshape(-1, size),
        "places": np.asarray(model.places @ basis),
        "probes": np.asarray(model.probes @ basis),
        "one": one,
        "probe_gradients": _dense(model.probe_gradients @ basis).reshape(-1, 2, size)
        if model.probe_gradients.shape[0]
        else np.zeros((0, 2, size)),
        "ring_shifts": _dense(model.ring_shifts @ basis)
        if model.ring_shifts.shape[0]
        else np.zeros((0, size)),
        "cell_load": np.asarray(model.cell_load @ basis) if model.cell_area.size else np.zeros((0, size)),
        "n_full": model.n_full or model.size,
        "nodes": (basis.T @ model.nodes).astype(np.float32) if model.nodes.size else model.nodes,
    }
    return ThermalModel(**own)


def _dense(matrix: Matrix) -> Array:
    return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix)


def _projected(matrices: Matrices, basis: Array) -> Array:
    """``Vᵀ K V`` of each matrix, (m, r, r)."""
    if isinstance(matrices, np.ndarray):
        found = np.einsum("ra,nrs,sb->nab", basis, matrices, basis, optimize=True) if len(matrices) else None
    else:
        jobs = [partial(_projected_sparse, matrices, index, basis) for index in range(len(matrices))]
        found = np.array(in_threads(jobs))
    if found is None or not len(found):
        return np.zeros((0, basis.shape[1], basis.shape[1]))
    return 0.5 * (found + found.transpose(0, 2, 1))


def _projected_sparse(matrices: Sequence[sparse.csr_array], index: int, basis: Array) -> Array:
    """``Vᵀ K V``; most operators live on a surface or in a material, and only its rows are touched."""
    matrix = matrices[index]
    own = np.flatnonzero(np.diff(matrix.indptr))
    if len(own) and own[-1] - own[0] + 1 == len(own):
        together = slice(int(own[0]), int(own[-1]) + 1)
        rows, matrix = basis[together], matrix[together, together]
    elif 2 * len(own) > matrix.shape[0]:
        rows = basis
    else:
        rows, matrix = basis[own], matrix[own][:, own]
    # images of all columns at once would be as large as the basis
    parts = [slice(first, first + COLUMNS_AT_ONCE) for first in range(0, basis.shape[1], COLUMNS_AT_ONCE)]
    return np.hstack([rows.T @ (matrix @ np.ascontiguousarray(rows[:, part])) for part in parts])


def _weighted(matrices: Matrices, weights: Sequence[float] | Array, size: int) -> Matrix:
    """Weighted sum; of sparse matrices by one concatenation, cheaper than adding one after the other."""
    if isinstance(matrices, np.ndarray):
        return np.tensordot(weights, matrices, axes=1) if len(matrices) else np.zeros((size, size))
    if isinstance(matrices, MatricesOnPattern):
        return matrices.weighted(weights)
    rows, columns, values = [], [], []
    for matrix, weight in zip(matrices, weights, strict=True):
        if weight != 0.0:
            entries = matrix.tocoo()
            rows.append(entries.row.astype(np.int32, copy=False))
            columns.append(entries.col.astype(np.int32, copy=False))
            values.append(weight * entries.data)
    if not rows:
        return sparse.csr_array((size, size))
    joined = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.coo_array(joined, shape=(size, size)).tocsr()
