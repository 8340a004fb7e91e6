"""Choice of the film coefficient: regime, correlation, value with low and high."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.coolant import nusselt
from spindle_fem.coolant.properties import Coolant
from spindle_fem.coolant.section import ChannelSection
from spindle_fem.coolant.transition import (
    TURBULENT_FROM_REYNOLDS,
    critical_reynolds_ito,
    critical_reynolds_schmidt,
    transition_weight,
)
from spindle_fem.errors import OutOfValidityError, did_you_mean
from spindle_fem.validity import POSITIVE, CodedWarning, range_fault, require_range

__all__ = [
    "FILM_MODELS",
    "ChannelState",
    "FilmCoefficient",
    "critical_reynolds_ito",
    "critical_reynolds_schmidt",
    "select_film",
]

FILM_MODELS = ("helical", "paper", "sieder_tate")

# Where the paper switches from equation 31 to equation 30, on the channel depth.
PAPER_CRITICAL_REYNOLDS = 2300.0

# Low and high move away from the value by this factor when its source is extrapolated.
EXTRAPOLATION_WIDENING = 1.25

# Scatter of the measurements behind Gnielinski's equation.
_TURBULENT_SCATTER = 1.15

# Below the first Prandtl number theory, above the second measurements with oil.
_OIL_BLEND_PRANDTL = (30.0, 100.0)


@dataclass(frozen=True, slots=True)
class ChannelState:
    """What flows through a channel and at which temperatures.

    Attributes
    ----------
    coolant : Coolant
    volume_flow : float, [m³/s]
        Total, all starts, at bulk temperature.
    bulk_temperature : (n,) array_like or float, [K]
    wall_temperature : (n,) array_like, float or None, [K]
        None leaves the correction for the viscosity at the wall out.
    """

    coolant: Coolant
    volume_flow: float
    bulk_temperature: ArrayLike
    wall_temperature: ArrayLike | None = None


@dataclass(frozen=True, slots=True)
class FilmCoefficient:
    """Film coefficient of a channel; floats for a scalar state, else arrays.

    Attributes
    ----------
    value, low, high : float or (n,) ndarray, [W/(m²·K)]
        What the model answers, and the spread of what the applicable
        correlations for helical channels answer (it always contains the value).
    regime : str or (n,) ndarray of str
        ``laminar``, ``transition`` or ``turbulent``.
    source : str
        Correlations behind the value.
    in_range : bool or (n,) ndarray of bool
        Whether the value's source was used inside its range.
    warnings : tuple of CodedWarning
    reynolds : float or (n,) ndarray, [-]
        On the hydraulic diameter.
    prandtl : float or (n,) ndarray, [-]
    critical_reynolds : float, [-]
    candidates : mapping of str to float or (n,) ndarray, [W/(m²·K)]
        Every correlation that was looked at, for the regime it belongs to.
    """

    value: Any
    low: Any
    high: Any
    regime: Any
    source: str
    in_range: Any
    warnings: tuple[CodedWarning, ...]
    reynolds: Any
    prandtl: Any
    critical_reynolds: float
    candidates: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Flow:
    """Dimensionless groups of a state, all of one shape."""

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
class _Band:
    """Nusselt numbers of the helical set on the hydraulic diameter."""

    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    faults: tuple[str, ...]
    in_range: NDArray[np.bool_]
    candidates: dict[str, NDArray[np.float64]]


def select_film(model: str, section: ChannelSection, state: ChannelState) -> FilmCoefficient:
    """Film coefficient of a helical rectangular channel by a named model.

    ``helical``
        Laminar: for oil (Pr above 100) Seban & McLaughlin, who measured oil in
        coils; below Pr 30 Manlapaz & Churchill; blended between on log Pr.
        Never below the developing flow of a straight rectangle (Shah–London
        with Hausen), which curvature can only improve. Low and high: the
        lowest and highest of Manlapaz–Churchill, Schmidt, Sieder–Tate,
        Seban–McLaughlin and Janssen–Hoogendoorn. Turbulent: Gnielinski;
        low is the straight duct, high the scatter of the data (15 %).
        Between the critical Reynolds number (Schmidt) and 2.2e4 linear.
    ``paper``
        Equation 31, from Re 2300 on the channel depth equation 30, as the paper
        prints them: channel depth as length, no wall correction, a jump.
    ``sieder_tate``
        1.86 (k/D_h)(Re Pr D_h/L)^(1/3) on the hydraulic diameter, times
        (η/η_wall)^0.14 when a wall temperature is given.

    Parameters
    ----------
    model : {"helical", "paper", "sieder_tate"}
    section : ChannelSection
    state : ChannelState

    Returns
    -------
    FilmCoefficient

    Raises
    ------
    OutOfValidityError
        Unknown model, no flow, a bulk temperature outside the coolant's range.

    Range: what leaves a source's range is answered, marked ``in_range`` false,
    widened in ``low`` and ``high`` and said in ``warnings``.

    Source: the correlations in ``coolant.nusselt``.

    >>> from spindle_fem.coolant.properties import OilIsoVg32
    >>> channel = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    >>> state = ChannelState(OilIsoVg32(), 20.0e-3 / 60.0, 288.15)
    >>> film = select_film("sieder_tate", channel, state)
    >>> round(film.value, 1), film.regime, round(film.reynolds)
    (243.2, 'laminar', 292)
    """
    if model not in FILM_MODELS:
        raise OutOfValidityError(
            "coolant film model", f'"{model}" is not known.', did_you_mean(model, FILM_MODELS)
        )
    flow = _flow_groups(section, state)
    band = _helical_band(section, flow)
    conductance = flow.conductance

    if model == "helical":
        value, in_range, faults = band.value * conductance, band.in_range, band.faults
        regime = np.where(
            flow.reynolds <= flow.critical,
            "laminar",
            np.where(flow.reynolds < TURBULENT_FROM_REYNOLDS, "transition", "turbulent"),
        )
        source = _helical_source(flow)
    elif model == "sieder_tate":
        value, in_range, faults = _sieder_tate(flow)
        value = value * conductance
        regime = np.full(value.shape, "laminar")
        source = "Sieder & Tate 1936"
    else:
        value, in_range, faults, regime = _paper(section, flow)
        source = "Wu & Tan 2016, equations 30 and 31"

    # An extrapolated value is surrounded by more doubt than the correlations differ.
    widening = np.where(in_range, 1.0, EXTRAPOLATION_WIDENING)
    low = np.minimum(band.low * conductance, value / widening)
    high = np.maximum(band.high * conductance, value * widening)
    candidates = {name: _unwrap(number * conductance) for name, number in band.candidates.items()}
    return FilmCoefficient(
        value=_unwrap(value),
        low=_unwrap(low),
        high=_unwrap(high),
        regime=_unwrap(regime),
        source=source,
        in_range=_unwrap(in_range),
        warnings=flow.warnings + _film_warnings(model, source, faults),
        reynolds=_unwrap(flow.reynolds),
        prandtl=_unwrap(flow.prandtl),
        critical_reynolds=flow.critical,
        candidates=candidates,
    )


def _unwrap(array: NDArray[Any]) -> Any:
    if array.ndim:
        array = np.array(array)
        array.flags.writeable = False
        return array
    return array.item()


def _flow_groups(section: ChannelSection, state: ChannelState) -> _Flow:
    require_range(
        "select_film",
        volume_flow=(state.volume_flow, *POSITIVE),
        how_to_fix="Set coolant.flow above 0, or use a machine without a channel.",
    )
    bulk = np.asarray(state.bulk_temperature, dtype=np.float64)
    warnings = state.coolant.temperature_warnings(bulk)
    wall = bulk
    if state.wall_temperature is not None:
        bulk, wall = np.broadcast_arrays(bulk, np.asarray(state.wall_temperature, dtype=np.float64))
        wall, wall_warnings = _wall_in_range(wall, state.coolant)
        warnings += wall_warnings
    at_bulk = state.coolant.properties(bulk)
    at_wall = state.coolant.properties(wall)
    velocity = section.velocity(state.volume_flow)
    diameter = section.hydraulic_diameter
    reynolds = velocity * diameter / at_bulk.kinematic_viscosity
    prandtl = at_bulk.prandtl
    delta = section.curvature_ratio
    return _Flow(
        reynolds=reynolds,
        prandtl=prandtl,
        graetz=reynolds * prandtl * diameter / section.length,
        viscosity_ratio=at_bulk.dynamic_viscosity / at_wall.dynamic_viscosity,
        prandtl_ratio=prandtl / at_wall.prandtl,
        conductance=at_bulk.thermal_conductivity / diameter,
        delta=delta,
        critical=float(critical_reynolds_schmidt(delta)),
        warnings=warnings,
    )


def _wall_in_range(
    wall: NDArray[np.float64], coolant: Coolant
) -> tuple[NDArray[np.float64], tuple[CodedWarning, ...]]:
    """Wall temperature for the (weak) wall correction, said when it is cut."""
    lowest, highest = coolant.lowest_temperature, coolant.highest_temperature
    fault = range_fault("wall temperature in K", wall, lowest, highest)
    if not fault:
        return wall, ()
    text = f"Coolant {coolant.name}: {fault}; the wall viscosity is taken at the end of the range."
    return np.clip(wall, lowest, highest), (CodedWarning("coolant_wall_temperature_out_of_range", text),)


def _laminar_band(section: ChannelSection, flow: _Flow, reynolds: NDArray[np.float64]) -> _Band:
    """Laminar Nusselt numbers at a Reynolds number that may differ from the flow's."""
    prandtl, delta = flow.prandtl, flow.delta
    dean = reynolds * np.sqrt(delta)
    graetz = flow.graetz * reynolds / flow.reynolds
    floor = nusselt.nusselt_hausen(graetz, nusselt.nusselt_rectangle(section.aspect_ratio))
    candidates = {
        "straight_developing": floor,
        "sieder_tate": nusselt.nusselt_sieder_tate(graetz, flow.viscosity_ratio, extrapolate=True),
        "manlapaz_churchill": nusselt.nusselt_manlapaz_churchill(dean, prandtl),
        "schmidt": nusselt.nusselt_schmidt(reynolds, prandtl, delta, flow.viscosity_ratio, extrapolate=True),
        "seban_mclaughlin": nusselt.nusselt_seban_mclaughlin(reynolds, prandtl, delta, extrapolate=True),
        "janssen_hoogendoorn": nusselt.nusselt_janssen_hoogendoorn(
            reynolds, prandtl, delta, extrapolate=True
        ),
    }
    oil_from, oil_to = np.log(_OIL_BLEND_PRANDTL)
    oil = np.clip((np.log(prandtl) - oil_from) / (oil_to - oil_from), 0.0, 1.0)
    developed = candidates["manlapaz_churchill"] ** (1.0 - oil) * candidates["seban_mclaughlin"] ** oil
    value = np.maximum(developed, floor)

    # Correlations from round-tube experiments count only where their source covers the state;
    # Schmidt and Manlapaz-Churchill carry no upper Prandtl number and always count.
    applicable = [floor, value, np.maximum(candidates["manlapaz_churchill"], floor)]
    applicable.append(np.maximum(candidates["schmidt"], floor))
    for name, quantities in (
        ("sieder_tate", {"graetz": graetz}),
        ("seban_mclaughlin", {"reynolds": reynolds, "prandtl": prandtl, "curvature_ratio": delta}),
        ("janssen_hoogendoorn", {"dean": dean, "prandtl": prandtl, "curvature_ratio": delta}),
    ):
        covered = _covered(f"nusselt_{name}", **quantities)
        applicable.append(np.where(covered, np.maximum(candidates[name], floor), value))

    uses_oil = oil > 0.0
    shapes = {"reynolds": reynolds, "prandtl": np.maximum(prandtl, 100.0), "curvature_ratio": delta}
    covered = ~uses_oil | _covered("nusselt_seban_mclaughlin", **shapes) | (floor >= developed)
    faults: tuple[str, ...] = ()
    if not covered.all():
        faults = tuple(
            f"Seban & McLaughlin: {text}"
            for text in nusselt.range_faults("nusselt_seban_mclaughlin", **shapes)
        )
    return _Band(
        value=value,
        low=np.minimum.reduce(np.broadcast_arrays(*applicable)),
        high=np.maximum.reduce(np.broadcast_arrays(*applicable)),
        faults=faults,
        in_range=covered,
        candidates=candidates,
    )


