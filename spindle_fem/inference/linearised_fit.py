"""The inference about one of its fits to first order: what a further effect would explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from spindle_fem.errors import ConvergenceError
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.robust_size import outlier_weight

Array = NDArray[np.float64]

# Distance from a bound within which a coordinate is at it, in standard deviations of its prior.
NEAR = 1e-6
# Rounds in which all may change sides although they do not get fewer.
PATIENCE = 3
# Rounds for each coordinate; some ten in all are usual.
MOST_ROUNDS = 50


def _pressed(fit: Fit, downhill: Array) -> NDArray[np.bool_]:
    """Coordinates at a bound that the data would have beyond it."""
    low = np.array([c.low for c in fit.coordinates])
    high = np.array([c.high for c in fit.coordinates])
    near = NEAR * np.maximum(1.0, np.abs(fit.position))
    return ((fit.position <= low + near) & (downhill < 0.0)) | (
        (fit.position >= high - near) & (downhill > 0.0)
    )


@dataclass(frozen=True, slots=True)
class Box:
    """Moves of a fit's coordinates, each between its bounds: ``|r - J d|² + |root (d + d0)|²``.

    Attributes
    ----------
    jacobian : (n, p) ndarray
    residual : (n,) ndarray
    hessian : (p, p) ndarray
    downhill : (p,) ndarray
    cost : float
        Without any move.
    low, high : (p,) ndarray
    """

    jacobian: Array
    residual: Array
    hessian: Array
    downhill: Array
    cost: float
    low: Array
    high: Array

    @classmethod
    def about(cls, fit: Fit, jacobian: Array, residual: Array, root: Array, departure: Array) -> Box:
        """All coordinates of a fit; ``departure`` is ``root d0``."""
        return cls(
            jacobian,
            residual,
            jacobian.T @ jacobian + root.T @ root,
            jacobian.T @ residual - root.T @ departure,
            float(residual @ residual + departure @ departure),
            np.array([c.low for c in fit.coordinates]) - fit.position,
            np.array([c.high for c in fit.coordinates]) - fit.position,
        )

    @property
    def matters(self) -> bool:
        """Whether a bound keeps the coordinates from where the data would have them."""
        free = np.linalg.solve(self.hessian, self.downhill)
        return bool(np.any((free < self.low - NEAR) | (free > self.high + NEAR)))


def bounded_minimum(
    hessian: Array, downhill: Array, low: Array, high: Array, begin: NDArray[np.int64] | None = None
) -> Array:
    """Minimum of ``x H x / 2 - g x`` between bounds, (n,).

    All coordinates that violate a bound, or are held at one that they would leave, change sides at once;
    if that does not reduce their number, only the last one does. Ends for every positive definite ``H``.

    Parameters
    ----------
    hessian : (n, n) ndarray
        Positive definite.
    downhill, low, high : (n,) ndarray
        Bounds may be infinite or equal.
    begin : (n,) ndarray, optional
        Coordinates that may be held: -1 at the lower bound, 1 at the upper one, 0 free. All free by default.

    Raises
    ------
    ConvergenceError
        Rounding keeps coordinates changing sides.

    Source: Júdice & Pires (1994), Computers & Operations Research 21, 587-596.

    >>> hessian, downhill = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([3.0, 3.0])
    >>> bounded_minimum(hessian, downhill, np.zeros(2), np.array([0.5, 9.0]))
    array([0.5 , 1.25])
    """
    side = np.zeros(len(downhill), dtype=int) if begin is None else begin.copy()
    steepness = np.diag(hessian)
    fewest, patience = len(downhill) + 1, PATIENCE
    found = np.empty(len(downhill))
    for _ in range(MOST_ROUNDS * len(downhill)):
        free = side == 0
        found[~free] = np.where(side < 0, low, high)[~free]
        right = downhill[free] - hessian[np.ix_(free, ~free)] @ found[~free]
        found[free] = cho_solve(cho_factor(hessian[np.ix_(free, free)]), right) if free.any() else right
        # by how much a coordinate that is held would move by itself
        pull = (downhill - hessian @ found) / steepness
        below, above = free & (found < low - NEAR), free & (found > high + NEAR)
        leaving = ((side < 0) & (pull > NEAR)) | ((side > 0) & (pull < -NEAR))
        wrong = np.flatnonzero(below | above | (leaving & (low < high)))
        if not wrong.size:
            return np.clip(found, low, high)
        if wrong.size < fewest:
            fewest, patience = wrong.size, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong = wrong[-1:]
        side[wrong] = above[wrong].astype(int) - below[wrong]
    raise ConvergenceError("screening", "rounding leaves no least value between bounds.")


@dataclass(frozen=True, slots=True)
class BoxedColumns:
    """Inner products of columns with a box's Jacobian, among themselves and with its residual."""

    box: Box
    with_jacobian: Array
    with_columns: Array
    with_residual: Array

    def costs(self, sets: NDArray[np.int64], spread: Array, one_sided: Array) -> Array:
        """Least of the quadratic form with the columns of each of several sets, amplitudes included, (k,).

        With the coordinates held that bounds hold without any column, all sets are solved at once; those
        that move others to or from their bounds are then solved one by one.

        Parameters
        ----------
        sets : (k, s) ndarray
        spread : (m,) ndarray
            Prior standard deviation of every amplitude.
        one_sided : (m,) ndarray of bool
            Amplitudes that cannot be negative.
        """
        held = HeldColumns.of(self)
        matrix = held.with_columns[sets[:, :, None], sets[:, None, :]]
        own = np.arange(sets.shape[1])
        matrix[:, own, own] += spread[sets] ** -2.0
        right = held.with_residual[sets]
        amplitudes = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
        refused = one_sided[sets] & (amplitudes < 0.0)
        if sets.shape[1] == 1:
            amplitudes[refused] = 0.0
            refused[:] = False
        costs = held.cost - np.sum(right * amplitudes, axis=1)
        side = held.sides(sets, amplitudes)
        moved = np.any(side != held.side, axis=1) | refused.any(axis=1)
        for index in np.flatnonzero(moved):
            costs[index], _ = self.least(sets[index], spread, one_sided, side[index])
        return costs

    def least(
        self,
        members: Sequence[int],
        spread: Array,
        one_sided: Array,
        begin: NDArray[np.int64] | None = None,
    ) -> tuple[float, Array]:
        """Least of the quadratic form with the columns of one set, and their amplitudes there, (s,).

        Parameters as of :meth:`costs`; ``begin`` says which of the box's coordinates may be held, as
        :func:`bounded_minimum` has it.
        """
        own = np.asarray(members, dtype=int)
        p = len(self.box.low)
        matrix = np.empty((p + len(own), p + len(own)))
        matrix[:p, :p] = self.box.hessian
        matrix[:p, p:] = self.with_jacobian[:, own]
        matrix[p:, :p] = matrix[:p, p:].T
        matrix[p:, p:] = self.with_columns[np.ix_(own, own)] + np.diag(spread[own] ** -2.0)
        right = np.concatenate((self.box.downhill, self.with_residual[own]))
        low = np.concatenate((self.box.low, np.where(one_sided[own], 0.0, -np.inf)))
        high = np.concatenate((self.box.high, np.full(len(own), np.inf)))
        side = None if begin is None else np.append(begin, np.zeros(len(own), dtype=int))
        move = bounded_minimum(matrix, right, low, high, side)
        return self.box.cost + float(move @ (matrix @ move)) - 2.0 * float(right @ move), move[p:]


