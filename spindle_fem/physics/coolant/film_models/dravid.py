"""Developed laminar flow in a helical coil, computed and measured (Dravid and others)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Dravid, Smith, Merrill & Brian 1971", regime="laminar", dean=(50.0, 2000.0), prandtl=(5.0, 175.0)
)
def nusselt_dravid(dean: Array, prandtl: Array) -> Array:
    """Nusselt number of developed laminar flow in a helical coil, computed and measured.

    Parameters
    ----------
    dean : (n,) array_like, [-]
        Re √(D_h/D_c).
    prandtl : (n,) array_like, [-]

    Range: round tubes with uniform heat flux.

    Source: Dravid, Smith, Merrill & Brian (1971), AIChE J. 17, 1114–1122; as
    reviewed by Naphon & Wongwises (2006).

    >>> float(nusselt_dravid(100.0, 100.0).round(1))
    16.3
    """
    return (0.76 + 0.65 * np.sqrt(dean)) * prandtl**0.175
