"""Oil of viscosity grade 32 and the film in the channel, temperatures in °C."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .machine import CHANNEL_HYDRAULIC_DIAMETER, CHANNEL_LENGTH, FLOW

_SECTION = 0.010 * 0.012


def oil_properties(temperature: ArrayLike) -> tuple[NDArray[np.float64], ...]:
    """Conductivity, density, dynamic viscosity and specific heat capacity in SI.

    Source: Wu and Tan (2016), equation 29.
    """
    t = np.asarray(temperature, dtype=float)
    conductivity = 0.1381 * (1.012 - 5.5018e-4 * t)
    density = 869.1 * (1.0 - 7.9744e-4 * (t - 21.0))
    viscosity = 0.06673 * np.exp(-0.051 * (t - 21.0))
    return conductivity, density, viscosity, 4.428 * (t - 21.0) + 1884.2


def channel_film(temperature: ArrayLike, flow_share: ArrayLike = 1.0) -> tuple[NDArray[np.float64], ...]:
    """Film coefficient, capacity flow and Reynolds number at an inlet temperature.

    >>> film, capacity, reynolds = channel_film(15.0)
    >>> round(float(film)), round(float(reynolds))
    (243, 292)
    """
    conductivity, density, viscosity, heat = oil_properties(temperature)
    flow = FLOW * np.asarray(flow_share, dtype=float)
    reynolds = density * flow / _SECTION * CHANNEL_HYDRAULIC_DIAMETER / viscosity
    graetz = reynolds * viscosity * heat / conductivity * CHANNEL_HYDRAULIC_DIAMETER / CHANNEL_LENGTH
    film = 1.86 * conductivity / CHANNEL_HYDRAULIC_DIAMETER * np.cbrt(graetz)
    return film, density * heat * flow, reynolds
