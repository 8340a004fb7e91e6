"""Cylinder that rotates in still fluid (Becker)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_correlation


@ROTATING_FILMS.register
@rotating_correlation(800.0, 1.0e5)
def nusselt_becker(reynolds: Array, prandtl: Array = 0.71) -> Array:
    """Nusselt number of a horizontal cylinder that rotates in still fluid, on the diameter.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    prandtl : (n,) array_like, [-]

    Source: Becker (1963), Int. J. Heat Mass Transfer 6, 1053–1062.

    >>> float(nusselt_becker(1.0e4, 0.71).round(2))
    55.07
    """
    return 0.133 * np.cbrt(reynolds) ** 2 * np.cbrt(prandtl)
