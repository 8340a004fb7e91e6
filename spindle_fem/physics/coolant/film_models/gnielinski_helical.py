"""Developed turbulent flow in a helical coil (Gnielinski)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.duct_friction import friction_factor_helical_turbulent
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS


@FILM_MODELS.register
@nusselt_correlation(
    source="Gnielinski 1986",
    regime="turbulent",
    counts=True,
    reynolds=(TURBULENT_FROM_REYNOLDS, 1.5e5),
    prandtl=(0.6, 2000.0),
    curvature_ratio=(0.0, 0.2),
)
def nusselt_gnielinski_helical(
    reynolds: Array, prandtl: Array, curvature_ratio: Array, prandtl_ratio: Array = 1.0
) -> Array:
    """Nusselt number of developed turbulent flow in a helical coil.

    Parameters
    ----------
    reynolds, prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter; 0 is a straight duct.
    prandtl_ratio : (n,) array_like, [-]
        Prandtl number at bulk over that at wall temperature.

    Source: Gnielinski (1986), Proc. 8th Int. Heat Transfer Conf. 6, 2847–2854; VDI
    Heat Atlas, section G3: the straight-duct equation with the friction of the coil.

    >>> float(nusselt_gnielinski_helical(3.0e4, 100.0, 0.05).round(0))
    671.0
    """
    eighth = friction_factor_helical_turbulent(reynolds, curvature_ratio, extrapolate=True) / 8.0
    denominator = 1.0 + 12.7 * np.sqrt(eighth) * (np.cbrt(prandtl) ** 2 - 1.0)
    return eighth * reynolds * prandtl / denominator * prandtl_ratio**0.14
