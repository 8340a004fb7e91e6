"""What the correlations for helical channels say together: value, low and high."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant import nusselt, nusselt_helical
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS, transition_weight
from spindle_fem.validity import CodedWarning

# Scatter of the measurements behind Gnielinski's equation.
_TURBULENT_SCATTER = 1.15

# Below the first Prandtl number theory, above the second measurements with oil and glycol.
OIL_BLEND_PRANDTL = (30.0, 100.0)


@dataclass(frozen=True, slots=True)
class FlowGroups:
    """Dimensionless groups of a state, all of one shape.

    Attributes
    ----------
    reynolds, prandtl, graetz : ndarray, [-]
        On the hydraulic diameter, at bulk temperature.
    viscosity_ratio, prandtl_ratio : ndarray, [-]
        Bulk over wall.
    conductance : ndarray, [W/(m²·K)]
        Thermal conductivity over hydraulic diameter: Nusselt number 1.
    delta : float, [-]
        Hydraulic over coil diameter.
    critical : float, [-]
        Reynolds number at which laminar flow ends.
    warnings : tuple of CodedWarning
    """

    reynolds: NDArray[np.float64]
    prandtl: NDArray[np.float64]
    graetz: NDArray[np.float64]
    viscosity_ratio: NDArray[np.float64]
    prandtl_ratio: NDArray[np.float64]
    conductance: NDArray[np.float64]
    delta: float
    critical: float
    warnings: tuple[CodedWarning, ...]


@dataclass(frozen=True, slots=True)
class FilmBand:
    """Nusselt numbers of the helical set on the hydraulic diameter.

    Attributes
    ----------
    value, low, high : ndarray, [-]
    faults : tuple of str
        What leaves the range of the value's source.
    in_range : ndarray of bool
    candidates : dict of str to ndarray, [-]
    """

    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    faults: tuple[str, ...]
    in_range: NDArray[np.bool_]
    candidates: dict[str, NDArray[np.float64]]


def _laminar_band(section: ChannelSection, flow: FlowGroups, reynolds: NDArray[np.float64]) -> FilmBand:
    """Laminar Nusselt numbers at a Reynolds number that may differ from the flow's."""
    prandtl, delta = flow.prandtl, flow.delta
    dean = reynolds * np.sqrt(delta)
    graetz = flow.graetz * reynolds / flow.reynolds
    floor = nusselt.nusselt_hausen(graetz, nusselt.nusselt_rectangle(section.aspect_ratio))
    candidates = {
        "straight_developing": floor,
        "sieder_tate": nusselt.nusselt_sieder_tate(graetz, flow.viscosity_ratio, extrapolate=True),
        "manlapaz_churchill": nusselt_helical.nusselt_manlapaz_churchill(dean, prandtl),
        "schmidt": nusselt_helical.nusselt_schmidt(
            reynolds, prandtl, delta, flow.viscosity_ratio, extrapolate=True
        ),
        "seban_mclaughlin": nusselt_helical.nusselt_seban_mclaughlin(
            reynolds, prandtl, delta, extrapolate=True
        ),
        "dravid": nusselt_helical.nusselt_dravid(dean, prandtl, extrapolate=True),
        "janssen_hoogendoorn": nusselt_helical.nusselt_janssen_hoogendoorn(
            reynolds, prandtl, delta, extrapolate=True
        ),
    }
    measured = np.sqrt(candidates["seban_mclaughlin"] * candidates["janssen_hoogendoorn"])
    oil_from, oil_to = np.log(OIL_BLEND_PRANDTL)
    oil = np.clip((np.log(prandtl) - oil_from) / (oil_to - oil_from), 0.0, 1.0)
    developed = candidates["manlapaz_churchill"] ** (1.0 - oil) * measured**oil
    value = np.maximum(developed, floor)

    # Measured correlations count where their source covers the state; Schmidt and
    # Manlapaz-Churchill carry no upper Prandtl number and always count. None goes below the
    # straight duct, which curvature can only improve.
    groups = {
        "reynolds": reynolds,
        "dean": dean,
        "prandtl": prandtl,
        "curvature_ratio": delta,
        "graetz": graetz,
    }
    applicable = [floor, value]
    applicable += [np.maximum(candidates[name], floor) for name in ("manlapaz_churchill", "schmidt")]
    covered = {}
    for name in ("sieder_tate", "seban_mclaughlin", "janssen_hoogendoorn", "dravid"):
        ranged = {key: groups[key] for key in nusselt.RANGES[f"nusselt_{name}"] if key in groups}
        covered[name] = is_covered(f"nusselt_{name}", **ranged)
        applicable.append(np.where(covered[name], np.maximum(candidates[name], floor), value))

    # The oil measurements stand when one of the two covers the state; the theory of
    # Manlapaz and Churchill and the straight duct always do.
    in_range = (
        (oil == 0.0) | (floor >= developed) | covered["seban_mclaughlin"] | covered["janssen_hoogendoorn"]
    )
    faults: tuple[str, ...] = ()
    if not in_range.all():
        outside = {
            "reynolds": reynolds,
            "prandtl": prandtl,
            "curvature_ratio": np.broadcast_to(delta, in_range.shape),
        }
        outside = {key: array[~in_range] for key, array in outside.items()}
        texts = nusselt.range_faults("nusselt_seban_mclaughlin", **outside)
        faults = tuple(f"Seban & McLaughlin: {text}" for text in texts)
    return FilmBand(
        value=value,
        low=np.minimum.reduce(np.broadcast_arrays(*applicable)),
        high=np.maximum.reduce(np.broadcast_arrays(*applicable)),
        faults=faults,
        in_range=in_range,
        candidates=candidates,
    )