def _turbulent_band(flow: _Flow, reynolds: NDArray[np.float64]) -> _Band:
    prandtl, delta = flow.prandtl, flow.delta
    value = nusselt.nusselt_gnielinski_helical(reynolds, prandtl, delta, flow.prandtl_ratio, extrapolate=True)
    straight = nusselt.nusselt_gnielinski_helical(
        reynolds, prandtl, 0.0, flow.prandtl_ratio, extrapolate=True
    )
    ranges = {"reynolds": reynolds, "prandtl": prandtl, "curvature_ratio": delta}
    faults = nusselt.range_faults("nusselt_gnielinski_helical", **ranges)
    return _Band(
        value=value,
        low=np.minimum(straight, value / _TURBULENT_SCATTER),
        high=value * _TURBULENT_SCATTER,
        faults=tuple(f"Gnielinski: {text}" for text in faults),
        in_range=_covered("nusselt_gnielinski_helical", **ranges),
        candidates={"gnielinski_helical": value, "gnielinski_straight": straight},
    )


def _helical_band(section: ChannelSection, flow: _Flow) -> _Band:
    """Laminar and turbulent bands joined by the same linear weight: no jump anywhere."""
    weight = transition_weight(flow.reynolds, flow.critical)
    has_laminar, has_turbulent = bool((weight > 0.0).any()), bool((weight < 1.0).any())
    bands: list[tuple[NDArray[np.float64], _Band]] = []
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
    return _Band(
        value=sum(share * band.value for share, band in bands),
        low=sum(share * band.low for share, band in bands),
        high=sum(share * band.high for share, band in bands),
        faults=faults,
        in_range=in_range,
        candidates=candidates,
    )


