"""Face of a disc that rotates in still air, laminar inside and turbulent outside (Cobb & Saunders)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_correlation

_TRANSITION_REYNOLDS = 2.4e5


@ROTATING_FILMS.register
@rotating_correlation(0.0, 5.0e6, on_radius=True)
def nusselt_rotating_disc(reynolds: Array, prandtl: Array = 0.71) -> Array:
    """Mean Nusselt number of an isothermal disc that rotates in still air, on the outer radius.

    Laminar inside the radius where ω r²/ν = 2.4e5, turbulent outside it; the
    mean over the area has no jump and tends to 0.015 Re^0.8.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω R²/ν with the outer radius.
    prandtl : (n,) array_like, [-]
        Without influence: measured in air.

    Source: Cobb & Saunders (1956), Proc. R. Soc. A 236, 343–351; Dorfman (1963):
    local 0.36 Re_r^0.5 laminar, mean 0.015 Re^0.8 of an all-turbulent disc.

    >>> nusselt_rotating_disc([1.0e5, 2.4e5, 4.0e6]).round(1).tolist()
    [113.8, 176.4, 2838.2]
    """
    # Share of the area that is laminar: (r_c/R)².
    core = np.minimum(_TRANSITION_REYNOLDS / np.maximum(reynolds, _TRANSITION_REYNOLDS), 1.0)
    return 0.36 * np.sqrt(reynolds) * core + 0.015 * reynolds**0.8 * (1.0 - core**1.3)
