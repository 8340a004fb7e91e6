"""Galerkin projection of a mesh model whose basis is enlarged where its own residual is large.

At a set of coefficients and some Laplace frequencies the projected solutions leave residuals ``r``; with
the preconditioner B, ``√(rᵀ B r)`` estimates how far the full solutions are away in the energy norm. Only
combinations of loads for which that is more than wanted are solved in full, from there on and no
farther than to what is wanted. Every operator's projection is extended by what joins, so that another
set of coefficients costs one product with the mesh's matrix and one cycle of multigrid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cholesky, eigh, solve_triangular

from spindle_fem.model.matrices_on_pattern import sum_of
from spindle_fem.model.mesh.column_solver import COLUMNS_AT_ONCE, corrections, dots, product_of
from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.linear_solvers import Preconditioner, build_preconditioner
from spindle_fem.model.mesh.threads import LEAST_ROWS, inner_product, product, run_blocks
from spindle_fem.model.reduced.mesh_model import MeshModel
from spindle_fem.model.reduced.snapshots import Sample
from spindle_fem.model.thermal_model import MATRIX_FIELDS, ThermalModel
from spindle_fem.parallel import beside, in_threads

Array = NDArray[np.float64]

# Vectors of the iterations; a residual of single precision is right to some 1e-6 of the solution.
PRECISION = np.float32
# Share of what is wanted below which a direction adds nothing to those before.
DISTINCT_SHARE = 0.1
# Share of its first error that a correction is solved to at least.
LEAST_REDUCTION = 0.5
# Rows that scalar products in double precision take at a time.
ROWS_AT_ONCE = 16_384
# Share of the largest square below which the new part of a block may be round-off.
DEPENDENT_SHARE = 1.0e-9
# Directions that there is room for at first, and the share by which it grows.
FIRST_ROOM, GROWTH = 320, 1.25
# A preconditioner is made for this share of the highest frequency, which is at least this [1/s]: slow
# fields, in which other frequencies differ, are held by the directions.
FAR, SLOW = 10.0, 3.0e-3
# Share of the capacities in the energy, 1/s: makes it definite where no film holds a part.
CAPACITY_SHARE = 1.0e-4


@dataclass(frozen=True, slots=True)
class _Block:
    """An operator on the rows that it has."""

    rows: slice | NDArray[np.int64]
    matrix: sparse.csr_array

    def projected(self, directions: NDArray[np.float32], fresh: NDArray[np.float32]) -> Array:
        """``Dᵀ K Q`` of directions (n, d) and some of them (n, q), (d, q)."""
        own = np.ascontiguousarray(fresh[self.rows])
        image = room(own.shape, own.dtype)
        product_of(self.matrix)(own, image)
        return inner_product(directions[self.rows], image)


@dataclass(frozen=True, slots=True)
class Solved:
    """Solutions of one set of coefficients in the directions then known, (d, m) for each frequency.

    ``errors`` are estimates of what the projection missed before, in the energy norm, (m,) each.
    """

    coordinates: tuple[Array, ...]
    errors: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class _Missing:
    """Residuals (n, q), the same preconditioned, and the square of the error (q,) that is allowed."""

    residual: NDArray[np.float32]
    conditioned: NDArray[np.float32]
    target: Array


@dataclass(frozen=True, slots=True)
class _System:
    """``K + s M`` of one sample in single precision, and the preconditioner of one frequency for others."""

    sample: Sample
    conduction: sparse.csr_array
    capacity: sparse.csr_array
    shift: float = 0.0
    preconditioner: Preconditioner | None = None

    def product(self, vectors: NDArray, out: NDArray, shifts: Array) -> None:
        """``out = (K + s M) vectors``, each column with its own s."""
        product_of(self.conduction)(vectors, out)
        if shifts.any():
            image = room(out.shape, out.dtype)
            product_of(self.capacity)(vectors, image)
            image *= shifts.astype(out.dtype)
            out += image


@dataclass(slots=True)
class GrowingProjection:
    """Directions on a mesh model, and the projections of every operator on them.

    Attributes
    ----------
    full : MeshModel
        Its unknowns in any order; products are fastest in that of ``solving_order``.
    sample : Sample
        Coefficients of the energy in which solutions are compared.
    known : tuple of (n, d) float32 ndarray and ThermalModel, optional
        Directions to begin from, the uniform field of 1 K the first, and the projection on them; that field
        alone when None.
    """

    full: MeshModel
    sample: Sample
    known: InitVar[tuple[NDArray[np.float32], ThermalModel] | None] = None
    size: int = field(init=False, default=0)
    _directions: NDArray[np.float32] = field(init=False)
    _stacks: dict[str, Array] = field(init=False)
    _energy: sparse.csr_array | None = field(init=False, default=None)
    _blocks: dict[str, list[_Block]] = field(init=False, default_factory=dict)
    _solved: list[Array] = field(init=False, default_factory=list)
    _last: _System | None = field(init=False, default=None)
    _coming: list[tuple[Sample, float]] = field(init=False, default_factory=list)
    _begun: Callable[[], _System] | None = field(init=False, default=None)

    def __post_init__(self, known: tuple[NDArray[np.float32], ThermalModel] | None) -> None:
        full = self.full
        if known is None:
            self._stacks = {name: np.zeros((len(getattr(full, name)), 0, 0)) for name in MATRIX_FIELDS}
            self._directions = room((full.size, FIRST_ROOM), PRECISION)
            self._join(full.one[:, None].astype(PRECISION))
        else:
            self._directions, model = known
            self.size = self._directions.shape[1]
            self._stacks = {name: getattr(model, name) for name in MATRIX_FIELDS}

    # ------------------------------------------------------------- directions
    @property
    def directions(self) -> NDArray[np.float32]:
        """All of them, (n, d); the uniform field of 1 K is the first."""
        return self._directions[:, : self.size]

    def fields(self, coordinates: Array) -> NDArray[np.float32]:
        """Temperatures of coordinates (d', m) on the first d' directions, (n, m) [K]."""
        return product(self._directions[:, : len(coordinates)], coordinates.astype(PRECISION))

    def flows(
        self, coefficients: Sequence[str], fields: Sequence[NDArray]
    ) -> list[tuple[slice | NDArray[np.int64], NDArray]]:
        """What unit coefficients conduct in fields (n,) or (n, m) of each: rows, and ``K_i T`` on these."""
        self._prepare_to_grow()
        own = [self._blocks["operators"][self.full.coefficient_names.index(name)] for name in coefficients]
        return [(item.rows, item.matrix @ field[item.rows]) for item, field in zip(own, fields, strict=True)]

    def _prepare_to_grow(self) -> None:
        """Matrix of the energy, and every operator on its own rows: a basis that is enough needs neither."""
        if self._energy is None:
            full = self.full
            energy = full.conduction(self.sample.coefficients, self.sample.channel_film)
            self._energy = _single(sum_of(energy, full.capacity(self.sample.capacities), CAPACITY_SHARE))
            for name in MATRIX_FIELDS:
                own = getattr(full, name)
                self._blocks[name] = in_threads([partial(_block, own, index) for index in range(len(own))])

    def add(self, block: NDArray[np.float32], smallest: float = 0.0) -> Array:
        """Let fields (n, m) join; returns their coordinates (d, m) on all directions.

        Parameters
        ----------
        smallest : float
            Of what is new in a direction, in the energy norm; what is smaller is left out.
        """
        self._prepare_to_grow()
        image = room(block.shape, block.dtype)
        product_of(self._energy)(block, image)
        known = inner_product(self.directions, image)
        held = np.linalg.solve(self._weighted(self.sample, CAPACITY_SHARE), known)
        new = _gram(block, image) - known.T @ held
        values, vectors = eigh(0.5 * (new + new.T))
        chosen = values > max(smallest**2, DEPENDENT_SHARE * float(values.max(initial=0.0)))
        turn = vectors[:, chosen] / np.sqrt(values[chosen])
        # New part of each, orthonormal among themselves and to those before.
        fresh = product(block, turn.astype(PRECISION))
        fresh -= self.fields(held @ turn)
        self._join(fresh)
        coordinates = np.zeros((self.size, block.shape[1]))
        coordinates[: len(held)], coordinates[len(held) :] = held, turn.T @ new
        return coordinates

    def _join(self, fresh: NDArray[np.float32]) -> None:
        """Directions (n, q) as they are."""
        self._prepare_to_grow()
        fresh = np.ascontiguousarray(fresh)
        old, joined = self.size, self.size + fresh.shape[1]
        self._make_room(joined)
        self._directions[:, old:joined] = fresh
        self.size = joined
        for name, blocks in self._blocks.items():
            grown = np.zeros((len(blocks), joined, joined))
            grown[:, :old, :old] = self._stacks[name]
            # large ones share threads themselves, and two of them would take the memory of two
            small = [own for own in blocks if own.matrix.shape[0] < LEAST_ROWS]
            jobs = [partial(own.projected, self.directions, fresh) for own in small]
            done = dict(zip(map(id, small), in_threads(jobs), strict=True))
            for stack, own in zip(grown, blocks, strict=True):
                borders = done[id(own)] if id(own) in done else own.projected(self.directions, fresh)
                stack[:, old:], stack[old:, :old] = borders, borders[:old].T
                stack[old:, old:] = 0.5 * (stack[old:, old:] + stack[old:, old:].T)
            self._stacks[name] = grown

    def _make_room(self, size: int) -> None:
        if size > self._directions.shape[1]:
            wider = room((self.full.size, int(GROWTH * size)), PRECISION)
            wider[:, : self.size] = self.directions
            self._directions = wider

    def _weighted(self, sample: Sample, shift: float) -> Array:
        """``K + s M`` of a sample on the directions."""
        full, stacks = self.full, self._stacks
        coefficients = [sample.coefficients[name] for name in full.coefficient_names]
        total = np.tensordot(coefficients, stacks["operators"], axes=1)
        if len(stacks["cell_film"]):
            total = total + np.tensordot(sample.channel_film, stacks["cell_film"], axes=1)
        if shift:
            capacities = [sample.capacities[name] for name in full.storage_names]
            total = total + shift * np.tensordot(capacities, stacks["storage"], axes=1)
        return total

    # ------------------------------------------------------------- solutions
    def enrich(
        self, sample: Sample, loads: Array, shifts: Sequence[float], wanted: float, *, keep: bool = True
    ) -> Solved:
        """Solve loads (n, m) [W] at some frequencies [1/s]; what the directions do not hold joins them.

        Parameters
        ----------
        wanted : float
            Error of a solution in the energy norm.
        keep : bool
            Whether the solutions count in :meth:`leading`.
        """
        system = self._system(sample, shifts)
        solved, residuals = self._projected(system, loads, shifts)
        turns, missing, errors = [], [], []
        for residual in residuals:
            conditioned = _in_portions(system.preconditioner.apply, residual)
            gram = _gram(residual, conditioned)
            errors.append(np.sqrt(np.maximum(np.diag(gram), 0.0)))
            values, vectors = eigh(0.5 * (gram + gram.T))
            chosen = values > wanted**2
            turns.append(vectors[:, chosen])
            turn = turns[-1].astype(PRECISION)
            target = np.minimum(wanted**2, LEAST_REDUCTION**2 * values[chosen])
            missing.append(_Missing(product(residual, turn), product(conditioned, turn), target))
        if any(turn.size for turn in turns):
            added = self.add(_together(self._corrected(system, missing, shifts)), DISTINCT_SHARE * wanted)
            parts = np.split(added, np.cumsum([turn.shape[1] for turn in turns])[:-1], axis=1)
            for index, (turn, part) in enumerate(zip(turns, parts, strict=True)):
                found = part @ turn.T
                found[: len(solved[index])] += solved[index]
                solved[index] = found
        if keep:
            self._solved += solved
        return Solved(tuple(solved), tuple(errors))

    def size_of(self, sample: Sample, loads: Array) -> float:
        """About the largest norm in energy that steady solutions for loads (n, m) have."""
        apply = self._system(sample, [0.0]).preconditioner.apply
        columns = np.ascontiguousarray(loads, dtype=PRECISION)
        return float(np.sqrt(dots(columns, _in_portions(apply, columns)).max()))

    def missing(
        self, sample: Sample, loads: Array, shifts: Sequence[float], basis: Array, share: float
    ) -> list[NDArray[np.float32]]:
        """Errors of solutions in a basis (d, r) of the directions, to a relative tolerance; each (n, m) K."""
        system = self._system(sample, shifts)
        _, residuals = self._projected(system, loads, shifts, basis)
        missing = []
        for residual in residuals:
            conditioned = _in_portions(system.preconditioner.apply, residual)
            target = share**2 * dots(residual, conditioned)
            missing.append(_Missing(residual, conditioned, target))
        return self._corrected(system, missing, shifts)

    def expect(self, samples: Sequence[Sample], shifts: Sequence[float]) -> None:
        """Say which samples come next, in their order: each is prepared while the one before is solved."""
        self._coming += [(sample, _slow_share(shifts)) for sample in samples]

    def _system(self, sample: Sample, shifts: Sequence[float]) -> _System:
        shift = _slow_share(shifts)
        if self._coming and self._coming[0][0] is sample and self._coming[0][1] == shift:
            self._coming.pop(0)
            self._last = self._begun() if self._begun else self._prepared(sample, shift, self._last)
            self._begun = beside(partial(self._prepared, *self._coming[0], None)) if self._coming else None
        else:
            self._last = self._prepared(sample, shift, self._last)
        return self._last

    def _prepared(self, sample: Sample, shift: float, last: _System | None) -> _System:
        full = self.full
        if last is None or last.sample is not sample:
            conduction = full.conduction(sample.coefficients, sample.channel_film)
            last = _System(sample, _single(conduction), _single(full.capacity(sample.capacities)))
        if last.shift == shift:
            return last
        matrix = sum_of(last.conduction, last.capacity, shift)
        return replace(last, shift=shift, preconditioner=build_preconditioner(full.system(matrix)))

    def _projected(
        self, system: _System, loads: Array, shifts: Sequence[float], basis: Array | None = None
    ) -> tuple[list[Array], list[NDArray[np.float32]]]:
        """Galerkin solutions of every frequency, and what they leave of the loads."""
        conduction = self._weighted(system.sample, 0.0)
        capacity = self._weighted(system.sample, 1.0) - conduction
        entering = inner_product(self.directions, loads.astype(PRECISION))
        if basis is not None:
            # Directions may have joined since.
            k = len(basis)
            conduction, capacity = (basis.T @ matrix[:k, :k] @ basis for matrix in (conduction, capacity))
            entering = basis.T @ entering[:k]
        solved, residuals = [], []
        for shift in shifts:
            coordinates = np.linalg.solve(conduction + shift * capacity, entering)
            coordinates = coordinates if basis is None else basis @ coordinates
            known = np.ascontiguousarray(self.fields(coordinates))
            image = room(known.shape, known.dtype)
            system.product(known, image, np.full(known.shape[1], shift))
            solved.append(coordinates)
            residuals.append(np.subtract(loads, image, dtype=PRECISION, casting="same_kind"))
        return solved, residuals

    def _corrected(
        self, system: _System, missing: Sequence[_Missing], shifts: Sequence[float]
    ) -> list[NDArray[np.float32]]:
        """Solutions of what is missing at each frequency, (n, q) each [K]."""
        counts = [item.residual.shape[1] for item in missing]
        own_shifts = np.repeat(shifts, counts)
        residual, direction = (
            _together([getattr(item, name) for item in missing]) for name in ("residual", "conditioned")
        )
        target = np.concatenate([item.target for item in missing])
        found = room(residual.shape, residual.dtype)
        for first in range(0, len(target), COLUMNS_AT_ONCE):
            own = slice(first, first + COLUMNS_AT_ONCE)
            found[:, own] = corrections(
                lambda vectors, out, active, own=own: system.product(vectors, out, own_shifts[own][active]),
                np.ascontiguousarray(residual[:, own]),
                np.ascontiguousarray(direction[:, own]),
                system.preconditioner.apply,
                target[own],
            )
        return np.split(found, np.cumsum(counts)[:-1], axis=1)

    # ------------------------------------------------------------- basis
    def leading(self, largest: int, tolerance: float) -> Array:
        """The leading combinations of all solutions, as coordinates (d, r).

        Proper orthogonal decomposition in the energy; the uniform field is held exactly.

        Parameters
        ----------
        largest : int
            Unknowns at most.
        tolerance : float
            Singular values below this share of the largest are dropped.
        """
        coordinates = np.zeros((self.size, sum(item.shape[1] for item in self._solved)))
        first = 0
        for item in self._solved:
            coordinates[: len(item), first : first + item.shape[1]] = item
            first += item.shape[1]
        # Directions that it began from are orthonormal in another energy.
        factor = cholesky(self._weighted(self.sample, CAPACITY_SHARE)[1:, 1:])
        vectors, values, _ = np.linalg.svd(factor @ coordinates[1:], full_matrices=False)
        wanted = np.count_nonzero(values > tolerance * values.max(initial=0.0))
        count = min(int(wanted), largest - 1)
        basis = np.zeros((self.size, count + 1))
        basis[0, 0], basis[1:, 1:] = 1.0, solve_triangular(factor, vectors[:, :count])
        return basis


def _slow_share(shifts: Sequence[float]) -> float:
    """Frequency that the preconditioner of some [1/s] is made for."""
    return max(*shifts, SLOW) / FAR


def _block(matrices: Sequence[sparse.csr_array], index: int) -> _Block:
    matrix = matrices[index]
    rows = np.flatnonzero(np.diff(matrix.indptr))
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        own = slice(int(rows[0]), int(rows[-1]) + 1)
        return _Block(own, _single(matrix[own, own]))
    return _Block(rows, _single(matrix[rows][:, rows]))


def _single(matrix: sparse.csr_array) -> sparse.csr_array:
    return sparse.csr_array(
        (matrix.data.astype(PRECISION), matrix.indices, matrix.indptr), shape=matrix.shape, copy=False
    )


def _together(blocks: Sequence[NDArray]) -> NDArray:
    """Blocks of columns side by side; one alone as it is."""
    return np.hstack(blocks) if len(blocks) > 1 else np.ascontiguousarray(blocks[0])


def _in_portions(apply: Callable[[NDArray], NDArray], columns: NDArray) -> NDArray:
    """A preconditioner on many columns, as many at once as are fast."""
    if columns.shape[1] <= COLUMNS_AT_ONCE:
        return apply(np.ascontiguousarray(columns))
    found = room(columns.shape, columns.dtype)
    for first in range(0, columns.shape[1], COLUMNS_AT_ONCE):
        own = slice(first, first + COLUMNS_AT_ONCE)
        found[:, own] = apply(np.ascontiguousarray(columns[:, own]))
    return found


def _gram(one: NDArray, two: NDArray) -> Array:
    """Scalar products of all columns of two single-precision blocks, (m, m), in double precision."""
    bounds = np.append(np.arange(0, len(one), ROWS_AT_ONCE), len(one))
    return sum(
        run_blocks(lambda low, high: one[low:high].astype(float).T @ two[low:high].astype(float), bounds)
    )
