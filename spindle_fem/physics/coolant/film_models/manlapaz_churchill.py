"""Developed laminar flow in a helical coil, theory for every Prandtl number (Manlapaz & Churchill)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Manlapaz & Churchill 1981",
    regime="laminar",
    counts=True,
    dean=(0.0, np.inf),
    prandtl=(0.0, np.inf),
)
def nusselt_manlapaz_churchill(dean: Array, prandtl: Array) -> Array:
    """Nusselt number of developed laminar flow in a helical coil, uniform wall temperature.

    Parameters
    ----------
    dean : (n,) array_like, [-]
        Re √(D_h/D_c).
    prandtl : (n,) array_like, [-]

    Range: laminar, every Dean and Prandtl number; no thermal entry.

    Source: Manlapaz & Churchill (1981), Chem. Eng. Commun. 9, 185–200.

    >>> float(nusselt_manlapaz_churchill(64.16, 1214.0).round(2))
    10.34
    """
    # The first term in a form that stays finite at De = 0.
    mixing = dean**2 * prandtl
    secondary = 4.343 * (mixing / (mixing + 957.0)) ** 2
    boundary_layer = 1.158 * (dean * prandtl / (prandtl + 0.477)) ** 1.5
    return np.cbrt((3.657 + secondary) ** 3 + boundary_layer)
