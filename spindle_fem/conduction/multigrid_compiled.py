"""The multigrid cycle in compiled loops: Gauss-Seidel sweeps, single precision, rows shared by threads.

A forward sweep before and a backward sweep after each coarser correction make
the cycle symmetric. The first starts from zero and needs the left half of each
row, the residual after it the right half, so a level costs two products where
polynomial smoothing costs four. Threads sweep over connected parts of the rows and
take what other parts had before the sweep; the cycle is then still symmetric,
and the same on every run with as many threads.

Sources: Vanek, Mandel & Brezina (1996), Computing 56, 179-196 (smoothed
aggregation); Baker, Falgout, Kolev & Yang (2011), SIAM J. Sci. Comput. 33,
2864-2887 (sweeps in blocks).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from spindle_fem.conduction import compiled_solver as compiled
from spindle_fem.conduction.threads import fill_rows, row_blocks, run_blocks, unsigned

COARSEST_SIZE = 400
MAXIMUM_LEVELS = 12
# Damping of the step that smooths the aggregates' constants.
DAMPING = 0.8
PRECISION = np.float32
# First guesses of how long rows are; wrong ones only cost time.
ENTRIES_OF_PROLONGATION = 5.0
ENTRIES_OF_PRODUCT = 9.0
ENTRIES_OF_COARSE = 45.0

Rows = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray]


@dataclass(frozen=True, slots=True)
class SweptLevel:
    """One level.

    Attributes
    ----------
    starts, columns, values : ndarray
        The matrix's compressed rows, columns rising.
    diagonal : (n,) uint32 ndarray
        Place of each row's diagonal.
    inverse : (n,) ndarray
        Inverse of the diagonal.
    prolongation, restriction : compressed rows
    part_inverse : (n,) ndarray
        The same where threads sweep apart: with half of the couplings between
        their parts.
    part, part_rows, part_bounds : ndarray
        Part of each row, rows by part, and the range of each part among them;
        one part when one thread sweeps.
    blocks, coarse_blocks : ndarray
        Ranges of rows of this level and the next, for products.
    """

    starts: NDArray[np.uint32]
    columns: NDArray[np.uint32]
    values: NDArray
    diagonal: NDArray[np.uint32]
    inverse: NDArray
    prolongation: Rows
    restriction: Rows
    part_inverse: NDArray
    part: NDArray[np.uint8]
    part_rows: NDArray[np.uint32]
    part_bounds: NDArray[np.int64]
    blocks: NDArray[np.int64]
    coarse_blocks: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SweptHierarchy:
    """Levels from fine to coarse and the factor of the coarsest matrix."""

    levels: tuple[SweptLevel, ...]
    coarsest: tuple[NDArray[np.float64], bool]

    def cycle(self, residual: NDArray[np.float64]) -> NDArray[np.float64]:
        """One V-cycle: approximate solution of ``K x = residual``.

        Parameters
        ----------
        residual : (n,) or (n, m) float64 ndarray
        """
        if residual.ndim == 2:
            scales = np.abs(residual).max(axis=0, initial=0.0)
            scales[scales == 0.0] = 1.0
            return scales * self._descend_many(0, (residual / scales).astype(PRECISION, order="C"))
        # scaled, so that small residuals stay inside the range of single precision
        scale = float(np.linalg.norm(residual)) / np.sqrt(len(residual)) or 1.0
        blocks = row_blocks(len(residual))
        single = np.empty(len(residual), dtype=PRECISION)
        run_blocks(compiled.scaled_copy, blocks, 1.0 / scale, residual, single)
        answer = np.empty(len(residual))
        run_blocks(compiled.scaled_copy, blocks, scale, self._descend(0, single), answer)
        return answer

    def _descend_many(self, depth: int, residual: NDArray) -> NDArray:
        """The cycle for several columns, in one thread."""
        if depth == len(self.levels):
            return cho_solve(self.coarsest, residual.astype(np.float64)).astype(PRECISION)
        level = self.levels[depth]
        matrix = (level.starts, level.columns, level.values)
        unknowns, left = np.empty_like(residual), np.empty_like(residual)
        compiled.forward_many(*matrix, level.diagonal, level.inverse, residual, unknowns)
        compiled.residual_many(*matrix, level.diagonal, unknowns, left)
        coarse = np.zeros((len(level.restriction[0]) - 1, residual.shape[1]), dtype=PRECISION)
        compiled.add_product_many(*level.restriction, left, coarse)
        correction = np.ascontiguousarray(self._descend_many(depth + 1, coarse))
        compiled.add_product_many(*level.prolongation, correction, unknowns)
        compiled.backward_many(*matrix, level.inverse, residual, unknowns)
        return unknowns

    def _descend(self, depth: int, residual: NDArray) -> NDArray:
        if depth == len(self.levels):
            return cho_solve(self.coarsest, residual.astype(np.float64)).astype(PRECISION)
        level = self.levels[depth]
        matrix = (level.starts, level.columns, level.values)
        unknowns, left = np.empty_like(residual), np.empty_like(residual)
        split = len(level.part_bounds) > 2
        inverse = level.part_inverse if split else level.inverse
        where = (level.part_bounds, level.part_rows, level.part) if split else (level.part_bounds,)
        run_blocks(
            compiled.forward_part if split else compiled.forward_from_zero,
            *where, *matrix, level.diagonal, inverse, residual, unknowns,
        )  # fmt: skip
        run_blocks(
            compiled.residual_of_part if split else compiled.residual_after_forward,
            *where, *matrix, level.diagonal, unknowns, left,
        )  # fmt: skip
        coarse = np.empty(len(level.restriction[0]) - 1, dtype=PRECISION)
        run_blocks(compiled.multiply, level.coarse_blocks, *level.restriction, left, coarse)
        correction = self._descend(depth + 1, coarse)
        run_blocks(compiled.add_product, level.blocks, *level.prolongation, correction, unknowns)
        if split:
            left[:] = unknowns
            run_blocks(
                compiled.backward_part, *where, *matrix, inverse, residual, left, unknowns
            )  # fmt: skip
        else:
            run_blocks(compiled.backward, *where, *matrix, inverse, residual, unknowns)
        return unknowns


def build_swept_hierarchy(matrix: sparse.csr_array, prolongation: sparse.csr_array | None) -> SweptHierarchy:
    """Hierarchy of a symmetric positive definite matrix with sorted rows.

    Parameters
    ----------
    matrix : (n, n) csr_array
    prolongation : (n, n_corners) csr_array or None
        From linear to quadratic temperatures; None when they are linear.
    """
    levels: list[SweptLevel] = []
    while matrix.shape[0] > COARSEST_SIZE and len(levels) < MAXIMUM_LEVELS:
        starts, columns = unsigned(matrix.indptr, matrix.indices)
        diagonal = np.empty(matrix.shape[0], dtype=np.uint32)
        inverse = np.empty(matrix.shape[0], dtype=PRECISION)
        compiled.find_diagonal(starts, columns, matrix.data, diagonal, inverse)
        fine = (starts, columns, matrix.data)
        if prolongation is None:
            label, size = compiled.aggregate(*fine)
            rows = fill_rows(
                compiled.smoothed_prolongation,
                matrix.shape[0],
                (*fine, diagonal, label, DAMPING, size),
                ENTRIES_OF_PROLONGATION,
            )
        else:
            size = prolongation.shape[1]
            rows = (prolongation.indptr, prolongation.indices, prolongation.data)
            prolongation = None
        if size >= matrix.shape[0] or size == 0:
            break
        rows = (*unsigned(*rows[:2]), rows[2])
        matrix, restriction = _galerkin(fine, rows, size)
        levels.append(
            SweptLevel(
                starts,
                columns,
                fine[2].astype(PRECISION),
                diagonal,
                inverse,
                (*rows[:2], rows[2].astype(PRECISION)),
                (*restriction[:2], restriction[2].astype(PRECISION)),
                *_parts(fine, diagonal, inverse),
                row_blocks(len(inverse)),
                row_blocks(size),
            )
        )
    return SweptHierarchy(tuple(levels), cho_factor(matrix.toarray()))


def _parts(
    fine: Rows, diagonal: NDArray[np.uint32], inverse: NDArray
) -> tuple[NDArray, NDArray[np.uint8], NDArray[np.uint32], NDArray[np.int64]]:
    """Inverse for what is swept apart, part of each row, rows by part and their ranges."""
    count = len(row_blocks(len(inverse))) - 1
    if count == 1:
        return inverse, np.empty(0, np.uint8), np.empty(0, np.uint32), np.array([0, len(inverse)])
    part = compiled.divide(*fine, count)
    inverse = np.empty_like(inverse)
    compiled.inverse_of_parts(*fine, diagonal, part, inverse)
    rows = np.concatenate([np.flatnonzero(part == k) for k in range(count)]).astype(np.uint32)
    return inverse, part, rows, np.concatenate(([0], np.cumsum(np.bincount(part, minlength=count))))


def _galerkin(fine: Rows, rows: Rows, size: int) -> tuple[sparse.csr_array, Rows]:
    """``Pᵀ A P`` with sorted rows, and ``Pᵀ``."""
    starts, columns, values = compiled.transpose(*rows, size)
    restriction = (*unsigned(starts, columns), values)
    starts, columns, values = fill_rows(
        compiled.product_rows, len(rows[0]) - 1, (*fine, *rows, size), ENTRIES_OF_PRODUCT
    )
    product = (*unsigned(starts, columns), values)
    starts, columns, values = fill_rows(
        compiled.product_rows, size, (*restriction, *product, size), ENTRIES_OF_COARSE
    )
    compiled.sort_rows(*unsigned(starts, columns), values)
    coarse = sparse.csr_array((values, columns, starts), shape=(size, size), copy=False)
    coarse.has_canonical_format = True
    return coarse, restriction
