"""Multigrid in single precision, the preconditioner of conjugate gradients on large meshes.

The cycle is symmetric. Quadratic temperatures are first restricted to the corner nodes, where the linear
elements of the same mesh are (p-multigrid); from there smoothed aggregation makes
the coarser levels. Two steps of Chebyshev's polynomials of the fourth kind, with
Lottes' weights, smooth before and after each coarser correction: they need
products alone, which threads share and which give the same digits whatever their
number. Rows whose sizes add up to more than twice the diagonal are damped, so
that no eigenvalue has to be estimated. Prolongations keep four entries in every
row: as many iterations as with all, and loops of fixed length.

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

from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import column_loops as many
from spindle_fem.model.mesh.kernels import multigrid_loops as loops
from spindle_fem.model.mesh.kernels import team_loops as teams
from spindle_fem.model.mesh.kernels.row_sums import LANES
from spindle_fem.model.mesh.threads import (
    chunk_bounds,
    fill_rows,
    row_blocks,
    run_blocks,
    run_team,
    unsigned,
)

COARSEST_SIZE = 400
MAXIMUM_LEVELS = 12
# Damping of the step that smooths the aggregates' constants.
DAMPING = 0.8
PRECISION = np.float32
# First guesses of how long rows are; wrong ones only cost time.
ENTRIES_OF_PRODUCT = 9.0
ENTRIES_OF_COARSE = 45.0
# Elements of single precision on a cache line.
LINE = 16

Rows = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray]
FixedRows = tuple[NDArray[np.uint32], NDArray]


@dataclass(frozen=True, slots=True)
class Level:
    """One level, its arrays in the order in which the kernels take them.

    Attributes
    ----------
    matrix : compressed rows
    inverse : (n,) ndarray
        Scale of smoothing: inverse of the diagonal, less where couplings are positive.
    prolongation : (n, 4) columns and values
    restriction : compressed rows
    """

    matrix: Rows
    inverse: NDArray
    prolongation: FixedRows
    restriction: Rows

    @property
    def arrays(self) -> tuple[NDArray, ...]:
        """The nine arrays."""
        return (*self.matrix, self.inverse, *self.prolongation, *self.restriction)

    @classmethod
    def of_arrays(cls, arrays: list[NDArray]) -> Level:
        """A level of what :attr:`arrays` gives."""
        return cls(tuple(arrays[:3]), arrays[3], tuple(arrays[4:6]), tuple(arrays[6:]))


@dataclass(frozen=True, slots=True)
class CyclePlan:
    """Schedule of a cycle: see :func:`spindle_fem.model.mesh.kernels.team_loops.cycle`.

    Attributes
    ----------
    passes : (n_passes + 1, 3) int64 ndarray
        Kind, level and first chunk; the last row has the number of chunks.
    bounds : (n_levels + 1, n) int64 ndarray
        Rows of each level's chunks.
    layout : (n_levels + 1, 11) int64 ndarray
        Rows of each level, where its vectors begin, and where its nine arrays begin in ``coarse``.
    fine : tuple of ndarray
        The nine arrays of the finest level.
    coarse : tuple of ndarray
        The same of all coarser levels, one after the other.
    coarsest : (n, n) ndarray
        Inverse of the coarsest matrix.
    size : int
        Unknowns of all levels together.
    """

    passes: NDArray[np.int64]
    bounds: NDArray[np.int64]
    layout: NDArray[np.int64]
    fine: tuple[NDArray, ...]
    coarse: tuple[NDArray, ...]
    coarsest: NDArray[np.float64]
    size: int


@dataclass(frozen=True, slots=True)
class Hierarchy:
    """Levels from fine to coarse, the factor of the coarsest matrix, and the plan of a cycle."""

    levels: tuple[Level, ...]
    coarsest: tuple[NDArray[np.float64], bool]
    plan: CyclePlan | None
    # vectors of all levels, for the next cycle: fresh memory would be touched anew in each
    _spare: list[NDArray] = field(default_factory=list)
    _spare_columns: list[dict[tuple[int, str], NDArray]] = field(default_factory=list)

    def cycle(self, residual: NDArray[np.float64]) -> NDArray[np.float64]:
        """One V-cycle: approximate solution of ``K x = residual``.

        Parameters
        ----------
        residual : (n,) or (n, m) ndarray
            Several columns cost far less than one after the other: each matrix
            is read once for all of them. They may be of single precision, as
            the answer then is.
        """
        if self.plan is None:
            return cho_solve(self.coarsest, residual)
        # scaled, so that small residuals stay inside the range of single precision
        if residual.ndim == 2:
            return self._cycle_many(residual)
        scale = float(np.linalg.norm(residual)) / np.sqrt(len(residual)) or 1.0
        plan = self.plan
        # calls from several threads find vectors of their own
        work = self._spare.pop() if self._spare else room(teams.N_VECTORS * plan.size, PRECISION)
        answer = np.empty(len(residual))
        run_team(
            teams.cycle, plan.bounds.shape[1] - 1, plan.passes, plan.bounds, plan.layout, plan.fine,
            plan.coarse, plan.coarsest, work, np.ascontiguousarray(residual), scale, answer,
        )  # fmt: skip
        self._spare.append(work)
        return answer

    def _cycle_many(self, residual: NDArray) -> NDArray:
        """One V-cycle for several columns, which fill vector registers with others that are zero."""
        n, m = residual.shape
        blocks = row_blocks(n)
        scales = np.max(run_blocks(many.largest_columns, blocks, residual), axis=0)
        scales[scales == 0.0] = 1.0
        spare = self._spare_columns.pop() if self._spare_columns else {}
        right = _columns(spare, (0, "r"), (n, -(-m // LANES) * LANES))
        run_blocks(many.scale_columns, blocks, 1.0 / scales, residual, right)
        answer = room(residual.shape, residual.dtype)
        run_blocks(many.scale_columns, blocks, scales, self._descend_many(0, right, spare), answer)
        self._spare_columns.append(spare)
        return answer

    def _descend_many(self, depth: int, right: NDArray, spare: dict[tuple[int, str], NDArray]) -> NDArray:
        """The cycle for several columns, from a level on; what it returns is memory of ``spare``."""
        if depth == len(self.levels):
            return cho_solve(self.coarsest, right.astype(np.float64)).astype(PRECISION)
        level, shape = self.levels[depth], right.shape
        blocks = row_blocks(len(right))
        left, direction, unknowns = (_columns(spare, (depth, name), shape) for name in "ldu")
        smooth = (many.smooth_columns, blocks, *level.matrix, level.inverse)
        weights = (teams.KEEP, teams.SECOND_STEP, teams.FIRST_WEIGHT, teams.SECOND_WEIGHT)
        run_blocks(many.scale_rows, blocks, teams.FIRST_STEP, level.inverse, right, direction)
        run_blocks(*smooth, right, direction, *weights, False, unknowns)
        run_blocks(many.left_over, blocks, *level.matrix, right, unknowns, left)
        coarse = _columns(spare, (depth, "c"), (len(level.restriction[0]) - 1, shape[1]))
        # rows of the restriction are long
        coarse_blocks = np.linspace(0, len(coarse), len(blocks)).astype(np.int64)
        run_blocks(many.multiply_columns, coarse_blocks, *level.restriction, left, coarse)
        correction = self._descend_many(depth + 1, coarse, spare)
        run_blocks(many.add_prolonged_columns, blocks, *level.prolongation, correction, unknowns)
        run_blocks(many.left_over, blocks, *level.matrix, right, unknowns, left)
        run_blocks(many.scale_rows, blocks, teams.FIRST_STEP, level.inverse, left, direction)
        run_blocks(*smooth, left, direction, *weights, True, unknowns)
        return unknowns


def _columns(spare: dict[tuple[int, str], NDArray], key: tuple[int, str], shape: tuple[int, ...]) -> NDArray:
    """Memory for columns of a level that the next cycle takes again."""
    size = shape[0] * shape[1]
    if key not in spare or spare[key].size < size:
        spare[key] = room(size, PRECISION)
    return spare[key][:size].reshape(shape)


def build_hierarchy(matrix: sparse.csr_array, prolongation: sparse.csr_array | None) -> Hierarchy:
    """Hierarchy of a symmetric positive definite matrix.

    Parameters
    ----------
    matrix : (n, n) csr_array
    prolongation : (n, n_corners) csr_array or None
        From linear to quadratic temperatures; None when they are linear.
    """
    levels: list[Level] = []
    while matrix.shape[0] > COARSEST_SIZE and len(levels) < MAXIMUM_LEVELS:
        n = matrix.shape[0]
        fine = (*unsigned(matrix.indptr, matrix.indices), matrix.data)
        inverse, smoothing = scales_of_smoothing(matrix)
        if prolongation is None:
            label, size = loops.aggregate(*fine)
            rows = room((n, loops.WIDTH), np.uint32), room((n, loops.WIDTH), PRECISION)
            given = (*fine, inverse, label.view(np.uint32), DAMPING, size, *rows)
            run_blocks(loops.smoothed_prolongation, row_blocks(n), *given)
        else:
            rows, size = _fixed_rows(prolongation), prolongation.shape[1]
            prolongation = None
        if size >= n or size == 0:
            break
        matrix, restriction = _galerkin(fine, rows, size)
        # after the product, which takes as much memory for a while
        single = room(len(fine[2]), PRECISION)
        single[:] = fine[2]
        levels.append(Level((*fine[:2], single), smoothing.astype(PRECISION), rows, restriction))
    coarsest = cho_factor(matrix.toarray())
    if not levels:
        return Hierarchy((), coarsest, None)
    plan = _plan(levels, coarsest)
    # coarser levels for several columns look at the arrays of the plan
    kept = [levels[0]]
    for index, level in enumerate(levels[1:], start=1):
        begins = plan.layout[index, teams.ARRAYS :]
        kept.append(
            Level.of_arrays(
                [
                    flat[begin : begin + len(own)]
                    for flat, begin, own in zip(plan.coarse, begins, level.arrays, strict=True)
                ]
            )
        )
    return Hierarchy(tuple(kept), coarsest, plan)


def scales_of_smoothing(matrix: sparse.csr_array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inverse of each row's diagonal, and the one that smoothing scales by, (n,) each.

    That is smaller where the row's sizes add up to more than twice the diagonal: no
    eigenvalue of the scaled matrix is then above two (Gershgorin).
    """
    inverse = 1.0 / matrix.diagonal()
    sizes = abs(matrix) @ np.ones(matrix.shape[0])
    return inverse, np.minimum(inverse, teams.LARGEST / sizes)


