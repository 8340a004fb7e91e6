"""Cylinder that rotates fast in still air (Dropkin & Carmi)."""

from __future__ import annotations

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_correlation


@ROTATING_FILMS.register
@rotating_correlation(8.0e3, 4.3e5)
def nusselt_dropkin_carmi(reynolds: Array, prandtl: Array = 0.71) -> Array:
    """Nusselt number of a horizontal cylinder that rotates fast in still air, on the diameter.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    prandtl : (n,) array_like, [-]
        Without influence: measured in air.

    Natural convection plays no part above Re 15 000.

    Source: Dropkin & Carmi (1957), Trans. ASME 79, 741–749.

    >>> float(nusselt_dropkin_carmi(1.0e5).round(1))
    230.8
    """
    return 0.073 * reynolds**0.7
