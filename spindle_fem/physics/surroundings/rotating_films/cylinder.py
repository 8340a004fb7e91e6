"""Cylinder that rotates in still air, slowly or fast (Becker, Dropkin & Carmi)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_films.becker import nusselt_becker
from spindle_fem.physics.surroundings.rotating_films.dropkin_carmi import nusselt_dropkin_carmi
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_correlation

(_SLOWEST, _BECKER_ENDS), (_CARMI_BEGINS, _FASTEST) = (
    law.ranges["reynolds"] for law in (nusselt_becker, nusselt_dropkin_carmi)
)


@ROTATING_FILMS.register
@rotating_correlation(_SLOWEST, _FASTEST)
def nusselt_cylinder(reynolds: Array, prandtl: Array = 0.71) -> Array:
    """Nusselt number of a horizontal cylinder that rotates in still air, on the diameter.

    Becker's up to Re 8000, where the range of Dropkin & Carmi begins, and theirs from 1e5 on, where his ends;
    between them one passes into the other evenly over the logarithm of the Reynolds number, so that nothing
    jumps. Theirs is lower there, by 17 % at first and by 10 % at last.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    prandtl : (n,) array_like, [-]

    Source: Becker (1963), Int. J. Heat Mass Transfer 6, 1053–1062; Dropkin & Carmi (1957), Trans. ASME 79,
    741–749.

    >>> nusselt_cylinder([5.0e3, 3.0e4, 4.0e5]).round(1).tolist()
    [34.7, 106.3, 609.2]
    """
    passed = np.log(np.clip(reynolds, _CARMI_BEGINS, _BECKER_ENDS) / _CARMI_BEGINS)
    share = passed / np.log(_BECKER_ENDS / _CARMI_BEGINS)
    slow = nusselt_becker(reynolds, prandtl, extrapolate=True)
    fast = nusselt_dropkin_carmi(reynolds, prandtl, extrapolate=True)
    return slow ** (1.0 - share) * fast**share
