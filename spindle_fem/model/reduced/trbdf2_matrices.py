"""TR-BDF2 steps of a reduced model as precomputed matrices, with their exact derivatives.

The two stages of a step of length h, with γ = 2 − √2 and d = γ/2, are

    (M + d h K) u_γ = (M − d h K) u_0 + d h ((2 − γ) f_0 + γ f_1)
    (M + d h K) u_1 = M (a u_γ − b u_0) + d h f_1

for loads that are linear in time over the step: second order, L-stable, one
matrix for both stages.

Source: Bank et al. (1985), IEEE Trans. CAD 4, 436-451.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.reduced.exponential_step import ExactPropagator
from spindle_fem.model.trbdf2 import DIAGONAL, GAMMA, STAGE_WEIGHT, START_WEIGHT

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Propagator:
    """One step of given length as matrices.

    Attributes
    ----------
    step : float, [s]
    advance : (r, r) ndarray
        ``u_1`` from ``u_0`` without loads.
    stage : (r, r) ndarray
        ``u_γ`` from ``u_0`` without loads.
    inverse : (r, r) ndarray
        ``(M + d h K)⁻¹``.
    carried : (r, r) ndarray
        What a right-hand side of the first stage adds to ``u_1``.
    """

    step: float
    advance: Array
    stage: Array
    inverse: Array
    carried: Array

    @property
    def from_start(self) -> Array:
        """``u_1`` from a load at the start of the step, (r, r) K/W."""
        return DIAGONAL * self.step * (2.0 - GAMMA) * self.carried

    @property
    def from_end(self) -> Array:
        """``u_1`` from a load at the end of the step, (r, r) K/W."""
        return DIAGONAL * self.step * (GAMMA * self.carried + self.inverse)


def build_propagator(storage: Array, conduction: Array, step: float) -> Propagator:
    """Matrices of one step.

    Parameters
    ----------
    storage, conduction : (r, r) ndarray, [J/K], [W/K]
    step : float, [s]
    """
    inverse = np.linalg.inv(storage + DIAGONAL * step * conduction)
    held = inverse @ storage
    # (M + d h K)⁻¹ (M - d h K) is 2 (M + d h K)⁻¹ M - 1.
    stage = 2.0 * held
    stage[np.diag_indices_from(stage)] -= 1.0
    advance = held @ (STAGE_WEIGHT * stage)
    advance -= START_WEIGHT * held
    return Propagator(step, advance, stage, inverse, held @ (STAGE_WEIGHT * inverse))


def load_response(propagator: Propagator | ExactPropagator, start: Array, end: Array, loads: Array) -> Array:
    """Contribution of linear loads to ``u_1`` in many equal steps.

    Parameters
    ----------
    start, end : (n, n_w) ndarray
        Load inputs at both ends of each step.
    loads : (r, n_w) ndarray

    Returns
    -------
    (n, r) ndarray, [K]
    """
    return start @ (propagator.from_start @ loads).T + end @ (propagator.from_end @ loads).T


def stage_values(
    propagator: Propagator | ExactPropagator, before: Array, start: Array, end: Array, loads: Array
) -> Array:
    """Input of :func:`sensitivity_forcing` for equal steps: ``u_γ`` (n, r); for exact ones, the loads."""
    if isinstance(propagator, ExactPropagator):
        return propagator.load_values(start, end, loads)
    weight = DIAGONAL * propagator.step
    matrix = propagator.inverse @ loads
    return before @ propagator.stage.T + weight * ((2.0 - GAMMA) * start + GAMMA * end) @ matrix.T


@dataclass(frozen=True, slots=True)
class MatrixChange:
    """Derivatives of a system to one parameter; None where it does not enter.

    Attributes
    ----------
    conduction, storage : (r, r) ndarray or None
    load_start, load_end : (n, r) ndarray or None
        Loads at both ends of each step.
    """

    conduction: Array | None = None
    storage: Array | None = None
    load_start: Array | None = None
    load_end: Array | None = None

    @property
    def enters(self) -> bool:
        """Whether the parameter changes anything."""
        return any(item is not None for item in (self.conduction, self.storage, self.load_start))


def sensitivity_forcing(
    propagator: Propagator | ExactPropagator,
    before: Array,
    stage: Array,
    after: Array,
    changes: Sequence[MatrixChange],
) -> Array:
    """Contribution of parameters to the derivative of ``u_1`` in many equal steps.

    Parameters
    ----------
    before, stage, after : (n, r) ndarray
        ``u_0``, :func:`stage_values` and ``u_1`` of each step.
    changes : sequence of MatrixChange
        One a parameter.

    Returns
    -------
    (n, r, p) ndarray
    """
    if isinstance(propagator, ExactPropagator):
        columns = [
            propagator.forcing(before, stage, c.conduction, c.storage, c.load_start, c.load_end)
            for c in changes
        ]
        return np.stack(columns, axis=2) if columns else np.zeros((*before.shape, 0))
    weight = DIAGONAL * propagator.step
    # Defects of both halves of the step; all parameters that enter share the products with the inverses.
    entering = [i for i, change in enumerate(changes) if change.enters]
    entered = [changes[i] for i in entering]
    n, size = before.shape
    first = np.zeros((n, len(entered), size))
    second = np.zeros_like(first)
    by_conduction = [i for i, change in enumerate(entered) if change.conduction is not None]
    if by_conduction:
        # All matrices below each other: two wide products give what every parameter does in every step.
        tall = np.concatenate([entered[i].conduction for i in by_conduction])
        first[:, by_conduction] = (-weight * (before + stage) @ tall.T).reshape(n, -1, size)
        second[:, by_conduction] = (-weight * after @ tall.T).reshape(n, -1, size)
    for i, change in enumerate(entered):
        if change.storage is not None:
            first[:, i] += (before - stage) @ change.storage.T
            second[:, i] += (STAGE_WEIGHT * stage - START_WEIGHT * before - after) @ change.storage.T
        if change.load_start is not None:
            first[:, i] += weight * ((2.0 - GAMMA) * change.load_start + GAMMA * change.load_end)
            second[:, i] += weight * change.load_end
    moved = first.reshape(-1, size) @ propagator.carried.T
    moved += second.reshape(-1, size) @ propagator.inverse.T
    columns = moved.reshape(first.shape).transpose(0, 2, 1)
    if len(entering) == len(changes):
        return np.ascontiguousarray(columns)
    found = np.zeros((n, size, len(changes)))
    found[:, :, entering] = columns
    return found


def group_steps(step_class: NDArray[np.int64], steps: Array) -> Mapping[tuple[int, float], NDArray[np.int64]]:
    """Steps by operating class and length, to a microsecond."""
    lengths, length = np.unique(np.round(steps, 6), return_inverse=True)
    # One whole number for both: rows of a table take ten times as long to sort.
    keys, label = np.unique(step_class * len(lengths) + length, return_inverse=True)
    return {
        (int(key) // len(lengths), float(lengths[key % len(lengths)])): np.flatnonzero(label == number)
        for number, key in enumerate(keys)
    }
