"""Laminar oil flow in a helical coil, measured (Seban & McLaughlin)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.duct_friction import friction_factor_curved_laminar
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Seban & McLaughlin 1963",
    regime="laminar",
    reynolds=(12.0, 5600.0),
    prandtl=(100.0, 657.0),
    curvature_ratio=(0.0096, 0.059),
)
def nusselt_seban_mclaughlin(reynolds: Array, prandtl: Array, curvature_ratio: Array) -> Array:
    """Nusselt number of laminar oil flow in a helical coil, measured.

    Parameters
    ----------
    reynolds, prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.

    Range: round tubes with uniform heat flux; 0.13 is the mean over the circumference.

    Source: Seban & McLaughlin (1963), Int. J. Heat Mass Transfer 6, 387–395:
    Nu = 0.13 (f/8 Re² Pr)^(1/3), f the Darcy factor of the coil; as reviewed by
    Naphon & Wongwises (2006), Renew. Sustain. Energy Rev. 10, 463–490.

    >>> float(nusselt_seban_mclaughlin(652.0, 562.0, 0.04827).round(1))
    22.3
    """
    dean = reynolds * np.sqrt(curvature_ratio)
    darcy = 64.0 / reynolds * friction_factor_curved_laminar(dean, extrapolate=True)
    return 0.13 * np.cbrt(darcy / 8.0 * reynolds**2 * prandtl)
