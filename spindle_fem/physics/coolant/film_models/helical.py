"""Measured and theoretical correlations for coils together, with a low and a high value."""

from __future__ import annotations

from spindle_fem.physics.coolant.film_correlation import FilmBand, FilmNumbers, FlowGroups
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.helical_band import OIL_BLEND_PRANDTL
from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS


@FILM_MODELS.register
def helical(flow: FlowGroups, band: FilmBand) -> FilmNumbers:
    """The value of the band; see :func:`spindle_fem.physics.coolant.helical_band.helical_band`."""
    names = []
    if (flow.reynolds < TURBULENT_FROM_REYNOLDS).any():
        if (flow.prandtl > OIL_BLEND_PRANDTL[0]).any():
            names.append("Seban & McLaughlin 1963 with Janssen & Hoogendoorn 1978")
        if (flow.prandtl < OIL_BLEND_PRANDTL[1]).any():
            names.append("Manlapaz & Churchill 1981")
        names.append("not below Shah & London 1978 with Hausen 1943")
    if (flow.reynolds > flow.critical_reynolds).any():
        names.append("Gnielinski 1986")
    return FilmNumbers(band.value, band.in_range, band.faults, "; ".join(names))
