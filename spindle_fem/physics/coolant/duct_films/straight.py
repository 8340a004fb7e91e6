"""A still, smooth, straight duct in every regime, thermal entry included (Hausen; Gnielinski)."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.ducts import (
    LAMINAR_TO,
    TURBULENT_FROM,
    DuctFilm,
    DuctFlow,
    friction_factor_smooth,
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


@DUCT_FILMS.register
def straight(flow: DuctFlow) -> DuctFilm:
    """Hausen's laminar and Gnielinski's turbulent mean, linear in Re between 2300 and 4000.

    Without the viscosity at the wall, and without rotation, which stirs laminar and calms turbulent flow.
    """
    reynolds, prandtl = flow.reynolds, flow.prandtl
    turbulent_at = {
        "reynolds": max(reynolds, TURBULENT_FROM),
        "prandtl": prandtl,
        "slenderness": flow.slenderness,
    }
    graetz = min(reynolds, LAMINAR_TO) * prandtl / flow.slenderness
    laminar = float(nusselt_hausen(graetz, flow.section.laminar_nusselt))
    turbulent = float(nusselt_gnielinski_straight(**turbulent_at, extrapolate=True))
    share = flow.turbulent_share
    faults = nusselt_gnielinski_straight.faults(**turbulent_at) if share > 0.0 else ()
    return DuctFilm(laminar + share * (turbulent - laminar), "Hausen 1943; Gnielinski 2013", faults)
