"""Water with ethylene glycol: polynomials over temperature at one mass fraction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.units import ZERO_CELSIUS_K

SCALE = 20.0


class WaterGlycol(Coolant):
    """Pure water and ethylene glycol, without inhibitors; coefficients count in (T - 293.15 K) / 20 K.

    Fitted to the property functions of the source within 0.02 % (conductivity 0.05 %).

    Range: 0-40 °C.

    Source: Melinder (2010), Properties of Secondary Working Fluids for Indirect Systems, IIR.

    Parameters
    ----------
    density, specific_heat_capacity, thermal_conductivity : sequence of float
    logarithm_of_viscosity : sequence of float
        Of the dynamic viscosity in Pa·s.
    """

    source = "Melinder 2010"
    lowest_temperature = lowest_accurate_temperature = ZERO_CELSIUS_K
    highest_temperature = highest_accurate_temperature = 40.0 + ZERO_CELSIUS_K

    def __init__(
        self,
        name: str,
        *,
        density: Sequence[float],
        logarithm_of_viscosity: Sequence[float],
        specific_heat_capacity: Sequence[float],
        thermal_conductivity: Sequence[float],
    ) -> None:
        self.name = name
        self._fits = tuple(
            np.polynomial.Polynomial(item)
            for item in (density, logarithm_of_viscosity, specific_heat_capacity, thermal_conductivity)
        )
        self._enthalpy = SCALE * self._fits[2].integ(lbnd=-1.0)

    @staticmethod
    def _scaled(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return (temperature - ZERO_CELSIUS_K) / SCALE - 1.0

    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._fits[0](self._scaled(temperature))

    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.exp(self._fits[1](self._scaled(temperature)))

    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._fits[2](self._scaled(temperature))

    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._fits[3](self._scaled(temperature))

    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._enthalpy(self._scaled(temperature))
