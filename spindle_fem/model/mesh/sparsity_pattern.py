"""One symmetric sparsity pattern that every operator shares.

Operators are summed as arrays of the upper triangle's entries, and only the
sum is expanded to a full matrix, so re-summing coefficients costs a few
passes over memory and no sorting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.threads import row_blocks, run_blocks, use_compiled


@dataclass(frozen=True, slots=True)
class SymmetricPattern:
    """Positions of the non-zero entries of a symmetric matrix.

    Attributes
    ----------
    size : int
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
        if use_compiled(self.size):
            from spindle_fem.model.mesh.kernels.assembly_loops import gather

            data = room(len(self.indices))
            run_blocks(gather, row_blocks(len(data)), upper, self.upper_of_full, data)
        else:
            data = upper[self.upper_of_full]
        matrix = sparse.csr_array((data, self.indices, self.indptr), shape=(self.size, self.size), copy=False)
        matrix.has_canonical_format = True
        return matrix


def build_pattern(
    size: int, groups: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]]
) -> tuple[SymmetricPattern, list[NDArray[np.int32]]]:
    """Pattern that holds every (row, column) of all groups.

    Parameters
    ----------
    size : int
    groups : sequence of (rows, columns)
        Arrays of equal shape; (i, j) and (j, i) are the same entry.

    Returns
    -------
    pattern : SymmetricPattern
    slots : list of int32 ndarray
        For each group, the upper entry of each of its pairs, in its shape.
    """
    keys = np.concatenate(
        [
            (np.minimum(rows, columns) * np.int64(size) + np.maximum(rows, columns)).ravel()
            for rows, columns in groups
        ]
    )
    order = np.argsort(keys)
    ordered = keys[order]
    is_new = np.empty(len(keys), dtype=bool)
    is_new[:1] = True
    np.not_equal(ordered[1:], ordered[:-1], out=is_new[1:])
    slot = np.empty(len(keys), dtype=np.int32)
    slot[order] = np.cumsum(is_new, dtype=np.int32) - 1
    unique = ordered[is_new]
    rows, columns = np.divmod(unique, size)
    numbers = np.arange(1, len(unique) + 1, dtype=np.int32)
    indptr = np.searchsorted(rows, np.arange(size + 1)).astype(np.int32)
    upper = sparse.csr_array((numbers, columns.astype(np.int32), indptr), shape=(size, size))
    full = (upper + sparse.triu(upper, k=1, format="csr").T.tocsr()).tocsr()
    full.sort_indices()
    pattern = SymmetricPattern(
        size,
        len(unique),
        full.indptr.astype(np.int32, copy=False),
        full.indices.astype(np.int32, copy=False),
        full.data - 1,
    )
    bounds = np.cumsum([rows.size for rows, _ in groups])[:-1]
    slots = [part.reshape(rows.shape) for part, (rows, _) in zip(np.split(slot, bounds), groups, strict=True)]
    return pattern, slots