def _sieder_tate(flow: _Flow) -> tuple[NDArray[np.float64], NDArray[np.bool_], tuple[str, ...]]:
    value = nusselt.nusselt_sieder_tate(flow.graetz, flow.viscosity_ratio, extrapolate=True)
    faults = nusselt.range_faults("nusselt_sieder_tate", graetz=flow.graetz)
    in_range = _covered("nusselt_sieder_tate", graetz=flow.graetz) & (flow.reynolds <= flow.critical)
    not_laminar = range_fault("laminar Reynolds number", flow.reynolds, 0.0, flow.critical)
    return value, in_range, faults + ((not_laminar,) if not_laminar else ())


def _paper(
    section: ChannelSection, flow: _Flow
) -> tuple[NDArray[np.float64], NDArray[np.bool_], tuple[str, ...], NDArray[np.str_]]:
    """Equations 30 and 31 on the channel depth, in W/(m²·K)."""
    scale = section.depth / section.hydraulic_diameter
    reynolds = flow.reynolds * scale
    turbulent = reynolds > PAPER_CRITICAL_REYNOLDS
    graetz = reynolds * flow.prandtl * section.depth / section.length
    number = np.where(
        turbulent,
        nusselt.nusselt_paper_turbulent(reynolds, flow.prandtl, extrapolate=True),
        nusselt.nusselt_sieder_tate(graetz, extrapolate=True),
    )
    in_range = np.where(
        turbulent,
        _covered("nusselt_paper_turbulent", reynolds=reynolds, prandtl=flow.prandtl),
        _covered("nusselt_sieder_tate", graetz=graetz),
    )
    faults: tuple[str, ...] = ()
    if turbulent.any():
        faults += nusselt.range_faults(
            "nusselt_paper_turbulent", reynolds=reynolds[turbulent], prandtl=flow.prandtl[turbulent]
        )
        if (flow.reynolds[turbulent] <= flow.critical).any():
            in_range = in_range & ~(turbulent & (flow.reynolds <= flow.critical))
            faults += (f"a coil stays laminar up to Re {flow.critical:.0f} on the hydraulic diameter",)
    if not turbulent.all():
        faults += nusselt.range_faults("nusselt_sieder_tate", graetz=graetz[~turbulent])
    regime = np.where(turbulent, "turbulent", "laminar")
    return number / scale * flow.conductance, in_range, faults, regime


