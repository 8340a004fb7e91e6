"""Combine the correlations for helical channels: value, low and high."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spindle_fem.correlation import Array
from spindle_fem.physics.coolant.film_correlation import FilmBand, FlowGroups, NusseltCorrelation, Regime
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.film_models.gnielinski_helical import nusselt_gnielinski_helical
from spindle_fem.physics.coolant.film_models.janssen_hoogendoorn import nusselt_janssen_hoogendoorn
from spindle_fem.physics.coolant.film_models.manlapaz_churchill import nusselt_manlapaz_churchill
from spindle_fem.physics.coolant.film_models.seban_mclaughlin import nusselt_seban_mclaughlin
from spindle_fem.physics.coolant.film_models.straight_developing import nusselt_straight_developing
from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS, transition_weight

# Scatter of the measurements behind Gnielinski's equation.
_TURBULENT_SCATTER = 1.15

# Below the first Prandtl number theory, above the second measurements with oil and glycol.
OIL_BLEND_PRANDTL = (30.0, 100.0)


def helical_band(flow: FlowGroups, *, bounds: bool = True) -> FilmBand:
    """Value, low and high of a helical channel, laminar and turbulent joined without a jump.

    Laminar: for oil (Pr above 100) the geometric mean of the two sets of
    measurements with viscous liquids in coils, Seban & McLaughlin and
    Janssen & Hoogendoorn; below Pr 30 the theory of Manlapaz & Churchill;
    blended between on log Pr. Never below the developing flow of a straight
    rectangle (Shah–London with Hausen), which curvature can only improve.
    Low and high: the lowest and highest of all laminar correlations whose source covers
    the state. Turbulent: Gnielinski; low is the straight duct, high the scatter of the data
    (15 %). Between the critical Reynolds number (Schmidt) and 2.2e4 linear.

    Parameters
    ----------
    bounds : bool
        Whether low, high and candidates are wanted; without them both are the value.
    """
    weight = transition_weight(flow.reynolds, flow.critical_reynolds)
    bands: list[tuple[Array, FilmBand]] = []
    if (weight > 0.0).any():
        laminar = np.minimum(flow.reynolds, flow.critical_reynolds)
        bands.append((weight, _laminar_band(flow.at_reynolds(laminar), bounds)))
    if (weight < 1.0).any():
        turbulent = np.maximum(flow.reynolds, TURBULENT_FROM_REYNOLDS)
        bands.append((1.0 - weight, _turbulent_band(flow.at_reynolds(turbulent), bounds)))
    in_range = np.ones(weight.shape, dtype=bool)
    candidates: dict[str, Array] = {}
    faults: tuple[str, ...] = ()
    for share, band in bands:
        in_range &= band.in_range | (share == 0.0)
        faults += band.faults
        candidates |= band.candidates
    return FilmBand(
        value=sum(share * band.value for share, band in bands),
        low=sum(share * band.low for share, band in bands),
        high=sum(share * band.high for share, band in bands),
        faults=faults,
        in_range=in_range,
        candidates=candidates,
    )


def _correlations(regime: Regime) -> Iterator[tuple[str, NusseltCorrelation]]:
    """Every correlation of a flow regime by name."""
    for name, model in FILM_MODELS.items():
        if isinstance(model, NusseltCorrelation) and model.regime == regime:
            yield name, model


def _laminar_band(flow: FlowGroups, bounds: bool) -> FilmBand:
    floor = nusselt_straight_developing.at(flow)
    theory = nusselt_manlapaz_churchill.at(flow)
    measured = np.sqrt(nusselt_seban_mclaughlin.at(flow) * nusselt_janssen_hoogendoorn.at(flow))
    oil_from, oil_to = np.log(OIL_BLEND_PRANDTL)
    oil = np.clip((np.log(flow.prandtl) - oil_from) / (oil_to - oil_from), 0.0, 1.0)
    developed = theory ** (1.0 - oil) * measured**oil
    value = np.maximum(developed, floor)

    # Measured correlations count where their source covers the state, those without an upper
    # Prandtl number always. None goes below the straight duct, which curvature can only improve.
    candidates: dict[str, Array] = {}
    applicable = [floor, value]
    for name, known in _correlations("laminar") if bounds else ():
        candidates[name] = known.at(flow)
        raised = np.maximum(candidates[name], floor)
        applicable.append(raised if known.counts else np.where(known.covers_flow(flow), raised, value))

    # The oil measurements hold when one of the two covers the state; the theory of
    # Manlapaz and Churchill and the straight duct always do.
    measured_covers = nusselt_seban_mclaughlin.covers_flow(flow) | nusselt_janssen_hoogendoorn.covers_flow(
        flow
    )
    in_range = (oil == 0.0) | (floor >= developed) | measured_covers
    faults: tuple[str, ...] = ()
    if not in_range.all():
        groups = flow.only(nusselt_seban_mclaughlin.quantities)
        outside = {name: np.broadcast_to(value, in_range.shape)[~in_range] for name, value in groups.items()}
        texts = nusselt_seban_mclaughlin.faults(**outside)
        faults = tuple(f"Seban & McLaughlin: {text}" for text in texts)
    return FilmBand(
        value=value,
        low=np.minimum.reduce(np.broadcast_arrays(*applicable)) if bounds else value,
        high=np.maximum.reduce(np.broadcast_arrays(*applicable)) if bounds else value,
        faults=faults,
        in_range=in_range,
        candidates=candidates,
    )


def _turbulent_band(flow: FlowGroups, bounds: bool) -> FilmBand:
    value = nusselt_gnielinski_helical.at(flow)
    candidates: dict[str, Array] = {}
    low = high = value
    if bounds:
        straight = nusselt_gnielinski_helical(
            flow.reynolds, flow.prandtl, 0.0, flow.prandtl_ratio, extrapolate=True
        )
        candidates["gnielinski_straight"] = straight
        low, high = np.minimum(straight, value / _TURBULENT_SCATTER), value * _TURBULENT_SCATTER
        for name, known in _correlations("turbulent"):
            candidates[name] = known.at(flow)
            applicable = np.where(known.covers_flow(flow), candidates[name], value)
            low, high = np.minimum(low, applicable), np.maximum(high, applicable)
    faults = nusselt_gnielinski_helical.faults(**flow.only(("reynolds", "prandtl", "curvature_ratio")))
    return FilmBand(
        value=value,
        low=low,
        high=high,
        faults=tuple(f"Gnielinski: {text}" for text in faults),
        in_range=nusselt_gnielinski_helical.covers_flow(flow),
        candidates=candidates,
    )
