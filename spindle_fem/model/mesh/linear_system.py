"""The linear equations of a problem, with lumped nodes and tied joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels.assembly_loops import join_rows, merge_rows
from spindle_fem.model.mesh.sparsity_pattern import grouped
from spindle_fem.model.mesh.threads import fill_rows, row_blocks, run_blocks, unsigned


@dataclass(frozen=True, slots=True)
class ThermalSystem:
    """Equations ``[K −B; −Bᵀ D] [T; T_l] = [f; f_l]`` of a problem.

    Temperatures count from ``reference_temperature``, so that round-off is
    relative to the rise and not to absolute zero.

    Attributes
    ----------
    matrix : (n, n) csr_array or None, [W/K]
        None where the full matrix alone is kept.
    load : (n,) ndarray, [W]
    exchange : (n, m) csc_array, [W/K]
        Coupling of unknowns with lumped nodes.
    lumped_matrix : (m, m) ndarray, [W/K]
    lumped_load : (m,) ndarray, [W]
    reference_temperature : float, [K]
    tie : (n, n_tied) csr_array or None
        Unknowns from those left when perfect joints tie node pairs.
    prolongation : (n, n_corners) csr_array or None
        From linear to quadratic temperatures, for multigrid.
    """

    matrix: sparse.csr_array | None
    load: NDArray[np.float64]
    exchange: sparse.csc_array
    lumped_matrix: NDArray[np.float64]
    lumped_load: NDArray[np.float64]
    reference_temperature: float
    tie: sparse.csr_array | None
    prolongation: sparse.csr_array | None

    @property
    def n_lumped(self) -> int:
        """Number of lumped nodes."""
        return len(self.lumped_load)

    def full_matrix(self) -> sparse.csr_array:
        """``[K −B; −Bᵀ D]`` as one sparse matrix."""
        if not self.n_lumped:
            return self.matrix
        return _bordered(self.matrix, -sparse.csr_array(self.exchange), self.lumped_matrix)

    def beside_full(self, matrix: sparse.csr_array, corner: NDArray[np.float64]) -> sparse.csr_array:
        """``[A 0; 0 C]`` on the pattern of the full matrix, for sums with it."""
        if not self.n_lumped:
            return matrix
        border = sparse.csr_array(self.exchange)
        border.data = np.zeros_like(border.data)
        return _bordered(matrix, border, corner)

    def full_load(self) -> NDArray[np.float64]:
        """``[f; f_l]``."""
        return np.concatenate((self.load, self.lumped_load))

    def tied(self) -> ThermalSystem:
        """System with perfect joints eliminated."""
        if self.tie is None:
            return self
        tie = self.tie
        return ThermalSystem(
            merged(self.matrix, tie),
            tie.T @ self.load,
            (tie.T @ self.exchange).tocsc(),
            self.lumped_matrix,
            self.lumped_load,
            self.reference_temperature,
            None,
            _tied_prolongation(tie, self.prolongation),
        )


def _bordered(
    matrix: sparse.csr_array, border: sparse.csr_array, corner: NDArray[np.float64]
) -> sparse.csr_array:
    """``[A B; Bᵀ C]`` of compressed rows, without sorting A again.

    Parameters
    ----------
    matrix : (n, n) csr_array
    border : (n, m) csr_array
    corner : (m, m) ndarray
    """
    n, m = border.shape
    below = rows_below(border, corner)
    ends = matrix.indptr + border.indptr
    indptr = np.concatenate((ends, ends[-1] + below.indptr[1:])).astype(np.int32)
    indices, data = room(int(indptr[-1]), np.int32), room(int(indptr[-1]))
    indices[ends[-1] :], data[ends[-1] :] = below.indices, below.data
    rows = [(*unsigned(part.indptr, part.indices), part.data) for part in (matrix, border)]
    run_blocks(join_rows, row_blocks(n), *rows[0], *rows[1], 0, n, *unsigned(indptr, indices), data)
    return sparse.csr_array((data, indices, indptr), shape=(n + m, n + m))


def rows_below(border: sparse.csr_array, corner: NDArray[np.float64]) -> sparse.csr_array:
    """The last rows ``[Bᵀ C]`` of a bordered matrix, (m, n + m)."""
    m = border.shape[1]
    # every entry of the corner, so that its pattern is the same whatever is zero
    square = sparse.csr_array(
        (np.ravel(corner), np.tile(np.arange(m), m), np.arange(0, m * m + 1, m)), shape=(m, m)
    )
    return sparse.csr_array(sparse.hstack((border.T, square)))


def merged(matrix: sparse.csr_array, tie: sparse.csr_array) -> sparse.csr_array:
    """``tieᵀ A tie``, for a tie with a single one in each row.

    Parameters
    ----------
    matrix : (n, n) csr_array
    tie : (n, n_tied) csr_array
    """
    size = tie.shape[1]
    (label,) = unsigned(tie.indices)
    given = (
        *unsigned(*grouped(tie.indices, size)),
        label,
        *unsigned(matrix.indptr, matrix.indices),
        matrix.data,
    )
    indptr, columns, values = fill_rows(merge_rows, size, given, matrix.nnz / size)
    answer = sparse.csr_array((values, columns, indptr), shape=(size, size))
    answer.has_canonical_format = True
    return answer


def _tied_prolongation(
    tie: sparse.csr_array, prolongation: sparse.csr_array | None
) -> sparse.csr_array | None:
    """Prolongation between tied unknowns: corners tie with corners, middles with middles."""
    if prolongation is None:
        return None
    n_corners = prolongation.shape[1]
    labels, group = np.unique(tie.indices[:n_corners], return_inverse=True)
    tie_corners = sparse.csr_array(
        (np.ones(n_corners), (np.arange(n_corners), group)), shape=(n_corners, len(labels))
    )
    first = np.unique(tie.indices, return_index=True)[1]
    return (prolongation[first] @ tie_corners).tocsr()
