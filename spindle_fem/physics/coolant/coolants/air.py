"""Dry air at 1.013 bar, for purge air."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.units import ZERO_CELSIUS_K


class Air(Coolant):
    """Dry air at 1.013 bar, an ideal gas of constant heat capacity.

    Range: -20–120 °C.

    Source: U.S. Standard Atmosphere (1976): viscosity and conductivity; gas constant 287.05 J/(kg·K).

    >>> at_20 = Air().properties(293.15)
    >>> round(float(at_20.density), 3), round(float(at_20.prandtl), 3)
    (1.204, 0.709)
    """

    name = "air"
    source = "U.S. Standard Atmosphere 1976"
    lowest_temperature = ZERO_CELSIUS_K - 20.0
    highest_temperature = ZERO_CELSIUS_K + 120.0
    lowest_accurate_temperature = lowest_temperature
    highest_accurate_temperature = highest_temperature

    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 101325.0 / (287.05 * temperature)

    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 1.458e-6 * temperature**1.5 / (temperature + 110.4)

    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full_like(temperature, 1006.0)

    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 2.64638e-3 * temperature**1.5 / (temperature + 245.4 * 10.0 ** (-12.0 / temperature))

    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 1006.0 * (temperature - ZERO_CELSIUS_K)


COOLANTS.add(Air.name, Air())
