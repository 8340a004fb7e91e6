"""Nusselt numbers of helical channels, one function per correlation.

Ranges and refusal are those of ``coolant.nusselt``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant.duct_friction import (
    friction_factor_curved_laminar,
    friction_factor_helical_turbulent,
)
from spindle_fem.physics.coolant.nusselt import guard_range


def nusselt_schmidt(
    reynolds: ArrayLike,
    prandtl: ArrayLike,
    curvature_ratio: ArrayLike,
    viscosity_ratio: ArrayLike = 1.0,
    *,
    extrapolate: bool = False,
) -> NDArray[np.float64]:
    """Nusselt number of laminar flow in a helical coil, as the VDI Heat Atlas has it.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
    prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.
    viscosity_ratio : (n,) array_like, [-]
        Dynamic viscosity at bulk over that at wall temperature.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 100 <= Re <= Re_critical, 0.012 <= D_h/D_c <= 0.2, Pr >= 0.5. The
    source sets no upper Prandtl number; it was fitted at low and moderate ones
    and reads high for oil.

    Source: Schmidt (1967), Chem.-Ing.-Techn. 39, 781–789; VDI Heat Atlas, section G3.

    >>> float(nusselt_schmidt(292.0, 1214.0, 0.04827).round(1))
    42.0
    """
    re, pr, delta, ratio = np.broadcast_arrays(
        np.asarray(reynolds, float),
        np.asarray(prandtl, float),
        np.asarray(curvature_ratio, float),
        np.asarray(viscosity_ratio, float),
    )
    guard_range(
        "nusselt_schmidt",
        extrapolate,
        reynolds=re,
        prandtl=pr,
        curvature_ratio=delta,
        viscosity_ratio=ratio,
    )
    exponent = 0.5 + 0.2903 * delta**0.194
    return 3.66 + 0.08 * (1.0 + 0.8 * delta**0.9) * re**exponent * np.cbrt(pr) * ratio**0.14


def nusselt_manlapaz_churchill(
    dean: ArrayLike, prandtl: ArrayLike, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of developed laminar flow in a helical coil, uniform wall temperature.

    Parameters
    ----------
    dean : (n,) array_like, [-]
        Re √(D_h/D_c).
    prandtl : (n,) array_like, [-]
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Negative input, unless ``extrapolate``.

    Range: laminar, every Dean and Prandtl number; no thermal entry.

    Source: Manlapaz & Churchill (1981), Chem. Eng. Commun. 9, 185–200.

    >>> float(nusselt_manlapaz_churchill(64.16, 1214.0).round(2))
    10.34
    """
    de, pr = np.broadcast_arrays(np.asarray(dean, float), np.asarray(prandtl, float))
    guard_range("nusselt_manlapaz_churchill", extrapolate, dean=de, prandtl=pr)
    # The first term in a form that stays finite at De = 0.
    mixing = de**2 * pr
    secondary = 4.343 * (mixing / (mixing + 957.0)) ** 2
    boundary_layer = 1.158 * (de * pr / (pr + 0.477)) ** 1.5
    return np.cbrt((3.657 + secondary) ** 3 + boundary_layer)


