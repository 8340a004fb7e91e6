"""The multigrid cycle in compiled loops: polynomial smoothing, single precision, rows shared by threads.

A cycle is one call in which threads claim chunks of rows, pass after pass
(``compiled_teams``). Two steps of Chebyshev's polynomials of the fourth kind, with Lottes' weights,
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

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.kernels import solver_loops as compiled
from spindle_fem.model.mesh.kernels import team_loops as teams
from spindle_fem.model.mesh.kernels.team_loops import (
    FIRST_STEP,
    FIRST_WEIGHT,
    KEEP,
    LARGEST,
    SECOND_STEP,
    SECOND_WEIGHT,
)
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
# Which column of the layout tells where each array of a level begins.
_BEGINS = (
    teams.START, teams.ENTRY, teams.ENTRY, teams.ROW, teams.ROW, teams.ROW,
    teams.TO_START, teams.TO_ENTRY, teams.TO_ENTRY,
)  # fmt: skip

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
class CyclePlan:
    """What a compiled cycle goes through, and where: see ``compiled_teams.cycle``.

    Attributes
    ----------
    passes : (n_passes + 1, 3) int64 ndarray
        Kind, level and first chunk; the last row has the number of chunks.
    bounds : (n_levels + 1, n) int64 ndarray
        Rows of each level's chunks.
    layout : (n_levels + 1, 7) int64 ndarray
        Rows of each level and where its arrays begin in ``coarse``.
    fine : tuple
        Matrix, inverse, prolongation and restriction of the finest level.
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
    fine: tuple
    coarse: tuple[NDArray, ...]
    coarsest: NDArray[np.float64]
    size: int


@dataclass(frozen=True, slots=True)
class CompiledHierarchy:
    """Levels from fine to coarse, the factor of the coarsest matrix, and the plan of a cycle."""

    levels: tuple[CompiledLevel, ...]
    coarsest: tuple[NDArray[np.float64], bool]
    plan: CyclePlan | None
    # vectors of all levels, for the next cycle: fresh memory would be touched anew in each
    _spare: list[NDArray] = field(default_factory=list)

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
        if self.plan is None:
            return cho_solve(self.coarsest, residual)
        # scaled, so that small residuals stay inside the range of single precision
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
    coarsest = cho_factor(matrix.toarray())
    if not levels:
        return CompiledHierarchy((), coarsest, None)
    plan, kept = _plan(levels, coarsest)
    return CompiledHierarchy(kept, coarsest, plan)


def _plan(
    levels: list[CompiledLevel], coarsest: tuple[NDArray[np.float64], bool]
) -> tuple[CyclePlan, tuple[CompiledLevel, ...]]:
    """Plan of a cycle, and the levels with the arrays of coarser ones lying one after the other."""
    count, size = len(levels), len(coarsest[0])
    rows = np.array([*(len(level.inverse) for level in levels), size])
    layout = np.zeros((count + 1, 7), dtype=np.int64)
    layout[:, teams.ROWS] = rows
    # each level's vectors begin on a cache line of their own
    padded = -(-rows // LINE) * LINE
    layout[1:, teams.WORK] = np.cumsum(padded)[:-1]
    coarse = levels[1:]
    sizes = {
        teams.ROW: [len(level.inverse) for level in coarse],
        teams.START: [len(level.matrix[0]) for level in coarse],
        teams.ENTRY: [len(level.matrix[1]) for level in coarse],
        teams.TO_START: [len(level.restriction[0]) for level in coarse],
        teams.TO_ENTRY: [len(level.restriction[1]) for level in coarse],
    }
    for column, each in sizes.items():
        layout[2:, column] = np.cumsum(each)
    flat = [
        np.concatenate([_arrays(level)[k] for level in coarse] or [_arrays(levels[0])[k][:0]])
        for k in range(9)
    ]
    bounds = [chunk_bounds(level.matrix[0]) for level in levels]
    bounds.append(np.array([0, size]))
    table = np.zeros((count + 1, max(len(each) for each in bounds)), dtype=np.int64)
    passes, first = [], 0
    for kind, level in _order(count):
        passes.append((kind, level, first))
        first += len(bounds[level]) - 1
    for level, each in enumerate(bounds):
        table[level, : len(each)] = each
    inverse = cho_solve(coarsest, np.eye(size))
    one = levels[0]
    plan = CyclePlan(
        np.array([*passes, (-1, -1, first)], dtype=np.int64),
        table,
        layout,
        (one.matrix, one.inverse, one.prolongation, one.restriction),
        tuple(flat),
        # symmetric to the last digit, as what it preconditions
        0.5 * (inverse + inverse.T),
        int(padded.sum()),
    )
    kept = [one]
    for index, level in enumerate(coarse, start=1):
        pieces = _arrays(level)
        columns = _BEGINS
        begins = [int(layout[index, column]) for column in columns]
        own = [
            array[begin : begin + len(piece)]
            for array, begin, piece in zip(flat, begins, pieces, strict=True)
        ]
        kept.append(
            replace(
                level,
                matrix=tuple(own[:3]),
                inverse=own[3],
                prolongation=tuple(own[4:6]),
                restriction=tuple(own[6:]),
            )
        )
    return plan, tuple(kept)


def _arrays(level: CompiledLevel) -> tuple[NDArray, ...]:
    return (*level.matrix, level.inverse, *level.prolongation, *level.restriction)


def _order(count: int) -> list[tuple[int, int]]:
    """Kind and level of each pass of a V-cycle with so many levels above the coarsest."""
    order = [(teams.BEGIN, 0)]
    for level in range(count):
        order += [(teams.GO_ON, level), (teams.END_FROM_ZERO, level), (teams.RESTRICT, level + 1)]
    order.append((teams.COARSEST, count))
    for level in reversed(range(count)):
        order += [(teams.PROLONG, level), (teams.BEGIN_AGAIN, level), (teams.END, level)]
    return order


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
