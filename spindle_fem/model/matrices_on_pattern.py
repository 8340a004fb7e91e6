"""Sparse matrices whose entries are entries of one pattern: a weighted sum of them sorts nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MatricesOnPattern(Sequence[sparse.csr_array]):
    """Square matrices (n, n), each given by its own entries of a pattern that all share.

    Attributes
    ----------
    indptr, indices : (n + 1,), (nnz,) int32 ndarray
        Compressed rows of the pattern, columns sorted.
    starts : (m + 1,) int64 ndarray
        Where each matrix begins in the next two, and the last one ends.
    places : int32 ndarray
        Entry of the pattern, ascending within a matrix.
    values : float64 ndarray
    """

    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    starts: NDArray[np.int64]
    places: NDArray[np.int32]
    values: Array

    @classmethod
    def of(cls, pattern: sparse.csr_array, matrices: Iterator[sparse.csr_array]) -> MatricesOnPattern:
        """Matrices, rows sorted and no entry twice, whose entries a pattern of the same kind holds."""
        known = _keys(pattern)
        places, values = [], []
        for matrix in matrices:
            places.append(np.searchsorted(known, _keys(matrix)).astype(np.int32))
            values.append(matrix.data)
        starts = np.cumsum([0, *map(len, values)])
        indptr, indices = (item.astype(np.int32, copy=False) for item in (pattern.indptr, pattern.indices))
        none = np.empty(0)
        joined = np.concatenate([none.astype(np.int32), *places]), np.concatenate([none, *values])
        return cls(indptr, indices, starts, *joined)

    def __len__(self) -> int:
        """Number of matrices."""
        return len(self.starts) - 1

    def __getitem__(self, index: int) -> sparse.csr_array:
        """One of them by itself."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        own = slice(*self.starts[index : index + 2])
        places, size = self.places[own], len(self.indptr) - 1
        rows = np.searchsorted(self.indptr, places, side="right") - 1
        indptr = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=size)))).astype(np.int32)
        return _canonical(self.values[own], self.indices[places], indptr)

    def part(self, first: int, last: int) -> MatricesOnPattern:
        """Those from ``first`` up to before ``last``."""
        return MatricesOnPattern(
            self.indptr, self.indices, self.starts[first : last + 1], self.places, self.values
        )

    def weighted(self, weights: Sequence[float] | Array) -> sparse.csr_array:
        """Weighted sum, on the whole pattern."""
        data = np.zeros(len(self.indices))
        for weight, first, last in zip(weights, self.starts[:-1], self.starts[1:], strict=True):
            if weight != 0.0:
                data[self.places[first:last]] += weight * self.values[first:last]
        return _canonical(data, self.indices, self.indptr)


def sum_of(one: sparse.csr_array, two: sparse.csr_array, share: float = 1.0) -> sparse.csr_array:
    """``one + share · two``; without a search where both are on one pattern.

    >>> unit = sparse.eye_array(2, format="csr")
    >>> matrices = MatricesOnPattern.of(unit, iter([unit]))
    >>> sum_of(matrices.weighted([1.0]), matrices.weighted([2.0]), 0.5).toarray().tolist()
    [[2.0, 0.0], [0.0, 2.0]]
    """
    share = one.dtype.type(share)
    if _same(one.indices, two.indices) and _same(one.indptr, two.indptr):
        return _canonical(one.data + share * two.data, one.indices, one.indptr)
    return (one + share * two).tocsr()


def _same(one: NDArray, two: NDArray) -> bool:
    """Whether two arrays are one piece of memory, as those of matrices made on one pattern are."""
    return one.__array_interface__["data"] == two.__array_interface__["data"] and one.shape == two.shape


def _canonical(data: NDArray, indices: NDArray, indptr: NDArray) -> sparse.csr_array:
    size = len(indptr) - 1
    matrix = sparse.csr_array((data, indices, indptr), shape=(size, size), copy=False)
    matrix.has_canonical_format = True
    return matrix


def _keys(matrix: sparse.csr_array) -> NDArray[np.int64]:
    """A number for each entry, ascending."""
    rows = np.repeat(np.arange(matrix.shape[0], dtype=np.int64), np.diff(matrix.indptr))
    return rows * matrix.shape[1] + matrix.indices
