"""Vertical plate in still air (Churchill & Chu)."""

from __future__ import annotations

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.surroundings.natural_films import NATURAL_FILMS
from spindle_fem.validity import POSITIVE


@NATURAL_FILMS.register
@correlation(how_to_fix="Check temperatures and height.", rayleigh=(0.0, 1.0e12), prandtl=POSITIVE)
def nusselt_churchill_chu_plate(rayleigh: Array, prandtl: Array) -> Array:
    """Mean Nusselt number of natural convection on a vertical plate, on the height.

    Parameters
    ----------
    rayleigh : (n,) array_like, [-]
        On the height; 0 is allowed.
    prandtl : (n,) array_like, [-]

    Source: Churchill & Chu (1975), Int. J. Heat Mass Transfer 18, 1323–1329.

    >>> float(nusselt_churchill_chu_plate(1.0e7, 0.71).round(2))
    31.21
    """
    prandtl_term = (1.0 + (0.492 / prandtl) ** (9.0 / 16.0)) ** (8.0 / 27.0)
    return (0.825 + 0.387 * rayleigh ** (1.0 / 6.0) / prandtl_term) ** 2
