"""Film coefficient over inlet temperature and channel depth: the paper's Figure 22 as data."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.validity import CodedWarning


@dataclass(frozen=True, slots=True)
class FilmMap:
    """Film coefficient against channel depth (rows) and bulk temperature (columns).

    Attributes
    ----------
    depth : (n_depths,) ndarray, [m]
    temperature : (n_temperatures,) ndarray, [K]
    value, low, high : (n_depths, n_temperatures) ndarray, [W/(m²·K)]
    reynolds : (n_depths, n_temperatures) ndarray, [-]
        On the hydraulic diameter.
    regime : (n_depths, n_temperatures) ndarray of str
    in_range : (n_depths, n_temperatures) ndarray of bool
    volume_flow : (n_depths,) ndarray, [m³/s]
    velocity : (n_depths,) ndarray, [m/s]
    warnings : tuple of CodedWarning
        Each distinct one once.
    """

    depth: NDArray[np.float64]
    temperature: NDArray[np.float64]
    value: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    reynolds: NDArray[np.float64]
    regime: NDArray[np.str_]
    in_range: NDArray[np.bool_]
    volume_flow: NDArray[np.float64]
    velocity: NDArray[np.float64]
    warnings: tuple[CodedWarning, ...]


def film_map(
    model: str,
    section: ChannelSection,
    coolant: Coolant,
    depths: ArrayLike,
    temperatures: ArrayLike,
    *,
    velocity: float | None = None,
    volume_flow: float | None = None,
) -> FilmMap:
    """Film coefficient over depth and temperature, at constant velocity or constant flow.

    The paper keeps the velocity constant without giving its value: a deeper channel
    then needs more flow. A cooler of given size keeps the flow constant.

    Parameters
    ----------
    model : str
        One of ``coolant.regimes.FILM_MODELS``.
    section : ChannelSection
        Everything but the depth is taken from it.
    depths : (n_depths,) array_like, [m]
    temperatures : (n_temperatures,) array_like, [K]
    velocity : float or None, [m/s]
    volume_flow : float or None, [m³/s]
        Total, all starts. Give exactly one of the two.

    Raises
    ------
    OutOfValidityError
        Neither or both given; a temperature outside the coolant's range.

    Source: Wu & Tan (2016), Adv. Mech. Eng. 8(8), Figure 22.

    >>> from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
    >>> channel = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    >>> chart = film_map("paper", channel, OilIsoVg32(), [0.010, 0.019], [288.15, 304.15], velocity=5.7)
    >>> chart.regime.tolist()
    [['laminar', 'laminar'], ['laminar', 'turbulent']]
    """
    if (velocity is None) == (volume_flow is None):
        raise OutOfValidityError(
            "film_map",
            f"velocity is {velocity} and volume_flow is {volume_flow}.",
            "Give exactly one of them.",
        )
    depth = np.atleast_1d(np.asarray(depths, dtype=np.float64))
    temperature = np.atleast_1d(np.asarray(temperatures, dtype=np.float64))
    sections = [replace(section, depth=float(value)) for value in depth]
    flows = np.array(
        [one.volume_flow(velocity) if velocity is not None else volume_flow for one in sections],
        dtype=np.float64,
    )
    films = [
        select_film(model, one, ChannelState(coolant, float(flow), temperature))
        for one, flow in zip(sections, flows, strict=True)
    ]
    speeds = [one.velocity(float(flow)) for one, flow in zip(sections, flows, strict=True)]
    return FilmMap(
        depth=depth,
        temperature=temperature,
        value=np.stack([film.value for film in films]),
        low=np.stack([film.low for film in films]),
        high=np.stack([film.high for film in films]),
        reynolds=np.stack([film.reynolds for film in films]),
        regime=np.stack([film.regime for film in films]),
        in_range=np.stack([film.in_range for film in films]),
        volume_flow=flows,
        velocity=np.array(speeds),
        warnings=tuple(dict.fromkeys(warning for film in films for warning in film.warnings)),
    )