@dataclass(frozen=True, slots=True)
class HeldColumns:
    """Columns beside a box whose coordinates are where the box alone has them at bounds, the others free.

    Attributes
    ----------
    side : (p,) ndarray
        -1 for a coordinate at its lower bound, 1 at its upper one, 0 for a free one.
    moves, by_columns : (p,) and (p, m) ndarray
        Moves of the free coordinates without columns, and less with each unit of one.
    pull, pull_less : (p,) and (p, m) ndarray
        By how much a held coordinate would move by itself, and less with each unit of a column.
    cost : float
        Without columns.
    with_columns, with_residual : (m, m) and (m,) ndarray
        Inner products in which what free coordinates absorb does not count.
    """

    box: Box
    side: NDArray[np.int64]
    moves: Array
    by_columns: Array
    pull: Array
    pull_less: Array
    cost: float
    with_columns: Array
    with_residual: Array

    @classmethod
    def of(cls, boxed: BoxedColumns) -> HeldColumns:
        """From the least of the box alone."""
        box, columns = boxed.box, boxed.with_jacobian
        moves = bounded_minimum(box.hessian, box.downhill, box.low, box.high)
        side = (moves >= box.high).astype(int) - (moves <= box.low)
        free = side == 0
        by_columns = np.zeros_like(columns)
        if free.any():
            factor = cho_factor(box.hessian[np.ix_(free, free)])
            right = box.downhill[free] - box.hessian[np.ix_(free, ~free)] @ moves[~free]
            moves[free] = cho_solve(factor, right)
            by_columns[free] = cho_solve(factor, columns[free])
        steepness = np.diag(box.hessian)
        return cls(
            box,
            side,
            moves,
            by_columns,
            (box.downhill - box.hessian @ moves) / steepness,
            (columns - box.hessian @ by_columns) / steepness[:, None],
            box.cost + float(moves @ (box.hessian @ moves)) - 2.0 * float(box.downhill @ moves),
            boxed.with_columns - columns[free].T @ by_columns[free],
            boxed.with_residual - columns.T @ moves,
        )

    def sides(self, sets: NDArray[np.int64], amplitudes: Array) -> NDArray[np.int64]:
        """Sides (k, p) on which coordinates are after amplitudes (k, s), those that were wrong changed."""
        box = self.box
        moves = self.moves - np.einsum("pks,ks->kp", self.by_columns[:, sets], amplitudes, optimize=True)
        pull = self.pull - np.einsum("pks,ks->kp", self.pull_less[:, sets], amplitudes, optimize=True)
        free = self.side == 0
        found = np.broadcast_to(self.side, moves.shape).copy()
        found[free & (moves < box.low - NEAR)] = -1
        found[free & (moves > box.high + NEAR)] = 1
        leaving = ((self.side < 0) & (pull > NEAR)) | ((self.side > 0) & (pull < -NEAR))
        found[leaving & (box.low < box.high)] = 0
        return found


