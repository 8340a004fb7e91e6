"""Laminar flow that develops thermally in a straight rectangular duct (Shah & London with Hausen)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.film_correlation import HOW_TO_FIX, nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS


@correlation(how_to_fix=HOW_TO_FIX, aspect_ratio=(0.0, 1.0))
def nusselt_rectangle(aspect_ratio: Array) -> Array:
    """Nusselt number of developed laminar flow in a straight rectangular duct.

    Uniform wall temperature on all four sides, on the hydraulic diameter.

    Parameters
    ----------
    aspect_ratio : (n,) array_like, [-]
        Short over long side: 0 (slit) to 1 (square).

    Source: Shah & London (1978), Laminar Flow Forced Convection in Ducts,
    polynomial within 0.1 % of their table.

    >>> nusselt_rectangle([0.0, 1.0]).round(2).tolist()
    [7.54, 2.98]
    """
    a = aspect_ratio
    return 7.541 * (1.0 + a * (-2.610 + a * (4.970 + a * (-5.119 + a * (2.702 - 0.548 * a)))))


@correlation(how_to_fix=HOW_TO_FIX, graetz=(0.0, np.inf), nusselt_developed=(0.0, np.inf))
def nusselt_hausen(graetz: Array, nusselt_developed: Array) -> Array:
    """Mean Nusselt number over the thermal entry of a straight duct.

    Parameters
    ----------
    graetz : (n,) array_like, [-]
        Re Pr D_h/L.
    nusselt_developed : (n,) array_like, [-]
        Far from the inlet, for example ``nusselt_rectangle``.

    Range: laminar, velocity profile developed (Pr > 5), uniform wall temperature.

    Source: Hausen (1943), VDI-Z Beih. Verfahrenstechnik 4, 91–98; the entry
    term of the round tube is used for other ducts, on the hydraulic diameter.

    >>> float(nusselt_hausen(1090.0, 3.0).round(1))
    16.9
    """
    return nusselt_developed + 0.0668 * graetz / (1.0 + 0.04 * np.cbrt(graetz) ** 2)


@FILM_MODELS.register
@nusselt_correlation(
    source="Shah & London 1978 with Hausen 1943",
    regime="laminar",
    counts=True,
    graetz=(0.0, np.inf),
    aspect_ratio=(0.0, 1.0),
)
def nusselt_straight_developing(graetz: Array, aspect_ratio: Array) -> Array:
    """Mean Nusselt number of a straight rectangular duct with its thermal entry.

    A coil never does worse: curvature can only mix.

    Parameters
    ----------
    graetz : (n,) array_like, [-]
        Re Pr D_h/L.
    aspect_ratio : (n,) array_like, [-]
        Short over long side.

    Source: ``nusselt_rectangle`` and ``nusselt_hausen``.

    >>> float(nusselt_straight_developing(0.0, 1.0).round(2))
    2.98
    """
    return nusselt_hausen(graetz, nusselt_rectangle(aspect_ratio))
