"""A still, smooth, straight duct in every regime, thermal entry included (Hausen; Gnielinski)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.ducts import (
    LAMINAR_TO,
    TURBULENT_FROM,
    DuctFilm,
    DuctFlow,
    friction_factor_smooth,
    turbulent_share,
)
from spindle_fem.physics.coolant.film_models.straight_developing import nusselt_hausen


@correlation(
    how_to_fix="Let the duct choose by its regime.",
    reynolds=(4.0e3, 1.0e6),
    prandtl=(0.1, 1.0e3),
    slenderness=(1.0, np.inf),
)
def nusselt_gnielinski_straight(reynolds: Array, prandtl: Array, slenderness: Array) -> Array:
    """Mean Nusselt number of turbulent flow over the length of a straight smooth duct.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the hydraulic diameter.
    prandtl : (n,) array_like, [-]
    slenderness : (n,) array_like, [-]
        Length over hydraulic diameter.

    Source: Gnielinski (2013), Int. J. Heat Mass Transfer 63, 134–140.

    >>> float(nusselt_gnielinski_straight(1.0e4, 7.0, 100.0).round(1))
    82.0
    """
    eighth = friction_factor_smooth(reynolds, extrapolate=True) / 8.0
    long = eighth * (reynolds - 1.0e3) * prandtl
    long /= 1.0 + 12.7 * np.sqrt(eighth) * (np.cbrt(prandtl) ** 2 - 1.0)
    return long * (1.0 + slenderness ** (-2.0 / 3.0))


def nusselt_straight(
    reynolds: ArrayLike, prandtl: ArrayLike, slenderness: float, laminar_nusselt: float
) -> tuple[Array, tuple[str, ...]]:
    """Mean Nusselt number of a straight smooth duct in every regime, and violations of its range.

    Hausen's laminar and Gnielinski's turbulent mean, linear in Re between 2300 and 4000.

    Parameters
    ----------
    reynolds, prandtl : (n,) array_like, [-]
        Reynolds number on the hydraulic diameter.
    slenderness : float, [-]
        Length over hydraulic diameter.
    laminar_nusselt : float, [-]
        Developed, walls of one temperature.
    """
    reynolds, prandtl = np.broadcast_arrays(np.asarray(reynolds, float), np.asarray(prandtl, float))
    laminar = nusselt_hausen(np.minimum(reynolds, LAMINAR_TO) * prandtl / slenderness, laminar_nusselt)
    at = np.maximum(reynolds, TURBULENT_FROM)
    turbulent = nusselt_gnielinski_straight(at, prandtl, slenderness, extrapolate=True)
    share = turbulent_share(reynolds)
    faults: tuple[str, ...] = ()
    if (share > 0.0).any():
        faults = nusselt_gnielinski_straight.faults(
            reynolds=at[share > 0.0], prandtl=prandtl[share > 0.0], slenderness=slenderness
        )
    return laminar + share * (turbulent - laminar), faults


@DUCT_FILMS.register
def straight(flow: DuctFlow) -> DuctFilm:
    """Hausen's laminar and Gnielinski's turbulent mean, linear in Re between 2300 and 4000.

    Without the viscosity at the wall, and without rotation, which stirs laminar and calms turbulent flow.
    """
    nusselt, faults = nusselt_straight(
        flow.reynolds, flow.prandtl, flow.slenderness, flow.section.laminar_nusselt
    )
    return DuctFilm(float(nusselt), "Hausen 1943; Gnielinski 2013", faults)
