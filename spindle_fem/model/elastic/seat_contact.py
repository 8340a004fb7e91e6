"""Which rings are tight on their seats, how hard they press, and where a gap opens: all seats at once.

Seats of one body yield together. With gap g and pressure p at every seat, g = g0 + M p, g ≥ 0, p ≥ 0 and
g p = 0: the bodies apart would leave gaps g0 (negative: they overlap), M is their compliance. That is
the minimum of a convex energy, found by non-negative least squares.

Source: Johnson, Contact Mechanics (1985), section 5.4, for the complementary form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]


def solve_seats(gap: Array, compliance: Array, areas: Array) -> tuple[Array, Array]:
    """Pressures [Pa] and gaps [m] of seats, both (n,) and neither negative.

    Parameters
    ----------
    gap : (n,) ndarray, [m]
        Without any pressure; negative where the bodies would overlap.
    compliance : (n, n) ndarray, [m/Pa]
        Opening of each gap by a pressure in each seat.
    areas : (n,) ndarray, [m²]

    >>> compliance = np.array([[2e-12, 0.5e-12], [0.5e-12, 2e-12]])
    >>> p, g = solve_seats(np.array([-4e-6, 2e-6]), compliance, np.ones(2))
    >>> (p / 1e6).round(6), (g * 1e6).round(6)
    (array([2., 0.]), array([0., 3.]))
    """
    # Work of the pressures on the gaps is symmetric: area times compliance.
    energy = areas[:, None] * compliance
    lower = np.linalg.cholesky(0.5 * (energy + energy.T))
    pressure, _ = nnls(lower.T, np.linalg.solve(lower, -areas * gap))
    opening = gap + compliance @ pressure
    return pressure, np.where(pressure > 0.0, 0.0, np.maximum(opening, 0.0))
