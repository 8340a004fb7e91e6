"""Developed laminar flow of viscous liquids in a helical coil, measured (Janssen & Hoogendoorn)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@FILM_MODELS.register
@nusselt_correlation(
    source="Janssen & Hoogendoorn 1978",
    regime="laminar",
    derived=lambda reynolds, prandtl, curvature_ratio: {"dean": reynolds * np.sqrt(curvature_ratio)},
    dean=(100.0, 830.0),
    prandtl=(20.0, 450.0),
    curvature_ratio=(0.010, 0.083),
)
def nusselt_janssen_hoogendoorn(reynolds: Array, prandtl: Array, curvature_ratio: Array) -> Array:
    """Nusselt number of developed laminar flow in a helical coil, measured in round tubes.

    Parameters
    ----------
    reynolds, prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.

    Source: Janssen & Hoogendoorn (1978), Int. J. Heat Mass Transfer 21,
    1197–1206; as reviewed by Naphon & Wongwises (2006).

    >>> float(nusselt_janssen_hoogendoorn(1000.0, 300.0, 0.048).round(1))
    28.6
    """
    return 0.7 * reynolds**0.43 * prandtl ** (1.0 / 6.0) * curvature_ratio**0.07