@dataclass(frozen=True, slots=True)
class LinearProblem:
    """A problem about one of its fits: data = J u + sum of columns, with the belief as prior of u.

    Attributes
    ----------
    data : (n,) ndarray
        Whitened data less what the fit predicts without any departure of its coordinates.
    jacobian : (n, p) ndarray
        In coordinates whose prior is a unit normal.
    weight : (n,) ndarray
        Root of what each reading counts.
    """

    data: Array
    jacobian: Array
    weight: Array
    box: Box

    @classmethod
    def about(cls, problem: Problem, fit: Fit, trust: Fit | None = None) -> LinearProblem:
        """Linearise about a fit; coordinates pressed against a bound stay there.

        Parameters
        ----------
        trust : Fit or None
            Fit whose residuals show which readings are outliers; None for the first one.
        """
        predicted = problem.predict(fit.candidates, fit.coordinates, fit.position)
        jacobian = problem.whitened([p.sensitivity for p in predicted])
        residual = problem.data - problem.whitened([p.temperature for p in predicted])
        root, mean = fit.known.beside(len(fit.coordinates))
        # The tails that a robust fit discounts are discounted here too.
        astray = residual if trust is None else trust.residual
        weight = np.sqrt(outlier_weight(astray))
        departure = root @ (fit.position - mean)
        downhill = jacobian.T @ (weight**2 * residual) - root.T @ departure
        free = ~_pressed(fit, downhill)
        # Belief about the free coordinates, given those that stay.
        q, r = np.linalg.qr(root[:, free])
        unit = np.linalg.solve(r.T, jacobian[:, free].T).T
        return cls(
            weight * (residual + unit @ (q.T @ departure)),
            weight[:, None] * unit,
            weight,
            Box.about(fit, weight[:, None] * jacobian, weight * residual, root, departure),
        )

    def boxed(self, columns: Array) -> BoxedColumns:
        """Columns (n, m) whose amplitudes are looked for together with coordinates within their bounds."""
        columns = self.weight[:, None] * columns
        return BoxedColumns(
            self.box,
            self.box.jacobian.T @ columns,
            columns.T @ columns,
            columns.T @ self.box.residual,
        )

    def gram(self, columns: Array) -> tuple[Array, Array, float]:
        """Inner products in which what the coordinates can absorb does not count.

        Parameters
        ----------
        columns : (n, m) ndarray
            Whitened.

        Returns
        -------
        (m, m) ndarray, of the columns; (m,) ndarray, with the data; float, of the data
        """
        n = self.jacobian.shape[1]
        lower = np.linalg.cholesky(np.eye(n) + self.jacobian.T @ self.jacobian)
        columns = self.weight[:, None] * columns
        seen = solve_triangular(lower, self.jacobian.T @ columns, lower=True)
        data = solve_triangular(lower, self.jacobian.T @ self.data, lower=True)
        return (
            columns.T @ columns - seen.T @ seen,
            columns.T @ self.data - seen.T @ data,
            float(self.data @ self.data - data @ data),
        )
