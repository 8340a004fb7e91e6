"""The multigrid cycle in compiled loops: polynomial smoothing, single precision, rows shared by threads.

Two steps of Chebyshev's polynomials of the fourth kind, with Lottes' weights,
smooth before and after each coarser correction. They need products alone, which
threads share without waiting for each other and which give the same digits
whatever their number; a Gauss-Seidel sweep damps as much with half the products,
but its rows wait for each other. Rows whose sizes add up to more than twice the
diagonal are damped, so that no eigenvalue has to be estimated. Prolongations
keep four entries in every row: as many iterations as with all, and loops whose
ends no processor mispredicts.

Sources: Lottes (2023), Numer. Linear Algebra Appl. 30, e2518 (polynomial);
Vanek, Mandel & Brezina (1996), Computing 56, 179-196 (smoothed aggregation);
De Sterck, Falgout, Nolting & Yang (2008), Numer. Linear Algebra Appl. 15,
115-139 (truncated prolongation).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from spindle_fem.conduction import compiled_solver as compiled
from spindle_fem.conduction.memory import room
from spindle_fem.conduction.threads import fill_rows, row_blocks, run_blocks, unsigned
from spindle_fem.errors import SpecError

COARSEST_SIZE = 400
MAXIMUM_LEVELS = 12
# Damping of the step that smooths the aggregates' constants.
DAMPING = 0.8
PRECISION = np.float32
# Weights of the two steps: Lottes (2023), table of optimal fourth-kind weights.
FIRST_WEIGHT = PRECISION(1.02387287570313)
SECOND_WEIGHT = PRECISION(1.26408905371085)
# Largest eigenvalue of the scaled matrix: that of rows that sum to zero with no positive coupling.
LARGEST = 2.0
FIRST_STEP = PRECISION(4.0 / (3.0 * LARGEST))
KEEP = PRECISION(1.0 / 5.0)
SECOND_STEP = PRECISION(12.0 / (5.0 * LARGEST))
# First guesses of how long rows are; wrong ones only cost time.
ENTRIES_OF_PRODUCT = 9.0
ENTRIES_OF_COARSE = 45.0

Rows = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray]
FixedRows = tuple[NDArray[np.uint32], NDArray]


@dataclass(frozen=True, slots=True)
class CompiledLevel:
    """One level.

    Attributes
    ----------
    matrix : compressed rows
    inverse : (n,) ndarray
        Scale of smoothing: inverse of the diagonal, less where couplings are positive.
    prolongation : (n, 4) columns and values
    restriction : compressed rows
    blocks, coarse_blocks : ndarray
        Ranges of rows of this level and of the restriction that threads take.
    """

    matrix: Rows
    inverse: NDArray
    prolongation: FixedRows
    restriction: Rows
    blocks: NDArray[np.int64]
    coarse_blocks: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CompiledHierarchy:
    """Levels from fine to coarse and the factor of the coarsest matrix."""

    levels: tuple[CompiledLevel, ...]
    coarsest: tuple[NDArray[np.float64], bool]
    # vectors of all levels, for the next cycle: fresh memory would be touched anew in each
    _spare: list[list[NDArray]] = field(default_factory=list)

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
        if not self.levels:
            return cho_solve(self.coarsest, residual)
        # scaled, so that small residuals stay inside the range of single precision
        scale = float(np.linalg.norm(residual)) / np.sqrt(len(residual)) or 1.0
        level = self.levels[0]
        # calls from several threads find vectors of their own
        work = self._spare.pop() if self._spare else self._vectors()
        right, direction = work[0][:2]
        run_blocks(
            compiled.begin_scaled, level.blocks, 1.0 / scale, FIRST_STEP, level.inverse, residual,
            right, direction,
        )  # fmt: skip
        answer = np.empty(len(residual))
        self._smooth_and_correct(0, work, scale, answer)
        self._spare.append(work)
        return answer

    def _vectors(self) -> list[NDArray]:
        return [room((5, len(level.inverse)), PRECISION) for level in self.levels]

    def _descend(self, depth: int, work: list[NDArray], right: NDArray) -> NDArray:
        if depth == len(self.levels):
            return cho_solve(self.coarsest, right.astype(np.float64), check_finite=False).astype(PRECISION)
        level = self.levels[depth]
        work[depth][0] = right
        run_blocks(compiled.begin, level.blocks, FIRST_STEP, level.inverse, right, work[depth][1])
        answer = np.empty_like(right)
        self._smooth_and_correct(depth, work, PRECISION(1.0), answer)
        return answer

    def _smooth_and_correct(self, depth: int, work: list[NDArray], scale: float, answer: NDArray) -> None:
        """A level from its first direction on; ``answer`` gets the result times a scale."""
        level = self.levels[depth]
        blocks, matrix, inverse = level.blocks, level.matrix, level.inverse
        right, direction, left, following, unknowns = work[depth]
        run_blocks(
            compiled.go_on, blocks, *matrix, inverse, right, direction, KEEP, SECOND_STEP, left, following
        )
        # the residual after both steps takes the place of the one between, row by row
        run_blocks(
            compiled.end_from_zero, blocks, *matrix, right, left, direction, following,
            FIRST_WEIGHT, SECOND_WEIGHT, unknowns, left,
        )  # fmt: skip
        coarse = np.empty(len(level.restriction[0]) - 1, dtype=PRECISION)
        run_blocks(compiled.multiply, level.coarse_blocks, *level.restriction, left, coarse)
        correction = self._descend(depth + 1, work, coarse)
        run_blocks(compiled.add_prolonged, blocks, *level.prolongation, correction, unknowns)
        run_blocks(
            compiled.begin_again, blocks, *matrix, inverse, right, unknowns, FIRST_STEP, left, direction
        )
        run_blocks(
            compiled.end, blocks, *matrix, inverse, left, direction,
            FIRST_WEIGHT, SECOND_WEIGHT, KEEP, SECOND_STEP, unknowns, scale, answer,
        )  # fmt: skip

    def _descend_many(self, depth: int, right: NDArray) -> NDArray:
        """The cycle for several columns."""
        if depth == len(self.levels):
            return cho_solve(self.coarsest, right.astype(np.float64)).astype(PRECISION)
        level = self.levels[depth]
        left, following = np.empty_like(right), np.empty_like(right)
        direction = right * (FIRST_STEP * level.inverse[:, None])
        unknowns = FIRST_WEIGHT * direction
        step = (compiled.step_many, level.blocks, *level.matrix, level.inverse)
        run_blocks(*step, right, direction, KEEP, SECOND_STEP, left, following)
        unknowns += SECOND_WEIGHT * following
        run_blocks(*step, right, unknowns, PRECISION(0.0), FIRST_STEP, left, direction)
        coarse = np.empty((len(level.restriction[0]) - 1, right.shape[1]), dtype=PRECISION)
        run_blocks(compiled.multiply_many, level.coarse_blocks, *level.restriction, left, coarse)
        correction = np.ascontiguousarray(self._descend_many(depth + 1, coarse))
        run_blocks(compiled.add_prolonged_many, level.blocks, *level.prolongation, correction, unknowns)
        run_blocks(*step, right, unknowns, PRECISION(0.0), FIRST_STEP, left, direction)
        unknowns += FIRST_WEIGHT * direction
        run_blocks(*step, left, direction, KEEP, SECOND_STEP, right, following)
        unknowns += SECOND_WEIGHT * following
        return unknowns


def build_compiled_hierarchy(
    matrix: sparse.csr_array, prolongation: sparse.csr_array | None
) -> CompiledHierarchy:
    """Hierarchy of a symmetric positive definite matrix.

    Parameters
    ----------
    matrix : (n, n) csr_array
    prolongation : (n, n_corners) csr_array or None
        From linear to quadratic temperatures; None when they are linear.
    """
    levels: list[CompiledLevel] = []
    while matrix.shape[0] > COARSEST_SIZE and len(levels) < MAXIMUM_LEVELS:
        n = matrix.shape[0]
        blocks = row_blocks(n)
        fine = (*unsigned(matrix.indptr, matrix.indices), matrix.data)
        inverse, smoothing = np.empty(n), np.empty(n, dtype=PRECISION)
        run_blocks(compiled.invert_diagonal, blocks, *fine, LARGEST, inverse, smoothing)
        if prolongation is None:
            label, size = compiled.aggregate(*fine)
            label = label.view(np.uint32)
            rows = _empty_rows(n)
            run_blocks(compiled.smoothed_prolongation, blocks, *fine, inverse, label, DAMPING, size, *rows)
        else:
            size = prolongation.shape[1]
            rows = _fixed_rows(prolongation)
            prolongation = None
        if size >= n or size == 0:
            break
        matrix, restriction = _galerkin(fine, rows, size)
        # after the product, which takes as much memory for a while
        single = (*fine[:2], room(len(fine[2]), PRECISION))
        single[2][:] = fine[2]
        levels.append(
            CompiledLevel(
                single,
                smoothing,
                rows,
                restriction,
                blocks,
                # rows of the restriction are long
                np.linspace(0, size, len(blocks)).astype(np.int64),
            )
        )
    return CompiledHierarchy(tuple(levels), cho_factor(matrix.toarray()))


def _empty_rows(n: int) -> FixedRows:
    shape = (n, compiled.WIDTH)
    return room(shape, np.uint32), room(shape, PRECISION)


def _fixed_rows(matrix: sparse.csr_array) -> FixedRows:
    """Columns and values of rows with at most four entries."""
    counts = np.diff(matrix.indptr)
    if counts.max(initial=0) > compiled.WIDTH:
        raise SpecError("prolongation", f"{counts.max()} entries in a row.", f"Allowed: {compiled.WIDTH}.")
    columns, values = _empty_rows(len(counts))
    # fillers name what the row has anyway: products get no entries from them
    columns[:] = matrix.indices[np.minimum(matrix.indptr[:-1], matrix.nnz - 1), None]
    values[:] = 0.0
    inside = np.arange(compiled.WIDTH) < counts[:, None]
    columns[inside], values[inside] = matrix.indices, matrix.data
    return columns, values


def _galerkin(fine: Rows, rows: FixedRows, size: int) -> tuple[sparse.csr_array, Rows]:
    """``Pᵀ A P``, rows not sorted, and ``Pᵀ``."""
    starts, columns, values = compiled.transpose_fixed(*rows, size)
    restriction = (*unsigned(starts, columns), values)
    starts, columns, values = fill_rows(
        compiled.times_fixed, len(rows[0]), (*fine, *rows, size), ENTRIES_OF_PRODUCT
    )
    product = (*unsigned(starts, columns), values)
    starts, columns, values = fill_rows(
        compiled.product_rows, size, (*restriction, *product, size), ENTRIES_OF_COARSE
    )
    return sparse.csr_array((values, columns, starts), shape=(size, size), copy=False), restriction