def _plan(levels: list[Level], coarsest: tuple[NDArray[np.float64], bool]) -> CyclePlan:
    """Plan of a cycle, the arrays of the coarser levels lying one after the other."""
    count, size = len(levels), len(coarsest[0])
    rows = np.array([*(len(level.inverse) for level in levels), size])
    # each level's vectors begin on a cache line of their own
    padded = -(-rows // LINE) * LINE
    fine, coarse = levels[0].arrays, [level.arrays for level in levels[1:]]
    layout = np.zeros((count + 1, teams.ARRAYS + len(fine)), dtype=np.int64)
    layout[:, teams.ROWS] = rows
    layout[1:, teams.WORK] = np.cumsum(padded)[:-1]
    for k in range(len(fine)):
        layout[2:, teams.ARRAYS + k] = np.cumsum([len(arrays[k]) for arrays in coarse])
    bounds = [*(chunk_bounds(level.matrix[0]) for level in levels), np.array([0, size])]
    table = np.zeros((count + 1, max(len(each) for each in bounds)), dtype=np.int64)
    for level, each in enumerate(bounds):
        table[level, : len(each)] = each
    passes, first = [], 0
    for kind, level in _order(count):
        passes.append((kind, level, first))
        first += len(bounds[level]) - 1
    inverse = cho_solve(coarsest, np.eye(size))
    return CyclePlan(
        np.array([*passes, (-1, -1, first)], dtype=np.int64),
        table,
        layout,
        fine,
        tuple(np.concatenate([arrays[k] for arrays in coarse] or [fine[k][:0]]) for k in range(len(fine))),
        # symmetric to the last digit, as what it preconditions
        0.5 * (inverse + inverse.T),
        int(padded.sum()),
    )


def _order(count: int) -> list[tuple[int, int]]:
    """Kind and level of each pass of a V-cycle with so many levels above the coarsest."""
    order = [(teams.BEGIN, 0)]
    for level in range(count):
        order += [(teams.SMOOTH, level), (teams.RESIDUAL, level), (teams.RESTRICT, level + 1)]
    order.append((teams.COARSEST, count))
    for level in reversed(range(count)):
        order += [(teams.PROLONG, level), (teams.AGAIN, level), (teams.END, level)]
    return order


def _fixed_rows(matrix: sparse.csr_array) -> FixedRows:
    """Columns and values of rows with at most four entries."""
    counts = np.diff(matrix.indptr)
    if counts.max(initial=0) > loops.WIDTH:
        raise SpecError("prolongation", f"{counts.max()} entries in a row.", f"Allowed: {loops.WIDTH}.")
    shape = (len(counts), loops.WIDTH)
    columns, values = room(shape, np.uint32), room(shape, PRECISION)
    # fillers name what the row has anyway: products get no entries from them
    columns[:] = matrix.indices[np.minimum(matrix.indptr[:-1], matrix.nnz - 1), None]
    values[:] = 0.0
    inside = np.arange(loops.WIDTH) < counts[:, None]
    columns[inside], values[inside] = matrix.indices, matrix.data
    return columns, values


def _galerkin(fine: Rows, rows: FixedRows, size: int) -> tuple[sparse.csr_array, Rows]:
    """``Pᵀ A P``, rows not sorted, and ``Pᵀ``."""
    n = len(rows[0])
    starts = np.arange(0, rows[0].size + 1, loops.WIDTH, dtype=np.int32)
    prolongation = sparse.csr_array(
        (rows[1].ravel(), rows[0].ravel().view(np.int32), starts), shape=(n, size)
    )
    transposed = prolongation.tocsc()
    transposed.eliminate_zeros()
    restriction = (*unsigned(transposed.indptr, transposed.indices), transposed.data)
    starts, columns, values = fill_rows(loops.times_fixed, n, (*fine, *rows, size), ENTRIES_OF_PRODUCT)
    product = (*unsigned(starts, columns), values)
    starts, columns, values = fill_rows(
        loops.product_rows, size, (*restriction, *product, size), ENTRIES_OF_COARSE
    )
    return sparse.csr_array((values, columns, starts), shape=(size, size), copy=False), restriction
