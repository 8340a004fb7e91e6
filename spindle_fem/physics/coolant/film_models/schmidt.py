"""Laminar flow in a helical coil as the VDI Heat Atlas has it (Schmidt); high for oil."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Schmidt 1967",
    regime="laminar",
    counts=True,
    reynolds=(100.0, 2.2e4),
    prandtl=(0.5, np.inf),
    curvature_ratio=(0.012, 0.2),
    viscosity_ratio=(0.0044, 9.75),
)
def nusselt_schmidt(
    reynolds: Array, prandtl: Array, curvature_ratio: Array, viscosity_ratio: Array = 1.0
) -> Array:
    """Nusselt number of laminar flow in a helical coil, as the VDI Heat Atlas has it.

    Parameters
    ----------
    reynolds, prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.
    viscosity_ratio : (n,) array_like, [-]
        Dynamic viscosity at bulk over that at wall temperature.

    Range: up to the critical Reynolds number. The source sets no upper Prandtl
    number; it was fitted at low and moderate ones and reads high for oil.

    Source: Schmidt (1967), Chem.-Ing.-Techn. 39, 781–789; VDI Heat Atlas, section G3.

    >>> float(nusselt_schmidt(292.0, 1214.0, 0.04827).round(1))
    42.0
    """
    exponent = 0.5 + 0.2903 * curvature_ratio**0.194
    mixing = 0.08 * (1.0 + 0.8 * curvature_ratio**0.9)
    return 3.66 + mixing * reynolds**exponent * np.cbrt(prandtl) * viscosity_ratio**0.14
