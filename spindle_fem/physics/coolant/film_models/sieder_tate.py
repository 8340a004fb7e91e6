"""Laminar flow that develops thermally in a straight duct, on the hydraulic diameter (Sieder & Tate)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Sieder & Tate 1936", regime="laminar", graetz=(10.0, np.inf), viscosity_ratio=(0.0044, 9.75)
)
def nusselt_sieder_tate(graetz: Array, viscosity_ratio: Array = 1.0) -> Array:
    """Mean Nusselt number of laminar flow that develops thermally in a straight duct.

    Parameters
    ----------
    graetz : (n,) array_like, [-]
        Re Pr D/L with the length D on which the Nusselt number is wanted.
    viscosity_ratio : (n,) array_like, [-]
        Dynamic viscosity at bulk over that at wall temperature.

    With viscosity ratio 1 and the channel depth as length it is equation 31 of Wu & Tan (2016).

    Source: Sieder & Tate (1936), Ind. Eng. Chem. 28, 1429–1435.

    >>> float(nusselt_sieder_tate(1000.0).round(2))
    18.6
    """
    return 1.86 * np.cbrt(graetz) * viscosity_ratio**0.14