def _covered(correlation: str, **quantities: ArrayLike) -> NDArray[np.bool_]:
    inside = [
        (np.asarray(value) >= low) & (np.asarray(value) <= high)
        for name, value in quantities.items()
        for low, high in [nusselt.RANGES[correlation][name]]
    ]
    return np.logical_and.reduce(np.broadcast_arrays(*inside))


def _helical_source(flow: _Flow) -> str:
    names = []
    if (flow.reynolds < TURBULENT_FROM_REYNOLDS).any():
        if (flow.prandtl > _OIL_BLEND_PRANDTL[0]).any():
            names.append("Seban & McLaughlin 1963")
        if (flow.prandtl < _OIL_BLEND_PRANDTL[1]).any():
            names.append("Manlapaz & Churchill 1981")
        names.append("not below Shah & London 1978 with Hausen 1943")
    if (flow.reynolds > flow.critical).any():
        names.append("Gnielinski 1986")
    return "; ".join(names)


def _film_warnings(model: str, source: str, faults: tuple[str, ...]) -> tuple[CodedWarning, ...]:
    if not faults:
        return ()
    text = f'Film model "{model}" ({source}) is extrapolated: {"; ".join(faults)}. Low and high are widened.'
    return (CodedWarning("coolant_film_extrapolated", text),)