def nusselt_seban_mclaughlin(
    reynolds: ArrayLike, prandtl: ArrayLike, curvature_ratio: ArrayLike, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of laminar oil flow in a helical coil, measured.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
    prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 12 <= Re <= 5600, 100 <= Pr <= 657, 0.0096 <= D/D_c <= 0.059, round
    tubes with uniform heat flux; 0.13 is the mean over the circumference.

    Source: Seban & McLaughlin (1963), Int. J. Heat Mass Transfer 6, 387–395:
    Nu = 0.13 (f/8 Re² Pr)^(1/3), f the Darcy factor of the coil; as reviewed by
    Naphon & Wongwises (2006), Renew. Sustain. Energy Rev. 10, 463–490.

    >>> float(nusselt_seban_mclaughlin(652.0, 562.0, 0.04827).round(1))
    22.3
    """
    re, pr, delta = np.broadcast_arrays(
        np.asarray(reynolds, float), np.asarray(prandtl, float), np.asarray(curvature_ratio, float)
    )
    guard_range("nusselt_seban_mclaughlin", extrapolate, reynolds=re, prandtl=pr, curvature_ratio=delta)
    darcy = 64.0 / re * friction_factor_curved_laminar(re * np.sqrt(delta), extrapolate=True)
    return 0.13 * np.cbrt(darcy / 8.0 * re**2 * pr)


def nusselt_janssen_hoogendoorn(
    reynolds: ArrayLike, prandtl: ArrayLike, curvature_ratio: ArrayLike, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of developed laminar flow in a helical coil, measured.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
    prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 100 <= De <= 830, 20 <= Pr <= 450, 0.01 <= D/D_c <= 0.083, round tubes.

    Source: Janssen & Hoogendoorn (1978), Int. J. Heat Mass Transfer 21,
    1197–1206; as reviewed by Naphon & Wongwises (2006).

    >>> float(nusselt_janssen_hoogendoorn(1000.0, 300.0, 0.048).round(1))
    28.6
    """
    re, pr, delta = np.broadcast_arrays(
        np.asarray(reynolds, float), np.asarray(prandtl, float), np.asarray(curvature_ratio, float)
    )
    guard_range(
        "nusselt_janssen_hoogendoorn",
        extrapolate,
        dean=re * np.sqrt(delta),
        prandtl=pr,
        curvature_ratio=delta,
    )
    return 0.7 * re**0.43 * pr ** (1.0 / 6.0) * delta**0.07


def nusselt_dravid(dean: ArrayLike, prandtl: ArrayLike, *, extrapolate: bool = False) -> NDArray[np.float64]:
    """Nusselt number of developed laminar flow in a helical coil, computed and measured.

    Parameters
    ----------
    dean : (n,) array_like, [-]
        Re √(D_h/D_c).
    prandtl : (n,) array_like, [-]
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 50 <= De <= 2000, 5 <= Pr <= 175, round tubes with uniform heat flux.

    Source: Dravid, Smith, Merrill & Brian (1971), AIChE J. 17, 1114–1122; as
    reviewed by Naphon & Wongwises (2006).

    >>> float(nusselt_dravid(100.0, 100.0).round(1))
    16.3
    """
    de, pr = np.broadcast_arrays(np.asarray(dean, float), np.asarray(prandtl, float))
    guard_range("nusselt_dravid", extrapolate, dean=de, prandtl=pr)
    return (0.76 + 0.65 * np.sqrt(de)) * pr**0.175


def nusselt_gnielinski_helical(
    reynolds: ArrayLike,
    prandtl: ArrayLike,
    curvature_ratio: ArrayLike,
    prandtl_ratio: ArrayLike = 1.0,
    *,
    extrapolate: bool = False,
) -> NDArray[np.float64]:
    """Nusselt number of developed turbulent flow in a helical coil.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
    prandtl : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter; 0 is a straight duct.
    prandtl_ratio : (n,) array_like, [-]
        Prandtl number at bulk over that at wall temperature.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 2.2e4 <= Re <= 1.5e5, 0.6 <= Pr <= 2000, D_h/D_c <= 0.2.

    Source: Gnielinski (1986), Proc. 8th Int. Heat Transfer Conf. 6, 2847–2854; VDI
    Heat Atlas, section G3: the straight-duct equation with the friction of the coil.

    >>> float(nusselt_gnielinski_helical(3.0e4, 100.0, 0.05).round(0))
    671.0
    """
    re, pr, delta, ratio = np.broadcast_arrays(
        np.asarray(reynolds, float),
        np.asarray(prandtl, float),
        np.asarray(curvature_ratio, float),
        np.asarray(prandtl_ratio, float),
    )
    guard_range("nusselt_gnielinski_helical", extrapolate, reynolds=re, prandtl=pr, curvature_ratio=delta)
    eighth = friction_factor_helical_turbulent(re, delta, extrapolate=True) / 8.0
    denominator = 1.0 + 12.7 * np.sqrt(eighth) * (np.cbrt(pr) ** 2 - 1.0)
    return eighth * re * pr / denominator * ratio**0.14
