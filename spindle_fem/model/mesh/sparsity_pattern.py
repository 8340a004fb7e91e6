"""One symmetric sparsity pattern that every operator shares.

Operators are summed as arrays of the upper triangle's entries, and only the
sum is expanded to a full matrix, so re-summing coefficients costs a few
passes over memory and no sorting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels.assembly_loops import join_rows
from spindle_fem.model.mesh.threads import row_blocks, run_blocks, unsigned


@dataclass(frozen=True, slots=True)
class SymmetricPattern:
    """Positions of the non-zero entries of a symmetric matrix.

    Attributes
    ----------
    n_upper : int
        Entries on and above the diagonal.
    indptr, indices : ndarray
        Full compressed rows, columns sorted.
    upper_of_full : (nnz,) int32 ndarray
        The upper entry that each full entry equals.
    """

    size: int
    n_upper: int
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    upper_of_full: NDArray[np.int32]

    def expand(self, upper: NDArray[np.float64]) -> sparse.csr_array:
        """Full matrix from the entries of the upper triangle.

        Parameters
        ----------
        upper : (n_upper,) ndarray
        """
        data = room(len(self.indices))
        np.take(upper, self.upper_of_full, out=data, mode="clip")
        matrix = sparse.csr_array((data, self.indices, self.indptr), shape=(self.size, self.size), copy=False)
        matrix.has_canonical_format = True
        return matrix


def expand_pattern(indptr: NDArray[np.int32], indices: NDArray[np.int32]) -> SymmetricPattern:
    """Full pattern of compressed rows of an upper triangle, each from its diagonal on and sorted.

    A full row is a column of the upper triangle, down to the diagonal, and then the rest of its row.
    """
    size, n_upper = len(indptr) - 1, len(indices)
    numbers = np.arange(n_upper, dtype=np.int32)
    left = sparse.csr_array((numbers, indices, indptr), shape=(size, size)).tocsc()
    starts = (left.indptr + indptr - np.arange(size + 1)).astype(np.int32)
    columns, slots = room(int(starts[-1]), np.int32), room(int(starts[-1]), np.int32)
    rows = (*unsigned(left.indptr, left.indices), left.data, *unsigned(indptr, indices), numbers)
    run_blocks(join_rows, row_blocks(size), *rows, 1, 0, *unsigned(starts, columns), slots)
    return SymmetricPattern(size, n_upper, starts, columns, slots)


def grouped(labels: NDArray[np.integer], size: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Positions of each label below ``size``: where each label's begin, (size + 1,), and the positions.

    >>> starts, places = grouped(np.array([2, 0, 2]), 3)
    >>> starts.tolist(), places.tolist()
    ([0, 1, 1, 3], [1, 0, 2])
    """
    count = labels.size
    ones, starts = np.ones(count, dtype=np.int8), np.arange(count + 1, dtype=np.int32)
    labels = labels.ravel().astype(np.int32, copy=False)
    columns = sparse.csr_array((ones, labels, starts), shape=(count, size)).tocsc()
    return columns.indptr, columns.indices