def _turbulent_band(flow: FlowGroups, reynolds: NDArray[np.float64]) -> FilmBand:
    prandtl, delta = flow.prandtl, flow.delta
    value = nusselt_helical.nusselt_gnielinski_helical(
        reynolds, prandtl, delta, flow.prandtl_ratio, extrapolate=True
    )
    straight = nusselt_helical.nusselt_gnielinski_helical(
        reynolds, prandtl, 0.0, flow.prandtl_ratio, extrapolate=True
    )
    ranges = {"reynolds": reynolds, "prandtl": prandtl, "curvature_ratio": delta}
    faults = nusselt.range_faults("nusselt_gnielinski_helical", **ranges)
    return FilmBand(
        value=value,
        low=np.minimum(straight, value / _TURBULENT_SCATTER),
        high=value * _TURBULENT_SCATTER,
        faults=tuple(f"Gnielinski: {text}" for text in faults),
        in_range=is_covered("nusselt_gnielinski_helical", **ranges),
        candidates={"gnielinski_helical": value, "gnielinski_straight": straight},
    )


def helical_band(section: ChannelSection, flow: FlowGroups) -> FilmBand:
    """Laminar and turbulent bands joined by the same linear weight: no jump anywhere."""
    weight = transition_weight(flow.reynolds, flow.critical)
    has_laminar, has_turbulent = bool((weight > 0.0).any()), bool((weight < 1.0).any())
    bands: list[tuple[NDArray[np.float64], FilmBand]] = []
    if has_laminar:
        bands.append((weight, _laminar_band(section, flow, np.minimum(flow.reynolds, flow.critical))))
    if has_turbulent:
        upper = np.maximum(flow.reynolds, TURBULENT_FROM_REYNOLDS)
        bands.append((1.0 - weight, _turbulent_band(flow, upper)))
    in_range = np.ones(weight.shape, dtype=bool)
    candidates: dict[str, NDArray[np.float64]] = {}
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


def is_covered(correlation: str, **quantities: ArrayLike) -> NDArray[np.bool_]:
    """Whether each value lies inside the ranges of a correlation, element by element.

    >>> is_covered("nusselt_sieder_tate", graetz=[5.0, 50.0]).tolist()
    [False, True]
    """
    inside = [
        (np.asarray(value) >= low) & (np.asarray(value) <= high)
        for name, value in quantities.items()
        for low, high in [nusselt.RANGES[correlation][name]]
    ]
    return np.logical_and.reduce(np.broadcast_arrays(*inside))
