"""Equations 30 and 31 of Wu & Tan (2016) on the channel depth, with their jump at Re 2300."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.film_correlation import HOW_TO_FIX, FilmBand, FilmNumbers, FlowGroups
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.film_models.sieder_tate import nusselt_sieder_tate

# Where the paper switches from equation 31 to equation 30, on the channel depth.
PAPER_CRITICAL_REYNOLDS = 2300.0


@correlation(how_to_fix=HOW_TO_FIX, reynolds=(1.0e4, 1.2e5), prandtl=(0.7, 160.0))
def nusselt_paper_turbulent(reynolds: Array, prandtl: Array) -> Array:
    """Nusselt number of turbulent flow as the paper has it (its equation 30).

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the paper's length, the channel depth h_gap, like the answer.
    prandtl : (n,) array_like, [-]

    Range: straight pipe. Cooling oil has Pr 360–1500: the paper used it outside.

    Source: Wu & Tan (2016), Adv. Mech. Eng. 8(8), equation 30 and Table 1;
    form and range of Dittus & Boelter (1930).

    >>> float(nusselt_paper_turbulent(1.0e4, 100.0).round(1))
    142.0
    """
    return 0.0225 * reynolds**0.8 * prandtl**0.3


@FILM_MODELS.register
def paper(flow: FlowGroups, band: FilmBand) -> FilmNumbers:
    """Equation 31, from Re 2300 on equation 30: channel depth as length, no wall correction, a jump."""
    scale = flow.depth_ratio
    reynolds, graetz = flow.reynolds * scale, flow.graetz * scale**2
    turbulent = reynolds > PAPER_CRITICAL_REYNOLDS
    number = np.where(
        turbulent,
        nusselt_paper_turbulent(reynolds, flow.prandtl, extrapolate=True),
        nusselt_sieder_tate(graetz, extrapolate=True),
    )
    in_range = np.where(
        turbulent,
        nusselt_paper_turbulent.covers(reynolds=reynolds, prandtl=flow.prandtl),
        nusselt_sieder_tate.covers(graetz=graetz),
    )
    faults: tuple[str, ...] = ()
    if turbulent.any():
        faults += nusselt_paper_turbulent.faults(
            reynolds=reynolds[turbulent], prandtl=flow.prandtl[turbulent]
        )
        laminar_in_coil = turbulent & (flow.reynolds <= flow.critical_reynolds)
        if laminar_in_coil.any():
            in_range = in_range & ~laminar_in_coil
            faults += (
                f"a coil stays laminar up to Re {flow.critical_reynolds:.0f} on the hydraulic diameter",
            )
    if not turbulent.all():
        faults += nusselt_sieder_tate.faults(graetz=graetz[~turbulent])
    regime = np.where(turbulent, "turbulent", "laminar")
    return FilmNumbers(number / scale, in_range, faults, "Wu & Tan 2016, equations 30 and 31", regime)
