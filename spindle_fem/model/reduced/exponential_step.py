"""Steps of a small linear model by the matrix exponential: exact for loads that are linear in time.

With ``f`` the loads, the model ``M u' = f − K u`` over a step of length h is

    d/ds (u, f, Δ) = ((−h M⁻¹K, h M⁻¹, 0), (0, 0, 1), (0, 0, 0)) (u, f, Δ),   0 <= s <= 1

with Δ the change of the loads, whose exponential holds every matrix of the
step; derivatives are Fréchet derivatives of the exponential.

Source: Van Loan (1978), IEEE Trans. Automatic Control 23, 395-404; Al-Mohy &
Higham (2009), SIAM J. Matrix Anal. Appl. 30, 1639-1657.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, expm_frechet

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ExactPropagator:
    """One step of given length as matrices.

    Attributes
    ----------
    step : float, [s]
    advance : (r, r) ndarray
        ``u_1`` from ``u_0`` without loads.
    from_start, from_end : (r, r) ndarray, [K/W]
        ``u_1`` from a load at the start and at the end of the step.
    inverse_storage, conduction : (r, r) ndarray, [K/J], [W/K]
    """

    step: float
    advance: Array
    from_start: Array
    from_end: Array
    inverse_storage: Array
    conduction: Array

    def load_values(self, start: Array, end: Array, loads: Array) -> Array:
        """Loads of many steps at both of their ends side by side, (n, 2 r) W."""
        return np.hstack((start @ loads.T, end @ loads.T))

    def forcing(
        self,
        before: Array,
        load_values: Array,
        conduction_by: Array | None,
        storage_by: Array | None,
        load_start: Array | None,
        load_end: Array | None,
    ) -> Array:
        """Contribution of one parameter to the derivative of ``u_1`` in many equal steps.

        Parameters
        ----------
        before : (n, r) ndarray
        load_values : (n, 2 r) ndarray
            As :meth:`load_values` gives them.
        conduction_by, storage_by : (r, r) ndarray or None
            Derivatives of the matrices.
        load_start, load_end : (n, r) ndarray or None
            Derivatives of the loads at both ends.

        Returns
        -------
        (n, r) ndarray
        """
        found = np.zeros_like(before)
        size = len(self.advance)
        if conduction_by is not None or storage_by is not None:
            none = np.zeros((size, size))
            # d(M⁻¹) = −M⁻¹ dM M⁻¹
            inverse_by = -self.inverse_storage @ (none if storage_by is None else storage_by)
            inverse_by = inverse_by @ self.inverse_storage
            rate_by = inverse_by @ self.conduction
            if conduction_by is not None:
                rate_by = rate_by + self.inverse_storage @ conduction_by
            direction = np.zeros((3 * size, 3 * size))
            direction[:size, :size] = -self.step * rate_by
            direction[:size, size : 2 * size] = self.step * inverse_by
            generator = _generator(self.inverse_storage, self.conduction, self.step)
            change = expm_frechet(generator, direction, compute_expm=False)[:size]
            level, ramp = change[:, size : 2 * size], change[:, 2 * size :]
            found += before @ change[:, :size].T
            found += load_values[:, :size] @ (level - ramp).T + load_values[:, size:] @ ramp.T
        if load_start is not None:
            found += load_start @ self.from_start.T + load_end @ self.from_end.T
        return found


def _generator(inverse_storage: Array, conduction: Array, step: float) -> Array:
    size = len(inverse_storage)
    generator = np.zeros((3 * size, 3 * size))
    generator[:size, :size] = -step * inverse_storage @ conduction
    generator[:size, size : 2 * size] = step * inverse_storage
    generator[size : 2 * size, 2 * size :] = np.eye(size)
    return generator


def build_exact_propagator(storage: Array, conduction: Array, step: float) -> ExactPropagator:
    """Matrices of one step.

    Parameters
    ----------
    storage, conduction : (r, r) ndarray, [J/K], [W/K]
    step : float, [s]

    >>> import numpy as np
    >>> step = build_exact_propagator(np.eye(1) * 50.0, np.eye(1), 50.0)
    >>> round(float(step.advance[0, 0]), 12), round(float((step.from_start + step.from_end)[0, 0]), 12)
    (0.367879441171, 0.632120558829)
    """
    inverse = np.linalg.inv(storage)
    size = len(storage)
    matrix = expm(_generator(inverse, conduction, step))[:size]
    level, ramp = matrix[:, size : 2 * size], matrix[:, 2 * size :]
    return ExactPropagator(step, matrix[:, :size], level - ramp, ramp, inverse, conduction)
