"""End of laminar flow in a helical channel, and the bridge to turbulent flow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.correlation import Array, correlation

TURBULENT_FROM_REYNOLDS = 2.2e4


@correlation(
    how_to_fix="A channel this tightly wound has no source; use a larger coil diameter.",
    curvature_ratio=(0.0, 0.2),
)
def critical_reynolds_schmidt(curvature_ratio: Array) -> Array:
    """Reynolds number at which laminar flow in a helical coil ends.

    Parameters
    ----------
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter, 0 for a straight duct.

    Source: Schmidt (1967), Chem.-Ing.-Techn. 39, 781–789.

    >>> float(critical_reynolds_schmidt(10.909 / 226.0).round(0))
    7357.0
    """
    return 2300.0 * (1.0 + 8.6 * curvature_ratio**0.45)


@correlation(how_to_fix="Use critical_reynolds_schmidt.", curvature_ratio=(0.0012, 0.067))
def critical_reynolds_ito(curvature_ratio: Array) -> Array:
    """Reynolds number at which laminar flow in a curved pipe ends, from friction.

    Parameters
    ----------
    curvature_ratio : (n,) array_like, [-]
        Pipe over coil diameter.

    Source: Ito (1959), J. Basic Eng. 81, 123–134.

    >>> float(critical_reynolds_ito(10.909 / 226.0).round(0))
    7582.0
    """
    return 2.0e4 * curvature_ratio**0.32


def transition_weight(reynolds: ArrayLike, critical_reynolds: ArrayLike) -> NDArray[np.float64]:
    """Share of the laminar value between the critical Reynolds number and 2.2e4.

    Parameters
    ----------
    reynolds, critical_reynolds : (n,) array_like, [-]

    Returns
    -------
    (n,) ndarray, [-]
        1 in laminar, 0 in turbulent flow, linear between.

    Source: Gnielinski (1986); VDI Heat Atlas, section G3.

    >>> transition_weight([5000.0, 15000.0, 30000.0], 8000.0).tolist()
    [1.0, 0.5, 0.0]
    """
    critical = np.asarray(critical_reynolds, float)
    share = (TURBULENT_FROM_REYNOLDS - np.asarray(reynolds, float)) / (TURBULENT_FROM_REYNOLDS - critical)
    return np.clip(share, 0.0, 1.0)
