"""Choice of the film coefficient: regime, correlation, value with low and high."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import OutOfValidityError, did_you_mean
from spindle_fem.physics.coolant import nusselt
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.helical_band import OIL_BLEND_PRANDTL, FlowGroups, helical_band, is_covered
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.transition import (
    TURBULENT_FROM_REYNOLDS,
    critical_reynolds_ito,
    critical_reynolds_schmidt,
)
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
        ``laminar``, ``transition`` or ``turbulent`` flow in the coil; with the
        model ``paper`` what the paper takes it for.
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


def select_film(model: str, section: ChannelSection, state: ChannelState) -> FilmCoefficient:
    """Film coefficient of a helical rectangular channel by a named model.

    ``helical``
        Laminar: for oil (Pr above 100) the geometric mean of the two sets of
        measurements with viscous liquids in coils, Seban & McLaughlin and
        Janssen & Hoogendoorn; below Pr 30 the theory of Manlapaz & Churchill;
        blended between on log Pr. Never below the developing flow of a straight
        rectangle (Shah–London with Hausen), which curvature can only improve.
        Low and high: the lowest and highest of these, Schmidt, Sieder–Tate and
        Dravid where they apply. Turbulent: Gnielinski; low is the straight
        duct, high the scatter of the data (15 %). Between the critical
        Reynolds number (Schmidt) and 2.2e4 linear.
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

    Source: the correlations in ``coolant.nusselt`` and ``coolant.nusselt_helical``.

    >>> from spindle_fem.physics.coolant.properties import OilIsoVg32
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
    band = helical_band(section, flow)
    conductance = flow.conductance

    regime = np.where(
        flow.reynolds <= flow.critical,
        "laminar",
        np.where(flow.reynolds < TURBULENT_FROM_REYNOLDS, "transition", "turbulent"),
    )
    if model == "helical":
        value, in_range, faults = band.value * conductance, band.in_range, band.faults
        source = _helical_source(flow)
    elif model == "sieder_tate":
        value, in_range, faults = _sieder_tate(flow)
        value = value * conductance
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


def _flow_groups(section: ChannelSection, state: ChannelState) -> FlowGroups:
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
    return FlowGroups(
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


def _sieder_tate(flow: FlowGroups) -> tuple[NDArray[np.float64], NDArray[np.bool_], tuple[str, ...]]:
    value = nusselt.nusselt_sieder_tate(flow.graetz, flow.viscosity_ratio, extrapolate=True)
    faults = nusselt.range_faults("nusselt_sieder_tate", graetz=flow.graetz)
    in_range = is_covered("nusselt_sieder_tate", graetz=flow.graetz) & (flow.reynolds <= flow.critical)
    not_laminar = range_fault("laminar Reynolds number", flow.reynolds, 0.0, flow.critical)
    return value, in_range, faults + ((not_laminar,) if not_laminar else ())


def _paper(
    section: ChannelSection, flow: FlowGroups
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
        is_covered("nusselt_paper_turbulent", reynolds=reynolds, prandtl=flow.prandtl),
        is_covered("nusselt_sieder_tate", graetz=graetz),
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


def _helical_source(flow: FlowGroups) -> str:
    names = []
    if (flow.reynolds < TURBULENT_FROM_REYNOLDS).any():
        if (flow.prandtl > OIL_BLEND_PRANDTL[0]).any():
            names.append("Seban & McLaughlin 1963 with Janssen & Hoogendoorn 1978")
        if (flow.prandtl < OIL_BLEND_PRANDTL[1]).any():
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
