"""Choice of the film coefficient: regime, correlation, value with low and high."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.film_correlation import FlowGroups, NusseltCorrelation
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.helical_band import helical_band
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

# Low and high move away from the value by this factor when its source is extrapolated.
EXTRAPOLATION_WIDENING = 1.25


@dataclass(frozen=True, slots=True)
class ChannelState:
    """Flow through a channel and its temperatures.

    Attributes
    ----------
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
        Result of the model, and the spread of the applicable
        correlations for helical channels (it always contains the value).
    regime : str or (n,) ndarray of str
        ``laminar``, ``transition`` or ``turbulent`` flow in the coil; with the
        model ``paper`` what the paper takes it for.
    source : str
        Correlations behind the value.
    in_range : bool or (n,) ndarray of bool
        Whether the value's source was used inside its range.
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


def select_film(
    model: str, section: ChannelSection, state: ChannelState, *, bounds: bool = True
) -> FilmCoefficient:
    """Film coefficient of a helical rectangular channel by a named model.

    Parameters
    ----------
    model : str
        One of ``FILM_MODELS``: ``helical``, ``paper``, or a correlation alone
        such as ``sieder_tate``.
    bounds : bool
        Whether low, high and candidates, most of the work, are wanted: without them both are the value.

    Raises
    ------
    OutOfValidityError
        Unknown model, no flow, a bulk temperature outside the coolant's range.

    Range: values outside a source's range are returned, marked ``in_range`` false,
    widened in ``low`` and ``high`` and reported in ``warnings``.

    Source: that of the model, in ``coolant.film_models``.

    >>> from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
    >>> channel = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    >>> state = ChannelState(OilIsoVg32(), 20.0e-3 / 60.0, 288.15)
    >>> film = select_film("sieder_tate", channel, state)
    >>> round(film.value, 1), film.regime, round(film.reynolds)
    (243.2, 'laminar', 292)
    """
    chosen = FILM_MODELS[model]
    flow, conductance, warnings = _flow_groups(section, state)
    band = helical_band(flow, bounds=bounds)
    answer = chosen.model(flow, band) if isinstance(chosen, NusseltCorrelation) else chosen(flow, band)
    value, in_range = answer.nusselt * conductance, answer.in_range
    regime = answer.regime
    if regime is None:
        turbulent = np.where(flow.reynolds < TURBULENT_FROM_REYNOLDS, "transition", "turbulent")
        regime = np.where(flow.reynolds <= flow.critical_reynolds, "laminar", turbulent)

    # An extrapolated value is surrounded by more doubt than the correlations differ.
    widening = np.where(in_range, 1.0, EXTRAPOLATION_WIDENING)
    low = np.minimum(band.low * conductance, value / widening) if bounds else value
    high = np.maximum(band.high * conductance, value * widening) if bounds else value
    candidates = {name: _unwrap(number * conductance) for name, number in band.candidates.items()}
    return FilmCoefficient(
        value=_unwrap(value),
        low=_unwrap(low),
        high=_unwrap(high),
        regime=_unwrap(regime),
        source=answer.source,
        in_range=_unwrap(in_range),
        warnings=warnings + _film_warnings(model, answer.source, answer.faults),
        reynolds=_unwrap(flow.reynolds),
        prandtl=_unwrap(flow.prandtl),
        critical_reynolds=flow.critical_reynolds,
        candidates=candidates,
    )


def _unwrap(array: NDArray[Any]) -> Any:
    if array.ndim:
        array = np.array(array)
        array.flags.writeable = False
        return array
    return array.item()


def _flow_groups(
    section: ChannelSection, state: ChannelState
) -> tuple[FlowGroups, NDArray[np.float64], tuple[CodedWarning, ...]]:
    """Groups of the flow, W/(m²·K) at Nusselt number 1, and what the coolant's properties warn of."""
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
    flow = FlowGroups(
        reynolds=reynolds,
        prandtl=prandtl,
        graetz=reynolds * prandtl * diameter / section.length,
        viscosity_ratio=at_bulk.dynamic_viscosity / at_wall.dynamic_viscosity,
        prandtl_ratio=prandtl / at_wall.prandtl,
        curvature_ratio=section.curvature_ratio,
        aspect_ratio=section.aspect_ratio,
        depth_ratio=section.depth / diameter,
        critical_reynolds=float(critical_reynolds_schmidt(section.curvature_ratio)),
    )
    return flow, at_bulk.thermal_conductivity / diameter, warnings


def _wall_in_range(
    wall: NDArray[np.float64], coolant: Coolant
) -> tuple[NDArray[np.float64], tuple[CodedWarning, ...]]:
    """Wall temperature for the (weak) wall correction, with a warning if it is clipped."""
    lowest, highest = coolant.lowest_temperature, coolant.highest_temperature
    fault = range_fault("wall temperature in K", wall, lowest, highest)
    if not fault:
        return wall, ()
    text = f"Coolant {coolant.name}: {fault}; the wall viscosity is taken at the end of the range."
    return np.clip(wall, lowest, highest), (CodedWarning("coolant_wall_temperature_out_of_range", text),)


def _film_warnings(model: str, source: str, faults: tuple[str, ...]) -> tuple[CodedWarning, ...]:
    if not faults:
        return ()
    text = f'Film model "{model}" ({source}) is extrapolated: {"; ".join(faults)}. Low and high are widened.'
    return (CodedWarning("coolant_film_extrapolated", text),)
